"""The gate of the loop: what comes from vehicle and vision is finite, plausible and in order of time, or refused.

Refusing never stops a flight: a value becomes None, a picture an observation without content, a time the last good
one, and the reason says so. What is within range and wrong is for filters and gates behind this gate. Behind it runs
the flight's time: the vehicle's, less what its clock has leapt. It never goes back, and on by a minute at most.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.messages import BarPose, Box, DeckSight, Frame, GimbalAttitude, Observation, Telemetry

_LEVEL = GimbalAttitude(0.0, 0.0)
_LEAP_S = 5.0
"""A clock that goes further between two readings has leapt; a picture older than this is not flown on."""
_SILENCE_S = 60.0
"""A clock that goes on from later than this, or from before, has leapt; up to this the vehicle was silent so long."""
_AHEAD_S = 0.1
"""Nothing was true later than it was received, but for rounding and clocks a little apart."""
_LATEST_S = 1e10
"""Of either sign, beyond any clock: 300 years. Past it a float no longer tells microseconds."""
_FARTHEST_M = 2000.0
"""Corners cannot be measured from farther away: a ship's bar of 10 m has 5 px a metre there in no camera."""
_OLD_GIMBAL_S = 0.2
"""A camera's attitude read longer than this before or after the exposure is not that of the picture: a gimbal follows
its command, and a body swings, by several degrees in that time, and 10° move the height by 0.7 m at 4 m. The slowest
that is flown tells it five times a second."""
_OLDEST_S = 3600.0
"""An older time stamp is none that a flight has given."""
_HIGHEST_M, _FASTEST_MPS, _WIDEST_RAD = 10_000.0, 100.0, 4.0 * math.pi
_STEEPEST_RAD = 0.6 * math.pi


