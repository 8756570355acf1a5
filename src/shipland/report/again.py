"""Two flights of one seed side by side: verdicts, where they part, and one picture."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from shipland.figures import drawn
from shipland.messages import TouchdownVerdict
from shipland.record.columns import FlightColumns
from shipland.record.reader import FlightLog
from shipland.report.palette import BLUE, VERMILION, unit
from shipland.report.plots import PLACES, draw_pad, finish_time_axes
from shipland.version import code_version

PART_M = 0.01
"""Two aircraft that are further from each other have parted."""
_FIGURES: dict[str, Callable[[TouchdownVerdict], float]] = {
    "error [cm]": lambda it: 100.0 * it.error_m,
    "ahead [cm]": lambda it: 100.0 * it.touchdown_in_deck_m[0],
    "starboard [cm]": lambda it: 100.0 * it.touchdown_in_deck_m[1],
    "sink [m/s]": lambda it: it.sink_mps,
    "tilt [°]": lambda it: math.degrees(it.tilt_rad),
    "first contact [s]": lambda it: it.t_s,
}
_NAMES = ("as it was flown", "again")


def comparison(before: FlightLog, after: FlightLog) -> Iterator[str]:
    """A table of both, a line each, and where they part."""
    verdicts = [before.verdict, after.verdict]
    landed = ["no touchdown" if it is None else "yes" if it.success else "no" for it in verdicts]
    rows = [["", *_NAMES], [f"landed in the {before.header.rig.landing_area}", *landed]]
    for name, of in _FIGURES.items():
        rows.append([name, *("–" if it is None or not it.touched else f"{of(it):.2f}" for it in verdicts)])
    rows.append(["cycles", f"{len(before.records)}", f"{len(after.records)}"])
    yield from (f"{name:<22}{first:>18}{second:>18}" for name, first, second in rows)
    for name, verdict in zip(_NAMES, verdicts, strict=True):
        yield f"{name}: {'no touchdown' if verdict is None else verdict.reason}"
    yield _parting(before.columns(), after.columns())


def versions(flown: str) -> str:
    """What to know of the code, by the version that flew; empty where it is the same."""
    here = code_version()
    if flown == here and "dirty" not in here:
        return ""
    if flown == here:
        return f"both by {here}: files differ from that commit, perhaps not the same ones"
    return f"flown by version {flown}, again by {here}: a difference may be the code's"


def plot_pair(path: Path, before: FlightLog, after: FlightLog) -> None:
    """Write both paths from above, their distance from the pad and their height; DataError when it cannot be."""
    with drawn(path, (10.4, 6.4), 110) as figure:
        info = before.header.info
        title = f"{info.scenario}, seed {info.seed}: as it was flown, and again"
        figure.suptitle(title, fontweight="bold", parse_math=False)
        grid = figure.add_gridspec(3, 2, width_ratios=[1.5, 1.0])
        rows = [figure.add_subplot(grid[row, 0]) for row in range(3)]
        above = figure.add_subplot(grid[:, 1])
        draw_pad(above, before.header.rig)
        above.set_title("over the deck, from above; touchdowns")
        for log, name, colour in zip((before, after), _NAMES, (BLUE, VERMILION), strict=True):
            columns = log.columns()
            for axis, axes in enumerate(rows):
                axes.plot(columns.t_s, columns.place_in_pad_m[:, axis], color=unit(colour), label=name)
            track_m = columns.truth_in_deck_m
            above.plot(track_m[:, 1], track_m[:, 0], color=unit(colour), linewidth=1.0, label=name)
            if log.verdict is not None and log.verdict.touched:
                forward_m, right_m = log.verdict.touchdown_in_deck_m
                above.plot(right_m, forward_m, "o", color=unit(colour), markersize=7)
        for axes, title in zip(rows, PLACES, strict=True):
            axes.set_title(title)
            finish_time_axes(axes, before.columns(), None, last=axes is rows[-1])
            axes.set_xlim(0.0, max(log.records[-1].frame.t_s for log in (before, after) if log.records))


def _parting(before: FlightColumns, after: FlightColumns) -> str:
    """Where the two differ first, and where by a centimetre."""
    count = min(len(before.t_s), len(after.t_s))
    if not count:
        return "one of the two has no cycle"
    both = [np.column_stack([it.t_s, it.sticks_percent, it.truth_in_pad_m])[:count] for it in (before, after)]
    same = (np.equal(*both) | np.isnan(both).all(axis=0)).all(axis=1)
    if same.all() and len(before.t_s) == len(after.t_s):
        return "the same flight, bit for bit"
    first = int(np.argmin(same)) if not same.all() else count - 1
    words = f"they differ from {before.t_s[first]:.2f} s on"
    shared_s = before.t_s[:count]
    again_m = np.column_stack([np.interp(shared_s, after.t_s, after.truth_in_pad_m[:, axis]) for axis in range(3)])
    apart = np.linalg.norm(again_m - before.truth_in_pad_m[:count], axis=1) > PART_M
    return f"{words}, by {100.0 * PART_M:g} cm from {shared_s[np.argmax(apart)]:.2f} s" if apart.any() else words
