"""`shipland serve-physics`: our world around a flight controller that somebody else wrote."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shipland.commands.options import ScenarioOptions, checked_seed


@dataclass(frozen=True)
class ServePhysics(ScenarioOptions):
    """Serve one flight's ship, wind, deck and camera to a flight controller: ArduCopter's `--model JSON`, or a PX4.

    The aircraft is held below its start until its rotors carry it, so that the flight controller can boot; then the
    flight begins, and `shipland fly --vehicle mavlink://…?camera=frames:127.0.0.1:9003` lands it. Parameters for the
    simulated airframe: examples/arducopter.parm and examples/px4.parm. Exit code: 0 landed in the square, 1 not.

    Example: shipland serve-physics --scenario rig-natops --seed 3
    """

    seed: int = 1
    """Seed of everything random."""
    interface: Literal["json", "px4"] = "json"
    """What the flight controller speaks: ArduCopter's JSON over UDP, or PX4's simulator messages over TCP."""
    host: str = "127.0.0.1"
    """Address that is bound; the flight controller and whoever looks must reach it."""
    port: int | None = None
    """Port of the flight controller; 9002 (json) or 4560 (px4) unless given."""
    frames_port: int = 9003
    """TCP port of the camera."""
    pictures: bool = False
    """Draw pictures; without them the frames carry the truth only, for `--vision geometric`."""
    climb_m: float = 0.9
    """How far below its start the aircraft waits."""

    def run(self) -> int:
        """Serve until the flight is over; Ctrl-C ends it before."""
        import sys

        from shipland.sitl.serving import PhysicsOptions, serve

        port = {"json": 9002, "px4": 4560}[self.interface] if self.port is None else self.port
        options = PhysicsOptions(self.interface, self.host, port, self.frames_port, self.pictures, self.climb_m)
        verdict = serve(self.load(), checked_seed(self.seed), options, lambda line: print(line, file=sys.stderr))
        print("no touchdown" if verdict is None else verdict.reason)
        return 0 if verdict is not None and verdict.success else 1