class InputGate(NamedTuple):
    """State of the gate between cycles.

    Attributes:
        now_s: the last good time of the flight; None before the first.
        exposure_s: the newest exposure that was admitted, by the same time.
        gimbal: its camera attitude.
        leapt_s: the vehicle's clock is ahead of the flight's time by this much.
        suspect_s: a time of the vehicle that was refused last: a clock that goes on from there has really leapt.
    """

    now_s: float | None = None
    exposure_s: float = -math.inf
    gimbal: GimbalAttitude = _LEVEL
    leapt_s: float = 0.0
    suspect_s: float | None = None

    def vehicle_s(self, t_s: float) -> float:
        """A time of the flight by the vehicle's clock."""
        return t_s + self.leapt_s

    def at_receipt(self, frame: Frame | None, t_s: float) -> InputGate:
        """After the receipt of a frame, or of telemetry without one, at `t_s` by the vehicle's clock."""
        if not abs(t_s) <= _LATEST_S:
            return self
        if self.now_s is None:
            return self._replace(now_s=t_s)
        exposed_s = math.nan if frame is None else frame.t_s
        fits_frame = not math.isfinite(exposed_s) or abs(t_s - exposed_s) <= 2.0 * _LEAP_S
        if 0.0 <= t_s - self.leapt_s - self.now_s <= _LEAP_S:
            return InputGate(t_s - self.leapt_s, self.exposure_s, self.gimbal, self.leapt_s)
        if self.suspect_s is not None and fits_frame and 0.0 < t_s - self.suspect_s <= _LEAP_S:
            return self._leapt(self.now_s, t_s, self.suspect_s)
        return self._replace(suspect_s=t_s)

    def _leapt(self, now_s: float, t_s: float, suspect_s: float) -> InputGate:
        """After the vehicle's clock went on from a time that was refused: silent, come back from a leap, or leapt.

        A leap takes no time of the flight.
        """
        known = (leapt_s for leapt_s in (self.leapt_s, 0.0) if 0.0 <= t_s - leapt_s - now_s <= _SILENCE_S)
        leapt_s = max(known, default=suspect_s - now_s)
        return self._replace(now_s=t_s - leapt_s, leapt_s=leapt_s, suspect_s=None)

    def at_decision(self, t_s: float, asked_s: float) -> InputGate:
        """When the command is decided, at `t_s` by the vehicle's clock; `asked_s` [s] where that is no good time.

        It is none where the clock stands still: in a flight without time no stick moves, and nothing grows old.
        """
        told_s = t_s - self.leapt_s
        good = math.isfinite(told_s) and self.now_s is not None and 0.0 < told_s - self.now_s <= 2.0 * _LEAP_S
        return InputGate(told_s if good else asked_s, *self[1:])

    def frame(self, frame: Frame | None) -> tuple[InputGate, Frame, str]:
        """The frame at the flight's time, and why it is not looked at; empty when it is.

        Of a refused one time and gimbal are the last's.
        """
        now_s = 0.0 if self.now_s is None else self.now_s
        last_s = self.exposure_s if math.isfinite(self.exposure_s) else now_s
        if frame is None:
            return self, Frame(last_s, None, self.gimbal), "no picture"
        if self.leapt_s:
            frame = replace(frame, t_s=frame.t_s - self.leapt_s, stamp_s=frame.t_s)
        reason = ""
        if not math.isfinite(frame.t_s) or frame.t_s > now_s + _AHEAD_S:
            reason = "exposure time refused"
        elif frame.t_s < self.exposure_s:
            reason = "picture older than the last"
        elif now_s - frame.t_s > _LEAP_S:
            reason = f"picture {now_s - frame.t_s:.0f} s old"
        elif not _plausible_gimbal(frame.gimbal):
            reason = "gimbal attitude refused"
        elif not frame.gimbal_age_s <= _OLD_GIMBAL_S:
            reason = _old_gimbal(frame.gimbal_age_s)
        if not reason:
            return InputGate(self.now_s, frame.t_s, frame.gimbal, *self[3:]), frame, ""
        return self, replace(frame, t_s=last_s, gimbal=self.gimbal), reason

    def observation(self, observation: Observation, frame: Frame, camera: Camera) -> Observation:
        """The observation without what is not finite or cannot be; its reason says what was refused."""
        pose, bar, ship, deck = observation.bar_pose, observation.bar_box, observation.ship_box, observation.deck
        refused: list[str] = []
        late_s = frame.t_s - observation.t_s
        if not (math.isfinite(late_s) and -1e-9 <= late_s <= _LEAP_S):
            pose = bar = ship = deck = None
            refused.append("time of the observation refused")
            observation = replace(observation, t_s=frame.t_s)
        if not _plausible_gimbal(observation.gimbal):
            pose = bar = ship = deck = None
            refused.append("gimbal attitude refused")
            observation = replace(observation, gimbal=self.gimbal)
        if pose is not None and not _plausible_pose(pose):
            pose = None
            refused.append("pose refused: not finite or out of range")
        if bar is not None and not _plausible_box(bar, camera):
            bar = None
            refused.append("bar's box refused: not finite or out of range")
        if ship is not None and not _plausible_box(ship, camera):
            ship = None
            refused.append("ship's box refused: not finite or out of range")
        if deck is not None and not _plausible_deck(deck):
            deck = None
            refused.append("sight of the deck refused: not finite or out of range")
        if not refused:
            return observation
        reason = "; ".join(text for text in (observation.reason, *refused) if text)
        return replace(observation, bar_pose=pose, bar_box=bar, ship_box=ship, deck=deck, reason=reason)

    def telemetry(self, telemetry: Telemetry) -> tuple[Telemetry, str]:
        """The telemetry at the flight's time, None for what is refused, and what that is."""
        now_s = telemetry.t_s if self.now_s is None else self.now_s
        if self.leapt_s:
            telemetry = _earlier(telemetry, self.leapt_s)
        attitude, heading = _timely(telemetry.attitude_t_s, now_s), _timely(telemetry.heading_t_s, now_s)
        height, velocity = _timely(telemetry.height_t_s, now_s), _timely(telemetry.velocity_t_s, now_s)
        parts = (
            ("roll", telemetry.roll_rad, attitude, _WIDEST_RAD),
            ("pitch", telemetry.pitch_rad, attitude, _WIDEST_RAD),
            ("heading", telemetry.heading_rad, heading, _WIDEST_RAD),
            ("height", telemetry.height_m, height, _HIGHEST_M),
            ("velocity", telemetry.velocity_in_level_mps, velocity, _FASTEST_MPS),
            ("battery", telemetry.battery_percent, True, 100.0),
            ("link", telemetry.link_percent, True, 100.0),
        )
        refused = [
            name for name, value, timely, limit in parts if value is not None and not (timely and _within(value, limit))
        ]
        if not refused and telemetry.t_s == now_s:
            return telemetry, ""
        admitted = replace(
            telemetry,
            t_s=now_s,
            roll_rad=None if "roll" in refused else telemetry.roll_rad,
            pitch_rad=None if "pitch" in refused else telemetry.pitch_rad,
            heading_rad=None if "heading" in refused else telemetry.heading_rad,
            height_m=None if "height" in refused else telemetry.height_m,
            velocity_in_level_mps=None if "velocity" in refused else telemetry.velocity_in_level_mps,
            battery_percent=None if "battery" in refused else telemetry.battery_percent,
            link_percent=None if "link" in refused else telemetry.link_percent,
            attitude_t_s=_past(telemetry.attitude_t_s, now_s),
            heading_t_s=_past(telemetry.heading_t_s, now_s),
            height_t_s=_past(telemetry.height_t_s, now_s),
            velocity_t_s=_past(telemetry.velocity_t_s, now_s),
        )
        return admitted, f"telemetry refused: {', '.join(refused)}" if refused else ""


