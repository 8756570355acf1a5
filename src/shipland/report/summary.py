"""A flight in figures: from its log alone, without the wall clock, so that the same flight gives the same file."""

from __future__ import annotations

import dataclasses
import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from shipland.files import json_bytes, write_atomically, writing
from shipland.frames import Array
from shipland.messages import Mode
from shipland.record.reader import FlightLog

_DIGITS = 6
_OF_THE_FLIGHT = (
    "scenario", "seed", "pilot", "vision", "software_version", "code_version", "weights_digest", "config_digest",
    "command",
)  # fmt: skip


def summarise(log: FlightLog, end: str = "") -> dict[str, Any]:
    """The figures of a flight, as summary.json has them; None where they are not known. `end` says why its loop ended.

    flight_time_s: from the first exposure to the last.
    time_to_land_s: from the first exposure to the first contact.
    touchdown_error_m: distance of the touchdown point from the deck's centre.
    time_per_mode_s: by the mode's name; NONE without a mode.
    cycles_with_pose, cycles_with_bar_box, cycles_with_ship_box: what the vision gave.
    refusals: cycles without a pose, by reason; figures in a reason are left out, and a cycle with several reasons (of
        near vision, of the ship's detector, of the bar's) counts for each.
    camera_error: the vision's pose against truth, see `_pose_error`.
    aircraft_error: the pilot's estimate against the truth of the estimate's own time, wherever it has one.
    max_right_m: largest sideways distance from the pad's middle line, on approach and landing.
    max_off_pad_m: largest horizontal distance from the pad's centre while landing.
    max_speed_mps: against the ship.
    max_deck_roll_deg, max_deck_pitch_deg, max_deck_heave_m: either side.
    """
    info, columns = log.header.info, log.columns()
    contact = log.verdict if log.verdict is not None and log.verdict.touched else None
    spans = columns.mode_spans()
    time_per_mode_s: dict[str, float] = {}
    for from_s, to_s, mode in spans:
        name = "NONE" if mode is None else mode.name
        time_per_mode_s[name] = time_per_mode_s.get(name, 0.0) + to_s - from_s
    observations = [record.observation for record in log.records]
    refused = Counter(kind for one in observations if one.bar_pose is None for kind in kinds_of(one.reason))
    landing = columns.mode_number == Mode.LAND.value
    near = landing | (columns.mode_number == Mode.APPROACH.value)
    place_m = columns.place_in_pad_m
    tilt_rad = np.where(np.isfinite(columns.truth_tilt_rad), columns.truth_tilt_rad, columns.telemetry_tilt_rad)
    start_s = float(columns.t_s[0]) if len(columns.t_s) else 0.0
    new = np.diff(columns.estimate_t_s, prepend=np.nan) != 0.0  # an estimate kept for several cycles counts once
    aircraft_error_m = columns.estimate_error_in_pad_m * [1.0, 1.0, -1.0]
    return {
        **{name: getattr(info, name) for name in _OF_THE_FLIGHT},
        "end": end,
        "cycles": len(log.records),
        "flight_time_s": float(np.ptp(columns.t_s)) if len(columns.t_s) else 0.0,
        "time_to_land_s": None if contact is None else contact.t_s - start_s,
        "touchdown_error_m": None if contact is None else contact.error_m,
        "touchdown": log.verdict,
        "time_per_mode_s": time_per_mode_s,
        "mode_changes": max(0, len(spans) - 1),
        "cycles_with_pose": sum(one.bar_pose is not None for one in observations),
        "cycles_with_bar_box": sum(one.bar_box is not None for one in observations),
        "cycles_with_ship_box": sum(one.ship_box is not None for one in observations),
        "refusals": dict(sorted(refused.items(), key=lambda item: (-item[1], item[0]))),
        "camera_error": _pose_error(columns.vision_error_m, columns.vision_error_yaw_rad),
        "aircraft_error": _pose_error(aircraft_error_m[new], columns.estimate_error_yaw_rad[new]),
        "max_right_m": _largest(place_m[near, 1]),
        "max_off_pad_m": _largest(np.linalg.norm(place_m[landing, :2], axis=1)),
        "max_tilt_deg": _largest(np.degrees(tilt_rad)),
        "max_speed_mps": _largest(np.linalg.norm(columns.speed_in_pad_mps, axis=1)),
        "max_stick_percent": _largest(columns.sticks_percent),
        "max_deck_roll_deg": _largest(np.degrees(columns.deck_turn_rad[:, 0])),
        "max_deck_pitch_deg": _largest(np.degrees(columns.deck_turn_rad[:, 1])),
        "max_deck_heave_m": _largest(columns.deck_shift_m[:, 2]),
    }


def kinds_of(reason: str) -> list[str]:
    """The parts of a reason, each without its figures and what stands in brackets with them.

    >>> kinds_of("too far for corners; bar: not confirmed (1 of 3 sightings)")
    ['too far for corners', 'bar: not confirmed']
    """
    words = re.sub(r" ?\([^)]*\d[^)]*\)", "", reason)
    words = re.sub(r"[-+−]?\d+(?:[.,]\d+)?", "…", words)
    return sorted(set(words.split("; ")) - {""}) or ["nothing seen"]


def write_json(path: Path, value: object, **verbatim: Any) -> None:  # noqa: ANN401 - JSON
    """Write a mapping as JSON, floats to the sixth decimal but in what is `verbatim`; DataError when it cannot be."""
    with writing(path):
        write_atomically(path, json_bytes(_plain(value) | verbatim))


def _pose_error(error_m: Array, error_yaw_rad: Array) -> dict[str, float] | None:
    """Seen minus true over the cycles that have both, along the axes of `bar`, and the largest distance in space."""
    whole = np.isfinite(error_m).all(axis=1) & np.isfinite(error_yaw_rad)
    if not whole.any():
        return None
    errors = np.column_stack([error_m[whole], np.degrees(error_yaw_rad[whole])])
    found: dict[str, float] = {"count": int(whole.sum())}
    for kind, values in (("rms", np.sqrt(np.mean(errors**2, axis=0))), ("mean", np.mean(errors, axis=0))):
        for name, value in zip(("forward_m", "right_m", "down_m", "yaw_deg"), values.tolist(), strict=True):
            found[f"{kind}_{name}"] = value
    return found | {"max_distance_m": float(np.linalg.norm(errors[:, :3], axis=1).max())}


def _largest(values: Array) -> float | None:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else None


def _plain(value: object) -> Any:  # noqa: ANN401 - JSON
    """Of dataclasses and arrays too: floats rounded, without -0.0, and what is not finite None."""
    text = json.dumps(value, default=lambda it: vars(it) if dataclasses.is_dataclass(it) else it.tolist())
    return json.loads(text, parse_float=lambda it: round(float(it), _DIGITS) + 0.0, parse_constant=lambda _: None)
