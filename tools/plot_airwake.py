"""Draw the parametric airwake of `shipland.sim.air.airwake` for the documentation.

python tools/plot_airwake.py [--out docs/pictures/airwake.png]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from shipland.report.plots import PLOT_STYLE, new_figure, save_figure
from shipland.rig import Rig
from shipland.sim.air.airwake import Airwake
from shipland.sim.air.wind import WindParameters


def draw_ship(axes: Axes, rig: Rig, side: bool) -> None:
    """Outline of platform and superstructure around the deck's centre."""
    aft, fore = -rig.deck_ahead_of_stern_m, rig.platform_length_m - rig.deck_ahead_of_stern_m
    face, top = rig.bar_ahead_of_stern_m - rig.deck_ahead_of_stern_m, rig.superstructure_height_m - rig.deck_height_m
    half = 0.5 * rig.platform_width_m
    if side:
        axes.add_patch(Rectangle((aft, -rig.deck_height_m), fore - aft, rig.deck_height_m, color="#777777"))
        axes.add_patch(Rectangle((face, 0.0), fore - face, top, color="#555555"))
    else:
        axes.add_patch(Rectangle((aft, -half), fore - aft, 2 * half, fill=False, edgecolor="#555555"))
        axes.add_patch(Rectangle((face, -half), fore - face, 2 * half, color="#555555"))


def main() -> None:
    """Draw."""
    parser = argparse.ArgumentParser(description="Draw the airwake for the documentation.")
    root = Path(__file__).resolve().parents[1]
    parser.add_argument("--out", type=Path, default=root / "docs/pictures/airwake.png")
    out = parser.parse_args().out
    rig = Rig()
    wake = Airwake(WindParameters().airwake, rig, np.random.default_rng(0))
    forward = np.linspace(-6.0, 3.0, 181)
    up, starboard = np.linspace(-0.9, 2.5, 86), np.linspace(-2.5, 2.5, 101)
    with mpl.rc_context(PLOT_STYLE):
        figure = new_figure(12.0, 8.0)
        rows = figure.subplots(3, 2, width_ratios=[1.0, 1.0])
        for column, (towards_deg, title) in enumerate(((180.0, "from ahead"), (225.0, "from 45° to port"))):
            towards = np.radians(towards_deg - 2 * 45.0 * column)
            for row, (name, side) in enumerate((("deficit", True), ("turbulence", True), ("deficit", False))):
                axes = rows[row, column]
                others = up if side else starboard
                field = [
                    [getattr(wake.place((x, 0.0, -o) if side else (x, o, -0.45), towards), name) for x in forward]
                    for o in others
                ]
                mesh = axes.pcolormesh(forward, others, field, vmin=0.0, vmax=1.2, cmap="viridis", rasterized=True)
                draw_ship(axes, rig, side)
                axes.set_aspect("equal")
                axes.grid(visible=False)
                axes.set_title(f"{title}: {name}, " + ("from the side" if side else "from above"))
                if not side:
                    axes.invert_yaxis()
                axes.set_ylabel("up [m]" if side else "starboard [m]")
            rows[2, column].set_xlabel("forward of the deck's centre [m]")
        figure.colorbar(mesh, ax=rows, shrink=0.6)
        save_figure(figure, out, 90)


if __name__ == "__main__":
    main()
