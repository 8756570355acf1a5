"""Time of the near vision on rendered pictures: `python benchmarks/vision.py [--rounds 60]`.

One core. Searching the whole picture, and following in a region around the last pose, at several ranges; and with parts
of the published chain. Each figure is the median over rounds of one picture after the other, in ms; wall time,
and the process's own CPU time, which other work on the machine disturbs less.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table

from shipland.camera import Camera, CameraParameters, level_from_camera
from shipland.config import build
from shipland.frames import Pose
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig, default_rig, packaged_table
from shipland.sim.scene import Scene, SceneParameters
from shipland.sim.state import SceneState
from shipland.vision.pipeline import NearVision, VisionParameters

Picture = npt.NDArray[np.uint8]
RANGES_M = (2.0, 4.0, 8.0, 15.0)
PICTURES = 5
CHAINS: dict[str, dict[str, str]] = {
    "default": {},
    "watershed on every region": {"watershed": "always"},
    "Förstner corners": {"corners": "forstner"},
    "as published": {"watershed": "always", "corners": "forstner", "screening": "printed"},
}


def approach(rig: Rig, camera: Camera, range_m: float) -> list[Frame]:
    """Pictures a thirtieth of a second apart on the way in at 1 m/s, seen from 5° off the axis."""
    scene = Scene(rig, build(SceneParameters, packaged_table("scene"), "scene"), seed=1)
    rng, gimbal, still = np.random.default_rng(1), GimbalAttitude(0.0, np.arctan2(0.3, 2.0)), np.zeros(3)
    ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -rig.deck_height_m]))
    ned_from_bar = ned_from_ship @ rig.ship_from_bar
    frames = []
    for index in range(PICTURES):
        t_s = index / 30.0
        away_m = range_m - t_s
        position_m = away_m * np.array([-np.cos(0.09), -np.sin(0.09), min(0.15, 0.3 / away_m)])
        ned_from_camera = ned_from_bar @ Pose(level_from_camera(gimbal), position_m)
        state = SceneState(
            t_s, ned_from_camera, ned_from_ship, ned_from_ship, ned_from_bar, ned_from_camera, still, still
        )
        frames.append(Frame(t_s, scene.render(state, camera, rng=rng), gimbal))
    scene.close()
    return frames


def median_ms(look: Callable[[Frame], bool], frames: list[Frame], rounds: int) -> tuple[float, float]:
    """Median wall and CPU time of one look [ms]; every look must find the cue."""
    wall, cpu = [], []
    for _ in range(rounds):
        for frame in frames:
            started, started_cpu = time.perf_counter(), time.process_time()
            found = look(frame)
            cpu.append(time.process_time() - started_cpu)
            wall.append(time.perf_counter() - started)
            if not found:
                raise SystemExit(f"the bar was not found at {frame.t_s} s: nothing to time")
    return 1e3 * float(np.median(wall)), 1e3 * float(np.median(cpu))


def searching(vision: NearVision) -> Callable[[Frame], bool]:
    """Looks that know of no last pose."""

    def look(frame: Frame) -> bool:
        vision.reset()
        return vision.see(frame).bar_pose is not None

    return look


def following(vision: NearVision, frames: list[Frame]) -> Callable[[Frame], bool]:
    """Looks that follow: time goes on over the rounds, to and fro along the approach."""
    clock = iter(range(10**9))
    vision.reset()

    def look(frame: Frame) -> bool:
        return vision.see(replace(frame, t_s=next(clock) / 30.0)).bar_pose is not None

    look(frames[0])
    return look


def main() -> None:
    """Time and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=60)
    rounds = parser.parse_args().rounds
    cv2.setNumThreads(1)
    rig = default_rig()
    camera = Camera.from_parameters(build(CameraParameters, packaged_table("camera"), "camera"))
    parameters = build(VisionParameters, packaged_table("vision"), "vision")
    frames = {range_m: approach(rig, camera, range_m) for range_m in RANGES_M}
    table = Table(title=f"near vision, {camera.width_px} × {camera.height_px} px, one core: median ms, wall / CPU")
    table.add_column("chain")
    table.add_column("picture")
    for range_m in RANGES_M:
        table.add_column(f"{range_m:.0f} m", justify="right")
    for name, changes in CHAINS.items():
        vision = NearVision(rig.target, camera, replace(parameters, **changes))  # type: ignore[arg-type]
        there_and_back = {range_m: [*some, *some[::-1]] for range_m, some in frames.items()}
        for kind in ("whole", "followed"):
            cells = []
            for some in there_and_back.values():
                look = searching(vision) if kind == "whole" else following(vision, some)
                cells.append("{:.2f} / {:.2f}".format(*median_ms(look, some, max(1, rounds // 2))))
            table.add_row(name, kind, *cells)
    Console().print(table)


if __name__ == "__main__":
    main()
