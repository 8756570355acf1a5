"""The geometric camera's far half: the true boxes of ship and bar with the detectors' measured errors and misses.

Its error model is taken from `shipland evaluate` on rendered pictures (docs/results/far-vision.md). False boxes are not
modelled: flights that must meet them fly the rendered camera.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

import numpy as np

from shipland.camera import Camera
from shipland.geometric.parameters import BoxErrors, BoxParameters
from shipland.messages import Box, Frame, Observation
from shipland.rig import Rig
from shipland.sim.state import SceneState
from shipland.sim.target_box import target_box


class _Detector:
    """One target's hits and errors."""

    def __init__(self, kind: str, errors: BoxErrors, parameters: BoxParameters) -> None:
        self.kind = kind
        self._errors = errors
        self._parameters = parameters
        self._hits: deque[bool] = deque(maxlen=parameters.confirm_frames)
        self._believed = False

    def see(self, sides: tuple[float, float, float, float] | None, range_m: float, draws: np.ndarray) -> Box | None:
        """The box with its errors, if it is found and believed; `draws` (4,) holds a uniform and three normals."""
        errors = self._errors
        miss = float(np.interp(range_m, errors.range_m, errors.miss_rate, right=1.0))
        found = sides is not None and draws[0] >= miss
        self._hits.append(found)
        if not any(self._hits):
            self._believed = False
        self._believed = self._believed or sum(self._hits) >= self._parameters.confirm_hits
        if sides is None or not found or not self._believed:
            return None
        left, top, right, bottom = sides
        centre = np.array([0.5 * (left + right) - 0.5, 0.5 * (top + bottom) - 0.5])
        centre += float(np.interp(range_m, errors.range_m, errors.centre_px)) * draws[1:3]
        scale = np.exp(0.5 * float(np.interp(range_m, errors.range_m, errors.area)) * draws[3])
        size = ((right - left) * scale, (bottom - top) * scale)
        return Box((float(centre[0]), float(centre[1])), (float(size[0]), float(size[1])), 1.0 - miss)


class Scenes(Protocol):
    """Source of the scenes that a camera saw."""

    def scene_at(self, t_s: float) -> SceneState | None:
        """The scene at an exposure [s]; None where it is not known."""


class GeometricFar:
    """Far vision without a picture, for a vehicle whose scene is known."""

    def __init__(
        self,
        scenes: Scenes,
        camera: Camera,
        rig: Rig,
        ship: BoxErrors,
        bar: BoxErrors,
        parameters: BoxParameters,
        rng: np.random.Generator,
    ) -> None:
        self._scenes, self._camera, self._rig, self._rng = scenes, camera, rig, rng
        self._parameters = parameters
        self._detectors = (_Detector("ship", ship, parameters), _Detector("bar", bar, parameters))

    def see(self, frame: Frame) -> Observation:
        """What the detectors would make of the picture; never raises."""
        draws = np.column_stack([self._rng.random(2), self._rng.normal(size=(2, 3))])
        scene = self._scenes.scene_at(frame.t_s if frame.stamp_s is None else frame.stamp_s)
        if scene is None:
            return Observation(frame.t_s, frame.gimbal, reason="far: no picture")
        boxes = []
        for detector, numbers in zip(self._detectors, draws, strict=True):
            target = scene.ned_from_bar if detector.kind == "bar" else scene.ned_from_ship
            range_m = float(np.linalg.norm(scene.ned_from_camera.translation_m - target.translation_m))
            visible, facing = self._parameters.least_visible, self._parameters.least_facing
            sides = target_box(detector.kind, scene, self._camera, self._rig, visible, facing)
            boxes.append(detector.see(sides, range_m, numbers))
        ship, bar = boxes
        reasons = [f"{name}: not found" for name, box in (("ship", ship), ("bar", bar)) if box is None]
        return Observation(frame.t_s, frame.gimbal, None, bar, ship, "; ".join(reasons))
