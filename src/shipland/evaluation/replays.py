"""Vision and pilot over a recorded flight again, and where they differ from what was recorded."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shipland import factories
from shipland.camera import Camera
from shipland.compiled import say_that_it_compiles
from shipland.config import merge, settings
from shipland.errors import ConfigError, DataError
from shipland.evaluation.folder import read_campaign, read_key
from shipland.flight import Autonomy, cycles, decide_or_degrade
from shipland.former import renamed
from shipland.messages import FlightRecord, Observation, PilotCommand
from shipland.record.reader import FlightLog, read_log
from shipland.safety.input_gate import InputGate, without_repeated
from shipland.scenario.autonomy import build_autonomy
from shipland.scenario.real_vehicle import replayed_log
from shipland.scenario.scenario import Scenario, load_scenario
from shipland.scenario.visions import needs_pictures
from shipland.vehicles.replay import ReplayVehicle, recorded_video
from shipland.version import code_version
from shipland.vision.pictures import read_video
from shipland.vision.vision import see_or_degrade

POSE_M, STICK_PERCENT = 0.05, 5.0
"""Differences from here on are counted."""


@dataclass(frozen=True)
class Pair:
    """One cycle as it was recorded, None of a video, and as it went again.

    Attributes:
        pose_m: distance of the two poses; infinite where one of the two has none, NaN where neither.
        stick_percent: largest difference of a stick; NaN of a video.
    """

    before: FlightRecord | None
    after: FlightRecord
    pose_m: float
    stick_percent: float


def differences(pairs: Sequence[Pair]) -> Iterator[str]:
    """What differs, a line each."""
    seen = sum(pair.after.observation.bar_pose is not None for pair in pairs)
    yield f"{len(pairs)} cycles; the bar's pose found in {seen}"
    if not pairs or pairs[0].before is None:
        return
    recorded = sum(pair.before is not None and pair.before.observation.bar_pose is not None for pair in pairs)
    both = [pair for pair in pairs if math.isfinite(pair.pose_m)]
    yield f"recorded in {recorded}; in one of the two only: {sum(math.isinf(it.pose_m) for it in pairs)}"
    if both:
        poses_m = [pair.pose_m for pair in both]
        middle = f"poses differ by {np.median(poses_m):.4f} m in the median, {max(poses_m):.4f} m at most"
        far = [pair for pair in both if pair.pose_m > POSE_M]
        yield f"{middle}; more than {POSE_M:g} m in {_counted(far)}"
    sticks = [pair.stick_percent for pair in pairs if math.isfinite(pair.stick_percent)]
    middle = f"sticks differ by {np.median(sticks):.2f} % in the median, {max(sticks):.2f} % at most"
    far = [pair for pair in pairs if pair.stick_percent > STICK_PERCENT]
    yield f"{middle}; more than {STICK_PERCENT:g} % in {_counted(far)}"
    modes = [it for it in pairs if it.before and it.before.decision.mode is not it.after.decision.mode]
    yield f"modes differ in {_counted(modes)}"


def _counted(pairs: Sequence[Pair]) -> str:
    first = f", first at {pairs[0].after.telemetry.t_s:.2f} s" if pairs else ""
    return f"{len(pairs)} cycles{first}"


@dataclass(frozen=True)
class Recording:
    """What is replayed: frames and setup, and who flies and sees, as `factories.resolve` takes them.

    Attributes:
        seed: of visions and pilots that draw numbers.
        records: as flown; empty of a video.
        complete: the log was closed in order.
    """

    vehicle: ReplayVehicle
    scenario: Scenario
    pilot: str
    vision: str
    seed: int = 0
    records: Sequence[FlightRecord] = ()
    complete: bool = True


def recorded_flight(path: Path, pilot: str = "", vision: str = "", changes: Sequence[str] = ()) -> Recording:
    """A flight log, under changes `section.key=value`; without a pilot or vision, with those that flew.

    DataError where the log cannot be read; ConfigError where its configuration is none today, a change is wrong, or it
    names a module of the user's, which a log does not get to run.
    """
    log = read_log(path)
    setup = flown_setup(log, path, pilot, vision, changes)
    return Recording(replayed_log(path), *setup, log.header.info.seed or 0, log.records, log.complete)


def flown_setup(
    log: FlightLog, path: Path, pilot: str = "", vision: str = "", changes: Sequence[str] = ()
) -> tuple[Scenario, str, str]:
    """Scenario under changes, pilot and vision of a log, unless others are named; errors as of `recorded_flight`."""
    info = log.header.info
    version = info.code_version or info.software_version
    return _setup(path, (info.table(), info.pilot, info.vision, version), (pilot, vision, changes))


def _setup(
    path: Path, flown: tuple[Mapping[str, Any], str, str, str], asked: tuple[str, str, Sequence[str]]
) -> tuple[Scenario, str, str]:
    """Scenario, pilot and vision of what stands in a file: configuration, pilot, vision and version, as written.

    Asked are pilot and vision in their place, or empty, and changes of the configuration.
    """
    table, flew, saw, version = flown
    pilot, vision, changes = asked
    for option, given, recorded in (("pilot", pilot, flew), ("vision", vision, saw)):
        if not given and factories.is_own_code(recorded):
            raise ConfigError(
                f"{path} names code as its {option}, which a log does not get run: give --{option} {recorded} to run it"
            )
    try:
        scenario = load_scenario(merge(table, settings(changes)))  # a younger key has today's default
    except ConfigError as error:
        here = code_version()
        if version == here:
            raise
        raise ConfigError(f"{path} was flown by version {version}, this is {here}: {error}") from None
    return scenario, pilot or flew, vision or saw


@dataclass(frozen=True)
class PastFlight:
    """A flight of the simulator that can be flown again, changes laid over what it was flown with.

    Attributes:
        version: of the code that flew it.
        out: where to, unless another folder is asked for.
        log: of that flight; None where it was not kept.
        result: its verdict in words.
    """

    scenario: Scenario
    pilot: str
    vision: str
    seed: int
    version: str
    out: Path
    log: Path | None
    result: str = ""


def flown_in_cell(
    folder: Path, seed: int, pilot: str = "", vision: str = "", changes: Sequence[str] = ()
) -> PastFlight:
    """A flight of a campaign's cell.

    DataError where the folder holds no campaign; ConfigError where that seed was not flown, or as of `recorded_flight`.
    """
    results = {landing.seed: landing.reason for landing in read_campaign(folder)}
    if seed not in results:
        listed = f"{min(results)} to {max(results)}" if results else "none"
        raise ConfigError(f"{folder} holds no flight of seed {seed}; seeds flown: {listed}")
    key = read_key(folder)
    version = str(key.get("version", ""))
    setup = _setup(folder, (renamed(key["scenario"]), key["pilot"], key["vision"], version), (pilot, vision, changes))
    log, out = folder / "flights" / f"{seed}.mcap", folder / "flights" / f"{seed}"
    return PastFlight(*setup, seed, version, out, log if log.is_file() else None, results[seed])


def recorded_film(
    path: Path, scenario: Scenario, pilot: str, vision: str, pitch_deg: float, camera: Camera | None = None
) -> Recording:
    """A video, whose camera is pitched against the horizon and is the scenario's unless another is given.

    The camera is scaled to pictures of another size; DataError where it is no video, or of another aspect.
    """
    camera = Camera.from_parameters(scenario.camera) if camera is None else camera
    with closing(read_video(path)) as pictures:
        height_px, width_px = next(pictures)[1].shape[:2]
    camera = camera.for_pictures(str(path), width_px, height_px)
    vehicle = ReplayVehicle(recorded_video(path, camera, math.radians(pitch_deg), scenario.delays.video_s), camera)
    return Recording(vehicle, scenario, pilot, vision)


def replay(recording: Recording, on_cycle: Callable[[FlightRecord], object] = lambda _: None) -> list[Pair]:
    """Run vision and pilot over a recording, which is used up; `on_cycle` sees every replayed row.

    DataError where the vision wants pictures and there are none, ConfigError where pilot or vision is not known.
    """
    wants_pictures = needs_pictures(factories.resolve("visions", recording.vision))
    say_that_it_compiles()
    autonomy = build_autonomy(recording.scenario, recording.vehicle, recording.pilot, recording.vision, recording.seed)
    rows, pairs = {record.frame.t_s: record for record in recording.records}, []
    nobody_flew = (cycle.record for cycle in cycles(recording.vehicle, autonomy, time.perf_counter))
    for after in _again(recording, autonomy) if rows else nobody_flew:
        if wants_pictures and after.frame.image is None:
            raise DataError(f"the log holds no pictures, which {recording.vision} wants; try --vision geometric")
        on_cycle(after)
        kept = replace(after, frame=replace(after.frame, image=None))
        pairs.append(_pair(rows.get(after.frame.t_s), kept))
    return pairs


def _again(recording: Recording, autonomy: Autonomy) -> Iterator[FlightRecord]:
    """Each recorded cycle with the telemetry that it was decided on, after the command that was sent before it.

    The same vision and pilot so see and decide the very same, however long they take today.
    """
    records, vehicle = recording.records, recording.vehicle
    commands: list[PilotCommand | None] = [None, *(record.decision.command for record in records[:-1])]
    rows = {record.frame.t_s: (record, sent) for record, sent in zip(records, commands, strict=True)}
    last: Observation | None = None
    vehicle.open()
    try:
        while (pair := vehicle.read()) is not None:
            frame = pair[0]
            row, sent = rows[frame.t_s]
            seen = see_or_degrade(autonomy.vision, frame)
            observation = InputGate().observation(without_repeated(seen, last), frame, vehicle.camera)
            last = seen
            decision = decide_or_degrade(autonomy, observation, row.telemetry, sent)
            decision = autonomy.safety.check(decision, observation, row.telemetry)
            yield FlightRecord(frame, row.telemetry, observation, decision, row.truth)
    finally:
        vehicle.close()


def _pair(before: FlightRecord | None, after: FlightRecord) -> Pair:
    if before is None:
        return Pair(None, after, math.nan, math.nan)
    poses = [it.observation.bar_pose for it in (before, after)]
    pose_m = math.nan
    if poses[0] is not None and poses[1] is not None:
        pose_m = float(np.linalg.norm(poses[0].position_in_bar_m - poses[1].position_in_bar_m))
    elif poses != [None, None]:
        pose_m = math.inf
    was, now = (np.array(it.decision.command.sticks_percent) for it in (before, after))
    return Pair(before, after, pose_m, float(np.max(np.abs(was - now))))
