"""The relative state: where the aircraft is against the bar, how it moves, and what pushes it.

One Kalman filter of linear motion over a few axes that do not turn. A belief stands at one time; `Model.predicted`
moves it through a known input, `updated` takes a measurement of that very time. Both are pure.

The states of an axis, in the order of the indices below:

| index | state | unit |
|---|---|---|
| `PLACE` | of the aircraft against the bar's mean place | m |
| `SPEED` | its rate | m/s |
| `THRUST` | acceleration that the autopilot makes of the sticks, lagging | m/s² |
| `GUST` | acceleration by turbulence, coloured | m/s² |
| `PUSH` | acceleration by the mean wind and by what is not modelled, slow | m/s² |
| `REFERENCE` | the vehicle's own velocity less `SPEED`: the ship's way, optical flow's bias; slow | m/s |
| `SWING` | of the deck, and on a ship of the bar, about its mean place | m |
| `SWING_RATE` | its rate | m/s |
| | and the two of the waves that drive it (`Swing`) | |

With u the input, k the drag and T the lag: ṗ = v; v̇ = a + g + s − k v; ȧ = (U − a)/T, where U = u for a vehicle whose
sticks mean a tilt, and U = κ (u − v − c) for one that tracks a velocity over its own reference. A picture of a bar
that the ship carries shows p − o, and one of a bar that stands still p.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from shipland.compiled import compiled
from shipland.config import require
from shipland.estimation.kernels import STRIDE_MS, corrected, spread_after
from shipland.estimation.swing import SWING_STATES, Swing
from shipland.frames import Array

PLACE, SPEED, THRUST, GUST, PUSH, REFERENCE, SWING, SWING_RATE = range(8)
STATES = SWING + SWING_STATES
"""Of one axis."""


@dataclass(frozen=True)
class Motion:
    """How the vehicle moves along an axis.

    Attributes:
        lag_s: of the acceleration behind what is asked for.
        drag_per_s: deceleration for a metre per second.
        servo_per_s: zero where the input is an acceleration; else the gain from speed error to acceleration.
        over_ship: share of ship in the optical flow's view that the servo flies on; the rest does not swing.
        settle_s: time in which the servo's own velocity follows the motion of what is in view.
        integral_per_s2: gain from the integral of the servo's speed error to acceleration; zero where it has none.
        approach_per_s, smoothing_s: of the speed that a servo with an integral tracks, behind the one asked for.
        gain: of an input that is an acceleration: by what factor it does more than it should.
    """

    lag_s: float
    drag_per_s: float
    servo_per_s: float = 0.0
    over_ship: float = 0.0
    settle_s: float = 0.0
    integral_per_s2: float = 0.0
    approach_per_s: float = 0.0
    smoothing_s: float = 0.0
    gain: float = 1.0

    @property
    def inputs(self) -> int:
        """Of one axis: the input; for a servo with an integral its tracked speed r, first as r + ṙ/κ, then alone."""
        return 2 if self.integral_per_s2 > 0.0 else 1


@dataclass(frozen=True)
class Disturbances:
    """Sizes of what is not known: standard deviations and correlation times.

    Attributes:
        gust_mps2, gust_time_s: acceleration by turbulence.
        push_mps2, push_time_s: acceleration by the mean wind.
        reference_mps, reference_time_s: the velocity reference.
        speed_noise: power density of an acceleration without memory [m²/s³].
    """

    gust_mps2: float
    gust_time_s: float
    push_mps2: float
    push_time_s: float
    reference_mps: float
    reference_time_s: float
    speed_noise: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require(value >= 0.0, f"{name} must not be negative, got {value}")
            require(value > 0.0 or not name.endswith("_time_s"), f"{name} must be positive")


@dataclass(frozen=True)
class Belief:
    """The state of all axes and its covariance at one time.

    Attributes:
        t_s: the time that it holds for.
        mean: (STATES × axes,) axis by axis.
        covariance: square of that size.
    """

    t_s: float
    mean: Array
    covariance: Array

    def of(self, state: int) -> Array:
        """(axes,) the mean of one state on every axis."""
        return np.asarray(self.mean[state::STATES])


def dynamics(motion: Motion, noise: Disturbances, swing: Swing) -> tuple[Array, Array, Array]:
    """Continuous time, one axis: matrix (n,n), input matrix (n, inputs), noise densities (n,), n = STATES."""
    a, b, q = np.zeros((STATES, STATES)), np.zeros((STATES, motion.inputs)), np.zeros(STATES)
    a[PLACE, SPEED] = 1.0
    a[SPEED, [SPEED, THRUST, GUST, PUSH]] = -motion.drag_per_s, 1.0, 1.0, 1.0
    a[THRUST, THRUST] = -1.0 / motion.lag_s
    gain = motion.servo_per_s if motion.servo_per_s > 0.0 else motion.gain
    b[THRUST, 0] = gain / motion.lag_s
    if motion.servo_per_s > 0.0:
        _, own = velocity_of(np.zeros(STATES), 1, motion.over_ship, motion.settle_s, swing.frequency_rad_s, swing.below)
        a[THRUST] -= gain / motion.lag_s * own[0]
        a[PUSH] -= motion.integral_per_s2 * own[0]
        b[PUSH, 1:] = motion.integral_per_s2
    slow = ((GUST, noise.gust_mps2, noise.gust_time_s), (PUSH, noise.push_mps2, noise.push_time_s))
    for state, deviation, time_s in (*slow, (REFERENCE, noise.reference_mps, noise.reference_time_s)):
        a[state, state] -= 1.0 / time_s
        q[state] = 2.0 * deviation**2 / time_s
    a[SWING:, SWING:], q[SWING:] = swing.matrix, swing.noise
    q[SPEED] = noise.speed_noise
    return a, b, q


def shaping(motion: Motion) -> tuple[Array, Array]:
    """Continuous time, of a servo's tracked speed and its rate: matrix (2,2), input vector (2,)."""
    a = np.array([[0.0, 1.0], [-motion.approach_per_s / motion.smoothing_s, -1.0 / motion.smoothing_s]])
    return a, np.array([0.0, motion.approach_per_s / motion.smoothing_s])


