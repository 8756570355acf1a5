"""The pictures of `shipland paper`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shipland.figures import drawn
from shipland.guidance.laws import PUBLISHED_STEP_S, derivative_gain, exponential_law
from shipland.guidance.parameters import FarParameters, FarVariant, NearGains, NearParameters
from shipland.report.palette import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, Rgb, unit
from shipland.reproduce.far import HAND_OVER_M, SETTLED_SHARE
from shipland.reproduce.near import FALSE_AT_S, NearTrace
from shipland.reproduce.ranges import FarCase, FarTrace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_READING_COLOURS: dict[FarVariant, Rgb] = {"saturating": BLUE, "growing": VERMILION, "printed": GREY}
_FAR_COLOURS: dict[str, Rgb] = {
    "P": GREEN,
    "PID": PURPLE,
    "exponential, saturating": BLUE,
    "exponential, growing": VERMILION,
    "exponential, printed": GREY,
}
_NEAR_COLOURS: tuple[Rgb, ...] = (VERMILION, GREEN, BLUE)
"""Those of [Lee2022]: red, green, blue."""


def plot_roll_law(path: Path, ship: FarParameters, match_px: float) -> None:
    """Roll stick against the box's distance from the picture's middle, in three readings [Lee2022, Eq. 3]."""
    with drawn(path, (9.0, 4.2)) as figure:
        panels = figure.subplots(1, 2)
        for axes, reach_px in zip(panels, (200.0, 40.0), strict=True):
            errors_px = np.linspace(-reach_px, reach_px, 401)
            for variant, colour in _READING_COLOURS.items():
                sticks = [exponential_law(float(error_px), ship.roll, variant) for error_px in errors_px]
                width, style = (2.6, (0, (1, 1))) if variant == "printed" else (1.6, "-")
                axes.plot(errors_px, sticks, color=unit(colour), linewidth=width, linestyle=style, label=variant)
            linear = exponential_law(match_px, ship.roll, "saturating") / match_px * errors_px
            axes.plot(errors_px, np.clip(linear, -100.0, 100.0), color=unit(GREEN), linestyle="--", label="P")
            axes.set_xlabel("ship right of the picture's middle [px]")
            axes.set_xlim(-reach_px, reach_px)
        panels[0].set_title("roll stick [%]")
        panels[1].set_title("the same, near the setpoint")
        panels[0].legend(loc="upper left")


def plot_derivative_gain(path: Path, near: NearParameters) -> None:
    """K_D against the error's step in 0.03 s [Lee2022, Eq. 5, Table 2], and the linear derivative's."""
    with drawn(path, (9.0, 4.0)) as figure:
        metres, degrees = figure.subplots(1, 2)
        for name, colour in (("pitch", BLUE), ("roll", VERMILION), ("heave", GREEN)):
            _draw_gain(metres, getattr(near, name), 0.16, name, colour)
        _draw_gain(degrees, near.yaw, 18.0, "yaw", PURPLE)
        metres.set_ylim(0.0, 9.5)
        degrees.set_ylim(0.0, 2.0)
        metres.set_title("K_D [% per m/s]; dashed: linear")
        metres.set_xlabel("step of the error in 0.03 s [m]")
        degrees.set_title("K_D [% per °/s]; dashed: linear")
        degrees.set_xlabel("step of the error in 0.03 s [°]")
        metres.legend(loc="upper right")


def _draw_gain(axes: Axes, gains: NearGains, reach: float, name: str, colour: Rgb) -> None:
    steps = np.linspace(-reach, reach, 401)
    values = [derivative_gain(float(step), PUBLISHED_STEP_S, gains, "probabilistic") for step in steps]
    axes.plot(steps, values, color=unit(colour), label=name)
    axes.axhline(gains.b, color=unit(colour), linestyle="--", linewidth=1.0)
    axes.set_xlim(-reach, reach)


def plot_far_steps(path: Path, columns: Mapping[str, Mapping[str, FarTrace]]) -> None:
    """Sideways and vertical errors and their sticks over time, a column a case and a curve a control."""
    with drawn(path, (11.0, 9.0)) as figure:
        panels = figure.subplots(4, len(columns), sharex=True, sharey="row", squeeze=False)
        titles = ("sideways error [px]", "roll stick [%]", "vertical error [px]", "heave stick [%]")
        for column, (case, traces) in enumerate(columns.items()):
            for row, title in enumerate(titles):
                axes, axis = panels[row, column], row // 2
                for name, trace in traces.items():
                    values = trace.sticks_percent[:, 1 + axis] if row % 2 else trace.off_px[:, axis]
                    draw = axes.step if row % 2 else axes.plot
                    draw(trace.t_s, values, color=unit(_FAR_COLOURS[name]), label=name, linewidth=1.2)
                axes.set_title(f"{case}: {title}" if row == 0 else title)
                axes.set_xlim(0.0, 60.0)
                if not row % 2:
                    band_px = SETTLED_SHARE * 81.0
                    axes.axhspan(-band_px, band_px, color="#dddddd", zorder=0)
            panels[-1, column].set_xlabel("time [s]")
        figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=5)


def plot_readings(path: Path, flights: Mapping[FarCase, Mapping[FarVariant, FarTrace]], bar_ahead_m: float) -> None:
    """Approaches from above: distance from the ship's axis over range; one panel a case, one curve a reading."""
    with drawn(path, (11.0, 2.6 * len(flights) + 0.4)) as figure:
        panels = figure.subplots(len(flights), 1, squeeze=False)[:, 0]
        for axes, (case, traces) in zip(panels, flights.items(), strict=True):
            for variant, trace in traces.items():
                range_m, right_m = bar_ahead_m - trace.place_in_ship_m[:, 0], trace.place_in_ship_m[:, 1]
                end = int(np.argmax(range_m < 0.5 * HAND_OVER_M)) or len(range_m)
                axes.plot(range_m[:end], right_m[:end], color=unit(_READING_COLOURS[variant]), label=variant)
            axes.axvline(HAND_OVER_M, color=unit(ORANGE), linestyle="--")
            axes.axhline(0.0, color="#888888", linewidth=0.8)
            axes.set_xlim(case.distance_m + 5.0, 0.0)
            air = "still air" if case.wind_mps == 0.0 else f"{case.wind_mps:g} m/s from port"
            axes.set_title(f"from {case.distance_m:g} m, ship {case.offset_deg:g}° right, {air}: off the axis [m]")
        panels[-1].set_xlabel("to the bar [m]; dashed: corners take over")
        panels[0].legend(loc="best", ncols=3)


