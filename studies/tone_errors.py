"""What a camera's tone curve does to the pose: drawn pictures of the bar, each through several curves.

Pictures are drawn in light, without the renderer (tests/pictures.py); ranges from 2 to 15 m, up to 40° off the bar's
axis, three amounts of blur. Every picture is searched without a prediction, with a gimbal error of 1 mrad.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from tests.pictures import TONES, Look, bar_picture, camera_from_bar

from shipland.messages import Frame, GimbalAttitude
from studies.harness import Case, Column, Row, Study
from studies.views import Setting

RANGES_M = (2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0)
AZIMUTHS_DEG = (-40.0, 20.0)
BLURS_PX = (0.3, 0.5, 0.9)
NOISE = 1.5
"""Grey levels."""
GIMBAL_RAD = 1e-3
LOOKS_ASIDE_RAD = 0.05
SEED = 11


def cases() -> Sequence[Case]:
    """Tone curves."""
    return [{"tone": tone} for tone in TONES]


def measure(case: Case, runs: int) -> Row:
    """One curve: the first `runs` places of the grid."""
    setting = Setting.packaged()
    camera, target = setting.camera, setting.rig.cue
    errors: list[tuple[float, float, float]] = []
    places = list(itertools.product(RANGES_M, AZIMUTHS_DEG, BLURS_PX))[:runs]
    for number, (range_m, azimuth_deg, blur_px) in enumerate(places):
        rng = np.random.default_rng([SEED, number])
        azimuth_rad = np.radians(azimuth_deg)
        position_m = range_m * np.array([-np.cos(azimuth_rad), -np.sin(azimuth_rad), 0.02])
        yaw_rad = azimuth_rad + LOOKS_ASIDE_RAD
        look = Look(blur_px, NOISE, tone=TONES[str(case["tone"])])
        picture = bar_picture(target, camera, camera_from_bar(position_m, yaw_rad), rng, look)
        roll_rad, pitch_rad = rng.normal(0.0, GIMBAL_RAD, 2)
        pose = setting.eyes().see(Frame(0.0, picture, GimbalAttitude(roll_rad, pitch_rad))).bar_pose
        if pose is not None:
            error = np.array([*(pose.position_in_bar_m - position_m), pose.yaw_rad - yaw_rad])
            squared = float(error @ np.linalg.solve(pose.covariance, error)) / 4.0
            ratio = float(np.linalg.norm(pose.position_in_bar_m) / np.linalg.norm(position_m))
            errors.append((ratio - 1.0, float(np.degrees(error[3])), squared))
    row: dict[str, float | None] = {"found": len(errors) / len(places)}
    if not errors:
        return row | dict.fromkeys(("distance_rms", "distance_worst", "yaw_rms_deg", "yaw_worst_deg", "nees"))
    distance, yaw_deg, squared_errors = np.abs(np.array(errors)).T
    return row | {
        "distance_rms": float(np.sqrt(np.mean(distance**2))),
        "distance_worst": float(distance.max()),
        "yaw_rms_deg": float(np.sqrt(np.mean(yaw_deg**2))),
        "yaw_worst_deg": float(yaw_deg.max()),
        "nees": float(squared_errors.mean()),
    }


STUDY = Study(
    question="What does a camera's tone curve do to the pose of the bar?",
    columns={
        "tone": Column("tone curve"),
        "found": Column("found [%]", ".0f", 100.0),
        "distance_rms": Column("distance rms [%]", ".2f", 100.0),
        "distance_worst": Column("worst [%]", ".2f", 100.0),
        "yaw_rms_deg": Column("yaw rms [°]", ".2f"),
        "yaw_worst_deg": Column("worst [°]", ".1f"),
        "nees": Column("error² / 4", ".2f"),
    },
    cases=cases,
    measure=measure,
    runs=42,
    minutes=1,
)
