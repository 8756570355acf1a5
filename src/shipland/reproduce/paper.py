"""`shipland paper`: the controlled figures of the paper, of laws and vision, each with its table [Lee2022]."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import get_args

from shipland.evaluation.tables import markdown
from shipland.extras import require
from shipland.files import write_atomically
from shipland.guidance.laws import derivative_gain, exponential_law
from shipland.guidance.parameters import FarVariant
from shipland.learning.arguments import at_least
from shipland.reproduce import FigureName, far, plots
from shipland.reproduce.detections import detections
from shipland.reproduce.flight_figures import figures_of_flights
from shipland.reproduce.geometry import distance_size, yolo_grid
from shipland.reproduce.landings import PUBLISHED_RUNS, courses, touchdowns
from shipland.reproduce.near import CONTROLS as DERIVATIVES
from shipland.reproduce.near import FALSE_AT_S, FALSE_M, LAW_STEPS, NOISE_M, fly_hover, near_figures
from shipland.reproduce.near_chain import near_chain
from shipland.reproduce.ranges import FarCase, FarTrace
from shipland.scenario.scenario import Scenario, load_scenario


def run_paper(out: Path, only: FigureName | None, flights: Path | None, runs: int = 0) -> int:
    """Make the figures and `table.md`, or those of the logs in the folder `flights`; 0, or DataError without logs.

    The figure `touchdowns` has `runs` landings on each motion; without any it is made only where `only` names it, with
    the paper's fifty.
    """
    require("plots", "`shipland paper`")
    at_least(0, runs=runs)
    if flights is not None:
        for path in figures_of_flights(flights, out):
            print(path)
        return 0
    scenario = load_scenario("near")
    names = (only,) if only else [name for name in get_args(FigureName) if name != "touchdowns" or runs]
    figures = dict(_FIGURES)
    figures["touchdowns"] = partial(touchdowns, runs=runs or PUBLISHED_RUNS)
    texts = _sections(out / "table.md")
    for number, name in enumerate(names, start=1):
        _progress(f"{number} of {len(names)}: {name} …")
        begun_s, before = time.monotonic(), _written(out)
        texts[name] = f"## {name}\n\n{figures[name](out / f'{name}.png', scenario)}\n"
        print(texts[name], flush=True)
        ordered = [texts[each] for each in figures if each in texts]
        write_atomically(out / "table.md", "\n".join(ordered).encode())
        for picture, _ in sorted(_written(out) - before):
            print(picture)
        _progress(f"{number} of {len(names)}: {name}, {time.monotonic() - begun_s:.0f} s")
    print(out / "table.md")
    return 0


def _sections(path: Path) -> dict[str, str]:
    """The sections of a table.md, by figure: those that are not made anew stay."""
    parts = path.read_text(encoding="utf-8").removeprefix("## ").split("\n## ") if path.exists() else []
    return {part.partition("\n")[0]: f"## {part}" for part in parts}


def _written(folder: Path) -> set[tuple[Path, int]]:
    """The pictures in a folder, each with the time when it was written [ns]."""
    return {(picture, picture.stat().st_mtime_ns) for picture in folder.glob("*.png")}


def _progress(words: str) -> None:
    """A line for who waits; not in the table."""
    print(words, file=sys.stderr, flush=True)


def _roll_law(path: Path, scenario: Scenario) -> str:
    ship, match_px = scenario.guidance.ship, scenario.guidance.far_baselines.match_px
    plots.plot_roll_law(path, ship, match_px)
    head = ["error [px]", *(f"{error_px:+.0f}" for error_px in far.LAW_ERRORS_PX)]
    rows = [
        [f"{variant} [%]", *(f"{exponential_law(error_px, ship.roll, variant):+.0f}" for error_px in far.LAW_ERRORS_PX)]
        for variant in get_args(FarVariant)
    ]
    return markdown(head, rows)


def _derivative_gain(path: Path, scenario: Scenario) -> str:
    near = scenario.guidance.near
    plots.plot_derivative_gain(path, near)
    head = ["axis", *(f"step {step:+g} σ" for step in LAW_STEPS), "linear"]
    rows = []
    for name in ("pitch", "roll", "heave", "yaw"):
        gains = getattr(near, name)
        values = [derivative_gain(step * gains.sigma, 0.03, gains, "probabilistic") for step in LAW_STEPS]
        rows.append([name, *(f"{value:.2f}" for value in values), f"{gains.b:g}"])
    return markdown(head, rows)


def _far_steps(path: Path, scenario: Scenario) -> str:  # noqa: ARG001 - one signature for all
    (roll, roll_s), (heave, heave_s) = far.ultimate(0, 0.8, 1.6), far.ultimate(1, 8.0, 16.0)
    shown: dict[str, dict[str, FarTrace]] = {"100 m, still air": {}, "60 m, still air": {}}
    sideways: list[list[str]] = []
    vertical: list[list[str]] = []
    for case in far.STEP_CASES:
        for name, (kind, variant) in far.CONTROLS.items():
            trace = far.fly_step(case, kind, variant)
            if case.name in shown:
                shown[case.name][name] = trace
            for axis, rows in enumerate((sideways, vertical)):
                figures = far.step_figures(trace.t_s, trace.off_px[:, axis])
                share = 100.0 * figures.overshoot_px / abs(figures.step_px)
                overshoot, *others = _texts(vars(figures), _STEP)
                rows.append([case.name, name, overshoot, f"{share:.0f}", *others])
    plots.plot_far_steps(path, shown)
    overshot, *other = _STEP
    head = ["case", "control", overshot, "overshoot [%]", *other]
    return "\n\n".join(
        [
            f"Settled: within {100.0 * far.SETTLED_SHARE:.0f} % of the step from then on. Steady error and swing: "
            f"mean, and highest minus lowest, over the last {far.LATE_S:.0f} of {far.STEP_S:.0f} s.",
            f"A proportional stick no longer settles at 100 m from {roll:.2f} % per px in roll (period "
            f"{roll_s:.1f} s) and {heave:.1f} % per px in heave ({heave_s:.1f} s).",
            "### Sideways",
            markdown(head, sideways),
            "### Vertical",
            markdown(head, vertical),
            "### Heading",
            markdown(
                ["yaw law, cycle", f"swing over {far.LATE_S:.0f} s [°]"],
                [[name, f"{far.yaw_swing_deg(overlay):.1f}"] for name, overlay in far.YAW_CASES.items()],
            ),
        ]
    )


_STEP = {
    "overshoot [px]": ("overshoot_px", ".0f"),
    "settled [s]": ("settled_s", ".0f"),
    "steady error [px]": ("steady_px", "+.1f"),
    "swing [px]": ("swing_px", ".0f"),
}
"""Columns: which figure, and how it is written."""
_SHOWN = (far.approach(250.0, 15.0, 5.0), far.approach(120.0, 5.0, 0.0), far.approach(60.0, 2.0, 5.0))


def _far_readings(path: Path, scenario: Scenario) -> str:
    bar_px2, bar_ahead_m = scenario.guidance.bar.pitch.setpoint, float(scenario.rig.bar_in_ship_m[0])
    shown: dict[FarCase, dict[FarVariant, FarTrace]] = {case: {} for case in _SHOWN}
    by_reading: dict[FarVariant, list[far.ApproachFigures]] = {variant: [] for variant in far.READINGS}
    rows = []
    for case in far.APPROACHES:
        for variant in far.READINGS:
            trace = far.fly_approach(case, variant)
            if case in shown:
                shown[case][variant] = trace
            figures = far.approach_figures(trace, bar_px2, bar_ahead_m)
            by_reading[variant].append(figures)
            place = [f"{case.distance_m:.0f}", f"{case.offset_deg:.0f}", f"{case.wind_mps:.0f}", variant]
            rows.append([*place, *_texts(vars(figures), _APPROACH)])
    plots.plot_readings(path, shown, bar_ahead_m)
    sums = [[variant, *_texts(far.summed(all_of), _SUM)] for variant, all_of in by_reading.items()]
    return "\n\n".join(
        [
            f"Hand-over: {far.HAND_OVER_M:.0f} m from the bar, where corners take over. Run-in: the "
            f"{far.RUN_IN_M:.0f} m before it. Settled: from when on within {far.AXIS_M:.0f} m of the ship's axis, if "
            "before the run-in. "
            "Setpoint area: when the bar's box, flown on past the hand-over, came within a fifth of 3400 px².",
            markdown(["reading", *_SUM], sums),
            markdown(["from [m]", "offset [°]", "wind [m/s]", "reading", *_APPROACH], rows),
        ]
    )


_SUM = {
    "flights": ("flights", "d"),
    "settled before the run-in": ("settled", "d"),
    "overshoot, median [m]": ("overshoot_m", ".1f"),
    "off the axis in the run-in, median [m]": ("run_in_m", ".1f"),
    "at the hand-over, median [m]": ("off_m", ".1f"),
    "across the axis there, median [m/s]": ("sideways_mps", ".1f"),
    "setpoint area, median [s]": ("setpoint_s", ".0f"),
    "ship lost on the way there": ("lost", "d"),
}
_APPROACH = {
    "overshoot [m]": ("overshoot_m", ".1f"),
    "settled [s]": ("settled_s", ".0f"),
    "in the run-in [m]": ("run_in_m", ".1f"),
    "hand-over [s]": ("hand_over_s", ".0f"),
    "off the axis there [m]": ("off_m", ".1f"),
    "across [m/s]": ("sideways_mps", ".1f"),
    "bar off middle [px]": ("off_px", ".0f"),
    "setpoint area [s]": ("setpoint_s", ".0f"),
    "lost on the way": ("lost", ""),
}


def _near_false(path: Path, scenario: Scenario) -> str:  # noqa: ARG001 - one signature for all
    rows, shown = [], {}
    cases = ((NOISE_M, FALSE_M, True), (0.0, FALSE_M, True), (0.0, FALSE_M, False), (0.0, 4.0 * FALSE_M, False))
    for noise_m, false_m, slew in cases:
        for name, near in DERIVATIVES.items():
            spoiled = fly_hover(near, noise_m, false_m, slew)
            figures = near_figures(spoiled, fly_hover(near, noise_m, 0.0, slew))
            if noise_m > 0.0:
                shown[name] = spoiled
            case = [f"{1000.0 * noise_m:.0f}", f"{false_m:g}", _text(slew), name]
            rows.append([*case, *_texts(vars(figures), _NEAR), f"{100.0 * figures.excursion_m:.1f}"])
    plots.plot_near(path, shown)
    words = (
        f"One estimate is false, at {FALSE_AT_S:g} s, to the right. Noise of the stick: before it, from step to step. "
        "Excursion: from where the aircraft would have been without it, within 3 s."
    )
    head = ["noise added [mm]", "false by [m]", "slew bound", "derivative", *_NEAR, "excursion [cm]"]
    return f"{words}\n\n{markdown(head, rows)}"


_NEAR = {
    "noise of the stick [%]": ("noise_percent", ".2f"),
    "peak of the law [%]": ("peak_percent", ".0f"),
    "peak sent [%]": ("sent_percent", ".0f"),
}


def _texts(figures: Mapping[str, float], columns: Mapping[str, tuple[str, str]]) -> list[str]:
    """Figures as the cells of these columns."""
    return [_text(figures[name], form) for name, form in columns.values()]


def _text(value: float | bool, form: str = "") -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "–" if math.isnan(value) else format(value, form)


_FIGURES: dict[str, Callable[[Path, Scenario], str]] = {
    "near-chain": near_chain,
    "distance-size": distance_size,
    "yolo-grid": yolo_grid,
    "detections": detections,
    "roll-law": _roll_law,
    "far-steps": _far_steps,
    "far-readings": _far_readings,
    "derivative-gain": _derivative_gain,
    "near-false": _near_false,
    "courses": courses,
}
