"""Our vision in an autopilot's words."""

import math
import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink")

from shipland.camera import Camera
from shipland.commands.publish import Publish
from shipland.errors import ConfigError
from shipland.frames import rotation_from_euler
from shipland.messages import BarPose, Frame, GimbalAttitude, Observation
from shipland.scenario.scenario import load_scenario
from shipland.vehicles import camera_stream
from shipland.vehicles.mavlink.publish import Mounting, landing_target, position_estimate, tell
from shipland.vehicles.mavlink.state import ARDUPILOT, PX4, AutopilotState
from shipland.vehicles.ros2.vehicle import Ros2Vehicle

CAMERA_M = np.array([0.1, 0.0, 0.02])
PAD_M = np.array([-2.0, 0.3, 0.8])
PLACE_M, YAW = np.array([-4.0, -0.5, -1.0]), 0.2
"""The aircraft in `bar`, and its heading there."""
STATE = AutopilotState(
    autopilot=ARDUPILOT, roll_rad=0.1, pitch_rad=-0.15, heading_rad=1.0, north_m=50.0, east_m=60.0, down_m=-7.0
)


def pose(covariance: np.ndarray | None = None) -> BarPose:
    level_from_body = rotation_from_euler(STATE.roll_rad, STATE.pitch_rad, 0.0)
    camera_m = PLACE_M + rotation_from_euler(0.0, 0.0, YAW) @ level_from_body @ CAMERA_M
    spread = 1e-4 * np.eye(4) if covariance is None else covariance
    return BarPose(camera_m, YAW, spread, 0.2, np.zeros((8, 2)))


MOUNTING = Mounting(CAMERA_M, PAD_M)


def test_an_ardupilot_is_told_in_its_body() -> None:
    message = landing_target(pose(), STATE, MOUNTING, 123)
    bar_from_body = rotation_from_euler(STATE.roll_rad, STATE.pitch_rad, YAW)
    assert message.frame == 12
    assert message.position_valid == 1
    assert PLACE_M + bar_from_body @ np.array([message.x, message.y, message.z]) == pytest.approx(PAD_M, abs=1e-6)
    assert message.distance == pytest.approx(float(np.linalg.norm(PAD_M - PLACE_M)))


def test_a_px4_is_told_in_its_local_frame() -> None:
    message = landing_target(pose(), replace(STATE, autopilot=PX4), MOUNTING, 123)
    assert message.frame == 1
    ned_from_bar = rotation_from_euler(0.0, 0.0, STATE.heading_rad - YAW)
    wanted = np.array([50.0, 60.0, -7.0]) + ned_from_bar @ (PAD_M - PLACE_M)
    assert np.array([message.x, message.y, message.z]) == pytest.approx(wanted, abs=1e-6)


def test_what_is_not_known_of_a_pose_is_sent_as_a_huge_variance() -> None:
    message = position_estimate(pose(np.full((4, 4), math.nan)), STATE, MOUNTING, 1)
    assert np.isfinite(message.covariance).all()
    assert len(message.covariance) == 21
    assert min(message.covariance[index] for index in (0, 6, 11, 20)) > 1e5
    assert min(message.covariance[15], message.covariance[18]) > 0.0
    ned_from_bar = rotation_from_euler(0.0, 0.0, STATE.heading_rad - YAW)
    assert np.array([message.x, message.y, message.z]) == pytest.approx(ned_from_bar @ PLACE_M, abs=1e-6)


LEVEL = GimbalAttitude(0.0, 0.0)


