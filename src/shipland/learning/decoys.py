"""Things that are not the target, painted into a picture of light: vessels, buoys, birds, green things.

They stand at a place in `ned`, are drawn in perspective as flat, many-times supersampled shapes, and fade into the
horizon's colour as the scene's air says, so that no sharp edge gives a painted thing away; what stands in the
water has a faint mirror image there, as the ship has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.sim.scene.tone import Light16, encoded

DecoyKind = Literal["vessel", "buoy", "bird", "green"]
Part = tuple[Array, Array]
"""A polygon (n,2) (right, up) [m] from the foot's middle, and its colour BGR, display values 0 … 255."""

SUPERSAMPLING = 6
CONTRAST_LEFT = 3.0
"""Koschmieder: ln(1/0.05), visibility at 5 % of contrast."""
_GREENS_BGR = (
    (60.0, 200.0, 60.0),
    (40.0, 255.0, 90.0),
    (90.0, 170.0, 40.0),
    (50.0, 140.0, 30.0),
    (120.0, 255.0, 140.0),
)


@dataclass(frozen=True)
class Decoy:
    """One thing, whose foot is at (3,) `position_in_ned_m` and whose shape and colours `seed` draws.

    Its size is a vessel's length, a buoy's height, a bird's span or a green thing's width.
    """

    kind: DecoyKind
    position_in_ned_m: Array
    size_m: float
    seed: int


def paint(
    light: Light16, decoys: tuple[Decoy, ...], camera: Camera, ned_from_camera: Pose, visibility_m: float
) -> None:
    """Paint decoys into a picture of light (h,w,3) BGR, in place, the farthest first."""
    camera_from_ned = ned_from_camera.inverse()
    air = horizon_light(light, camera, ned_from_camera)
    placed = [(camera_from_ned.apply(decoy.position_in_ned_m[None])[0], decoy) for decoy in decoys]
    for foot, decoy in sorted(placed, key=lambda item: -item[0][2]):
        if foot[2] < 1.0:
            continue
        foot_px, scale = camera.project(foot[None])[0], camera.focal_px / float(foot[2])
        left = float(np.exp(-CONTRAST_LEFT * float(np.linalg.norm(foot)) / visibility_m))
        up = camera_from_ned.rotation @ np.array([0.0, 0.0, -1.0])
        tilt_rad = np.arctan2(up[0], -up[1])
        cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
        turn = np.array([[cos, sin], [sin, -cos]])  # of (right, up) to (column, row)
        parts = parts_of(decoy)
        if decoy.kind != "bird":
            rng = np.random.default_rng([decoy.seed, 1])
            strength, stretch = rng.uniform(0.0, 0.6), rng.uniform(0.7, 1.4)
            mirrored = [(polygon * [1.0, -stretch] @ turn * scale + foot_px, colour) for polygon, colour in parts]
            _paint_one(light, mirrored, left, air, strength)
        upright = [(polygon @ turn * scale + foot_px, colour) for polygon, colour in parts]
        _paint_one(light, upright, left, air, 1.0)


def horizon_light(picture: Light16, camera: Camera, ned_from_camera: Pose) -> Array:
    """(3,) BGR light of the air far away: the picture just above the horizon, or its mean where that is outside."""
    forward = ned_from_camera.rotation[:, 2]
    level = np.array([forward[0], forward[1], 0.0])
    far = ned_from_camera.rotation.T @ (level / max(float(np.linalg.norm(level)), 1e-9) + np.array([0.0, 0.0, -0.02]))
    row = camera.project(far[None])[0][1] if far[2] > 1e-6 else np.nan
    if not np.isfinite(row):
        return np.asarray(picture.mean(axis=(0, 1)), dtype=float)
    at = int(np.clip(row, 0, picture.shape[0] - 1))
    return np.asarray(picture[at].mean(axis=0), dtype=float)


def foot_box_px(decoy: Decoy, camera: Camera, camera_from_ned: Pose) -> tuple[float, float, float, float] | None:
    """Upright box (left, top, right, bottom) that a decoy's picture stays inside; None behind the camera."""
    foot = camera_from_ned.apply(decoy.position_in_ned_m[None])[0]
    if foot[2] < 1.0:
        return None
    column, row = camera.project(foot[None])[0]
    points = np.concatenate([polygon for polygon, _ in parts_of(decoy)]) * camera.focal_px / float(foot[2])
    low, high = points.min(axis=0), points.max(axis=0)
    return float(column + low[0]), float(row - high[1]), float(column + high[0]), float(row - low[1])


