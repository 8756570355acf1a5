"""Why faulted flights failed, by flying each again: without one of its faults, and going around from the last one on.

    shipland campaign faults --pilot horizon --runs 209 --out out/faults
    python tools/fault_causes.py out/faults            # every flight there that is no landing in the square

A flight is a *hit* when it was no landing: it struck something, fell into the sea, or broke a limit. A safe action
was *possible* when the same flight touches nothing if the pilot goes around from three pictures after its last fault's
begin on, held by the vehicle itself. A process that stands still decides nothing.
Prints a row as each flight is done; leaves fault-causes.md in the folder.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import track

from shipland.errors import ShiplandError
from shipland.evaluation.folder import read_campaign
from shipland.evaluation.job import FlightJob, land_quietly
from shipland.evaluation.landing import Landing
from shipland.factories import resolve
from shipland.guidance.pilot import Pilot, PilotSetup
from shipland.messages import Decision, Intent, Mode, Observation, PilotCommand, Telemetry
from shipland.scenario.faults import Fault, faults_of
from shipland.scenario.scenario import Scenario, load_scenario

_CLIMB_PERCENT = 60.0
_REACTION_S = 0.1
"""Three pictures: before, nobody can know that something fails."""
_CLEAR_S = 8.0
"""So long after a fault an aircraft that climbs has left the ship."""
HEAD = "| cell | seed | faults | how it ended | a hit | lands without | safe action |\n|---|---:|---|---|---|---|---|"


@dataclass(frozen=True)
class Failed:
    """A flight that was no landing in the square."""

    cell: str
    scenario: Scenario
    pilot: str
    vision: str
    landing: Landing

    @property
    def is_hit(self) -> bool:
        """It touched something and was no landing."""
        return not self.landing.landed and not self.landing.reason.startswith("no touchdown")

    @property
    def faults(self) -> tuple[Fault, ...]:
        """What failed."""
        return faults_of(self.scenario, self.landing.seed)

    def flown_again(
        self, faults: tuple[Fault, ...], climbs_from_s: float | None = None, until_s: float | None = None
    ) -> Landing:
        """The same flight with these faults; from a time on going around, and ended at another."""
        none = replace(self.scenario.fault_draw, kinds=(), every_kind=False)
        scenario = replace(self.scenario, fault=faults, fault_draw=none)
        if climbs_from_s is None:
            return land_quietly(FlightJob(scenario, self.pilot, self.vision, self.landing.seed))
        end_s = max(fault.end_s for fault in faults) + _CLEAR_S if until_s is None else until_s

        def climber(setup: PilotSetup) -> Pilot:
            return _Climber(resolve("pilots", self.pilot)(setup), climbs_from_s)

        return land_quietly(FlightJob(replace(scenario, time_limit_s=end_s), climber, self.vision, self.landing.seed))


class _Climber:
    """A pilot until a time, and then straight up, held by the vehicle."""

    def __init__(self, pilot: Pilot, from_s: float) -> None:
        self._pilot, self._from_s = pilot, from_s

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """See `Pilot`."""
        decision = self._pilot.decide(observation, telemetry, sent)
        if telemetry.t_s < self._from_s:
            return decision
        hold = PilotCommand.hold(telemetry.t_s, decision.command.gimbal_pitch_rad)
        climb = replace(hold, heave_percent=_CLIMB_PERCENT, intent=Intent.GO_AROUND)
        return Decision(climb, Mode.GO_AROUND, "going around")


def failed_in(folder: Path) -> list[Failed]:
    """The flights of a campaign's folder that failed, in order."""
    found = []
    for path in sorted(folder.glob("*/campaign.json")):
        key = json.loads(path.read_text(encoding="utf-8"))
        scenario = load_scenario(key["scenario"])
        found += [
            Failed(path.parent.name, scenario, key["pilot"], key["vision"], landing)
            for landing in sorted(read_campaign(path.parent), key=lambda it: it.seed)
            if not landing.success
        ]
    return found


def row_of(failed: Failed) -> str:
    """A row of the table."""
    landing, faults = failed.landing, failed.faults
    lands_without = [
        each.kind.value
        for each in faults
        if failed.flown_again(tuple(fault for fault in faults if fault is not each)).success
    ]
    possible = ""
    if failed.is_hit and faults:
        began_s = max(fault.start_s for fault in faults if fault.start_s <= landing.time_s)
        climbed = failed.flown_again(faults, began_s + _REACTION_S)
        possible = "possible" if climbed.reason.startswith("no touchdown") else f"none: {climbed.reason}"
    hit = "yes" if failed.is_hit else "no"
    flown = failed.cell, str(landing.seed), landing.conditions.faults, landing.reason
    return f"| {' | '.join(flown)} | {hit} | {', '.join(lands_without) or 'none of them'} | {possible} |"


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Fly failed flights again.

    Args:
        folder: of `shipland campaign faults`.
    """
    flights, rows, console = failed_in(folder), [HEAD], Console()
    for failed in track(flights, "flying again", console=console, disable=not console.is_terminal):
        rows.append(row_of(failed))
        console.print(rows[-1], soft_wrap=True, highlight=False)
        (folder / "fault-causes.md").write_text("\n".join(rows) + "\n", encoding="utf-8")
    hits = sum(failed.is_hit for failed in flights)
    possible = sum(row.endswith("| possible |") for row in rows)
    console.print(f"{len(flights)} failed, {hits} of them hits, {possible} of those with a safe action possible")


if __name__ == "__main__":
    try:
        tyro.cli(main, description=__doc__)
    except ShiplandError as error:
        raise SystemExit(f"fault_causes: {error}") from None
