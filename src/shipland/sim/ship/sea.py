"""Waves and the ship's answer: spectra, sea states, short-crested seas, deck motion as a sum of harmonics.

Motion responses (RAOs) are those of the packaged FFG-7-like frigate. The table is made by `tools/make_rao.py`; hull and
method: `docs/explanation/ship-motion.md`. No measurement of an FFG-7 is behind it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import resources
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from shipland.config import key, parameters, require
from shipland.frames import GRAVITY_MPS2, Array
from shipland.sim.ship.deck_motion import Harmonics

if TYPE_CHECKING:
    from scipy.interpolate import RectBivariateSpline

ComplexArray = npt.NDArray[np.complex128]

MIRRORED = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of surge, sway, heave, roll, pitch, yaw when the waves come from the other side."""


@dataclass(frozen=True, eq=False)
class ResponseTable:
    """Complex motion a metre of wave amplitude, time factor exp(+iωt), wave crest at the origin at t = 0.

    Motions are along and about the ship's forward, starboard, down [m/m, rad/m], at the origin: midships on the
    still waterline.

    Attributes:
        speed_kn: (S,) ship's speeds, ascending.
        heading_deg: (H,) directions 0…180 that the waves run to, against the bow; 0 following, 180 head seas; the
            waves come from starboard.
        omega_rad_s: (F,) wave frequencies in the still frame, ascending.
        rao: (S, H, F, 6) complex.
        natural_period_s: (3,) heave, roll, pitch (uncoupled, zero speed).
        particulars: length, beam, draught [m], displacement [m³], GM [m], centre of gravity forward, port, up [m].
    """

    speed_kn: Array
    heading_deg: Array
    omega_rad_s: Array
    rao: ComplexArray
    natural_period_s: Array
    particulars: Array

    def responses(self, speed_kn: float, heading_rad: Array, omega_rad_s: Array) -> ComplexArray:
        """(N, 6) responses, cubic in speed, heading and frequency.

        Args:
            speed_kn: within the table.
            heading_rad: (N,) direction that the waves run to, any angle; beyond 180° (waves from port) mirrored.
            omega_rad_s: (N,) within the table.
        """
        heading_deg = np.degrees(heading_rad) % 360.0
        from_port = heading_deg > 180.0
        heading_deg = np.where(from_port, 360.0 - heading_deg, heading_deg)
        found = np.empty((heading_deg.size, 6), dtype=complex)
        for index, (real, imaginary) in enumerate(_surfaces(self, speed_kn)):
            found.real[:, index] = real.ev(heading_deg, omega_rad_s)
            found.imag[:, index] = imaginary.ev(heading_deg, omega_rad_s)
        return found * np.where(from_port[:, None], MIRRORED, 1.0)


@lru_cache(maxsize=16)
def _surfaces(table: ResponseTable, speed_kn: float) -> list[tuple[RectBivariateSpline, RectBivariateSpline]]:
    """Real and imaginary part of each motion over heading and frequency at one speed."""
    from scipy.interpolate import CubicSpline, RectBivariateSpline

    at_speed = CubicSpline(table.speed_kn, table.rao)(speed_kn)
    grid = (table.heading_deg, table.omega_rad_s)
    return [
        (RectBivariateSpline(*grid, at_speed[..., index].real), RectBivariateSpline(*grid, at_speed[..., index].imag))
        for index in range(6)
    ]


def at_point(responses: ComplexArray, point_m: npt.ArrayLike) -> ComplexArray:
    """(N, 6) responses at a point (3,) forward, starboard, down of the origin [m]; linear in the angles."""
    moved = np.array(responses)
    moved[:, :3] += np.cross(responses[:, 3:], np.asarray(point_m, dtype=float))
    return moved


@cache
def frigate() -> ResponseTable:
    """The packaged table."""
    with (
        (resources.files("shipland.sim.ship") / "data" / "frigate_rao.npz").open("rb") as file,
        np.load(file) as stored,
    ):
        arrays = {name: stored[name] for name in stored.files}
    arrays["rao"] = arrays["rao"].astype(complex)
    for array in arrays.values():
        array.setflags(write=False)
    return ResponseTable(**arrays)


KNOT_MPS = 1852.0 / 3600.0
BAND_RAD_S = (0.2, 2.0)
"""Wave frequencies that are sampled, within the table of responses; a 124 m hull does not answer shorter waves."""


@dataclass(frozen=True)
class SeaState:
    """A rung of the ladder.

    Attributes:
        height_range_m: significant wave heights that it covers (WMO code table 3700).
        significant_height_m: the mean of the range, as NATO uses it.
        modal_period_s: the most probable period of the spectrum's peak in the North Atlantic.
    """

    height_range_m: tuple[float, float]
    significant_height_m: float
    modal_period_s: float


