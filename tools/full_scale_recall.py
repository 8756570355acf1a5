"""How far the far detectors see the frigate: recall over range and visibility, beside the limits of picture and air.

    python tools/full_scale_recall.py --scenes 12 [--ship-weights FILE] [--bar-weights FILE]

One picture each, the whole frame at the camera's own resolution, boxes of at least `detector.acquire_confidence`. A box
finds a target when it overlaps the drawn target's (identity pass) by `LEAST_IOU` or more. The scenes: aspect within 30°
of astern, 15–60 m high, sun anywhere at 15–60°, the scenario's sea.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace

import numpy as np

from shipland.camera import Camera
from shipland.frames import Pose
from shipland.messages import Box
from shipland.report.chase import look_at
from shipland.scenario.autonomy import drawn_ship
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.sim.scene.labels import Label
from shipland.sim.scene.scene import Scene
from shipland.sim.ship.ship import ShipState
from shipland.sim.state import SceneState
from shipland.vision.far.detector import Detector

RANGES_KM = (0.3, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
VISIBILITIES_KM = (1.0, 3.0, 5.0, 10.0, 20.0)
BAR_TO_M = 1000.0
LEAST_IOU = 0.25


def overlap(box: Box, label: Label) -> float:
    """Intersection over union."""
    low = np.maximum(np.array(box.centre_px) - 0.5 * np.array(box.size_px), label_low(label))
    high = np.minimum(np.array(box.centre_px) + 0.5 * np.array(box.size_px), label_high(label))
    inner = float(np.prod(np.maximum(high - low, 0.0)))
    return inner / (float(np.prod(box.size_px)) + float(np.prod(label_high(label) - label_low(label))) - inner)


def label_low(label: Label) -> np.ndarray:
    """(2,) left and top edge [px]."""
    return np.array([label.left_px, label.top_px])


def label_high(label: Label) -> np.ndarray:
    """(2,) right and bottom edge [px]."""
    return np.array([label.right_px, label.bottom_px])


def state_at(ship: ShipState, eye_m: np.ndarray, rng: np.random.Generator) -> SceneState:
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


def main() -> None:
    """Draw, look, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="frigate-sea5")
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--ship-weights", default="ship")
    parser.add_argument("--bar-weights", default="bar")
    parser.add_argument("--ranges", type=float, nargs="+", default=RANGES_KM, help="km")
    parser.add_argument("--visibilities", type=float, nargs="+", default=VISIBILITIES_KM, help="km")
    arguments = parser.parse_args()
    ranges_m = [1000.0 * range_km for range_km in arguments.ranges]
    visibilities_m = [1000.0 * visibility_km for visibility_km in arguments.visibilities]
    scenario = load_scenario(scenario_table(arguments.scenario, None, arguments.set))
    camera, parameters = Camera.from_parameters(scenario.camera), scenario.detector
    ship_detector = Detector.load(arguments.ship_weights, parameters)
    bar_detector = Detector.load(arguments.bar_weights, parameters)
    shape = (len(visibilities_m), len(ranges_m))
    looked, ships, bars, false_ships, sizes_px = (np.zeros(shape) for _ in range(5))
    for row, visibility_m in enumerate(visibilities_m):
        for number in range(arguments.scenes):
            rng = np.random.default_rng([7, row, number])
            light = replace(
                scenario.scene,
                visibility_m=visibility_m,
                sun_azimuth_deg=rng.uniform(0.0, 360.0),
                sun_elevation_deg=rng.uniform(15.0, 60.0),
            )
            scene = Scene(scenario.rig, light, rng)
            ship = drawn_ship(scenario, number).at(float(rng.uniform(0.0, 60.0)))
            for column, range_m in enumerate(ranges_m):
                aspect_rad = math.radians(rng.uniform(-30.0, 30.0))
                away = np.array([-math.cos(aspect_rad), math.sin(aspect_rad), 0.0])
                eye_m = ship.ned_from_ship.apply(range_m * away - [0.0, 0.0, rng.uniform(15.0, 60.0)])
                state = state_at(ship, eye_m, rng)
                picture, labels = scene.render(state, camera, rng=rng), scene.labels(state, camera)
                if labels.ship is None:
                    continue
                looked[row, column] += 1
                sizes_px[row, column] += (
                    math.sqrt(float(np.prod(label_high(labels.ship) - label_low(labels.ship)))) / arguments.scenes
                )
                found = ship_detector.detect(picture, parameters.acquire_confidence)
                hits = [overlap(box, labels.ship) >= LEAST_IOU for box in found]
                ships[row, column] += any(hits)
                false_ships[row, column] += len(hits) - sum(hits)
                if range_m <= BAR_TO_M and labels.bar is not None:
                    found = bar_detector.detect(picture, parameters.acquire_confidence)
                    bars[row, column] += any(overlap(box, labels.bar) >= LEAST_IOU for box in found)
            scene.close()
    head = " | ".join(f"{range_m / 1000.0:g} km" for range_m in ranges_m)
    print(f"| visibility | {head} |\n|---|{'---:|' * len(ranges_m)}")
    for row, visibility_m in enumerate(visibilities_m):
        cells = []
        for column, range_m in enumerate(ranges_m):
            count = looked[row, column]
            bar = f" / {bars[row, column]:.0f}" if range_m <= BAR_TO_M else ""
            cells.append(f"{ships[row, column]:.0f}{bar} of {count:.0f} ({false_ships[row, column]:.0f})")
        print(f"| {visibility_m / 1000.0:g} km | {' | '.join(cells)} |", flush=True)
    print("| size [px] | " + " | ".join(f"{size:.0f}" for size in sizes_px[-1]) + " |")
    for visibility_m in visibilities_m:
        left = " | ".join(f"{math.exp(math.log(0.05) * range_m / visibility_m):.2g}" for range_m in ranges_m)
        print(f"| contrast left, {visibility_m / 1000.0:g} km | {left} |")


if __name__ == "__main__":
    main()
