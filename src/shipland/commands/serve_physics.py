"""`shipland serve-physics`: our world around a flight controller that somebody else wrote."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from shipland.commands.options import ScenarioOptions, check_between, say
from shipland.errors import ConfigError

if TYPE_CHECKING:
    from shipland.messages import TouchdownVerdict
    from shipland.scenario.scenario import Scenario


@dataclass(frozen=True)
class ServePhysics(ScenarioOptions):
    """Serve one flight's ship, wind, deck and camera to a flight controller: ArduCopter's `--model JSON`, a PX4, ROS 2.

    To a flight controller that flies motors the aircraft is held below its start until its rotors carry it, so that
    it can boot; then the flight begins, and `shipland fly --vehicle mavlink://…?camera=frames:127.0.0.1:9003` lands
    it. Parameters for the simulated airframe: `shipland example arducopter.parm`, `px4.parm`.

    To ROS 2 it is a vehicle with topics of its own, which flies the set-points that come; the world waits for the
    first, and `shipland fly --vehicle "ros2://drone?take=1"` lands it. Exit code: 0 landed in the square, 1 not.

    Example: shipland serve-physics --scenario rig-natops --seed 3

    Example: shipland serve-physics --interface ros2 --pictures --set aircraft.loop.kind=velocity
    """

    seed: int = 1
    """Seed of everything random."""
    interface: Literal["json", "px4", "ros2"] = "json"
    """What the flight controller speaks: ArduCopter's JSON over UDP, PX4's simulator messages over TCP, or the
    set-points of ROS 2 (extra `ros2`)."""
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
    namespace: str = "drone"
    """Of the topics of ros2."""

    def run(self) -> int:
        """Serve until the flight is over; Ctrl-C ends it before."""
        from shipland.api import checked_seed

        check_between(1, 65535, port=self.port, frames_port=self.frames_port)
        if self.interface == "ros2" and self.port is not None:
            raise ConfigError("--port is of json and px4: ros2 has topics, see --namespace")
        scenario, seed = self.load(), checked_seed(self.seed)
        verdict = self._over_ros2(scenario, seed) if self.interface == "ros2" else self._over_link(scenario, seed)
        print("no touchdown" if verdict is None else verdict.reason)
        return 0 if verdict is not None and verdict.success else 1

    def _over_link(self, scenario: Scenario, seed: int) -> TouchdownVerdict | None:
        from shipland.sitl.frame_server import FrameServer
        from shipland.sitl.physics import LaunchHold, ServedFlight

        held = LaunchHold(scenario, seed, self.climb_m)
        link: JsonLink | Px4Link
        if self.interface == "json":
            from shipland.sitl.servo_link import JsonLink

            link = JsonLink(self.host, 9002 if self.port is None else self.port)
        else:
            from shipland.sitl.px4_link import Px4Link  # pymavlink is optional

            link = Px4Link(self.host, 4560 if self.port is None else self.port, seed)
        with link, FrameServer(scenario, seed, self.host, self.frames_port, self.pictures) as frames:
            return ServedFlight(held, frames, say).over(link)

    def _over_ros2(self, scenario: Scenario, seed: int) -> TouchdownVerdict | None:
        from shipland.sitl.frame_server import FrameServer
        from shipland.sitl.ros2_node import serve_ros2

        with FrameServer(scenario, seed, self.host, self.frames_port, pictures=False) as frames:
            return serve_ros2(scenario, seed, self.namespace, self.pictures, frames, say)
