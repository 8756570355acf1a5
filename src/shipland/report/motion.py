"""The ship's motion and the wind of a scenario, as a table, CSV files and figures; no flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table

from shipland.errors import ConfigError
from shipland.figures import drawn
from shipland.files import write_csv, writing
from shipland.frames import Array
from shipland.report.palette import BLUE, GREEN, GREY, VERMILION, unit
from shipland.scenario.autonomy import drawn_ship
from shipland.scenario.scenario import Scenario
from shipland.scenario.seeds import generators_of
from shipland.sim.ship.deck_motion import DOF_NAMES, rig_limits
from shipland.sim.ship.recorded import HEADER
from shipland.sim.ship.sea import significant_amplitude
from shipland.sim.wind import build_wind

_AXES = [f"{name} [{unit}]" for name, unit in zip(DOF_NAMES, ("m", "m", "m, down", "°", "°", "°"), strict=True)]
_RULES = {
    "froude": ("Froude: time / √scale", unit(BLUE)),
    "length_only": ("lengths only: time as at sea", unit(VERMILION)),
}
DEGREES = np.array([1.0, 1.0, 1.0, *[180.0 / np.pi] * 3])
"""From metres and radians to metres and degrees."""
UNITS = ("m", "m", "m", "°", "°", "°")
WIND_HEADER = ("t_s", "north_m", "east_m", "course_deg", "wind_north_mps", "wind_east_mps", "wind_down_mps")
STATISTICS_STEP_S = 0.1
OVER_DECK_M = 1.0
"""The wind is taken this high over the deck's centre."""

HEADINGS = {120.0: "60° off the stern", 60.0: "60° off the bow"}
"""Bearings that the waves come from [deg], in words."""
TIME_RULES: tuple[Literal["froude", "length_only"], ...] = ("froude", "length_only")


@dataclass(frozen=True)
class Traces:
    """Ship and wind, sampled at (N,) times.

    Attributes:
        deck: (N, 6) surge, sway, heave [m], roll, pitch, yaw [deg] of the deck in `ship`.
        course: (N, 3) north, east [m], course [deg] of the ship.
        wind_in_ned_mps: (N, 3) air velocity over the deck.
        limit_bites: what the motion base has held back, a line each.
    """

    t_s: Array
    deck: Array
    course: Array
    wind_in_ned_mps: Array
    limit_bites: tuple[str, ...]


@dataclass(frozen=True)
class Statistics:
    """One degree of freedom over a long record [m or deg]: significant amplitude, mean period, largest excursion.

    The period is between upward zero crossings; NaN where there are fewer than two.
    """

    significant: float
    period_s: float
    largest: float


@dataclass(frozen=True)
class Sampling:
    """Length of the CSV files and the figure and of the record behind the table; time step of files and figure."""

    duration_s: float = 120.0
    statistics_s: float = 1800.0
    step_s: float = 0.05
    seed: int = 1

    def __post_init__(self) -> None:
        if not 0.001 <= self.step_s <= 1.0:
            raise ConfigError(f"step_s must be in 0.001…1 s, got {self.step_s}")
        for name, value in (("duration_s", self.duration_s), ("statistics_s", self.statistics_s)):
            if not 10.0 <= value <= 36000.0:
                raise ConfigError(f"{name} must be in 10…36000 s, got {value}")


def plot_case(path: Path, traces: Traces) -> None:
    """The deck's motion and the wind over it as a PNG; DataError when it cannot be written."""
    with drawn(path, (10.0, 11.0)) as figure:
        axes = figure.subplots(7, 1, sharex=True)
        *degrees, air = axes
        for panel, values, name in zip(degrees, traces.deck.T, _AXES, strict=True):
            panel.plot(traces.t_s, values, color=unit(BLUE))
            panel.set_ylabel(name)
        towards = (("north", VERMILION), ("east", GREEN), ("down", GREY))
        for values, (name, colour) in zip(traces.wind_in_ned_mps.T, towards, strict=True):
            air.plot(traces.t_s, values, color=unit(colour), label=name)
        air.legend(loc="upper right", ncols=3)
        air.set(xlabel="time [s]", ylabel="air over deck [m/s]", xlim=(traces.t_s[0], traces.t_s[-1]))
        figure.align_ylabels(axes)


