"""Our ship world as the physics of a flight controller that somebody else wrote."""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from shipland.errors import ConfigError
from shipland.frames import GRAVITY_MPS2
from shipland.messages import PilotCommand, TouchdownVerdict
from shipland.missions.crew import build_world
from shipland.missions.frame_server import FrameServer
from shipland.missions.scenarios import Scenario
from shipland.missions.servo_link import ServoPacket, felt_in_body_mps2, mount_pitch_rad, state_line
from shipland.sim.aircraft.aircraft import Motion
from shipland.sim.aircraft.parameters import Vector
from shipland.sim.aircraft.servo import ServoQuadrotor
from shipland.sim.world import Grid, World

STEP_S = 0.001
"""A flight controller's fast loop wants 800 Hz and more."""
_GRID = Grid(STEP_S, 1, 20)
_GIMBAL_CHANNEL = 8
"""Servo output 9, from 0."""
_STOPPED_US = 1010
"""All motors at or below this for a while after the flight: disarmed."""
_STOPPED_S = 0.3
_HELD_FORCE_MPS2: Vector = (0.0, 0.0, -GRAVITY_MPS2)


class Answer(NamedTuple):
    """What goes back after a packet."""

    line: bytes
    over: bool


@dataclass(frozen=True)
class PhysicsOptions:
    """What `serve-physics` serves, and where.

    Attributes:
        host: address that is bound; loopback.
        port: of the flight controller.
        frames_port: of the camera.
        pictures: whether frames carry pictures, or only the truth.
        climb_m: the aircraft is held this much below its start, and flies once its rotors carry it.
    """

    host: str
    port: int
    frames_port: int
    pictures: bool
    climb_m: float


class HeldWorld:
    """A world whose aircraft is held below its start until its rotors carry it; from then on the world's time runs.

    A flight controller wants to boot, level its sensors and find its place before it takes off; the ship waits.

    Args:
        scenario: what is flown; its aircraft takes servo pulses.
        seed: of the flight.
        climb_m: see `PhysicsOptions`.
    """

    def __init__(self, scenario: Scenario, seed: int, climb_m: float) -> None:
        start = scenario.start
        if climb_m < 0.0 or start.height_m - start.height_spread_m - climb_m <= 0.0:
            low_m = start.height_m - start.height_spread_m
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

    @property
    def t_s(self) -> float:
        """The flight controller's time: held and flown."""
        return self._held_s + self.world.t_s

    def step(self, packet: ServoPacket) -> Answer:
        """One step with the newest pulses; what to answer."""
        self._aircraft.set_pulses(packet.pulses_us)
        pitch_rad = mount_pitch_rad(packet.pulses_us[_GIMBAL_CHANNEL])
        if pitch_rad is not None:
            self.world.command(PilotCommand.hold(self.world.t_s, pitch_rad))
        felt = _HELD_FORCE_MPS2
        if not self.released:
            self._held_s += STEP_S
            self.released = self._aircraft.wanted_thrust_n > self._aircraft.weight_n
        else:
            self.world.advance(self.world.t_s + STEP_S)
            after = _motion_of(self.world)
            felt = felt_in_body_mps2(self._before, after, STEP_S)
            self._before = after
            stopped = max(packet.pulses_us[:4]) <= _STOPPED_US
            self._stopped_s = self._stopped_s + STEP_S if stopped else 0.0
            if self._stopped_s > _STOPPED_S:
                self.world.stop_motors()
        return Answer(state_line(self.t_s, self._before, felt, self._home_m), self.world.over())


class Tempo:
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


def serve(
    scenario: Scenario, seed: int, options: PhysicsOptions, say: Callable[[str], None]
) -> TouchdownVerdict | None:
    """Serve one flight until its verdict; interrupted by the caller's KeyboardInterrupt.

    Args:
        scenario: what is flown.
        seed: of everything random.
        options: where.
        say: takes a line for people.

    Returns:
        The verdict.

    Raises:
        ConfigError: the scenario leaves no room to climb.
        VehicleError: a port is taken.
    """
    held = HeldWorld(scenario, seed, options.climb_m)
    with contextlib.ExitStack() as stack:
        link = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        try:
            link.bind((options.host, options.port))
        except OSError as error:
            raise ConfigError(f"cannot listen on {options.host}:{options.port}: {error.strerror}") from None
        frames = stack.enter_context(FrameServer(scenario, seed, options.host, options.frames_port, options.pictures))
        say(f"waiting for a flight controller on udp:{options.host}:{options.port}")
        link.settimeout(1.0)
        count, begun_s, steps, linger_s = -1, time.monotonic(), 0, 2.0
        due_s, tempo, answer = 0.0, Tempo(), None
        while linger_s > 0.0:
            try:
                data, sender = link.recvfrom(512)
            except TimeoutError:
                continue
            packet = ServoPacket.parse(data)
            if packet is None:
                continue
            if packet.count == count and answer is not None:
                link.sendto(answer.line, sender)  # it asks again for an answer that was lost
                continue
            if count < 0:
                begun_s = time.monotonic()
                say(f"a flight controller at {sender[0]}:{sender[1]}, {packet.rate_hz} Hz")
            count = packet.count
            answer = held.step(packet)
            steps += 1
            link.sendto(answer.line, sender)
            if held.released:
                now_s = time.monotonic()
                if not tempo.begun:
                    say(f"it flies, after {now_s - begun_s:.0f} s and {steps} steps")
                tempo.note(held.t_s, now_s)
            if held.t_s >= due_s:
                due_s = held.t_s + 1.0 / scenario.camera.frame_rate_hz
                frames.show(held.t_s, held.world.snapshot())
            if answer.over:
                linger_s -= STEP_S
                if (verdict := held.world.verdict()) is not None:
                    frames.end(verdict)
        say(tempo.words())
        return held.world.verdict()


def _motion_of(world: World) -> Motion:
    at = world.snapshot()
    return Motion(at.position_m, at.quaternion, at.velocity_mps, at.body_rates_rad_s)
