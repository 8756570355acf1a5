"""Pictures without the cue, made to be taken for it: decoys painted into rendered scenes, and what spoils pictures.

Every shape lies in a plane as the bar does, seen by a level camera, so that its gimbal never gives it away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from shipland.frames import Array
from studies.views import Setting, View, view_at

Picture = npt.NDArray[np.uint8]
Shape = list[Array]
"""Polygons (n,2) (right, down) [m] of one colour in a plane."""

GREEN_BGR = np.array([70.0, 245.0, 40.0])
"""The lit bar in daylight."""

_SAMPLES = 4


def rectangle(right_m: float, down_m: float, width_m: float, height_m: float) -> Array:
    """Corners (4,2) of an upright rectangle around a middle."""
    signs = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return np.array([right_m, down_m]) + signs * [width_m, height_m]


def bar(setting: Setting) -> Shape:
    """The cue itself."""
    return list(setting.plane_m)


@dataclass(frozen=True)
class Canvas:
    """A picture in the making, and the camera it is seen with."""

    picture: Picture
    setting: Setting
    view: View
    rng: np.random.Generator

    def paint(self, shape: Shape, colour: Array, *, board_m: float | None = 0.075, opacity: float = 1.0) -> None:
        """A shape in the plane of the bar, on a grey board that reaches `board_m` beyond it."""
        if board_m is not None:
            points = np.concatenate(shape)
            low, high = points.min(axis=0) - board_m, points.max(axis=0) + board_m
            board = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
            grey = np.full(3, self.rng.uniform(60.0, 160.0))
            self.fill([self.project(board)], grey, opacity)
        self.fill([self.project(polygon) for polygon in shape], colour, opacity)

    def project(self, plane_m: Array) -> Array:
        """Pixels (n,2) of points (right, down) (n,2) in the plane of the bar."""
        points = np.column_stack([np.zeros(len(plane_m)), plane_m])
        return self.setting.camera.project(self.view.bar_from_camera.inverse().apply(points))

    def fill(self, polygons_px: list[Array], colour: Array, opacity: float = 1.0) -> None:
        """Polygons by coverage; those that are not wholly in front of the camera are left out."""
        polygons_px = [polygon for polygon in polygons_px if np.isfinite(polygon).all()]
        if not polygons_px:
            return
        size = np.array(self.picture.shape[1::-1])
        points = np.concatenate(polygons_px)
        low = np.clip(np.floor(points.min(axis=0)) - 1, 0, size).astype(int)
        high = np.clip(np.ceil(points.max(axis=0)) + 2, 0, size).astype(int)
        across, down = (int(v) for v in high - low)
        if across <= 0 or down <= 0:
            return
        fine = np.zeros((down * _SAMPLES, across * _SAMPLES), np.uint8)
        for polygon in polygons_px:
            clipped = np.clip((polygon - low + 0.5) * _SAMPLES - 0.5, -30000.0, 30000.0)
            cv2.fillPoly(fine, [np.round(clipped * 16.0).astype(np.int32)], 255, cv2.LINE_8, 4)
        cover = cv2.resize(fine.astype(np.float32), (across, down), interpolation=cv2.INTER_AREA)[..., None]
        cover *= opacity / 255.0
        part = self.picture[low[1] : high[1], low[0] : high[0]]
        part[:] = np.clip(part * (1.0 - cover) + cover * colour + 0.5, 0, 255).astype(np.uint8)

    def green(self) -> Array:
        """The lamp's green, brighter or darker, a little bluer or yellower."""
        return np.clip(GREEN_BGR * self.rng.uniform(0.75, 1.1) + self.rng.uniform(-20.0, 20.0, 3), 0.0, 255.0)


def _one(canvas: Canvas) -> None:
    width_m = canvas.rng.uniform(0.2, 1.5)
    canvas.paint([rectangle(0.0, 0.0, width_m, width_m * canvas.rng.uniform(0.15, 1.0))], canvas.green())


def _several(canvas: Canvas) -> None:
    rng, green = canvas.rng, canvas.green()
    for _ in range(int(rng.integers(2, 7))):
        at = rng.uniform(-1.5, 1.5, 2) * [1.0, 0.5]
        size = rng.uniform(0.1, 0.6, 2)
        canvas.paint([rectangle(*at, *size)], green, board_m=0.05 if rng.random() < 0.5 else None)


