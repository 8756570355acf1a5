"""`shipland identify`: what full sticks mean on a vehicle, from a log of its flight."""

from __future__ import annotations

import math
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shipland.commands.options import PathArgument, refuse_written_over, say
from shipland.errors import ConfigError, DataError

if TYPE_CHECKING:
    from shipland.record.info import FlightInfo


@dataclass(frozen=True)
class Identify:
    """Find what full sticks mean, time constants and delay of a vehicle from a flight log in which every stick moved.

    Writes a TOML file that `shipland fly --vehicle-config` takes, for the simulated aircraft too.

    Example: shipland identify out/flight/flight.mcap --out vehicle.toml
    """

    log: PathArgument
    """Log (flight.mcap), or its folder, of a flight with telemetry of attitude and velocity."""
    out: Path = Path("vehicle.toml")
    """TOML file; written over."""
    uplink_s: float = 0.02
    """Part of the delay that is the link's."""

    def run(self) -> int:
        """Identify, print the table, write the file."""
        if not 0.0 <= self.uplink_s < math.inf:
            raise ConfigError(f"--uplink-s must be 0 or more, got {self.uplink_s:g}")
        from shipland.estimation.identify import identify
        from shipland.files import writing
        from shipland.record.reader import read_log
        from shipland.report.outputs import log_in

        path = log_in(self.log)
        refuse_written_over([self.out], [path])
        log = read_log(path)
        found = identify(log.records)
        print(found.table())
        meant = _kind_of_sticks(log.header.info)
        if meant not in ("", found.kind):
            raise DataError(
                f"{path}: its sticks meant {_MEANINGS[meant]}, but explain {_MEANINGS[found.kind]} better: "
                "too steady a flight to tell; fly one in which every stick moves to either side and back"
            )
        with writing(self.out):
            about = f"# shipland identify {path.name}\n"  # a name may hold bytes that are no UTF-8
            self.out.write_text(about + found.toml(self.uplink_s), encoding="utf-8", errors="replace")
        say(f"written: {self.out}; fly with --vehicle-config {shlex.quote(str(self.out))}")
        return 0


_MEANINGS = {"attitude": "a tilt", "velocity": "a speed"}


def _kind_of_sticks(info: FlightInfo) -> str:
    """What the packaged loops of the simulated aircraft made of its sticks; empty for any other vehicle."""
    aircraft = info.table().get("aircraft") if info.is_simulated else None
    loop = aircraft.get("loop") if isinstance(aircraft, dict) else None
    kind = loop.get("kind") if isinstance(loop, dict) else None
    return kind if kind in _MEANINGS else ""
