"""What the sticks and the attitude say of the vehicle's motion: inputs by the time at which they take effect.

An autopilot that tracks a velocity makes of them a smoothed speed of its own, known without measuring. With u the speed
asked for, α the rate of approach and τ the smoothing: ṙ = q; q̇ = (α (u − r) − q) / τ.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.compiled import compiled
from shipland.estimation.delayed import Inputs
from shipland.estimation.heading import HeadingFilters
from shipland.estimation.kernels import add_input
from shipland.estimation.relative_state import AxisModel, shaping
from shipland.frames import GRAVITY_MPS2, Array, rotated
from shipland.guidance.response import Response
from shipland.messages import PilotCommand, Telemetry

_STEP_S = 0.005
_STEEPEST_RAD = 1.0
"""A vehicle holds its position with no larger a tilt than this."""
_TRIM_S = 2.5
"""Time constant of the mean tilt: the servo's integral and its gusts both show in it."""


class ShapedSpeed:
    """The speed that the autopilot tracks, over two axes, propagated in short steps; enters the filter's inputs.

    Args:
        motion: of the vehicle.
    """

    def __init__(self, motion: AxisModel) -> None:
        a, b = shaping(motion)
        self._step = np.eye(2) + _STEP_S * (a + 0.5 * _STEP_S * a @ a)
        self._push = _STEP_S * (b + 0.5 * _STEP_S * a @ b)
        self._gain = motion.servo_per_s
        self._t_s = -math.inf
        self.asked_mps: Array = np.zeros(2)
        """(2,) by the sticks."""
        self.state: Array = np.zeros((2, 2))
        """Speed and its rate, by axes."""

    def ask(self, from_s: float, speed_mps: Array, inputs: Inputs) -> None:
        """From `from_s` on the sticks ask for `speed_mps` (2,)."""
        if not math.isfinite(self._t_s):
            self._t_s = from_s
        self.advance(from_s, inputs)
        self.asked_mps = speed_mps

    def advance(self, to_s: float, inputs: Inputs) -> None:
        """Propagate to a time, to the nearest step."""
        while self._t_s + 0.5 * _STEP_S < to_s and math.isfinite(self._t_s):
            state, model = self.state.copy(), (self._step, self._push, self._gain)
            inputs.count, self._t_s = _shape(
                state, self.asked_mps, model, inputs.history, inputs.count, self._t_s, to_s
            )
            self.state = state
            inputs.make_room()


@compiled
def _shape(
    state: Array,
    asked_mps: Array,
    model: tuple[Array, Array, float],
    history: Array,
    count: int,
    t_s: float,
    to_s: float,
) -> tuple[int, float]:
    """Propagate the state in place while the history has rows; how many are filled, and the time."""
    (step, push, gain), value = model, np.empty(4)
    while t_s + 0.5 * _STEP_S < to_s and count < len(history):
        for axis in range(2):
            speed, rate = state[0, axis], state[1, axis]
            state[0, axis] = step[0, 0] * speed + step[0, 1] * rate + push[0] * asked_mps[axis]
            state[1, axis] = step[1, 0] * speed + step[1, 1] * rate + push[1] * asked_mps[axis]
            value[2 + axis] = 0.5 * (speed + state[0, axis])
            value[axis] = value[2 + axis] + 0.5 * (rate + state[1, axis]) / gain
        add_input(history, count, t_s, value)
        count, t_s = count + 1, t_s + _STEP_S
    return count, t_s


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
        climb_s = command.t_s + response.uplink_s + response.climb_dead_s
        self.climbs.add(climb_s, np.array([-(0.01 * command.heave_percent * response.max_climb_mps)]))
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
