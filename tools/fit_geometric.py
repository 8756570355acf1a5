"""Measure what the geometric camera needs: corner errors and misses of near vision in rendered pictures, by range.

    python tools/fit_geometric.py

Prints a table; `[geometric]` in geometric.py carries the fit.
"""

from __future__ import annotations

import numpy as np

from shipland.config import merge
from shipland.messages import PilotCommand
from shipland.scenario.autonomy import build_scene, build_vehicle
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.vision.near.pipeline import NearVision

RANGES_M = (2.5, 4.0, 6.0, 9.0, 12.0, 15.0, 18.0, 20.0, 22.0)
SEEDS = range(1, 7)
FRAMES = 8


def main() -> None:
    """Hover at each range, compare corners with the truth."""
    print("| range [m] | pictures | found | corner rms [px] | corner bias [px] |")
    print("|---:|---:|---:|---:|---:|")
    for range_m in RANGES_M:
        errors_px, pictures = [], 0
        start = {"distance_m": range_m - 2.09, "distance_half_range_m": 0.2, "bearing_half_range_deg": 15.0}
        scenario = load_scenario(merge(scenario_table("near"), {"start": start | {"height_m": 1.2}}))
        for seed in SEEDS:
            scene = build_scene(scenario, seed)
            vehicle = build_vehicle(scenario, seed, scene)
            eyes = NearVision(scenario.rig.cue, vehicle.camera, scenario.vision)
            vehicle.open()
            for _ in range(FRAMES):
                pair = vehicle.read()
                if pair is None:
                    break
                frame, telemetry = pair
                pictures += 1
                pose, truth = eyes.see(frame).bar_pose, vehicle.truth_at(frame.t_s)
                if pose is not None and truth is not None:
                    camera_from_bar = truth.ned_from_camera.inverse() @ truth.ned_from_bar
                    true_px = vehicle.camera.project(camera_from_bar.apply(scenario.rig.cue.points_in_bar_m))
                    errors_px.append(pose.corners_px - true_px)
                vehicle.send(PilotCommand.hold(telemetry.t_s + 0.2, 0.0))
            vehicle.close()
            scene.close()
        errors = np.array(errors_px)
        rms_px = float(np.sqrt(np.mean(errors**2))) if len(errors) else float("nan")
        bias_px = float(np.abs(errors.mean(axis=0)).max()) if len(errors) else float("nan")
        print(f"| {range_m:g} | {pictures} | {len(errors)} | {rms_px:.3f} | {bias_px:.3f} |", flush=True)


if __name__ == "__main__":
    main()
