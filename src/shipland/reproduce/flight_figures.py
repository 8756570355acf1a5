"""Pictures of recorded flights as the paper shows them: trajectories, commands over time, landing points."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.figures import drawn
from shipland.frames import Array
from shipland.record.reader import FlightLog, read_log
from shipland.report.landing_plots import Touchdown, plot_touchdowns
from shipland.report.palette import GREY, MODE_COLOURS, VERMILION, Rgb, mode_colour, mode_name, unit
from shipland.report.plots import (
    draw_forward,
    draw_heading,
    draw_mode_key,
    draw_right,
    draw_sticks,
    draw_up,
    finish_time_axes,
    write_title,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_UP = np.array([1.0, 1.0, -1.0])
_SHIP_EVERY_S = 5.0
_DPI = 80
"""Small enough for a page of documentation."""


def read_flights(folder: Path) -> list[FlightLog]:
    """The logs with truth in a folder and those below it, by name, a flight that was flown again once.

    DataError where none are, or one cannot be read.
    """
    paths = sorted(folder.rglob("*.mcap"), key=lambda path: (path.parent, len(path.stem), path.stem))
    flights: dict[tuple[str, str, str, int | None], FlightLog] = {}
    for log in map(read_log, paths):
        info = log.header.info
        if any(record.truth for record in log.records):
            flights.setdefault((info.config_digest, info.pilot, info.vision, info.seed), log)
    logs = [*flights.values()]
    if not logs:
        raise DataError(
            f"{folder} holds no log of a simulated flight (*.mcap); "
            "fly with `shipland fly` or `shipland campaign --logs`"
        )
    return logs


def figures_of_flights(folder: Path, out: Path) -> list[Path]:
    """Draw a folder's flights: all trajectories and landing points, and the commands of the one from farthest away.

    DataError where there are no logs, or a file cannot be written.
    """
    logs = read_flights(folder)
    farthest = max(logs, key=lambda log: Tracks(log).distance_m[0])
    scenarios, pilots = ({getattr(log.header.info, name): None for log in logs} for name in ("scenario", "pilot"))
    title = f"{', '.join(scenarios)}, pilot {', '.join(pilots)}, {len(logs)} flight{'s' if len(logs) > 1 else ''}"
    paths = [out / name for name in ("trajectories.png", "commands.png", "landings.png")]
    plot_trajectories(paths[0], logs, title)
    plot_commands(paths[1], farthest)
    plot_touchdowns(paths[2], first_contacts(logs), logs[0].header.rig, title, _DPI)
    return paths


class Tracks:
    """Where aircraft and ship went, in the axes of `ship` at the first frame: ahead, starboard, UP of the pad there.

    Attributes:
        t_s: (n,) exposure times.
        aircraft_m, ship_m: (n, 3).
        distance_m: (n,) between them over ground.
        under_way: whether the ship moved by more than a metre.
    """

    def __init__(self, log: FlightLog) -> None:
        truths = [record.truth for record in log.records if record.truth is not None]
        start = truths[0].ned_from_ship.inverse()
        self.t_s = np.array([truth.t_s for truth in truths])
        self.aircraft_m = np.array([_UP * start.apply(truth.ned_from_body.translation_m) for truth in truths])
        self.ship_m = np.array([_UP * start.apply(truth.ned_from_ship.translation_m) for truth in truths])
        self.distance_m: Array = np.linalg.norm((self.aircraft_m - self.ship_m)[:, :2], axis=1)
        self.under_way = bool(np.linalg.norm(np.ptp(self.ship_m, axis=0)[:2]) > 1.0)


def first_contacts(logs: Iterable[FlightLog]) -> list[Touchdown]:
    """One a flight."""
    found = []
    for verdict in (log.verdict for log in logs):
        if verdict is None:
            found.append(Touchdown(nan, nan, nan, False))
        else:
            forward_m, starboard_m = map(float, verdict.touchdown_in_deck_m)
            found.append(Touchdown(verdict.t_s, forward_m, starboard_m, verdict.success))
    return found


def plot_trajectories(path: Path, logs: Sequence[FlightLog], title: str) -> None:
    """Many flights from above and from the side, by mode, as in [Lee2022, §Tracking Capability and Landing Accuracy].

    Above: in the axes of the ship at the start; a ship under way is drawn every five seconds. Side: height over the
    neutral deck against distance from the ship.
    """
    with drawn(path, (10.4, 9.0), _DPI) as figure:
        figure.suptitle(title, fontsize=13, fontweight="bold")
        above, beside = figure.subplots(2, 1, height_ratios=[2.2, 1.0])
        tracks = [Tracks(log) for log in logs]
        for log, track in zip(logs, tracks, strict=True):
            draw_above(above, log, track)
            _draw_beside(beside, log, track)
        above.set_aspect("equal", adjustable="datalim")
        above.set_title("from above: starboard (downward) over ahead of the ship at the start [m]")
        above.invert_yaxis()
        beside.set_title("from the side: height over the neutral deck [m] over distance from the ship [m]")
        beside.set_xlim(right=0.0)
        beside.axhline(-logs[0].header.rig.deck_height_m, color="#7fa7c9", linewidth=1.0)
        if max(float(track.distance_m.max()) for track in tracks) > 60.0:
            beside.set_xscale("symlog", linthresh=5.0, linscale=0.5)
            beside.set_xticks([-200, -100, -50, -20, -10, -5, 0])
            beside.xaxis.set_major_formatter("{x:g}")
            beside.minorticks_off()
        draw_key(above, logs)


def _stretches(log: FlightLog, track: Tracks) -> Iterator[tuple[Rgb, npt.NDArray[np.bool_]]]:
    """Of each stretch of one mode its colour and the (n,) frames of it; it lasts until the next one's start."""
    for from_s, to_s, mode in log.columns().mode_spans():
        yield mode_colour(mode), (track.t_s >= from_s) & (track.t_s <= to_s)


