"""What the sticks and the attitude say of the vehicle's motion: inputs by the time at which they take effect."""

from __future__ import annotations

import math

import numpy as np

from shipland.estimation.delayed import Inputs
from shipland.estimation.heading import HeadingFilters
from shipland.estimation.relative_state import AxisModel
from shipland.frames import GRAVITY_MPS2, Array, rotated
from shipland.guidance.horizon.servo import ShapedSpeed
from shipland.guidance.response import Response
from shipland.messages import PilotCommand, Telemetry

_STEEPEST_RAD = 1.0
"""A vehicle holds its position with no larger a tilt than this."""
_TRIM_S = 2.5
"""Time constant of the mean tilt: the servo's integral and its gusts both show in it."""


class StickHistory:
    """Inputs of the motion models, from the commands sent.

    Args:
        response: of the vehicle.
        motion: horizontal, of the vehicle.
    """

    def __init__(self, response: Response, motion: AxisModel) -> None:
        self._response = response
        self.servo = ShapedSpeed(motion) if motion.inputs > 1 else None
        """The speed that an autopilot tracks; None where its servo is not modelled."""
        self.across, self.climbs = Inputs(2 * motion.inputs), Inputs(1)
        """Horizontal inputs in the axes of the flight; climb rates, downward."""
        self.nose_up_rad = 0.0
        """By the newest attitude."""
        self.trim_mps2: Array = np.zeros(2)
        """(2,) acceleration by the mean tilt, in the axes of the flight."""
        self._tilted_mps2: Array = np.zeros(2)
        self._tilted_s = -math.inf

    def effect_s(self, now_s: float) -> float:
        """When a command that is ready now takes effect."""
        return now_s + self._response.uplink_s + self._response.dead_time_s

    def sent(self, command: PilotCommand, headings: HeadingFilters, gain: float) -> None:
        """A command as it left the safety; `gain` of the sticks as in `AxisModel`."""
        response, effect_s = self._response, self.effect_s(command.t_s)
        sticks = command.pitch_percent, command.roll_percent
        wanted = np.array([response.input_of(stick) for stick in sticks])
        if self.servo is None and max(map(abs, sticks)) < response.hold_below_percent:
            wanted = self._tilted_mps2 / gain  # the vehicle holds its position by itself, against the wind
        turn_rad_s = 0.01 * command.yaw_percent * response.max_turn_rad_s
        headings.sent(effect_s + response.turn_lag_s, turn_rad_s)
        self.climbs.add(effect_s, np.array([-(0.01 * command.heave_percent * response.max_climb_mps)]))
        wanted = rotated(wanted, headings.nose_at(effect_s))
        if self.servo is None:
            self.across.add(effect_s, wanted)
        else:
            self.servo.ask(effect_s, wanted, self.across)

    def attitude(self, telemetry: Telemetry, headings: HeadingFilters) -> None:
        """The vehicle's tilt, where it is one that holds a position."""
        roll_rad, pitch_rad = telemetry.roll_rad, telemetry.pitch_rad
        if roll_rad is None or pitch_rad is None or not max(abs(roll_rad), abs(pitch_rad)) < _STEEPEST_RAD:
            return
        self._tilted_mps2 = GRAVITY_MPS2 * np.array([-math.tan(pitch_rad), math.tan(roll_rad)])
        self.nose_up_rad = pitch_rad
        share = 1.0 - math.exp(-max(telemetry.t_s - self._tilted_s, 0.0) / _TRIM_S)
        tilt_mps2 = rotated(self._tilted_mps2, headings.nose_at(telemetry.t_s))
        self.trim_mps2, self._tilted_s = self.trim_mps2 + share * (tilt_mps2 - self.trim_mps2), telemetry.t_s

    def input_before(self) -> Array:
        """(2,) the newest input sent, in the axes of the flight."""
        return self.across.latest() if self.servo is None else self.servo.asked_mps

    def advance(self, t_s: float) -> None:
        """Propagate the tracked speed to a time."""
        if self.servo is not None:
            self.servo.advance(t_s, self.across)
