"""The uniform block that every shader reads (`common.glsl`), laid out and packed in one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.rig import Solid
from shipland.sim.scene.light import Light
from shipland.sim.scene.sea import WaveTiles, whitecap_cover
from shipland.sim.scene.tone import FULL_SCALE
from shipland.sim.scene.view import Crop, clip_from_rel, rays

CASTERS = 5
BLOCK_BYTES = 4 * (16 + 4 * 16 + 16 * CASTERS + 4 * CASTERS)

_SHADOW_EDGE_M = 0.02
_CLOUD_DRIFT_PER_S = 2e-4
_SUN_RADIUS_RAD = 0.00465
_TURN = np.array([[0.940, -0.342], [0.342, 0.940]])
_TURN_BACK = np.array([[0.766, 0.643], [-0.643, 0.766]])
"""The wave layers' rotations, as in `sea.frag`."""


@dataclass(frozen=True)
class RenderView:
    """What a pass looks at.

    Attributes:
        camera: intrinsics of the whole picture.
        ned_from_camera: its pose.
        crop: the part that is drawn.
        samples_a_px: samples along a pixel's side.
        near_m, far_m: clip planes.
        t_s: time [s].
        mirrored: what is drawn is mirrored in a flat sea.
    """

    camera: Camera
    ned_from_camera: Pose
    crop: Crop
    samples_a_px: float
    near_m: float
    far_m: float
    t_s: float
    mirrored: bool = False


def block(view: RenderView, light: Light, waves: WaveTiles, casters: list[tuple[Solid, Pose]], foam: float) -> bytes:
    """The block's bytes for a view; `casters` are boxes with ned_from_box, `foam` scales the foam around the hull."""
    eye, camera, crop = view.ned_from_camera, view.camera, view.crop
    ray = rays(camera, eye)
    ground = eye.translation_m[:2]
    whitecaps = whitecap_cover(waves.wind_speed_mps)
    scale = np.array([1.0, 1.0 / 0.618, 0.0, 0.0]) / waves.long_tile_m
    scale[2] = 1.0 / waves.short_tile_m
    offset_a = np.mod([ground * scale[0], _TURN @ ground * scale[1]], 1.0).ravel()
    offset_b = np.mod((_TURN_BACK @ ground - waves.short_drift_m(view.t_s)) * scale[2], 1.0)
    rows = [
        [*ray[:, 0], 0.0],
        [*ray[:, 1], 0.0],
        [*ray[:, 2], 0.0],
        [crop.left - 0.5, crop.top - 0.5, 1.0 / view.samples_a_px, view.samples_a_px],
        [*light.sun_in_ned, np.cos(_SUN_RADIUS_RAD)],
        [*light.sun_rgb, light.glare],
        [*light.zenith_rgb, light.cloud_cover],
        [*light.horizon_rgb, _CLOUD_DRIFT_PER_S * view.t_s],
        [*light.glow_rgb, light.exposure / FULL_SCALE],
        [*light.water_rgb, light.extinction_per_m],
        [max(-float(eye.translation_m[2]), 0.05), camera.focal_px, whitecaps, view.t_s],
        scale,
        offset_a,
        [*offset_b, waves.height_of_unit_m, foam],
        [waves.long_gain, waves.short_gain, waves.residual_variance, waves.foam_threshold],
        [*ground, 0.0, 0.0],
    ]
    boxes, suns = _casters(casters, eye, light.sun_in_ned)
    clip = clip_from_rel(camera, eye, crop, view.near_m, view.far_m)
    if view.mirrored:  # up is down, about the sea's plane
        mirror = np.diag([1.0, 1.0, -1.0, 1.0])
        mirror[2, 3] = -2.0 * eye.translation_m[2]
        clip = clip @ mirror
    parts = [clip.T.ravel(), np.array(rows, dtype=float).ravel(), boxes.ravel(), suns.ravel()]
    return np.concatenate(parts).astype(np.float32).tobytes()


def _casters(casters: list[tuple[Solid, Pose]], eye: Pose, sun_in_ned: Array) -> tuple[Array, Array]:
    """(5,4,4) matrices, column-major, camera-relative ned to a cube of ±1, and (5,4) inverse sun directions there."""
    boxes, suns = np.zeros((CASTERS, 4, 4)), np.ones((CASTERS, 4))
    for index, (solid, ned_from_box) in enumerate(casters):
        low, high = np.array(solid.low_m), np.array(solid.high_m)
        half = 0.5 * (high - low)
        matrix = np.eye(4)
        matrix[:3, :3] = ned_from_box.rotation.T / half[:, None]
        offset = ned_from_box.rotation.T @ (eye.translation_m - ned_from_box.translation_m)
        matrix[:3, 3] = (offset - 0.5 * (high + low)) / half
        boxes[index] = matrix.T
        direction = matrix[:3, :3] @ sun_in_ned
        direction = np.where(np.abs(direction) < 1e-5, 1e-5, direction)
        suns[index] = [*(1.0 / direction), 1.0 / _SHADOW_EDGE_M]
    return boxes, suns
