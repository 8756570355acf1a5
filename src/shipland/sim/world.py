"""The simulated world: one aircraft, one ship, the wind; stepped on a fixed grid, deterministic for a seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from shipland.camera import CameraParameters
from shipland.config import require
from shipland.messages import GimbalAttitude, GroundTruth, Intent, PilotCommand, Telemetry, TouchdownVerdict
from shipland.rig import Rig
from shipland.sim.air.wind import Wind
from shipland.sim.aircraft.aerodynamics import euler_from_quaternion, rows_from_quaternion, trim_hover
from shipland.sim.aircraft.inner_loop import CENTRED, InnerLoop, Sensed, Sticks
from shipland.sim.aircraft.parameters import GRAVITY_MPS2, AircraftParameters, Vector
from shipland.sim.aircraft.sensors import Coloured, Gimbal, Instruments, Normals
from shipland.sim.contact.body import Body, Motion
from shipland.sim.contact.deck_drive import Stage, against_deck, deck_state
from shipland.sim.contact.model import build_model
from shipland.sim.contact.touchdown import NO_TOUCH, Judge, OnDeck, VerdictParameters
from shipland.sim.ship.ship import Ship, ShipState
from shipland.sim.snapshot import Snapshot, scene_of, truth_of
from shipland.sim.state import SceneState

STEP_S = 0.002
"""Physics step: what MuJoCo's contacts want."""
CONTROL_EVERY = 2
"""Physics steps between updates of the inner loop (250 Hz)."""
AIR_EVERY = 10
"""Physics steps between samples of the wind (50 Hz), and of a ship far away."""
NEAR_DECK_M = 2.0
"""From the deck's centre: nearer, the deck is set every physics step and contacts are judged."""
NEAR_SHIP_M = 6.0
"""From the deck's centre: nearer, the ship is set every control step."""
CUT_OFF_RAD = math.radians(75.0)
"""Tilt at which the motors stop, as a crash detector does."""
IMPACT_MPS2 = 0.3 * GRAVITY_MPS2
"""Upward jerk of the vertical speed that counts as a felt impact."""
STILL_MPS = 0.05
"""Closing slower than this, the downward range says that the descent has ended."""


@dataclass(frozen=True)
class StartParameters:
    """Where a flight begins, against the ship at t = 0 (`[start]`); each value plus a uniform spread either side.

    Attributes:
        distance_m, distance_spread_m: over ground from the deck's centre.
        bearing_deg, bearing_spread_deg: off the axis straight astern, positive to starboard.
        height_m, height_spread_m: above the neutral deck.
        heading_error_deg, heading_error_spread_deg: of the nose, off the deck's centre, clockwise positive.
    """

    distance_m: float
    distance_spread_m: float
    bearing_deg: float
    bearing_spread_deg: float
    height_m: float
    height_spread_m: float
    heading_error_deg: float
    heading_error_spread_deg: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require("spread" not in name or value >= 0.0, f"{name} must not be negative, got {value}")
        require(self.distance_m >= self.distance_spread_m, "distance_m must not be below distance_spread_m")
        require(
            self.height_m > self.height_spread_m, "height_m must be above height_spread_m: flights start above deck"
        )


