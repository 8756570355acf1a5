"""Former names of keys, columns and enum members: what was recorded under them is still read."""

from __future__ import annotations

from typing import Any

FORMER = {
    "CLIMB_OUT": "GO_AROUND",
    "astray_m": "abort_offset_m",
    "bearing_spread_deg": "bearing_half_range_deg",
    "carries_bar": "bar_moves",
    "climb_out_back_m": "go_around_back_m",
    "climb_out_height_m": "go_around_height_m",
    "climb_out_percent": "go_around_percent",
    "climb_out_radius_m": "go_around_radius_m",
    "climb_out_s": "go_around_s",
    "climb_out_turn": "go_around_turn",
    "distance_spread_m": "distance_half_range_m",
    "drop_mps": "final_descent_mps",
    "dropping": "in_final_descent",
    "edge_growth_px": "edge_bias_px",
    "eyes": "selector",
    "from_spread_deg": "from_half_range_deg",
    "heading_error_spread_deg": "heading_error_half_range_deg",
    "height_spread_m": "height_half_range_m",
    "instant_spread_s": "instant_range_s",
    "known_m": "position_std_max_m",
    "lean_deg": "tilt_deg",
    "leash_m": "tracking_error_max_m",
    "leash_mps": "tracking_error_max_mps",
    "made_to": "manufacturing_tolerance",
    "mean_spread_mps": "mean_half_range_mps",
    "own_forward_m": "control_forward_m",
    "own_starboard_m": "control_starboard_m",
    "pause_m": "rise_offset_m",
    "perfect_forward_m": "oracle_forward_m",
    "perfect_in_square": "oracle_in_square",
    "perfect_starboard_m": "oracle_starboard_m",
    "push_mps2": "wind_mps2",
    "push_time_s": "wind_time_s",
    "quad": "polygon",
    "reference_mps": "velocity_bias_mps",
    "reference_time_s": "velocity_bias_time_s",
    "sureness_gain": "score_gain",
    "swing": "wave",
    "swing_m": "wave_m",
    "swing_mps": "wave_mps",
}
"""Today's name by the former one."""

GONE = {
    "guidance.horizon.contact_std_max_m": "guidance.horizon.descent.odds_min says with which odds a landing begins",
    "guidance.horizon.unfit_m": "guidance.horizon.descent.odds_min says with which odds a landing begins",
    "guidance.horizon.descent.drop_m": "wait_cost says how long good odds are waited for",
    "guidance.horizon.descent.final_descent_offset_m": "wait_cost says how long good odds are waited for",
    "guidance.horizon.descent.relax_after_s": "wait_cost says how long good odds are waited for",
    "guidance.horizon.descent.relax_per_s": "wait_cost says how long good odds are waited for",
    "guidance.horizon.lull_mps": "the odds of a landing know how the bar moves",
    "guidance.horizon.levelling.touch_deg": "the odds of a landing hold the tilt at contact",
    "guidance.horizon.levelling.touch_m": "guidance.horizon.descent.touch_m says what counts as a touch",
    "guidance.horizon.levelling.touch_offset_m": "the odds of a landing hold the offset at contact",
    "guidance.horizon.measured.flow": "velocity_reference of [response] says what the velocity is against",
    "guidance.horizon.wave.deck.followed": "a deck below a bar at rest moves by itself",
    "guidance.horizon.wave.followed": "guidance.horizon.wave.deck_shares has a share for each state of the waves",
    "guidance.horizon.wave.followed_servo": "guidance.horizon.wave.deck_shares holds for both kinds of stick",
    "quad": "a polygon of the cue is one [[rig.polygon]] with corners_m",
    "vision.adaptive": "each region is judged at half of its own peak",
    "vision.adaptive_floor": "each region is judged at half of its own peak",
    "vision.adaptive_hue": "each region is judged at half of its own peak",
    "vision.length_tolerance": "--vision published screens sides as printed; else manufacturing_tolerance says it all",
    "vision.screening_px": "--vision published screens sides as printed; else manufacturing_tolerance says it all",
    "vision.slope_tolerance": "--vision published screens sides as printed; else manufacturing_tolerance says it all",
    "vision.corners": "--vision published flies the published near chain",
    "vision.screening": "--vision published flies the published near chain",
    "vision.watershed": "--vision published flies the published near chain",
}
"""What does a former key's work today, by the key with its table."""

_DECK_WATCH = (
    *("moment", "deck_rise_max_mps", "deck_std_max_m", "look_down_max_s", "look_up_s"),
    *("watch_blind_s", "watch_known_m", "watch_rises_mps", "watch_seen_s"),
    *("descent.deck_watch_height_m", "descent.deck_watch_max_s", "descent.deck_watch_offset_m"),
    *("descent.reacquire_max_s", "descent.reacquire_offset_m", "descent.reacquire_s"),
    *("descent.poise_m", "descent.poise_most_s", "descent.poise_s"),
    *("descent.watch_height_m", "descent.watch_m", "descent.watch_most_s"),
)
GONE |= {f"guidance.horizon.{key}": "the odds of a landing choose the moment" for key in _DECK_WATCH}

FORMER_OPTIONS = {
    ("campaign", "--count"): "--runs",
    ("campaign", "--time-limit-s"): "--minutes",
    ("envelope", "--time-limit-s"): "--minutes",
    ("evaluate", "--scenes"): "--count",
    ("replay", "--camera"): "--calibration",
    ("see", "--camera"): "--calibration",
}
"""New name of a command's option; the former one is refused with it."""


def todays(name: str) -> str:
    """A name, or several with dots between them, as they are called today."""
    return ".".join(FORMER.get(part, part) for part in name.split("."))


def renamed(table: Any, where: str = "") -> Any:  # noqa: ANN401 - a configuration as JSON has it
    """A table and the tables in it, with today's keys and without those that are gone; `where` it stands, with dots."""
    if isinstance(table, dict):
        paths = {key: f"{where}.{key}".lstrip(".") for key in table}
        return {
            FORMER.get(key, key): renamed(value, paths[key]) for key, value in table.items() if paths[key] not in GONE
        }
    if isinstance(table, list):
        return [renamed(value, where) for value in table]
    return table


def as_before(table: Any) -> Any:  # noqa: ANN401 - a configuration as JSON has it
    """A table and the tables in it with the former keys: what digests on record were taken over."""
    if isinstance(table, dict):
        before = {today: former for former, today in FORMER.items()}
        return {before.get(key, key): as_before(value) for key, value in table.items()}
    return [as_before(value) for value in table] if isinstance(table, list) else table
