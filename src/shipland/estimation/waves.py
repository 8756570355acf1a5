"""Wave motion of a deck, and of a bar that a ship carries, about its mean place; which of several the bar has.

A wave motion is a resonator that waves drive. Waves are no white noise: their force oscillates itself, within a band.
With o the wave motion and d the waves' own

    ö + 2 ζ ω₁ ȯ + ω₁² o = ḋ,    d̈ + 2 ζ ω₂ ḋ + ω₂² d = white noise,

the spectrum of o vanishes with ω towards long waves and with ω⁻⁶ towards short ones, as that of a hull's heave and
sway does. ω₁ and ω₂ lie either side of the frequency that the wave motion is named by.

Whether the bar moves, how far and how fast, a bank of hypotheses on its heave tells. Downward the aircraft does what
its climb sticks say and little else, so that what pictures show beyond that is the bar's heave. Each hypothesis is a
small Kalman filter of height, drift and wave motion; all move at once as arrays. They are weighted by the likelihood
of their innovations, with a fading memory.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from shipland.config import key, parameters, require, scaled
from shipland.estimation.kernels import see_bank
from shipland.frames import Array

WAVE_STATES = 4
"""The wave motion, its rate, the waves' own resonator, its rate."""
_OWN, _WAVES = 0.8, 1.3
"""ω₁ and ω₂ over the frequency: fitted to sway and heave of the frigate in sea states 5 and 6."""
Shares = tuple[float, float, float, float]
Output = tuple[Array, Array]
"""(4,) and (4,): a motion and its rate, as sums of the states."""


@parameters
class WaveMotion:
    """The deck's own oscillation."""

    deviation_m: float = scaled(..., "standard deviation")
    frequency_rad_s: float = scaled(..., "of the middle of its band")
    damping: float = key(..., "ratio, of both resonators")
    bar_moves: bool = key(
        True, "with the deck, as on a ship; on a motion base it stands still and only the flow shows the deck"
    )
    deck_shares: Shares = key(
        (1.0, 0.0, 0.0, 0.0),
        "of the states, over powers of the frequency, that make up the motion of a deck whose bar moves",
    )

    @cached_property
    def bar(self) -> Output:
        """The bar's motion."""
        return _output(self, (float(self.bar_moves), 0.0, 0.0, 0.0))

    @cached_property
    def deck(self) -> Output:
        """The deck's motion: on a ship it rolls less far than the bar, which stands above it, and later."""
        return _output(self, self.deck_shares if self.bar_moves else (1.0, 0.0, 0.0, 0.0))

    @cached_property
    def tracked(self) -> Output:
        """The motion of the point to land on: the deck's as far as the bar shows it."""
        return _output(self, self.deck_shares if self.bar_moves else (0.0, 0.0, 0.0, 0.0))

    @property
    def matrix(self) -> Array:
        """(4,4) of its states in continuous time."""
        return _solved(self)[0]

    @property
    def noise(self) -> Array:
        """(4,) power densities."""
        return _solved(self)[1]

    @property
    def covariance(self) -> Array:
        """(4,4) covariance of its states while nothing is seen of it."""
        return _solved(self)[2]

    def later(self, states: Array, passed_s: float) -> Array:
        """(4,) its states a while later, or earlier."""
        passed_ms, kept = round(1e3 * passed_s), self._passed
        if passed_ms not in kept:
            from scipy.linalg import expm

            kept[passed_ms] = expm(1e-3 * passed_ms * self.matrix)
        return np.asarray(kept[passed_ms] @ states)

    @cached_property
    def _passed(self) -> dict[int, Array]:
        """Transitions (4,4) over whole milliseconds, as they are asked for."""
        return {}


def _output(wave: WaveMotion, shares: Shares) -> Output:
    w = wave.frequency_rad_s
    row = np.array(shares) / np.array([1.0, w, w, w * w])
    return row, row @ wave.matrix


@lru_cache(maxsize=64)
def _solved(wave: WaveMotion) -> tuple[Array, Array, Array]:
    from scipy.linalg import solve_continuous_lyapunov

    own, waves, damping = _OWN * wave.frequency_rad_s, _WAVES * wave.frequency_rad_s, wave.damping
    matrix = np.zeros((WAVE_STATES, WAVE_STATES))
    matrix[0, 1] = matrix[1, 3] = matrix[2, 3] = 1.0
    matrix[1, :2] = -own * own, -2.0 * damping * own
    matrix[3, 2:] = -waves * waves, -2.0 * damping * waves
    noise = np.array([0.0, 0.0, 0.0, 1.0])
    covariance = solve_continuous_lyapunov(matrix, -np.diag(noise))
    scale = wave.deviation_m**2 / covariance[0, 0]
    return matrix, scale * noise, scale * covariance