class World:
    """Steps the physics and says what is true, what is seen and what is measured.

    Time runs on a grid of `STEP_S`; `advance` goes to the last grid instant not after the time asked for, and every
    instant of the result belongs to that grid time. The flight does not depend on how `advance` is cut up, nor on
    how often truth, scene or telemetry are asked for.

    Args:
        rig: the ship platform's dimensions.
        camera_parameters: the gimbal's rate, range and residual motion, and where the camera sits.
        aircraft: the aircraft.
        verdict: limits of a landing.
        ship: motion of the ship.
        wind: the air; asked at non-decreasing times only.
        start: where the flight begins.
        rng: seeds the start, the sensors and the gimbal.
    """

    def __init__(
        self,
        rig: Rig,
        camera_parameters: CameraParameters,
        aircraft: AircraftParameters,
        verdict: VerdictParameters,
        ship: Ship,
        wind: Wind,
        start: StartParameters,
        rng: np.random.Generator,
    ) -> None:
        self._camera, self._aircraft, self._ship, self._wind = camera_parameters, aircraft, ship, wind
        start_rng, loop_rng, instrument_rng = rng.spawn(3)
        model = build_model(rig, aircraft.airframe, STEP_S)
        self._mj_model, self._data = model.mj, mujoco.MjData(model.mj)
        self._body = Body(rig, aircraft.airframe, model, self._data)
        self._stage = Stage(model, self._data)
        self._judge = Judge(verdict, rig.landing_square_m)
        self._instruments = Instruments(aircraft.sensors, instrument_rng)
        self._steps = 0
        self._motors_run = True
        self._reach_m = self._range_m = math.inf
        self._landed_for_s, self._impact, self._down_mps = 0.0, False, 0.0
        self._sticks, self._land, self._command_s, self._gimbal_wanted_rad = CENTRED, False, -math.inf, 0.0

        position_m, heading_rad = self._draw_start(start, start_rng)
        self._sample_air(self._set_ship(hull=True), position_m)
        trim = trim_hover(aircraft.airframe, self._wind_mps, heading_rad)
        self._body.put(position_m, trim.roll_rad, trim.pitch_rad, heading_rad, trim.thrust_n)

        sensors, normals = aircraft.sensors, Normals(loop_rng)
        self._tick_s = CONTROL_EVERY * STEP_S
        noise = (sensors.velocity_noise_mps, sensors.velocity_noise_time_s, self._tick_s, normals)
        self._velocity_errors = [Coloured(*noise) for _ in range(3)]
        self._place_error_m = [0.0, 0.0]
        self._gimbal = Gimbal(camera_parameters, sensors, self._tick_s, normals)
        self._loop = InnerLoop(aircraft, self._tick_s, self._sense(self._body.motion()), trim)

    def _draw_start(self, start: StartParameters, rng: np.random.Generator) -> tuple[Vector, float]:
        """Position in `ned` and heading."""
        table = np.array(list(vars(start).values())).reshape(4, 2)
        drawn = table[:, 0] + table[:, 1] * rng.uniform(-1.0, 1.0, 4)
        distance_m, bearing_deg, height_m, error_deg = drawn.tolist()
        bearing_rad = math.radians(bearing_deg)
        in_ship_m = np.array([-distance_m * math.cos(bearing_rad), distance_m * math.sin(bearing_rad), -height_m])
        state = self._ship.at(0.0)
        north, east, down = state.ned_from_ship.apply(in_ship_m).tolist()
        return (north, east, down), state.course.course_rad - bearing_rad + math.radians(error_deg)

    @property
    def t_s(self) -> float:
        """Time of the state [s]."""
        return self._steps * STEP_S

    @property
    def frame_rate_hz(self) -> float:
        """Pictures a second of the camera on board."""
        return self._camera.frame_rate_hz

    @property
    def step_s(self) -> float:
        """Step of the time grid [s]."""
        return STEP_S

    def command(self, command: PilotCommand) -> None:
        """Take the sticks from now on; values beyond ±100 % are clipped, those that are no numbers are zero."""
        step = self._aircraft.settings.stick_step_percent
        percents = (command.pitch_percent, command.roll_percent, command.heave_percent, command.yaw_percent)
        self._sticks = Sticks(*(_stick(percent, step) for percent in percents))
        self._land = command.intent is Intent.LAND
        if math.isfinite(command.gimbal_pitch_rad):
            self._gimbal_wanted_rad = command.gimbal_pitch_rad
        self._command_s = self.t_s

    def advance(self, to_t_s: float) -> None:
        """Step to the last grid instant not after `to_t_s` [s]; an earlier time does nothing."""
        end = math.floor(to_t_s / STEP_S + 1e-6)
        while self._steps < end:
            phase = self._steps % CONTROL_EVERY
            if phase == 0:
                self._control()
            count = min(CONTROL_EVERY - phase, end - self._steps)
            if self._reach_m < NEAR_DECK_M:
                if phase:
                    self._set_ship(hull=False)
                if self._judge.verdict is None and (phase == 0 or self._body.in_contact):
                    self._judge_now()
                count = 1
            mujoco.mj_step(self._mj_model, self._data, count)
            self._steps += count
            self._look_for_crash()

    def _control(self) -> None:
        motion = self._body.motion()
        self._reach_m = math.dist(motion.position_m, self._deck.origin_m)
        if self._steps % AIR_EVERY == 0:
            self._sample_air(self._set_ship(hull=self._reach_m < NEAR_SHIP_M), motion.position_m)
        elif self._reach_m < NEAR_SHIP_M:
            self._set_ship(hull=True)
        self._gimbal.step(self._gimbal_wanted_rad)
        if self._motors_run:
            fresh = self.t_s - self._command_s < self._aircraft.settings.command_timeout_s - 1e-9
            self._body.ask(self._loop.update(self._sense(motion), self._sticks if fresh else CENTRED))
            self._feel_deck(motion, self._land and fresh)
            if _upright(motion) < math.cos(CUT_OFF_RAD):
                self._stop_motors()
        over_deck = self._aircraft.airframe.ground_effect and self._reach_m < NEAR_DECK_M
        self._body.apply_air(motion, self._wind_mps, self._deck if over_deck else None)

    def _set_ship(self, hull: bool) -> ShipState:
        state = self._ship.at(self.t_s)
        self._deck = deck_state(state)
        self._stage.set_deck(self._deck)
        if hull:
            self._stage.set_hull(state, self._deck)
        return state

    def _sample_air(self, state: ShipState, position_m: Vector) -> None:
        wind = self._wind.velocity_at(self.t_s, np.array(position_m), state.ned_from_ship)
        self._wind_mps: Vector = (float(wind[0]), float(wind[1]), float(wind[2]))

    def _sense(self, motion: Motion) -> Sensed:
        """The motion as the aircraft believes it: its place strays by the integral of its velocity's error."""
        u, v, w = (error.step() for error in self._velocity_errors)
        stray_m = self._place_error_m
        stray_m[0] += u * self._tick_s
        stray_m[1] += v * self._tick_s
        north, east, down = motion.position_m
        v_north, v_east, v_down = motion.velocity_mps
        return Sensed(
            north + stray_m[0],
            east + stray_m[1],
            down,
            v_north + u,
            v_east + v,
            v_down + w,
            *euler_from_quaternion(motion.quaternion),
            *motion.rates_rad_s,
        )

    def _feel_deck(self, motion: Motion, landing: bool) -> None:
        """Stop the motors once the downward range says landed and an impact was felt or the descent has ended."""
        jolt_mps2 = (self._down_mps - motion.velocity_mps[2]) / self._tick_s
        self._down_mps = motion.velocity_mps[2]
        near = landing and self._reach_m < NEAR_DECK_M
        before_m, self._range_m = self._range_m, self._body.range_m(motion, self._deck) if near else math.inf
        if self._range_m > self._aircraft.loop.land_range_m:
            self._landed_for_s, self._impact = 0.0, False
            return
        self._impact = self._impact or jolt_mps2 > IMPACT_MPS2
        ended = (before_m - self._range_m) / self._tick_s < STILL_MPS
        self._landed_for_s = self._landed_for_s + self._tick_s if self._impact or ended else 0.0
        if self._landed_for_s >= self._aircraft.loop.land_confirm_s:
            self._stop_motors()

    def _stop_motors(self) -> None:
        self._motors_run = False
        self._body.ask((0.0, 0.0, 0.0, 0.0))

    def _on_deck(self) -> OnDeck:
        motion = self._body.motion()
        rows = rows_from_quaternion(*motion.quaternion)
        return against_deck(self._deck, motion.position_m, motion.velocity_mps, (rows[2], rows[5], rows[8]))

    def _judge_now(self) -> None:
        """Show the judge the last step's contacts."""
        touch = self._body.touch() if self._body.in_contact else NO_TOUCH
        self._judge.follow(self.t_s, self._on_deck(), touch, self._motors_run)
        if touch.fault:
            self._stop_motors()

    def _look_for_crash(self) -> None:
        """Faults away from the deck: the sea, and the ship's far end."""
        if self._body.down_m > -self._aircraft.airframe.foot_below_m:
            self._crash("fell into the sea")
        elif self._body.in_contact and self._reach_m >= NEAR_DECK_M:
            self._crash(self._body.touch().fault)

    def _crash(self, fault: str) -> None:
        if fault:
            self._judge.crash(self.t_s, self._on_deck(), fault)
            self._stop_motors()

    def verdict(self) -> TouchdownVerdict | None:
        """The verdict once the aircraft rests on the deck or has crashed, None before."""
        return self._judge.verdict

    def over(self) -> bool:
        """Whether there is a verdict."""
        return self._judge.verdict is not None

    def gimbal(self) -> GimbalAttitude:
        """The camera's attitude in `level` as the vehicle reports it: without the residual motion."""
        return self.snapshot().reported_gimbal

    def telemetry(self) -> Telemetry:
        """What the vehicle says of itself now, with its errors."""
        motion = self._body.motion()
        attitude = euler_from_quaternion(motion.quaternion)
        u, v, w = (motion.velocity_mps[i] + self._velocity_errors[i].value for i in range(3))
        c, s = math.cos(attitude[2]), math.sin(attitude[2])
        return self._instruments.telemetry(
            self.t_s,
            attitude,
            -motion.position_m[2],
            (c * u + s * v, c * v - s * u, w),
            math.dist(motion.position_m, self._deck.origin_m),
            self._motors_run,
        )

    def snapshot(self) -> Snapshot:
        """The instant in a few floats; `truth` and `scene_state` make the rest of it, when it is wanted."""
        motion, gimbal = self._body.motion(), self._gimbal
        return Snapshot(
            self.t_s,
            *motion,
            gimbal.pitch_rad,
            gimbal.pitch_rate_rad_s,
            (gimbal.roll_error_rad, gimbal.pitch_error_rad),
            self._wind_mps,
        )

    def truth(self, snapshot: Snapshot | None = None) -> GroundTruth:
        """The truth of now, or of a snapshot."""
        at = snapshot or self.snapshot()
        return truth_of(at, self._ship.at(at.t_s), self._camera)

    def scene_state(self, snapshot: Snapshot | None = None) -> SceneState:
        """What the camera sees now, or at a snapshot."""
        at = snapshot or self.snapshot()
        return scene_of(at, self._ship.at(at.t_s), self._camera)


def _upright(motion: Motion) -> float:
    """Cosine of the tilt."""
    _, x, y, _ = motion.quaternion
    return 1.0 - 2.0 * (x * x + y * y)


def _stick(percent: float, step_percent: float) -> float:
    if not math.isfinite(percent):
        return 0.0
    percent = min(max(percent, -100.0), 100.0)
    if step_percent > 0.0:
        percent = step_percent * round(percent / step_percent)
    return 0.01 * percent
