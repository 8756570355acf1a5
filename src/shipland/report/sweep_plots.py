"""One picture of a sweep: the share of landings in the landing area and the touchdown error over what was changed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipland.evaluation.landing import Landing
from shipland.evaluation.statistics import share_interval
from shipland.evaluation.sweep import Cell
from shipland.report.palette import BLUE, GREEN, VERMILION, unit
from shipland.report.plots import PLOT_STYLE, PlotParameters, new_figure, save_figure

_COLOURS = (BLUE, VERMILION, GREEN)


def plot_sweep(
    path: Path, done: Sequence[tuple[Cell, Sequence[Landing]]], title: str, area: str, parameters: PlotParameters
) -> None:
    """A line a pilot; DataError when the picture cannot be written."""
    import matplotlib as mpl

    pilots = list(dict.fromkeys(cell.pilot for cell, _ in done))
    keys = ", ".join(key for key, _ in done[0][0].swept) or "scenario"
    labels = list(dict.fromkeys(_label(cell) for cell, _ in done))
    with mpl.rc_context(PLOT_STYLE):
        figure = new_figure(9.0, 4.2)
        shares, errors = figure.subplots(1, 2)
        for index, pilot in enumerate(pilots):
            colour = unit(_COLOURS[index % len(_COLOURS)])
            mine = [(labels.index(_label(cell)), landings) for cell, landings in done if cell.pilot == pilot]
            at = np.array([place for place, _ in mine]) + 0.06 * (index - 0.5 * (len(pilots) - 1))
            counts = [(sum(landing.good for landing in landings), len(landings)) for _, landings in mine]
            share = np.array([good / of for good, of in counts])
            bounds = np.array([share_interval(good, of) for good, of in counts]).T
            off = 100.0 * np.abs(bounds - share)
            shares.errorbar(at, 100.0 * share, off, fmt="o-", color=colour, capsize=3, label=pilot)
            quartiles = np.array([_quartiles(landings) for _, landings in mine]).T
            errors.errorbar(
                at, quartiles[1], np.abs(quartiles[[0, 2]] - quartiles[1]), fmt="o-", color=colour, capsize=3
            )
        shares.set_ylim(-3.0, 103.0)
        shares.set_ylabel(f"landed in the {area} [%], 95 % interval")
        errors.set_ylim(bottom=0.0)
        errors.set_ylabel("touchdown error [m], median and quartiles")
        for axes in (shares, errors):
            axes.set_xticks(range(len(labels)), labels)
            axes.set_xlabel(keys)
        shares.legend()
        figure.suptitle(title)
        save_figure(figure, path, parameters.dpi)


def _label(cell: Cell) -> str:
    return ", ".join(value for _, value in cell.swept)


def _quartiles(landings: Sequence[Landing]) -> np.ndarray:
    errors_m = [landing.error_m for landing in landings if np.isfinite(landing.error_m)]
    return np.quantile(errors_m, [0.25, 0.5, 0.75]) if errors_m else np.full(3, np.nan)