def plot_near(path: Path, traces: Mapping[str, NearTrace]) -> None:
    """Roll stick and place of a hover with a false estimate [Lee2022, §Close-range Tracking Controller]."""
    with drawn(path, (10.0, 7.6)) as figure:
        whole, near, place = figure.subplots(3, 1)
        for (name, trace), colour in zip(traces.items(), _NEAR_COLOURS, strict=True):
            for axes in (whole, near):
                axes.plot(trace.t_s, trace.law_percent, color=unit(colour), label=name, linewidth=1.2)
            place.plot(trace.t_s, 100.0 * trace.right_m, color=unit(colour), linewidth=1.4, label=name)
        seen = next(iter(traces.values()))
        place.plot(
            seen.t_s, 100.0 * seen.seen_right_m, color=unit(ORANGE), linestyle="none", marker=".", markersize=3.0,
            label="as seen", zorder=1,
        )  # fmt: skip
        whole.set_title("roll stick of the law [%]")
        near.set_title("the same around zero")
        near.set_ylim(-15.0, 15.0)
        place.set_title("right of the landing point [cm]")
        place.set_xlabel("time [s]")
        for axes in (whole, near, place):
            axes.axvline(FALSE_AT_S, color="#888888", linestyle="--", linewidth=1.0, zorder=0)
            axes.set_xlim(0.0, float(seen.t_s[-1]))
        whole.legend(loc="upper right")
        place.legend(loc="upper right", ncols=2)
