"""A flight in figures: from its log alone, without the wall clock, so that the same flight gives the same file."""

from __future__ import annotations

import dataclasses
import enum
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from shipland.files import json_bytes, write_atomically, writing
from shipland.frames import Array
from shipland.messages import Mode, TouchdownVerdict
from shipland.record.columns import FlightColumns
from shipland.record.reader import FlightLog

_DIGITS = 6
_VERBATIM = {"verbatim": True}
"""Metadata of a field that is written as it is, without rounding."""


@dataclass(frozen=True)
class PoseError:
    """Seen minus true, over the cycles that have both; axes of `bar`.

    Attributes:
        count: cycles.
        rms_forward_m, rms_right_m, rms_down_m, rms_yaw_deg: root mean squares.
        mean_forward_m, mean_right_m, mean_down_m, mean_yaw_deg: means.
        max_distance_m: largest distance in space.
    """

    count: int
    rms_forward_m: float
    rms_right_m: float
    rms_down_m: float
    rms_yaw_deg: float
    mean_forward_m: float
    mean_right_m: float
    mean_down_m: float
    mean_yaw_deg: float
    max_distance_m: float


@dataclass(frozen=True)
class FlightSummary:
    """One flight.

    Attributes:
        scenario, seed, pilot, vision: which flight.
        software_version, code_version, weights_digest, config_digest, command: what it was flown with.
        configuration: the whole merged configuration.
        end: why the loop ended, in words.
        cycles: rows of the log.
        flight_time_s: from the first exposure to the last.
        time_to_land_s: from the first exposure to the first contact; None without contact.
        touchdown_error_m: distance of the touchdown point from the deck's centre.
        touchdown: the verdict.
        time_per_mode_s: by the mode's name; NONE without a mode.
        mode_changes: how often the mode changed.
        cycles_with_pose, cycles_with_bar_box, cycles_with_ship_box: what the vision gave.
        refusals: cycles without a pose, by reason; figures in a reason are left out, and a cycle with several reasons
            (of near vision, of the ship's detector, of the bar's) counts for each.
        camera_error: the vision's pose against truth.
        aircraft_error: the pilot's estimate against the truth of the estimate's own time, wherever it has one.
        max_right_m: largest sideways distance from the pad's middle line, on approach and landing.
        max_off_pad_m: largest horizontal distance from the pad's centre while landing.
        max_tilt_deg: of the aircraft.
        max_speed_mps: against the ship.
        max_stick_percent: of any stick.
        max_deck_roll_deg, max_deck_pitch_deg, max_deck_heave_m: either side.
    """

    scenario: str
    seed: int | None
    pilot: str
    vision: str
    software_version: str
    code_version: str
    weights_digest: str
    config_digest: str
    command: str
    end: str
    cycles: int
    flight_time_s: float
    time_to_land_s: float | None
    touchdown_error_m: float | None
    touchdown: TouchdownVerdict | None
    time_per_mode_s: dict[str, float]
    mode_changes: int
    cycles_with_pose: int
    cycles_with_bar_box: int
    cycles_with_ship_box: int
    refusals: dict[str, int]
    camera_error: PoseError | None
    aircraft_error: PoseError | None
    max_right_m: float | None
    max_off_pad_m: float | None
    max_tilt_deg: float | None
    max_speed_mps: float | None
    max_stick_percent: float | None
    max_deck_roll_deg: float | None
    max_deck_pitch_deg: float | None
    max_deck_heave_m: float | None
    configuration: dict[str, Any] = field(metadata=_VERBATIM)


