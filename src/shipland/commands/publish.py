"""`shipland publish`: our vision for an autopilot's own precision landing and estimator."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import ScenarioOptions


@dataclass(frozen=True)
class Publish(ScenarioOptions):
    """Look for the cue and tell an autopilot where the deck is; it is never commanded.

    Sends LANDING_TARGET (BODY_FRD to an ArduPilot, LOCAL_NED to a PX4) and, with --position, VISION_POSITION_ESTIMATE.

    Example: shipland publish --vehicle "mavlink://udp:127.0.0.1:14550?camera=/dev/video0" --calibration camera.yaml
    """

    vehicle: str = "mavlink://udp:127.0.0.1:14550"
    """Address as `shipland fly` takes it, with its camera."""
    calibration: Path | None = None
    """OpenCV calibration file of the camera."""
    vehicle_config: Path | None = None
    """TOML file laid over the settings of vehicles."""
    position: bool = False
    """Send the position estimate as well."""

    def run(self) -> int:
        """Publish until the camera ends or Ctrl-C."""
        import numpy as np

        from shipland.errors import ConfigError
        from shipland.scenario.real_vehicle import make_vehicle
        from shipland.vehicles.mavlink.publish import Mounting, publish
        from shipland.vehicles.mavlink.vehicle import MavlinkVehicle
        from shipland.vision.near.pipeline import NearVision

        scenario = self.load()
        vehicle = make_vehicle(self.vehicle, scenario, self.calibration, self.vehicle_config)
        if not isinstance(vehicle, MavlinkVehicle):
            raise ConfigError(f"--vehicle {self.vehicle}: only a mavlink:// vehicle takes these messages")
        print(f"connecting to {self.vehicle}", file=sys.stderr, flush=True)
        vehicle.connect()
        try:
            vision = NearVision(scenario.rig.cue, vehicle.camera, scenario.vision)
            mounting = Mounting(np.array(scenario.camera.position_in_body_m), scenario.rig.deck_in_bar_m)
            count = publish(vehicle, vision, mounting, self.position, lambda _: None)
        finally:
            vehicle.close()
        print(f"{count} poses published; the camera has ended")
        return 0
