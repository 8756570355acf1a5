"""Options that several commands share."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import tyro

from shipland.errors import ConfigError, DataError
from shipland.extras import installed
from shipland.learning.arguments import positive

if TYPE_CHECKING:
    from shipland.api import Flight
    from shipland.learning.shot import ShipAndCamera
    from shipland.scenario.scenario import Scenario

PathArgument = Annotated[Path, tyro.conf.Positional]
NameArgument = Annotated[str, tyro.conf.Positional]
Paths = Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="PATH …", help_behavior_hint="")]
Changes = Annotated[tuple[str, ...], tyro.conf.arg(name="set", metavar="KEY=VALUE"), tyro.conf.UseAppendAction]
Flown = TypeVar("Flown")


@dataclass(frozen=True)
class ScenarioOptions:
    """Which scenario, and what is changed in it."""

    scenario: str = "near"
    """Packaged scenario (see `shipland scenarios`), or the path of a TOML file laid over the defaults."""
    config: Path | None = None
    """TOML file laid over the scenario, any section of the configuration."""
    changes: Changes = ()
    """One value laid over all, as `--set wind.mean_mps=5`; may be given again and again."""

    def load(self) -> Scenario:
        """The scenario; ConfigError names what is wrong."""
        from shipland.scenario.scenario import load_scenario, scenario_table

        return load_scenario(scenario_table(self.scenario, self.config, self.changes))


@dataclass(frozen=True, kw_only=True)
class CampaignOptions:
    """Who flies many flights, what is laid over them, and what carries them out."""

    pilot: str = "horizon"
    """Who flies, as in `shipland fly`; several with commas between."""
    vision: str = "geometric"
    """Who sees, as in `shipland fly`."""
    changes: Annotated[Changes, tyro.conf.arg(name="set", metavar="KEY=A,B,…")] = ()
    """Values of a key, laid over every scenario, as `--set delays.video_s=0.2,0.4`; may be given again."""
    config: Path | None = None
    """TOML file laid over every scenario."""
    first_seed: int = 1
    """Seed of the first flight of each cell."""
    workers: int = 2
    """Processes; without meaning with --cluster."""
    cluster: str = ""
    """Fly on a Ray cluster: its address, or `auto` (extra `cluster`)."""
    minutes: float | None = None
    """Stop in order after so long; no limit when not given."""
    print_only: bool = False
    """Fly nothing; show what there is."""

    @property
    def time_limit_s(self) -> float:
        """Of `minutes`; 0 without one."""
        return 60.0 * (self.minutes or 0.0)

    def flown(self, fly: Callable[[int], Flown], out: Path) -> tuple[Flown, bool]:
        """What `fly` gives with so many processes, with none what `out` holds; and whether a person stopped it."""
        if self.print_only and not out.is_dir():
            raise DataError(f"{out} does not exist: nothing was flown there")
        if self.workers < 1:
            raise ConfigError(f"--workers must be at least 1, got {self.workers}")
        positive(minutes=self.minutes)
        try:
            return fly(0 if self.print_only else self.workers), False
        except KeyboardInterrupt:
            return fly(0), True


def ship_and_camera_of(scenario: str | None) -> ShipAndCamera:
    """Ship and camera of a scenario's name or TOML file, to draw pictures of; the packaged ones for None."""
    from shipland.learning.shot import PACKAGED, ShipAndCamera
    from shipland.scenario.scenario import load_scenario

    if scenario is None:
        return PACKAGED
    found = load_scenario(scenario)
    return ShipAndCamera(found.name, found.rig, found.camera)


def refuse_written_over(written: Iterable[Path | None], read: Iterable[Path | None]) -> None:
    """ConfigError where a file that is to be written is one of those that are read."""
    inputs = {path.resolve() for path in read if path is not None}
    for path in written:
        if path is not None and path.resolve() in inputs:
            raise ConfigError(f"{path} is read here: name another file to write")


def require_record(flight: Flight) -> None:
    """DataError where an output of the flight failed."""
    if flight.problems:
        raise DataError(f"the flight is not on record as asked: {'; '.join(flight.problems)}")


def picture(name: str) -> str:
    """A picture's name; without the extra, in words that say what to install."""
    return name if installed("plots") else f"(no {name}: pip install 'shipland[plots]')"


def say(words: str) -> None:
    """A line for the person at the terminal, apart from what the command prints."""
    print(words, file=sys.stderr, flush=True)


def say_if_broken_off(log: Path, cycles: int, complete: bool) -> None:
    """Tell the person at the terminal of a log that was not closed, as of a process that was killed."""
    if not complete:
        say(f"shipland: {log} breaks off: {cycles} cycles read, the log was not closed")


def command_line() -> str:
    """The command as it was typed, but for a camera's password: logs are passed on."""
    from shipland.vehicles.address import without_password

    return without_password(shlex.join(["shipland", *sys.argv[1:]]))


def names_of(option: str, text: str) -> tuple[str, ...]:
    """Names with commas between; ConfigError names the option when one is empty or comes twice."""
    names = tuple(text.split(","))
    if len(set(names)) < len(names) or not all(names):
        raise ConfigError(f"--{option} {text}: expected different names, separated by commas")
    return names


def check_between(low: float, high: float, **options: float | None) -> None:
    """ConfigError, by its flag, for a number that is given and lies outside of a range, or is NaN."""
    for name, value in options.items():
        if value is not None and not low <= value <= high:
            raise ConfigError(f"--{name.replace('_', '-')} must be {low:.9g} to {high:.9g}, got {value:.9g}")
