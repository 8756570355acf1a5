"""`shipland envelope`: an operating envelope over the wind over deck, from simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shipland.commands.options import CampaignOptions, NameArgument, command_line, names_of, picture, say
from shipland.errors import ConfigError, DataError
from shipland.extras import installed

if TYPE_CHECKING:
    from shipland.envelopes import Envelopes


@dataclass(frozen=True)
class Envelope(CampaignOptions):
    """Fly an operating envelope over the wind over deck.

    The landing rate by the wind's speed and direction, as a polar diagram, one for each value of --set; the wind is
    the grid's. It is no release document. Every cell of the grid is flown; then flights go where the border is: a cell
    between two neighbours on either side of it, and more flights for those whose interval holds the rate. The folder
    is a campaign's: run the command again to resume, and `shipland report` makes its page. Leaves envelope.json,
    envelope.md, envelope.png, flights.csv, and the rows and logs of a campaign. Exit codes as of `shipland campaign`.

    Example: shipland envelope rig-natops --out out/rig

    Example: shipland envelope frigate-sea4,frigate-sea5 --ship-kn 5,10 --wind-kn 10,20,30,40 --every-deg 45
        --out out/frigate

    Example: shipland envelope frigate-sea5 --set ship.sea.waves_from_deg=0,60,120 --out out/waves
    """

    scenario: NameArgument
    """Ship and aircraft, as in `shipland fly`; several with commas between make an envelope each."""
    out: Path = Path("out/envelope")
    """Output folder; made when missing."""
    ship_kn: str = ""
    """The ship's speed, straight ahead, several with commas between; the scenario's own when not given."""
    wind_kn: str = "5,10,15,20,25,30"
    """Wind over deck speeds to begin with."""
    every_deg: float = 30.0
    """Between the directions that it comes from, the bow's first."""
    rate: float = 0.9
    """Share of flights that must land within the envelope."""
    runs: int = 10
    """Flights of a cell to begin with."""
    most: int = 40
    """Flights of a cell on the border."""
    finest_kn: float = 2.5
    """Speeds on either side of the border are halved until they are this near."""

    def run(self) -> int:
        """Fly, draw and print; 0 when everything is flown, 1 when not."""
        from shipland.evaluation.campaign import write_rows
        from shipland.report.envelope import write_envelopes

        found, stopped = self.flown(self._envelopes, self.out)
        write_rows(self.out / "flights.csv", found.cells)
        if found.envelopes:
            print(write_envelopes(self.out, found.envelopes, command_line(), installed("plots")), end="")
            say(f"{self.out}: envelope.json, envelope.md, flights.csv, {picture('envelope.png')}")
        elif not stopped:
            raise DataError(f"{self.out}: not every cell has a flight yet; run the command again to resume")
        return 130 if stopped else int(found.left > 0)

    def _envelopes(self, workers: int) -> Envelopes:
        from shipland.envelopes import bases_of, fly_envelopes
        from shipland.evaluation.envelope import EnvelopeGrid
        from shipland.evaluation.suite import Overrides, SuiteEntry

        count = round(360.0 / self.every_deg) if 1.0 <= self.every_deg <= 360.0 else 0
        if not math.isclose(count * self.every_deg, 360.0):
            raise ConfigError(f"--every-deg must divide 360° into equal steps of 1° or more, got {self.every_deg:g}")
        if not self.finest_kn >= 0.1:
            raise ConfigError(f"--finest-kn must be 0.1 or more, got {self.finest_kn:g}")
        directions = tuple(round(index * self.every_deg, 3) for index in range(count))
        grid = EnvelopeGrid(
            _numbers("wind-kn", self.wind_kn), directions, self.rate, self.runs, self.most, self.finest_kn
        )
        asked = Overrides(names_of("pilot", self.pilot), self.changes, self.config)
        entry = SuiteEntry(names_of("SCENARIO", self.scenario), (), self.vision)
        return fly_envelopes(
            bases_of(entry, asked, _numbers("ship-kn", self.ship_kn) if self.ship_kn else ()),
            grid,
            first_seed=self.first_seed,
            workers=workers,
            cluster=self.cluster,
            out=self.out,
            time_limit_s=self.time_limit_s,
            command=command_line(),
        )


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in names_of(option, text))
    except ValueError:
        raise ConfigError(f"--{option} {text}: expected numbers, separated by commas") from None