def summarise(log: FlightLog, end: str = "") -> FlightSummary:
    """The figures of a flight; `end` says why its loop ended."""
    info, columns, verdict = log.header.info, log.columns(), log.verdict
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
    return FlightSummary(
        scenario=info.scenario,
        seed=info.seed,
        pilot=info.pilot,
        vision=info.vision,
        software_version=info.software_version,
        code_version=info.code_version,
        weights_digest=info.weights_digest,
        config_digest=info.config_digest,
        command=info.command,
        end=end,
        cycles=len(log.records),
        flight_time_s=float(np.ptp(columns.t_s)) if len(columns.t_s) else 0.0,
        time_to_land_s=None if verdict is None or not verdict.touched else verdict.t_s - start_s,
        touchdown_error_m=None if verdict is None or not verdict.touched else verdict.error_m,
        touchdown=verdict,
        time_per_mode_s=time_per_mode_s,
        mode_changes=max(0, len(spans) - 1),
        cycles_with_pose=sum(one.bar_pose is not None for one in observations),
        cycles_with_bar_box=sum(one.bar_box is not None for one in observations),
        cycles_with_ship_box=sum(one.ship_box is not None for one in observations),
        refusals=dict(sorted(refused.items(), key=lambda item: (-item[1], item[0]))),
        camera_error=_pose_error(columns.vision_error_m, columns.vision_error_yaw_rad),
        aircraft_error=_aircraft_error(columns),
        max_right_m=_largest(place_m[near, 1]),
        max_off_pad_m=_largest(np.linalg.norm(place_m[landing, :2], axis=1)),
        max_tilt_deg=_largest(np.degrees(tilt_rad)),
        max_speed_mps=_largest(np.linalg.norm(columns.speed_in_pad_mps, axis=1)),
        max_stick_percent=_largest(columns.sticks_percent),
        max_deck_roll_deg=_largest(np.degrees(columns.deck_turn_rad[:, 0])),
        max_deck_pitch_deg=_largest(np.degrees(columns.deck_turn_rad[:, 1])),
        max_deck_heave_m=_largest(columns.deck_shift_m[:, 2]),
        configuration=info.table(),
    )


def kinds_of(reason: str) -> list[str]:
    """The parts of a reason, each without its figures and what stands in brackets with them.

    >>> kinds_of("too far for corners; bar: not confirmed (1 of 3 sightings)")
    ['too far for corners', 'bar: not confirmed']
    """
    words = re.sub(r" ?\([^)]*\d[^)]*\)", "", reason)
    words = re.sub(r"[-+−]?\d+(?:[.,]\d+)?", "…", words)
    return sorted(set(words.split("; ")) - {""}) or ["nothing seen"]


def write_json(path: Path, value: object) -> None:
    """Write a dataclass or mapping as JSON, floats to the sixth decimal; DataError when the file cannot be written."""
    with writing(path):
        write_atomically(path, json_bytes(_plain(value)))


def _aircraft_error(columns: FlightColumns) -> PoseError | None:
    new = np.diff(columns.estimate_t_s, prepend=np.nan) != 0.0  # an estimate kept for several cycles counts once
    error_m = columns.estimate_error_in_pad_m * [1.0, 1.0, -1.0]
    return _pose_error(error_m[new], columns.estimate_error_yaw_rad[new])


def _pose_error(error_m: Array, error_yaw_rad: Array) -> PoseError | None:
    whole = np.isfinite(error_m).all(axis=1) & np.isfinite(error_yaw_rad)
    if not whole.any():
        return None
    errors = np.column_stack([error_m[whole], np.degrees(error_yaw_rad[whole])])
    rms, mean = np.sqrt(np.mean(errors**2, axis=0)), np.mean(errors, axis=0)
    largest_m = float(np.linalg.norm(errors[:, :3], axis=1).max())
    figures: list[float] = [*rms.tolist(), *mean.tolist(), largest_m]
    return PoseError(int(whole.sum()), *figures)


def _largest(values: Array) -> float | None:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else None


def _plain(value: Any) -> Any:  # noqa: ANN401 - values of any kind come in
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = {each.name: (getattr(value, each.name), each.metadata) for each in dataclasses.fields(value)}
        return {name: part if metadata.get("verbatim") else _plain(part) for name, (part, metadata) in parts.items()}
    if isinstance(value, dict):
        return {str(key.value if isinstance(key, enum.Enum) else key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, float | np.floating):
        number = round(float(value), _DIGITS) + 0.0  # no -0.0
        return number if np.isfinite(number) else None
    return int(value) if isinstance(value, np.integer) else value