@parameters
class WaveShares:
    """Wave motion along the axes of the ship, as shares of its heave."""

    along: float = key(0.25, "of the ship's surge")
    across: float = key(1.0, "of the ship's sway")
    along_rad: float = key(0.0, "direction of the ship's axis in the axes of the flight")

    @property
    def shape(self) -> Array:
        """(2,2) squared shares, in the axes of the flight."""
        ahead = np.array([math.cos(self.along_rad), math.sin(self.along_rad)])
        aside = np.array([-ahead[1], ahead[0]])
        return self.along**2 * np.outer(ahead, ahead) + self.across**2 * np.outer(aside, aside)


@parameters
class WaveParameters:
    """`[guidance.horizon.wave]`."""

    still_m: float = scaled(0.003, "standard deviation in the hypothesis of a bar at rest")
    first: int = key(5, "index of the initial hypothesis", "of the hypotheses: 0.12 m at 2.1 rad/s", ge=0)
    deck_shares: Shares = key(
        (0.6, -0.28, 0.4, 0.05),
        "of a moving bar's states that make up the deck's motion, which is followed over the deck",
        "measured: docs/explanation/bar-and-deck.md",
    )
    deck_heave_shares: Shares = key(
        (1.21, 0.02, -0.32, -0.16),
        "likewise downward, where a pitch moves the deck otherwise than the bar",
        "measured: docs/explanation/bar-and-deck.md",
    )
    followed_within_m: float = key(
        1000.0,
        "nearer to the bar than this all of that share is followed, beyond twice this nothing: from afar the "
        "aircraft's own sway is taken for the bar's, and following it is positive feedback",
        "everywhere",
        gt=0,
        allow_inf_nan=True,
    )
    deck: WaveMotion = key(WaveMotion(0.1, 1.8, 0.2, bar_moves=False), "wave motion of a deck below a bar at rest")
    spread: WaveShares = key(WaveShares(), "surge and sway of a ship as shares of its heave")
    deviations_m: tuple[float, ...] = scaled(
        (0.05, 0.12, 0.25), "of the hypotheses of a moving bar, with every frequency"
    )
    frequencies_rad_s: tuple[float, ...] = key((0.7, 2.1), "of the hypotheses")
    damping: float = key(0.2, "of every resonator")
    memory_s: float = scaled(15.0, "over which innovations count")
    lead: float = key(4.0, "log-likelihood ratio from which a hypothesis replaces the present one")
    quick: float = key(
        1.0,
        "the quickest waves are taken even when this much less likely than the leader: a small quick heave is "
        "hard to tell from none, and comes with a sway that a delayed loop amplifies",
        "measured: docs/results/guidance.md",
        ge=0,
    )
    drift_mps: float = scaled(0.15, "of the height, other than by the sticks")
    drift_time_s: float = scaled(0.7, "time constant of that drift")
    drift_s: float = scaled(
        0.085,
        "that drift is no less than so much of the acceleration by the mean wind, with which vertical gusts grow",
        "measured: docs/results/guidance.md",
        ge=0,
    )
    jitter_m: float = scaled(0.01, "least standard deviation of a picture's height")

    def __post_init__(self) -> None:
        require(
            bool(self.deviations_m and self.frequencies_rad_s), "at least one hypothesis of a wave motion is needed"
        )
        count = len(self.hypotheses)
        require(
            0 <= self.first < count, f"first must be one of the {count} hypotheses, 0 a bar at rest, got {self.first}"
        )

    def followed_at(self, distance_m: float) -> float:
        """How much of the deck's motion is followed at a distance from the bar, 0 to 1."""
        return min(max(2.0 - distance_m / self.followed_within_m, 0.0), 1.0)

    @property
    def believed(self) -> tuple[WaveMotion, ...]:
        """What the relative state takes for the deck's wave motion under each hypothesis."""
        return (self.deck, *self.hypotheses[1:])

    @cached_property
    def hypotheses(self) -> tuple[WaveMotion, ...]:
        """The bar's heave: at rest, and every wave."""
        moving = [
            WaveMotion(d, f, self.damping, deck_shares=self.deck_shares)
            for f in self.frequencies_rad_s
            for d in self.deviations_m
        ]
        return (WaveMotion(self.still_m, 1.8, self.damping), *moving)

    def steps(self, step_ms: int, wind_mps2: float) -> tuple[Array, Array]:
        """Transitions (k,6,6) and noises (k,6,6) of all hypotheses over whole milliseconds, in a wind of a level."""
        drift_mps = max(self.drift_mps, self.drift_s * wind_mps2)
        if (step_ms, drift_mps) not in self._steps:
            self._steps[step_ms, drift_mps] = self._solved(1e-3 * step_ms, drift_mps)
        return self._steps[step_ms, drift_mps]

    @cached_property
    def _steps(self) -> dict[tuple[int, float], tuple[Array, Array]]:
        """Those asked for."""
        return {}

    def _solved(self, step_s: float, drift_mps: float) -> tuple[Array, Array]:
        from scipy.linalg import expm

        n = _STATES
        blocks = np.zeros((len(self.hypotheses), 2 * n, 2 * n))
        for block, wave in zip(blocks, self.hypotheses, strict=True):
            a, q = np.zeros((n, n)), np.zeros(n)
            a[_HEIGHT, _DRIFT] = 1.0
            a[_DRIFT, _DRIFT] = -1.0 / self.drift_time_s
            a[_WAVE:, _WAVE:], q[_WAVE:] = wave.matrix, wave.noise
            q[_DRIFT] = 2.0 * drift_mps**2 / self.drift_time_s
            block[:n, :n], block[:n, n:], block[n:, n:] = -a, np.diag(q), a.T
        result = expm(blocks * step_s)
        transition = np.ascontiguousarray(result[:, n:, n:].transpose(0, 2, 1))
        return transition, transition @ result[:, :n, n:]


