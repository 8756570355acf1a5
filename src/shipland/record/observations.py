"""What an agent sees: what a pilot gets in its cycle, as arrays that are always finite."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.frames import wrap_angle
from shipland.messages import Observation, PilotCommand, Telemetry

Arrays = dict[str, npt.NDArray[np.float32]]

OLDEST_S = 10.0
"""Ages end here; what never came has this age, and zeros for its values."""

_FARTHEST_M, _HIGHEST_M, _FASTEST_MPS = 200.0, 10_000.0, 100.0
"""The border of the loop refuses what is beyond."""
_UPPER = np.triu_indices(4)
_PLACE = ["forward", "right", "down", "yaw"]
_BOX = (["column", "row", "width", "height", "confidence"], [2.0, 2.0, 2.0, 2.0, 1.0])
_PARTS = {
    "pose": (["forward_m", "right_m", "down_m", "yaw_rad"], [_FARTHEST_M, _FARTHEST_M, _FARTHEST_M, math.pi]),
    "pose_covariance": (
        [f"{_PLACE[row]}_{_PLACE[column]}" for row, column in zip(*_UPPER, strict=True)], [_FARTHEST_M**2] * 10,
    ),
    "bar_box": _BOX,
    "ship_box": _BOX,
    "gimbal": (["roll_rad", "pitch_rad", "yaw_rad"], [math.pi] * 3),
    "attitude": (["roll_rad", "pitch_rad"], [math.pi] * 2),
    "heading": (["cosine", "sine"], [1.0, 1.0]),
    "height": (["m"], [_HIGHEST_M]),
    "velocity": (["forward_mps", "right_mps", "down_mps"], [_FASTEST_MPS] * 3),
    "sent": (["pitch", "roll", "heave", "yaw"], [1.0] * 4),
}  # fmt: skip
"""Names of each entry's numbers, and their largest magnitudes."""
_AGED = ("picture", "pose", "bar_box", "ship_box", "attitude", "heading", "height", "velocity")

_BOUNDS = {name: ([-value for value in high], high) for name, (_, high) in _PARTS.items()}
_BOUNDS |= {f"{name}_age": ([0.0], [OLDEST_S]) for name in _AGED} | {"flying": ([0.0], [1.0])}

BOUNDS = {
    name: (np.array(low, np.float32), np.array(high, np.float32)) for name, (low, high) in sorted(_BOUNDS.items())
}
"""Lowest and highest values of each entry, in the order of the alphabet."""


def flat_names() -> list[str]:
    """What each number is, of all entries one after the other."""
    parts = {name: names for name, (names, _) in _PARTS.items()} | {f"{name}_age": ["s"] for name in _AGED}
    return [name for entry in BOUNDS for name in [f"{entry}_{part}" for part in parts.get(entry, [])] or [entry]]


class Observer:
    """Keeps the newest of everything and tells its age.

    Args:
        camera: intrinsics of the pictures; boxes are given in shares of half their width and height.
    """

    def __init__(self, camera: Camera) -> None:
        self._half_px = 0.5 * np.array([camera.width_px, camera.height_px])
        self._newest: dict[str, tuple[float, list[float]]] = {}

    def take(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Arrays:
        """The arrays of one cycle, as `Pilot.decide` gets it."""
        now_s, newest = telemetry.t_s, self._newest
        pose = observation.bar_pose
        if pose is not None:
            position_m = pose.position_in_bar_m.tolist()
            newest["pose"] = observation.t_s, [*position_m, wrap_angle(pose.yaw_rad)]
            newest["pose_covariance"] = observation.t_s, pose.covariance[_UPPER].tolist()
        for name, box in (("bar_box", observation.bar_box), ("ship_box", observation.ship_box)):
            if box is not None:
                centre = np.array(box.centre_px) / self._half_px - 1.0
                size = np.array(box.size_px) / (2.0 * self._half_px)
                newest[name] = observation.t_s, [*centre.tolist(), *size.tolist(), box.confidence]
        newest["picture"] = observation.t_s, []
        gimbal = observation.gimbal
        newest["gimbal"] = observation.t_s, list(map(wrap_angle, (gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad)))
        self._take_telemetry(telemetry)
        newest["flying"] = now_s, [float(telemetry.flying)]
        if sent is not None:
            newest["sent"] = sent.t_s, [0.01 * percent for percent in sent.sticks_percent]
        return {name: self._entry(name, now_s) for name in BOUNDS}

    def _take_telemetry(self, telemetry: Telemetry) -> None:
        def keep(name: str, t_s: float | None, values: list[float]) -> None:
            self._newest[name] = telemetry.t_s if t_s is None else t_s, values

        if telemetry.roll_rad is not None and telemetry.pitch_rad is not None:
            keep("attitude", telemetry.attitude_t_s, [wrap_angle(telemetry.roll_rad), wrap_angle(telemetry.pitch_rad)])
        if telemetry.heading_rad is not None:
            north_east = [math.cos(telemetry.heading_rad), math.sin(telemetry.heading_rad)]
            keep("heading", telemetry.heading_t_s, north_east)
        if telemetry.height_m is not None:
            keep("height", telemetry.height_t_s, [telemetry.height_m])
        if telemetry.velocity_in_level_mps is not None:
            keep("velocity", telemetry.velocity_t_s, telemetry.velocity_in_level_mps.tolist())

    def _entry(self, name: str, now_s: float) -> npt.NDArray[np.float32]:
        low, high = BOUNDS[name]
        source = name.removesuffix("_age")
        t_s, values = self._newest.get(source, (-math.inf, [0.0] * len(low)))
        if source != name:
            values = [now_s - t_s]
        clipped: npt.NDArray[np.float32] = np.clip(np.array(values, np.float32), low, high)
        return clipped
