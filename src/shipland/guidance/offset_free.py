"""Near control without steady error: a Kalman filter of place, speed and disturbance, and a prediction over the delay.

Ours, not the paper's. Wind and a ship under way show in the filter as an acceleration that the sticks do not explain;
the stick that cancels it is given at once, so neither leaves an error behind. What the sticks do is known from the
vehicle's own settings. The horizontal filters stand in the axes of `bar`, which do not turn with the nose: in `level` a
turn would look like a speed, 14 m/s at 20 m and 40 °/s.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipland.config import require
from shipland.frames import GRAVITY_MPS2, Array, wrap_angle
from shipland.guidance.estimate import Measured, NearEstimate
from shipland.guidance.laws import clamp
from shipland.guidance.near import Sticks
from shipland.guidance.response import Response


@dataclass(frozen=True)
class OffsetFreeParameters:
    """`[guidance.offset_free]`.

    Attributes:
        bandwidth_per_s, damping: of the horizontal position loop.
        max_speed_mps, max_brake_mps2: of the horizontal approach against the ship.
        climb_per_s, turn_per_s: of the height and heading loops.
        max_climb_mps: of the approach.
        lag_s: from a stick's effect to its acceleration.
        acceleration_noise, disturbance_noise: power densities of the horizontal model, [m²/s³] and [m²/s⁵].
        climb_noise, turn_noise: power densities of the drift of climb and turn rate, [m²/s³] and [rad²/s³].
        floor_m, floor_rad: least standard deviation that a measurement is given.
    """

    bandwidth_per_s: float
    damping: float
    max_speed_mps: float
    max_brake_mps2: float
    climb_per_s: float
    turn_per_s: float
    max_climb_mps: float
    lag_s: float
    acceleration_noise: float
    disturbance_noise: float
    climb_noise: float
    turn_noise: float
    floor_m: float
    floor_rad: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require(value > 0.0, f"{name} must be positive, got {value}")


class _Sent(NamedTuple):
    from_s: float
    sticks: Sticks


class _Axis:
    """Kalman filter of one axis: state propagated by (transition, input), first component measured."""

    def __init__(self, decay_per_s: float, size: int, noise: Array) -> None:
        self._decay_per_s, self._size, self._noise = decay_per_s, size, noise
        self.state = np.zeros(size)
        self.covariance = np.diag([1e4, 1.0, 0.2][:size])

    def transition(self, step_s: float) -> tuple[Array, Array]:
        """Matrix (n,n) and input vector (n,) of a step: error falls with speed, speed follows push and disturbance."""
        if self._size == 2:  # error, drift; the input is a speed
            return np.array([[1.0, -step_s], [0.0, 1.0]]), np.array([-step_s, 0.0])
        keep = math.exp(-self._decay_per_s * step_s)
        gain = (1.0 - keep) / self._decay_per_s
        way = (step_s - gain) / self._decay_per_s
        matrix = np.array([[1.0, -gain, -way], [0.0, keep, gain], [0.0, 0.0, 1.0]])
        return matrix, np.array([-way, gain, 0.0])

    def predicted(self, state: Array, inputs: list[tuple[float, float]]) -> Array:
        """The state after a sequence of (step [s], input)."""
        for step_s, given in inputs:
            matrix, push = self.transition(step_s)
            state = matrix @ state + push * given
        return state

    def advance(self, inputs: list[tuple[float, float]]) -> None:
        """Propagate state and covariance."""
        self.state = self.predicted(self.state, inputs)
        for step_s, _ in inputs:
            matrix, _ = self.transition(step_s)
            self.covariance = matrix @ self.covariance @ matrix.T + np.diag(self._noise * step_s)

    def correct(self, measured: float, variance: float) -> None:
        """Take a measurement of the error."""
        gain = self.covariance[:, 0] / (self.covariance[0, 0] + variance)
        self.state = self.state + gain * (measured - self.state[0])
        self.covariance = self.covariance - np.outer(gain, self.covariance[0])
        self.covariance = 0.5 * (self.covariance + self.covariance.T)

    def widen(self) -> None:
        """After a gap: position and speed become unknown, the disturbance stays known."""
        drift = self.covariance[-1, -1]
        self.covariance = np.diag([1e4, 1.0, drift][: self._size] if self._size == 3 else [1e4, drift])


class _Predicted(NamedTuple):
    """Predicted states at the time when a command takes effect: position along `bar`'s axes, height, heading."""

    longitudinal: Array
    lateral: Array
    up: Array
    turn: Array


