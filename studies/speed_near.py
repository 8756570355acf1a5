"""Time of the near vision on rendered pictures, with parts of the published chain, beside two peers; and its stages.

One core. Searching the whole picture, and following in a region around the last pose; the peers' tags hang in the bar's
stead (studies/tags.py): in the whole picture, and in the region that the near vision follows in, cut out beforehand. A
peer's time ends with its pose. Each figure is the median of the process's own CPU time over one picture after the
other; none where one did not find what it looks for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from unittest.mock import patch

import cv2
import numpy as np

from shipland.camera import Camera, CameraParameters, level_from_camera
from shipland.frames import Pose
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.sim.scene.scene import Scene
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import SceneState
from shipland.vision.near import choice, pipeline, pose, published
from shipland.vision.near.pipeline import NearVision, Steps
from shipland.vision.near.segment import Window
from shipland.vision.parameters import VisionParameters
from studies.harness import Case, Column, Row, Study
from studies.tags import Peer, Picture, apriltag, aruco, grain, in_picture

RANGES_M = (2.0, 4.0, 8.0, 15.0)
PICTURES = 5
NOISE = 1.5
CHAINS = {
    "near vision": Steps(),
    "near vision, Förstner corners": Steps(measure=published.measure_corners),
    "near vision, as published": published.published_steps(VisionParameters()),
}
PEERS: dict[str, Callable[[Rig], Peer]] = {
    "cv2.aruco, sub-pixel": aruco,
    "cv2.aruco, as it comes": lambda rig: aruco(rig, refined=False),
    "pyapriltags, decimate 2": apriltag,
    "pyapriltags, decimate 1": lambda rig: apriltag(rig, 1.0),
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


def median_s(look: Callable[[Frame], bool], frames: list[Frame], rounds: int) -> float | None:
    """Median CPU time of one look; None where one does not find what it looks for."""
    spent_s = []
    for frame in frames * rounds:
        started_s = time.process_time()
        if not look(frame):
            return None
        spent_s.append(time.process_time() - started_s)
    return float(np.median(spent_s))


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
    "covariance from afar": (pose, "covariance_over_tilts"),
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

    look, rows, names = following(vision, frames), [], ["regions", "edges", *STAGES]
    with ExitStack() as patches:
        steps = vision._steps
        steps = replace(steps, regions_of=timed("regions", steps.regions_of), measure=timed("edges", steps.measure))
        patches.enter_context(patch.object(vision, "_steps", steps))
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


def cases() -> Sequence[Case]:
    """Ranges."""
    return [{"range_m": range_m} for range_m in RANGES_M]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` rounds over the pictures; rows of those who look, and of the stages of a followed picture."""
    cv2.setNumThreads(1)
    rig, parameters = Rig(), VisionParameters()
    camera = Camera.from_parameters(CameraParameters())
    looks = approach(rig, camera, float(case["range_m"]))
    frames = [look.frame for look in (*looks, *looks[::-1])]
    rows = []
    for name, steps in CHAINS.items():
        vision = NearVision(rig.cue, camera, parameters, steps)
        whole, followed = (median_s(look, frames, runs) for look in (searching(vision), following(vision, frames)))
        rows.append({"group": "looks", "what": name, "whole_s": whole, "followed_s": followed})
    for name, make in PEERS.items():
        peer = make(rig)
        pictures = [peer_frames(peer, looks, camera, margins) for margins in (None, parameters)]
        whole, followed = (median_s(asking(peer, camera), some, 2 * runs) for some in pictures)
        rows.append({"group": "looks", "what": name, "whole_s": whole, "followed_s": followed})
    stages = stages_ms(NearVision(rig.cue, camera, parameters), frames, runs)
    return [*rows, *({"group": "stages", "what": name, "followed_s": 1e-3 * ms} for name, ms in stages.items())]


STUDY = Study(
    question="What does a look of the near vision cost?",
    columns={
        "range_m": Column("range [m]", ".0f"),
        "what": Column(""),
        "whole_s": Column("whole frame [ms]", ".1f", 1e3),
        "followed_s": Column("followed, or region [ms]", ".2f", 1e3),
    },
    cases=cases,
    measure=measure,
    runs=8,
    minutes=2,
    alone=True,
)
