"""A made-up landing for the tests of what a flight leaves behind: no physics, only smooth curves and a seeded noise."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from shipland.camera import Camera, camera_pose
from shipland.frames import Pose, euler_from_rotation
from shipland.messages import (
    BarPose,
    Box,
    Decision,
    Estimate,
    FlightRecord,
    Frame,
    GimbalAttitude,
    GroundTruth,
    Intent,
    Mode,
    Observation,
    PilotCommand,
    Telemetry,
    TouchdownVerdict,
)
from shipland.record.channels import LogParameters
from shipland.record.info import FORMAT_VERSION, FlightInfo, LogHeader
from shipland.record.reader import FlightLog
from shipland.record.writer import LogWriter
from shipland.rig import Rig

RIG: Rig = Rig()
CAMERA = Camera.from_fov(1280, 720, 69.0)
INFO = FlightInfo("made-up", 7, "paper", "0.1.0", "0123456789abcdef", 0.24)
CAMERA_IN_BODY_M = np.array([0.09, 0.0, 0.0])
LOG = LogParameters()
TOUCHDOWN_S = 34.0
DECK_TO_BODY_M = 0.06


def deck_pose(t_s: float) -> Pose:
    """ship_from_deck: NATOPS-like rolling and pitching, some heave."""
    roll_rad = math.radians(8.0) * math.sin(2.0 * math.pi * t_s / 10.1)
    pitch_rad = math.radians(3.0) * math.sin(2.0 * math.pi * t_s / 6.5 + 1.0)
    heave_m = 0.25 * math.sin(2.0 * math.pi * t_s / 8.0 + 2.0)
    return Pose.from_euler([0.05 * math.sin(t_s), 0.0, heave_m], roll_rad, pitch_rad, 0.0)


def truth_at(t_s: float) -> GroundTruth:
    """Ship under way at 2 m/s to the north-east; the aircraft comes from astern and settles at TOUCHDOWN_S."""
    course_rad = math.radians(45.0)
    ship = Pose.from_euler(
        [2.0 * t_s * math.cos(course_rad), 2.0 * t_s * math.sin(course_rad), -RIG.deck_height_m], 0.0, 0.0, course_rad
    )
    ned_from_deck, ned_from_bar = ship @ deck_pose(t_s), ship @ RIG.ship_from_bar
    if t_s >= TOUCHDOWN_S:
        body = ned_from_deck @ Pose.from_euler([0.04, -0.03, -DECK_TO_BODY_M], 0.0, 0.0, 0.05)
    else:
        far = 1.0 / (1.0 + math.exp((t_s - 12.0) / 3.0))
        height_m = 1.2 + 4.0 * far + 0.05 * math.sin(t_s)
        if t_s > 32.0:
            rest = ned_from_deck @ np_pose([0.04, -0.03, -DECK_TO_BODY_M])
            end_m = -(ship.inverse() @ rest).translation_m[2]
            height_m += (end_m - height_m) * (t_s - 32.0) / (TOUCHDOWN_S - 32.0)
        place_m = [-60.0 * far + 0.03 * math.sin(0.7 * t_s), 3.0 * far * math.sin(0.4 * t_s) - 0.03, -height_m]
        body = ship @ Pose.from_euler(
            place_m, 0.06 * math.sin(1.3 * t_s), -0.15 * far + 0.03 * math.sin(t_s), 0.1 * far * math.sin(t_s)
        )
    heading_rad = euler_from_rotation(body.rotation)[2]
    gimbal = gimbal_at(t_s)
    velocity = np.array([2.0 * math.cos(course_rad), 2.0 * math.sin(course_rad), 0.0])
    return GroundTruth(
        t_s, body, velocity, ship, ned_from_deck, ned_from_bar,
        camera_pose(body, heading_rad, gimbal, CAMERA_IN_BODY_M), np.array([-3.0, 0.5, 0.0]),
    )  # fmt: skip


def np_pose(position_m: list[float]) -> Pose:
    """A pose without turn."""
    return Pose.from_euler(position_m, 0.0, 0.0, 0.0)


def gimbal_at(t_s: float) -> GimbalAttitude:
    """Looks up a little at the end, at the bar."""
    return GimbalAttitude(0.0, 0.15 * max(0.0, min(1.0, (t_s - 30.0) / 4.0)), 0.0)


def mode_at(t_s: float) -> tuple[Mode, str]:
    """The mode and its reason."""
    for until_s, mode, reason in (
        (2.0, Mode.SEARCH, "nothing seen yet"),
        (9.0, Mode.TRACK_SHIP, "ship seen for 1.0 s"),
        (13.0, Mode.TRACK_BAR, "bar seen for 1.0 s"),
        (31.5, Mode.APPROACH, "corners seen for 0.2 s"),
        (TOUCHDOWN_S, Mode.LAND, "landing condition held for 0.5 s: off by less than 5 cm"),
    ):
        if t_s < until_s:
            return mode, reason
    return Mode.DONE, "on the deck"


@cache
def sea_and_sky(width_px: int, height_px: int) -> np.ndarray:
    """The picture without the bar."""
    image = np.full((height_px, width_px, 3), (190, 150, 110), np.uint8)
    image[: height_px // 2] = (225, 205, 180)
    return image


def paint(truth: GroundTruth, camera: Camera) -> np.ndarray:
    """Sea, sky and the bar's rectangles, flat colours."""
    image = sea_and_sky(camera.width_px, camera.height_px).copy()
    corners = corners_px(truth, camera)
    if np.isfinite(corners).all():
        for quad in corners.reshape(-1, 4, 2):
            cv2.fillConvexPoly(image, np.round(quad * 16).astype(np.int32), (60, 200, 40), cv2.LINE_AA, 4)
    return image


