"""Draw turbulence over land and sea against its formulas for the documentation.

python tools/plot_turbulence.py [--out docs/pictures/turbulence.png]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
from scipy.signal import welch

from shipland.config import build
from shipland.frames import Array
from shipland.report.palette import BLUE, VERMILION, unit
from shipland.report.plots import PLOT_STYLE, new_figure, save_figure
from shipland.rig import Rig
from shipland.sim.air.turbulence import Scales
from shipland.sim.air.wind import ShipPlace, WindParameters, build_wind

MEAN_MPS, HEIGHT_M, STEP_S, COUNT = 5.0, 1.5, 0.1, 400_000
COLOURS = {"land": VERMILION, "sea": BLUE}


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


def main() -> None:
    """Draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    root = Path(__file__).resolve().parents[1]
    parser.add_argument("--out", type=Path, default=root / "docs/pictures/turbulence.png")
    out = parser.parse_args().out
    ship, place = ShipPlace(0.0, 0.0, -0.9, 0.0), (500.0, 0.0, -HEIGHT_M)
    heights_m = np.geomspace(0.5, 30.0, 60)
    with mpl.rc_context(PLOT_STYLE):
        figure = new_figure(12.0, 4.6)
        axes = figure.subplots(1, 4)
        for surface, colour in COLOURS.items():
            wind = build_wind(parameters(surface), Rig(), np.random.default_rng(1))
            series = np.array([wind.velocity_at(STEP_S * i, place, ship) for i in range(COUNT)])
            series[:, 0] -= MEAN_MPS
            frequency_hz, power = welch(series, 1.0 / STEP_S, nperseg=8192, axis=0)
            wanted = formulas(parameters(surface).turbulence_at(HEIGHT_M), frequency_hz[1:])
            for column, name in enumerate(("along the wind", "across", "vertical")):
                axes[column].loglog(frequency_hz[1:], power[1:, column], color=unit(colour), alpha=0.35, linewidth=0.8)
                axes[column].loglog(
                    frequency_hz[1:], wanted[:, column], color=unit(colour), label=f"{surface}, formula"
                )
                axes[column].set_title(f"{name}, {HEIGHT_M:g} m up", fontsize=10)
                axes[column].set_xlabel("frequency [Hz]")
            deviations = np.array([parameters(surface).turbulence_at(h).deviations_mps for h in heights_m])
            for values, style, name in ((deviations[:, 0], "-", "along"), (deviations[:, 2], "--", "vertical")):
                axes[3].semilogy(values, heights_m, style, color=unit(colour), label=f"{surface}, {name}")
            print(f"{surface}: {series.std(axis=0).round(3)} m/s, formula {np.round(deviations[0], 3)} at 0.5 m")
        axes[0].set_ylabel("spectrum [m²/s² per Hz]")
        axes[0].legend(fontsize=8)
        axes[3].set_title("standard deviation", fontsize=10)
        axes[3].set_xlabel("[m/s]")
        axes[3].set_ylabel("height [m]")
        axes[3].set_xlim(0.0, 2.0)
        axes[3].legend(fontsize=8, loc="center right")
        figure.suptitle(f"Turbulence in {MEAN_MPS:g} m/s of wind", fontweight="bold")
        save_figure(figure, out, 90)


if __name__ == "__main__":
    main()
