"""The simulated world: one aircraft, one ship, the wind; stepped on a fixed grid, deterministic for a seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.camera import CameraParameters
from shipland.config import key, parameters, require
from shipland.factories import resolve
from shipland.frames import GRAVITY_MPS2
from shipland.messages import GroundTruth, Intent, PilotCommand, TouchdownVerdict
from shipland.rig import Rig
from shipland.sim.aircraft.aircraft import Aircraft, Quadrotor
from shipland.sim.aircraft.loops import CENTRED, Sticks
from shipland.sim.aircraft.parameters import AircraftParameters, Vector
from shipland.sim.aircraft.record import Record, RigidBodyState, at
from shipland.sim.aircraft.sensors import (
    LandingDetector,
    Normals,
    Readings,
    Senses,
    clearance_m,
    reach_m,
    read_instruments,
    sense,
    set_gimbal,
    set_surface,
    step_gimbal,
)
from shipland.sim.aircraft.step import fly_free, tick
from shipland.sim.contact import Bodies, deck_in_ned
from shipland.sim.ship.ship import Ship, place_of
from shipland.sim.state import SceneState, Snapshot, scene_of, truth_of
from shipland.sim.touchdown import NO_TOUCH, Judge, VerdictParameters
from shipland.sim.wind import Wind

STEP_S = 0.002
"""Physics step: what MuJoCo's contacts want."""


@dataclass(frozen=True)
class Grid:
    """The time grid.

    Attributes:
        step_s: physics step.
        control_every: physics steps between updates of the inner loop (250 Hz).
        air_every: physics steps between samples of the wind (50 Hz), and of a ship far away.
    """

    step_s: float = STEP_S
    control_every: int = 2
    air_every: int = 10

    def __post_init__(self) -> None:
        require(self.step_s > 0.0, f"step_s must be positive, got {self.step_s}")
        require(self.air_every % self.control_every == 0, "air_every must be a multiple of control_every")

    @property
    def tick_s(self) -> float:
        """Time between updates of the inner loop."""
        return self.control_every * self.step_s


GRID = Grid()
"""The time grid of simulated flights."""
NEAR_DECK_M = 2.0
"""Least distance from the deck's centre within which the deck is set, and contacts judged, every physics step."""
SHIP_MARGIN_M = 0.5
"""Distance from the ship's bounds within which the ship is set every control step."""
LOW_M = 0.3
"""Height of the feet over the sea below which the flight is not free: MuJoCo flies it."""
CLEAR_M = 0.1
"""Free distance, beyond that flown between two checks, at which no contact is possible."""
CUT_OFF_RAD = math.radians(75.0)
"""Tilt at which the motors stop, as a crash detector does."""
IMPACT_MPS2 = 0.3 * GRAVITY_MPS2
"""Upward jerk of the vertical speed that counts as a felt impact."""


@parameters
class StartParameters:
    """Where a flight begins, against the ship at t = 0 (`[start]`); uniform within a half-range of each value."""

    distance_m: float = key(12.0, "over ground from the deck's centre", "chosen: the bar's detection range with margin")
    distance_half_range_m: float = key(2.0, "drawn evenly within this much either side", ge=0)
    bearing_deg: float = key(0.0, "off the axis straight astern, positive to starboard")
    bearing_half_range_deg: float = key(10.0, "drawn evenly within this much either side", ge=0)
    height_m: float = key(1.5, "above the neutral deck")
    height_half_range_m: float = key(0.5, "drawn evenly within this much either side", ge=0)
    heading_error_deg: float = key(0.0, "of the nose, off the deck's centre, clockwise positive")
    heading_error_half_range_deg: float = key(5.0, "drawn evenly within this much either side", ge=0)

    def __post_init__(self) -> None:
        require(self.distance_m >= self.distance_half_range_m, "distance_m must not be below distance_half_range_m")
        above = self.height_m > self.height_half_range_m
        require(above, "height_m must be above height_half_range_m: flights start above the deck")


