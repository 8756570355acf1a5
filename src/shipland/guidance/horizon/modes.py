"""The situation that `next_mode` decides on, from the estimate of the pilot `horizon`."""

from __future__ import annotations

import math

from shipland.frames import wrap_angle
from shipland.guidance.horizon.descent import Descent, Phase
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.modes import ModeMemory, Situation, may_retry
from shipland.guidance.parameters import GuidanceParameters
from shipland.messages import Mode, Observation, Telemetry


def situation_of(
    observation: Observation,
    telemetry: Telemetry,
    estimate: Estimated | None,
    landing: tuple[Descent | None, float | None],
    memory: ModeMemory,
    guidance: GuidanceParameters,
) -> Situation:
    """The situation of one cycle; what is remembered over a lost estimate is the pilot's to add.

    Args:
        observation: of the newest frame, without what the estimator rejected.
        telemetry: of the decision's time.
        estimate: at the command's effect; None while it cannot be flown on.
        landing: its descent, and its odds if it began now, of the cycle before; None for not known.
        memory: of the mode function.
        guidance: parameters.
    """
    margins, approach, (descent, odds) = guidance.horizon.margins, guidance.approach, landing
    height_m, clear = math.inf, False
    if estimate is not None:
        height_m = estimate.height_m
        astern_m = float(estimate.deck_in_bar_m[0]) - approach.go_around_back_m + margins.clear_ahead_m
        high = height_m > approach.go_around_height_m - margins.clear_below_m
        clear = bool(estimate.aircraft_in_bar_m[0] < astern_m and high)
    phase = None if descent is None else descent.phase
    return Situation(
        now_s=telemetry.t_s,
        observation=observation,
        landing_condition=landing_condition(estimate, odds, guidance),
        committed=phase is Phase.FINAL_DESCENT or height_m < margins.committed_m,
        abort_reason=_abort_reason(estimate, descent, guidance) if memory.mode is Mode.LAND else "",
        near_ship=False,
        clear=may_retry(telemetry.t_s - memory.since_s, clear, approach),
        flying=telemetry.flying,
    )


def landing_condition(estimate: Estimated | None, odds: float | None, guidance: GuidanceParameters) -> str:
    """Why a landing must not begin; empty when it may."""
    limits, approach = guidance.horizon, guidance.approach
    if estimate is None or not estimate.bar_known:
        return "no pose yet"
    off_m = math.hypot(*estimate.offset_m.tolist())
    if off_m > limits.land_offset_m:
        return f"{off_m:.2f} m off the landing point"
    up_m = estimate.height_m - approach.hover_height_m
    if abs(up_m) > 2.0 * approach.max_height_error_m:
        return f"{-up_m:+.2f} m to the hover height"
    yaw_deg = math.degrees(wrap_angle(estimate.nose_rad - estimate.bar_rad))
    if abs(yaw_deg) > approach.max_yaw_error_deg:
        return f"heading off by {yaw_deg:.0f}°"
    if odds is None or odds < limits.descent.odds_min:
        return f"odds of a landing {100.0 * (odds or 0.0):.0f} %"
    return ""


def _abort_reason(estimate: Estimated | None, descent: Descent | None, guidance: GuidanceParameters) -> str:
    """Why a landing must be broken off; empty when it may go on."""
    if estimate is None:
        return ""
    # From the bar as it is seen: which part of a motion is the bar's own wave motion is far less certain.
    off_m = math.hypot(*estimate.observed_offset_m.tolist())
    if off_m > guidance.horizon.abort_offset_m:
        return f"{off_m:.2f} m off the landing point"
    odds = None if descent is None else descent.odds
    if odds is not None and odds.stay_below(guidance.horizon.descent.odds_min):
        return f"odds of a landing no better than {100.0 * odds.best:.0f} %"
    return ""
