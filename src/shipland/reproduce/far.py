"""Far controls side by side [Lee2022, §Long-range Tracking Controller]: a step at one range, and whole approaches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipland.frames import Array
from shipland.guidance.parameters import FarKind, FarVariant
from shipland.reproduce.ranges import FarCase, FarTrace, fly_far

STEP_DEG = 5.0
"""Of the box, to the right and downward: 81 px."""
STEP_S = 90.0
LATE_S = 30.0
"""The end of a step's flight, in which steady error and swing are read."""
SETTLED_SHARE = 0.1
"""Of the step: what counts as settled."""
NOISE_PX = 1.7
"""Of a box's edge: the shipped detector's 1.2 px of the centre at 100 m (docs/results/far-vision.md)."""
HAND_OVER_M = 22.0
"""From the bar: here corners take over."""
RUN_IN_M = 20.0
"""Before the hand-over: where an approach should have settled."""
AXIS_M = 2.0
"""From the ship's axis: what counts as settled on an approach."""
IN_ALL: dict[str, Any] = {"delays": {"video_s": 0.0, "uplink_s": 0.0}}
"""The paper's 0.5 s read as everything from exposure to stick."""

CONTROLS: dict[str, tuple[FarKind, FarVariant]] = {
    "P": ("p", "saturating"),
    "PID": ("pid", "saturating"),
    "exponential, saturating": ("exponential", "saturating"),
    "exponential, growing": ("exponential", "growing"),
    "exponential, printed": ("exponential", "printed"),
}
LAW_ERRORS_PX = (-100.0, -50.0, -20.0, -5.0, 5.0, 20.0, 50.0, 100.0)
"""For which the law's stick is told."""
READINGS: tuple[FarVariant, ...] = ("saturating", "growing")
"""The two symmetric ones of erratum 3."""


@dataclass(frozen=True)
class StepCase:
    """Where a step is flown: range, side wind, noise on the boxes, and which delays."""

    name: str
    distance_m: float = 100.0
    wind_mps: float = 0.0
    noise_px: float = 0.0
    in_all: bool = False


STEP_CASES = (
    StepCase("100 m, still air"),
    StepCase("100 m, still air, noise", noise_px=NOISE_PX),
    StepCase("100 m, 5 m/s side wind", wind_mps=5.0),
    StepCase("100 m, 5 m/s side wind, noise", wind_mps=5.0, noise_px=NOISE_PX),
    StepCase("60 m, still air", distance_m=60.0),
    StepCase("30 m, still air", distance_m=30.0),
    StepCase("100 m, still air, 0.5 s in all", in_all=True),
    StepCase("60 m, still air, 0.5 s in all", distance_m=60.0, in_all=True),
    StepCase("30 m, still air, 0.5 s in all", distance_m=30.0, in_all=True),
)


def fly_step(case: StepCase, kind: FarKind, variant: FarVariant) -> FarTrace:
    """The box stands `STEP_DEG` right of and below where it is wanted; roll and heave fly, the rest holds.

    The box is wanted 5° below the horizon, not on it, so that the height wanted is clear of the sea.
    """
    height_m = case.distance_m * math.tan(math.radians(2.0 * STEP_DEG))
    flight = FarCase(
        case.distance_m, STEP_DEG, height_m, case.wind_mps, kind, variant, case.noise_px, False, STEP_S, STEP_DEG
    )
    return fly_far(flight, IN_ALL if case.in_all else {})


@dataclass(frozen=True)
class StepFigures:
    """How one axis answered a step.

    Attributes:
        step_px: error at the start.
        overshoot_px: largest error on the other side.
        settled_s: from when on the error stays within `SETTLED_SHARE` of the step; NaN when it does not.
        steady_px, swing_px: mean, and highest minus lowest, over the last `LATE_S`.
    """

    step_px: float
    overshoot_px: float
    settled_s: float
    steady_px: float
    swing_px: float


