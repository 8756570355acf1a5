"""Near control by model predictive control to the waves that a spectrum of the observed motion predicts.

The idea of MPC-NE [Gupta2023]: the vessel's oscillation, seen by the camera alone, is decomposed online into a few
waves and predicted, a controller of finite horizon flies to the prediction, and the descent waits for a good moment.
Here the bar's place is what the pose adds to the vehicle's own travel; the peaks of its discrete Fourier transform give
the frequencies, least squares the amplitudes and phases. The quadratic programme of each axis, with limits of input and
speed, is solved by OSQP (`programme`).

[Gupta2023] Gupta, Pairet, Nascimento, Saska: Landing a UAV in harsh winds and turbulent open waters, IEEE RA-L 8(2),
arXiv 2301.00255. Not theirs: the model (linear, by axes), the weights, and that the moment is one of small heave rate;
theirs is one of small tilt, which a level bar does not show. None of their figures is reproduced.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from shipland.extras import require
from shipland.frames import Array, rotated, rotation_from_euler, wrap_angle
from shipland.guidance.laws import clamp
from shipland.guidance.mode_pilot import ModePilot
from shipland.guidance.near import HOLD, MeasuredError, NearEstimate, SticksPercent
from shipland.guidance.parameters import SpectralMpcParameters
from shipland.guidance.response import Response
from shipland.guidance.rivals.programme import STEPS, Axis
from shipland.guidance.rivals.waves import STEP_S, Waves
from shipland.guidance.situation import PositionEstimate
from shipland.messages import Decision, Observation, PilotCommand, Telemetry

_LONGEST_GAP_S = 1.0
_DOWN: Array = np.array([1.0, 1.0, -1.0])
_STD_M, _STD = 0.01, 0.01
"""Standard deviation of a place of the reference [m], and its growth with the distance from there."""
_QUICK_S = 0.05
"""Lag of the vertical acceleration, of which a response tells nothing but that of the speed."""


class SpectralMpc:
    """A `NearControl` along the compass's axes; without a compass, the bar's.

    Args:
        parameters: window, weights, limits.
        response: what the sticks do on this vehicle; the model of the programmes.

    Raises:
        SystemLibraryError: OSQP is not installed.
    """

    def __init__(self, parameters: SpectralMpcParameters, response: Response) -> None:
        require("mpc", "pilot spectral_mpc")
        self.parameters, self.response = parameters, response
        drag_per_s = 0.0 if response.servo_per_s > 0.0 else response.drag_per_s
        level = Axis(response.servo_per_s, response.lag_s, drag_per_s, response.full_input, parameters)
        climb = Axis(1.0 / response.climb_lag_s, _QUICK_S, 0.0, response.max_climb_mps, parameters)
        self._axes = (level, level, climb)
        self._estimate: NearEstimate | None = None
        self._track: deque[tuple[float, Array]] = deque()
        """Exposures; the reference's place from where the vehicle's travel began and its standard deviation."""
        self._travel: deque[tuple[float, Array]] = deque(maxlen=60)
        self._state: Array = np.zeros((3, 3))
        """Place, speed and acceleration, by axes, at the last telemetry."""
        self._inputs, self._disturbance_mps2 = np.zeros(3), np.zeros(3)
        self._now_s = self._turn_rad = 0.0
        self.waves: Waves | None = None
        self.trouble = ""
        """Why the last sticks are not the programmes'; empty where they are."""

    def observe(self, measured: MeasuredError) -> NearEstimate:
        """The pose to the track of the bar, the vehicle's velocity to its travel and to the wind's estimate."""
        self._now_s = measured.t_s + measured.age_s
        # Axes of the compass, where there is one: far off, the pose's own yaw would turn the target about the aircraft.
        self._turn_rad = measured.yaw_rad if measured.heading_rad is None else measured.heading_rad
        axes_from_level = rotation_from_euler(0.0, 0.0, self._turn_rad)
        told_mps = measured.velocity_in_level_mps
        told = told_mps is not None and bool(np.isfinite(told_mps).all())
        self._move(
            self._now_s if measured.velocity_t_s is None else measured.velocity_t_s,
            axes_from_level @ told_mps if told and told_mps is not None else None,
        )
        times_s, places_m = [t_s for t_s, _ in self._travel], np.array([place_m for _, place_m in self._travel])
        own_m = np.array([np.interp(measured.t_s, times_s, places_m[:, axis]) for axis in range(3)])
        away_m = measured.error_in_level_m * _DOWN
        std_m = _STD_M + _STD * float(np.linalg.norm(away_m))
        self._track.append((measured.t_s, np.append(own_m + axes_from_level @ away_m, std_m)))
        while measured.t_s - self._track[0][0] > self.parameters.window_s:
            self._track.popleft()
        self.waves = self._decomposed()
        rate_mps = np.zeros(3)
        if self.waves is not None:
            speeds_mps = self.waves.at(np.array([measured.t_s]))[1][0]
            rate_mps = _DOWN * (axes_from_level.T @ (speeds_mps - self._state[:, 1]))
        self._estimate = NearEstimate(
            measured.t_s, measured.error_in_level_m, rate_mps, measured.yaw_rad, measured.bar_elevation_rad
        )
        return self._estimate

    def _move(self, t_s: float, own_mps: Array | None) -> None:
        """The model to `t_s` with the inputs flown; what the vehicle's velocity then differs by is the wind's."""
        gap_s = t_s - self._travel[-1][0] if self._travel else 0.0
        if self._travel and gap_s <= 0.0:
            return
        if gap_s > _LONGEST_GAP_S:
            self._track.clear()
            self._travel.clear()
            gap_s = 0.0
        for index, axis in enumerate(self._axes):
            state, push = self._state[index], float(self._disturbance_mps2[index])
            predicted = axis.after(state, push, float(self._inputs[index]), gap_s) if gap_s > 0.0 else state
            if own_mps is not None:
                if gap_s > 0.0:
                    share = -math.expm1(-gap_s * self.parameters.disturbance_per_s)
                    self._disturbance_mps2[index] += share * float(own_mps[index] - predicted[1]) / gap_s
                place_m = state[0] + 0.5 * gap_s * (state[1] + own_mps[index])
                predicted = np.array([place_m, own_mps[index], predicted[2]])
            self._state[index] = predicted
        self._travel.append((t_s, self._state[:, 0].copy()))

    def _decomposed(self) -> Waves | None:
        """The waves of the track; None while it is too short for a speed."""
        times_s, places_m = [t_s for t_s, _ in self._track], np.array([place_m for _, place_m in self._track])
        count = int((times_s[-1] - times_s[0]) / STEP_S) + 1
        if count < 4:
            return None
        even_s = times_s[-1] + STEP_S * np.arange(1 - count, 1)
        series_m = np.column_stack([np.interp(even_s, times_s, places_m[:, axis]) for axis in range(4)])
        return Waves(self.parameters, series_m[:, :3], series_m[:, 3], times_s[-1])

    def sticks(self, wanted_yaw_rad: float) -> SticksPercent:
        """The first inputs of the horizons; zero before the track has a speed, and where a programme is not solved."""
        estimate, response = self._estimate, self.response
        if estimate is None or self.waves is None:
            return HOLD
        delay_s = self._now_s - self._travel[-1][0] + response.uplink_s + response.dead_time_s
        places_m, speeds_mps = self.waves.at(self._travel[-1][0] + delay_s + STEP_S * np.arange(1.0, STEPS + 1.0))
        self.trouble = ""
        for index, axis in enumerate(self._axes):
            push, before = float(self._disturbance_mps2[index]), float(self._inputs[index])
            ahead = axis.after(self._state[index], push, before, delay_s)
            target = np.column_stack([places_m[:, index], speeds_mps[:, index]])
            found = axis.input(ahead, push, target, before)
            if found is None:
                self.trouble = "the programme of an axis was not solved: sticks released"
                self._inputs[:] = 0.0
                return HOLD
            self._inputs[index] = found
        pitch, roll = (response.stick_of(float(value)) for value in rotated(self._inputs[:2], -self._turn_rad))
        turn_rad_s = self.parameters.turn_per_s * wrap_angle(wanted_yaw_rad - estimate.yaw_rad)
        return SticksPercent(
            clamp(pitch, 100.0),
            clamp(roll, 100.0),
            clamp(-100.0 * float(self._inputs[2]) / response.max_climb_mps, 100.0),
            clamp(100.0 * turn_rad_s / response.max_turn_rad_s, 100.0),
        )

    def heave_mps(self, ahead_s: float) -> float:
        """Predicted rate of the reference's height, upward, so long after the last decision; 0 without a prediction."""
        if self.waves is None:
            return 0.0
        return -float(self.waves.at(np.array([self._now_s + ahead_s]))[1][0, 2])

    def reset(self) -> None:
        """Forget the track of the reference; the wind stays."""
        self._track.clear()
        self._estimate, self.waves, self.trouble = None, None, ""


class SpectralPilot(ModePilot):
    """The published modes; the descent goes with the predicted heave and waits while it would meet the deck fast."""

    _near: SpectralMpc

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """One cycle; never raises."""
        decision = super().decide(observation, telemetry, sent)
        return replace(decision, reason=self._near.trouble) if self._near.trouble else decision

    def _descent_percent(self, position: PositionEstimate) -> float:
        """Of the modes, relative to the deck."""
        percent, approach = super()._descent_percent(position), self._guidance.approach
        response, calm_mps = self._near.response, self._near.parameters.calm_mps
        if position.aircraft_in_bar_m is None or percent >= 0.0:
            return percent
        height_m = self._references.height_m(position.aircraft_in_bar_m)
        sink_mps = 0.01 * approach.descent_percent * response.max_climb_mps
        meets_mps = self._near.heave_mps(max(height_m, 0.0) / sink_mps)
        heave_mps = self._near.heave_mps(response.uplink_s + response.climb_lag_s)
        if height_m > approach.commit_height_m and abs(meets_mps) > calm_mps:
            return clamp(100.0 * heave_mps / response.max_climb_mps, 100.0)
        return clamp(100.0 * heave_mps / response.max_climb_mps - approach.descent_percent, 100.0)
