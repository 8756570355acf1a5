"""An ArduPilot or PX4 vehicle over MAVLink, with a camera beside it.

Set-points leave at a steady rate from a thread of their own, whatever the loop does. Whoever takes the mode or the
sticks has the vehicle at once and keeps it: nothing here takes it back.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack

from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.guidance.response import Response
from shipland.messages import Frame, GroundTruth, Intent, PilotCommand, Telemetry, TouchdownVerdict
from shipland.stopping import sleep_or_stop, uninterrupted
from shipland.vehicles.camera_stream import CameraStream, Shot
from shipland.vehicles.checks import Check
from shipland.vehicles.mavlink.dialect import dialect
from shipland.vehicles.mavlink.parameters import (
    ARDUPILOT_NAMES,
    PX4_NAMES,
    VehicleLimits,
    response_within,
)
from shipland.vehicles.mavlink.session import FORCE, GUIDED_NOGPS, Session
from shipland.vehicles.mavlink.setpoints import HOLD, AttitudeTarget, Wanted, pressed, velocity_message, wanted_of
from shipland.vehicles.mavlink.setup import Engagement, MavlinkSetup, open_session
from shipland.vehicles.mavlink.state import PX4, AutopilotState
from shipland.vehicles.mavlink.telemetry import gimbal_at, telemetry_of
from shipland.vehicles.pace import Pace
from shipland.vehicles.touchdown import Contact, Touch, TouchdownWatch
from shipland.vehicles.vehicle import LONGEST_WAIT_S, unless_late

_REMEMBERED = 64
"""Given frames whose truth is kept."""
_VERDICT_S = 5.0
"""How long a simulated touchdown's verdict is waited for."""


