"""Options that several commands share."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from shipland.errors import ConfigError

if TYPE_CHECKING:
    from shipland.learning.ship_and_camera import ShipAndCamera
    from shipland.scenario.scenario import Scenario

Changes = Annotated[tuple[str, ...], tyro.conf.arg(name="set", metavar="KEY=VALUE"), tyro.conf.UseAppendAction]


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


def ship_and_camera_of(scenario: str | None) -> ShipAndCamera:
    """Ship and camera of a scenario's name or TOML file, to draw pictures of; the packaged ones for None."""
    from shipland.learning.ship_and_camera import ShipAndCamera
    from shipland.scenario.scenario import load_scenario

    if scenario is None:
        return ShipAndCamera.packaged()
    found = load_scenario(scenario)
    return ShipAndCamera(found.name, found.rig, found.camera)


def command_line() -> str:
    """The command as it was typed."""
    return shlex.join(["shipland", *sys.argv[1:]])


def checked_seed(seed: int) -> int:
    """The seed; ConfigError when it is negative."""
    if seed < 0:
        raise ConfigError(f"a seed must be 0 or more, got {seed}")
    return seed


def names_of(option: str, text: str) -> tuple[str, ...]:
    """Names with commas between; ConfigError names the option when one is empty or comes twice."""
    names = tuple(text.split(","))
    if len(set(names)) < len(names) or not all(names):
        raise ConfigError(f"--{option} {text}: expected different names, separated by commas")
    return names
