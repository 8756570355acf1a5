"""One flight of our world, served to a flight controller over the interface that it speaks."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from shipland.messages import TouchdownVerdict
from shipland.scenario.scenario import Scenario
from shipland.sitl.frame_server import FrameServer
from shipland.sitl.physics import LaunchHold, ServedFlight
from shipland.sitl.servo_link import JsonLink

if TYPE_CHECKING:
    from shipland.sitl.px4_link import Px4Link

Interface = Literal["json", "px4"]


@dataclass(frozen=True)
class PhysicsOptions:
    """What `serve-physics` serves, and where.

    Attributes:
        interface: of the flight controller: `json` is ArduCopter's over UDP, `px4` PX4's over TCP.
        host: address that is bound; loopback.
        port: of the flight controller.
        frames_port: of the camera.
        pictures: whether frames carry pictures, or only the truth.
        climb_m: the aircraft is held this much below its start, and flies once its rotors carry it.
    """

    interface: Interface
    host: str
    port: int
    frames_port: int
    pictures: bool
    climb_m: float


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
        VehicleError: a port is taken, or pymavlink is missing.
    """
    held = LaunchHold(scenario, seed, options.climb_m)
    with contextlib.ExitStack() as stack:
        link = _link_of(options, seed)
        stack.enter_context(link)
        frames = stack.enter_context(FrameServer(scenario, seed, options.host, options.frames_port, options.pictures))
        flight = ServedFlight(held, frames, scenario.camera.frame_rate_hz, say)
        say(f"waiting for a flight controller on {link.address}")
        link.fly(flight)
        say(flight.pace)
        verdict = held.world.verdict()
        if verdict is not None and verdict.touched and math.isfinite(held.motors_rest_s):
            say(f"motors at rest {held.motors_rest_s - verdict.t_s:.2f} s after the touch")
        return verdict


def _link_of(options: PhysicsOptions, seed: int) -> JsonLink | Px4Link:
    if options.interface == "json":
        return JsonLink(options.host, options.port)
    from shipland.sitl.px4_link import Px4Link  # pymavlink is optional

    return Px4Link(options.host, options.port, seed)