_HEIGHT, _DRIFT, _WAVE = range(3)
_STATES = _WAVE + WAVE_STATES


@dataclass(frozen=True)
class WaveEstimate:
    """Of all k hypotheses at one time.

    Attributes:
        t_s: of the newest picture.
        mean: (k, 6) height, drift, and the states of a `WaveMotion`.
        covariance: (k, 6, 6).
        score: (k,) faded log-likelihood.
        chosen: index of the hypothesis in use.
    """

    t_s: float
    mean: Array
    covariance: Array
    score: Array
    chosen: int = 0


class WaveBank:
    """Pure steps of a `WaveEstimate`.

    Args:
        parameters: sizes.
    """

    def __init__(self, parameters: WaveParameters) -> None:
        self._parameters = parameters
        self.hypotheses = parameters.hypotheses
        quickest_rad_s = max(parameters.frequencies_rad_s)
        quick = [it.frequency_rad_s == quickest_rad_s for it in self.hypotheses[1:]]
        self._ahead = parameters.quick * np.array([False, *quick])

    def start(self, t_s: float, down_m: float) -> WaveEstimate:
        """From a first height."""
        k = len(self.hypotheses)
        mean, covariance = np.zeros((k, _STATES)), np.zeros((k, _STATES, _STATES))
        mean[:, _HEIGHT] = down_m
        covariance[:, _HEIGHT, _HEIGHT] = covariance[:, _DRIFT, _DRIFT] = 0.3**2
        covariance[:, _WAVE:, _WAVE:] = [it.covariance for it in self.hypotheses]
        return WaveEstimate(t_s, mean, covariance, np.zeros(k), self._parameters.first)

    def update_pose(
        self,
        before: WaveEstimate,
        t_s: float,
        moved_m: float,
        down_m: float,
        variance_m2: float,
        wind_mps2: float = 0.0,
    ) -> WaveEstimate:
        """A picture's height below the bar.

        Args:
            before: the estimate.
            t_s: exposure.
            moved_m: downward, since the picture before, by the sticks.
            down_m: height below the bar in the picture; not finite is refused.
            variance_m2: of its error.
            wind_mps2: acceleration by the mean wind, one of a few levels.
        """
        step_s = t_s - before.t_s
        if not (math.isfinite(down_m) and math.isfinite(moved_m) and step_s > 0.0):
            return before
        if step_s > 2.0:
            return replace(self.start(t_s, down_m), score=before.score, chosen=before.chosen)
        steps = self._parameters.steps(max(1, round(1e3 * step_s)), wind_mps2)
        mean, covariance = before.mean.copy(), before.covariance.copy()
        score = math.exp(-step_s / self._parameters.memory_s) * before.score
        variance = variance_m2 + self._parameters.jitter_m**2
        see_bank(mean, covariance, score, steps, moved_m, down_m, variance)
        left = score.max() - score[before.chosen] > self._parameters.lead
        chosen = int((score + self._ahead).argmax()) if left else before.chosen
        return WaveEstimate(t_s, mean, covariance, score, chosen)

    def update_velocity(self, before: WaveEstimate, drift_mps: float, deviation_mps: float) -> WaveEstimate:
        """The aircraft's own vertical speed less what the sticks ask for, both downward; not finite is refused."""
        if not math.isfinite(drift_mps):
            return before
        crossed = before.covariance[:, :, _DRIFT]
        gain = crossed / (crossed[:, _DRIFT] + deviation_mps**2)[:, None]
        innovation = drift_mps - before.mean[:, _DRIFT]
        covariance = before.covariance - gain[:, :, None] * crossed[:, None, :]
        return replace(before, mean=before.mean + gain * innovation[:, None], covariance=covariance)
