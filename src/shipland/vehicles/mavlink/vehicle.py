"""An ArduPilot or PX4 vehicle over MAVLink, with a camera beside it.

Whoever takes the mode or the sticks has the vehicle at once and keeps it. See `control`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

from shipland.camera import Camera
from shipland.errors import VehicleError
from shipland.frames import Array
from shipland.guidance.response import Response
from shipland.messages import FlightRecord, GimbalAttitude, Intent, Observation, Telemetry
from shipland.rig import Rig
from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.checks import Check
from shipland.vehicles.gimbal import gimbal_at
from shipland.vehicles.mavlink.control import Control
from shipland.vehicles.mavlink.dialect import AUTOPILOT, dialect
from shipland.vehicles.mavlink.guard import ASK_TIME_S
from shipland.vehicles.mavlink.modes import GUIDED_NOGPS, modes_of, obeys_us
from shipland.vehicles.mavlink.motors import MotorStop
from shipland.vehicles.mavlink.parameters import (
    ARDUPILOT_NAMES,
    PX4_NAMES,
    MavlinkParameters,
    VehicleLimits,
    changed_parameters,
    missing_parameters,
    response_within,
)
from shipland.vehicles.mavlink.publish import Mounting, tell
from shipland.vehicles.mavlink.session import HAND_OVERS, PATIENT_HAND_OVERS, Session
from shipland.vehicles.mavlink.setpoints import attitude_message, velocity_message
from shipland.vehicles.mavlink.setup import MavlinkSetup, open_session
from shipland.vehicles.mavlink.state import PX4, AutopilotState
from shipland.vehicles.mavlink.taking import Taking
from shipland.vehicles.mavlink.telemetry import telemetry_of
from shipland.vehicles.setpoint_vehicle import SetpointVehicle
from shipland.vehicles.touchdown import MOTORS_STOPPED, GroundContact, motors_stopped
from shipland.vehicles.vehicle import Vehicle
from shipland.vehicles.wanted import HOLD, Wanted, pressed, thrust_of, wanted_of

_HEIGHT_S = 1.0
"""A take-off of ours does not climb on a height older than this."""
_ASK_HEARTBEAT_S = 0.15
"""Age at which a heartbeat is requested: a PX4 says one a second and no more, and only a fresh one shows the mode."""
_NEXT_HEARTBEAT_S = 0.5
"""Timeout of the heartbeat after one that says disarmed; it is requested."""
_HAND_OVER_S = 0.5
"""From one request for a mode to the next."""
_GRANTED_S = 2.0
"""A mode that we asked for may still be given for so long."""


class MavlinkVehicle(SetpointVehicle):
    """An autopilot that is flown by MAVLink set-points."""

    _parameters: MavlinkParameters

    def __init__(self, setup: MavlinkSetup) -> None:
        super().__init__(setup.parameters)
        self._setup = setup
        self._session: Session | None = None
        self._control = Control(self._parameters.stick_takeover_us, self._parameters.kind == "velocity")
        self._opening = self._lands = False
        self._hand_overs, self._handed_s, self._handed_answers = 0, -math.inf, 0
        self._beat_s = self._asked_s = self._asked_heartbeat_s = -math.inf
        self._response: Response | None = None
        self._told: Mapping[str, float] = {}
        self._mounting: Mounting | None = None

    # What the loop sees

    @property
    def camera(self) -> Camera:
        """Intrinsics of the pictures."""
        return self._setup.camera

    @property
    def in_command(self) -> str:
        """Who flies: `shipland`, `the pilot (MODE)`, `the autopilot` after the end, or `nobody: WHY`."""
        return "nobody: not connected" if self._session is None else self._control.holder(self._session.state)

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

    def _connect(self) -> None:
        parameters = self._parameters
        session = self._session = open_session(self._setup, self._on_state)
        self._stack.callback(session.link.close)
        session.connect(parameters.connect_timeout_s)
        autopilot = session.state.autopilot
        values = session.read_parameters(
            PX4_NAMES if autopilot == PX4 else ARDUPILOT_NAMES,
            lambda found: not missing_parameters(autopilot, found),
        )
        limits = self._limits = VehicleLimits.of(autopilot, values)
        self._told = values
        self._response = response_within(parameters, limits, autopilot, self._setup.response_table)
        hover = limits.hover_throttle or parameters.hover_throttle
        climb_mps = self._response.max_climb_mps
        self._taking = Taking(session, self._control, parameters, climb_mps, self._ended)
        self._motors = MotorStop(session, parameters, self._setup.touchdown, hover)
        self._press_mps = min(self._setup.touchdown.press_mps, limits.down_mps)
        hz, gap_s, silence_s = parameters.setpoint_hz, parameters.setpoint_gap_s, parameters.link_timeout_s
        session.link.port.watch(session.guard_orders(hz, gap_s, silence_s))
        self._start_stream(self._setup.source)
        self._await_picture(self._setup.open_timeout_s, "it keeps silent")
        self._stack.callback(session.link.port.watch, None)  # once the set-points have stopped
        self._start_set_points("mavlink-set-points", parameters.goes_first)

    def _ended(self) -> str:
        """Why no flight may begin any more; after a suspension who has the vehicle is not known."""
        return self._end_reason or self._suspended or ("the flight was ended here" if self._closed else "")

    def _engage(self) -> None:
        self._opening = True
        self._taking.run(self._setup.engagement)
        self._begin()

    def telemetry_at(self, t_s: float) -> Telemetry:
        """The newest that has come, stamped with `t_s`."""
        return telemetry_of(self.session.state, t_s if math.isfinite(t_s) else time.monotonic())

    def _leave(self) -> None:
        with self._lock:
            self._command = None
        session = self._session
        if session is not None and self._control.granted:
            self._end("the flight was ended here; the vehicle holds")
            if self._control.over and not session.state.armed:
                self._await_heartbeat(session)
            if self._control.answers_for(session.state):
                self._control.released = True
                self._set_point(HOLD, session.state, 0.0, int(1e3 * time.monotonic()) & 0xFFFFFFFF)
                session.ask_hold(self._control.answers_for)
            until_s = time.monotonic() + (HAND_OVERS + 1) * _HAND_OVER_S
            while self._control.by_sticks and time.monotonic() < until_s:
                time.sleep(0.02)  # the set-points' thread is asking for a mode that obeys the pilot
        if session is not None:
            session.give_gimbal_back()

    def _await_heartbeat(self, session: Session) -> None:
        """One that says disarmed may be another vehicle's, with the same id; the next tells whether ours flies on."""
        said_s, until_s = session.state.heartbeat_s, time.monotonic() + _NEXT_HEARTBEAT_S
        while session.state.heartbeat_s == said_s and time.monotonic() < until_s:
            time.sleep(0.02)

    def checks(self) -> list[Check]:
        """What of link, camera and vehicle is fit to fly; once connected."""
        from shipland.vehicles.mavlink.checks import link_checks

        assert self._stream is not None and self._pace is not None  # connected
        lines = link_checks(self.session, self._stream, self._limits, self._setup, self.response())
        late_s = sorted(self._pace.late_s) or [0.0]
        words = f"99 % of the turns within {1e3 * late_s[int(0.99 * (len(late_s) - 1))]:.0f} ms of their time"
        if not self._pace.preferred:
            words += "; among other processes: CAP_SYS_NICE puts them first"
        return [*lines, Check("pace", True, words)]

    def inform_of(self, rig: Rig, camera_in_body_m: Array) -> None:
        """What it is told of where it lands by itself."""
        self._mounting = Mounting(camera_in_body_m, rig.deck_in_bar_m)

    def inform(self, record: FlightRecord) -> None:
        """The landing target, to an autopilot that is to land by itself; a person's key ends that in a hold."""
        if self._setup.engagement.own_landing:
            override = record.decision.override
            if override is not None and self._control.lands(self.session.state):
                self._end(f"the autopilot's own landing is ended, {override.value}; the vehicle holds")
            self.tell(record.observation)

    def tell(self, observation: Observation, with_position: bool = False) -> bool:
        """Send the landing target, and the position estimate if asked for; whether there was anything to send.

        Raises:
            VehicleError: the link's guard has gone, and nothing reaches the autopilot any more.
        """
        if problem := self.session.link.port.problem:
            raise VehicleError(problem)
        return self._mounting is not None and tell(self.session, observation, self._mounting, with_position)

    # Taking and losing the vehicle

    def _gimbal_at(self, t_s: float) -> tuple[GimbalAttitude, float]:
        session = self.session
        return gimbal_at(t_s, session.attitudes, session.mounts, self._setup.fixed_pitch_rad)

    def _end(self, reason: str) -> None:
        """No more frames; the first reason stands. Where control is still ours, set-points to hold go on."""
        port = self.session.link.port
        if self._control.lost:
            port.watch(None)  # silence is meant from now on
        if not self._end_reason:
            self._end_reason = "; ".join(filter(None, (reason, port.problem)))
            with self._lock:
                self._command = None

    def _on_state(self, before: AutopilotState, after: AutopilotState) -> None:
        """Notice on the receiving thread that the vehicle is no longer ours, or obeys us otherwise than it told."""
        self._control.see(before, after)
        if over := self._control.over or self._control.lost:
            self._end(motors_stopped(self._landing()) if over == MOTORS_STOPPED else over)
        if after.parameters is not before.parameters and (
            changed := changed_parameters(after.autopilot, self._told, after.parameters)
        ):
            self._end(f"what sticks mean was changed ({changed}); the vehicle holds")

    # The thread of the set-points

    def _landing(self) -> bool:
        with self._lock:
            wanted = self._command is not None and self._command[0].intent is Intent.LAND
        return wanted or self._control.hands_over

    def _tick(self, step_s: float) -> None:
        session, control, now_s = self.session, self._control, time.monotonic()
        boot_ms = int(1e3 * now_s) & 0xFFFFFFFF
        if now_s - self._beat_s >= 1.0:
            self._beat_s = now_s
            session.beat()
        if now_s - self._asked_s >= ASK_TIME_S:
            self._asked_s = now_s
            session.ask_time()
            session.ask_stream()
        if session.link.port.problem:
            self._end("")
        state = session.state
        if not now_s - max(state.heartbeat_s, self._asked_heartbeat_s) < _ASK_HEARTBEAT_S:
            self._asked_heartbeat_s = now_s
            session.ask_heartbeat()
        if step_s > self._parameters.setpoint_gap_s:
            session.awake_s = now_s
        unheard_s = now_s - max(state.heartbeat_s, session.awake_s)
        if self._opening and unheard_s > self._parameters.link_timeout_s:
            # it may still hear: holds go on until we close, and are better than the last tilt
            self._end(f"link lost: no heartbeat for {self._parameters.link_timeout_s:g} s")
        if control.by_sticks:
            self._hand_over(state, now_s)
        if control.lands(state):
            newest = self._newest(now_s)
            if not (self._lands or (newest is not None and newest.intent is Intent.LAND)):
                self._end("the autopilot began its own landing when that was not wanted any more; the vehicle holds")
            self._lands = True
            self._aim(newest, now_s)
        if not self._may_command(state):
            return
        if not self._engaged:
            climbs = self._taking.climbing and now_s - state.height_t_s <= _HEIGHT_S
            climb = Wanted(0.0, 0.0, self.response().max_climb_mps, 0.0)
            self._set_point(climb if climbs else HOLD, state, step_s, boot_ms)
            return
        newest = self._newest(now_s)
        wanted = HOLD if newest is None else wanted_of(newest, self.response())
        if not self._end_reason and self._motors.look(newest, state, now_s) is not GroundContact.NONE:
            wanted = pressed(self.response(), state.velocity_in_level_mps, self._press_mps)
        self._set_point(wanted, state, step_s, boot_ms)
        self._aim(newest, now_s)
        if self._setup.engagement.own_landing:
            self._let_it_land(newest is not None and newest.intent is Intent.LAND, state, now_s)

    def _hand_over(self, state: AutopilotState, now_s: float) -> None:
        """Ask for a mode that obeys the pilot's sticks, until it has one; what is chosen after that is left alone."""
        if not (obeys_us(state) or self._control.lands(state)):
            self._control.by_sticks = False
            return
        attempt, asked = self._hand_overs, dialect.MAV_CMD_DO_SET_MODE
        if 0 < attempt < HAND_OVERS and state.denied(asked, self._handed_answers):
            attempt += -attempt % PATIENT_HAND_OVERS  # the next mode, without waiting
        due = attempt > self._hand_overs or now_s - self._handed_s > _HAND_OVER_S
        if due and self.session.hand_over(attempt):
            self._handed_s, self._hand_overs, self._handed_answers = now_s, attempt + 1, state.answers(asked)

    def _may_command(self, state: AutopilotState) -> bool:
        """Whether set-points may leave: control is ours now.

        A PX4 wants them before it gives OFFBOARD, and to climb, for its own take-off would leave OFFBOARD. In an
        OFFBOARD that was not given to us they may be another's; in forward flight none is wanted.
        """
        if state.autopilot == PX4 and self._opening and not (self._control.granted or self._end_reason):
            return self._control.asking or not (obeys_us(state) or state.forward)
        return self._control.has(state) and (self._engaged or state.autopilot == PX4)

    def _set_point(self, wanted: Wanted, state: AutopilotState, step_s: float, boot_ms: int) -> None:
        link, limits = self.session.link, self._limits
        by_speed = self.response().kind == "velocity" or (wanted.hold and state.mode != GUIDED_NOGPS)
        if by_speed or not math.isfinite(state.heading_rad):
            self._heading.rest()
            link.send(velocity_message(wanted, link.vehicle, boot_ms))
            return
        to_rad = self._heading.next_rad(wanted.turn_rad_s, state.heading_rad, step_s)
        thrust = thrust_of(wanted.climb_mps, limits.up_mps, limits.down_mps)
        link.send(attitude_message(wanted, to_rad, thrust, link.vehicle, boot_ms))

    def _let_it_land(self, landing: bool, state: AutopilotState, now_s: float) -> None:
        """Ask for the autopilot's own landing while the pilot lands; until it is given, the pilot's goes on."""
        if not landing:
            self._control.hands_over &= now_s - self._handed_s <= _GRANTED_S
            return
        asked = dialect.MAV_CMD_DO_SET_MODE, 1, *modes_of(state).landing
        if now_s - self._handed_s > _HAND_OVER_S:
            before, self._control.hands_over = self._control.hands_over, True  # before the answer can come
            if self.session.command(*asked):
                self._handed_s = now_s
            else:
                self._control.hands_over = before

    def _turn_camera(self, pitch_rad: float) -> None:
        link, nan = self.session.link, math.nan
        # roll and pitch against the horizon, yaw with the aircraft
        link.send(
            dialect.MAVLink_gimbal_manager_set_pitchyaw_message(
                link.vehicle, AUTOPILOT, 4 | 8, 0, pitch_rad, 0.0, nan, nan
            )
        )


def mavlink(setup: VehicleSetup) -> Vehicle:
    """`mavlink://udp:127.0.0.1:14550?camera=rtsp://…`; options: `setup.OPTIONS`."""
    return MavlinkVehicle(MavlinkSetup.of(setup))