SEA_STATES = {
    3: SeaState((0.5, 1.25), 0.88, 7.5),
    4: SeaState((1.25, 2.5), 1.88, 8.8),
    5: SeaState((2.5, 4.0), 3.25, 9.7),
    6: SeaState((4.0, 6.0), 5.0, 12.4),
}
"""Open-ocean North Atlantic, annual: Bales (1983), as in NATO STANAG 4194."""


@parameters
class SeaParameters:
    """Section `[ship.sea]`: the waves and how the ship meets them, at full scale.

    The FFG-7-like frigate at full scale; tools/make_rao.py makes another table of responses.
    """

    sea_state: int = key(6, "rung of `SEA_STATES`", "[Lee2022]; Bales (1983), North Atlantic, as in NATO STANAG 4194")
    spectrum: Literal["bretschneider", "jonswap"] = key(
        "bretschneider", "Bretschneider (ITTC two-parameter) or JONSWAP", "bretschneider | jonswap"
    )
    jonswap_gamma: float = key(3.3, "JONSWAP's peak enhancement", "Hasselmann et al. (1973), mean", ge=1, le=7)
    short_crested: bool = key(True, "energy spread by cos² over ±90°; else from one direction", "ITTC, for an open sea")
    waves_from_deg: float = key(
        60.0, "clockwise from the bow; 120 is off the stern", "[Lee2022] says 60°, not of what", ge=-180, le=360
    )
    speed_kn: float = key(10.0, "the ship's, within the range of the computed responses", ge=0, le=15)
    flight_deck_m: tuple[float, float, float] = key(
        (-50.0, 0.0, -6.0), "the deck's place, forward, starboard, down of midships on the waterline"
    )
    frequencies: int = key(40, "number of wave frequencies", ge=8, le=400)
    directions: int = key(8, "number of directions of a short-crested sea", ge=1, le=60)
    significant_height_m: float | None = key(None, "significant wave height, or None")
    modal_period_s: float | None = key(None, "period of the spectrum's peak, or None")

    def __post_init__(self) -> None:
        known = ", ".join(map(str, SEA_STATES))
        require(self.sea_state in SEA_STATES, f"sea_state must be one of {known}, got {self.sea_state}")
        height, period = self.height_m, self.period_s
        require(0.0 <= height <= 9.0, f"significant_height_m must be in 0…9 m (linear theory), got {height}")
        require(4.0 <= period <= 25.0, f"modal_period_s must be in 4…25 s, got {period}")

    @property
    def height_m(self) -> float:
        """Significant wave height [m]."""
        given = self.significant_height_m
        return given if given is not None else SEA_STATES[self.sea_state].significant_height_m

    @property
    def period_s(self) -> float:
        """Period of the spectrum's peak [s]."""
        return self.modal_period_s if self.modal_period_s is not None else SEA_STATES[self.sea_state].modal_period_s

    @property
    def heading_rad(self) -> float:
        """Direction that the waves run to, against the bow; 0 following, π head; in 0…π they come from starboard."""
        return float(np.radians(180.0 - self.waves_from_deg))

    def density(self, omega_rad_s: npt.ArrayLike) -> Array:
        """The chosen spectrum [m² s] at wave frequencies [rad/s]."""
        peak_rad_s = 2.0 * np.pi / self.period_s
        if self.spectrum == "jonswap":
            return jonswap(omega_rad_s, self.height_m, peak_rad_s, self.jonswap_gamma)
        return bretschneider(omega_rad_s, self.height_m, peak_rad_s)


def bretschneider(omega_rad_s: npt.ArrayLike, significant_height_m: float, peak_rad_s: float) -> Array:
    """Bretschneider / ITTC two-parameter spectrum [m² s]; its integral is Hs²/16 (ITTC 1978)."""
    omega = np.asarray(omega_rad_s, dtype=float)
    ratio = (peak_rad_s / omega) ** 4
    return np.asarray(0.3125 * significant_height_m**2 * ratio / omega * np.exp(-1.25 * ratio))


