"""Tables and pictures of many landings: where they touched the deck, and at which instants of its motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shipland.evaluation.campaign import CellResult
from shipland.evaluation.landing import Landing
from shipland.evaluation.leaderboard import rules_table
from shipland.evaluation.suite import Cell
from shipland.evaluation.tables import causes_table, landings_table, modes_table
from shipland.evaluation.tally import Tally
from shipland.extras import installed
from shipland.factories import name_of
from shipland.figures import drawn, styled
from shipland.files import write_atomically, writing
from shipland.frames import Array
from shipland.report.palette import BLUE, GREEN, VERMILION, unit
from shipland.report.plots import DPI, draw_pad
from shipland.report.svg import SERIES
from shipland.rig import Rig, area_of
from shipland.scenario.scenario import Scenario
from shipland.sim.ship.ship import build_ship

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Touchdown(NamedTuple):
    """First contact of a flight, NaN where there was none: its time on the axis of the deck's motion, its place there.

    `landed`: the aircraft came to rest on its feet on the deck, in the landing area.
    """

    t_s: float
    forward_m: float
    starboard_m: float
    landed: bool


@dataclass(frozen=True)
class DeckTrace:
    """The deck's motion that was met at (m,) times: (m, 6) forward, starboard, down [m], roll, pitch, yaw [rad]."""

    t_s: Array
    displacement: Array

    def curves(self) -> list[tuple[str, Array]]:
        """The coordinates that move, with their names, angles first."""
        surge_m, sway_m, down_m, *angles_rad = self.displacement.T
        named = dict(zip(("roll [°]", "pitch [°]", "yaw [°]"), np.degrees(angles_rad), strict=True))
        named |= {"surge [m]": surge_m, "sway [m]": sway_m, "heave, up [m]": -down_m}
        return [(name, values) for name, values in named.items() if np.ptp(values) > _STILL]


_STILL = 1e-6
"""A coordinate that moves by less, in metres or degrees, is not drawn."""


def touchdowns_of(landings: Sequence[Landing]) -> list[Touchdown]:
    """Of some landings."""
    return [
        Touchdown(it.instant_s if it.touched else math.nan, it.forward_m, it.starboard_m, it.success) for it in landings
    ]


def plot_touchdowns(path: Path, touchdowns: Sequence[Touchdown], rig: Rig, title: str, dpi: int = DPI) -> None:
    """Dots on deck and landing area, with median and largest distance; DataError when it cannot be written."""
    with drawn(path, (6.2, 6.6), dpi) as figure:
        figure.suptitle(title, fontsize=13, fontweight="bold", parse_math=False)
        draw_touchdowns(figure.add_subplot(), touchdowns, rig, "")


def draw_touchdowns(axes: Axes, touchdowns: Sequence[Touchdown], rig: Rig, title: str) -> None:
    """Dots on deck and landing area, their number, median and largest distance below the title."""
    place_m = np.array([(it.forward_m, it.starboard_m) for it in touchdowns]).reshape(-1, 2)
    landed = np.array([it.landed for it in touchdowns], dtype=bool)
    touched = np.isfinite(place_m).all(axis=1)
    draw_pad(axes, rig)
    for chosen, colour, marker, name in (
        (touched & landed, BLUE, "o", f"landed in the {rig.landing_area}"),
        (touched & ~landed, VERMILION, "X", "not"),
    ):
        if chosen.any():
            axes.scatter(
                place_m[chosen, 1], place_m[chosen, 0], s=34, marker=marker, color=unit(colour), alpha=0.7,
                edgecolor="white", linewidth=0.6, label=f"{int(chosen.sum())} {name}", zorder=3,
            )  # fmt: skip
    lines = [title] * bool(title) + [f"{int(landed.sum())} of {len(landed)} landed in the {rig.landing_area}"]
    if touched.any():
        error_m = np.linalg.norm(place_m[touched], axis=1)
        lines.append(f"median {100 * np.median(error_m):.1f} cm, largest {100 * error_m.max():.1f} cm from the centre")
        axes.legend(loc="lower left", bbox_to_anchor=(0.1, 0.1))
    if not touched.all():
        lines.append(f"{int((~touched).sum())} without contact")
    axes.set_title("\n".join(lines), fontweight="normal", parse_math=False)


def pad_of(rig: Rig) -> tuple[str, float, float]:
    """What touchdowns are drawn on: the landing area's kind and size [m], and the deck's size [m]."""
    return rig.landing_area, rig.landing_square_m, rig.deck_size_m