def discretised(a: Array, b: Array, q: Array, step_s: float) -> tuple[Array, Array, Array]:
    """Transition (n,n), input (n,m) and noise covariance (n,n) of a step (C. Van Loan, 1978)."""
    n, m = b.shape
    with_input = np.zeros((n + m, n + m))
    with_input[:n, :n], with_input[:n, n:] = a, b
    moved = expm(with_input * step_s)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -a, np.diag(q), a.T
    result = expm(block * step_s)
    transition = result[n:, n:].T
    covariance = transition @ result[:n, n:]
    return moved[:n, :n], moved[:n, n:], 0.5 * (covariance + covariance.T)


@dataclass(frozen=True)
class Spread:
    """How a swing spreads over the axes of the ship, as shares of the heave that it was judged by.

    Attributes:
        along, across: of the ship: surge and sway.
        along_rad: direction of the ship's axis in the axes of the flight.
    """

    along: float
    across: float
    along_rad: float = 0.0

    @property
    def shape(self) -> Array:
        """(2,2) squared shares, in the axes of the flight."""
        ahead = np.array([math.cos(self.along_rad), math.sin(self.along_rad)])
        aside = np.array([-ahead[1], ahead[0]])
        return self.along**2 * np.outer(ahead, ahead) + self.across**2 * np.outer(aside, aside)


