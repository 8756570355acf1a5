"""Motion of the deck in `ship`: six coordinates with their first and second derivatives, and the motion base's limits.

The deck is brought to rest smoothly before it reaches a limit, and that is recorded.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from shipland.compiled import compiled
from shipland.config import key, parameters, require
from shipland.frames import Array
from shipland.rig import Rig

DOF_NAMES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
"""Order of the six coordinates: along forward, starboard and down [m], then about them, right-handed [rad]."""


@dataclass(frozen=True)
class SixDof:
    """The deck against `ship` at one instant: (18,) displacement, velocity, acceleration, in the order of `DOF_NAMES`.

    The angles are Euler angles (yaw, then pitch, then roll, about moving axes); velocity and acceleration are the
    time derivatives of the coordinates themselves, not angular velocity vectors.
    """

    values: Array

    @property
    def displacement(self) -> Array:
        """(6,) [m, m, m, rad, rad, rad]."""
        return self.values[:6]

    @property
    def velocity(self) -> Array:
        """(6,) [m/s, …, rad/s, …]."""
        return self.values[6:12]

    @property
    def acceleration(self) -> Array:
        """(6,) [m/s², …, rad/s², …]."""
        return self.values[12:]


class DeckMotion(Protocol):
    """A motion of `deck` in `ship`, defined at any time."""

    def at(self, t_s: float) -> SixDof:
        """The deck's coordinates and their derivatives at time `t_s`."""


class Later:
    """Another motion, met `start_s` after its beginning."""

    def __init__(self, motion: DeckMotion, start_s: float) -> None:
        self._motion = motion
        self.start_s = start_s

    def at(self, t_s: float) -> SixDof:
        """The other motion's state at `t_s + start_s`."""
        return self._motion.at(t_s + self.start_s)


class Still:
    """A deck that keeps its neutral place."""

    def __init__(self) -> None:
        self._state = SixDof(np.zeros(18))

    def at(self, t_s: float) -> SixDof:  # noqa: ARG002 - the protocol's argument
        """Zeros."""
        return self._state


class Harmonics:
    """Sum of harmonics: Re Σ_k amplitude[:, k] · exp(i ω_k t).

    Args:
        frequency_rad_s: (K,) circular frequencies.
        amplitude: (6, K) complex amplitudes [m or rad]; their angle is the phase at t = 0.
    """

    def __init__(self, frequency_rad_s: npt.ArrayLike, amplitude: npt.NDArray[np.complex128]) -> None:
        omega = np.asarray(frequency_rad_s, dtype=float)
        if omega.ndim != 1 or np.shape(amplitude) != (6, omega.size):
            raise ValueError(
                f"Harmonics wants frequencies (K,) and amplitudes (6, K), got {omega.shape}, {np.shape(amplitude)}"
            )
        self.frequency_rad_s = omega
        self.amplitude = np.asarray(amplitude, dtype=complex)
        stacked = np.vstack([self.amplitude, 1j * omega * self.amplitude, -(omega**2) * self.amplitude])
        self._weights = np.ascontiguousarray(np.stack([stacked.real, -stacked.imag]).transpose(2, 0, 1))
        self._kept: dict[float, Array] = {}

    def at(self, t_s: float) -> SixDof:
        """Displacement, velocity and acceleration, all analytic."""
        steps = round(t_s / _STEP_S)
        few = steps % _FEW
        begin_s, passed_s = (steps - few) * _STEP_S, few * _STEP_S
        if abs(begin_s + passed_s - t_s) > _ON_GRID_S:
            begin_s, passed_s = t_s, 0.0
        values = np.zeros(18)
        _add_harmonics(self._weights, self._phasors(begin_s), self._phasors(passed_s), values)
        return SixDof(values)

    def _phasors(self, t_s: float) -> Array:
        """(2,K) exp(i ω t), real and imaginary part; kept for a while."""
        found = self._kept.get(t_s)
        if found is None:
            if len(self._kept) >= 2 * _FEW:
                self._kept.clear()
            phase = self.frequency_rad_s * t_s
            found = self._kept[t_s] = np.array([np.cos(phase), np.sin(phase)])
        return found


_STEP_S, _FEW, _ON_GRID_S = 0.002, 128, 1e-9
"""A time on the world's grid is so many steps and a few: sines of a sum are cheaper than sines."""


@compiled
def _add_harmonics(weights: Array, begin: Array, passed: Array, total: Array) -> None:
    """Add (K,2,18) weights, phasors (2,K) multiplied, to (18,)."""
    for k in range(len(weights)):
        cosine = begin[0, k] * passed[0, k] - begin[1, k] * passed[1, k]
        sine = begin[1, k] * passed[0, k] + begin[0, k] * passed[1, k]
        for i in range(len(total)):
            total[i] += weights[k, 0, i] * cosine + weights[k, 1, i] * sine


class Sinusoids(Harmonics):
    """One sinusoid a degree of freedom: amplitude · sin(2π t / period + phase).

    Args:
        amplitude: (6,) [m, m, m, rad, rad, rad]; zero leaves that degree of freedom still.
        period_s: (6,) [s], all positive.
        phase_rad: (6,) phases at t = 0.
    """

    def __init__(self, amplitude: npt.ArrayLike, period_s: npt.ArrayLike, phase_rad: npt.ArrayLike) -> None:
        size, period = np.asarray(amplitude, dtype=float), np.asarray(period_s, dtype=float)
        if not np.all(period > 0.0):
            raise ValueError(f"Sinusoids wants positive periods, got {period.tolist()}")
        moving = np.flatnonzero(size)
        complex_amplitude = np.zeros((6, moving.size), dtype=complex)
        phase = np.asarray(phase_rad, dtype=float)[moving]
        complex_amplitude[moving, np.arange(moving.size)] = -1j * size[moving] * np.exp(1j * phase)
        super().__init__(2.0 * np.pi / period[moving], complex_amplitude)


