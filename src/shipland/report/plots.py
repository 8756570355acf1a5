"""A flight as one picture: places, speeds, sticks, deck motion over time, and the touchdown on the pad."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from shipland.errors import DataError
from shipland.figures import drawn
from shipland.frames import Array
from shipland.messages import Mode, TouchdownVerdict
from shipland.record.columns import FlightColumns
from shipland.record.reader import FlightLog
from shipland.report.palette import BLACK, BLUE, GREEN, GREY, ORANGE, STICKS, VERMILION, mode_colour, mode_name, unit
from shipland.rig import Rig

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 160
"""A flight is 1660 px wide: sharp at twice the width of a README."""
_STEP_S = 0.05
"""Cycles that are as close as this are drawn as they are."""
PLACES = ("ahead of the pad's centre [m]", "right of it [m]", "height over the neutral deck [m]")
_TRUTH, _SEEN = unit(BLACK), unit(ORANGE)


def write_title(figure: Figure, log: FlightLog) -> None:
    """Scenario, seed, pilot and verdict above a figure of one flight."""
    info, verdict = log.header.info, log.verdict
    seed = "" if info.seed is None else f", seed {info.seed}"
    end = "no touchdown" if verdict is None else verdict.reason
    title = f"{info.scenario}{seed}, pilot {info.pilot}:  {end}"
    figure.suptitle(title, fontsize=13, fontweight="bold", parse_math=False)


def plot_flight(path: Path, log: FlightLog, dpi: int = DPI) -> None:
    """Write the picture of one flight; DataError when the log has no rows or the file cannot be written."""
    if not log.records:
        raise DataError("the flight log has no rows: nothing to plot")
    columns, info, verdict = log.columns(), log.header.info, log.verdict
    with drawn(path, (10.4, 11.6), dpi) as figure:
        write_title(figure, log)
        grid = figure.add_gridspec(6, 2, height_ratios=[0.16, 1, 1, 1, 1, 1])
        band = figure.add_subplot(grid[0, :])
        draw_mode_key(band, columns)
        left = [figure.add_subplot(grid[row, 0]) for row in range(1, 6)]
        right = [figure.add_subplot(grid[row, 1]) for row in range(3, 6)]
        pad = figure.add_subplot(grid[1:3, 1])
        for draw, axes in zip((draw_forward, draw_right, draw_up, draw_heading, _draw_speed), left, strict=True):
            draw(axes, columns)
        for draw, axes in zip((draw_sticks, _draw_deck_turn, _draw_deck_heave), right, strict=True):
            draw(axes, columns)
        for axes in (*left, *right):
            finish_time_axes(axes, columns, verdict, last=axes in (left[-1], right[-1]))
        draw_pad(pad, log.header.rig)
        _draw_touchdown(pad, columns, log.header.rig, info.aircraft_diagonal_m, verdict)


def draw_pad(axes: Axes, rig: Rig) -> None:
    """Deck and landing area from above, forward up, starboard right [m]."""
    from matplotlib.patches import Circle, Patch, Rectangle

    half_deck_m, half_m = 0.5 * rig.deck_size_m, 0.5 * rig.landing_square_m
    deck = Rectangle((-half_deck_m, -half_deck_m), rig.deck_size_m, rig.deck_size_m, facecolor="#e9ecef")
    landing: Patch = Rectangle((-half_m, -half_m), rig.landing_square_m, rig.landing_square_m, facecolor="#ffffff")
    if rig.landing_area == "circle":
        landing = Circle((0.0, 0.0), half_m, facecolor="#ffffff")
    for patch, edge in ((deck, "#555555"), (landing, unit(GREEN))):
        patch.set(edgecolor=edge, linewidth=1.8, zorder=0.5)
        axes.add_patch(patch)
    reach_m = 0.5 * rig.deck_size_m + 0.12
    axes.set(xlim=(-reach_m, reach_m), ylim=(-reach_m, reach_m), aspect="equal")
    axes.set(xlabel="starboard of the deck's centre [m]", ylabel="ahead of it [m]")
    axes.grid(visible=False)


def _show_at_least(axes: Axes, span: float) -> None:
    """Widen the ordinate to `span`, so that noise about a steady value does not fill the picture."""
    low, high = axes.get_ylim()
    if high - low < span:
        axes.set_ylim(0.5 * (low + high - span), 0.5 * (low + high + span))


def draw_mode_key(axes: Axes, columns: FlightColumns) -> None:
    """The colours of the modes that occur."""
    from matplotlib.patches import Patch

    present = [mode for mode in Mode if (columns.mode_number == mode.value).any()]
    keys = [Patch(facecolor=unit(mode_colour(mode)), alpha=0.45, label=mode_name(mode)) for mode in present]
    if keys:
        axes.legend(handles=keys, loc="center", ncols=len(keys), frameon=False, fontsize=10, title="flight mode")
    axes.axis("off")


def finish_time_axes(axes: Axes, columns: FlightColumns, verdict: TouchdownVerdict | None, last: bool) -> None:
    """Modes as background, touchdown as a line, legend; the time's name below the last panel only."""
    t_s = columns.t_s
    for from_s, to_s, mode in columns.mode_spans():
        axes.axvspan(from_s, to_s, facecolor=unit(mode_colour(mode)), alpha=0.2, linewidth=0, zorder=0)
    if verdict is not None:
        axes.axvline(verdict.t_s, color=unit(BLACK), linewidth=1.0, linestyle=(0, (4, 2)))
    axes.set_xlim(float(t_s[0]), float(t_s[-1]) if t_s[-1] > t_s[0] else float(t_s[0]) + 1.0)
    if last:
        axes.set_xlabel("time [s]")
    else:
        axes.tick_params(labelbottom=False)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best", ncols=4, markerscale=2.5, handlelength=1.2, columnspacing=0.9, borderpad=0.25)


