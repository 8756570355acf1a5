"""Wave motion of a deck, and of a bar that a ship carries, about its mean place: a resonator that waves drive.

Waves are no white noise: their force oscillates itself, within a band. With o the wave motion and d the waves' own

    ö + 2 ζ ω₁ ȯ + ω₁² o = ḋ,    d̈ + 2 ζ ω₂ ḋ + ω₂² d = white noise,

the spectrum of o vanishes with ω towards long waves and with ω⁻⁶ towards short ones, as that of a hull's heave and
sway does. ω₁ and ω₂ lie either side of the frequency that the wave motion is named by.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from shipland.config import key, parameters, scaled
from shipland.frames import Array

WAVE_STATES = 4
"""The wave motion, its rate, the waves' own resonator, its rate."""
_OWN, _WAVES = 0.8, 1.3
"""ω₁ and ω₂ over the frequency: fitted to sway and heave of the frigate in sea states 5 and 6."""


@parameters
class WaveMotion:
    """The deck's own oscillation."""

    deviation_m: float = scaled(..., "standard deviation")
    frequency_rad_s: float = scaled(..., "of the middle of its band")
    damping: float = key(..., "ratio, of both resonators")
    bar_moves: bool = key(
        True, "with the deck, as on a ship; on a motion base it stands still and only the flow shows the deck"
    )
    followed: float = key(
        1.0, "share of the bar's motion that the aircraft follows: above the deck a roll moves it farther"
    )

    @property
    def observed_share(self) -> float:
        """Share of the wave motion that the bar has: 1 or 0."""
        return float(self.bar_moves)

    @property
    def tracked_share(self) -> float:
        """Share of the wave motion that the point to land on has."""
        return self.followed if self.bar_moves else 0.0

    @property
    def deck_share(self) -> float:
        """Share of the wave motion that the ship below the aircraft has: what lies as low as the deck."""
        return self.followed if self.bar_moves else 1.0

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

    def variance_later(self, estimated: Array, passed_s: float) -> float:
        """Of the wave motion a while later, from the estimated covariance (4,4) of its states now."""
        passed = _passed(self, round(1e3 * passed_s))
        later = passed @ (estimated - self.covariance) @ passed.T + self.covariance
        return float(later[0, 0])


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