class World:
    """Steps the physics and says what is true, what is seen and what is measured.

    Time runs on a grid of steps; `advance` goes to the last grid instant not after the requested time, and every
    instant of the result belongs to that grid time. The flight does not depend on how `advance` is cut up, nor on
    how often truth, scene or readings are requested.

    Args:
        rig: the ship platform's dimensions.
        camera_parameters: the gimbal's rate, range and residual motion, and where the camera sits.
        aircraft: the aircraft.
        verdict: limits of a landing.
        ship: motion of the ship.
        wind: the air; asked at non-decreasing times only.
        start: where the flight begins.
        rng: seeds the start, the sensors and the gimbal.
        water: the ship is at sea, not on land: what optical flow sees around it.
        grid: the time grid.

    Raises:
        ConfigError: there is no such aircraft or inner loop.
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
        water: bool = False,
        grid: Grid = GRID,
    ) -> None:
        self._step_s, self._control_every, self._air_every = grid.step_s, grid.control_every, grid.air_every
        self._camera, self._aircraft, self._ship, self._wind = camera_parameters, aircraft, ship, wind
        start_rng, sense_rng, gimbal_rng, range_rng, self._reading_rng = rng.spawn(5)
        tick_s, sensors, loop = grid.tick_s, aircraft.sensors, aircraft.loop
        self._flier: Aircraft = resolve("aircraft", aircraft.kind)(aircraft, tick_s)
        self._record = self._flier.record if isinstance(self._flier, Quadrotor) else Record(aircraft, tick_s)
        shape = self._flier.shape
        self._bodies = Bodies(rig, shape, grid.step_s, self._record)
        self._foot_below_m = shape.foot_below_m
        values = self._record.values
        self._deck, self._course, self._air = values[at("deck")], values[at("ship")], values[at("air")]
        self._deck_height_m = rig.deck_height_m
        self._unstaged_deck = self._unstaged_hull = False
        self._judge = Judge(verdict, rig.landing_square_m, rig.landing_area)
        on_deck_m = math.hypot(math.sqrt(0.5) * rig.deck_size_m + shape.reach_m, shape.reach_m)
        self._near_deck_m = max(NEAR_DECK_M, on_deck_m)
        ahead_m = max(rig.deck_ahead_of_stern_m, rig.platform_length_m - rig.deck_ahead_of_stern_m)
        ship_m = math.hypot(ahead_m, 0.5 * max(rig.platform_width_m, rig.board_width_m))
        self._near_ship_m = max(ship_m + SHIP_MARGIN_M, self._near_deck_m)
        set_surface(self._record, rig, sensors, water, ship.full_ship)
        self._record.set(
            step_s=grid.step_s,
            lowest_z=-shape.foot_below_m - LOW_M,
            near_deck=self._near_deck_m,
            radius=shape.reach_m,
            foot_below=shape.foot_below_m,
        )
        self._steps, self._tick_s = 0, tick_s
        self._motors_run = True
        self._reach_m = math.inf
        self._sticks, self._land, self._stale_steps = CENTRED, False, 0
        self._flown_sticks: Sticks | None = None  # as they stand in the record

        position_m, heading_rad = self._draw_start(start, start_rng)
        self._set_ship(hull=True)
        self._sample_air(position_m)
        roll_rad, pitch_rad = self._flier.trim(self._wind_mps, heading_rad)
        self._bodies.put(position_m, roll_rad, pitch_rad, heading_rad)

        over_ground = loop.velocity_reference == "ground"
        self._senses = Senses(self._record, sensors, over_ground, grid.air_every * grid.step_s, sense_rng)
        self._senses.look()
        self._gimbal_normals = Normals(gimbal_rng)
        set_gimbal(self._record, camera_parameters, sensors, tick_s, self._gimbal_normals)
        self._touchdown = LandingDetector(loop, sensors.range_noise_m, tick_s, range_rng)
        sense(self._record.states, self._record.constants)
        self._sensed_s = 0.0
        self._flier.begin(self._record.sensed)
        self._packaged = isinstance(self._flier, Quadrotor) and self._flier.is_packaged
        self._clear = False

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
        return self._steps * self._step_s

    @property
    def frame_rate_hz(self) -> float:
        """Pictures a second of the camera on board."""
        return self._camera.frame_rate_hz

    @property
    def step_s(self) -> float:
        """Step of the time grid [s]."""
        return self._step_s

    def command(self, command: PilotCommand) -> None:
        """Take the sticks from now on; values beyond ±100 % are clipped, those that are no numbers or hold are zero."""
        step = self._aircraft.settings.stick_step_percent
        held = command.intent is Intent.HOLD
        self._sticks = CENTRED if held else Sticks(*(_stick(percent, step) for percent in command.sticks_percent))
        self._land = command.intent is Intent.LAND
        if math.isfinite(command.gimbal_pitch_rad):
            self._record.values[_GIMBAL_WANTED] = command.gimbal_pitch_rad
        stale_s = self.t_s + self._aircraft.settings.command_timeout_s
        self._stale_steps = math.ceil((stale_s - 1e-9) / self._step_s - 1e-6)

    def advance(self, to_t_s: float) -> None:
        """Step to the last grid instant not after `to_t_s` [s]; an earlier time does nothing."""
        end = math.floor(to_t_s / self._step_s + 1e-6)
        while self._steps < end:
            if self._steps % self._air_every == 0:
                self._look_around()
            phase = self._steps % self._control_every
            if self._clear and self._motors_run and self._fly_free(phase, end):
                continue
            if phase == 0:
                self._control()
            count = min(self._control_every - phase, end - self._steps)
            if self._reach_m < self._near_deck_m:
                if phase:
                    self._set_ship(hull=False)
                if self._judge.verdict is None and (phase == 0 or self._bodies.in_contact):
                    self._judge_now()
                count = 1
            self._set_stage()
            self._bodies.step(count)
            self._steps += count
            self._look_for_crash()

    def _look_around(self) -> None:
        """Set the ship, sample the air and what is in view, and see whether anything can touch the aircraft soon."""
        record, motion = self._record, self._bodies.motion()
        self._reach_m = reach_m(record.states)
        near = self._reach_m < self._near_ship_m
        self._set_ship(hull=near)
        self._sample_air(motion.position_m)
        self._senses.look()
        flown_m = self._air_every * self._step_s * math.hypot(*motion.velocity_mps)
        margin_m = max(CLEAR_M, self._touchdown.listen_m) + flown_m
        free = self._packaged and self._motors_run and not self._judge.touched and not self._bodies.in_contact
        self._clear = free and (not near or clearance_m(record.states, record.constants) > margin_m)

    def _fly_free(self, phase: int, end: int) -> bool:
        """Fly compiled to `end` or until the next look around; False when it cannot."""
        begin, record, every = self._steps, self._record, self._control_every
        count = min(end, (begin // self._air_every + 1) * self._air_every) - begin
        if self._give_sticks():
            count = max(min(count, self._stale_steps - begin), 1)
        record.values[_DECK_S] = self.t_s - self._ship_s
        ticks = (phase + count + every - 1) // every - (phase + every - 1) // every
        steps: int = fly_free(
            record.states, record.constants, self._gimbal_normals.draws(2 * ticks), phase, every, count
        )
        self._bodies.moved()
        last_tick = (begin + steps - 1) // every * every
        if steps and last_tick >= begin:
            self._sensed_s = last_tick * self._step_s
        self._touchdown.reset()
        self._steps += steps
        self._clear = steps == count
        return steps > 0

    def _give_sticks(self) -> bool:
        """Put the sticks of now into the record; whether they are a fresh command's."""
        fresh = self._steps < self._stale_steps
        sticks = self._sticks if fresh else CENTRED
        if sticks is not self._flown_sticks:
            self._record.values[_STICKS] = self._flown_sticks = sticks
        return fresh

    def _control(self) -> None:
        motion = self._bodies.motion()
        self._reach_m = reach_m(self._record.states)
        if self._steps % self._air_every and self._reach_m < self._near_ship_m:
            self._set_ship(hull=True)
        record, fresh, down_mps = self._record, self._give_sticks(), float(self._record.values[_W_AT_TICK])
        if self._packaged:
            record.values[_DECK_S] = 0.0
            tick(record.states, record.constants, self._gimbal_normals.draws(2), self._motors_run)
        else:
            step_gimbal(record.states, record.constants, self._gimbal_normals.draws(2))
            sense(record.states, record.constants)
            over_deck = self._bodies.over_deck if self._reach_m < self._near_deck_m else None
            piloted = self._flown_sticks if self._motors_run else None
            force, moment = self._flier.step(motion, record.sensed, piloted, self._wind_mps, over_deck)
            record.values[_WRENCH] = (*force, *moment)
        self._sensed_s = self.t_s
        if self._motors_run:
            self._feel_deck((down_mps - motion.velocity_mps[2]) / self._tick_s, self._land and fresh)
            if _upright(motion) < math.cos(CUT_OFF_RAD):
                self._motors_run = False

    def _set_ship(self, hull: bool) -> None:
        """Put the ship of now into the record."""
        self._ship_s, self._unstaged_deck, self._unstaged_hull = self.t_s, True, self._unstaged_hull or hull
        self._course[:] = self._ship.course.at(self._ship_s).values
        deck_in_ship = self._ship.deck_motion.at(self._ship_s).values
        deck_in_ned(self._course, deck_in_ship, self._deck_height_m, self._deck)

    def _set_stage(self) -> None:
        """Write the ship as it was set last, which MuJoCo needs for its steps alone."""
        if self._unstaged_deck:
            self._bodies.set_deck()
        if self._unstaged_hull:
            self._bodies.set_hull(self._ship.full_ship)
        self._unstaged_deck = self._unstaged_hull = False

    def _sample_air(self, position_m: Vector) -> None:
        self._wind_mps = self._wind.velocity_at(self.t_s, position_m, place_of(self._course, self._deck_height_m))
        self._air[0], self._air[1], self._air[2] = self._wind_mps

    def _feel_deck(self, jolt_mps2: float, landing: bool) -> None:
        """Stop the motors once the aircraft takes itself for landed."""
        near = landing and self._reach_m < self._near_deck_m
        range_m = self._bodies.range_m() if near else math.inf
        if self._touchdown.landed(range_m, jolt_mps2 > IMPACT_MPS2):
            self._motors_run = False

    def _judge_now(self) -> None:
        """Show the judge the last step's contacts."""
        touch = self._bodies.touch() if self._bodies.in_contact else NO_TOUCH
        self._judge.follow(self.t_s, self._bodies.on_deck(), touch, self._motors_run)
        if touch.fault:
            self._motors_run = False

    def _look_for_crash(self) -> None:
        """Faults away from the deck: the sea, and the ship's far end."""
        if self._record.values[_DOWN] > -self._foot_below_m:
            self._crash("fell into the sea")
        elif self._bodies.in_contact and self._reach_m >= self._near_deck_m:
            self._crash(self._bodies.touch().fault)

    def _crash(self, fault: str) -> None:
        if fault:
            self._judge.crash(self.t_s, self._bodies.on_deck(), fault)
            self._motors_run = False

    def verdict(self) -> TouchdownVerdict | None:
        """The verdict once the aircraft rests on the deck or has crashed, None before."""
        return self._judge.verdict

    def over(self) -> bool:
        """Whether there is a verdict."""
        return self._judge.verdict is not None

    @property
    def motors_run(self) -> bool:
        """Whether the motors run: the vehicle flies."""
        return self._motors_run

    @property
    def aircraft(self) -> Aircraft:
        """What flies."""
        return self._flier

    def weaken_rotor(self, rotor: int, missing: float) -> None:
        """Take a share of a rotor's thrust from now on; an aircraft that is no quadrotor flies on as it is.

        Args:
            rotor: 0…3, front right, front left, rear right, rear left.
            missing: share of its thrust; 0 gives it back.
        """
        if isinstance(self._flier, Quadrotor):
            self._flier.weaken(rotor, missing)

    def stop_motors(self) -> None:
        """Stop them for good: whoever flies has disarmed."""
        self._motors_run = False

    @property
    def battery_percent(self) -> float:
        """Charge left, 100 … 0."""
        return max(0.0, 100.0 * (1.0 - self.t_s / self._aircraft.sensors.endurance_s))

    @property
    def link_percent(self) -> float:
        """Strength of the link to a base station at the deck, 100 … 0."""
        return max(0.0, 100.0 * (1.0 - reach_m(self._record.states) / self._aircraft.sensors.link_range_m))

    def readings(self) -> Readings:
        """A reading of every instrument at the last control tick; each call draws its own noise, no flight changes."""
        record = self._record
        lost = bool(record.values[_FLOW_LOST])
        return read_instruments(self._aircraft.sensors, self._sensed_s, record.sensed, lost, self._reading_rng)

    def snapshot(self) -> Snapshot:
        """The instant in a few floats; `truth` and `scene_state` make the rest of it, when it is wanted."""
        pitch_rad, rate_rad_s, roll_noise, pitch_noise, roll_bias, pitch_bias = self._record.values[_GIMBAL].tolist()
        errors_rad = (roll_bias + roll_noise, pitch_bias + pitch_noise)
        return Snapshot(self.t_s, *self._bodies.motion(), pitch_rad, rate_rad_s, errors_rad, self._wind_mps)

    def truth(self, snapshot: Snapshot | None = None) -> GroundTruth:
        """The truth of now, or of a snapshot."""
        at = snapshot or self.snapshot()
        return truth_of(at, self._ship.at(at.t_s), self._camera)

    def scene_state(self, snapshot: Snapshot | None = None) -> SceneState:
        """What the camera sees now, or at a snapshot."""
        at = snapshot or self.snapshot()
        return scene_of(at, self._ship.at(at.t_s), self._camera)


_STICKS, _WRENCH, _GIMBAL = at("sticks"), at("wrench"), slice(at("gimbal").start, at("gimbal_bias").stop)
_GIMBAL_WANTED, _DECK_S, _W_AT_TICK = at("gimbal_wanted").start, at("deck_s").start, at("w_at_tick").start
_DOWN, _FLOW_LOST = at("motion").start + 2, at("seen").stop - 1


def _upright(motion: RigidBodyState) -> float:
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
