"""Many landings of one scenario: a row each, resumable, on several cores."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from shipland.evaluation.folder import campaign_key, open_folder
from shipland.evaluation.landing import Landing, landing_of
from shipland.evaluation.workers import run_jobs
from shipland.factories import Factory
from shipland.messages import FlightRecord
from shipland.scenario.fly import flight_log, fly_quietly
from shipland.scenario.scenario import Scenario
from shipland.stopping import check_stop, stop_requests


@dataclass(frozen=True)
class CampaignPlan:
    """A campaign with a folder: one scenario, one pilot, many seeds.

    Attributes:
        scenario: what is flown.
        pilot, vision: names, as `factories.resolve` takes them.
        seeds: of the flights.
        out: folder; made when missing.
        workers: processes.
        logs: keep each flight's log, without pictures, as flights/SEED.mcap.
        command: command line to write into the logs.
    """

    scenario: Scenario
    pilot: str
    vision: str
    seeds: Sequence[int]
    out: Path
    workers: int
    logs: bool
    command: str = ""


@dataclass(frozen=True)
class FlightJob:
    """One flight to be flown.

    Attributes:
        scenario: what is flown.
        pilot, vision: as `factories.resolve` takes them; names where they go to another process.
        seed: of the flight.
        log: where its log is kept, if anywhere.
        only_failed: keep it only where it is no landing in the square.
        cell: which table it belongs to, where there are several.
        command: command line to write into the log.
    """

    scenario: Scenario
    pilot: str | Factory
    vision: str | Factory
    seed: int
    log: Path | None = None
    only_failed: bool = False
    cell: str = ""
    command: str = ""


def land_once(flight: FlightJob) -> Landing:
    """Fly one seed and leave nothing behind but, where asked for, its log; a request to stop ends it in the air."""
    records: list[FlightRecord] = []
    scenario, pilot, vision, seed = flight.scenario, flight.pilot, flight.vision, flight.seed

    def remember(record: FlightRecord) -> None:
        check_stop()
        if record.frame.image is not None:
            record = replace(record, frame=replace(record.frame, image=None))
        records.append(record)

    flown = fly_quietly(scenario, pilot, vision, seed, remember)
    landing = landing_of(scenario, seed, flown, records)
    if flight.log is not None and not (flight.only_failed and landing.good):
        part = flight.log.with_name(f".{flight.log.name}.part")
        with flight_log(part, scenario, pilot, vision, seed, flight.command) as writer:
            for record in records:
                writer.append(record)
            writer.finish(flown.verdict)
        part.replace(flight.log)
    return landing


def run_campaign(plan: CampaignPlan) -> Generator[Landing, None, None]:
    """Yield the landings, first those found in `landings.csv`, then the others as they are flown and written.

    Raises:
        DataError: the folder holds landings of another code, configuration or weights, or a broken table; another
            campaign flies in it; or it cannot be written.
    """
    key = campaign_key(plan.scenario, plan.pilot, plan.vision)
    logs = plan.out / "flights" if plan.logs else None
    with stop_requests(), open_folder(plan.out, key) as folder:
        missing = [seed for seed in plan.seeds if seed not in folder.done]
        yield from (folder.done[seed] for seed in plan.seeds if seed in folder.done)
        flights = [
            FlightJob(
                plan.scenario,
                plan.pilot,
                plan.vision,
                seed,
                None if logs is None else logs / f"{seed}.mcap",
                command=plan.command,
            )
            for seed in missing
        ]
        workers = min(plan.workers, max(len(missing), 1))
        for _, landing in run_jobs(land_once, flights, workers, lambda _, landing: folder.append(landing)):
            yield landing