def plot_headings(path: Path, panels: Mapping[str, Mapping[str, Traces]], limit: Array) -> None:
    """Six traces, one column a heading, one curve a time rule, the motion base's limits where they are near.

    `panels`: heading → time rule → traces; `limit` (6,) [m, deg]. DataError when the PNG cannot be written.
    """
    with drawn(path, (13.0, 11.0)) as figure:
        axes = figure.subplots(6, len(panels), sharex=True, sharey="row", squeeze=False)
        for column, (heading, rules) in enumerate(panels.items()):
            axes[0, column].set_title(f"waves from {heading}")
            axes[5, column].set_xlabel("time on the rig [s]")
            for index in range(6):
                for rule, traces in rules.items():
                    name, colour = _RULES[rule]
                    axes[index, column].plot(traces.t_s, traces.deck[:, index], color=colour, label=name)
                    axes[index, column].set_xlim(traces.t_s[0], traces.t_s[-1])
        for index, name in enumerate(_AXES):
            axes[index, 0].set_ylabel(name)
            largest = max(np.abs(it.deck[:, index]).max() for rules in panels.values() for it in rules.values())
            if largest > 0.8 * limit[index]:
                for axis, sign in product(axes[index], (-1.0, 1.0)):
                    axis.axhline(sign * limit[index], color=unit(GREY), linestyle="--", linewidth=1.0)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
        figure.align_ylabels(axes[:, 0])


def sample(scenario: Scenario, seed: int, duration_s: float, step_s: float) -> Traces:
    """Ship and wind of a flight of this seed at every step from 0 to `duration_s`."""
    ship, wind = drawn_ship(scenario, seed), build_wind(scenario.wind, scenario.rig, generators_of(seed).wind)
    t_s = np.arange(0.0, duration_s + 0.5 * step_s, step_s)
    deck, course, air = np.empty((t_s.size, 6)), np.empty((t_s.size, 3)), np.empty((t_s.size, 3))
    over_deck_m = np.array([0.0, 0.0, -OVER_DECK_M])
    for i, t in enumerate(t_s.tolist()):
        state = ship.at(t)
        deck[i] = state.deck.displacement * DEGREES
        course[i] = (*state.course.position_in_ned_m, np.degrees(state.course.course_rad))
        north_m, east_m, down_m = state.ned_from_ship.apply(over_deck_m).tolist()
        air[i] = wind.velocity_at(t, (north_m, east_m, down_m), state.place)
    return Traces(t_s, deck, course, air, tuple(map(str, ship.limit_bites)))


def statistics(scenario: Scenario, seed: int, duration_s: float) -> tuple[Statistics, ...]:
    """Statistics of the six degrees of freedom of the deck."""
    ship = drawn_ship(scenario, seed)
    t_s = np.arange(0.0, duration_s, STATISTICS_STEP_S)
    deck = np.array([ship.deck_motion.at(t).displacement for t in t_s.tolist()]) * DEGREES
    found = []
    for series in deck.T:
        centred = series - series.mean()
        rising = np.flatnonzero((centred[:-1] < 0.0) & (centred[1:] >= 0.0))
        period_s = float(np.diff(t_s[rising]).mean()) if rising.size > 1 else float("nan")
        found.append(Statistics(2.0 * float(series.std()), period_s, float(np.abs(series).max())))
    return tuple(found)


