"""Small antialiased pictures of coplanar quadrilaterals, for tests that need no renderer.

Colours are given as a picture shows them, 0 … 255; a canvas holds light, and a tone curve makes the picture of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from scipy.special import ndtr

from shipland.camera import Camera
from shipland.cue import Cue, Polygon
from shipland.frames import CAMERA_FROM_MOUNT, Array, Pose, rotation_from_euler

GREEN = (60.0, 190.0, 70.0)
GREY = (128.0, 128.0, 128.0)
SKY = (200.0, 170.0, 140.0)


def srgb(light):
    """The level, 0 … 1, that sRGB shows for light, 0 … 1."""
    light = np.clip(light, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)


def light_of(colour) -> Array:
    """Light, 0 … 1, of a colour, 0 … 255, by sRGB."""
    level = np.asarray(colour, float) / 255.0
    return np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)


def sharpened(picture, amount, sigma_px=1.0):
    """An unsharp mask over levels 0 … 1."""
    return picture + amount * (picture - cv2.GaussianBlur(picture, (0, 0), sigma_px))


def contrasty(light):
    """sRGB with an S-curve on top, as cameras' own pictures have."""
    level = srgb(light)
    return level + 0.6 * level * (1.0 - level) * (2.0 * level - 1.0)


def gamma(exponent):
    """A power law."""
    return lambda light: np.clip(light, 0.0, 1.0) ** (1.0 / exponent)


TONES: dict[str, Callable] = {
    "sRGB": srgb,
    "gamma 1.8": gamma(1.8),
    "gamma 2.6": gamma(2.6),
    "S": contrasty,
    "S, sharpened": lambda light: sharpened(contrasty(light), 0.5),
    "sharpened": lambda light: sharpened(srgb(light), 0.8),
    "clipped": lambda light: srgb(1.9 * light),
    "dark": lambda light: srgb(0.3 * light),
}
"""From a canvas to levels 0 … 1."""


@dataclass(frozen=True)
class Look:
    """How a picture is made: blur [px, standard deviation], noise [grey levels], supersampling a side, tone curve."""

    blur_px: float = 0.7
    noise: float = 2.0
    samples: int = 4
    tone: Callable = srgb


def camera_from_bar(position_in_bar_m, yaw_rad=0.0, pitch_rad=0.0, roll_rad=0.0) -> Pose:
    """Pose of `bar` in `camera` for a camera at a place in `bar`, turned by yaw, pitch, roll."""
    bar_from_mount = rotation_from_euler(roll_rad, pitch_rad, yaw_rad)
    bar_from_camera = bar_from_mount @ CAMERA_FROM_MOUNT.T
    return Pose(bar_from_camera, np.asarray(position_in_bar_m, float)).inverse()


def project_plane(plane_m, camera: Camera, pose: Pose) -> Array:
    """Pixels (n,2) of plane points (n,2) (right, down)."""
    plane_m = np.asarray(plane_m, float).reshape(-1, 2)
    return camera.project(pose.apply(np.column_stack([np.zeros(len(plane_m)), plane_m])))


def paint(canvas, polygon_px, colour, samples: int, blur_px: float = 0.0) -> None:
    """Fill a convex clockwise polygon on a canvas of light by coverage; pixel centres at whole numbers.

    Coverage is that of each of `samples`² sub-pixels by each side's half-plane, multiplied: exact but at corners. A
    blur is a Gaussian's, before the pixels take their squares.
    """
    polygon = np.asarray(polygon_px, float)
    if not np.all(np.isfinite(polygon)):
        return
    height, width = canvas.shape[:2]
    low = np.clip(np.floor(polygon.min(axis=0) - 4.0 * blur_px) - 1, 0, [width, height]).astype(int)
    high = np.clip(np.ceil(polygon.max(axis=0) + 4.0 * blur_px) + 2, 0, [width, height]).astype(int)
    if np.any(high <= low):
        return
    size = (high - low) * samples
    columns = low[0] - 0.5 + (np.arange(size[0]) + 0.5) / samples
    rows = low[1] - 0.5 + (np.arange(size[1]) + 0.5) / samples
    fine = np.ones((size[1], size[0]), np.float32)
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        along = (end - start) / np.linalg.norm(end - start)
        inward = (columns - start[0]) * -along[1] + ((rows - start[1]) * along[0])[:, None]
        if blur_px > 0.0:
            fine *= ndtr(inward / blur_px)
        else:
            fine *= np.clip(0.5 + inward * samples / np.abs(along).sum(), 0.0, 1.0)
    coverage = fine.reshape(high[1] - low[1], samples, high[0] - low[0], samples).mean(axis=(1, 3))[..., None]
    part = canvas[low[1] : high[1], low[0] : high[0]]
    part[:] = part * (1.0 - coverage) + coverage * light_of(colour)


