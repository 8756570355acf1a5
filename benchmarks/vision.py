"""Time of the near vision on rendered pictures: `python benchmarks/vision.py [--rounds 60]`.

One core. Searching the whole picture, and following in a region around the last pose, at several ranges; with parts
of the published chain; and two peers on the same places, their tags in the bar's stead (tools/peers.py): in the whole
picture, and in the region that the near vision follows in, cut out beforehand. A peer's time ends with its pose. Each
figure is the median over rounds of one picture after the other, in ms: wall time, and the process's own CPU time, which
other work on the machine disturbs less. A dash: not found.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table

from shipland.camera import Camera, CameraParameters, level_from_camera
from shipland.frames import Pose
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.sim.scene.parameters import SceneParameters
from shipland.sim.scene.scene import Scene
from shipland.sim.state import SceneState
from shipland.vision.near import choice, pipeline, pose, published
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.pipeline import NearVision, Steps
from shipland.vision.near.segment import Window

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
from studies.tags import Peer, apriltag, aruco, grain, in_picture

Picture = npt.NDArray[np.uint8]
RANGES_M = (2.0, 4.0, 8.0, 15.0)
PICTURES = 5
NOISE = 1.5
CHAINS = {
    "default": Steps(),
    "watershed on every region": Steps(quads_of=published.find_quads),
    "Förstner corners": Steps(measure=published.measure_corners),
    "as published": published.STEPS,
}


@dataclass(frozen=True)
class Look:
    """One picture: as the near vision gets it, and clean, with where it was taken, for the peers' boards."""

    frame: Frame
    clean: Picture
    camera_from_bar: Pose


def approach(rig: Rig, camera: Camera, range_m: float) -> list[Look]:
    """Pictures a thirtieth of a second apart on the way in at 1 m/s, seen from 5° off the axis."""
    scene = Scene(rig, SceneParameters(), np.random.default_rng(1))
    rng, gimbal, still = np.random.default_rng(1), GimbalAttitude(0.0, np.arctan2(0.3, 2.0)), np.zeros(3)
    ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -rig.deck_height_m]))
    ned_from_bar = ned_from_ship @ rig.ship_from_bar
    looks = []
    for index in range(PICTURES):
        t_s = index / 30.0
        away_m = range_m - t_s
        position_m = away_m * np.array([-np.cos(0.09), -np.sin(0.09), min(0.15, 0.3 / away_m)])
        bar_from_camera = Pose(level_from_camera(gimbal), position_m)
        ned_from_camera = ned_from_bar @ bar_from_camera
        state = SceneState(
            t_s, ned_from_camera, ned_from_ship, ned_from_ship, ned_from_bar, ned_from_camera, still, still
        )
        clean = scene.render(state, camera)
        looks.append(Look(Frame(t_s, grain(clean, NOISE, rng), gimbal), clean, bar_from_camera.inverse()))
    scene.close()
    return looks


def median_ms(look: Callable[[Frame], bool], frames: list[Frame], rounds: int) -> str:
    """Median wall and CPU time of one look [ms]; a dash where one does not find what it looks for."""
    wall, cpu = [], []
    for _ in range(rounds):
        for frame in frames:
            started, started_cpu = time.perf_counter(), time.process_time()
            found = look(frame)
            cpu.append(time.process_time() - started_cpu)
            wall.append(time.perf_counter() - started)
            if not found:
                return "–"
    return f"{1e3 * float(np.median(wall)):.2f} / {1e3 * float(np.median(cpu)):.2f}"


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


def asking(peer: Peer, camera: Camera) -> Callable[[Frame], bool]:
    """Looks of a peer, to the pose; every tag must be found."""

    def look(frame: Frame) -> bool:
        assert frame.image is not None
        found = peer.detect(frame.image)
        return peer.pose(found, camera) is not None and len(found) == len(peer.board.tags_m)

    return look