@parameters
class SinusoidParameters:
    """One amplitude and period a degree of freedom: surge, sway, heave, roll, pitch, yaw."""

    amplitude_m_deg: tuple[float, float, float, float, float, float] = key(..., "three lengths [m], three angles [deg]")
    period_s: tuple[float, float, float, float, float, float] = key(
        ..., "six periods; that of a still degree of freedom is not used"
    )

    def __post_init__(self) -> None:
        require(min(self.amplitude_m_deg) >= 0.0, f"amplitude_m_deg must not be negative, got {self.amplitude_m_deg}")
        require(max(self.amplitude_m_deg[3:]) < 90.0, "amplitude_m_deg: angles must be below 90°")
        require(min(self.period_s) > 0.0, f"period_s must be positive, got {self.period_s}")

    def motion(self, rng: np.random.Generator) -> Sinusoids:
        """The motion, with phases drawn from `rng`."""
        amplitude = np.array(self.amplitude_m_deg)
        amplitude[3:] = np.radians(amplitude[3:])
        return Sinusoids(amplitude, self.period_s, rng.uniform(0.0, 2.0 * np.pi, 6))


logger = logging.getLogger(__name__)


@parameters
class LimitParameters:
    """Section `[ship.limits]`."""

    enabled: bool = key(True, "the deck stands on the rig's motion base; a ship at sea has no such limits")
    knee: float = key(
        0.75, "share of a limit that leaves motion as it is", "chosen: a sharper stop would jerk the deck", gt=0, lt=1
    )


@dataclass(frozen=True)
class LimitBite:
    """One of `DOF_NAMES` that the limits held back: since when, its limit and the largest demand so far [m or rad]."""

    name: str
    t_s: float
    limit: float
    largest_demand: float

    def __str__(self) -> str:
        unit, scale = ("m", 1.0) if self.name in DOF_NAMES[:3] else ("°", 180.0 / np.pi)
        return (
            f"motion base: {self.name} held back since t = {self.t_s:.2f} s, "
            f"asked {self.largest_demand * scale:.2f} {unit} of at most {self.limit * scale:.2f} {unit}"
        )


class LimitedMotion:
    """A deck motion kept inside symmetric limits L (6,) [m, m, m, rad, rad, rad] by y = L·g(x/L).

    g(u) = u for |u| ≤ k, the knee, else ±(k + (1 − k) tanh((|u| − k)/(1 − k))): twice continuously differentiable and
    below 1, so that velocity g'ẋ and acceleration g'ẍ + g''ẋ²/L are those of the limited motion.
    """

    def __init__(self, motion: DeckMotion, limit: Array, knee: float) -> None:
        self.motion = motion
        self._limit = np.asarray(limit, dtype=float)
        self._knee = knee
        self._free = knee * self._limit
        self._bites: dict[int, LimitBite] = {}

    @property
    def bites(self) -> tuple[LimitBite, ...]:
        """The degrees of freedom held back so far, in the order of `DOF_NAMES`."""
        return tuple(self._bites[index] for index in sorted(self._bites))

    def at(self, t_s: float) -> SixDof:
        """See `DeckMotion`."""
        asked = self.motion.at(t_s)
        if is_within(asked.values, self._free):
            return asked
        limited = SixDof(asked.values.copy())
        x, v, a = limited.displacement, limited.velocity, limited.acceleration
        for index in np.flatnonzero(np.abs(x) > self._free).tolist():
            self._note(index, t_s, abs(float(x[index])))
            limit, knee = self._limit[index], self._knee
            sign, beyond = np.sign(x[index]), (abs(x[index]) / limit - knee) / (1.0 - knee)
            tanh = np.tanh(beyond)
            slope = 1.0 - tanh**2
            bend = -2.0 * sign * tanh * slope / ((1.0 - knee) * limit)
            x[index] = sign * limit * (knee + (1.0 - knee) * tanh)
            a[index] = slope * a[index] + bend * v[index] ** 2
            v[index] *= slope
        return limited

    def _note(self, index: int, t_s: float, demand: float) -> None:
        before = self._bites.get(index)
        if before is not None and demand <= before.largest_demand:
            return
        first_s = t_s if before is None else before.t_s
        self._bites[index] = LimitBite(DOF_NAMES[index], first_s, float(self._limit[index]), demand)
        if before is None:
            logger.info("%s", self._bites[index])


@compiled
def is_within(values: Array, limit: Array) -> bool:
    """Whether the first of `values` lie within limits (6,) either side."""
    within = True
    for index in range(6):
        within = within and abs(values[index]) <= limit[index]
    return within


def rig_limits(rig: Rig) -> Array:
    """(6,) the motion base's limits [m, m, m, rad, rad, rad]."""
    lengths = (rig.surge_limit_m, rig.sway_limit_m, rig.heave_limit_m)
    return np.array([*lengths, *np.radians((rig.roll_limit_deg, rig.pitch_limit_deg, rig.yaw_limit_deg))])
