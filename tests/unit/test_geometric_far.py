"""The pictureless detectors: true boxes, with the errors and misses they are told to have."""

from dataclasses import replace

import numpy as np
import pytest

from shipland.config import merge
from shipland.geometric import BoxErrors, GeometricFar
from shipland.messages import PilotCommand
from shipland.scenario.autonomy import build_vehicle
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.sim.state import target_box

EXACT = BoxErrors((1.0, 400.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0))


def hovering(distance_m, ship=EXACT, bar=EXACT, frames=12, seed=1):
    """Observations of an aircraft that hovers astern, and the vehicle."""
    start = {"distance_m": distance_m, "distance_half_range_m": 0.0, "height_m": 3.0, "height_half_range_m": 0.0}
    over_ground = {"loop": {"velocity_reference": "ground"}}  # optical flow strays by metres in these 40 s
    changes = {"start": start | {"bearing_half_range_deg": 0.0}, "aircraft": over_ground}
    scenario = load_scenario(merge(scenario_table("far"), changes))
    vehicle = build_vehicle(scenario, seed, None)
    eyes = GeometricFar(
        vehicle, vehicle.camera, scenario.rig, ship, bar, scenario.geometric.boxes, np.random.default_rng(seed)
    )
    vehicle.open()
    seen = []
    for _ in range(frames):
        frame, telemetry = vehicle.read()
        seen.append(eyes.see(frame))
        vehicle.send(PilotCommand.hold(telemetry.t_s + 0.1, 0.0))
    return seen, vehicle, scenario


def test_boxes_without_errors_are_the_labels_and_come_once_believed():
    seen, vehicle, scenario = hovering(100.0)
    hits = scenario.geometric.boxes.confirm_hits
    assert [item.ship_box is None for item in seen[:hits]] == [True] * (hits - 1) + [False]
    scene = vehicle.scene_at(seen[-1].t_s)
    left, top, right, bottom = target_box("ship", scene, vehicle.camera, scenario.rig, 0.5, 0.17)
    box = seen[-1].ship_box
    assert box.size_px == pytest.approx((right - left, bottom - top))
    assert box.centre_px == pytest.approx((0.5 * (left + right) - 0.5, 0.5 * (top + bottom) - 0.5))


def test_beyond_the_last_range_nothing_is_found():
    near_only = BoxErrors((1.0, 50.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
    seen, _, _ = hovering(100.0, bar=near_only)
    assert all(item.bar_box is None for item in seen)
    assert "bar: not found" in seen[-1].reason


def test_misses_and_errors_are_as_told():
    poor = BoxErrors((1.0, 400.0), (0.3, 0.3), (2.0, 2.0), (0.2, 0.2))
    seen, *_ = hovering(100.0, ship=poor, frames=400)
    boxes = [item.ship_box for item in seen if item.ship_box is not None]
    # 400 draws: 0.7 ± 4 standard deviations of 0.023
    assert len(boxes) / len(seen) == pytest.approx(0.7, abs=0.09)
    columns = np.array([box.centre_px[0] for box in boxes])
    areas = np.array([box.area_px2 for box in boxes])
    assert columns.std() == pytest.approx(2.0, rel=0.2)  # the hover's own wander is below 0.3 px
    assert np.log(areas).std() == pytest.approx(0.2, rel=0.2)


def test_the_same_seed_gives_the_same_boxes():
    poor = BoxErrors((1.0, 400.0), (0.3, 0.3), (2.0, 2.0), (0.2, 0.2))
    first, second = (hovering(60.0, ship=poor, bar=poor)[0] for _ in range(2))
    assert [(item.ship_box, item.bar_box) for item in first] == [(item.ship_box, item.bar_box) for item in second]


def test_tables_of_unlike_length_are_refused():
    with pytest.raises(ValueError, match="miss_rate"):
        replace(EXACT, miss_rate=(0.0,))
