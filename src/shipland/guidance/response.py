"""Sticks, and a vehicle's response to them: the one description from which a pilot's model and gains are built."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

from shipland.config import key, parameters, require
from shipland.frames import GRAVITY_MPS2


class SticksPercent(NamedTuple):
    """Percent, -100 … 100: forward, right, up, clockwise positive."""

    pitch: float
    roll: float
    heave: float
    yaw: float


HOLD = SticksPercent(0.0, 0.0, 0.0, 0.0)


def clamp(value: float, limit: float) -> float:
    """`value` within ±`limit`; 0 for a value that is no number, which asks for nothing."""
    return 0.0 if math.isnan(value) else max(-limit, min(limit, value))


@parameters
class Response:
    """The meaning of the sticks on this vehicle, and its lags."""

    kind: Literal["attitude", "velocity"] = key(
        ...,
        "`attitude`: pitch and roll sticks ask for a tilt against the horizon; `velocity`: for a speed over "
        "ground, or over the surface that the vehicle's optical flow sees, which the autopilot tracks",
    )
    max_tilt_rad: float = key(
        ..., "tilt at full stick (attitude), or the most that the autopilot uses (velocity)", gt=0, le=1.2
    )
    max_speed_mps: float = key(..., "speed at full stick (velocity); 0 otherwise")
    lag_s: float = key(..., "time constant of the horizontal acceleration behind what is asked for", gt=0, le=10)
    servo_per_s: float = key(..., "gain from speed error to acceleration (velocity); 0 otherwise")
    drag_per_s: float = key(..., "deceleration for a metre per second through the air, linear", ge=0)
    max_input_rate: float = key(..., "most that the input may change by in a second and be followed: [m/s³] or [m/s²]")
    max_climb_mps: float = key(..., "vertical speed at full stick", gt=0, le=20)
    climb_lag_s: float = key(..., "time constant of the vertical speed", gt=0)
    max_turn_rad_s: float = key(..., "yaw rate at full stick", gt=0, le=10)
    turn_lag_s: float = key(..., "time constant of the yaw rate", gt=0)
    uplink_s: float = key(..., "from a command's being ready to its arrival", ge=0, le=3)
    dead_time_s: float = key(..., "from its arrival to the first reaction", ge=0, le=3)
    hold_below_percent: float = key(
        ..., "pitch and roll sticks both below this make the vehicle brake and hold its place", ge=0
    )
    stick_step_percent: float = key(0.0, "sticks travel in steps of this; 0 where they are continuous")
    integral_per_s2: float = key(
        0.0,
        "gain from the integral of the speed error to acceleration (velocity); 0 where it is not known, and then "
        "the lags below belong to the speed asked for, else to the tilt alone",
    )
    velocity_reference: Literal["ground", "surface"] = key(
        "surface", "what its own velocity is against", "ground (GPS) | surface (optical flow, which a ship below moves)"
    )
    approach_per_s: float = key(0.0, "with an integral: how the speed that is tracked follows the one asked for")
    smoothing_s: float = key(0.0, "likewise")
    climb_dead_time_s: float | None = key(None, "`dead_time_s` of a climb", "that of a tilt where it is not known")

    def __post_init__(self) -> None:
        if self.kind == "velocity":
            require(self.max_speed_mps > 0.0, "a velocity response needs max_speed_mps above zero")
            shaped = self.approach_per_s > 0.0 and self.smoothing_s > 0.0
            require(
                self.integral_per_s2 <= 0.0 or shaped, "an integral needs approach_per_s and smoothing_s above zero"
            )
            require(self.servo_per_s > 0.0, "a velocity response needs servo_per_s above zero")

    @property
    def climb_dead_s(self) -> float:
        """Dead time of a climb."""
        return self.dead_time_s if self.climb_dead_time_s is None else self.climb_dead_time_s

    @property
    def climb_after_s(self) -> float:
        """From a command's effect on the tilt to that on the climb; negative where the climb begins first."""
        return self.climb_dead_s - self.dead_time_s

    @property
    def climb_in_s(self) -> float:
        """Likewise to the climb's having come about, on average."""
        return max(self.climb_after_s + self.climb_lag_s, 0.0)

    @property
    def full_input(self) -> float:
        """Input of the motion model at full stick: an acceleration [m/s²] or a speed [m/s]."""
        return GRAVITY_MPS2 * math.tan(self.max_tilt_rad) if self.kind == "attitude" else self.max_speed_mps

    def input_of(self, stick_percent: float) -> float:
        """Input of the motion model for a pitch or roll stick: [m/s²] (attitude) or [m/s] (velocity).

        >>> round(ANAFI_LIKE.input_of(100.0), 3)
        2.629
        """
        if self.kind == "attitude":
            return GRAVITY_MPS2 * math.tan(0.01 * stick_percent * self.max_tilt_rad)
        return 0.01 * stick_percent * self.max_speed_mps

    def stick_of(self, wanted: float) -> float:
        """The stick [percent, unclipped] that gives the input `wanted`; the inverse of `input_of`."""
        if self.kind == "attitude":
            return 100.0 * math.atan(wanted / GRAVITY_MPS2) / self.max_tilt_rad
        return 100.0 * wanted / self.max_speed_mps


ANAFI_LIKE = Response(
    kind="attitude",
    max_tilt_rad=math.radians(15.0),
    max_speed_mps=0.0,
    lag_s=0.16,
    servo_per_s=0.0,
    drag_per_s=0.3,
    max_input_rate=15.0,
    max_climb_mps=1.0,
    climb_lag_s=0.3,
    max_turn_rad_s=math.radians(40.0),
    turn_lag_s=0.2,
    uplink_s=0.025,
    dead_time_s=0.04,
    hold_below_percent=1.0,
)
"""The shape of an ANAFI at its default settings, for examples and tests; a flight takes its vehicle's own."""
