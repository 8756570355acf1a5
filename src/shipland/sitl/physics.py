"""Our ship world as the physics of a flight controller that somebody else wrote, whatever interface it speaks."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shipland.errors import ConfigError
from shipland.frames import GRAVITY_MPS2, Array, rotation_from_quaternion
from shipland.messages import PilotCommand, TouchdownVerdict
from shipland.scenario.autonomy import build_world
from shipland.scenario.scenario import Scenario
from shipland.sim.aircraft.parameters import Vector
from shipland.sim.aircraft.record import RigidBodyState
from shipland.sim.aircraft.servo import ServoQuadrotor
from shipland.sim.world import Grid, World
from shipland.sitl.frame_server import FrameServer

if TYPE_CHECKING:
    from shipland.sitl.px4_link import Px4Link
    from shipland.sitl.servo_link import JsonLink

STEP_S = 0.001
"""Physics step: a flight controller's fast loop runs at 800 Hz and more."""
_GRID = Grid(STEP_S, 1, 20)
_STOPPED_US = 1010
"""All motors at or below this for a while after the flight: disarmed."""
_STOPPED_S = 0.3
_LINGER_S = 2.0
"""Time for which the world is served after the verdict."""
_HELD_FORCE_MPS2: Vector = (0.0, 0.0, -GRAVITY_MPS2)


class FlightStep(NamedTuple):
    """The aircraft after a step.

    Attributes:
        t_s: the flight controller's time.
        motion: of the centre of mass; its place from where the aircraft waited.
        force_in_body_mps2: what accelerometers felt during the step.
        over: whether the flight has its verdict.
    """

    t_s: float
    motion: RigidBodyState
    force_in_body_mps2: Vector
    over: bool


class LaunchHold:
    """A world whose aircraft is held below its start until its rotors carry it; from then on the world's time runs.

    A flight controller wants to boot, level its sensors and find its place before it takes off; the ship waits.

    Args:
        scenario: what is flown; its aircraft takes servo pulses.
        seed: of the flight.
        climb_m: how far below its start it is held.
    """

    def __init__(self, scenario: Scenario, seed: int, climb_m: float) -> None:
        start = scenario.start
        low_m = start.height_m - start.height_half_range_m
        if not 0.0 <= climb_m < low_m:
            raise ConfigError(f"flights start {low_m:g} m over the deck: there is no room to climb {climb_m:g} m")
        servo = replace(scenario.aircraft, kind="servo_quadrotor")
        lower = replace(start, height_m=start.height_m - climb_m)
        self.world: World = build_world(replace(scenario, aircraft=servo, start=lower), seed, _GRID)
        aircraft = self.world.aircraft
        assert isinstance(aircraft, ServoQuadrotor)
        self._aircraft = aircraft
        self._home_m = self.world.snapshot().position_m
        self._before = _motion_of(self.world)
        self._held_s, self._stopped_s = 0.0, 0.0
        self.released = False
        """Whether it flies."""
        self.motors_rest_s = math.nan
        """The world's time when its motors were stopped for good."""

    @property
    def t_s(self) -> float:
        """The flight controller's time: held and flown."""
        return self._held_s + self.world.t_s

    def step(self, motors_us: Sequence[float], gimbal_pitch_rad: float | None) -> FlightStep:
        """One step of `STEP_S`.

        Args:
            motors_us: the newest four pulses: front right, rear left, front left, rear right.
            gimbal_pitch_rad: asked of the gimbal, against the horizon; None to leave it.
        """
        self._aircraft.set_pulses(motors_us)
        if gimbal_pitch_rad is not None:
            self.world.command(PilotCommand.hold(self.world.t_s, gimbal_pitch_rad))
        felt = _HELD_FORCE_MPS2
        if not self.released:
            self._held_s += STEP_S
            self.released = self._aircraft.wanted_thrust_n > self._aircraft.weight_n
        else:
            self.world.advance(self.world.t_s + STEP_S)
            after = _motion_of(self.world)
            felt = felt_in_body_mps2(self._before, after, STEP_S)
            self._before = after
            stopped = max(motors_us[:4]) <= _STOPPED_US
            self._stopped_s = self._stopped_s + STEP_S if stopped else 0.0
            if self._stopped_s > _STOPPED_S and self.world.motors_run:
                self.world.stop_motors()
                self.motors_rest_s = self.world.t_s
        at = self._before
        (north, east, down), (north0, east0, down0) = at.position_m, self._home_m
        from_home = at._replace(position_m=(north - north0, east - east0, down - down0))
        return FlightStep(self.t_s, from_home, felt, self.world.over())


