"""`shipland publish`: our vision for an autopilot's own precision landing and estimator, or for ROS 2."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from shipland.commands.options import ScenarioOptions, say

if TYPE_CHECKING:
    from shipland.scenario.scenario import Scenario
    from shipland.vehicles.mavlink.vehicle import MavlinkVehicle
    from shipland.vehicles.ros2.vehicle import Ros2Vehicle


@dataclass(frozen=True)
class Publish(ScenarioOptions):
    """Look for the cue and tell an autopilot or ROS 2 where the deck is; nothing is commanded.

    An autopilot gets LANDING_TARGET (BODY_FRD an ArduPilot, LOCAL_NED a PX4) and, with --position,
    VISION_POSITION_ESTIMATE. ROS 2 gets /shipland/cue_pose, /shipland/detections, /shipland/diagnostics and TF.

    Example: shipland publish --vehicle "mavlink://udp:127.0.0.1:14550?camera=/dev/video0" --calibration camera.yaml

    Example: shipland publish --vehicle "ros2://drone?image=/camera/image_raw&camera_info=/camera/camera_info&mount_deg=-10"
    """

    vehicle: str = "mavlink://udp:127.0.0.1:14550"
    """Address as `shipland fly` takes it, with its camera."""
    calibration: Path | None = None
    """OpenCV's or ROS's calibration file of the camera."""
    vehicle_config: Path | None = None
    """TOML file laid over the settings of vehicles."""
    position: bool = False
    """Send the position estimate as well."""

    def run(self) -> int:
        """Publish until a recording ends or Ctrl-C; VehicleError once camera or link fail."""
        from shipland.errors import ConfigError, VehicleError
        from shipland.scenario.real_vehicle import make_vehicle
        from shipland.vehicles.address import without_password
        from shipland.vehicles.ros2.vehicle import Ros2Vehicle
        from shipland.vehicles.setpoint_vehicle import SetpointVehicle

        scenario = self.load()
        made = make_vehicle(self.vehicle, scenario, self.calibration, self.vehicle_config)
        if not isinstance(made, SetpointVehicle):  # of either's own class the other's extra may be missing
            raise ConfigError(f"--vehicle {self.vehicle}: only mavlink:// and ros2:// vehicles take these messages")
        vehicle = cast("MavlinkVehicle | Ros2Vehicle", made)
        if self.position and isinstance(vehicle, Ros2Vehicle):
            raise ConfigError("--position is for an autopilot: ROS 2 gets the cue's pose without it")
        say(f"connecting to {without_password(self.vehicle)}")
        vehicle.connect()
        try:
            count = self._publish(vehicle, scenario)
            if lost := vehicle.video_lost(_CAMERA_S):
                raise VehicleError(f"{lost}; {count} poses published")
        finally:
            vehicle.close()
        print(f"{count} poses published; the camera has ended")
        return 0

    def _publish(self, vehicle: MavlinkVehicle | Ros2Vehicle, scenario: Scenario) -> int:
        """How many poses were sent; ROS 2 is told of corners, the bar's box and the ship's: what a flight looks at.

        What a flight refuses is no pose here either.
        """
        import numpy as np

        from shipland.messages import Observation
        from shipland.safety.input_gate import InputGate, without_repeated
        from shipland.scenario.visions import VisionSetup, rendered
        from shipland.vehicles.ros2.vehicle import Ros2Vehicle
        from shipland.vision.near.pipeline import NearVision
        from shipland.vision.vision import Vision, see_or_degrade

        vision: Vision = NearVision(scenario.rig.cue, vehicle.camera, scenario.vision)
        if isinstance(vehicle, Ros2Vehicle):
            rng = np.random.default_rng(0)  # this vision draws no numbers
            vision = rendered(VisionSetup(scenario, vehicle.camera, vehicle, rng, rng))
        vehicle.inform_of(scenario.rig, np.array(scenario.camera.position_in_body_m))
        count, gate, failures = 0, InputGate(), set[type[BaseException]]()
        before: Observation | None = None
        while (frame := vehicle.look(_CAMERA_S)) is not None:
            gate, frame, refused = gate._replace(now_s=time.monotonic()).frame(frame)
            seen = Observation(frame.t_s, frame.gimbal, reason=refused)
            if not refused:
                new = see_or_degrade(vision, frame, failures)
                seen, before = gate.observation(without_repeated(new, before), frame, vehicle.camera), new
            if isinstance(vehicle, Ros2Vehicle):
                vehicle.tell(seen)
                count += seen.bar_pose is not None
            else:
                count += vehicle.tell(seen, self.position)
        return count


_CAMERA_S = 10.0
"""A camera that gives no picture for so long is lost, as in a flight; one that failed is opened again meanwhile."""