class MavlinkVehicle:
    """A `Vehicle` on `time.monotonic`; a `Witness` where its camera is a simulator's.

    Args:
        setup: link, camera, parameters, and what it may do by itself.
    """

    def __init__(self, setup: MavlinkSetup) -> None:
        self._setup, self._parameters = setup, setup.parameters
        self._stack = ExitStack()
        self._session: Session | None = None
        self._stream: CameraStream | None = None
        self._pace: Pace | None = None
        self._lock = threading.Lock()
        self._command: tuple[PilotCommand, float] | None = None
        self._engaged = self._opening = self._closed = self._holding = self._taking_off = self._took_off = False
        self._end_reason = ""
        self._sticks_us: tuple[int, ...] = ()
        self._moved = 0
        self._last_exposed_s = self._pictured_s = -math.inf
        self._truths: dict[float, GroundTruth] = {}
        self._disarm_s, self._disarms, self._answers = -math.inf, 0, 0
        self._beat_s = self._gimbal_s = -math.inf
        self._response: Response | None = None
        self._limits: VehicleLimits | None = None

    # What the loop sees

    @property
    def camera(self) -> Camera:
        """Intrinsics of the pictures."""
        return self._setup.camera

    @property
    def end_reason(self) -> str:
        """Why the flight is over, in words; empty in flight."""
        return self._end_reason

    def response(self) -> Response:
        """What full sticks mean here; known once connected."""
        if self._response is None:
            raise VehicleError("connect to the vehicle first: its parameters say what full sticks mean")
        return self._response

    @property
    def session(self) -> Session:
        """The conversation; open once connected."""
        if self._session is None:
            raise VehicleError("the vehicle is not connected")
        return self._session

    @property
    def late_s(self) -> list[float]:
        """How late each set-point left [s]."""
        return [] if self._pace is None else list(self._pace.late_s)

    def connect(self) -> None:
        """Link, parameters and camera, without taking control; once is enough.

        Raises:
            VehicleError: something does not answer.
        """
        if self._session is not None:
            return
        parameters = self._parameters
        try:
            session = self._session = open_session(self._setup, self._on_state)
            self._stack.callback(session.link.close)
            session.connect(parameters.connect_timeout_s)
            autopilot = session.state.autopilot
            values = session.read_parameters(PX4_NAMES if autopilot == PX4 else ARDUPILOT_NAMES)
            limits = self._limits = VehicleLimits.of(autopilot, values)
            self._response = response_within(parameters, limits, autopilot, self._setup.response_table)
            hover = limits.hover_throttle or parameters.hover_throttle
            self._watch = TouchdownWatch(self._setup.touchdown, hover)
            self._press_mps = min(self._setup.touchdown.press_mps, limits.down_mps)
            self._tilts = None
            if self._response.kind == "attitude":
                self._tilts = AttitudeTarget(limits.climb_scale, session.target)
            stream = self._stream = CameraStream(self._setup.source)
            self._stack.callback(stream.close)
            stream.start()
            if stream.newest(-math.inf, self._setup.open_timeout_s) is None:
                raise VehicleError(f"no picture from the camera: {stream.problem or 'it keeps silent'}")
            pace = self._pace = Pace(self._tick, parameters.setpoint_hz, "mavlink-set-points", parameters.goes_first)
            self._stack.callback(pace.stop)
            pace.start()
        except BaseException:
            self._stack.close()
            raise

    def open(self) -> None:
        """Connect, and take the vehicle as far as that was allowed; VehicleError when it does not come to us."""
        if self._closed:
            raise VehicleError("this flight is over; make a new vehicle for the next one")
        self.connect()
        self._opening = True
        try:
            self._engage(self._setup.engagement)
        except BaseException:
            self.close()
            raise

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        """The newest picture not given, or none within `LONGEST_WAIT_S`; None when the flight is over."""
        stream = self._stream
        if stream is None or self._closed or not self._engaged:
            return None
        if not self._end_reason:
            until_s = time.monotonic() + LONGEST_WAIT_S
            shot = stream.newest(self._last_exposed_s, LONGEST_WAIT_S)
            if shot is not None:
                self._pictured_s = time.monotonic()
                return self._frame(shot), self.telemetry_at(self._pictured_s)
            judged = bool(stream.problem) and stream.verdict() is not None
            lost = time.monotonic() - self._pictured_s > self._parameters.video_timeout_s
            if not judged and not lost:
                time.sleep(max(0.0, until_s - time.monotonic()))  # a stream that has ended does not wait
                return None, self.telemetry_at(time.monotonic())
            words = stream.problem or f"no picture for {self._parameters.video_timeout_s:g} s"
            self._end(f"video lost: {words}; the vehicle holds", hold=True)
        if self._truths:  # a simulator's camera; it gives its verdict when the aircraft has come to rest
            until_s = time.monotonic() + _VERDICT_S
            while stream.verdict() is None and not stream.problem and time.monotonic() < until_s:
                time.sleep(0.05)
        return None

    def look(self, timeout_s: float) -> Frame | None:
        """The newest picture not given, without flying: only connected. None when none comes in time."""
        shot = None if self._stream is None else self._stream.newest(self._last_exposed_s, timeout_s)
        return None if shot is None else self._frame(shot)

    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest that has come, stamped with `t_s`."""
        return telemetry_of(self.session.state, t_s if math.isfinite(t_s) else time.monotonic())

    def send(self, command: PilotCommand) -> None:
        """The newest sticks; they leave with the next set-point."""
        with self._lock:
            now_s = time.monotonic()
            self._command = unless_late(command, now_s), now_s

    @uninterrupted()
    def close(self) -> None:
        """Leave the vehicle holding, where it is still ours, and let go of it; no signal cuts it short."""
        if self._closed:
            return
        self._closed = True
        with self._lock:
            self._command = None
        session = self._session
        if session is not None and (self._engaged or self._took_off):
            self._end("the flight was ended here; the vehicle holds", hold=True)
            if self._holding and session.is_ours(session.state):
                session.link.send(velocity_message(HOLD, session.target, int(1e3 * time.monotonic()) & 0xFFFFFFFF))
                session.ask_hold()
        self._stack.close()

    def truth_at(self, t_s: float) -> GroundTruth | None:
        """The truth of a frame that `read` gave, from a simulator's camera."""
        return self._truths.get(t_s)

    def verdict(self) -> TouchdownVerdict | None:
        """The touchdown, from a simulator's camera."""
        return None if self._stream is None else self._stream.verdict()

    def checks(self) -> list[Check]:
        """What of link, camera and vehicle is fit to fly; once connected."""
        from shipland.vehicles.mavlink.checks import link_checks

        assert self._limits is not None  # connected
        assert self._stream is not None
        lines = link_checks(self.session, self._stream, self._limits, self._setup, self.response())
        return [*lines, Check("pace", True, self._pace_words())]

    def _pace_words(self) -> str:
        """How steadily set-points can leave here."""
        assert self._pace is not None  # connected
        late_s = sorted(self._pace.late_s) or [0.0]
        words = f"99 % of the turns within {1e3 * late_s[int(0.99 * (len(late_s) - 1))]:.0f} ms of their time"
        return words if self._pace.preferred else f"{words}; among other processes: CAP_SYS_NICE puts them first"

    # Taking and losing the vehicle

    def _engage(self, engagement: Engagement) -> None:
        session, parameters = self.session, self._parameters
        if engagement.take or engagement.take_off_m > 0.0:
            # PX4 wants set-points before it gives OFFBOARD
            sleep_or_stop(1.0 if session.state.autopilot == PX4 else 0.0)
            self._insist(session.ask_guided, "the autopilot refuses its guided mode")
        session.wait(
            session.is_ours, parameters.engage_timeout_s, f"the mode was not given to us (it is {session.mode_name})"
        )
        if engagement.take_off_m > 0.0:
            self._take_off(engagement.take_off_m)
        elif not session.state.armed:
            raise VehicleError("the vehicle is not armed; arm it and take off, or ask for it: takeoff=METRES")
        self._sticks_us = session.state.sticks_us
        self._pictured_s = time.monotonic()
        self._engaged = True

    def _insist(self, ask: Callable[[], int], otherwise: str) -> None:
        """Ask every second until it is granted: an autopilot that has just booted refuses until it knows its place."""
        until_s = time.monotonic() + self._parameters.engage_timeout_s
        while (result := ask()) != 0:
            if time.monotonic() > until_s:
                said = "; ".join(self.session.state.texts[-3:])
                raise VehicleError(f"{otherwise} (MAV_RESULT {result}): {said}")
            sleep_or_stop(1.0)

    def _take_off(self, height_m: float) -> None:
        session = self.session
        if not session.state.armed:
            arm = dialect.MAV_CMD_COMPONENT_ARM_DISARM
            self._insist(lambda: session.ask(arm, 1, 0), "the autopilot does not arm")
        session.wait(lambda state: state.armed, 5.0, "the motors did not start")
        self._taking_off = self._took_off = True
        try:
            by_itself = session.state.autopilot != PX4
            if by_itself and session.ask(dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m) != 0:
                raise VehicleError(f"the autopilot does not take off: {'; '.join(session.state.texts[-3:])}")
            near_m = max(0.3, 0.1 * height_m)
            session.wait(lambda state: state.height_m > height_m - near_m, 30.0, "the take-off did not end")
        finally:
            self._taking_off = False

    def _end(self, reason: str, hold: bool = False) -> None:
        """No more frames; the first reason stands. With `hold`, set-points to hold go on until `close`."""
        if not self._end_reason:
            self._end_reason, self._holding = reason, hold
            with self._lock:
                self._command = None

    def _on_state(self, before: AutopilotState, after: AutopilotState) -> None:
        """Notice on the receiving thread that the vehicle is no longer ours."""
        if not self._engaged or self._end_reason:
            return
        session = self.session
        if after.reboots != before.reboots:
            self._end("the autopilot has restarted")
        elif not session.is_ours(after) and after.mode != before.mode:
            self._end(f"the pilot took over: {session.mode_name}")
        elif before.armed and not after.armed:
            landed = self._landing()
            self._end("landed: the motors have stopped" if landed else "the motors have stopped")
        elif self._sticks_us and after.sticks_us and after.sticks_us is not before.sticks_us:
            off_us = [abs(now - then) for now, then in zip(after.sticks_us, self._sticks_us, strict=True)]
            moved = max(off_us) > self._parameters.stick_takeover_us
            self._moved = self._moved + 1 if moved else 0
            if self._moved >= 2:
                self._end("the pilot moved the sticks")
                session.hand_over()

    # The thread of the set-points

    def _landing(self) -> bool:
        with self._lock:
            return self._command is not None and self._command[0].intent is Intent.LAND

    def _tick(self, step_s: float) -> None:
        session, now_s = self.session, time.monotonic()
        boot_ms = int(1e3 * now_s) & 0xFFFFFFFF
        if now_s - self._beat_s >= 1.0:
            self._beat_s = now_s
            session.beat()
        state = session.state
        if self._engaged and not self._end_reason and now_s - state.heartbeat_s > self._parameters.link_timeout_s:
            self._end(f"link lost: no heartbeat for {self._parameters.link_timeout_s:g} s")
        if self._taking_off:
            if state.autopilot == PX4:  # its own take-off would leave OFFBOARD
                climb = Wanted(0.0, 0.0, self.response().max_climb_mps, 0.0)
                self._set_point(climb, state, step_s, boot_ms)
            return
        if not self._may_command():
            return
        with self._lock:
            command = self._command
        stale = command is None or now_s - command[1] > self._parameters.stale_s
        wanted = HOLD if command is None or stale else wanted_of(command[0], self.response())
        if self._engaged and not self._end_reason:
            landing = command is not None and not stale and command[0].intent is Intent.LAND
            contact = self._look_for_touchdown(landing, state, now_s)
            if contact is not Contact.NONE:
                wanted = pressed(self.response(), state.velocity_in_level_mps, self._press_mps)
        self._set_point(wanted, state, step_s, boot_ms)
        if command is not None and not stale:
            self._turn_gimbal(command[0].gimbal_pitch_rad, now_s)

    def _may_command(self) -> bool:
        """Whether set-points may leave: ours and not over; a PX4 wants them before it is ours."""
        if self._end_reason:
            return self._holding and self.session.is_ours(self.session.state)
        return self._engaged or (self.session.state.autopilot == PX4 and self._opening)

    def _set_point(self, wanted: Wanted, state: AutopilotState, step_s: float, boot_ms: int) -> None:
        session = self.session
        by_speed = wanted.hold and state.mode != GUIDED_NOGPS
        if self._tilts is None or by_speed or not math.isfinite(state.heading_rad):
            if self._tilts is not None:
                self._tilts.rest()
            session.link.send(velocity_message(wanted, session.target, boot_ms))
        else:
            session.link.send(self._tilts.message(wanted, state.heading_rad, step_s, boot_ms))

    def _turn_gimbal(self, pitch_rad: float, now_s: float) -> None:
        if not math.isfinite(pitch_rad) or now_s - self._gimbal_s < 1.0 / self._parameters.gimbal_hz:
            return
        self._gimbal_s = now_s
        target, nan = self.session.target, math.nan
        # roll and pitch against the horizon, yaw with the aircraft
        self.session.link.send(
            dialect.MAVLink_gimbal_manager_set_pitchyaw_message(
                target.system, target.component, 4 | 8, 0, pitch_rad, 0.0, nan, nan
            )
        )

    def _look_for_touchdown(self, landing: bool, state: AutopilotState, now_s: float) -> Contact:
        """Whether it has touched the deck; where it stands, ask for the motors to stop."""
        touch = Touch(
            t_s=now_s,
            landing=landing and state.armed,
            throttle=0.01 * state.throttle_percent,
            throttle_t_s=state.throttle_t_s,
            down_mps=state.velocity_in_ned_mps[2],
            down_t_s=state.velocity_t_s,
            range_m=state.range_m,
        )
        contact = self._watch.see(touch)
        if contact is Contact.STANDS and state.armed:
            self._disarm(state, now_s)
        elif contact is Contact.NONE:
            self._disarms = 0  # it was none: the next one is asked for politely again
        return contact

    def _disarm(self, state: AutopilotState, now_s: float) -> None:
        """Ask politely; by force as soon as that was denied, or was not obeyed for a while."""
        number = dialect.MAV_CMD_COMPONENT_ARM_DISARM
        result, answers = state.acknowledged.get(number, (0, 0))
        done = (dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_IN_PROGRESS)
        denied = self._disarms == 1 and answers > self._answers and result not in done
        if self._disarms > 0 and not denied and now_s - self._disarm_s < self._parameters.disarm_retry_s:
            return
        self._disarm_s, self._answers = now_s, answers
        self._disarms += 1
        force = FORCE if self._disarms > 1 and self._parameters.force_disarm else 0
        self.session.command(number, 0, force)

    def _frame(self, shot: Shot) -> Frame:
        self._last_exposed_s = shot.exposed_s
        if shot.truth is not None:
            self._truths[shot.exposed_s] = shot.truth
            for stamp_s in list(self._truths)[:-_REMEMBERED]:
                del self._truths[stamp_s]
        session = self.session
        gimbal = shot.gimbal or gimbal_at(
            shot.exposed_s, session.attitudes, session.mounts, self._setup.fixed_pitch_rad
        )
        return Frame(shot.exposed_s, shot.image, gimbal)