class Model:
    """Steps of any length over one or more equal axes; matrices are kept, by whole milliseconds.

    Args:
        axes: how many.
        motion: of the vehicle.
        noise: what is not known.
        swing: of the bar.
        spread: of the swing over two axes; None where it is alike on every axis.
    """

    def __init__(
        self, axes: int, motion: Motion, noise: Disturbances, swing: Swing, spread: Spread | None = None
    ) -> None:
        self.axes, self.motion, self.noise, self.swing = axes, motion, noise, swing
        self._shape = np.eye(axes) if spread is None else spread.shape
        self._ways: dict[int, Array] = {}

    def step(self, step_ms: int) -> tuple[Array, Array, Array]:
        """Transition (n,n), input matrix (n, axes) and noise (n,n) over whole milliseconds."""
        transition, noise, inputs = self.way(step_ms)[:3]
        return transition, inputs[:, : self.axes * self.motion.inputs], noise

    def way(self, way_ms: int) -> Array:
        """What `mean_after` and `spread_after` take over whole milliseconds: (3,n,n) transition, noise and input.

        Of a way of a stride or more (7,n,n): transition and input of a stride, then those of the rest, come after
        these. Inputs are filled up with zeros on their right.
        """
        found = self._ways.get(way_ms)
        if found is None:
            found = self._ways[way_ms] = self._solved(way_ms)
        return found

    def _solved(self, way_ms: int) -> Array:
        size, inputs = STATES * self.axes, self.axes * self.motion.inputs
        way = np.zeros((7 if way_ms >= STRIDE_MS else 3, size, size))
        transition, covariance, entries = way[:3]
        if way_ms == 0:
            transition[:] = np.eye(size)
            return way
        one, push, noise, swing_noise = _axis_step(self.motion, self.noise, self.swing, way_ms)
        for axis in range(self.axes):
            rows = _rows(axis)
            transition[rows, rows], covariance[rows, rows], entries[rows, axis : inputs : self.axes] = one, noise, push
            for other in range(self.axes):
                covariance[rows, _rows(other)] += self._shape[axis, other] * swing_noise
        if way_ms >= STRIDE_MS:
            way[3:5] = way[[0, 2]] if way_ms == STRIDE_MS else self.way(STRIDE_MS)[[0, 2]]
            way[5:7] = self.way(way_ms % STRIDE_MS)[[0, 2]]
        return way

    def _swing_spread(self) -> Array:
        """(n,n) covariance of the swing while nothing is known of it; zero for all else."""
        size = STATES * self.axes
        covariance = np.zeros((size, size))
        for axis in range(self.axes):
            for other in range(self.axes):
                covariance[_swing(axis), _swing(other)] = self._shape[axis, other] * self.swing.spread
        return covariance

    def start(self, t_s: float, place_m: Array, covariance_m2: Array, speed_mps: float, way_mps: float = 0.0) -> Belief:
        """A belief from a first place (axes,) with its covariance (axes, axes).

        Args:
            t_s: of the place.
            place_m: from the bar.
            covariance_m2: of it.
            speed_mps: standard deviation of the speed, for a ship that lies still.
            way_mps: standard deviation of the ship's way.
        """
        noise = self.noise
        spreads = [0.0, math.hypot(speed_mps, way_mps), 0.5, noise.gust_mps2, noise.push_mps2]
        spreads.append(max(noise.reference_mps, way_mps))
        deviation = np.array([*spreads, *[0.0] * (STATES - SWING)] * self.axes)
        mean, covariance = np.zeros(len(deviation)), np.diag(deviation**2) + self._swing_spread()
        mean[PLACE::STATES] = place_m
        covariance[PLACE::STATES, PLACE::STATES] = covariance_m2
        return Belief(t_s, mean, covariance)

    def adopted(self, belief: Belief, before: Swing) -> Belief:
        """A belief of a model with the swing `before`.

        Where the bar swings by both the belief is kept. Else the offset from the bar is kept, and the swing is learned
        anew.
        """
        if before.carries_bar and self.swing.carries_bar:
            return belief
        n = len(belief.mean)
        forget, share = np.eye(n), np.eye(n)
        for axis in range(self.axes):
            first = STATES * axis
            forget[first + PLACE, first + SWING] = forget[first + SPEED, first + SWING_RATE] = -before.shown
            forget[_swing(axis), _swing(axis)] = 0.0
            # The bar's mean place is as uncertain as its swing, and in step with it: their difference is what is seen.
            share[first + PLACE, first + SWING] = share[first + SPEED, first + SWING_RATE] = self.swing.shown
        spread = share @ (forget @ belief.covariance @ forget.T + self._swing_spread()) @ share.T
        return Belief(belief.t_s, forget @ belief.mean, spread)

    def predicted(self, belief: Belief, step_ms: int, given: Array) -> Belief:
        """The belief after a step through the input `given` (axes,), constant meanwhile."""
        transition, inputs, noise = self.step(step_ms)
        return Belief(
            belief.t_s + 1e-3 * step_ms,
            transition @ belief.mean + inputs @ given,
            spread_after(transition, belief.covariance, noise),
        )

    def seen(self, belief: Belief) -> tuple[Array, Array]:
        """What a picture shows of the place: expected value (axes,) and its Jacobian (axes, n)."""
        return seen_of(belief.mean, self.axes, self.swing.shown)

    def velocity(self, belief: Belief, over_ship: float = 0.0, settle_s: float = 0.0) -> tuple[Array, Array]:
        """What the vehicle measures of its own velocity: expected value (axes,) and its Jacobian (axes, n).

        Args:
            belief: at the measurement's time.
            over_ship: share of the optical flow's view that is ship, and so swings with the bar.
            settle_s: time in which the vehicle's fusion follows the motion of what is in view; the lag of a resonator
                is a mixture of its two states.
        """
        return velocity_of(belief.mean, self.axes, over_ship, settle_s, self.swing.frequency_rad_s, self.swing.below)


