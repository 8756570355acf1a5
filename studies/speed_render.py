"""Processor time of a rendered frame by range and weather, one thread of Mesa's llvmpipe, and of its labels."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from shipland.camera import Camera, CameraParameters
from shipland.frames import CAMERA_FROM_MOUNT, Pose, rotation_from_euler
from shipland.rig import Rig
from shipland.sim.scene.scene import Scene
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import SceneState
from studies.harness import Case, Column, Row, Study

RANGES_M = (2.0, 5.0, 12.0, 30.0, 100.0, 250.0)
WEATHERS: dict[str, dict[str, float]] = {
    "clear, no noise": {"sensor_noise": 0.0},
    "clear": {},
    "fog 300 m": {"visibility_m": 300.0},
    "rain 10 mm/h": {"rain_mm_h": 10.0, "cloud_cover": 0.9},
    "sun ahead": {"sun_azimuth_deg": 10.0, "sun_elevation_deg": 15.0},
    "dusk": {"sun_elevation_deg": 0.0, "sun_azimuth_deg": 40.0},
    "spray, wet lens": {"spray": 1.0, "lens_drops": 0.5},
    "shutter 1/60 s": {"shutter_s": 1.0 / 60.0},
}
LABELS = "labels alone"


def state_at(rig: Rig, range_m: float, t_s: float, height_m: float | None = None) -> SceneState:
    """An approach from astern, 3 m/s ahead and turning slowly."""
    ned_from_ship = Pose.from_euler([0.0, 0.0, -rig.deck_height_m], 0.0, 0.0, 0.0)
    ned_from_bar = ned_from_ship @ rig.ship_from_bar
    if height_m is None:
        height_m = min(0.08 * range_m, 8.0) if range_m > 8.0 else 0.0
    eye = ned_from_bar.apply(np.array([-range_m, 0.1, -height_m]))
    looks = rotation_from_euler(0.0, -np.arctan2(height_m, range_m), 0.0) @ CAMERA_FROM_MOUNT.T
    return SceneState(
        t_s=t_s,
        ned_from_camera=Pose(looks, eye),
        ned_from_ship=ned_from_ship,
        ned_from_deck=ned_from_ship @ Pose.from_euler([0.0, 0.0, -0.05], 0.05, 0.02, 0.0),
        ned_from_bar=ned_from_bar,
        ned_from_body=Pose(np.eye(3), eye),
        camera_velocity_in_ned_mps=np.array([3.0, 0.0, 0.0]),
        camera_rate_in_camera_rad_s=np.array([0.0, 0.1, 0.0]),
    )


def cases() -> Sequence[Case]:
    """Weathers, and labels."""
    return [{"weather": name} for name in (*WEATHERS, LABELS)]


def measure(case: Case, runs: int) -> list[Row]:
    """Median of `runs` frames, after one that loads; a row a range."""
    name, rig = str(case["weather"]), Rig()
    camera, rng = Camera.from_parameters(CameraParameters()), np.random.default_rng(0)
    scene = Scene(rig, replace(SceneParameters(), **WEATHERS.get(name, {})), np.random.default_rng(0))
    draw: Callable[[SceneState], object] = lambda state: scene.render(state, camera, rng=rng)  # noqa: E731
    if name == LABELS:
        draw = lambda state: scene.labels(state, camera)  # noqa: E731
    rows = []
    for range_m in RANGES_M:
        spent_s = []
        for index in range(runs + 1):
            state = state_at(rig, range_m, index / 30.0)
            started_s = time.process_time()
            draw(state)
            spent_s.append(time.process_time() - started_s)
        rows.append({"range_m": range_m, "cpu_s": float(np.median(spent_s[1:]))})
    scene.close()
    return rows


STUDY = Study(
    question="What does a rendered frame cost?",
    columns={
        "weather": Column("weather"),
        "range_m": Column("range [m]", ".0f"),
        "cpu_s": Column("CPU [ms]", ".0f", 1e3),
    },
    cases=cases,
    measure=measure,
    runs=9,
    minutes=1,
    alone=True,
)