def _other_bar(canvas: Canvas) -> None:
    """Two rectangles with one or two dimensions off by 15–50 %."""
    rng, rig = canvas.rng, canvas.setting.rig
    sizes = np.array([rig.rectangle_width_m, rig.rectangle_height_m, rig.rectangle_gap_m])
    wrong = rng.permutation(3)[: rng.integers(1, 3)]
    sizes[wrong[0]] *= rng.uniform(1.15, 1.5) ** rng.choice([-1.0, 1.0])
    if len(wrong) > 1:
        sizes[wrong[1]] *= rng.uniform(1.0, 1.5) ** rng.choice([-1.0, 1.0])
    width_m, height_m, gap_m = sizes
    right_m = 0.5 * (width_m + gap_m)
    lift_m = rng.uniform(0.08, 0.25) if rng.random() < 0.25 else 0.0
    canvas.paint(
        [rectangle(-right_m, -lift_m, width_m, height_m), rectangle(right_m, lift_m, width_m, height_m)],
        canvas.green(),
    )


def _tape(canvas: Canvas) -> None:
    """Pairs of other shapes where the rectangles would be, and frames around them."""
    rng, setting, green = canvas.rng, canvas.setting, canvas.green()
    turn = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    outlines = {
        "disc": np.column_stack([np.cos(turn), np.sin(turn)]),
        "triangle": np.array([[-1.0, 1.0], [0.0, -1.0], [1.0, 1.0]]),
        "trapezoid": np.array([[-0.4, -1.0], [0.4, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
        "tilted": np.array([[-1.0, -1.0], [0.5, -1.0], [1.0, 1.0], [-0.5, 1.0]]),
        "L": np.array([[-1, -1], [-0.4, -1], [-0.4, 0.4], [1, 0.4], [1, 1], [-1, 1]], float),
        "U": np.array([[-1, -1], [-0.5, -1], [-0.5, 0.5], [0.5, 0.5], [0.5, -1], [1, -1], [1, 1], [-1, 1]], float),
        "arrow": np.array([[-1, -0.4], [0.2, -0.4], [0.2, -1], [1, 0], [0.2, 1], [0.2, 0.4], [-1, 0.4]], float),
        "hexagon": np.array([[-1, 0], [-0.5, -1], [0.5, -1], [1, 0], [0.5, 1], [-0.5, 1]], float),
    }
    outline = outlines[str(rng.choice(list(outlines)))]
    shape = [quad.mean(axis=0) + 0.5 * np.ptp(quad, axis=0) * outline for quad in setting.plane_m]
    canvas.paint(shape, green)


def _row(canvas: Canvas) -> None:
    """Three to six equal rectangles in a row; the gap is never the bar's."""
    rng, rig = canvas.rng, canvas.setting.rig
    count, gap_m = int(rng.integers(3, 7)), rig.rectangle_gap_m * rng.uniform(0.2, 0.7)
    step_m = rig.rectangle_width_m + gap_m
    places = step_m * (np.arange(count) - 0.5 * (count - 1))
    shape = [rectangle(place, 0.0, rig.rectangle_width_m, rig.rectangle_height_m) for place in places]
    canvas.paint(shape, canvas.green())


def _half(canvas: Canvas) -> None:
    """One of the bar's two rectangles on the bar's board."""
    shape, green = bar(canvas.setting), canvas.green()
    canvas.paint(shape, np.full(3, 110.0))
    canvas.paint(shape[:1] if canvas.rng.random() < 0.5 else shape[1:], green, board_m=None)


def _on_end(canvas: Canvas) -> None:
    """The bar turned by 50–90° in its plane."""
    angle = np.radians(canvas.rng.uniform(50.0, 90.0)) * canvas.rng.choice([-1.0, 1.0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    canvas.paint([quad @ turn.T for quad in bar(canvas.setting)], canvas.green(), board_m=None)


def _other_colour(canvas: Canvas) -> None:
    """The bar lit in another colour."""
    hue = int(canvas.rng.choice([*range(28), *range(93, 180)]))
    saturation, value = int(canvas.rng.integers(120, 256)), int(canvas.rng.integers(140, 256))
    colour = cv2.cvtColor(np.array([[[hue, saturation, value]]], np.uint8), cv2.COLOR_HSV2BGR)[0, 0]
    canvas.paint(bar(canvas.setting), colour.astype(float))


def _foliage(canvas: Canvas) -> None:
    """Mottled green over a part of the picture, blotches of many sizes."""
    rng, (height, width) = canvas.rng, canvas.picture.shape[:2]
    texture = np.zeros((height, width), np.float32)
    for step in (4, 9, 20, 60):
        coarse = rng.standard_normal((height // step + 2, width // step + 2), dtype=np.float32)
        texture += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    leaf = texture > np.quantile(texture[::8, ::8], 1.0 - rng.uniform(0.15, 0.8))
    rows = slice(int(rng.uniform(0.0, 0.6) * height), height)
    shade = rng.uniform(0.6, 1.3, (height, width, 1)).astype(np.float32)
    green, ground = np.array([45.0, 150.0, 60.0]), np.array([50.0, 75.0, 95.0])
    leaves = np.where(leaf[..., None], green, ground) * cv2.GaussianBlur(shade, (0, 0), 1.5)[..., None]
    canvas.picture[rows] = np.clip(leaves[rows], 0, 255).astype(np.uint8)


def _shadow(canvas: Canvas) -> None:
    """The bar's own shadow: its shape, dark and soft, on the wall or aslant on the deck."""
    rng = canvas.rng
    shear = np.array([[1.0, rng.uniform(-0.8, 0.8)], [0.0, rng.uniform(0.6, 2.0)]])
    shape = [quad @ shear.T + rng.uniform(-0.5, 0.5, 2) for quad in bar(canvas.setting)]
    canvas.paint(shape, np.array([30.0, 45.0, 25.0]), board_m=None, opacity=rng.uniform(0.4, 0.8))


def _in_water(canvas: Canvas) -> None:
    """The bar's image in rippled water: upside down, dimmed, each row shifted by the waves' slopes."""
    rng = canvas.rng
    _mirror(canvas, 2.0 * canvas.setting.rig.bar_height_m, rng.uniform(1.5, 6.0), rng.uniform(0.25, 0.7), 1)


def _on_deck(canvas: Canvas) -> None:
    """The bar's image in a wet deck: dimmed and smeared down the picture."""
    rng, rig = canvas.rng, canvas.setting.rig
    smear_px = int(rng.integers(4, 15)) * 2 + 1
    _mirror(canvas, 2.0 * (rig.bar_height_m - rig.deck_height_m), 0.3, rng.uniform(0.15, 0.6), smear_px)


def _mirror(canvas: Canvas, drop_m: float, ripple_px: float, strength: float, smear_px: int) -> None:
    """The bar's mirror image `drop_m` below it; `strength` is the share of its light that comes back."""
    rng = canvas.rng
    layer = Canvas(np.zeros_like(canvas.picture), canvas.setting, canvas.view, rng)
    layer.paint([quad + np.array([0.0, drop_m]) for quad in bar(canvas.setting)], canvas.green())
    cover = np.asarray(layer.picture.max(axis=2) > 0, np.float32)
    height, width = canvas.picture.shape[:2]
    rows, columns = np.arange(height, dtype=np.float32)[:, None], np.arange(width, dtype=np.float32)
    phase, length = rng.uniform(0.0, 2.0 * np.pi, 3), rng.uniform(4.0, 25.0, 3)
    waves = [np.sin(rows * (2.0 * np.pi / long) + 0.02 * columns + p) for p, long in zip(phase, length, strict=True)]
    sway = np.asarray(ripple_px * sum(waves), np.float32)
    smear = np.full((smear_px, 1), 1.0 / smear_px)
    image, cover = (
        cv2.filter2D(cv2.remap(part, columns + sway, rows + 0.4 * sway, cv2.INTER_LINEAR), -1, smear)
        for part in (layer.picture, cover)
    )
    seen = strength * np.asarray(cover)[..., None]
    canvas.picture[:] = np.clip(canvas.picture * (1.0 - seen) + strength * image, 0, 255).astype(np.uint8)


DECOYS: dict[str, Callable[[Canvas], None]] = {
    "one green rectangle": _one,
    "several green rectangles": _several,
    "a bar of other dimensions": _other_bar,
    "lit tape of another shape": _tape,
    "a row of rectangles": _row,
    "half of the bar": _half,
    "the bar on end": _on_end,
    "the bar in another colour": _other_colour,
    "foliage": _foliage,
    "the bar's shadow": _shadow,
    "the bar in rippled water": _in_water,
    "the bar in a wet deck": _on_deck,
}


def hide_bar(canvas: Canvas) -> None:
    """Grey over the bar's board."""
    rig = canvas.setting.rig
    board = rectangle(0.0, 0.0, rig.board_width_m + 0.04, rig.board_height_m + 0.04)
    canvas.fill([canvas.project(board)], np.full(3, 140.0))


LEAST_RANGE_M = {"the bar in rippled water": 9.0, "the bar in a wet deck": 4.5}
"""Nearer, a level camera does not see them."""


def decoy_view(decoy: str, setting: Setting, rng: np.random.Generator) -> View:
    """Where a decoy is seen from: 1.8–18 m (log-uniform), up to 40° off its axis."""
    least_m = LEAST_RANGE_M.get(decoy, 1.8)
    range_m = float(np.exp(rng.uniform(np.log(least_m), np.log(18.0))))
    return view_at(range_m, float(rng.uniform(-38.0, 38.0)), setting.gimbal_noise_rad, rng)
