"""Scenarios: the defaults, a scenario laid over them, the user's file and settings over both."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

from shipland.camera import CameraParameters
from shipland.config import (
    Table,
    at_scale,
    build,
    defaults,
    key,
    merge,
    nested,
    packaged_names,
    packaged_toml,
    parameters,
    plain,
    read_toml,
    require,
    settings,
)
from shipland.errors import ConfigError
from shipland.geometric.parameters import GeometricParameters
from shipland.guidance.parameters import GuidanceParameters
from shipland.rig import Rig
from shipland.safety.assurance import SafetyParameters
from shipland.scenario.contradictions import contradictions
from shipland.scenario.faults import Fault, FaultDraw
from shipland.scenario.follower import FollowParameters
from shipland.sim.air.wind import WindParameters
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.contact.touchdown import VerdictParameters
from shipland.sim.scene.parameters import SceneParameters
from shipland.sim.ship.ship import ShipParameters
from shipland.sim.world import StartParameters
from shipland.vehicles.delays import DelayParameters
from shipland.vision.far.parameters import DetectorParameters
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.vision import VisionSelectorParameters


@parameters
class Scenario:
    """Everything that a simulated flight is made of, but for pilot, vision and seed; one attribute a TOML section."""

    name: str = key(..., "of the packaged scenario or of the file")
    description: str = key("", "one line for people")
    time_limit_s: float = key(420.0, "of one flight", "chosen: as the longest of the packaged scenarios", gt=0)
    rig: Rig = Rig()
    camera: CameraParameters = CameraParameters()
    delays: DelayParameters = DelayParameters()
    aircraft: AircraftParameters = AircraftParameters()
    start: StartParameters = StartParameters()
    ship: ShipParameters = ShipParameters()
    wind: WindParameters = WindParameters()
    scene: SceneParameters = SceneParameters()
    verdict: VerdictParameters = VerdictParameters()
    vision: VisionParameters = VisionParameters()
    detector: DetectorParameters = key(
        DetectorParameters(threads=1), "", "one thread: a flight repeats bit by bit, campaigns fly one a core"
    )
    selector: VisionSelectorParameters = VisionSelectorParameters()
    guidance: GuidanceParameters = GuidanceParameters()
    safety: SafetyParameters = SafetyParameters()
    geometric: GeometricParameters = GeometricParameters()
    follow: FollowParameters = FollowParameters()
    fault: tuple[Fault, ...] = key(
        (),
        "on schedule",
        'e.g. [{ kind = "link_loss", start_s = 12.0, duration_s = 2.0 }]: docs/how-to/inject-faults.md',
    )
    fault_draw: FaultDraw = FaultDraw()

    def __post_init__(self) -> None:
        found = list(contradictions(self))
        require(not found, "; ".join(found))

    def table(self) -> Table:
        """The whole merged configuration in plain TOML and JSON types; `load_scenario` reads it back."""
        table: Table = plain(self)
        return table


@dataclass(frozen=True)
class ConfigLayer:
    """One source of a configuration.

    Attributes:
        name: "default", a file, or `--set`.
        table: the keys that it gives.
    """

    name: str
    table: Table


def scenario_layers(
    source: str | Path | Scenario, config: Path | None = None, changes: Iterable[str] = ()
) -> list[ConfigLayer]:
    """Where the values of a scenario come from, each laid over those before it; arguments as in `scenario_table`.

    Raises:
        ConfigError: no such scenario, or a file or a text is missing or broken.
    """
    if isinstance(source, Scenario):
        scenario = ConfigLayer("the scenario given", source.table())
    elif str(source).endswith(".toml"):
        scenario = _file(Path(source))
    elif str(source) in packaged_names("scenarios"):
        scenario = _packaged(f"scenarios/{source}")
    else:
        known = ", ".join(packaged_names("scenarios"))
        raise ConfigError(f"no scenario {str(source)!r}; there are: {known}, or give a path that ends in .toml")
    name = source.name if isinstance(source, Scenario) else Path(source).stem
    layers = [ConfigLayer("the name given", {"name": name}), *_with_parts(scenario)]
    if config is not None:
        layers += _with_parts(_file(config))
    layers.append(ConfigLayer("--set", settings(changes)))
    return [ConfigLayer("default", usual(reduce(merge, (layer.table for layer in layers), {}))), *layers]


def usual(table: Mapping[str, Any]) -> Table:
    """Defaults of a scenario, those of pilot and safety at the `guidance.length_scale` that a table gives."""
    guidance = table.get("guidance")
    scale = guidance.get("length_scale", 1.0) if isinstance(guidance, Mapping) else 1.0
    known = isinstance(scale, int | float) and 0.0 < scale <= 100.0 and scale != 1.0
    return at_scale(Scenario, float(scale)) if known else plain(defaults(Scenario))


def scenario_table(source: str | Path | Scenario, config: Path | None = None, changes: Iterable[str] = ()) -> Table:
    """The merged table of a packaged scenario's name, or of a TOML file laid over the defaults.

    Args:
        source: the name, a path that ends in .toml, or a scenario.
        config: a file laid over the scenario.
        changes: texts `section.key=value` laid over both.

    Raises:
        ConfigError: no such scenario, or a file or a text is missing or broken.
    """
    return reduce(merge, (layer.table for layer in scenario_layers(source, config, changes)), {})


def _packaged(name: str) -> ConfigLayer:
    return ConfigLayer(f"{name}.toml", packaged_toml(name))


def _file(path: Path) -> ConfigLayer:
    return ConfigLayer(str(path), read_toml(path))


def _with_parts(layer: ConfigLayer) -> list[ConfigLayer]:
    """A file over the packaged parts (ships, aircraft) that its key `parts` names, in their order."""
    parts = layer.table.get("parts", [])
    if not isinstance(parts, list):
        raise ConfigError(f"parts must be a list of names, got {parts!r}")
    rest = {key: value for key, value in layer.table.items() if key != "parts"}
    return [*(_packaged(f"parts/{part}") for part in parts), ConfigLayer(layer.name, rest)]


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
    table = merge({"name": "own"} | dict(table), nested(overrides))
    return build(Scenario, merge(usual(table), table), "configuration")