def jonswap(omega_rad_s: npt.ArrayLike, significant_height_m: float, peak_rad_s: float, gamma: float) -> Array:
    """JONSWAP spectrum [m² s] (Hasselmann et al. 1973), its integral normalised to Hs²/16."""

    def shape(omega: Array) -> Array:
        width = np.where(omega <= peak_rad_s, 0.07, 0.09)
        power = np.exp(-0.5 * ((omega - peak_rad_s) / (width * peak_rad_s)) ** 2)
        return bretschneider(omega, significant_height_m, peak_rad_s) * gamma**power

    from scipy.integrate import trapezoid  # half a second of imports that a calm sea does without

    grid = peak_rad_s * np.linspace(0.3, 12.0, 6000)
    integral = float(trapezoid(shape(grid), grid))
    scale = significant_height_m**2 / 16.0 / integral if integral > 0.0 else 0.0
    return scale * shape(np.asarray(omega_rad_s, dtype=float))


def encounter_frequency(omega_rad_s: Array, heading_rad: Array, speed_mps: float) -> Array:
    """ωe = ω − ω² U cos μ / g [rad/s]; negative where the ship overtakes the waves."""
    return np.asarray(omega_rad_s - omega_rad_s**2 * speed_mps * np.cos(heading_rad) / GRAVITY_MPS2)


@dataclass(frozen=True)
class Waves:
    """Regular waves whose sum is the sea, (K,) each.

    Frequencies are those of the still frame, headings the directions that the waves run to against the bow, phases
    those at the ship's origin at t = 0.
    """

    omega_rad_s: Array
    heading_rad: Array
    amplitude_m: Array
    phase_rad: Array


def sample_waves(sea: SeaParameters, rng: np.random.Generator) -> Waves:
    """Stratified samples of the directional spectrum.

    Every cell of `frequencies` equal bands and `directions` equal shares of energy gives one wave at a random place
    in its cell, so that no record repeats and the variance of any linear response is met without bias.
    """
    low, high = BAND_RAD_S
    width = (high - low) / sea.frequencies
    directions = sea.directions if sea.short_crested else 1
    shape = (sea.frequencies, directions)
    omega = low + width * (np.arange(sea.frequencies)[:, None] + rng.uniform(size=shape))
    share = (np.arange(directions) + rng.uniform(size=shape)) / directions
    off_main = _spreading_quantile(share) if sea.short_crested else np.zeros(shape)
    amplitude = np.sqrt(2.0 * sea.density(omega) * width / directions)
    phase = rng.uniform(0.0, 2.0 * np.pi, shape)
    return Waves(omega.ravel(), (sea.heading_rad + off_main).ravel(), amplitude.ravel(), phase.ravel())


def _spreading_quantile(share: Array) -> Array:
    """Angle below which `share` of the energy of (2/π) cos²θ lies, θ in ±π/2."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2001)
    cumulative = (angle + 0.5 * np.pi + 0.5 * np.sin(2.0 * angle)) / np.pi
    return np.interp(share, cumulative, angle)


def deck_motion(sea: SeaParameters, rng: np.random.Generator, length_scale: float, time_scale: float) -> Harmonics:
    """Motion of the flight deck in these waves: harmonics at the frequencies of encounter.

    Full-scale lengths and times are divided by the scales; `rng` draws frequencies, directions and phases.
    """
    waves = sample_waves(sea, rng)
    omega_e = encounter_frequency(waves.omega_rad_s, waves.heading_rad, sea.speed_kn * KNOT_MPS)
    responses = frigate().responses(sea.speed_kn, waves.heading_rad, waves.omega_rad_s)
    at_deck = at_point(responses, sea.flight_deck_m)
    amplitude = at_deck.T * (waves.amplitude_m * np.exp(1j * waves.phase_rad))
    amplitude[:3] /= length_scale
    return Harmonics(omega_e * time_scale, amplitude)


def significant_amplitude(sea: SeaParameters, table: ResponseTable | None = None) -> Array:
    """(6,) significant single amplitudes 2√m₀ of the full-scale deck motion [m, rad], from the spectrum.

    `table` None is the packaged frigate's.
    """
    from scipy.integrate import trapezoid

    ship = table if table is not None else frigate()
    omega = np.linspace(*BAND_RAD_S, 361)
    if sea.short_crested:
        angle = np.radians(np.arange(-87.5, 90.0, 5.0))
        weight = np.cos(angle) ** 2 / np.sum(np.cos(angle) ** 2)
    else:
        angle, weight = np.zeros(1), np.ones(1)
    grid_omega, grid_angle = (a.ravel() for a in np.meshgrid(omega, sea.heading_rad + angle, indexing="ij"))
    at_deck = at_point(ship.responses(sea.speed_kn, grid_angle, grid_omega), sea.flight_deck_m)
    squared = np.abs(at_deck.reshape(omega.size, angle.size, 6)) ** 2
    density = np.einsum("fad,a->fd", squared, weight) * sea.density(omega)[:, None]
    return np.asarray(2.0 * np.sqrt(trapezoid(density, omega, axis=0)))
