"""Reads a flight log back: rows and verdict, from which every picture and figure can be remade."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

from shipland.errors import DataError
from shipland.files import json_of
from shipland.mcap_records import mcap_records
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.record.columns import FlightColumns
from shipland.record.info import FORMAT_VERSION, LogHeader
from shipland.rows import Row, from_row, to_row
from shipland.vision.attitude import AttitudeTrack, Reading, no_attitude
from shipland.vision.parameters import VisionParameters

FLIGHT_TOPIC, HEADER_TOPIC, VERDICT_TOPIC = "/flight", "/header", "/verdict"
_MOST_AGE_S = 0.5
"""Largest age of a gimbal's reading that a picture is seen with."""


@dataclass(frozen=True, eq=False)
class FlightLog:
    """A flight log; two are equal that hold the same flight.

    Attributes:
        header: which flight, with which rig and camera.
        records: one a cycle, in order; their pictures are None.
        verdict: the touchdown, None when there was none.
        complete: the file was closed in order; False for the log of a process that was killed.
    """

    header: LogHeader
    records: tuple[FlightRecord, ...] = field(repr=False)
    verdict: TouchdownVerdict | None
    complete: bool

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FlightLog) and self._rows() == other._rows()

    def _rows(self) -> list[Row]:
        verdict = () if self.verdict is None else (self.verdict,)
        return [{"complete": self.complete}, *map(to_row, (self.header, *self.records, *verdict))]

    def columns(self) -> FlightColumns:
        """The flight as arrays."""
        return FlightColumns.from_records(self.records, self.header.rig)

    def attitude(self, path: Path, *, body: bool = False) -> AttitudeTrack:
        """The gimbal's attitude, or the body's, by the log's clock, as exact as the flight took it to be.

        DataError, which names the file `path`, where the log holds none.
        """
        readings: list[Reading] = []
        for record in self.records:
            frame, telemetry = record.frame, record.telemetry
            if not body and frame.gimbal_age_s <= _MOST_AGE_S:
                readings.append((frame.t_s, frame.gimbal.roll_rad, frame.gimbal.pitch_rad))
            elif body and telemetry.roll_rad is not None and telemetry.pitch_rad is not None:
                t_s = telemetry.t_s if telemetry.attitude_t_s is None else telemetry.attitude_t_s
                readings.append((t_s, telemetry.roll_rad, telemetry.pitch_rad))
        if not readings:
            raise no_attitude(path, body, (FLIGHT_TOPIC,))
        try:
            noise_rad = float(self.header.info.table()["vision"]["gimbal_noise_rad"])
        except (KeyError, TypeError, ValueError):
            noise_rad = VisionParameters().gimbal_noise_rad
        return AttitudeTrack.of(readings, noise_rad if math.isfinite(noise_rad) else 0.0, str(path))


def read_log(path: Path) -> FlightLog:
    """Read `flight.mcap`; of a broken-off file, what there is.

    Raises:
        DataError: the file is missing, no MCAP file, no flight log of this version, or a row in it is none.
    """
    rows, complete = _read_rows(path)
    if not rows[HEADER_TOPIC]:
        raise DataError(f"{path} holds no flight log: it lacks the channel {HEADER_TOPIC}")
    version = rows[HEADER_TOPIC][0].get("format_version")
    if version != FORMAT_VERSION:
        raise DataError(
            f"{path} is a flight log of format {version}, expected {FORMAT_VERSION}; "
            "read it with the version of shipland that wrote it"
        )
    try:
        header = from_row(LogHeader, rows[HEADER_TOPIC][0])
        records = tuple(from_row(FlightRecord, row) for row in rows[FLIGHT_TOPIC])
        verdict = from_row(TouchdownVerdict, rows[VERDICT_TOPIC][-1]) if rows[VERDICT_TOPIC] else None
        for number, record in enumerate(records, 1):
            if not (math.isfinite(record.frame.t_s) and math.isfinite(record.telemetry.t_s)):
                raise DataError(f"row {number} of {FLIGHT_TOPIC} has no time")
        if header.info.seed is not None and header.info.seed < 0:
            raise DataError(f"seed {header.info.seed}, expected 0 or more")
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    return FlightLog(header, records, verdict, complete)


def _read_rows(path: Path) -> tuple[dict[str, list[Row]], bool]:
    """By topic, and whether the file was closed in order."""
    from mcap.records import Channel, Footer, Message

    rows: dict[str, list[Row]] = {FLIGHT_TOPIC: [], HEADER_TOPIC: [], VERDICT_TOPIC: []}
    topics: dict[int, str] = {}
    broken: DataError | None = None
    for item in mcap_records(path):
        if broken is not None:  # at the file's end it was broken off
            raise broken
        if isinstance(item, Channel) and item.topic in rows:
            topics[item.id] = item.topic
        elif isinstance(item, Message) and item.channel_id in topics:
            topic = topics[item.channel_id]
            try:
                rows[topic].append(dict(json_of(item.data)))
            except (TypeError, ValueError) as error:
                broken = DataError(f"{path}: message {len(rows[topic]) + 1} of {topic} is no row: {error}")
        elif isinstance(item, Footer):
            return rows, True
    return rows, False