def without_repeated(observation: Observation, before: Observation | None) -> Observation:
    """Without what is older than the one before, and without a pose of the same corners: the stream stands still.

    No two pictures of a camera have the same noise; a decoder that has lost its stream shows the last one again, with
    new time stamps, and the aircraft would seem to stand while it flies on.
    """
    if before is not None and observation.t_s < before.t_s:
        reason = "; ".join(filter(None, (observation.reason, "observation older than the last")))
        empty = replace(observation, bar_pose=None, bar_box=None, ship_box=None, deck=None)
        return replace(empty, t_s=before.t_s, reason=reason)
    pose, last = observation.bar_pose, None if before is None else before.bar_pose
    if pose is None or last is None or pose.corners_px.tobytes() != last.corners_px.tobytes():
        return observation
    return replace(observation, bar_pose=None, reason="picture repeated: the stream stands still")


def _earlier(telemetry: Telemetry, leapt_s: float) -> Telemetry:
    return replace(
        telemetry,
        t_s=telemetry.t_s - leapt_s,
        attitude_t_s=None if telemetry.attitude_t_s is None else telemetry.attitude_t_s - leapt_s,
        heading_t_s=None if telemetry.heading_t_s is None else telemetry.heading_t_s - leapt_s,
        height_t_s=None if telemetry.height_t_s is None else telemetry.height_t_s - leapt_s,
        velocity_t_s=None if telemetry.velocity_t_s is None else telemetry.velocity_t_s - leapt_s,
    )


def _timely(t_s: float | None, now_s: float) -> bool:
    return t_s is None or (math.isfinite(t_s) and -_AHEAD_S <= now_s - t_s <= _LEAP_S)


def _past(t_s: float | None, now_s: float) -> float | None:
    """A time stamp that may stand, without its value too where that is too old: it says that one was given once."""
    return t_s if t_s is not None and -_AHEAD_S <= now_s - t_s <= _OLDEST_S else None


def _plausible_gimbal(gimbal: GimbalAttitude) -> bool:
    return abs(gimbal.roll_rad) <= _STEEPEST_RAD and abs(gimbal.pitch_rad) <= _STEEPEST_RAD and abs(gimbal.yaw_rad) <= 7


def _old_gimbal(age_s: float) -> str:
    if math.isfinite(age_s):
        return f"gimbal attitude {age_s:.1f} s old"
    return "no gimbal attitude" if math.isinf(age_s) else "age of the gimbal attitude unknown"


def _plausible_pose(pose: BarPose) -> bool:
    return (
        _within(pose.position_in_bar_m, _FARTHEST_M)
        and abs(pose.yaw_rad) <= _WIDEST_RAD
        and _within(pose.covariance, _FARTHEST_M**2)
        and min(pose.covariance.diagonal().tolist()) >= 0.0
        and _within(pose.corners_px, 1e5)
    )


def _plausible_deck(deck: DeckSight) -> bool:
    return (
        _within(deck.centre_in_level_m, _HIGHEST_M)
        and _within(deck.deviation_m, _HIGHEST_M)
        and min(deck.deviation_m.tolist()) >= 0.0
        and (deck.normal_in_level is None or _within(deck.normal_in_level, 1.5))
    )


def _within(value: float | Array, limit: float) -> bool:
    """Whether no component is larger than a limit; what is no number is not within."""
    if isinstance(value, float):
        return abs(value) <= limit
    return all(map(limit.__ge__, map(abs, np.asarray(value).ravel().tolist())))


def _plausible_box(box: Box, camera: Camera) -> bool:
    return all(
        abs(centre - 0.5 * side) <= side and 0.0 < size <= 2.0 * side
        for centre, size, side in zip(box.centre_px, box.size_px, (camera.width_px, camera.height_px), strict=True)
    )