def bar_picture(target: Cue, camera: Camera, pose: Pose, rng, look: Look = Look(), colour=GREEN, margin_m=0.075):
    """A picture (H,W,3) uint8 of a target on a grey board before a plain background."""
    canvas = plain_canvas(camera)
    add_target(canvas, target, camera, pose, look, colour, margin_m)
    return finish(canvas, rng, look)


def plain_canvas(camera: Camera, colour=SKY) -> Array:
    """A canvas of one colour, of single precision: a power costs half as much."""
    return np.full((camera.height_px, camera.width_px, 3), light_of(colour), np.float32)


def add_target(
    canvas, target: Cue, camera: Camera, pose: Pose, look: Look = Look(), colour=GREEN, margin_m=0.075, board=GREY
):
    """Paint board and quadrilaterals on a canvas."""
    plane = target.points_in_bar_m[:, 1:]
    low, high = plane.min(axis=0) - margin_m, plane.max(axis=0) + margin_m
    edges = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    paint(canvas, project_plane(edges, camera, pose), board, 2, look.blur_px)
    for quad in target.polygon:
        paint(canvas, project_plane(quad.corners_m, camera, pose), colour, look.samples, look.blur_px)


def finish(canvas, rng, look: Look = Look()):
    """Tone curve, noise, eight bits."""
    image = 255.0 * look.tone(canvas)
    if look.noise > 0:
        image += look.noise * noise(canvas.shape, rng)
    return np.clip(np.rint(image, out=image), 0, 255, out=image).astype(np.uint8)


NOISE_OFFSETS = 500_009


@lru_cache(maxsize=4)
def noise_bank(size: int) -> Array:
    """Standard normal values, more than a picture of `size` takes."""
    return np.random.default_rng(4).standard_normal(size + NOISE_OFFSETS, np.float32)


def noise(shape: tuple[int, ...], rng) -> Array:
    """Standard normal noise, from a bank at a drawn place: drawing each value anew takes half of a picture's time."""
    size, first = math.prod(shape), int(rng.integers(NOISE_OFFSETS))
    return noise_bank(size)[first : first + size].reshape(shape)


def rectangles(*boxes) -> Cue:
    """A target of upright rectangles (centre right, centre down, width, height) [m]."""
    return Cue(tuple(Polygon.rectangle((x, y), w, h) for x, y, w, h in boxes))


def decoys(camera: Camera, kind: str, rng):
    """A canvas without the cue: green things of a kind on a plain background."""
    canvas = plain_canvas(camera)
    size = np.array([camera.width_px, camera.height_px])
    for _ in range(int(rng.integers(1, 7))):
        centre = rng.uniform(0.1, 0.9, 2) * size
        across = np.exp(rng.uniform(np.log(12.0), np.log(250.0)))
        angle = rng.normal(0.0, 0.1)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        colour = np.array(GREEN) * rng.uniform(0.8, 1.2)
        if kind == "rectangles":
            half = 0.5 * across * np.array([1.0, rng.uniform(0.15, 1.0)])
            shape = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        elif kind == "shapes":
            count = int(rng.choice([3, 5, 6, 16]))
            steps = 2.0 * np.pi * np.arange(count) / count
            shape = 0.5 * across * np.column_stack([np.cos(steps), rng.uniform(0.4, 1.0) * np.sin(steps)])
        else:
            raise ValueError(kind)
        paint(canvas, shape @ turn + centre, colour, 2, 0.6)
    return canvas


def foliage(camera: Camera, rng, cover: float = 0.4):
    """A canvas of mottled green on brown, blotches of many sizes."""
    height, width = camera.height_px, camera.width_px
    texture = np.zeros((height, width))
    for step in (4, 8, 16, 48):
        coarse = rng.normal(size=(height // step + 2, width // step + 2))
        rows, columns = np.arange(height) / step, np.arange(width) / step
        top, left = rows.astype(int), columns.astype(int)
        down, right = (rows - top)[:, None], (columns - left)[None]
        upper = coarse[np.ix_(top, left)] * (1 - right) + coarse[np.ix_(top, left + 1)] * right
        lower = coarse[np.ix_(top + 1, left)] * (1 - right) + coarse[np.ix_(top + 1, left + 1)] * right
        texture += upper * (1 - down) + lower * down
    leaf = texture > np.quantile(texture, 1.0 - cover)
    return np.where(leaf[..., None], light_of([50.0, 150.0, 60.0]), light_of([60.0, 80.0, 100.0]))


def write_film(path: Path, images: Iterable, rate: int = 30, codec: str = "libx264", **options: str) -> Path:
    """A film of pictures (H,W,3) uint8 BGR, so many a second; the path."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate, options=options)
        stream.pix_fmt = "yuv420p"
        for image in images:
            if not stream.codec_context.is_open:
                stream.height, stream.width = image.shape[:2]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="bgr24")))
        container.mux(stream.encode())
    return path
