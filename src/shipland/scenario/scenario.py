"""Scenarios: the defaults, a scenario over them, the user's file and settings over both; none contradicts itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from shipland.camera import Camera, CameraParameters
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
from shipland.geometric import GeometricParameters
from shipland.guidance.parameters import GuidanceParameters
from shipland.rig import Rig
from shipland.safety.assurance import SafetyParameters
from shipland.scenario.faults import Fault, FaultDraw
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.ship.ship import ShipParameters
from shipland.sim.touchdown import VerdictParameters
from shipland.sim.wind import WindParameters
from shipland.sim.world import StartParameters
from shipland.vehicles.delays import DelayParameters
from shipland.vision.parameters import DetectorParameters, VisionParameters
from shipland.vision.vision import VisionSelectorParameters

_TOUCH_M = 1e-9
"""Rounding error of two equal lengths."""


def contradictions(scenario: Scenario) -> Iterator[str]:
    """A line each, with both keys; nothing for a scenario that can be flown."""
    yield from _of_rig(scenario.rig)
    yield from _of_flight(scenario)
    yield from _of_view(scenario)


def _of_rig(rig: Rig) -> Iterator[str]:
    half_deck_m, (board_width_m, board_height_m) = 0.5 * rig.deck_size_m, rig.board_size_m
    deck_front_m = rig.deck_ahead_of_stern_m + half_deck_m
    board_top_m = rig.bar_height_m + 0.5 * board_height_m
    if rig.deck_size_m > rig.platform_width_m + _TOUCH_M:
        yield f"rig.deck_size_m = {rig.deck_size_m:g} is wider than rig.platform_width_m = {rig.platform_width_m:g}"
    if half_deck_m > rig.deck_ahead_of_stern_m + _TOUCH_M:
        yield (
            f"rig.deck_size_m = {rig.deck_size_m:g} stands out astern: "
            f"rig.deck_ahead_of_stern_m = {rig.deck_ahead_of_stern_m:g} is less than half of it"
        )
    if deck_front_m > rig.bar_ahead_of_stern_m + _TOUCH_M:
        yield (
            f"rig.deck_size_m = {rig.deck_size_m:g} reaches {deck_front_m:g} m ahead of the stern, past "
            f"rig.bar_ahead_of_stern_m = {rig.bar_ahead_of_stern_m:g}"
        )
    if rig.bar_ahead_of_stern_m > rig.platform_length_m + _TOUCH_M:
        yield (
            f"rig.bar_ahead_of_stern_m = {rig.bar_ahead_of_stern_m:g} is ahead of the platform: "
            f"rig.platform_length_m = {rig.platform_length_m:g}"
        )
    widest = "rig.polygon" if board_width_m > rig.board_width_m else "rig.board_width_m"
    if board_width_m > rig.platform_width_m + _TOUCH_M:
        yield (
            f"{widest} makes a board of {board_width_m:g} m, wider than the superstructure, "
            f"rig.platform_width_m = {rig.platform_width_m:g}"
        )
    if board_top_m > rig.superstructure_height_m + _TOUCH_M:
        yield (
            f"rig.bar_height_m = {rig.bar_height_m:g} puts the board's upper edge at {board_top_m:g} m, above "
            f"rig.superstructure_height_m = {rig.superstructure_height_m:g}"
        )


def _of_flight(scenario: Scenario) -> Iterator[str]:
    start, safety, approach = scenario.start, scenario.safety, scenario.guidance.approach
    to_bar_m = float(scenario.rig.bar_in_ship_m[0])
    farthest_m = math.hypot(start.distance_m + start.distance_half_range_m + to_bar_m, start.height_m)
    if farthest_m > safety.fence_distance_m:
        yield (
            f"start.distance_m = {start.distance_m:g} ± {start.distance_half_range_m:g} begins {farthest_m:.0f} m from "
            f"the bar, beyond safety.fence_distance_m = {safety.fence_distance_m:g}"
        )
    highest_m = start.height_m + start.height_half_range_m
    if highest_m > safety.fence_height_m:
        yield (
            f"start.height_m = {start.height_m:g} ± {start.height_half_range_m:g} begins above "
            f"safety.fence_height_m = {safety.fence_height_m:g}"
        )
    if approach.hover_height_m <= safety.floor_m:
        yield (
            f"guidance.approach.hover_height_m = {approach.hover_height_m:g} is not above "
            f"safety.floor_m = {safety.floor_m:g}"
        )
    if to_bar_m <= safety.bar_clearance_m:
        yield (
            f"safety.bar_clearance_m = {safety.bar_clearance_m:g} forbids the deck's centre, {to_bar_m:g} m astern of "
            f"the bar (rig.bar_ahead_of_stern_m, rig.deck_ahead_of_stern_m)"
        )


def _of_view(scenario: Scenario) -> Iterator[str]:
    """The cue must fit into the picture from the hover point, the camera turned to it."""
    camera = Camera.from_parameters(scenario.camera)
    hover_in_bar_m = scenario.rig.deck_in_bar_m - np.array([0.0, 0.0, scenario.guidance.approach.hover_height_m])
    eye_in_bar_m = hover_in_bar_m + np.array(scenario.camera.position_in_body_m)
    points_m = scenario.rig.cue.points_in_bar_m - eye_in_bar_m
    ahead_m = float(points_m[:, 0].min())
    cue = "rig.polygon" if scenario.rig.polygon else "rig.rectangle_width_m"
    if ahead_m <= 0.0:
        yield f"camera.position_in_body_m is ahead of the bar from the hover point: {cue} cannot be seen"
        return
    middle_rad = math.atan2(float(eye_in_bar_m[2]), -float(eye_in_bar_m[0]))  # of the bar above the horizon
    if not scenario.camera.gimbal_min_rad <= middle_rad <= scenario.camera.gimbal_max_rad:
        yield (
            f"guidance.approach.hover_height_m = {scenario.guidance.approach.hover_height_m:g} wants the camera at "
            f"{middle_rad:.2f} rad, outside camera.gimbal_min_rad … camera.gimbal_max_rad"
        )
    half_wide_px = camera.focal_px * float(np.abs(points_m[:, 1]).max()) / ahead_m
    elevations_rad = np.arctan2(-points_m[:, 2], points_m[:, 0])
    half_tall_px = camera.focal_px * float(np.tan(np.abs(elevations_rad - middle_rad)).max())
    if half_wide_px > 0.5 * camera.width_px or half_tall_px > 0.5 * camera.height_px:
        yield (
            f"{cue} covers {2.0 * half_wide_px:.0f} × {2.0 * half_tall_px:.0f} px from the hover point, more than the "
            f"picture: camera.horizontal_fov_deg = {scenario.camera.horizontal_fov_deg:g} is too narrow"
        )


@parameters
class FollowParameters:
    """`[follow]`: `scenario.follower`."""

    enabled: bool = key(False, "whether the deck's attitude is followed")
    below_m: float = key(0.5, "only while landing lower than this over the deck", "over the deck; chosen", gt=0)


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
    """One source of a configuration, "default", a file or `--set`, and the keys that it gives."""

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
    try:
        changes = nested(overrides)
    except AttributeError:
        raise ConfigError(f"a key of {overrides} is no text; expected names, as wind={{'mean_mps': 5.0}}") from None
    table = merge({"name": "own"} | dict(table), changes)
    return build(Scenario, merge(usual(table), table), "configuration")
