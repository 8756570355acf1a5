"""Former names of keys, columns and enum members: what was recorded under them is still read."""

from __future__ import annotations

from typing import Any

_FORMER = (
    ("CLIMB_OUT", "GO_AROUND", "CLIMB_OUT"),
    ("climb_out", "go_around", "climb_out_back_m climb_out_height_m climb_out_percent climb_out_radius_m climb_out_s"
     " climb_out_turn"),
    ("_spread", "_half_range", "bearing_spread_deg distance_spread_m from_spread_deg heading_error_spread_deg"
     " height_spread_m mean_spread_mps"),
    ("_spread", "_range", "instant_spread_s"),
    ("astray", "abort_offset", "astray_m"),
    ("carries_bar", "bar_moves", "carries_bar"),
    ("drop_", "final_descent_", "drop_mps"),
    ("dropping", "in_final_descent", "dropping"),
    ("eyes", "selector", "eyes"),
    ("growth", "bias", "edge_growth_px"),
    ("known", "position_std_max", "known_m"),
    ("lean", "tilt", "lean_deg"),
    ("leash", "tracking_error_max", "leash_m leash_mps"),
    ("made_to", "manufacturing_tolerance", "made_to"),
    ("own_", "control_", "own_forward_m own_starboard_m"),
    ("pause", "rise_offset", "pause_m"),
    ("perfect_", "oracle_", "perfect_forward_m perfect_in_square perfect_starboard_m"),
    ("push_", "wind_", "push_mps2 push_time_s"),
    ("quad", "polygon", "quad"),
    ("reference_", "velocity_bias_", "reference_mps reference_time_s"),
    ("sureness", "score", "sureness_gain"),
    ("swing", "wave", "swing swing_m swing_mps"),
)  # fmt: skip
FORMER = {name: name.replace(word, today) for word, today, names in _FORMER for name in names.split()}
"""Today's name by the former one."""

_CHOOSE = "the odds of a landing choose the moment"
_GONE = (
    ("guidance.horizon", "contact_std_max_m unfit_m",
     "guidance.horizon.descent.odds_min says with which odds a landing begins"),
    ("guidance.horizon.descent", "drop_m final_descent_offset_m relax_after_s relax_per_s",
     "wait_cost says how long good odds are waited for"),
    ("guidance.horizon", "lull_mps", "the odds of a landing know how the bar moves"),
    ("guidance.horizon.levelling", "touch_deg", "the odds of a landing hold the tilt at contact"),
    ("guidance.horizon.levelling", "touch_m", "guidance.horizon.descent.touch_m begins the final descent"),
    ("guidance.horizon.levelling", "touch_offset_m", "the odds of a landing hold the offset at contact"),
    ("guidance.horizon.measured", "flow", "velocity_reference of [response] says what the velocity is against"),
    ("guidance.horizon.wave.deck", "followed", "a deck below a bar at rest moves by itself"),
    ("guidance.horizon.wave", "followed", "guidance.horizon.wave.deck_shares has a share for each state of the waves"),
    ("guidance.horizon.wave", "followed_servo", "guidance.horizon.wave.deck_shares holds for both kinds of stick"),
    ("guidance.horizon", "moment deck_rise_max_mps deck_std_max_m look_down_max_s look_up_s", _CHOOSE),
    ("guidance.horizon", "watch_blind_s watch_known_m watch_rises_mps watch_seen_s", _CHOOSE),
    ("guidance.horizon.descent", "deck_watch_height_m deck_watch_max_s deck_watch_offset_m poise_m poise_most_s poise_s"
     " reacquire_max_s reacquire_offset_m reacquire_s watch_height_m watch_m watch_most_s", _CHOOSE),
    ("", "quad", "a polygon of the cue is one [[rig.polygon]] with corners_m"),
    ("vision", "adaptive adaptive_floor adaptive_hue", "each region is judged at half of its own peak"),
    ("vision", "length_tolerance screening_px slope_tolerance",
     "--vision published screens sides as printed; else manufacturing_tolerance says it all"),
    ("vision", "corners screening watershed", "--vision published flies the published near chain"),
)  # fmt: skip
GONE = {f"{table}.{key}".lstrip("."): instead for table, keys, instead in _GONE for key in keys.split()}
"""What does a former key's work today, by the key with its table."""

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
