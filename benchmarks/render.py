"""Median time of a rendered frame by range and weather: `python benchmarks/render.py [--frames 9] [--pictures out]`.

Wall time and the process's own CPU time, which other work on the machine disturbs less. `LP_NUM_THREADS` sets how many
threads Mesa's software renderer takes. `--pictures` writes the documentation's sheet of frames too.
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import time
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table

from shipland.camera import Camera, CameraParameters
from shipland.frames import CAMERA_FROM_MOUNT, Pose, rotation_from_euler
from shipland.rig import Rig
from shipland.sim.scene.parameters import SceneParameters
from shipland.sim.scene.scene import Scene
from shipland.sim.state import SceneState

Picture = npt.NDArray[np.uint8]
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


SHEET: list[tuple[float, float, dict[str, float]]] = [  # range, height over the bar, weather
    (3.0, 0.0, {}),
    (12.0, 1.5, {}),
    (100.0, 5.0, {}),
    (9.0, 1.2, {"sun_azimuth_deg": 12.0, "sun_elevation_deg": 12.0}),
    (9.0, 1.2, {"sun_azimuth_deg": 40.0, "sun_elevation_deg": 0.0}),
    (9.0, 1.2, {"visibility_m": 60.0, "cloud_cover": 0.9}),
    (9.0, 1.2, {"rain_mm_h": 20.0, "cloud_cover": 0.95, "visibility_m": 8000.0}),
    (9.0, 1.2, {"significant_wave_height_m": 0.8, "wind_speed_mps": 14.0, "spray": 1.0}),
    (9.0, 1.2, {"lens_drops": 0.8}),
]


def sheet(rig: Rig, camera: Camera, base: SceneParameters) -> Picture:
    """Nine frames, three a row, at half size."""
    tiles = []
    for range_m, height_m, changes in SHEET:
        scene = Scene(rig, dataclasses.replace(base, **changes), np.random.default_rng(3))
        image = scene.render(state_at(rig, range_m, 3.6, height_m), camera, rng=np.random.default_rng(0))
        tiles.append(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
        scene.close()
    return np.asarray(cv2.vconcat([cv2.hconcat(tiles[row : row + 3]) for row in (0, 3, 6)]), np.uint8)


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=9, help="frames a cell")
    parser.add_argument("--pictures", type=Path, help="folder for scene.jpg")
    arguments = parser.parse_args()
    frames, pictures = arguments.frames, arguments.pictures
    rig, rng = Rig(), np.random.default_rng(0)
    camera = Camera.from_parameters(CameraParameters())
    base = SceneParameters()
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(pictures / "scene.jpg"), sheet(rig, camera, base), [cv2.IMWRITE_JPEG_QUALITY, 82])
    table = Table(title=f"ms a {camera.width_px}×{camera.height_px} frame: wall (CPU), median of {frames}")
    table.add_column("weather")
    for range_m in RANGES_M:
        table.add_column(f"{range_m:g} m", justify="right")
    for name, changes in WEATHERS.items():
        scene = Scene(rig, dataclasses.replace(base, **changes), np.random.default_rng(0))
        cells = []
        for range_m in RANGES_M:
            wall, cpu = [], []
            for index in range(frames + 1):
                state = state_at(rig, range_m, index / 30.0)
                wall_s, cpu_s = time.perf_counter(), time.process_time()
                scene.render(state, camera, rng=rng)
                wall.append(time.perf_counter() - wall_s)
                cpu.append(time.process_time() - cpu_s)
            cells.append(f"{1e3 * statistics.median(wall[1:]):.0f} ({1e3 * statistics.median(cpu[1:]):.0f})")
        table.add_row(name, *cells)
        scene.close()
    Console(width=120).print(table)
    scene = Scene(rig, base, np.random.default_rng(0))
    spent = []
    for index in range(4 * frames):
        started = time.process_time()
        scene.labels(state_at(rig, RANGES_M[index % len(RANGES_M)], 0.0), camera)
        spent.append(time.process_time() - started)
    Console().print(f"labels: {1e3 * statistics.median(spent):.1f} ms of CPU, median over the ranges")
    scene.close()


if __name__ == "__main__":
    main()