def draw_forward(axes: Axes, columns: FlightColumns) -> None:
    """Place ahead of the pad; logarithmic when it goes from far to near."""
    _draw_place(axes, columns, 0)
    ahead_m = columns.place_in_pad_m[:, 0]
    if np.nanmax(np.abs(ahead_m), initial=0.0) > 20.0 and np.nanmin(np.abs(ahead_m), initial=np.inf) < 2.0:
        axes.set_yscale("symlog", linthresh=1.0, linscale=0.4)
        axes.set_yticks([-200, -100, -50, -20, -10, -5, -2, -1, 0, 1])
        axes.yaxis.set_major_formatter("{x:g}")
        axes.minorticks_off()
        axes.set_ylim(1.3 * float(np.nanmin(ahead_m)), max(1.0, 1.2 * float(np.nanmax(ahead_m))))


def draw_right(axes: Axes, columns: FlightColumns) -> None:
    """Place right of the pad."""
    _draw_place(axes, columns, 1)


def draw_up(axes: Axes, columns: FlightColumns) -> None:
    """Height over the neutral deck, and the deck's own."""
    _draw_place(axes, columns, 2)
    axes.plot(*smooth(columns.t_s, columns.deck_shift_m[:, 2]), color=unit(GREY), label="deck's centre")
    if np.isfinite(columns.landing_probability).any():
        shares, percent = axes.twinx(), 100.0 * columns.landing_probability
        low, high = axes.get_ylim()
        axes.set_ylim(low - 0.25 * (high - low), high)  # a place for the legend, which keeps clear of lines in `axes`
        axes.plot(columns.t_s, percent, color=unit(VERMILION), linewidth=0.8, transform=shares.transData)
        shares.set_ylim(0.0, 100.0)
        shares.set_ylabel("P(landing) [%]", color=unit(VERMILION))


def _draw_place(axes: Axes, columns: FlightColumns, axis: int) -> None:
    axes.set_title(PLACES[axis])
    _draw_both(axes, columns, columns.estimate_in_pad_m[:, axis], columns.truth_in_pad_m[:, axis], 0.4)


def draw_heading(axes: Axes, columns: FlightColumns) -> None:
    """Heading against the ship."""
    axes.set_title("heading against the ship's [°]")
    _draw_both(axes, columns, np.degrees(columns.estimate_yaw_rad), np.degrees(columns.truth_yaw_rad), 10.0)


def _draw_both(axes: Axes, columns: FlightColumns, estimate: Array, truth: Array, span: float) -> None:
    """The pilot's estimates at their own times, so that they lie on the truth where they are right."""
    axes.plot(
        columns.estimate_t_s, estimate, ".", color=_SEEN, label="pilot's estimate", markersize=4.0, markeredgewidth=0.0
    )
    axes.plot(columns.t_s, truth, color=_TRUTH, label="truth")
    _show_at_least(axes, span)


def _draw_speed(axes: Axes, columns: FlightColumns) -> None:
    axes.set_title("speed against the ship [m/s]")
    names = (("forward", BLUE), ("right", VERMILION), ("up", GREEN))
    for (name, colour), along_mps in zip(names, columns.speed_in_pad_mps.T, strict=True):
        axes.plot(columns.t_s, along_mps, color=unit(colour), label=name)
    _show_at_least(axes, 0.4)


def draw_sticks(axes: Axes, columns: FlightColumns, names: Collection[str] = STICKS) -> None:
    """The sticks of these names."""
    axes.set_title("sticks [%]")
    for (name, colour), percent in zip(STICKS.items(), columns.sticks_percent.T, strict=True):
        if name in names:
            axes.step(columns.t_s, percent, where="post", color=unit(colour), label=name)
    axes.set_ylim(-105.0, 105.0)
    axes.set_yticks([-100, -50, 0, 50, 100])


