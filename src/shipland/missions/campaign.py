"""Many landings of one scenario: a row each, resumable, on several cores, as table and picture."""

from __future__ import annotations

import csv
import dataclasses
import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shipland.errors import ConfigError, DataError
from shipland.factories import Factory
from shipland.messages import FlightRecord
from shipland.missions.crew import motion_start_s
from shipland.missions.fly import flight_log, fly_quietly
from shipland.missions.landing import Landing, no_landing, way_of
from shipland.missions.scenarios import load_scenario, scenario_table
from shipland.record.info import config_digest


@dataclass(frozen=True)
class CampaignRequest:
    """What `shipland campaign` was asked for."""

    scenario: str
    pilot: str
    vision: str
    first_seed: int
    count: int
    out: Path
    config: Path | None
    workers: int
    logs: bool
    changes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ConfigError(f"--count must be at least 1, got {self.count}")
        if self.workers < 1:
            raise ConfigError(f"--workers must be at least 1, got {self.workers}")


def land_once(
    table: dict[str, Any], pilot: str | Factory, vision: str | Factory, seed: int, log: Path | None = None
) -> Landing:
    """Fly one seed and leave nothing behind but, where asked for, its log."""
    records: list[FlightRecord] = []
    scenario = load_scenario(table)
    with ExitStack() as stack:
        writer = None
        if log is not None:
            part = log.with_name(f".{log.name}.part")
            writer = stack.enter_context(flight_log(part, scenario, pilot, seed))

        def remember(record: FlightRecord) -> None:
            records.append(replace(record, frame=replace(record.frame, image=None)))
            if writer is not None:
                writer.append(record)

        flown = fly_quietly(scenario, pilot, vision, seed, remember)
        if writer is not None and log is not None:
            writer.finish(flown.verdict)
            part.replace(log)
    truths = [record.truth for record in records if record.truth is not None]
    start_s = motion_start_s(scenario, seed)
    verdict = flown.verdict
    way = way_of(records, flown.result.t_s if verdict is None else verdict.t_s)
    if verdict is None:
        return no_landing(seed, flown.result.t_s, start_s, way, flown.reason)
    velocity = verdict.relative_velocity_in_deck_mps
    at_contact = max((truth for truth in truths if truth.t_s <= verdict.t_s), key=lambda truth: truth.t_s)
    ship_from_ned = at_contact.ned_from_ship.inverse()
    place_m = ship_from_ned.apply(at_contact.ned_from_body.translation_m)
    deck_m = ship_from_ned.apply(at_contact.ned_from_deck.translation_m)
    return Landing(
        seed=seed,
        landed=verdict.landed,
        in_square=verdict.in_square,
        forward_m=float(verdict.touchdown_in_deck_m[0]),
        starboard_m=float(verdict.touchdown_in_deck_m[1]),
        sink_mps=float(velocity[2]),
        slide_mps=float(np.hypot(velocity[0], velocity[1])),
        tilt_deg=float(np.degrees(verdict.tilt_rad)),
        slip_m=verdict.slip_m,
        force_n=verdict.peak_contact_force_n,
        time_s=verdict.t_s,
        instant_s=verdict.t_s + start_s,
        place_forward_m=float(place_m[0]),
        place_starboard_m=float(place_m[1]),
        deck_forward_m=float(deck_m[0]),
        deck_starboard_m=float(deck_m[1]),
        **vars(way),
        reason=verdict.reason,
    )


def run_campaign(request: CampaignRequest) -> Iterator[Landing]:
    """Yield the landings, first those found in `landings.csv`, then the others as they are flown and written.

    Raises:
        ConfigError: the scenario or the configuration is wrong.
        DataError: the folder holds a campaign of another configuration, or a broken table.
    """
    table = scenario_table(request.scenario, request.config, request.changes)
    load_scenario(table)
    request.out.mkdir(parents=True, exist_ok=True)
    key = f"{config_digest(table)} {request.pilot} {request.vision}"
    path = request.out / "landings.csv"
    done = _read_done(path, key) if path.exists() else {}
    seeds = range(request.first_seed, request.first_seed + request.count)
    yield from (done[seed] for seed in seeds if seed in done)
    missing = [seed for seed in seeds if seed not in done]
    if not path.exists():
        path.write_text(f"# {key}\n{','.join(_COLUMNS)}\n", encoding="utf-8")
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, _COLUMNS)
        for landing in _fly_all(table, request, missing):
            writer.writerow(dataclasses.asdict(landing))
            file.flush()
            yield landing


def _fly_all(table: dict[str, Any], request: CampaignRequest, seeds: list[int]) -> Iterator[Landing]:
    if request.workers == 1 or len(seeds) < 2:
        for seed in seeds:
            yield land_once(*_arguments(table, request, seed))
        return
    # spawn: an OpenGL context does not survive a fork
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(request.workers, context, initializer=_ignore_interrupt) as pool:
        futures = [pool.submit(land_once, *_arguments(table, request, seed)) for seed in seeds]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _arguments(
    table: dict[str, Any], request: CampaignRequest, seed: int
) -> tuple[dict[str, Any], str, str, int, Path | None]:
    log = request.out / "flights" / f"{seed}.mcap" if request.logs else None
    return table, request.pilot, request.vision, seed, log


def _ignore_interrupt() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


_COLUMNS = [field.name for field in dataclasses.fields(Landing)]


def _read_done(path: Path, key: str) -> dict[int, Landing]:
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    if head != f"# {key}":
        raise DataError(f"{path} holds landings of another configuration ({head[2:]}); give another --out")
    done = {}
    for number, row in enumerate(csv.DictReader(rows), start=3):
        try:
            values: dict[str, Any] = {name: _parse(name, row[name]) for name in _COLUMNS}
            done[int(row["seed"])] = Landing(**values)
        except (KeyError, TypeError, ValueError):
            raise DataError(f"{path}, line {number}: not a landing: {row}; remove the line to fly it again") from None
    return done


def _parse(name: str, text: str) -> bool | int | float | str:
    if name in ("landed", "in_square"):
        return {"True": True, "False": False}[text]
    if name in ("seed", "tries"):
        return int(text)
    return text if name == "reason" else float(text)
