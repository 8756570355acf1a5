"""Wave motion of a deck, and of a bar that a ship carries, about its mean place: a resonator that waves drive.

Waves are no white noise: their force oscillates itself, within a band. With o the wave motion and d the waves' own

    ö + 2 ζ ω₁ ȯ + ω₁² o = ḋ,    d̈ + 2 ζ ω₂ ḋ + ω₂² d = white noise,

the spectrum of o vanishes with ω towards long waves and with ω⁻⁶ towards short ones, as that of a hull's heave and
sway does. ω₁ and ω₂ lie either side of the frequency that the wave motion is named by.
"""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np

from shipland.config import key, parameters, scaled
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
        return np.asarray(_passed(self, round(1e3 * passed_s)) @ states)

    def covariance_later(self, estimated: Array, passed_s: float) -> Array:
        """(4,4) of its states a while later, from the estimated one now."""
        passed = _passed(self, round(1e3 * passed_s))
        return np.asarray(passed @ (estimated - self.covariance) @ passed.T + self.covariance)


def _output(wave: WaveMotion, shares: Shares) -> Output:
    w = wave.frequency_rad_s
    row = np.array(shares) / np.array([1.0, w, w, w * w])
    return row, row @ wave.matrix


@lru_cache(maxsize=4096)
def _passed(wave: WaveMotion, passed_ms: int) -> Array:
    from scipy.linalg import expm

    return np.asarray(expm(1e-3 * passed_ms * wave.matrix))


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
