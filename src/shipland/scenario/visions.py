"""The visions that fly in simulation, as factories: what `--vision NAME` looks up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from shipland.camera import Camera
from shipland.errors import ConfigError
from shipland.scenario.scenario import Scenario
from shipland.sim.state import SceneState
from shipland.vehicles.simulated import SimulatedVehicle
from shipland.vehicles.vehicle import GroundTruthSource, Vehicle
from shipland.vision.vision import Vision, VisionSelector

F = TypeVar("F", bound=Callable[..., object])


@dataclass(frozen=True)
class VisionSetup:
    """Arguments of a vision's factory.

    Attributes:
        scenario: everything configured; `scenario.rig.cue` is the cue.
        camera: intrinsics of the pictures.
        vehicle: what flies; a vision that needs no pictures may ask a simulated one for the truth.
        near_rng, far_rng: for visions that draw numbers; seeded by the flight's seed.
    """

    scenario: Scenario
    camera: Camera
    vehicle: Vehicle
    near_rng: np.random.Generator
    far_rng: np.random.Generator


def without_pictures(factory: F) -> F:
    """Marks a vision factory whose vision looks at no picture: none is drawn then."""
    factory.needs_pictures = False  # type: ignore[attr-defined]
    return factory


def needs_pictures(factory: Callable[..., object]) -> bool:
    """Whether pictures are drawn for this factory's vision."""
    return bool(getattr(factory, "needs_pictures", True))


def rendered(setup: VisionSetup) -> Vision:
    """Near and far vision on drawn pictures."""
    from shipland.vision.near.pipeline import NearVision

    return _of_pictures(setup, NearVision(setup.scenario.rig.cue, setup.camera, setup.scenario.vision))


def published(setup: VisionSetup) -> Vision:
    """As `rendered`, with the near chain as published [Lee2022]."""
    from shipland.vision.near.published import published_vision

    return _of_pictures(setup, published_vision(setup.scenario.rig.cue, setup.camera, setup.scenario.vision))


def _of_pictures(setup: VisionSetup, near: Vision) -> Vision:
    from shipland.vision.far.far import FarVision
    from shipland.vision.near.deck import DeckVision

    scenario = setup.scenario
    below = DeckVision(scenario.rig, setup.camera, scenario.vision.deck)
    return VisionSelector(near, FarVision.load(setup.camera, scenario.detector, scenario.rig), scenario.selector, below)


@without_pictures
def geometric(setup: VisionSetup) -> Vision:
    """True corners and boxes with the errors of `rendered`, without a picture."""
    from shipland.geometric import GeometricDeck, GeometricFar, GeometricVision

    scenario, vehicle, camera, model = setup.scenario, setup.vehicle, setup.camera, setup.scenario.geometric
    if not isinstance(vehicle, GroundTruthSource):
        raise ConfigError("--vision geometric needs the truth, which only a simulated world knows")
    scenes = vehicle if isinstance(vehicle, SimulatedVehicle) else _SceneFromTruth(vehicle)
    near = GeometricVision(vehicle, scenario.rig.cue, camera, model, scenario.vision, setup.near_rng)
    far = GeometricFar(scenes, camera, scenario.rig, model.ship, model.bar, model.boxes, setup.far_rng)
    below = GeometricDeck(vehicle, camera, model.deck, setup.near_rng.spawn(1)[0])
    return VisionSelector(near, far, scenario.selector, below)


class _SceneFromTruth:
    """The scene of a ground truth source that is not our simulator: the hull counts as level."""

    def __init__(self, truth_source: GroundTruthSource) -> None:
        self._truth_source = truth_source

    def scene_at(self, t_s: float) -> SceneState | None:
        """See `SimulatedVehicle.scene_at`."""
        truth = self._truth_source.truth_at(t_s)
        if truth is None:
            return None
        still = np.zeros(3)
        return SceneState(
            t_s, truth.ned_from_camera, truth.ned_from_ship, truth.ned_from_deck, truth.ned_from_bar,
            truth.ned_from_body, still, still, truth.waves_off,
        )  # fmt: skip