class RealTimeFactor:
    """How far the served world kept up with the clock of those who fly it."""

    def __init__(self) -> None:
        self._first = self._second = (math.nan, math.nan)
        self._last = self._first
        self._slowest_s = 0.0

    @property
    def begun(self) -> bool:
        """Whether anything has been noted."""
        return math.isfinite(self._first[0])

    def note(self, world_s: float, now_s: float) -> None:
        """The world's time, and ours."""
        now = world_s, now_s
        if not self.begun:
            self._first = self._second = now
        if world_s - self._second[0] >= 1.0:
            self._slowest_s = max(self._slowest_s, now_s - self._second[1])
            self._second = now
        self._last = now

    def words(self) -> str:
        """For people; empty before two notes."""
        if not self.begun:
            return ""
        (from_s, since_s), (to_s, until_s) = self._first, self._last
        took_s = until_s - since_s
        return f"{to_s - from_s:.1f} s of flight took {took_s:.1f} s, the slowest second {self._slowest_s:.2f} s"


class ServedFlight:
    """One flight of a held world, its camera and its messages to the terminal, stepped by an interface."""

    def __init__(self, held: LaunchHold, frames: FrameServer, say: Callable[[str], None]) -> None:
        self.held, self._frames, self._frame_s, self.say = held, frames, 1.0 / held.world.frame_rate_hz, say
        self._due_s, self._linger_s, self._steps = 0.0, _LINGER_S, 0
        self._begun_s, self._tempo = math.nan, RealTimeFactor()

    @property
    def done(self) -> bool:
        """Whether the verdict has stood for a while."""
        return self._linger_s <= 0.0

    def over(self, link: JsonLink | Px4Link) -> TouchdownVerdict | None:
        """Serve it over a link until its verdict; interrupted by the caller's KeyboardInterrupt."""
        self.say(f"waiting for a flight controller on {link.address}")
        link.fly(self)
        self.say(self._tempo.words())
        verdict, rest_s = self.held.world.verdict(), self.held.motors_rest_s
        if verdict is not None and verdict.touched and math.isfinite(rest_s):
            self.say(f"motors at rest {rest_s - verdict.t_s:.2f} s after the touch")
        return verdict

    def step(self, motors_us: Sequence[float], gimbal_pitch_rad: float | None) -> FlightStep:
        """See `LaunchHold.step`; the camera sees it."""
        held, now_s = self.held, time.monotonic()
        if self._steps == 0:
            self._begun_s = now_s
        step = held.step(motors_us, gimbal_pitch_rad)
        self._steps += 1
        if held.released:
            if not self._tempo.begun:
                self.say(f"it flies, after {now_s - self._begun_s:.0f} s and {self._steps} steps")
            self._tempo.note(step.t_s, now_s)
        if step.t_s >= self._due_s:
            self._due_s = step.t_s + self._frame_s
            self._frames.show(step.t_s, held.world.snapshot())
        if step.over:
            self._linger_s -= STEP_S
            if (verdict := held.world.verdict()) is not None:
                self._frames.end(verdict)
        return step


def felt_in_body_mps2(before: RigidBodyState, after: RigidBodyState, step_s: float) -> Vector:
    """Specific force along `body`: acceleration without gravity, contacts included."""
    change = np.array(after.velocity_mps) - np.array(before.velocity_mps)
    felt_in_ned: Array = change / step_s - np.array([0.0, 0.0, GRAVITY_MPS2])
    forward, right, down = (rotation_from_quaternion(np.array(after.quaternion)).T @ felt_in_ned).tolist()
    return forward, right, down


def _motion_of(world: World) -> RigidBodyState:
    at = world.snapshot()
    return RigidBodyState(at.position_m, at.quaternion, at.velocity_mps, at.body_rates_rad_s)
