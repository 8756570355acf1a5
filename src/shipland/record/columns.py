"""What people look at in a flight, from its rows: places against the pad, deck motion, errors of the vision.

`pad` here has the axes of `bar` turned up: forward, right, UP, from the deck centre's neutral point, so that an
aircraft over the middle of a still deck is at (0, 0, height). It moves with the ship, never with the deck.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from shipland.frames import Array, euler_from_rotation, wrap_angle
from shipland.messages import BarPose, FlightRecord, GroundTruth, Mode, Telemetry
from shipland.rig import Rig

_UP = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True)
class Derived:
    """Figures of one cycle that follow from its record; NaN where it lacks what they follow from.

    Attributes:
        mode_number: the mode as a number, for plotting; 0 without a mode.
        estimate_t_s: the time that the pilot's estimate is valid for; the truth below is of the exposure, so the two
            are compared through `FlightColumns.estimate_error_in_pad_m`.
        estimate_in_pad_m: (3,) aircraft, as the pilot has it.
        estimate_yaw_rad: its heading against the ship, as the pilot has it.
        truth_in_pad_m: (3,) aircraft.
        truth_yaw_rad: its heading against the ship.
        truth_tilt_rad: angle of its vertical against the world's.
        truth_in_deck_m: (3,) aircraft against the moving deck: forward, starboard, UP.
        truth_yaw_in_deck_rad: its heading in the deck's plane.
        deck_shift_m: (3,) surge, sway, heave: forward, starboard, UP.
        deck_turn_rad: (3,) roll, pitch, yaw.
        vision_error_m: (3,) camera in `bar` (forward, right, down), seen minus true.
        vision_error_yaw_rad: its heading, seen minus true.
    """

    mode_number: int
    estimate_t_s: float
    estimate_in_pad_m: Array
    estimate_yaw_rad: float
    truth_in_pad_m: Array
    truth_yaw_rad: float
    truth_tilt_rad: float
    truth_in_deck_m: Array
    truth_yaw_in_deck_rad: float
    deck_shift_m: Array
    deck_turn_rad: Array
    vision_error_m: Array
    vision_error_yaw_rad: float


def derive(record: FlightRecord, rig: Rig) -> Derived:
    """The derived figures of one cycle; truth and picture must be of the same instant, the exposure."""
    decision, truth, pose = record.decision, record.truth, record.observation.bar_pose
    nothing, mode_number = np.full(3, np.nan), 0 if decision.mode is None else decision.mode.value
    estimate_t_s, estimate_in_pad_m, estimate_yaw_rad = math.nan, nothing, math.nan
    if decision.estimate is not None:
        estimate_t_s, estimate_yaw_rad = decision.estimate.t_s, decision.estimate.yaw_rad
        estimate_in_pad_m = _UP * (decision.estimate.aircraft_in_bar_m - rig.deck_in_bar_m)
    known = Derived(
        mode_number, estimate_t_s, estimate_in_pad_m, estimate_yaw_rad, nothing, math.nan, math.nan, nothing, math.nan,
        nothing, nothing, nothing, math.nan,
    )  # fmt: skip
    if truth is None:
        return known
    bar_from_ned = truth.ned_from_bar.inverse()
    ship_from_deck = truth.ned_from_ship.inverse() @ truth.ned_from_deck
    deck_from_body = truth.ned_from_deck.inverse() @ truth.ned_from_body
    error_m, error_yaw_rad = _vision_error(pose, truth)
    return replace(
        known,
        truth_in_pad_m=_UP * (truth.aircraft_in_bar_m - rig.deck_in_bar_m),
        truth_yaw_rad=euler_from_rotation(bar_from_ned.rotation @ truth.ned_from_body.rotation)[2],
        truth_tilt_rad=math.acos(min(1.0, max(-1.0, float(truth.ned_from_body.rotation[2, 2])))),
        truth_in_deck_m=_UP * deck_from_body.translation_m,
        truth_yaw_in_deck_rad=euler_from_rotation(deck_from_body.rotation)[2],
        deck_shift_m=_UP * ship_from_deck.translation_m,
        deck_turn_rad=np.array(euler_from_rotation(ship_from_deck.rotation)),
        vision_error_m=error_m,
        vision_error_yaw_rad=error_yaw_rad,
    )


def _vision_error(pose: BarPose | None, truth: GroundTruth) -> tuple[Array, float]:
    if pose is None:
        return np.full(3, np.nan), math.nan
    bar_from_camera = truth.ned_from_bar.inverse() @ truth.ned_from_camera
    axis = bar_from_camera.rotation[:, 2]
    yaw_rad = math.atan2(axis[1], axis[0])
    return pose.position_in_bar_m - bar_from_camera.translation_m, wrap_angle(pose.yaw_rad - yaw_rad)


@dataclass(frozen=True)
class FlightColumns:
    """A flight as arrays, one row a cycle; NaN where there was nothing.

    Attributes:
        t_s: (n,) exposure times.
        sticks_percent: (n, 4) pitch, roll, heave, yaw.
        reprojection_px: (n,) of the vision's pose.
        landing_probability: (n,) that the pilot gives.
        telemetry_tilt_rad: (n,) angle of the aircraft's vertical as the vehicle tells it.
        mode_number … vision_error_yaw_rad: (n,) or (n, 3), stacked from `Derived`.
    """

    t_s: Array
    sticks_percent: Array
    reprojection_px: Array
    landing_probability: Array
    telemetry_tilt_rad: Array
    mode_number: npt.NDArray[np.int64]
    estimate_t_s: Array
    estimate_in_pad_m: Array
    estimate_yaw_rad: Array
    truth_in_pad_m: Array
    truth_yaw_rad: Array
    truth_tilt_rad: Array
    truth_in_deck_m: Array
    truth_yaw_in_deck_rad: Array
    deck_shift_m: Array
    deck_turn_rad: Array
    vision_error_m: Array
    vision_error_yaw_rad: Array

    @staticmethod
    def from_records(records: Sequence[FlightRecord], rig: Rig) -> FlightColumns:
        """Columns of rows in order of time."""
        derived = [derive(record, rig) for record in records]
        stacked = {
            field.name: np.array([getattr(row, field.name) for row in derived]).reshape(
                (-1, 3) if field.type == "Array" else -1
            )
            for field in fields(Derived)
        }
        sticks = [record.decision.command.sticks_percent for record in records]
        poses = [record.observation.bar_pose for record in records]
        return FlightColumns(
            t_s=np.array([record.frame.t_s for record in records], dtype=float),
            sticks_percent=np.array(sticks, dtype=float).reshape(-1, 4),
            reprojection_px=np.array([math.nan if pose is None else pose.reprojection_px for pose in poses], float),
            landing_probability=np.array([record.decision.landing_probability for record in records], dtype=float),
            telemetry_tilt_rad=np.array([_tilt_rad(record.telemetry) for record in records], dtype=float),
            **stacked,
        )

    @property
    def estimate_error_in_pad_m(self) -> Array:
        """(n, 3) the pilot's estimate minus the truth of the same time; NaN where either is missing."""
        return self.estimate_in_pad_m - _resampled(self.estimate_t_s, self.t_s, self.truth_in_pad_m)

    @property
    def estimate_error_yaw_rad(self) -> Array:
        """(n,) likewise of the heading, in -pi … pi."""
        yaw_rad = np.full_like(self.truth_yaw_rad, np.nan)
        known = np.isfinite(self.truth_yaw_rad)
        yaw_rad[known] = np.unwrap(self.truth_yaw_rad[known])
        error_rad = self.estimate_yaw_rad - _resampled(self.estimate_t_s, self.t_s, yaw_rad[:, None])[:, 0]
        return np.asarray((error_rad + np.pi) % (2.0 * np.pi) - np.pi)

    @property
    def place_in_pad_m(self) -> Array:
        """(n, 3) the aircraft against the pad at `t_s`: truth where there is one, else the pilot's estimates."""
        estimate_m = _resampled(self.t_s, self.estimate_t_s, self.estimate_in_pad_m)
        estimate_m[~np.isfinite(self.estimate_t_s)] = np.nan  # no line over a stretch without estimates
        return np.where(np.isfinite(self.truth_in_pad_m), self.truth_in_pad_m, estimate_m)

    @property
    def speed_in_pad_mps(self) -> Array:
        """(n, 3) rate of `place_in_pad_m`, by central differences; the ship's own velocity is thus taken out."""
        place_m = self.place_in_pad_m
        if len(self.t_s) < 2:
            return np.full_like(place_m, np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.asarray(np.gradient(place_m, self.t_s, axis=0))
        rate[~np.isfinite(rate)] = np.nan
        return rate

    def mode_spans(self) -> list[tuple[float, float, Mode | None]]:
        """(from_s, to_s, mode) of each unbroken stretch of one mode; a stretch lasts until the next one's start."""
        spans: list[tuple[float, float, Mode | None]] = []
        if not len(self.t_s):
            return spans
        starts = [0, *(np.flatnonzero(np.diff(self.mode_number)) + 1).tolist()]
        ends = [*starts[1:], len(self.t_s) - 1]
        for start, end in zip(starts, ends, strict=True):
            number = int(self.mode_number[start])
            spans.append((float(self.t_s[start]), float(self.t_s[end]), Mode(number) if number else None))
        return spans


def _resampled(at_s: Array, t_s: Array, values: Array) -> Array:
    """Values (n, k) at times (n,), taken by line to the times (m,) `at_s`; NaN outside them and where `at_s` is."""
    known = np.isfinite(t_s) & np.isfinite(values).all(axis=1)
    found = np.full((len(at_s), values.shape[1]), np.nan)
    if known.any():
        order = np.argsort(t_s[known], kind="stable")
        times_s, known_values = t_s[known][order], values[known][order]
        for column in range(values.shape[1]):
            found[:, column] = np.interp(at_s, times_s, known_values[:, column], left=np.nan, right=np.nan)
    found[~np.isfinite(at_s)] = np.nan
    return found


def _tilt_rad(telemetry: Telemetry) -> float:
    if telemetry.roll_rad is None or telemetry.pitch_rad is None:
        return math.nan
    return math.acos(math.cos(telemetry.roll_rad) * math.cos(telemetry.pitch_rad))