def draw_above(axes: Axes, log: FlightLog, track: Tracks) -> None:
    """A flight and the ship from above; a ship under way is drawn every five seconds."""
    for colour, chosen in _stretches(log, track):
        place_m = np.where(chosen[:, None], track.aircraft_m, np.nan)
        axes.plot(place_m[:, 0], place_m[:, 1], color=unit(colour), linewidth=1.0, alpha=0.85)
    if track.under_way:
        axes.plot(track.ship_m[:, 0], track.ship_m[:, 1], color=unit(GREY), linewidth=1.0)
        at_s = np.arange(track.t_s[0], track.t_s[-1], _SHIP_EVERY_S)
        squares = [np.interp(at_s, track.t_s, track.ship_m[:, axis]) for axis in (0, 1)]
        axes.plot(*squares, color=unit(VERMILION), marker="s", markersize=3.5, linestyle="none")
    else:
        axes.plot(0.0, 0.0, color=unit(VERMILION), marker="s", markersize=6.0, linestyle="none")
    axes.plot(*track.aircraft_m[0, :2], color="#000000", marker=".", markersize=5.0, linestyle="none")
    if log.verdict is None or not log.verdict.success:
        axes.plot(*track.aircraft_m[-1, :2], color=unit(VERMILION), marker="x", markersize=9.0, markeredgewidth=2.0)


def _draw_beside(axes: Axes, log: FlightLog, track: Tracks) -> None:
    for colour, chosen in _stretches(log, track):
        distance_m = np.where(chosen, track.distance_m, np.nan)
        height_m = np.where(chosen, track.aircraft_m[:, 2], np.nan)
        axes.plot(-distance_m, height_m, color=unit(colour), linewidth=1.0, alpha=0.85)


def draw_key(axes: Axes, logs: Sequence[FlightLog]) -> None:
    """What the colours and marks of `draw_above` mean."""
    from matplotlib.lines import Line2D

    seen = {record.decision.mode for log in logs for record in log.records}
    handles = [
        Line2D([], [], color=unit(mode_colour(mode)), linewidth=2.5, label=mode_name(mode))
        for mode in (*MODE_COLOURS, None)
        if mode in seen
    ]
    for marker, colour, label in (
        (".", (0, 0, 0), "start"),
        ("s", VERMILION, "ship"),
        ("x", VERMILION, "not in the landing area"),
    ):
        handles.append(Line2D([], [], color=unit(colour), marker=marker, linestyle="none", label=label))
    axes.legend(handles=handles, loc="best", ncols=2)


def plot_commands(path: Path, log: FlightLog) -> None:
    """One flight's sticks, distances and heading over time, the mode behind them, as in the same place of [Lee2022]."""
    columns = log.columns()
    with drawn(path, (9.0, 11.0), _DPI) as figure:
        write_title(figure, log)
        band, *panels = figure.subplots(7, 1, height_ratios=[0.16, 1, 1, 1, 1, 1, 1])
        draw_mode_key(band, columns)
        for axes, names in zip(panels, (("pitch", "roll"), ("heave", "yaw")), strict=False):
            draw_sticks(axes, columns, names)
            axes.set_title(f"{names[0]} and {names[1]} stick [%]")
        for draw, axes in zip((draw_forward, draw_right, draw_up, draw_heading), panels[2:], strict=True):
            draw(axes, columns)
        for axes in panels:
            finish_time_axes(axes, columns, log.verdict, last=axes is panels[-1])
