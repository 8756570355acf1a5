"""Pictures that a vision is shown before a flight, so that none of its code is compiled in the air."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.cue import Cue
from shipland.frames import Array
from shipland.messages import Frame, GimbalAttitude
from shipland.vision.vision import Vision, see_or_degrade

_SHARES = (0.5, 0.2, 0.06)
"""Widths of the cue in pictures' widths: near, on the way, far."""
_LIGHT, _GREY, _STEP_S = (60, 200, 255), 90, 1.0 / 30.0
"""In HSV, of an unstated hue; of board and deck; between pictures."""
_FINE_BITS = 4


def rehearse(vision: Vision, cue: Cue, camera: Camera) -> None:
    """Show a vision the cue near and far, followed, cut and in part, what is no cue, and the deck from above."""
    t_s = -1e6  # long before any flight: nothing of it is followed
    for picture, pitch_rad in _pictures(cue, camera):
        for _ in range(2):
            t_s += _STEP_S
            see_or_degrade(vision, Frame(t_s, picture, GimbalAttitude(0.0, pitch_rad)))


def _pictures(cue: Cue, camera: Camera) -> Iterator[tuple[npt.NDArray[np.uint8], float]]:
    """Each with the pitch of the camera [rad]."""
    plane_m = cue.plane_m - cue.plane_m.mean(axis=(0, 1))
    width_m = float(np.ptp(plane_m[..., 0]))
    for share in _SHARES:
        distance_m = camera.focal_px * width_m / (share * camera.width_px)
        half_m = 0.5 * camera.width_px * distance_m / camera.focal_px
        yield _drawn(cue, camera, plane_m, distance_m), 0.0
        yield _drawn(cue, camera, plane_m - [half_m, 0.0], distance_m), 0.0  # cut by the picture's edge
        yield _drawn(cue, camera, plane_m[1:], distance_m), 0.0
        yield _drawn(cue, camera, plane_m * [1.0, 1.5], distance_m), 0.0  # of other dimensions
    yield _drawn(cue, camera, plane_m[:0], 1.0), 0.0
    yield _drawn(cue, camera, plane_m[:0], 1.0), -0.5 * np.pi


def _drawn(cue: Cue, camera: Camera, plane_m: Array, distance_m: float) -> npt.NDArray[np.uint8]:
    """Polygons (n,k,2), lit and squarely before the camera; a grey board in place of none."""
    height_px, width_px = camera.height_px, camera.width_px
    picture = np.full((height_px, width_px, 3), 5, np.uint8)
    if plane_m.size == 0:
        picture[height_px // 3 : 2 * height_px // 3, width_px // 3 : 2 * width_px // 3] = _GREY
    hue = _LIGHT[0] if not isinstance(cue.hue, tuple) else (cue.hue[0] + ((cue.hue[1] - cue.hue[0]) % 180) // 2) % 180
    colour = np.array([[[hue, 0 if cue.hue == "white" else _LIGHT[1], _LIGHT[2]]]], np.uint8)
    light = cv2.cvtColor(colour, cv2.COLOR_HSV2BGR)[0, 0].tolist()
    for polygon_m in plane_m:
        corners = camera.project(np.column_stack([polygon_m, np.full(len(polygon_m), distance_m)]))
        cv2.fillPoly(picture, [np.round(corners * 2**_FINE_BITS).astype(np.int32)], light, cv2.LINE_AA, _FINE_BITS)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.8), np.uint8)
