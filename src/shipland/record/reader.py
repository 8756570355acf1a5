"""Reads a flight log back: rows and verdict, from which every picture and figure can be remade."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from shipland.errors import DataError
from shipland.files import json_of
from shipland.mcap_records import mcap_records
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.record.columns import FlightColumns
from shipland.record.info import FORMAT_VERSION, LogHeader
from shipland.rows import Row, from_row, to_row

FLIGHT_TOPIC, HEADER_TOPIC, VERDICT_TOPIC = "/flight", "/header", "/verdict"


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
