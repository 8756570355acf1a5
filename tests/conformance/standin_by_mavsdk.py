"""The stand-in autopilot whose MAVLink is MAVSDK's: its library, and nothing of pymavlink, reads and writes every byte.

    python standin_by_mavsdk.py PORT ardupilot|px4

pymavlink's classes serve the stand-in as records alone.
"""

from __future__ import annotations

import json
import sys
import time
from collections import deque
from types import SimpleNamespace
from typing import Any

from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mavlink_direct_server.mavlink_direct_server import MavlinkDirectServer, MavlinkMessage
from standin import Autopilot, run

OWN_AUTOPILOTS = (3, 12)  # MAV_AUTOPILOT of ArduPilot and PX4


class ByMavsdk(Autopilot):
    def __init__(self, port: int, px4: bool) -> None:
        super().__init__(port, px4, None)
        self.received: deque[tuple[str, dict[str, Any]]] = deque()
        self.sdk = Mavsdk(Configuration.create_manual(1, 1, False))
        self.sdk.subscribe_raw_bytes_to_be_sent(self.leave)
        self.sdk.add_any_connection("raw://")
        self.server = MavlinkDirectServer(self.sdk.server_component_by_id(1))
        self.server.subscribe_message("", self.arrive)

    def leave(self, data: bytes) -> None:
        """MAVSDK says heartbeats of its own, of an autopilot of no kind: a real one has one kind."""
        if data[7:10] == b"\0\0\0" and (data[10:] + bytes(9))[5] not in OWN_AUTOPILOTS:
            return
        self.socket.sendto(data, self.to)

    def arrive(self, message: MavlinkMessage, _: object) -> None:
        self.received.append((message.message_name, json.loads(message.fields_json)))

    def listen(self) -> None:
        try:
            while True:
                self.sdk.pass_received_raw_bytes(self.socket.recv(65536))
        except OSError:
            pass
        while self.received:
            name, fields = self.received.popleft()
            self.counts[name] = self.counts.get(name, 0) + 1
            handler = getattr(self, "on_" + name.lower(), None)
            if handler is not None and time.monotonic() > self.silent_until_s:
                handler(SimpleNamespace(**fields))

    def send(self, message: Any) -> None:
        if time.monotonic() <= self.silent_until_s:
            return
        fields = message.to_dict()
        name = fields.pop("mavpackettype")
        self.server.send_message(
            MavlinkMessage(message_name=name, system_id=1, component_id=1, fields_json=json.dumps(fields))
        )


if __name__ == "__main__":
    run(ByMavsdk(int(sys.argv[1]), sys.argv[2] == "px4"))
