"""How well the look down sees the deck: drawn pictures from random places, against the truth.

Heights, places, the deck's tilt and shift, and light at random; the gimbal says where it looks to 0.05°.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipland.camera import level_from_camera
from shipland.frames import Array, Pose, rotation_from_euler
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.sim.state import SceneState
from shipland.vision.near.deck import DeckVision
from studies.harness import Case, Column, Row, Study
from studies.views import Setting, bins, lit_scenes

LOOK_DOWN_RAD = -1.48
HEIGHTS = bins((0.5, 0.65, 0.8, 1.0, 1.2, 1.6))
LOOKS_A_SCENE = 6
SEED = 1


def look_down(rig: Rig, gimbal_noise_rad: float, height_m: float, rng: np.random.Generator) -> tuple[SceneState, Array]:
    """A place over the deck, and the deck's centre from the camera: forward, right, down, level."""
    ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -rig.deck_height_m]))
    tilt = rotation_from_euler(*np.radians(rng.normal(0.0, (4.0, 1.5, 1.5))))
    ned_from_deck = ned_from_ship @ Pose(tilt, rng.normal(0.0, (0.05, 0.13, 0.06)))
    heading = rotation_from_euler(0.0, 0.0, np.radians(rng.normal(0.0, 2.0)))
    body_m = ned_from_ship.translation_m + np.array([*rng.normal(0.0, 0.06, 2), -height_m])
    eye_m = body_m + heading @ np.array([0.09, 0.0, 0.0])
    roll_rad, pitch_rad = rng.normal(0.0, gimbal_noise_rad, 2)
    mount = level_from_camera(GimbalAttitude(roll_rad, LOOK_DOWN_RAD + pitch_rad))
    poses = (Pose(heading @ mount, eye_m), ned_from_ship, ned_from_deck, ned_from_ship @ rig.ship_from_bar)
    state = SceneState(float(height_m), *poses, Pose(heading, body_m), np.zeros(3), np.zeros(3))
    return state, heading.T @ (ned_from_deck.translation_m - eye_m)


def cases() -> Sequence[Case]:
    """Heights of the aircraft over the deck at rest."""
    return [{"height_m": name} for name in HEIGHTS]


def measure(case: Case, runs: int) -> Row:
    """`runs` pictures."""
    name, setting, errors = str(case["height_m"]), Setting.packaged(), list[Array]()
    low_m, high_m = HEIGHTS[name]
    for scene, rng in lit_scenes(setting, SEED + list(HEIGHTS).index(name), runs, LOOKS_A_SCENE):
        height_m = float(rng.uniform(low_m, high_m))
        state, centre_m = look_down(setting.rig, setting.gimbal_noise_rad, height_m, rng)
        image = scene.render(state, setting.camera, rng=rng)
        vision = DeckVision(setting.rig, setting.camera, setting.vision.deck)
        sight = vision.see(Frame(0.0, image, GimbalAttitude(0.0, LOOK_DOWN_RAD))).deck
        if sight is not None:
            errors.append(sight.centre_in_level_m - centre_m)
    names = ("forward_m", "right_m", "down_m", "worst_m")
    if not errors:
        return {"found": 0.0, **dict.fromkeys(names)}
    values = [*np.sqrt(np.mean(np.square(errors), axis=0)), np.abs(errors).max()]
    return {"found": len(errors) / runs, **dict(zip(names, map(float, values), strict=True))}


STUDY = Study(
    question="How well does the look down see the deck?",
    columns={
        "height_m": Column("aircraft over the deck [m]"),
        "found": Column("found [%]", ".0f", 100.0),
        "forward_m": Column("forward, rms [mm]", ".1f", 1e3),
        "right_m": Column("right [mm]", ".1f", 1e3),
        "down_m": Column("down [mm]", ".1f", 1e3),
        "worst_m": Column("worst [mm]", ".1f", 1e3),
    },
    cases=cases,
    measure=measure,
    runs=60,
    minutes=1,
)