_Applied = tuple[float, Sticks]
"""Sticks and the time for which they acted [s]."""


def _turned(forward: float, right: float, yaw_rad: float) -> tuple[float, float]:
    """A vector (forward, right) of axes that are turned clockwise by `yaw_rad`, in those that are not."""
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    return cosine * forward - sine * right, sine * forward + cosine * right


class OffsetFreeNear:
    """Four filters, predicted over the delay; a speed profile into the square, and the disturbance cancelled."""

    def __init__(self, parameters: OffsetFreeParameters, response: Response) -> None:
        self._parameters, self._response = parameters, response
        horizontal = np.array([1e-6, parameters.acceleration_noise, parameters.disturbance_noise])
        decay_per_s = 1.0 / response.speed_time_s
        self._axes = (
            _Axis(decay_per_s, 3, horizontal),
            _Axis(decay_per_s, 3, horizontal),
            _Axis(0.0, 2, np.array([1e-6, parameters.climb_noise])),
            _Axis(0.0, 2, np.array([1e-6, parameters.turn_noise])),
        )
        self._sent: deque[_Sent] = deque([_Sent(-math.inf, Sticks(0.0, 0.0, 0.0, 0.0))])
        self._t_s: float | None = None
        self._predicted = _Predicted(np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(2))

    def observe(self, measured: Measured, now_s: float) -> NearEstimate:
        """Filter at exposure, predict to the moment when this cycle's command takes effect."""
        effect_s = now_s + self._response.uplink_s + self._parameters.lag_s
        before_s = measured.t_s if self._t_s is None else self._t_s
        self._t_s = measured.t_s
        self._filter(measured, self._applied(before_s, measured.t_s))
        self._predicted = predicted = self._predict(self._applied(measured.t_s, effect_s))
        while len(self._sent) > 1 and self._sent[1].from_s < measured.t_s:
            self._sent.popleft()
        yaw_rad = wrap_angle(-float(predicted.turn[0]))
        error = np.array([*_turned(predicted.longitudinal[0], predicted.lateral[0], -yaw_rad), predicted.up[0]])
        climb_mps = self._climb_mps(self._at(effect_s)) + predicted.up[1]
        rate = -np.array([*_turned(predicted.longitudinal[1], predicted.lateral[1], -yaw_rad), climb_mps])
        return NearEstimate(measured.t_s, error, rate, yaw_rad, measured.bar_elevation_rad, effect_s)

    def sticks(self, wanted_yaw_rad: float = 0.0) -> Sticks:
        """Sticks for the predicted state; the desired heading is relative to the bar."""
        response, limits, predicted = self._response, self._parameters, self._predicted
        climb_mps = clamp(limits.climb_per_s * float(predicted.up[0]), limits.max_climb_mps) - float(predicted.up[1])
        off_rad = wrap_angle(float(predicted.turn[0]) + wanted_yaw_rad)
        turn_rad_s = limits.turn_per_s * off_rad - float(predicted.turn[1])
        longitudinal_mps2, lateral_mps2 = self._push_mps2(predicted.longitudinal), self._push_mps2(predicted.lateral)
        pitch_mps2, roll_mps2 = _turned(longitudinal_mps2, lateral_mps2, float(predicted.turn[0]))
        return Sticks(
            self._tilt_percent(pitch_mps2),
            self._tilt_percent(roll_mps2),
            clamp(100.0 * climb_mps / response.max_climb_mps, 100.0),
            clamp(100.0 * turn_rad_s / response.max_turn_rad_s, 100.0),
        )

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """Remember the sticks sent and when they act."""
        self._sent.append(_Sent(ready_s + self._response.uplink_s + self._parameters.lag_s, sticks))

    def reset(self) -> None:
        """Place and speed start anew with the next picture."""
        for axis in self._axes:
            axis.widen()

    def _filter(self, measured: Measured, applied: list[_Applied]) -> None:
        limits, (longitudinal, lateral, up, turn) = self._parameters, self._axes
        for axis, inputs in zip(self._axes, self._inputs(applied), strict=True):
            axis.advance(inputs)
        off_rad = wrap_angle(-measured.yaw_rad - float(turn.state[0]))
        turn.correct(float(turn.state[0]) + off_rad, max(measured.yaw_variance_rad2, limits.floor_rad**2))
        turn.state[0] = wrap_angle(float(turn.state[0]))
        # The heading measured, not the one filtered: its error is that of the place, which it turns back.
        yaw_rad, yaw_variance = measured.yaw_rad, measured.yaw_variance_rad2
        forward_m, right_m, up_m = (float(value) for value in measured.error_in_level_m)
        errors_m = _turned(forward_m, right_m, yaw_rad)
        spread = np.abs(_turned(1.0, 0.0, yaw_rad)) ** 2
        variances = (spread @ measured.variance_in_level_m2[:2], spread @ measured.variance_in_level_m2[1::-1])
        # A heading error moves the target point by heading error × distance, across the line of sight.
        for axis, error_m, variance, lever_m in zip(
            (longitudinal, lateral), errors_m, variances, errors_m[::-1], strict=True
        ):
            axis.correct(error_m, max(float(variance), limits.floor_m**2) + yaw_variance * lever_m**2)
        up_variance = max(float(measured.variance_in_level_m2[2]), limits.floor_m**2)
        up.correct(up_m, up_variance)

    def _predict(self, applied: list[_Applied]) -> _Predicted:
        return _Predicted(
            *(
                axis.predicted(axis.state, inputs)
                for axis, inputs in zip(self._axes, self._inputs(applied), strict=True)
            )
        )

    def _inputs(self, applied: list[_Applied]) -> list[list[tuple[float, float]]]:
        """(duration [s], input) for each axis: accelerations along `bar`'s axes at the yaw of that time; speeds."""
        turn = self._axes[3].state
        tilt_rad, yaw_rad, drift_rad_s = self._response.max_tilt_rad, -float(turn[0]), float(turn[1])
        inputs: list[list[tuple[float, float]]] = [[], [], [], []]
        for step_s, sticks in applied:
            turn_rad_s = self._turn_rad_s(sticks)
            turned_rad = step_s * (turn_rad_s + drift_rad_s)
            pitch_mps2, roll_mps2 = (GRAVITY_MPS2 * math.tan(0.01 * stick * tilt_rad) for stick in sticks[:2])
            pushes_mps2 = _turned(pitch_mps2, roll_mps2, yaw_rad + 0.5 * turned_rad)
            for row, value in zip(inputs, (*pushes_mps2, self._climb_mps(sticks), turn_rad_s), strict=True):
                row.append((step_s, value))
            yaw_rad += turned_rad
        return inputs

    def _push_mps2(self, axis: Array) -> float:
        """The desired acceleration along an axis of `bar`."""
        limits, response = self._parameters, self._response
        error_m, speed_mps, disturbance_mps2 = (float(value) for value in axis)
        slope_per_s = limits.bandwidth_per_s / (2.0 * limits.damping)
        wanted_mps = min(
            slope_per_s * abs(error_m), math.sqrt(2.0 * limits.max_brake_mps2 * abs(error_m)), limits.max_speed_mps
        )
        wanted_mps = math.copysign(wanted_mps, error_m)
        push = 2.0 * limits.damping * limits.bandwidth_per_s * (wanted_mps - speed_mps)
        return push + speed_mps / response.speed_time_s - disturbance_mps2

    def _tilt_percent(self, push_mps2: float) -> float:
        return clamp(100.0 * math.atan(push_mps2 / GRAVITY_MPS2) / self._response.max_tilt_rad, 100.0)

    def _climb_mps(self, sticks: Sticks) -> float:
        return 0.01 * sticks.heave * self._response.max_climb_mps

    def _turn_rad_s(self, sticks: Sticks) -> float:
        return 0.01 * sticks.yaw * self._response.max_turn_rad_s

    def _at(self, t_s: float) -> Sticks:
        given = self._sent[0].sticks
        for sent in self._sent:
            if sent.from_s > t_s:
                break
            given = sent.sticks
        return given

    def _applied(self, from_s: float, to_s: float) -> list[_Applied]:
        """The sticks that acted between two times."""
        found, t_s, sticks = [], from_s, self._at(from_s)
        for sent in self._sent:
            if from_s < sent.from_s < to_s:
                found.append((sent.from_s - t_s, sticks))
                t_s, sticks = sent.from_s, sent.sticks
        if to_s > t_s:
            found.append((to_s - t_s, sticks))
        return found
