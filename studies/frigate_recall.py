"""How far the far detectors see the frigate: over range and visibility, through the scenario's lens and a long one.

One picture each, the whole frame at the camera's own resolution, boxes of at least `detector.acquire_confidence`. A box
finds a target when it overlaps the drawn target's (identity pass) by `LEAST_IOU` or more. The scenes: aspect within 30°
of astern, 15–60 m high, sun anywhere at 15–60°, the scenario's sea.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.messages import Box
from shipland.report.chase import look_at
from shipland.scenario.autonomy import drawn_ship
from shipland.scenario.scenario import load_scenario
from shipland.sim.scene.labels import Label
from shipland.sim.scene.scene import Scene
from shipland.sim.ship.ship import ShipState
from shipland.sim.state import SceneState
from shipland.vision.far.detector import Detector
from studies.harness import Case, Column, Row, Study

SCENARIO = "frigate-sea5"
RANGES_KM = (0.3, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 8.0, 12.0, 17.3)
AIRS = ((69.0, 1.0), (69.0, 3.0), (69.0, 5.0), (69.0, 10.0), (69.0, 20.0), (69.0, 40.0), (30.0, 20.0), (30.0, 40.0))
"""Lens [°] and visibility [km]."""
LEAST_IOU = 0.25


def overlap(box: Box, label: Label) -> float:
    """Intersection over union."""
    low = np.maximum(np.array(box.centre_px) - 0.5 * np.array(box.size_px), label_low(label))
    high = np.minimum(np.array(box.centre_px) + 0.5 * np.array(box.size_px), label_high(label))
    inner = float(np.prod(np.maximum(high - low, 0.0)))
    return inner / (float(np.prod(box.size_px)) + float(np.prod(label_high(label) - label_low(label))) - inner)


def label_low(label: Label) -> Array:
    """(2,) left and top edge [px]."""
    return np.array([label.left_px, label.top_px])


def label_high(label: Label) -> Array:
    """(2,) right and bottom edge [px]."""
    return np.array([label.right_px, label.bottom_px])


def state_at(ship: ShipState, eye_m: Array, rng: np.random.Generator) -> SceneState:
    """From a place; the ship lies anywhere in the middle third of the picture."""
    aim_m = ship.ned_from_bar.translation_m
    camera = look_at(eye_m, aim_m)
    aside = Pose.from_euler((0.0, 0.0, 0.0), 0.0, 0.0, math.radians(rng.uniform(-10.0, 10.0)))
    camera = Pose(aside.rotation @ camera.rotation, camera.translation_m)
    zero = np.zeros(3)
    return SceneState(
        t_s=30.0,
        ned_from_camera=camera,
        ned_from_ship=ship.ned_from_hull,
        ned_from_deck=ship.ned_from_deck,
        ned_from_bar=ship.ned_from_bar,
        ned_from_body=camera,
        camera_velocity_in_ned_mps=zero,
        camera_rate_in_camera_rad_s=zero,
    )


def cases() -> Sequence[Case]:
    """Lenses and airs."""
    return [{"lens_deg": lens_deg, "visibility_km": visibility_km} for lens_deg, visibility_km in AIRS]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` scenes, each from every range; a row a range."""
    lens_deg, visibility_km = float(case["lens_deg"]), float(case["visibility_km"])
    scenario = load_scenario(SCENARIO, **{"camera.horizontal_fov_deg": lens_deg})
    camera, parameters = Camera.from_parameters(scenario.camera), scenario.detector
    detectors = {"ship": Detector.load(parameters.ship_weights, parameters), "bar": Detector.load("bar", parameters)}
    rows = {range_km: {"looked": 0, "ship": 0, "bar": 0, "false": 0, "size_px": 0.0} for range_km in RANGES_KM}
    for number in range(runs):
        rng = np.random.default_rng([7, int(visibility_km), number])
        sun = {"sun_azimuth_deg": rng.uniform(0.0, 360.0), "sun_elevation_deg": rng.uniform(15.0, 60.0)}
        scene = Scene(scenario.rig, replace(scenario.scene, visibility_m=1e3 * visibility_km, **sun), rng)
        ship = drawn_ship(scenario, number).at(float(rng.uniform(0.0, 60.0)))
        for range_km, row in rows.items():
            aspect_rad = math.radians(rng.uniform(-30.0, 30.0))
            away = np.array([-math.cos(aspect_rad), math.sin(aspect_rad), 0.0])
            eye_m = ship.ned_from_ship.apply(1e3 * range_km * away - [0.0, 0.0, rng.uniform(15.0, 60.0)])
            state = state_at(ship, eye_m, rng)
            picture, labels = scene.render(state, camera, rng=rng), scene.labels(state, camera)
            if labels.ship is None:
                continue
            row["looked"] += 1
            row["size_px"] += math.sqrt(float(np.prod(label_high(labels.ship) - label_low(labels.ship)))) / runs
            for name, label in (("ship", labels.ship), ("bar", labels.bar)):
                boxes = detectors[name].detect(picture, parameters.acquire_confidence) if label is not None else []
                hits = [overlap(box, label) >= LEAST_IOU for box in boxes if label is not None]
                row[name] += any(hits)
                row["false"] += len(hits) - sum(hits) if name == "ship" else 0
        scene.close()
    return [
        {
            "range_km": range_km,
            **row,
            "contrast": math.exp(math.log(0.05) * range_km / visibility_km),
            "together": f"{row['ship']} ({row['false']})",
        }
        for range_km, row in rows.items()
    ]


STUDY = Study(
    question="How far do the far detectors see the frigate?",
    columns={
        "lens_deg": Column("lens [°]", ".0f"),
        "visibility_km": Column("visibility [km]", ".0f"),
        "range_km": Column("range [km]", "g"),
        "looked": Column("pictures", ".0f"),
        "ship": Column("ship found", ".0f"),
        "bar": Column("bar found", ".0f"),
        "false": Column("false boxes", ".0f"),
        "size_px": Column("size of the ship [px]", ".0f"),
        "contrast": Column("contrast left", ".2f"),
        "together": Column("ship found (false boxes)"),
    },
    cases=cases,
    measure=measure,
    runs=12,
    minutes=15,
)