def step_figures(t_s: Array, error_px: Array) -> StepFigures:
    """Figures of one axis; errors (n,) that are NaN (out of the picture) count as outside."""
    seen = np.flatnonzero(np.isfinite(error_px))
    step_px = float(error_px[seen[0]])
    side = math.copysign(1.0, step_px)
    outside = np.flatnonzero(~(np.abs(error_px) <= SETTLED_SHARE * abs(step_px)))
    settled_s = float(t_s[outside[-1] + 1]) if outside[-1] + 1 < len(t_s) else math.nan
    late = error_px[t_s > t_s[-1] - LATE_S]
    late = late[np.isfinite(late)]
    return StepFigures(
        step_px=step_px,
        overshoot_px=max(0.0, float(np.nanmax(-side * error_px))),
        settled_s=settled_s if settled_s <= t_s[-1] - LATE_S else math.nan,
        steady_px=float(np.mean(late)) if len(late) else math.nan,
        swing_px=float(np.ptp(late)) if len(late) else math.nan,
    )


def ultimate(axis: int, low: float, high: float) -> tuple[float, float]:
    """Gain [percent per px] and period [s] with which a proportional stick no longer settles at 100 m.

    By bisection, for roll (`axis` 0) or heave (1), between a gain that settles and one that does not.
    """
    off = {"k_p": 0.0, "t_i_s": 1e9, "t_d_s": 0.0}
    period_s = math.nan
    while high - low > 0.05 * high:
        gain = 0.5 * (low + high)
        gains = [off, off]
        gains[axis] = off | {"k_p": gain}
        height_m = 100.0 * math.tan(math.radians(STEP_DEG + (2.0 if axis == 1 else 0.0)))
        case = FarCase(100.0, 0.0 if axis == 1 else 2.0, height_m, 0.0, "pid", "growing", 0.0, False, STEP_S, STEP_DEG)
        overlay = {"guidance": {"far_baselines": {"roll": gains[0], "heave": gains[1]}}}
        trace = fly_far(case, overlay)
        late = trace.t_s > STEP_S - LATE_S
        error_px = trace.off_px[late, axis]
        if np.ptp(error_px) > 10.0:
            high, period_s = gain, _period_s(trace.t_s[late], error_px)
        else:
            low = gain
    return high, period_s


def _period_s(t_s: Array, values: Array) -> float:
    """Mean time between rises through the mean."""
    off = values - np.mean(values)
    rises = np.flatnonzero((off[:-1] < 0.0) & (off[1:] >= 0.0))
    at_s = t_s[rises] - off[rises] * np.diff(t_s)[rises] / np.diff(off)[rises]
    return float(np.mean(np.diff(at_s))) if len(at_s) > 1 else math.nan


YAW_CASES: dict[str, dict[str, Any]] = {
    "Table 2, 0.5 s": {},
    "Table 2 without the derivative, 0.5 s": {"guidance": {"near": {"yaw": {"b": 0.0}}}},
    "half of Table 2, 0.5 s": {"guidance": {"near": {"yaw": {"k_p": 2.75, "b": 0.875}}}},
    "Table 2, 0.03 s": {"delays": {"learned_s": 0.03}},
}


def yaw_swing_deg(overlay: dict[str, Any]) -> float:
    """Highest minus lowest heading over the last `LATE_S` of a minute's approach from 250 m."""
    trace = fly_far(FarCase(250.0, 0.0, 10.0, 0.0, "exponential", "saturating", 0.0, True, 2.0 * LATE_S), overlay)
    return float(np.ptp(trace.heading_deg[trace.t_s > LATE_S]))


def approach(distance_m: float, offset_deg: float, wind_mps: float) -> FarCase:
    """All four sticks, on the ship and then the bar, on the ship's course, from 10 m above the deck."""
    duration_s = 60.0 + 0.5 * distance_m
    return FarCase(distance_m, offset_deg, 10.0, wind_mps, "exponential", "saturating", 0.0, True, duration_s)


