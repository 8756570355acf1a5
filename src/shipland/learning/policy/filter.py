"""The pilot's estimator as constant matrices: with one schedule of measurements its gains do not depend on the data.

The pilot `horizon` filters each axis at the newest picture's exposure and looks ahead to its command's effect. Cycle
by cycle its covariance goes through the same values whatever is measured, so that after some seconds the gains repeat
with the velocity readings. They are found here once, from the pilot's own model (`estimation.relative_state`), and the
batched flights share them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from shipland.estimation.relative_state import (
    STATES,
    AxisModel,
    Disturbances,
    Model,
    discretised,
    dynamics,
)
from shipland.estimation.wave_motion import WaveMotion
from shipland.frames import Array
from shipland.learning.policy.setup import PhaseSetup

AXES = 3
"""Forward, starboard, down of the bar."""
_SETTLED_S = 20.0
_FIRST_MPS = 1.5
POSE_M = (0.0003, 0.00055, 0.0014)
"""Standard deviation of a pose's place over the deck, 2.15 m from the bar: of flights in the simulator."""
POSE_RANGE_M, POSE_POWERS = 2.15, (2.1, 2.8, 1.3)
"""It grows with these powers of the range: of the same flights, to 12 m."""
VIEWS = 2
"""What the optical flow sees: no ship, or nothing else."""


@dataclass(frozen=True)
class EstimatorTables:
    """Matrices of the estimator; the last axis of every gain is the state.

    Attributes:
        step: (3, 10, 10) of a cycle, and `step_inputs` (3, 10, m) for the m newest commands, newest first.
        ahead, ahead_inputs: from the newest picture to the next command's effect.
        reading, reading_inputs: (phases, 3, 10, …) from the newest picture to the velocity reading that waits.
        rest: (phases, 3, 10, 10) from that reading to the effect.
        seen: (3, 10) what a picture shows.
        velocity: (views, 3, 10) what a velocity reading shows.
        picture_gain, velocity_gain, ahead_gain: (levels, views, phases, 3, 10); phase 0 has a velocity of the picture's
            own time.
        deviation: (levels, 3, 10) of the estimate.
    """

    step: Array
    step_inputs: Array
    ahead: Array
    ahead_inputs: Array
    reading: Array
    reading_inputs: Array
    rest: Array
    seen: Array
    velocity: Array
    picture_gain: Array
    velocity_gain: Array
    ahead_gain: Array
    deviation: Array


@dataclass(frozen=True)
class _Axis:
    motion: AxisModel
    noise: Disturbances
    wave: WaveMotion
    picture_m2: float
    velocity_m2ps2: float


def estimated_wave(setup: PhaseSetup, heave_m: float, rate_mps: float) -> WaveMotion:
    """The hypothesis of the pilot's bank that a bar's heave (standard deviation of it and of its rate) leads to."""
    parameters = setup.horizon.wave
    if heave_m < parameters.still_m:
        return parameters.believed[0]

    def apart(wave: WaveMotion) -> float:
        return abs(math.log(wave.deviation_m / heave_m)) + abs(math.log(wave.frequency_rad_s * heave_m / rate_mps))

    return min(parameters.believed[1:], key=apart)


def level_of(setup: PhaseSetup, wind_mps2: float, carried: bool) -> int:
    """Index of the level of gusts that the pilot takes for a steady push."""
    horizon = setup.horizon
    share = horizon.gust_share_at_sea if carried else horizon.gust_share
    wanted = max(share * wind_mps2, 1e-3)
    return min(range(len(horizon.gust_levels_mps2)), key=lambda i: abs(math.log(horizon.gust_levels_mps2[i] / wanted)))


def estimator_tables(setup: PhaseSetup, wave: WaveMotion) -> EstimatorTables:
    """Solve for one scenario and one wave motion of the bar."""
    h, phases = setup.cycle_s, setup.velocity_every
    response = setup.response
    delay_s = response.uplink_s + response.dead_time_s
    count = math.ceil((setup.picture_age_s + h + delay_s) / h) + 1
    spans = _Spans(h, delay_s, count)
    levels = [setup.horizon.horizontal_at(level) for level in setup.horizon.gust_levels_mps2]
    shape = {name: np.zeros((AXES, STATES, STATES)) for name in ("step", "ahead")}
    shape |= {f"{name}_inputs": np.zeros((AXES, STATES, count)) for name in ("step", "ahead")}
    shape |= {name: np.zeros((phases, AXES, STATES, STATES)) for name in ("reading", "rest")}
    shape["reading_inputs"] = np.zeros((phases, AXES, STATES, count))
    seen, velocity = np.zeros((AXES, STATES)), np.zeros((VIEWS, AXES, STATES))
    gains = {
        f"{name}_gain": np.zeros((len(levels), VIEWS, phases, AXES, STATES))
        for name in ("picture", "velocity", "ahead")
    }
    deviation = np.zeros((len(levels), AXES, STATES))
    age_s = setup.picture_age_s
    for axis in range(AXES):
        for level, noise in enumerate(levels):
            parts = _axis(setup, wave, axis, noise)
            model = Model(1, parts.motion, parts.noise, parts.wave)
            start = model.start(0.0, np.zeros(1), np.eye(1) * 0.1, _FIRST_MPS)
            seen[axis] = model.pose(start)[1][0]
            for view in range(VIEWS):
                over_ship = float(view) if axis < 2 and setup.horizon.measured.flow else 0.0
                velocity[view, axis] = model.velocity(start, over_ship, setup.horizon.delayed.flow_settle_s)[1][0]
                found = _riccati(setup, parts, seen[axis], velocity[view, axis], start.covariance)
                for name in ("picture", "velocity", "ahead"):
                    gains[f"{name}_gain"][level, view, :, axis] = found[name]
                deviation[level, axis] = found["deviation"]
        a, b, _ = dynamics(parts.motion, parts.noise, parts.wave)
        shape["step"][axis], shape["step_inputs"][axis] = spans.between(a, b, -age_s - h, -age_s)
        shape["ahead"][axis], shape["ahead_inputs"][axis] = spans.between(a, b, -age_s, delay_s)
        for phase in range(phases):
            at_s = -age_s + (phases - phase) * h
            shape["reading"][phase, axis], shape["reading_inputs"][phase, axis] = spans.between(a, b, -age_s, at_s)
            shape["rest"][phase, axis] = spans.between(a, b, at_s, delay_s)[0]
    return EstimatorTables(**shape, **gains, seen=seen, velocity=velocity, deviation=deviation)


