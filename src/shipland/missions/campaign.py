"""Many landings of one scenario: a row each, resumable, on several cores."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from shipland.errors import ConfigError
from shipland.factories import Factory
from shipland.messages import FlightRecord
from shipland.missions.fly import flight_log, fly_quietly
from shipland.missions.folder import campaign_key, open_folder
from shipland.missions.landing import Landing, landing_of
from shipland.missions.scenarios import Scenario, load_scenario, scenario_table
from shipland.missions.workers import run_jobs, stoppable


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


@dataclass(frozen=True)
class Flight:
    """One flight to be flown.

    Attributes:
        scenario: what is flown.
        pilot, vision: as `factories.resolve` takes them; names where they go to another process.
        seed: of the flight.
        log: where its log is kept, if anywhere.
        cell: which table it belongs to, where there are several.
    """

    scenario: Scenario
    pilot: str | Factory
    vision: str | Factory
    seed: int
    log: Path | None = None
    cell: str = ""


def land_once(flight: Flight) -> Landing:
    """Fly one seed and leave nothing behind but, where asked for, its log."""
    records: list[FlightRecord] = []
    scenario = flight.scenario
    with ExitStack() as stack:
        writer = None
        if flight.log is not None:
            part = flight.log.with_name(f".{flight.log.name}.part")
            writer = stack.enter_context(flight_log(part, scenario, flight.pilot, flight.seed))

        def remember(record: FlightRecord) -> None:
            records.append(replace(record, frame=replace(record.frame, image=None)))
            if writer is not None:
                writer.append(record)

        flown = fly_quietly(scenario, flight.pilot, flight.vision, flight.seed, remember)
        if writer is not None and flight.log is not None:
            writer.finish(flown.verdict)
            part.replace(flight.log)
    return landing_of(scenario, flight.seed, flown, records)


def run_campaign(request: CampaignRequest) -> Generator[Landing, None, None]:
    """Yield the landings, first those found in `landings.csv`, then the others as they are flown and written.

    Raises:
        ConfigError: the scenario or the configuration is wrong.
        DataError: the folder holds landings of another code, configuration or weights, or a broken table; another
            campaign flies in it; or it cannot be written.
    """
    scenario = load_scenario(scenario_table(request.scenario, request.config, request.changes))
    key = campaign_key(scenario, request.pilot, request.vision)
    with stoppable(), open_folder(request.out, key) as folder:
        seeds = range(request.first_seed, request.first_seed + request.count)
        missing = [seed for seed in seeds if seed not in folder.done]
        yield from (folder.done[seed] for seed in seeds if seed in folder.done)
        flights = [Flight(scenario, request.pilot, request.vision, seed, _log_of(request, seed)) for seed in missing]
        workers = min(request.workers, max(len(missing), 1))
        for _, landing in run_jobs(land_once, flights, workers, lambda _, landing: folder.append(landing)):
            yield landing


def _log_of(request: CampaignRequest, seed: int) -> Path | None:
    return request.out / "flights" / f"{seed}.mcap" if request.logs else None