def _draw_deck_turn(axes: Axes, columns: FlightColumns) -> None:
    axes.set_title("deck's roll and pitch [°]")
    for name, colour, turn_rad in zip(("roll", "pitch"), (BLUE, VERMILION), columns.deck_turn_rad.T, strict=False):
        axes.plot(*smooth(columns.t_s, np.degrees(turn_rad)), color=unit(colour), label=name)
    _show_at_least(axes, 4.0)


def _draw_deck_heave(axes: Axes, columns: FlightColumns) -> None:
    axes.set_title("deck's heave, up [m]")
    axes.plot(*smooth(columns.t_s, columns.deck_shift_m[:, 2]), color=unit(GREEN))
    _show_at_least(axes, 0.2)


def _draw_touchdown(
    axes: Axes, columns: FlightColumns, rig: Rig, diagonal_m: float, verdict: TouchdownVerdict | None
) -> None:
    axes.set_title("touchdown on the deck, from above")
    ahead_m, right_m, _ = columns.truth_in_deck_m.T
    landing = np.isin(columns.mode_number, [Mode.LAND.value, Mode.DONE.value])
    seen = np.maximum(np.abs(ahead_m), np.abs(right_m)) < axes.get_xlim()[1]
    for chosen, colour, name in ((seen & ~landing, BLUE, "before landing"), (seen & landing, GREEN, "while landing")):
        if chosen.any():
            track = np.where(chosen, right_m, np.nan), np.where(chosen, ahead_m, np.nan)
            axes.plot(*track, color=unit(colour), linewidth=1.1, alpha=0.8, label=name)
    if verdict is not None and verdict.touched:
        first = min(int(np.searchsorted(columns.t_s, verdict.t_s)), len(columns.t_s) - 1)
        yaw_rad = float(np.nan_to_num(columns.truth_yaw_in_deck_rad[first]))
        draw_footprint(axes, verdict.touchdown_in_deck_m, yaw_rad, diagonal_m)
        axes.plot(*verdict.touchdown_in_deck_m[::-1], "o", color=unit(BLACK), markersize=6, label="touchdown")
        axes.plot(
            *verdict.rest_in_deck_m[::-1], "x", color=unit(VERMILION), markersize=7, markeredgewidth=2, label="at rest"
        )
        text = (
            f"{100.0 * verdict.error_m:.1f} cm from the centre, {verdict.sink_mps:.2f} m/s down, "
            f"tilt {np.degrees(verdict.tilt_rad):.1f}°, slip {100.0 * verdict.slip_m:.1f} cm"
        )
        axes.set_title("touchdown on the deck, from above", pad=20.0)
        axes.text(0.0, 1.02, text, transform=axes.transAxes, fontsize=9)
    if axes.get_legend_handles_labels()[0]:
        half = 0.5 - 0.5 * 0.96 * rig.deck_size_m / (2.0 * max(axes.get_xlim()))
        axes.legend(loc="lower left", bbox_to_anchor=(half, half), fontsize=8.5)


def draw_footprint(axes: Axes, place_in_deck_m: Array, yaw_rad: float, diagonal_m: float) -> None:
    """The aircraft from above: arms and rotor discs at (forward, starboard) `place_in_deck_m`, nose marked."""
    from matplotlib.patches import Circle

    forward_m, right_m = place_in_deck_m
    arm_m = 0.5 * diagonal_m
    for angle_rad in np.radians([45.0, 135.0, 225.0, 315.0]) + yaw_rad:
        tip = (right_m + arm_m * np.sin(angle_rad), forward_m + arm_m * np.cos(angle_rad))
        axes.plot([right_m, tip[0]], [forward_m, tip[1]], color="#444444", linewidth=2.0, zorder=1.5)
        axes.add_patch(Circle(tip, 0.55 * arm_m, facecolor="#44444433", edgecolor="#444444", zorder=1.5))
    nose = (right_m + 0.8 * arm_m * np.sin(yaw_rad), forward_m + 0.8 * arm_m * np.cos(yaw_rad))
    arrow = {"arrowstyle": "-|>", "color": "#444444", "linewidth": 1.5}
    axes.annotate("", nose, (right_m, forward_m), arrowprops=arrow)


def smooth(t_s: Array, values: Array) -> tuple[Array, Array]:
    """Times and values (n,) of a motion, splined between a detector's slow cycles; as they are where one is unknown."""
    if len(t_s) < 3 or not np.isfinite(values).all() or np.diff(t_s).min() <= 0.0 or np.diff(t_s).max() <= _STEP_S:
        return t_s, values
    dense_s = np.union1d(t_s, np.arange(t_s[0], t_s[-1], _STEP_S))
    return dense_s, np.asarray(CubicSpline(t_s, values)(dense_s))