def _axis(setup: PhaseSetup, wave: WaveMotion, axis: int, horizontal: Disturbances) -> _Axis:
    """What the pilot takes one axis for."""
    horizon, response = setup.horizon, setup.response
    measured = horizon.measured
    floor = (measured.place_m + measured.place_share * POSE_RANGE_M) ** 2
    picture = floor + POSE_M[axis] ** 2
    if axis == 2:
        climb = AxisModel(0.05, 0.0, 1.0 / response.climb_lag_s)
        return _Axis(climb, horizon.vertical, wave, picture, measured.velocity_down_mps**2)
    if wave.bar_moves:
        spread = horizon.wave.spread
        wave = replace(wave, deviation_m=wave.deviation_m * (spread.along if axis == 0 else spread.across))
    motion = AxisModel(response.lag_s, response.drag_per_s)
    return _Axis(motion, horizontal, wave, picture, measured.velocity_mps**2)


def _riccati(setup: PhaseSetup, parts: _Axis, seen: Array, velocity: Array, first: Array) -> dict[str, Array]:
    """Gains of the last period after some seconds: picture, velocity, look-ahead; and the deviation."""
    phases, has_velocity = setup.velocity_every, setup.velocity_hz > 0.0
    a, b, q = dynamics(parts.motion, parts.noise, parts.wave)
    forward, _, noise = discretised(a, b, q, setup.cycle_s)
    gains = {name: np.zeros((phases, STATES)) for name in ("picture", "velocity", "ahead")}
    p = first.copy()
    for cycle in range(phases * round(_SETTLED_S / setup.cycle_s / phases)):
        phase = cycle % phases
        p = forward @ p @ forward.T + noise
        if phase == 0 and has_velocity:
            gains["velocity"][phase], p = _updated(p, velocity, parts.velocity_m2ps2)
        gains["picture"][phase], p = _updated(p, seen, parts.picture_m2)
        later = p
        for _ in range(phases - phase):
            later = forward @ later @ forward.T + noise
        if has_velocity:
            gains["ahead"][phase] = _updated(later, velocity, parts.velocity_m2ps2)[0]
    return gains | {"deviation": np.sqrt(np.maximum(np.diag(p), 0.0))}


def _updated(p: Array, row: Array, variance: float) -> tuple[Array, Array]:
    gain = p @ row / (row @ p @ row + variance)
    left = np.eye(STATES) - np.outer(gain, row)
    return gain, left @ p @ left.T + variance * np.outer(gain, gain)


class _Spans:
    """Motion through commands that each hold for a cycle, from `delay_s` after they were ready.

    Args:
        cycle_s: of commands.
        delay_s: from being ready to the effect.
        count: how many are kept, newest first; the newest was ready a cycle before now, which is time zero.
    """

    def __init__(self, cycle_s: float, delay_s: float, count: int) -> None:
        self._cycle_s, self._delay_s, self._count = cycle_s, delay_s, count

    def between(self, a: Array, b: Array, from_s: float, to_s: float) -> tuple[Array, Array]:
        """Transition (10,10) and input matrix (10, count) from one time to another."""
        edges = self._delay_s - self._cycle_s * np.arange(self._count)
        cuts = sorted({from_s, to_s, *(float(edge) for edge in edges if from_s < edge < to_s)})
        transition, inputs = np.eye(STATES), np.zeros((STATES, self._count))
        for begin_s, end_s in pairwise(cuts):
            # Command i holds from edge i + 1 to edge i; the newest goes on holding.
            which = max(int(np.ceil((self._delay_s - 0.5 * (begin_s + end_s)) / self._cycle_s)) - 1, 0)
            move, push, _ = discretised(a, b[:, :1], np.zeros(STATES), end_s - begin_s)
            transition, inputs = move @ transition, move @ inputs
            inputs[:, min(which, self._count - 1)] += push[:, 0]
        return transition, inputs
