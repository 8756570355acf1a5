"""What a log says of its flight as a whole."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shipland.camera import Camera
from shipland.config import require
from shipland.errors import DataError
from shipland.files import json_of
from shipland.former import renamed
from shipland.rig import Rig

FORMAT_VERSION = 2
"""Counts up when a column of the log changes its name or meaning."""


@dataclass(frozen=True)
class FlightInfo:
    """Which flight this is. The same info, seed included, gives the same log.

    Attributes:
        scenario: name of the scenario, or of the place and day for a real vehicle.
        seed: of every random number; None for a real vehicle.
        pilot: name of the pilot.
        software_version: release of this package that flew, or that it comes after.
        config_digest: `config_digest` of the merged configuration.
        aircraft_diagonal_m: distance between opposite motors, for drawing.
        vision: name of the vision.
        code_version: version of this package; between releases with its commit, and `dirty` where files differ from it.
        weights_digest: `file_digest` of the detectors' weights; empty where no detector flies.
        command: command line; empty where the flight was flown from Python.
        configuration: the whole merged configuration, as JSON.
    """

    scenario: str
    seed: int | None
    pilot: str
    software_version: str
    config_digest: str
    aircraft_diagonal_m: float
    vision: str = ""
    code_version: str = ""
    weights_digest: str = ""
    command: str = ""
    configuration: str = "{}"

    def table(self) -> dict[str, Any]:
        """The configuration; DataError when it is no table in JSON."""
        try:
            return dict(renamed(json_of(self.configuration)))
        except (TypeError, ValueError) as error:
            raise DataError(f"the log's configuration cannot be read: {error}") from None

    def options(self) -> list[str]:
        """Words of the command line, options without their values; none where it was not typed in a shell."""
        with suppress(ValueError):
            return [word.partition("=")[0] for word in shlex.split(self.command)]
        return []

    @property
    def is_simulated(self) -> bool:
        """Whether the simulated aircraft flew, with this configuration."""
        return self.seed is not None and "--vehicle" not in self.options()

    def __post_init__(self) -> None:
        require(self.aircraft_diagonal_m > 0.0, f"aircraft_diagonal_m must be positive, got {self.aircraft_diagonal_m}")


@dataclass(frozen=True)
class LogHeader:
    """First message of a log: with it the log alone is enough to remake every picture and figure.

    Attributes:
        format_version: `FORMAT_VERSION` of the code that wrote it.
        info: which flight.
        rig: ship platform, deck and cue.
        camera: intrinsics.
    """

    format_version: int
    info: FlightInfo
    rig: Rig
    camera: Camera


def config_digest(table: Mapping[str, Any]) -> str:
    """First 16 hex digits of the SHA-256 of a configuration, independent of the order of its keys."""
    text = json.dumps(table, sort_keys=True, separators=(",", ":"), default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def file_digest(*paths: Path) -> str:
    """First 16 hex digits of the SHA-256 of files, one after the other."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