APPROACHES = tuple(
    approach(distance_m, offset_deg, wind_mps)
    for distance_m in (60.0, 120.0, 250.0)
    for offset_deg in (2.0, 5.0, 15.0, 30.0)
    for wind_mps in (0.0, 5.0)
)


@dataclass(frozen=True)
class ApproachFigures:
    """How an approach went, as far as the hand-over to corners and on to the bar's setpoint area.

    Attributes:
        overshoot_m: farthest sideways on the other side of the ship's axis before the hand-over.
        settled_s: from when on the aircraft stayed within `AXIS_M` until the hand-over; NaN when that came later than
            the begin of the run-in.
        run_in_m: farthest from the axis in the run-in.
        hand_over_s: when `HAND_OVER_M` was reached; NaN when it was not.
        off_m, sideways_mps: distance from the ship's axis and speed across it then.
        off_px: the bar's distance from the picture's middle then.
        setpoint_s: when the bar's box came within a fifth of its setpoint area; NaN when it did not.
        lost: the target left the picture before the setpoint area was reached.
    """

    overshoot_m: float
    settled_s: float
    run_in_m: float
    hand_over_s: float
    off_m: float
    sideways_mps: float
    off_px: float
    setpoint_s: float
    lost: bool


def fly_approach(case: FarCase, variant: FarVariant) -> FarTrace:
    """An `approach` in one reading of the law."""
    return fly_far(replace(case, variant=variant))


def approach_figures(trace: FarTrace, bar_setpoint_px2: float, bar_ahead_m: float) -> ApproachFigures:
    """Figures of one approach; `bar_ahead_m` is the bar's place ahead of the deck's centre."""
    range_m = bar_ahead_m - trace.place_in_ship_m[:, 0]
    right_m = trace.place_in_ship_m[:, 1]
    side = math.copysign(1.0, right_m[0])
    near = np.flatnonzero(range_m <= HAND_OVER_M)
    end = int(near[0]) if len(near) else len(range_m) - 1
    reached = np.flatnonzero(trace.on_bar & (trace.area_px2 >= 0.8 * bar_setpoint_px2))
    last = int(reached[0]) if len(reached) else len(range_m) - 1
    outside = np.flatnonzero(np.abs(right_m[: end + 1]) > AXIS_M)
    settled = int(outside[-1]) + 1 if len(outside) else 0
    run_in = int(np.argmax(range_m <= HAND_OVER_M + RUN_IN_M))
    speed = np.gradient(right_m, trace.t_s)
    return ApproachFigures(
        overshoot_m=max(0.0, float(np.max(-side * right_m[: end + 1]))),
        settled_s=float(trace.t_s[settled]) if settled <= run_in else math.nan,
        run_in_m=float(np.max(np.abs(right_m[run_in : end + 1]))),
        hand_over_s=float(trace.t_s[end]) if len(near) else math.nan,
        off_m=abs(float(right_m[end])),
        sideways_mps=abs(float(speed[end])),
        off_px=abs(float(trace.off_px[end, 0])),
        setpoint_s=float(trace.t_s[last]) if len(reached) else math.nan,
        lost=bool(np.isnan(trace.off_px[: last + 1, 0]).any()),
    )


def summed(approaches: Sequence[ApproachFigures]) -> dict[str, float]:
    """Of a reading's approaches: their number, how many settled before the run-in and lost the ship, and medians."""
    names = ("overshoot_m", "run_in_m", "off_m", "sideways_mps", "setpoint_s")
    medians = {name: float(np.nanmedian([getattr(each, name) for each in approaches])) for name in names}
    settled = sum(not math.isnan(each.settled_s) for each in approaches)
    return {"flights": len(approaches), "settled": settled, **medians, "lost": sum(each.lost for each in approaches)}