def peer_frames(peer: Peer, looks: list[Look], camera: Camera, margins: VisionParameters | None) -> list[Frame]:
    """Pictures with the peer's board; cut to the region that the near vision would follow in, given its margins."""
    rng, frames = np.random.default_rng(2), []
    for look in looks:
        picture = grain(peer.board.hung(look.clean, camera, look.camera_from_bar), NOISE, rng)
        if margins is not None:
            tags_m = np.concatenate(list(peer.board.tags_m.values()))
            corners_px = in_picture(tags_m, camera, look.camera_from_bar)
            margin_px = np.maximum(margins.track_margin_px, margins.track_margin * np.ptp(corners_px, axis=0))
            window = Window.around(corners_px, margin_px, camera.width_px, camera.height_px)
            picture = np.ascontiguousarray(window.of(picture))
        frames.append(Frame(look.frame.t_s, picture, look.frame.gimbal))
    return frames


STAGES: dict[str, tuple[object, str]] = {
    "segment": (pipeline, "segment"),
    "associate with the last pose": (choice, "match_by_prediction"),
    "pose": (pipeline, "solve_pose"),
    "validate": (pipeline, "validate"),
    "covariance from afar": (pose, "covariance_over_heading"),
    "covariance": (pose, "bar_pose_of"),
}
"""Where the parts of a followed picture are called, by module and name; the edges are a step of the vision's own."""


def stages_ms(vision: NearVision, frames: list[Frame], rounds: int) -> dict[str, float]:
    """Median wall time of each part of a followed picture, of the rest, and of all [ms]."""
    spent: dict[str, float] = {}

    def timed(name: str, part: Callable[..., object]) -> Callable[..., object]:
        def call(*arguments: object, **named: object) -> object:
            started = time.perf_counter()
            result = part(*arguments, **named)
            spent[name] = spent.get(name, 0.0) + time.perf_counter() - started
            return result

        return call

    look, rows, names = following(vision, frames), [], ["edges", *STAGES]
    with ExitStack() as patches:
        edges = replace(vision._steps, measure=timed("edges", vision._steps.measure))
        patches.enter_context(patch.object(vision, "_steps", edges))
        for name, (module, part) in STAGES.items():
            patches.enter_context(patch.object(module, part, timed(name, getattr(module, part))))
        for _ in range(rounds):
            for frame in frames:
                spent.clear()
                started = time.perf_counter()
                look(frame)
                whole = time.perf_counter() - started
                parts = [spent.get(name, 0.0) for name in names]
                rows.append([*parts, whole - sum(parts), whole])
    return dict(zip([*names, "the rest", "all"], 1e3 * np.median(rows, axis=0), strict=True))


def main() -> None:
    """Time and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--stages", action="store_true", help="where the time of a followed picture goes, and no peers")
    arguments = parser.parse_args()
    rounds = max(1, arguments.rounds // 2)
    cv2.setNumThreads(1)
    rig = Rig()
    camera = Camera.from_parameters(CameraParameters())
    parameters = VisionParameters()
    looks = {range_m: approach(rig, camera, range_m) for range_m in RANGES_M}
    there_and_back = [[look.frame for look in (*some, *some[::-1])] for some in looks.values()]
    table = Table(title=f"near vision, {camera.width_px} × {camera.height_px} px, one core: median ms, wall / CPU")
    table.add_column("chain", no_wrap=True)
    table.add_column("picture")
    for range_m in RANGES_M:
        table.add_column(f"{range_m:.0f} m", justify="right", no_wrap=True)
    if arguments.stages:
        vision = NearVision(rig.cue, camera, parameters)
        columns = [stages_ms(vision, some, rounds) for some in there_and_back]
        for name in columns[0]:
            table.add_row(name, "followed", *(f"{column[name]:.2f}" for column in columns))
        Console(width=120).print(table)
        return
    for name, steps in CHAINS.items():
        vision = NearVision(rig.cue, camera, parameters, steps)
        table.add_row(name, "whole", *(median_ms(searching(vision), some, rounds) for some in there_and_back))
        table.add_row(name, "followed", *(median_ms(following(vision, some), some, rounds) for some in there_and_back))
    for peer in (aruco(rig), aruco(rig, refined=False), apriltag(rig), apriltag(rig, 1.0)):
        for kind, margins in (("whole", None), ("region", parameters)):
            frames = (peer_frames(peer, some, camera, margins) for some in looks.values())
            table.add_row(peer.name, kind, *(median_ms(asking(peer, camera), some, rounds) for some in frames))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
