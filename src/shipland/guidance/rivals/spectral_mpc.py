"""Near control by model predictive control to the waves that a spectrum of the observed motion predicts.

The idea of MPC-NE [Gupta2023]: the vessel's oscillation, seen by the camera alone, is decomposed online into a few
waves and predicted, a controller of finite horizon flies to the prediction, and the descent waits for a good moment.
Here the bar's place is what the pose adds to the vehicle's own travel; the peaks of its discrete Fourier transform give
the frequencies, least squares the amplitudes and phases. The quadratic programme of each axis, with limits of input and
speed, is solved by OSQP [Stellato2020].

[Gupta2023] Gupta, Pairet, Nascimento, Saska: Landing a UAV in harsh winds and turbulent open waters, IEEE RA-L 8(2),
arXiv 2301.00255. Not theirs: the model (linear, by axes), the weights, and that the moment is one of small heave rate;
theirs is one of small tilt, which a level bar does not show. None of their figures is reproduced.

[Stellato2020] Stellato et al.: OSQP: an operator splitting solver for quadratic programs, Math. Prog. Comp. 12.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np
from scipy import linalg, sparse

from shipland.extras import require
from shipland.frames import Array, rotated, rotation_from_euler, wrap_angle
from shipland.guidance.mode_pilot import ModePilot
from shipland.guidance.near import MeasuredError, NearEstimate
from shipland.guidance.parameters import SpectralMpcParameters
from shipland.guidance.response import HOLD, Response, SticksPercent, clamp
from shipland.guidance.situation import PositionEstimate
from shipland.messages import Decision, Observation, PilotCommand, Telemetry

STEP_S, STEPS = 0.1, 20
"""Of the series that is decomposed and of the horizon; how many the horizon has."""
_ANCHOR_S = 0.5
"""Length of the motion whose mean the decomposition meets."""
_LINE_S = 1.0
"""Length of the motion that a straight line continues, before there is enough for a spectrum."""


class Waves:
    """Motion of one point as a straight line and a few waves.

    Args:
        parameters: of the decomposition.
        series_m: (n,k) its places, `STEP_S` apart.
        std_m: (n,) their standard deviations.
        end_s: time of the last.
    """

    def __init__(self, parameters: SpectralMpcParameters, series_m: Array, std_m: Array, end_s: float) -> None:
        count = len(series_m)
        self._end_s, self._rates_rad_s = end_s, np.zeros(0)
        if STEP_S * (count - 1) < parameters.least_s:
            series_m, std_m = series_m[-round(_LINE_S / STEP_S) :], std_m[-round(_LINE_S / STEP_S) :]
        else:
            self._rates_rad_s = _peaks_rad_s(series_m, 1.0 / std_m, parameters.waves)
        basis = self._basis(end_s + STEP_S * np.arange(1.0 - len(series_m), 1.0))
        self._factors = np.linalg.lstsq(basis / std_m[:, None], series_m / std_m[:, None], rcond=1e-3)[0]
        newest = slice(-round(_ANCHOR_S / STEP_S), None)  # what the line has not taken up of the travel's drift
        self._factors[0] += np.mean(series_m[newest] - basis[newest] @ self._factors, axis=0)

    def _basis(self, times_s: Array) -> Array:
        phase = np.outer(times_s - self._end_s, self._rates_rad_s)
        line = np.column_stack([np.ones_like(times_s), times_s - self._end_s])
        return np.hstack([line, np.cos(phase), np.sin(phase)])

    def at(self, times_s: Array) -> tuple[Array, Array]:
        """(n,k) places [m] and (n,k) speeds [m/s]."""
        ahead_s = 0.5 * STEP_S
        early, late = (self._basis(times_s + shift_s) @ self._factors for shift_s in (-ahead_s, ahead_s))
        return self._basis(times_s) @ self._factors, (late - early) / STEP_S


def _peaks_rad_s(series_m: Array, weights: Array, most: int) -> Array:
    """Rates of the largest peaks of the spectrum, summed over the axes; zero-padded fourfold, the line taken out."""
    count = len(series_m)
    line = np.column_stack([np.ones(count), np.arange(count)])
    weighted = weights[:, None] / weights.max()
    rest = weighted * (series_m - line @ np.linalg.lstsq(weighted * line, weighted * series_m, rcond=None)[0])
    power = np.sum(np.abs(np.fft.rfft(np.hanning(count)[:, None] * rest, 4 * count, axis=0)) ** 2, axis=1)
    top = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])) + 1
    rates_rad_s = 2.0 * np.pi * top / (4 * count * STEP_S)
    kept = rates_rad_s > 2.0 * np.pi / (count * STEP_S)  # slower ones are the line's
    top, rates_rad_s = top[kept], rates_rad_s[kept]
    return np.asarray(rates_rad_s[np.argsort(-power[top], kind="stable")[:most]])


_TICK_S = 1e-3
"""To which steps are rounded, so that their transitions are found once."""
_LEAD_S = 0.7
"""Travel at the limit of the speed by which the place aimed at leads, at most, and grows over the horizon."""


class Axis:
    """The programme of one axis over the inputs of the horizon: minimise ½ uᵀPu + qᵀu, limits on u and on the speed.

    State: place, speed, acceleration. acceleration' = (servo (u - speed) - acceleration) / lag, and where `servo_per_s`
    is 0 (u - acceleration) / lag; speed' = acceleration - drag speed + disturbance.

    Args:
        servo_per_s, lag_s, drag_per_s: of the model.
        most_input: limit of the input.
        parameters: weights, and the limit of the speed.
    """

    def __init__(
        self, servo_per_s: float, lag_s: float, drag_per_s: float, most_input: float, parameters: SpectralMpcParameters
    ) -> None:
        import osqp

        self._most_input, self._most_mps, self._step_weight = most_input, parameters.most_mps, parameters.step_weight
        rates = np.zeros((5, 5))  # place, speed, acceleration; input; disturbance
        rates[0, 1] = rates[1, 2] = rates[1, 4] = 1.0
        rates[1, 1], rates[2, 1:4] = -drag_per_s, np.array([-servo_per_s, -1.0, servo_per_s or 1.0]) / lag_s
        self._rates, self._steps = rates, dict[int, Array]()
        step = linalg.expm(STEP_S * rates)
        free, forced, power = [], np.zeros((STEPS, STEPS, 2)), [np.eye(3)]
        for _ in range(STEPS):
            power.append(step[:3, :3] @ power[-1])
        pushed = np.zeros(3)
        for k in range(STEPS):
            pushed = step[:3, :3] @ pushed + step[:3, 4]
            free.append(np.column_stack([power[k + 1], pushed])[:2])
            for i in range(k + 1):
                forced[k, i] = (power[k - i] @ step[:3, 3])[:2]
        self._free = np.array(free)
        self._places, self._speeds = forced[:, :, 0], forced[:, :, 1]
        change = np.eye(STEPS) - np.eye(STEPS, k=-1)
        self._weights = parameters.error_weight, parameters.speed_weight
        cost = (
            self._weights[0] * self._places.T @ self._places
            + self._weights[1] * self._speeds.T @ self._speeds
            + self._step_weight * change.T @ change
        )
        bounds = np.ones(2 * STEPS)
        self._solver = osqp.OSQP()
        self._solver.setup(
            sparse.csc_matrix(np.triu(cost)),
            np.zeros(STEPS),
            sparse.csc_matrix(np.vstack([np.eye(STEPS), self._speeds])),
            -bounds,
            bounds,
            verbose=False,
            adaptive_rho=False,  # its default times itself: the same flight would not be the same
            warm_starting=False,
            max_iter=2000,
            eps_abs=1e-3,
            eps_rel=1e-3,
        )

    def input(self, state: Array, disturbance: float, target: Array, before: float) -> float | None:
        """The first input of the horizon; None where the programme is not solved.

        Args:
            state: (3,) place [m], speed [m/s], acceleration [m/s²].
            disturbance: acceleration that nothing explains [m/s²].
            target: (STEPS, 2) place and speed at the end of each step.
            before: the input that is flown now.
        """
        free = self._free @ np.append(state, disturbance)
        far_m = float(target[0, 0] - state[0])
        beyond_m = np.maximum(abs(far_m) - self._most_mps * (_LEAD_S + STEP_S * np.arange(1.0, STEPS + 1.0)), 0.0)
        short = free - target
        short[:, 0] += np.copysign(beyond_m, far_m)
        slope = self._weights[0] * short[:, 0] @ self._places + self._weights[1] * short[:, 1] @ self._speeds
        slope[0] -= self._step_weight * before
        # Faster than the limit already, it is given no more than that: a programme without a solution helps nobody.
        most_mps = np.maximum(self._most_mps, np.abs(short[:, 1]).max() + 0.1)
        limits = np.full(STEPS, self._most_input)
        high = np.concatenate([limits, target[:, 1] + most_mps - free[:, 1]])
        low = np.concatenate([-limits, target[:, 1] - most_mps - free[:, 1]])
        if not (np.isfinite(slope).all() and np.isfinite(high).all()):
            return None
        self._solver.update(q=slope, l=low, u=high)
        found = self._solver.solve(raise_error=False)
        usable = found.info.status_val in (1, 2) and np.isfinite(found.x).all()  # solved, or nearly
        return clamp(float(found.x[0]), self._most_input) if usable else None

    def after(self, state: Array, disturbance: float, given: float, step_s: float) -> Array:
        """(3,) state after a step with one input, to the millisecond."""
        whole = np.array([*state.tolist(), given, disturbance])
        ticks = round(step_s / _TICK_S)
        if ticks not in self._steps:
            self._steps[ticks] = linalg.expm(ticks * _TICK_S * self._rates)
        return np.asarray((self._steps[ticks] @ whole)[:3])


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
        heave_mps = self._near.heave_mps(response.uplink_s + response.climb_dead_s + response.climb_lag_s)
        if height_m > approach.commit_height_m and abs(meets_mps) > calm_mps:
            return clamp(100.0 * heave_mps / response.max_climb_mps, 100.0)
        return clamp(100.0 * heave_mps / response.max_climb_mps - approach.descent_percent, 100.0)
