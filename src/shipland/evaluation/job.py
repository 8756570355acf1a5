"""One flight of a campaign and its row."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path

from shipland.evaluation.landing import Landing, landing_of
from shipland.factories import Factory
from shipland.files import replacing
from shipland.messages import FlightRecord
from shipland.scenario.fly import flight_log, fly_quietly
from shipland.scenario.scenario import Scenario
from shipland.stopping import check_stop


@dataclass(frozen=True)
class FlightJob:
    """One flight to be flown; pilot and vision as `factories.resolve` takes them.

    Attributes:
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
    if flight.log is not None and not (flight.only_failed and landing.success):
        with (
            replacing(flight.log) as beside,
            flight_log(beside, scenario, pilot, vision, seed, flight.command) as writer,
        ):
            for record in records:
                writer.append(record)
            writer.finish(flown.verdict)
    return landing


def land_quietly(flight: FlightJob) -> Landing:
    """Fly one seed; what visions and pilots raise stands in the reasons of its log, and not on the terminal too."""
    loggers = [logging.getLogger(name) for name in ("shipland.flight", "shipland.vision.vision")]
    before = [logger.disabled for logger in loggers]
    try:
        for logger in loggers:
            logger.disabled = True
        return land_once(flight)
    finally:
        for logger, disabled in zip(loggers, before, strict=True):
            logger.disabled = disabled