def corners_px(truth: GroundTruth, camera: Camera) -> np.ndarray:
    """The rectangles' corners in the picture."""
    camera_from_bar = truth.ned_from_camera.inverse() @ truth.ned_from_bar
    return camera.project(camera_from_bar.apply(RIG.cue.points_in_bar_m))


def record_at(t_s: float, rng: np.random.Generator, pictures: bool = True, witnessed: bool = True) -> FlightRecord:
    """One cycle."""
    truth, (mode, reason) = truth_at(t_s), mode_at(t_s)
    near = mode in (Mode.APPROACH, Mode.LAND, Mode.DONE)
    bar_from_camera = truth.ned_from_bar.inverse() @ truth.ned_from_camera
    axis = bar_from_camera.rotation[:, 2]
    pose, box, refusal = None, None, "bar is 7 px high, at least 12 px wanted"
    if near:
        seen_m = bar_from_camera.translation_m + rng.normal(0.0, 0.01, 3)
        yaw_rad = math.atan2(axis[1], axis[0]) + float(rng.normal(0.0, 0.01))
        pose = BarPose(
            seen_m, yaw_rad, np.diag([1e-4] * 4), 0.3, corners_px(truth, CAMERA) + rng.normal(0, 0.2, (8, 2))
        )
        refusal = ""
    elif mode is not Mode.SEARCH:
        centre = CAMERA.project((truth.ned_from_camera.inverse() @ truth.ned_from_bar).translation_m[None])[0]
        distance_m = float(np.linalg.norm(bar_from_camera.translation_m))
        size = (1.8 * CAMERA.focal_px / distance_m, 1.2 * CAMERA.focal_px / distance_m)
        box = Box((float(centre[0]), float(centre[1])), size, 0.9)
    roll_rad, pitch_rad, heading_rad = euler_from_rotation(truth.ned_from_body.rotation)
    telemetry = Telemetry(
        t_s + 0.28, roll_rad, pitch_rad, heading_rad, 3.0, np.array([0.1, 0.0, 0.0]), 80.0, None, t_s < TOUCHDOWN_S
    )
    sticks = (
        (20.0 * math.sin(t_s), 15.0 * math.cos(0.8 * t_s), -50.0 if mode is Mode.LAND else 8.0, 5.0)
        if mode not in (Mode.SEARCH, Mode.DONE)
        else (0.0, 0.0, 0.0, 0.0)
    )
    command = PilotCommand(
        t_s + 0.31, *sticks, gimbal_at(t_s).pitch_rad, Intent.LAND if mode is Mode.LAND else Intent.FLY
    )
    estimate = None
    if pose is not None:
        estimate = Estimate(t_s, truth.aircraft_in_bar_m + rng.normal(0.0, 0.01, 3), pose.yaw_rad)
    return FlightRecord(
        Frame(t_s, paint(truth, CAMERA) if pictures else None, gimbal_at(t_s)),
        telemetry,
        Observation(
            t_s, gimbal_at(t_s), pose, box if mode is Mode.TRACK_BAR else None,
            box if mode is Mode.TRACK_SHIP else None, refusal,
        ),
        Decision(command, mode, reason, estimate),
        truth if witnessed else None,
    )  # fmt: skip


def cycles(from_s: float = 0.0, to_s: float = TOUCHDOWN_S + 1.0) -> Iterator[float]:
    """Exposure times: every half second on boxes, every 30th of a second on corners."""
    tick = round(from_s * 30.0)
    while tick < to_s * 30.0:
        yield tick / 30.0
        tick += 1 if mode_at(tick / 30.0)[0] in (Mode.APPROACH, Mode.LAND, Mode.DONE) else 15


def flight(
    seed: int = 7, from_s: float = 0.0, to_s: float = TOUCHDOWN_S + 1.0, pictures: bool = True, witnessed: bool = True
) -> Iterator[FlightRecord]:
    """The rows of a flight, in order."""
    rng = np.random.default_rng(seed)
    for t_s in cycles(from_s, to_s):
        yield record_at(t_s, rng, pictures, witnessed)


VERDICT = TouchdownVerdict(
    t_s=TOUCHDOWN_S,
    landed=True,
    in_square=True,
    touchdown_in_deck_m=np.array([0.04, -0.03]),
    rest_in_deck_m=np.array([0.045, -0.035]),
    relative_velocity_in_deck_mps=np.array([0.05, -0.02, 0.55]),
    tilt_rad=0.03,
    slip_m=0.007,
    peak_contact_force_n=21.0,
    reason="landed in the square, 5 cm from its centre",
)


def log_of(records: Iterable[FlightRecord], verdict: TouchdownVerdict | None = VERDICT) -> FlightLog:
    """Rows as a log that was read, without a file."""
    return FlightLog(LogHeader(FORMAT_VERSION, INFO, RIG, CAMERA), tuple(records), verdict, complete=True)


def write_log(
    path: Path,
    records: Iterable[FlightRecord],
    verdict: TouchdownVerdict | None = VERDICT,
    parameters: LogParameters = LOG,
    info: FlightInfo = INFO,
    camera: Camera = CAMERA,
) -> Path:
    """A log file of rows; the path."""
    with LogWriter(path, info, RIG, camera, parameters) as writer:
        for record in records:
            writer.append(record)
        writer.finish(verdict)
    return path