def flying(autopilot: int, sent: list) -> SimpleNamespace:
    """A session at 1.2 s of an aircraft that was as `STATE` says at 1 s."""
    place = {"north_m": STATE.north_m + 0.4, "east_m": STATE.east_m - 0.2, "down_m": STATE.down_m + 0.1}
    moved = {"roll_rad": -0.3, "pitch_rad": 0.3, "velocity_t_s": 1.2, "velocity_in_ned_mps": (2.0, -1.0, 0.5)}
    return SimpleNamespace(
        state=replace(STATE, autopilot=autopilot, **moved, **place),
        attitudes=[
            (0.9, 0.0, 0.0, 0.0),
            (1.1, 2.0 * STATE.roll_rad, 2.0 * STATE.pitch_rad, 0.0),
            (1.3, -0.3, 0.3, 0.0),
        ],
        link=SimpleNamespace(send=sent.append),
    )


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_the_pad_is_told_from_where_the_aircraft_was_at_the_exposure(autopilot: int) -> None:
    """ArduPilot turns the vector back by its attitude of PLND_LAG ago; PX4 takes the place as it is."""
    sent: list = []
    session = flying(autopilot, sent)
    assert not tell(session, Observation(1.0, LEVEL, reason="no cue"), MOUNTING)
    assert tell(session, Observation(1.0, LEVEL, bar_pose=pose()), MOUNTING)
    told, wanted = sent[0], landing_target(pose(), replace(STATE, autopilot=autopilot), MOUNTING, 0)
    assert (told.x, told.y, told.z) == pytest.approx((wanted.x, wanted.y, wanted.z), abs=1e-9)


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_no_pad_is_told_from_a_place_or_an_attitude_that_stands_still(autopilot: int) -> None:
    """Heartbeats and pictures go on; a PX4 without an origin has no place."""
    sent: list = []
    session = flying(autopilot, sent)
    seen, later = (Observation(t_s, LEVEL, bar_pose=pose()) for t_s in (1.0, 1.6))
    assert not tell(session, later, MOUNTING)
    for place in ({"velocity_t_s": 0.7}, {"velocity_t_s": math.nan, "north_m": math.nan}):
        session.state = replace(session.state, **place)
        assert tell(session, seen, MOUNTING) is (autopilot == ARDUPILOT)
    assert len(sent) == (2 if autopilot == ARDUPILOT else 0)


def test_what_a_flight_refuses_is_told_to_no_autopilot(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = time.monotonic()
    frame, seen = Frame(now_s - 0.1, None, LEVEL), replace(pose(), corners_px=np.ones((8, 2)))
    shown = iter([
        (replace(frame, t_s=now_s - 0.2), pose()),
        (frame, pose()),  # the stream stands still
        (replace(frame, gimbal_age_s=math.inf), seen),  # nobody knows where the camera looked
        (replace(frame, t_s=now_s - 0.3), seen),  # older than the last
        (frame, replace(seen, position_in_bar_m=np.full(3, math.nan))),
        (frame, replace(seen, corners_px=np.full((8, 2), 2.0))),
    ])  # fmt: skip
    newest: list[BarPose] = []
    told: list[bool] = []

    def look(_: float) -> Frame | None:
        frame, newest[:] = next(((frame, [pose]) for frame, pose in shown), (None, []))
        return frame

    def see(frame: Frame) -> Observation:
        return Observation(frame.t_s, frame.gimbal, newest[0])

    def tell(seen: Observation, position: bool) -> bool:
        told.append(seen.bar_pose is not None and not position)
        return told[-1]

    monkeypatch.setattr("shipland.vision.near.pipeline.NearVision", lambda *_: SimpleNamespace(see=see))
    vehicle: Any = SimpleNamespace(
        camera=Camera.from_fov(64, 48, 69.0), inform_of=lambda *_: None, look=look, tell=tell
    )
    assert Publish()._publish(vehicle, load_scenario("near")) == 2
    assert told == [True, False, False, False, False, True]


def test_a_camera_that_is_opened_again_does_not_end_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A link that is lost for a moment costs seconds: the pause, and the wait for the first picture."""
    again_s = camera_stream._LONGEST_REOPEN_S + camera_stream._REOPEN_TIMEOUT_S
    gaps_s, vision = iter([0.0, again_s, 0.0]), SimpleNamespace(see=lambda frame: Observation(frame.t_s, frame.gimbal))
    monkeypatch.setattr("shipland.vision.near.pipeline.NearVision", lambda *_: vision)
    told: list[Observation] = []

    def look(timeout_s: float) -> Frame | None:
        return Frame(time.monotonic(), None, LEVEL) if next(gaps_s, math.inf) < timeout_s else None

    def tell(seen: Observation, _: bool) -> bool:
        told.append(seen)
        return False

    vehicle: Any = SimpleNamespace(
        camera=Camera.from_fov(64, 48, 69.0), inform_of=lambda *_: None, look=look, tell=tell
    )
    Publish()._publish(vehicle, load_scenario("near"))
    assert len(told) == 3


def test_a_position_for_ros_2_is_refused_before_anything_is_connected(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Ros2Vehicle.__new__(Ros2Vehicle)
    monkeypatch.setattr("shipland.scenario.real_vehicle.make_vehicle", lambda *_: made)
    monkeypatch.setattr(Ros2Vehicle, "connect", lambda _: pytest.fail("connected"))
    with pytest.raises(ConfigError, match="--position is for an autopilot"):
        Publish(vehicle="ros2://drone", position=True).run()
