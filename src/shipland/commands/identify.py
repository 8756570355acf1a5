"""`shipland identify`: what full sticks mean on a vehicle, from a log of its flight."""

from __future__ import annotations

import math
import shlex
from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import PathArgument, refuse_written_over, say
from shipland.errors import ConfigError


@dataclass(frozen=True)
class Identify:
    """Find what full sticks mean, time constants and delay of a vehicle from a flight log in which every stick moved.

    Writes a TOML file that `shipland fly --vehicle-config` takes, for the simulated aircraft too.

    Example: shipland identify out/flight/flight.mcap --out vehicle.toml
    """

    log: PathArgument
    """Log (flight.mcap) of a flight with telemetry of attitude and velocity."""
    out: Path = Path("vehicle.toml")
    """TOML file; written over."""
    uplink_s: float = 0.02
    """Part of the delay that is the link's."""

    def run(self) -> int:
        """Identify, print the table, write the file."""
        if not 0.0 <= self.uplink_s < math.inf:
            raise ConfigError(f"--uplink-s must be 0 or more, got {self.uplink_s:g}")
        refuse_written_over([self.out], [self.log])
        from shipland.estimation.identify import identify
        from shipland.files import writing
        from shipland.record.reader import read_log

        found = identify(read_log(self.log).records)
        print(found.table())
        with writing(self.out):
            about = f"# shipland identify {self.log.name}\n"  # a name may hold bytes that are no UTF-8
            self.out.write_text(about + found.toml(self.uplink_s), encoding="utf-8", errors="replace")
        say(f"written: {self.out}; fly with --vehicle-config {shlex.quote(str(self.out))}")
        return 0
