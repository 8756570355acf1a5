"""`ros2://`: the factory of the group `vehicles`."""

from __future__ import annotations

from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.ros2.setup import Ros2Setup
from shipland.vehicles.ros2.vehicle import Ros2Vehicle
from shipland.vehicles.vehicle import Vehicle


def ros2(setup: VehicleSetup) -> Vehicle:
    """`ros2://drone?image=/camera/image_raw`: the vehicle's topics below `/drone`; options: see `ros2.setup`."""
    return Ros2Vehicle(Ros2Setup.of(setup))
