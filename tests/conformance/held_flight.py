"""A MAVLink vehicle in flight with full forward sticks, in a process that can be kept from running.

    python held_flight.py PORT

It says `flying` once it flies. A line of standard input with a number holds the interpreter for so many seconds.
"""

from __future__ import annotations

import ctypes
import sys
import threading

from mavlink_bench import Blank, setup_for

from shipland.messages import PilotCommand
from shipland.vehicles.mavlink.setup import Engagement
from shipland.vehicles.mavlink.vehicle import MavlinkVehicle


def fly(vehicle: MavlinkVehicle) -> None:
    while (pair := vehicle.read()) is not None:
        vehicle.send(PilotCommand(pair[1].t_s, 100.0, 0.0, 0.0, 0.0, -0.2))
    print(f"over: {vehicle.end_reason}", flush=True)


def main() -> None:
    vehicle = MavlinkVehicle(
        setup_for(int(sys.argv[1]), Blank(), None, Engagement(take=True), {"video_timeout_s": 10.0})
    )
    vehicle.connect()
    connected_s = vehicle.session.state.heartbeat_s
    # the guard then knows the mode from the first set-point on
    vehicle.session.wait(lambda state: state.heartbeat_s > connected_s, 10.0, "no further heartbeat")
    vehicle.open()
    threading.Thread(target=fly, args=(vehicle,), daemon=True).start()
    print("flying", flush=True)
    for line in sys.stdin:
        ctypes.PyDLL(None).usleep(int(1e6 * float(line)))  # a PyDLL's call keeps the interpreter's lock


if __name__ == "__main__":
    main()
