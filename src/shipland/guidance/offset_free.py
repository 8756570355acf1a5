"""Near control without steady error: a Kalman filter of place, speed and disturbance, and a prediction over the delay.

Ours, not the paper's. Wind and a ship under way show in the filter as an acceleration that the sticks do not explain;
the stick that cancels it is given at once, so neither leaves an error behind. What the sticks do is known from the
vehicle's own settings.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipland.config import require
from shipland.frames import Array, wrap_angle
from shipland.guidance.laws import clamp
from shipland.guidance.near import Measured, NearEstimate, Sticks

_GRAVITY_MPS2 = 9.81


@dataclass(frozen=True)
class Response:
    """What full sticks mean on this vehicle: its settings, and the time constant of its speed.

    Attributes:
        max_tilt_rad: of pitch and roll.
        speed_time_s: time constant with which a tilt becomes a speed.
        max_climb_mps: of heave.
        max_turn_rad_s: of yaw.
        uplink_s: from a command's being ready to its effect.
    """

    max_tilt_rad: float
    speed_time_s: float
    max_climb_mps: float
    max_turn_rad_s: float
    uplink_s: float


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

    def ahead(self, state: Array, inputs: list[tuple[float, float]]) -> Array:
        """The state after a sequence of (step [s], input)."""
        for step_s, given in inputs:
            matrix, push = self.transition(step_s)
            state = matrix @ state + push * given
        return state

    def advance(self, inputs: list[tuple[float, float]]) -> None:
        """Propagate state and covariance."""
        self.state = self.ahead(self.state, inputs)
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
        """After a gap: place and speed are unknown, the disturbance is not."""
        drift = self.covariance[-1, -1]
        self.covariance = np.diag([1e4, 1.0, drift][: self._size] if self._size == 3 else [1e4, drift])


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
        self._ahead = [axis.state for axis in self._axes]

    def observe(self, measured: Measured, now_s: float) -> NearEstimate:
        """Filter at exposure, predict to the moment when this cycle's command takes effect."""
        limits = self._parameters
        floors = (limits.floor_m, limits.floor_m, limits.floor_m, limits.floor_rad)
        values = (*measured.error_in_level_m, -wrap_angle(measured.yaw_rad))
        variances = (*measured.variance_in_level_m2, measured.yaw_variance_rad2)
        effect_s = now_s + self._response.uplink_s + limits.lag_s
        before_s = measured.t_s if self._t_s is None else self._t_s
        self._t_s = measured.t_s
        for index, axis in enumerate(self._axes):
            axis.advance(self._inputs(index, before_s, measured.t_s))
            axis.correct(float(values[index]), max(float(variances[index]), floors[index] ** 2))
            self._ahead[index] = axis.ahead(axis.state, self._inputs(index, measured.t_s, effect_s))
        while len(self._sent) > 1 and self._sent[1].from_s < measured.t_s:
            self._sent.popleft()
        forward, right, up, turn = self._ahead
        rate = -np.array([forward[1], right[1], self._climb_mps(effect_s) + up[1]])
        error = np.array([forward[0], right[0], up[0]])
        return NearEstimate(measured.t_s, error, rate, -float(turn[0]), measured.bar_elevation_rad)

    def sticks(self, wanted_yaw_rad: float = 0.0) -> Sticks:
        """Sticks for the state predicted; the heading wanted is against the bar."""
        response, limits = self._response, self._parameters
        forward, right, up, turn = self._ahead
        climb_mps = clamp(limits.climb_per_s * float(up[0]), limits.max_climb_mps) - float(up[1])
        turn_rad_s = limits.turn_per_s * (float(turn[0]) + wanted_yaw_rad) - float(turn[1])
        return Sticks(
            self._tilt_percent(forward),
            self._tilt_percent(right),
            clamp(100.0 * climb_mps / response.max_climb_mps, 100.0),
            clamp(100.0 * turn_rad_s / response.max_turn_rad_s, 100.0),
        )

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """Remember what was given and when it acts."""
        self._sent.append(_Sent(ready_s + self._response.uplink_s + self._parameters.lag_s, sticks))

    def reset(self) -> None:
        """Place and speed start anew with the next picture."""
        for axis in self._axes:
            axis.widen()

    def _tilt_percent(self, axis: Array) -> float:
        limits, response = self._parameters, self._response
        error_m, speed_mps, disturbance_mps2 = (float(value) for value in axis)
        slope_per_s = limits.bandwidth_per_s / (2.0 * limits.damping)
        wanted_mps = min(
            slope_per_s * abs(error_m), math.sqrt(2.0 * limits.max_brake_mps2 * abs(error_m)), limits.max_speed_mps
        )
        wanted_mps = math.copysign(wanted_mps, error_m)
        push = 2.0 * limits.damping * limits.bandwidth_per_s * (wanted_mps - speed_mps)
        push += speed_mps / response.speed_time_s - disturbance_mps2
        return clamp(100.0 * math.atan(push / _GRAVITY_MPS2) / response.max_tilt_rad, 100.0)

    def _climb_mps(self, t_s: float) -> float:
        return self._effect(2, self._at(t_s))

    def _at(self, t_s: float) -> Sticks:
        given = self._sent[0].sticks
        for sent in self._sent:
            if sent.from_s > t_s:
                break
            given = sent.sticks
        return given

    def _inputs(self, index: int, from_s: float, to_s: float) -> list[tuple[float, float]]:
        """What stick `index` did between two times, as (duration [s], acceleration or speed)."""
        inputs, t_s, given = [], from_s, self._at(from_s)
        for sent in self._sent:
            if from_s < sent.from_s < to_s:
                inputs.append((sent.from_s - t_s, self._effect(index, given)))
                t_s, given = sent.from_s, sent.sticks
        if to_s > t_s:
            inputs.append((to_s - t_s, self._effect(index, given)))
        return inputs

    def _effect(self, index: int, sticks: Sticks) -> float:
        share, response = 0.01 * sticks[index], self._response
        if index < 2:
            return _GRAVITY_MPS2 * math.tan(share * response.max_tilt_rad)
        return share * (response.max_climb_mps if index == 2 else response.max_turn_rad_s)
