"""The paper's controlled figures in numbers [Lee2022]: laws, steps far away, readings, a false estimate.

The pictures are those of `shipland paper`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import get_args

from shipland.guidance.laws import derivative_gain, exponential_law
from shipland.guidance.parameters import FarVariant
from shipland.reproduce import far
from shipland.reproduce.near import CONTROLS as DERIVATIVES
from shipland.reproduce.near import FALSE_M, LAW_STEPS, NOISE_M, fly_hover, near_figures
from shipland.scenario.scenario import load_scenario
from studies.harness import Case, Column, Row, Study

NEAR_CASES = ((NOISE_M, True), (0.0, True), (0.0, False))
"""Noise added to estimates, and whether the sticks' slew is bound."""


def cases() -> Sequence[Case]:
    """A figure's curves, each flown apart."""
    return [
        *({"figure": "roll law", "law": variant} for variant in get_args(FarVariant)),
        *({"figure": "derivative gain", "law": axis} for axis in ("pitch", "roll", "heave", "yaw")),
        *({"figure": "steps", "case": each.name, "law": name} for each, name in product(far.STEP_CASES, far.CONTROLS)),
        *({"figure": "yaw", "law": name} for name in far.YAW_CASES),
        *({"figure": "readings", "law": variant} for variant in far.READINGS),
        *({"figure": "near", "noise_m": noise_m, "slew": "yes" if slew else "no", "law": name}
          for (noise_m, slew), name in product(NEAR_CASES, DERIVATIVES)),
    ]  # fmt: skip


def measure(case: Case, _runs: int) -> Row | list[Row]:
    """Rows of a curve."""
    return FIGURES[str(case["figure"])](case)


def _roll_law(case: Case) -> list[Row]:
    roll, law = load_scenario("near").guidance.ship.roll, case["law"]
    return [{"error_px": px, "stick": float(exponential_law(px, roll, law))} for px in far.LAW_ERRORS_PX]  # type: ignore[arg-type]


def _derivative_gain(case: Case) -> list[Row]:
    gains = getattr(load_scenario("near").guidance.near, str(case["law"]))
    found = [float(derivative_gain(step * gains.sigma, 0.03, gains, "probabilistic")) for step in LAW_STEPS]
    return [{"step": step, "gain": gain, "linear": gains.b} for step, gain in zip(LAW_STEPS, found, strict=True)]


def _steps(case: Case) -> list[Row]:
    each = next(each for each in far.STEP_CASES if each.name == case["case"])
    trace = far.fly_step(each, *far.CONTROLS[str(case["law"])])
    rows: list[Row] = []
    for axis, name in enumerate(("sideways", "vertical")):
        found = far.step_figures(trace.t_s, trace.off_px[:, axis])
        rows.append(
            {
                "axis": name,
                "overshoot": float(found.overshoot_px / abs(found.step_px)),
                "settled_s": _none(found.settled_s),
                "steady_px": float(found.steady_px),
                "swing_px": float(found.swing_px),
            }
        )
    return rows


def _yaw(case: Case) -> Row:
    return {"swing_deg": float(far.yaw_swing_deg(far.YAW_CASES[str(case["law"])]))}


def _readings(case: Case) -> Row:
    scenario, variant = load_scenario("near"), case["law"]
    bar_px2, ahead_m = scenario.guidance.bar.pitch.setpoint, float(scenario.rig.bar_in_ship_m[0])
    found = [
        far.approach_figures(far.fly_approach(each, variant), bar_px2, ahead_m)  # type: ignore[arg-type]
        for each in far.APPROACHES
    ]
    return {name: _none(value) for name, value in far.summed(found).items() if name != "lost"}


def _near(case: Case) -> Row:
    near, noise_m, slew = DERIVATIVES[str(case["law"])], float(case["noise_m"]), case["slew"] == "yes"
    found = near_figures(fly_hover(near, noise_m, FALSE_M, slew), fly_hover(near, noise_m, 0.0, slew))
    names = ("noise_percent", "peak_percent", "sent_percent", "excursion_m")
    return {name: float(getattr(found, name)) for name in names}


def _none(value: float) -> float | None:
    return None if math.isnan(value) else value


FIGURES: dict[str, Callable[[Case], Row | list[Row]]] = {
    "roll law": _roll_law,
    "derivative gain": _derivative_gain,
    "steps": _steps,
    "yaw": _yaw,
    "readings": _readings,
    "near": _near,
}

STUDY = Study(
    question="What do the paper's figures come to in this simulator?",
    columns={
        "case": Column("case"),
        "axis": Column("axis"),
        "law": Column("law"),
        "error_px": Column("error [px]", "+g"),
        "step": Column("step [σ]", "+g"),
        "stick": Column("stick [%]", "+.0f"),
        "gain": Column("gain", ".2f"),
        "linear": Column("linear", "g"),
        "overshoot": Column("overshoot [%]", ".0f", 100.0),
        "settled_s": Column("settled [s]", ".0f"),
        "steady_px": Column("steady error [px]", "+.1f"),
        "swing_px": Column("swing, last 30 s [px]", ".0f"),
        "swing_deg": Column("swing over 30 s [°]", ".1f"),
        "flights": Column("flights", "d"),
        "settled": Column("settled before the run-in", "d"),
        "overshoot_m": Column("overshoot, median [m]", ".1f"),
        "run_in_m": Column("off the axis in the run-in [m]", ".1f"),
        "off_m": Column("at the hand-over [m]", ".1f"),
        "sideways_mps": Column("across the axis there [m/s]", ".1f"),
        "setpoint_s": Column("setpoint area [s]", ".0f"),
        "noise_m": Column("noise added [mm]", ".0f", 1e3),
        "slew": Column("slew bound"),
        "noise_percent": Column("noise of the stick [%]", ".2f"),
        "peak_percent": Column("peak of the law [%]", ".0f"),
        "sent_percent": Column("peak sent [%]", ".0f"),
        "excursion_m": Column("excursion [cm]", ".1f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=1,
    minutes=3,
)