def report_case(scenario: Scenario, sampling: Sampling, out: Path, console: Console) -> None:
    """Write table, CSV files and figure; DataError where the folder cannot be written."""
    traces = sample(scenario, sampling.seed, sampling.duration_s, sampling.step_s)
    _write_series(out / "motion.csv", HEADER, traces.t_s, traces.deck)
    _write_series(out / "wind.csv", WIND_HEADER, traces.t_s, traces.course, traces.wind_in_ned_mps)
    plot_case(out / "motion.png", traces)
    columns = {str(scenario.ship.motion): statistics(scenario, sampling.seed, sampling.statistics_s)}
    _report_statistics(columns, out / "motion_table.csv", console, f"deck motion over {sampling.statistics_s:g} s")
    for line in traces.limit_bites:
        console.print(line)
    console.print(f"written: motion.csv, wind.csv, motion_table.csv, motion.png in {out}", soft_wrap=True)


def report_headings(scenario: Scenario, sampling: Sampling, out: Path, console: Console) -> None:
    """The same of waves 60° off the bow and off the stern, at both time rules, in one figure."""
    panels: dict[str, dict[str, Traces]] = {}
    columns: dict[str, tuple[Statistics, ...]] = {}
    full_scale: dict[str, Array] = {}
    sea, scale = scenario.ship.sea, scenario.ship.scale
    for waves_from_deg, name in HEADINGS.items():
        turned = replace(sea, waves_from_deg=waves_from_deg)
        full_scale[name] = significant_amplitude(turned) * DEGREES
        panels[name] = {}
        for rule in TIME_RULES:
            ship = replace(scenario.ship, motion="sea", sea=turned, scale=replace(scale, time=rule))
            one = replace(scenario, ship=ship)
            panels[name][rule] = sample(one, sampling.seed, sampling.duration_s, sampling.step_s)
            columns[f"{name}\n{rule}"] = statistics(one, sampling.seed, sampling.statistics_s)
    plot_headings(out / "motion_headings.png", panels, rig_limits(scenario.rig) * DEGREES)
    title = f"Hs {sea.height_m:g} m, Tp {sea.period_s:g} s, {sea.speed_kn:g} kn, length scale {scale.length:g}"
    console.print(f"significant single amplitudes at full scale: {title}", soft_wrap=True)
    console.print(_table({name: [f"{value:.2f}" for value in each] for name, each in full_scale.items()}))
    words = f"on the rig: {title}, {sampling.statistics_s:g} s"
    _report_statistics(columns, out / "motion_headings.csv", console, words)
    console.print(f"written: motion_headings.csv, motion_headings.png in {out}", soft_wrap=True)


def _table(columns: Mapping[str, Sequence[str]]) -> Table:
    """Of a text for each degree of freedom."""
    table = Table("", *columns)
    for name, symbol, *texts in zip(DOF_NAMES, UNITS, *columns.values(), strict=True):
        table.add_row(f"{name}, {symbol}", *texts)
    return table


def _report_statistics(columns: Mapping[str, tuple[Statistics, ...]], path: Path, console: Console, words: str) -> None:
    """Write the statistics of cases as CSV, and print them as a table."""
    rows, texts = [], {}
    for case, found in columns.items():
        texts[case] = [f"{it.significant:.3g}{f' / {it.period_s:.1f} s' if it.period_s > 0.0 else ''}" for it in found]
        for name, symbol, it in zip(DOF_NAMES, UNITS, found, strict=True):
            about = {"case": case.replace("\n", ", "), "motion": name, "unit": symbol.replace("°", "deg")}
            measured = {"significant_amplitude": f"{it.significant:.4f}", "mean_period_s": f"{it.period_s:.3f}"}
            rows.append(about | measured | {"largest": f"{it.largest:.4f}"})
    with writing(path):
        write_csv(path, list(rows[0]), rows)
    console.print(f"{words}: significant amplitude / mean period", soft_wrap=True)
    console.print(_table(texts))


def _write_series(path: Path, header: tuple[str, ...], *columns: Array) -> None:
    with writing(path):
        texts = ([f"{value:.6g}" for value in row] for row in np.column_stack(columns).tolist())
        write_csv(path, header, (dict(zip(header, row, strict=True)) for row in texts))
