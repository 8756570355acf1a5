"""Our vision for an autopilot's own landing and estimator: LANDING_TARGET and VISION_POSITION_ESTIMATE."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from shipland.frames import Array, rotation_from_euler
from shipland.messages import BarPose, Observation
from shipland.vehicles.gimbal import gimbal_at
from shipland.vehicles.mavlink.dialect import Message, dialect
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.state import PX4, AutopilotState
from shipland.vehicles.told import LEAST_STD_M, LEAST_STD_RAD, LEVEL_STD_RAD, told_covariance

_OLD_S = 0.2
"""Nothing is sent of an exposure that comes later than this after the newest attitude, or a PX4's newest place."""


@dataclass(frozen=True)
class Mounting:
    """Where things are.

    Attributes:
        camera_in_body_m: (3,) optical centre.
        pad_in_bar_m: (3,) where to land: the deck's centre at rest.
    """

    camera_in_body_m: Array
    pad_in_bar_m: Array


def aircraft_in_bar(pose: BarPose, state: AutopilotState, mounting: Mounting) -> Array:
    """(3,) the aircraft's centre in `bar` [m]; a camera beside it is taken off with the aircraft's attitude."""
    level_from_body = rotation_from_euler(state.roll_rad, state.pitch_rad, 0.0)
    bar_from_level = rotation_from_euler(0.0, 0.0, pose.yaw_rad)
    return np.asarray(pose.position_in_bar_m - bar_from_level @ level_from_body @ mounting.camera_in_body_m)


def landing_target(pose: BarPose, state: AutopilotState, mounting: Mounting, time_us: int) -> Message:
    """LANDING_TARGET of the pad: in BODY_FRD for an ArduPilot, in LOCAL_NED for a PX4, which takes no other."""
    to_pad_in_bar = mounting.pad_in_bar_m - aircraft_in_bar(pose, state, mounting)
    to_pad_in_level = rotation_from_euler(0.0, 0.0, pose.yaw_rad).T @ to_pad_in_bar
    if state.autopilot == PX4:
        frame = dialect.MAV_FRAME_LOCAL_NED
        place = rotation_from_euler(0.0, 0.0, state.heading_rad) @ to_pad_in_level
        place = place + np.array([state.north_m, state.east_m, state.down_m])
    else:
        frame = dialect.MAV_FRAME_BODY_FRD
        place = rotation_from_euler(state.roll_rad, state.pitch_rad, 0.0).T @ to_pad_in_level
    forward, right, down = to_pad_in_level.tolist()
    x, y, z = place.tolist()
    return dialect.MAVLink_landing_target_message(
        time_us, 0, frame, math.atan2(right, max(down, 1e-3)), math.atan2(-forward, max(down, 1e-3)),
        float(np.linalg.norm(to_pad_in_bar)), 0.0, 0.0, x, y, z, [1.0, 0.0, 0.0, 0.0],
        dialect.LANDING_TARGET_TYPE_VISION_OTHER, 1,
    )  # fmt: skip


def position_estimate(pose: BarPose, state: AutopilotState, mounting: Mounting, time_us: int) -> Message:
    """VISION_POSITION_ESTIMATE from the cue's centre, north-east-down; every covariance is finite."""
    ned_from_bar = rotation_from_euler(0.0, 0.0, state.heading_rad - pose.yaw_rad)
    north, east, down = (ned_from_bar @ aircraft_in_bar(pose, state, mounting)).tolist()
    covariance = ned_from_bar @ pose.covariance[:3, :3] @ ned_from_bar.T
    full = np.zeros((6, 6))
    full[:3, :3] = told_covariance(covariance) + LEAST_STD_M**2 * np.eye(3)
    full[3, 3] = full[4, 4] = LEVEL_STD_RAD**2
    full[5, 5] = told_covariance(pose.covariance)[3, 3] + LEAST_STD_RAD**2
    return dialect.MAVLink_vision_position_estimate_message(
        time_us, north, east, down, state.roll_rad, state.pitch_rad, state.heading_rad,
        full[np.triu_indices(6)].tolist(), 0,
    )  # fmt: skip


def _at_exposure(session: Session, state: AutopilotState, t_s: float) -> AutopilotState | None:
    """The state with attitude and place of another time; None where they had stood still, or are not known, by then.

    The heading stays, for it turns slowly.
    """
    body, age_s = gimbal_at(t_s, session.attitudes, (), 0.0)  # a camera fixed along the body has its attitude
    since_s, (north, east, down) = t_s - state.velocity_t_s, state.velocity_in_ned_mps
    if age_s > _OLD_S or (state.autopilot == PX4 and not since_s <= _OLD_S):
        return None
    return replace(
        state,
        roll_rad=body.roll_rad,
        pitch_rad=body.pitch_rad,
        north_m=state.north_m + since_s * north,
        east_m=state.east_m + since_s * east,
        down_m=state.down_m + since_s * down,
    )


def tell(session: Session, seen: Observation, mounting: Mounting, with_position: bool = False) -> bool:
    """Send what was seen of the pad, from where the aircraft was at the exposure; whether there was anything."""
    state, pose = session.state, seen.nose_pose
    exposed = _at_exposure(session, state, seen.t_s)
    if pose is None or exposed is None:
        return False
    # the autopilot's clock: what it has said of it, and the exposure's age since
    exposed_us = int(1e6 * max(0.0, state.clock.boot_s - (time.monotonic() - seen.t_s)))
    session.link.send(landing_target(pose, exposed, mounting, exposed_us))
    if with_position:
        session.link.send(position_estimate(pose, exposed, mounting, exposed_us))
    return True