def parts_of(decoy: Decoy) -> list[Part]:
    """The polygons of a decoy, first drawn first."""
    rng = np.random.default_rng(decoy.seed)
    return {"vessel": _vessel, "buoy": _buoy, "bird": _bird, "green": _green}[decoy.kind](decoy.size_m, rng)


def _colour(rng: np.random.Generator) -> Array:
    """A colour BGR: greys and whites mostly, as at sea."""
    if rng.random() < 0.5:
        return np.full(3, rng.uniform(25.0, 240.0)) + rng.uniform(-8.0, 8.0, 3)
    return rng.uniform(15.0, 230.0, 3)


def _shade(colour: Array, factor: float) -> Array:
    return np.clip(colour * factor, 0.0, 255.0)


def _rectangle(left: float, right: float, low: float, high: float) -> Array:
    return np.array([(left, low), (right, low), (right, high), (left, high)])


def _disc(radius: float, up: float) -> Array:
    turn = np.linspace(0.0, 2.0 * np.pi, 16)
    return np.column_stack([radius * np.cos(turn), up + radius * np.sin(turn)])


def _vessel(length_m: float, rng: np.random.Generator) -> list[Part]:
    """Hull, one to three houses, sometimes a mast, cranes or a sail; seen from some side, so foreshortened."""
    seen = length_m * rng.uniform(0.25, 1.0)
    freeboard = length_m * rng.uniform(0.05, 0.12)
    half, rake = 0.5 * seen, rng.uniform(0.0, 0.12) * seen
    hull = _colour(rng)
    flip = rng.choice([-1.0, 1.0])
    outline = np.array([(-half + 0.3 * rake, 0.0), (half - rake, 0.0), (half, 1.3 * freeboard), (-half, freeboard)])
    parts: list[Part] = [(outline, _shade(hull, 1.0))]
    if rng.random() < 0.5:
        parts.append((outline * [1.0, 0.35], _shade(_colour(rng), 0.7)))
    house = _colour(rng)
    for _ in range(int(rng.integers(1, 4))):
        at, wide = rng.uniform(-0.35, 0.25) * seen, rng.uniform(0.06, 0.3) * seen
        tall = freeboard + length_m * rng.uniform(0.04, 0.18)
        parts.append((_rectangle(at, at + wide, freeboard, tall), _shade(house, rng.uniform(0.75, 1.1))))
        if rng.random() < 0.5:
            parts.append((_rectangle(at + 0.1 * wide, at + 0.9 * wide, 0.8 * tall, 0.9 * tall), _shade(house, 0.3)))
    if rng.random() < 0.4:
        at, tall = rng.uniform(-0.3, 0.3) * seen, length_m * rng.uniform(0.3, 1.2)
        parts.append((_rectangle(at, at + 0.012 * length_m, freeboard, tall), _shade(house, 0.8)))
        if rng.random() < 0.5:
            sail = np.array([(at, 1.3 * freeboard), (at - 0.4 * seen, 1.4 * freeboard), (at, tall)])
            parts.append((sail, _shade(np.full(3, 235.0), rng.uniform(0.6, 1.0))))
    if rng.random() < 0.15:
        at = rng.uniform(-0.4, 0.3) * seen
        box = _rectangle(at, at + 0.1 * seen, freeboard, 1.6 * freeboard)
        parts.append((box, _shade(np.array(_GREENS_BGR[rng.integers(len(_GREENS_BGR))]), 1.0)))
    return [(polygon * [flip, 1.0], colour) for polygon, colour in parts]


def _buoy(height_m: float, rng: np.random.Generator) -> list[Part]:
    """Cone, can, sphere or spar, plain or banded."""
    colours = [(40, 40, 210), (50, 160, 40), (30, 210, 240), (30, 30, 30), (40, 120, 245), (225, 225, 225)]
    colour = np.array(colours[rng.integers(6)], float)
    wide = height_m * rng.uniform(0.12, 0.6)
    cone = np.array([(-wide / 2, 0.0), (wide / 2, 0.0), (0.06 * wide, height_m), (-0.06 * wide, height_m)])
    can, sphere = _rectangle(-wide / 2, wide / 2, 0.0, height_m), _disc(0.5 * height_m, 0.4 * height_m)
    outline = (cone, can, sphere)[rng.integers(3)]
    parts: list[Part] = [(outline, _shade(colour, rng.uniform(0.6, 1.0)))]
    if rng.random() < 0.4:
        parts.append((_rectangle(-wide / 2, wide / 2, 0.35 * height_m, 0.6 * height_m), _shade(_colour(rng), 1.0)))
    return parts