def plot_cells(cells: Sequence[CellResult]) -> Figure:
    """Where each pilot's landings touched, a picture a pad, and each cell's share with its interval."""
    pilots = list(dict.fromkeys(cell.pilot for cell in cells))
    parts = {(cell.pilot, pad_of(cell.rig)): cell.rig for cell in cells}
    with styled((5.2 * (len(parts) + 1), max(5.4, 2.0 + 0.32 * len(cells)))) as figure:
        *pads, shares = figure.subplots(1, len(parts) + 1)
        for ((pilot, pad), rig), axes in zip(parts.items(), pads, strict=True):
            there = (cell for cell in cells if (cell.pilot, pad_of(cell.rig)) == (pilot, pad))
            draw_touchdowns(axes, touchdowns_of([it for cell in there for it in cell.landings]), rig, pilot)
        for row, cell in enumerate(cells):
            tally = Tally.of(cell.landings)
            colour = unit(SERIES[pilots.index(cell.pilot) % len(SERIES)])
            shares.plot(100 * np.array(tally.interval), [row, row], color=colour, linewidth=2.0)
            shares.plot(100 * tally.share, row, "o", color=colour)
        shares.set_yticks(range(len(cells)), [cell.name for cell in cells], parse_math=False)
        shares.set(xlim=(-2.0, 102.0), ylim=(len(cells) - 0.5, -0.5))
        shares.set_title(f"landed in the {area_of(cell.rig for cell in cells)}, with the 95 % interval [%]")
    return figure


def plot_instants(path: Path, trace: DeckTrace, touchdowns: Sequence[Touchdown], title: str) -> None:
    """The deck's moving coordinates over time with a dot at each touchdown; DataError when it cannot be written.

    [Lee2022, §Tracking Capability and Landing Accuracy] shows its landings in this way.
    """
    curves = trace.curves()
    with drawn(path, (10.4, 1.2 + 1.7 * max(len(curves), 1)), DPI) as figure:
        figure.suptitle(title, fontsize=13, fontweight="bold", parse_math=False)
        grid = figure.add_gridspec(max(len(curves), 1), 2, width_ratios=[6, 1])
        for row, (name, values) in enumerate(curves):
            axes = figure.add_subplot(grid[row, 0])
            side = figure.add_subplot(grid[row, 1], sharey=axes)
            axes.set_title(name)
            axes.plot(trace.t_s, values, color="#777777", linewidth=1.0)
            side.hist(values, bins=12, density=True, orientation="horizontal", color="#c8c8c8")
            for landed, colour, marker, name in ((True, GREEN, "o", "landed"), (False, VERMILION, "X", "not")):
                t_s = [it.t_s for it in touchdowns if it.landed == landed]
                if t_s:
                    axes.plot(
                        t_s, np.interp(t_s, trace.t_s, values), color=unit(colour), marker=marker, linestyle="none",
                        markersize=5.5, markeredgecolor="white", label=f"{len(t_s)} {name}",
                    )  # fmt: skip
            touched = np.interp([it.t_s for it in touchdowns if math.isfinite(it.t_s)], trace.t_s, values)
            if len(touched):
                side.hist(touched, bins=12, density=True, orientation="horizontal", histtype="step", color=unit(GREEN))
            axes.set_xlim(float(trace.t_s[0]), float(trace.t_s[-1]))
            side.tick_params(labelleft=False, labelbottom=False)
            side.set_title("share" if row == 0 else "")
            if row == len(curves) - 1:
                axes.set_xlabel("time [s]")
                side.set_xlabel("grey: motion\ngreen: touchdowns", fontsize=8.5)
            else:
                axes.tick_params(labelbottom=False)
            if row == 0:
                axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)


def write_campaign(folder: Path, cell: Cell, landings: Sequence[Landing]) -> None:
    """Write `table.md` and, with `plots`, `landings.png` and, of one motion, `instants.png`; or a DataError."""
    scenario, rig = cell.scenario, cell.scenario.rig
    tables = [landings_table(landings, rig.landing_area), causes_table(landings), modes_table(landings)]
    tables.append(rules_table(landings, rig))
    with writing(folder / "table.md"):
        write_atomically(folder / "table.md", ("\n\n".join(filter(None, tables)) + "\n").encode())
    if not installed("plots"):
        return
    touchdowns = touchdowns_of(landings)
    title = f"{scenario.name}, pilot {name_of(cell.pilot)}, vision {name_of(cell.vision)}"
    plot_touchdowns(folder / "landings.png", touchdowns, rig, title)
    if scenario.ship.same_motion:
        plot_instants(folder / "instants.png", deck_trace(scenario, landings), touchdowns, title)


def deck_trace(scenario: Scenario, landings: Sequence[Landing]) -> DeckTrace:
    """The one motion that every flight meets with `ship.same_motion`, to five seconds after the last landing."""
    ship = build_ship(replace(scenario.ship, instant_range_s=0.0), scenario.rig, np.random.default_rng(0))
    t_s = np.arange(0.0, max(landing.instant_s for landing in landings) + 5.0, 0.05)
    return DeckTrace(t_s, np.array([ship.at(t).deck.displacement for t in t_s.tolist()]))
