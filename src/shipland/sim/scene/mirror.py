"""The ship's mirror image in a flat sea, drawn small into a texture that `sea.frag` looks up by the waves' facets."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.rig import Solid
from shipland.sim.scene import gl
from shipland.sim.scene.view import Crop, screen_box

SIZE = 256
"""Side of the texture; waves blur more than this resolves. As in `sea.frag`."""
_BEYOND = 0.3
"""Pictures that the mirror image may reach out of the picture, for facets that look there."""
_MOST_SAMPLES_A_PX = 4.0
_WATER_M = 2.0
"""Margin of water around the hull, for foam and shadow."""
_WAKE_WIDENS = 0.08
"""Half-width that the wake gains, as a share of its length."""
_STRETCH = 1.7
"""How much longer waves draw the image towards the eye."""


@dataclass(frozen=True)
class Mirror:
    """Where the mirror image lies in the picture and beyond it, and its texture's samples a pixel."""

    crop: Crop
    samples_a_px: float

    @property
    def drawn(self) -> tuple[int, int]:
        """Width and height of the texture's part that is used."""
        return round(self.crop.width * self.samples_a_px), round(self.crop.height * self.samples_a_px)

    @property
    def area(self) -> tuple[float, float, float, float]:
        """Left and top edge [px, edges at whole numbers], texture units a px."""
        unit = self.samples_a_px / SIZE
        return float(self.crop.left), float(self.crop.top), unit, unit

    @property
    def used(self) -> tuple[float, float]:
        """Texture units that are drawn."""
        return self.drawn[0] / SIZE, self.drawn[1] / SIZE


@dataclass(frozen=True)
class AroundShip:
    """What the ship does to the water: part of the picture, its mirror image, its hull's box in `ship`, its pose."""

    crop: Crop
    mirror: Mirror
    hull: Solid
    ned_from_ship: Pose


def around_ship(
    camera: Camera,
    eye: Pose,
    corners_in_ned_m: Array,
    hull: Solid,
    ned_from_ship: Pose,
    near_m: float,
    wake_m: float = 0.0,
) -> AroundShip | None:
    """Where the water shows the ship; None where neither is in the picture.

    `corners_in_ned_m` (n,3) bound what is mirrored, `hull` is a box in `ship`, `wake_m` the length of the wake astern.
    """
    camera_from_ned = eye.inverse()
    mirrored = corners_in_ned_m * [1.0, 1.0, -1.0]
    image = screen_box(camera, camera_from_ned.apply(mirrored), near_m, 4.0, beyond=_BEYOND)
    plan = np.array([[x, y, hull.high_m[2]] for x in (-1, 1) for y in (-1, 1)], dtype=float)
    low, high = np.array(hull.low_m) - _WATER_M, np.array(hull.high_m) + _WATER_M
    if wake_m > 0.0:
        low -= [wake_m, _WAKE_WIDENS * wake_m, 0.0]
        high += [0.0, _WAKE_WIDENS * wake_m, 0.0]
    plan[:, :2] = np.where(plan[:, :2] < 0.0, low[:2], high[:2])
    on_water = ned_from_ship.apply(plan) * [1.0, 1.0, 0.0]
    stretched = mirrored * [1.0, 1.0, _STRETCH]
    water = camera_from_ned.apply(np.concatenate([on_water, stretched]))
    crop = screen_box(camera, water, near_m, 4.0)
    if image is None or crop is None:
        return None
    samples = min(_MOST_SAMPLES_A_PX, SIZE / max(image.width, image.height))
    samples = 2.0 ** np.floor(np.log2(samples))
    grain = max(round(1.0 / samples), 1)  # a whole number of samples along each side
    image = Crop(image.left, image.top, -(-image.width // grain) * grain, -(-image.height // grain) * grain)
    return AroundShip(crop, Mirror(image, float(samples)), hull, ned_from_ship)


def target(context: moderngl.Context) -> gl.RenderTarget:
    """The texture, bound to its unit, clear of everything beyond its border."""
    made = gl.RenderTarget(context, SIZE, SIZE)
    made.colour.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    made.colour.repeat_x = made.colour.repeat_y = False
    made.colour.use(gl.MIRROR_UNIT)
    return made