@lru_cache(maxsize=4096)
def _axis_step(motion: Motion, noise: Disturbances, swing: Swing, step_ms: int) -> tuple[Array, Array, Array, Array]:
    """Of one axis over whole milliseconds: transition, inputs, noise but for the swing's, and the swing's."""
    longest_ms = 1 << (step_ms.bit_length() - 1)
    if longest_ms < step_ms:  # of two steps: far cheaper than matrix exponentials
        first, push, rest, swung = _axis_step(motion, noise, swing, longest_ms)
        then, then_push, then_rest, then_swung = _axis_step(motion, noise, swing, step_ms - longest_ms)
        spread = spread_after(then, rest, then_rest), spread_after(then, swung, then_swung)
        return then @ first, then @ push + then_push, *spread
    a, b, q = dynamics(motion, noise, swing)
    swing_q = np.zeros(STATES)
    swing_q[SWING:] = q[SWING:]
    transition, push, swung = discretised(a, b, swing_q, 1e-3 * step_ms)
    return transition, push, discretised(a, b, q - swing_q, 1e-3 * step_ms)[2], swung


def _rows(axis: int) -> slice:
    """The states of an axis."""
    return slice(STATES * axis, STATES * (axis + 1))


def _swing(axis: int) -> slice:
    """The swing's states of an axis."""
    return slice(STATES * axis + SWING, STATES * (axis + 1))


@compiled
def seen_of(mean: Array, axes: int, shown: float) -> tuple[Array, Array]:
    """`Model.seen` of a mean, where the bar shows this share of the swing."""
    expected, jacobian = np.zeros(axes), np.zeros((axes, len(mean)))
    for axis in range(axes):
        first = STATES * axis
        expected[axis] = mean[first + PLACE] - shown * mean[first + SWING]
        jacobian[axis, first + PLACE], jacobian[axis, first + SWING] = 1.0, -shown
    return expected, jacobian


@compiled
def less_swing(mean: Array, share: float) -> tuple[Array, Array]:
    """(axes,) place less a share of the swing, and its rate, from the mean of all states."""
    axes = len(mean) // STATES
    place, rate = np.empty(axes), np.empty(axes)
    for axis in range(axes):
        first = STATES * axis
        place[axis] = mean[first + PLACE] - share * mean[first + SWING]
        rate[axis] = mean[first + SPEED] - share * mean[first + SWING_RATE]
    return place, rate


@compiled
def spread_of_place(covariance: Array, shown: float) -> Array:
    """(axes, axes) covariance of the place less the `shown` share of the swing, from that of all states."""
    axes = len(covariance) // STATES
    result = np.empty((axes, axes))
    for i in range(axes):
        for j in range(axes):
            a, b = STATES * i, STATES * j
            both = covariance[a + PLACE, b + PLACE] + shown * shown * covariance[a + SWING, b + SWING]
            result[i, j] = both - shown * (covariance[a + PLACE, b + SWING] + covariance[b + PLACE, a + SWING])
    return result


@compiled
def velocity_of(
    mean: Array, axes: int, over_ship: float, settle_s: float, w: float, below: float
) -> tuple[Array, Array]:
    """`Model.velocity` of a mean, with a swing of frequency `w` [rad/s] that the ship has this share of `below`."""
    share = below * over_ship / (1.0 + (w * settle_s) ** 2)
    expected, jacobian = np.zeros(axes), np.zeros((axes, len(mean)))
    for axis in range(axes):
        for state, entry in (
            (SPEED, 1.0),
            (REFERENCE, 1.0 - over_ship),
            (SWING, -share * settle_s * w * w),
            (SWING_RATE, -share),
        ):
            jacobian[axis, STATES * axis + state] = entry
            expected[axis] += entry * mean[STATES * axis + state]
    return expected, jacobian


@dataclass(frozen=True)
class Taken:
    """A belief after a measurement.

    Attributes:
        belief: as it is now; as it was where the measurement was refused.
        normalised: the innovation squared over its covariance, chi-squared of the measurement's size where all is well.
        accepted: it was finite and inside the gate.
    """

    belief: Belief
    normalised: float
    accepted: bool


def updated(
    belief: Belief, expected: tuple[Array, Array], measured: Array, covariance: Array, gate: float = math.inf
) -> Taken:
    """Take a measurement (m,) with covariance (m,m) of the belief's own time, unless it is astray.

    Args:
        belief: before.
        expected: (m,) and its Jacobian (m,n): `Model.seen`, `Model.velocity`.
        measured: the measurement.
        covariance: of its error.
        gate: largest normalised innovation squared that is taken.
    """
    predicted, jacobian = expected
    mean, after, normalised = corrected(belief.mean, belief.covariance, jacobian, measured - predicted, covariance)
    if not normalised <= gate:  # NaN too
        return Taken(belief, normalised, False)
    return Taken(Belief(belief.t_s, mean, after), normalised, True)