def _bird(span_m: float, rng: np.random.Generator) -> list[Part]:
    """Two wings and a body."""
    colour = np.full(3, rng.choice([30.0, 60.0, 200.0, 240.0]))
    lift = span_m * rng.uniform(-0.15, 0.35)
    deep = 0.1 * span_m
    wing = np.array([(0.0, 0.0), (0.5 * span_m, lift), (0.2 * span_m, 0.4 * lift - deep), (0.0, -deep)])
    body = _rectangle(-0.06 * span_m, 0.06 * span_m, -0.12 * span_m, 0.04 * span_m)
    shades = _shade(colour, 1.0), _shade(colour, rng.uniform(0.6, 1.0))
    return [(wing, shades[0]), (wing * [-1.0, 1.0], shades[1]), (body, shades[1])]


def _green(width_m: float, rng: np.random.Generator) -> list[Part]:
    """Green things of another shape than the cue: one patch, patches one above the other, a disc, a row of three."""
    green = np.array(_GREENS_BGR[rng.integers(len(_GREENS_BGR))])
    shade = _shade(green, rng.uniform(0.5, 1.0))
    tall = width_m * rng.uniform(0.2, 1.5)
    low = rng.uniform(0.0, 1.5)
    half = width_m / 2
    shapes = (
        [_rectangle(-half, half, low, low + tall)],
        [_rectangle(-half, half, low, low + 0.35 * tall), _rectangle(-half, half, low + 0.65 * tall, low + tall)],
        [_disc(half, low + half)],
        [_rectangle(left * width_m, (left + 0.2) * width_m, low, low + tall) for left in (-0.5, -0.1, 0.3)],
    )[rng.integers(4)]
    parts: list[Part] = []
    if rng.random() < 0.5:
        margin = 0.4 * width_m
        board = _rectangle(-half - margin, half + margin, 0.0, low + tall + margin)
        parts.append((board, _shade(_colour(rng), 0.9)))
    return parts + [(shape, shade) for shape in shapes]


def _paint_one(light: Light16, parts: list[Part], left: float, air: Array, strength: float) -> None:
    """Paint polygons [px], whose contrast the air cuts to `left`; below a `strength` of 1 as a blurred mirror image."""
    height, width = light.shape[:2]
    everything = np.concatenate([outline for outline, _ in parts])
    low = np.floor(everything.min(axis=0)).astype(int) - 1
    high = np.ceil(everything.max(axis=0)).astype(int) + 2
    low, high = np.clip(low, 0, [width, height]), np.clip(high, 0, [width, height])
    columns, rows = high - low
    if columns <= 0 or rows <= 0:
        return
    fine = SUPERSAMPLING if max(columns, rows) < 200 else 2
    layer = np.zeros((rows * fine, columns * fine, 4), np.uint16)
    for outline, colour in parts:
        # Pixel centres at whole numbers; OpenCV's shift takes 1/16 px.
        points = np.round(16.0 * ((outline + 0.5 - low) * fine - 0.5)).astype(np.int32)
        shown = encoded((colour / 255.0) ** 2.2)  # light that is shown as about this colour
        cv2.fillPoly(layer, [points], (*shown.tolist(), 65535.0), cv2.LINE_8, 4)
    small = cv2.resize(layer, (int(columns), int(rows)), interpolation=cv2.INTER_AREA).astype(np.float32)
    if strength < 1.0:
        small = strength * cv2.GaussianBlur(small, (0, 0), sigmaX=0.5, sigmaY=max(0.12 * rows, 0.5))
    cover = small[..., 3:] / 65535.0
    paint_bgr = small[..., :3] * left + cover * air * (1.0 - left)
    area = light[low[1] : high[1], low[0] : high[0]]
    area[:] = np.clip(area * (1.0 - cover) + paint_bgr + 0.5, 0, 65535).astype(np.uint16)
