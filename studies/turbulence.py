"""Turbulence over land and sea against its formulas: standard deviations flown through, and spectra."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipland.config import build
from shipland.frames import Array
from shipland.rig import Rig
from shipland.sim.turbulence import Scales
from shipland.sim.wind import ShipPlace, WindParameters, build_wind
from studies.harness import Case, Column, Row, Study

MEAN_MPS, HEIGHT_M, STEP_S = 5.0, 1.5, 0.1
SURFACES = ("land", "sea")
AXES = ("along the wind", "across", "vertical")


def parameters(surface: str) -> WindParameters:
    """5 m/s from the south over a surface, without airwake."""
    keys = {"mean_mps": MEAN_MPS, "from_deg": 180.0, "surface": surface, "airwake": {"enabled": False}}
    return build(WindParameters, keys, "wind")


def formulas(scales: Scales, frequency_hz: Array) -> Array:
    """One-sided Dryden spectra (n, 3) [m²/s² per Hz] at a point, MIL-F-8785C §3.7.1.2."""
    lengths_m = np.array([scales.length_horizontal_m, scales.length_horizontal_m, scales.length_vertical_m])
    x2 = (lengths_m * 2.0 * np.pi * frequency_hz[:, None] / MEAN_MPS) ** 2
    shape = np.column_stack([2.0 / (1.0 + x2[:, 0]), (1.0 + 3.0 * x2[:, 1:]) / (1.0 + x2[:, 1:]) ** 2])
    return np.asarray(2.0 * np.square(scales.deviations_mps) * lengths_m / MEAN_MPS * shape)


def sampled(surface: str, count: int) -> Array:
    """(n,3) velocities less the mean, north, east, down, at a place far from the ship."""
    ship, place = ShipPlace(0.0, 0.0, -0.9, 0.0), (500.0, 0.0, -HEIGHT_M)
    wind = build_wind(parameters(surface), Rig(), np.random.default_rng(1))
    series = np.array([wind.velocity_at(STEP_S * index, place, ship) for index in range(count)])
    return np.asarray(series - [MEAN_MPS, 0.0, 0.0])


def cases() -> Sequence[Case]:
    """Surfaces."""
    return [{"surface": surface} for surface in SURFACES]


def measure(case: Case, runs: int) -> Row:
    """`runs` samples."""
    surface = str(case["surface"])
    formula = parameters(surface).turbulence_at(HEIGHT_M).deviations_mps
    names = ("along", "across", "vertical")
    measured = dict(zip(names, sampled(surface, runs).std(axis=0).tolist(), strict=True))
    return measured | {f"{name}_formula": float(value) for name, value in zip(names, formula, strict=True)}


def picture(_rows: Sequence[Row], path: Path) -> None:
    """Spectra and standard deviations over height, beside the formulas."""
    from scipy.signal import welch

    from shipland.figures import drawn
    from shipland.report.palette import BLUE, VERMILION, unit

    heights_m = np.geomspace(0.5, 30.0, 60)
    with drawn(path, (12.0, 4.6), 90) as figure:
        axes = figure.subplots(1, 4)
        for surface, colour in zip(SURFACES, map(unit, (VERMILION, BLUE)), strict=True):
            frequency_hz, power = welch(sampled(surface, STUDY.runs), 1.0 / STEP_S, nperseg=8192, axis=0)
            wanted = formulas(parameters(surface).turbulence_at(HEIGHT_M), frequency_hz[1:])
            for column, name in enumerate(AXES):
                axes[column].loglog(frequency_hz[1:], power[1:, column], color=colour, alpha=0.35, linewidth=0.8)
                axes[column].loglog(frequency_hz[1:], wanted[:, column], color=colour, label=f"{surface}, formula")
                axes[column].set(title=f"{name}, {HEIGHT_M:g} m up", xlabel="frequency [Hz]")
            deviations = np.array([parameters(surface).turbulence_at(h).deviations_mps for h in heights_m])
            for values, style, name in ((deviations[:, 0], "-", "along"), (deviations[:, 2], "--", "vertical")):
                axes[3].semilogy(values, heights_m, style, color=colour, label=f"{surface}, {name}")
        axes[0].set_ylabel("spectrum [m²/s² per Hz]")
        axes[0].legend(fontsize=8)
        axes[3].set(title="standard deviation", xlabel="[m/s]", ylabel="height [m]", xlim=(0.0, 2.0))
        axes[3].legend(fontsize=8, loc="center right")
        figure.suptitle(f"Turbulence in {MEAN_MPS:g} m/s of wind", fontweight="bold")


STUDY = Study(
    question="Has the turbulence its formulas' size?",
    columns={
        "surface": Column("5 m/s, 1.5 m up"),
        "along": Column("σ along [m/s]", ".2f"),
        "along_formula": Column("formula", ".2f"),
        "across": Column("across", ".2f"),
        "across_formula": Column("formula", ".2f"),
        "vertical": Column("vertical", ".2f"),
        "vertical_formula": Column("formula", ".2f"),
    },
    cases=cases,
    measure=measure,
    runs=400_000,
    minutes=1,
    picture=picture,
)
