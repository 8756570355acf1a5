"""`mavlink://`: the factory of the group `vehicles`."""

from __future__ import annotations

from shipland.vehicles.address import VehicleSetup
from shipland.vehicles.mavlink.setup import MavlinkSetup
from shipland.vehicles.mavlink.vehicle import MavlinkVehicle
from shipland.vehicles.vehicle import Vehicle


def mavlink(setup: VehicleSetup) -> Vehicle:
    """`mavlink://udp:127.0.0.1:14550?camera=rtsp://…`; options: see `mavlink_setup.OPTIONS`."""
    return MavlinkVehicle(MavlinkSetup.of(setup))
