"""Scenarios: the packaged defaults, a scenario laid over them, the user's file and settings over both."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shipland.camera import CameraParameters
from shipland.config import Table, build, merge, nested, packaged_names, packaged_toml, read_toml, require, settings
from shipland.errors import ConfigError
from shipland.geometric.parameters import GeometricParameters
from shipland.guidance.parameters import GuidanceParameters
from shipland.rig import Rig
from shipland.safety.assurance import SafetyParameters
from shipland.scenario.contradictions import contradictions
from shipland.scenario.fault_kinds import Fault, FaultDraw
from shipland.scenario.follower import FollowParameters
from shipland.sim.air.wind import WindParameters
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.contact.touchdown import VerdictParameters
from shipland.sim.scene.scene import SceneParameters
from shipland.sim.ship.ship import ShipParameters
from shipland.sim.world import StartParameters
from shipland.vehicles.delays import DelayParameters
from shipland.vision.far.parameters import DetectorParameters
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.selector import VisionSelectorParameters


@dataclass(frozen=True)
class Scenario:
    """Everything that a simulated flight is made of, but for pilot, vision and seed; one attribute a TOML section.

    Attributes:
        name: of the packaged scenario or of the file.
        description: one line for people.
        time_limit_s: of one flight.
        fault: what fails, on schedule.
    """

    name: str
    description: str
    time_limit_s: float
    rig: Rig
    camera: CameraParameters
    delays: DelayParameters
    aircraft: AircraftParameters
    start: StartParameters
    ship: ShipParameters
    wind: WindParameters
    scene: SceneParameters
    verdict: VerdictParameters
    vision: VisionParameters
    detector: DetectorParameters
    selector: VisionSelectorParameters
    guidance: GuidanceParameters
    safety: SafetyParameters
    geometric: GeometricParameters
    follow: FollowParameters
    fault: tuple[Fault, ...]
    fault_draw: FaultDraw

    def __post_init__(self) -> None:
        require(self.time_limit_s > 0.0, f"time_limit_s must be positive, got {self.time_limit_s}")
        found = list(contradictions(self))
        require(not found, "; ".join(found))

    def table(self) -> Table:
        """The whole merged configuration in plain TOML and JSON types; `load_scenario` reads it back."""
        return {name: _plain(value) for name, value in dataclasses.asdict(self).items()}


def scenario_table(source: str | Path, config: Path | None = None, changes: Iterable[str] = ()) -> Table:
    """The merged table of a packaged scenario's name, or of a TOML file laid over the defaults.

    Args:
        source: the name, or a path that ends in .toml.
        config: a file laid over the scenario.
        changes: texts `section.key=value` laid over both.

    Raises:
        ConfigError: no such scenario, or a file or a text is missing or broken.
    """
    if str(source).endswith(".toml"):
        overlay = _with_parts(read_toml(Path(source)))
    elif str(source) in packaged_names("scenarios"):
        overlay = _with_parts(packaged_toml(f"scenarios/{source}"))
    else:
        known = ", ".join(packaged_names("scenarios"))
        raise ConfigError(f"no scenario {str(source)!r}; there are: {known}, or give a path that ends in .toml")
    # One thread: a flight is repeated bit by bit, and campaigns fly one flight a core.
    detector = packaged_toml("learning")["detector"] | {"threads": 1}
    table = merge(merge(packaged_toml("default"), {"name": Path(source).stem, "detector": detector}), overlay)
    if config is not None:
        table = merge(table, _with_parts(read_toml(config)))
    return merge(table, settings(changes))


def _with_parts(overlay: Table) -> Table:
    """A file's table laid over the packaged parts (ships, aircraft) that its key `parts` names, in their order."""
    rest = {key: value for key, value in overlay.items() if key != "parts"}
    parts = overlay.get("parts", [])
    if not isinstance(parts, list):
        raise ConfigError(f"parts must be a list of names, got {parts!r}")
    table: Table = {}
    for part in parts:
        table = merge(table, packaged_toml(f"parts/{part}"))
    return merge(table, rest)


def load_scenario(source: str | Path | Mapping[str, Any], /, **overrides: Any) -> Scenario:  # noqa: ANN401
    """The scenario of a packaged name, of a TOML file's path, or of a merged table.

    Args:
        source: the name, the path, or the whole table.
        **overrides: sections laid over it, as tables (`wind={"mean_mps": 5.0}`) or with dotted keys
            (`**{"wind.mean_mps": 5.0}`).

    Raises:
        ConfigError: it names what is wrong.
    """
    table = source if isinstance(source, Mapping) else scenario_table(source)
    return build(Scenario, merge({"name": "own"} | dict(table), nested(overrides)), "configuration")


def _plain(value: Any) -> Any:  # noqa: ANN401 - of any configured type
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, enum.Enum):
        return value.value
    return str(value) if isinstance(value, Path) else value
