"""The stand-in autopilot flying somebody's physics over ArduPilot's JSON interface: attitude, height and motor mixing.

In LAND it descends over the landing target that it is told, and disarms once it stands.

python standin_physics.py MAVLINK_PORT PHYSICS_PORT
"""

from __future__ import annotations

import json
import math
import socket
import struct
import sys
import threading
import time

from standin import GUIDED, Autopilot

STEPS_A_TURN = 10
HOVER = 1.0 / 2.2
LAND = 9
STANDS_S = 0.7


def pulse(share: float) -> int:
    """Servo pulse of a steady thrust."""
    signal = (-0.35 + math.sqrt(0.35**2 + 4.0 * 0.65 * min(max(share, 0.0), 1.0))) / (2.0 * 0.65)
    return round(1000.0 + 1000.0 * min(max(signal, 0.0), 1.0))


class FlyingAutopilot(Autopilot):
    def __init__(self, port: int, physics_port: int) -> None:
        super().__init__(port, False, None)
        self.physics = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.physics.settimeout(1.0)
        self.to_physics = ("127.0.0.1", physics_port)
        self.count, self.up, self.armed, self.mode = 0, 0.0, False, 5
        self.gimbal_us = 1500
        self.rates = (0.0, 0.0, 0.0)
        self.height_ref, self.heading_ref = 0.0, None
        self.time_s = self.still_s = 0.0
        self.pad = (0.0, 0.0)

    def on_landing_target(self, it) -> None:  # type: ignore[no-untyped-def]
        """The pad ahead and aside in the heading's level; a roll counts for little this near."""
        assert it.frame == 12
        self.pad = (math.cos(self.pitch) * it.x + math.sin(self.pitch) * it.z, it.y - math.tan(self.roll) * it.z)

    def on_gimbal_manager_set_pitchyaw(self, it) -> None:  # type: ignore[no-untyped-def]
        self.gimbal_us = round(1500.0 + 500.0 * min(max(it.pitch / (0.5 * math.pi), -1.0), 1.0))

    def step(self) -> None:
        for _ in range(STEPS_A_TURN):
            self.physics_step()

    def wanted(self) -> tuple[float, float, float, float]:
        """Roll, pitch, climb and turn."""
        kind, values = self.target
        if self.mode != GUIDED or (kind != "up" and time.monotonic() - self.target_s > 3.0):
            kind, values = "hold", []
        if self.mode == LAND:
            kind, values = "speed", [0.6 * self.pad[0], 0.6 * self.pad[1], -0.4, 0.0]
        if kind == "tilt":
            turn = 3.0 * ((values[2] - self.yaw + math.pi) % (2.0 * math.pi) - math.pi)
            return values[0], values[1], values[3], turn
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        ahead, aside, climb, turn = 0.0, 0.0, 0.0, 0.0
        if kind == "speed":
            ahead, aside, climb, turn = values
        elif kind == "up":
            climb = max(-1.0, min(1.0, values[0] - self.up))
        ahead -= c * self.velocity[0] + s * self.velocity[1]
        aside -= c * self.velocity[1] - s * self.velocity[0]
        roll, pitch = math.atan(0.12 * aside), -math.atan(0.12 * ahead)
        return max(-0.4, min(0.4, roll)), max(-0.4, min(0.4, pitch)), climb, turn

    def motors(self) -> list[float]:
        """Thrust shares: front right, rear left, front left, rear right."""
        if not self.armed or self.target[0] == "wait":
            return [0.0] * 4
        roll, pitch, climb, turn = self.wanted()
        p, q, r = self.rates
        self.height_ref += 0.001 * climb
        self.height_ref = max(self.up - 1.0, min(self.up + 0.5, self.height_ref))
        tilt = max(0.6, math.cos(self.roll) * math.cos(self.pitch))
        lift = HOVER + 0.3 * (self.height_ref - self.up) + 0.15 * (climb - self.velocity[2])
        lift = max(0.0, min(0.9, lift)) / tilt
        a = 0.04 * (5.0 * (roll - self.roll) - p)
        b = 0.035 * (5.0 * (pitch - self.pitch) - q)
        c = 0.1 * (turn - r)
        self.throttle = lift
        return [lift - a + b + c, lift + a - b + c, lift + a + b - c, lift - a - b - c]

    def physics_step(self) -> None:
        pulses = [1000 if not self.armed else pulse(share) for share in self.motors()]
        channels = [*pulses, 0, 0, 0, 0, self.gimbal_us, *[0] * 7]
        self.count += 1
        self.physics.sendto(struct.pack("<HHI16H", 18458, 1000, self.count, *channels), self.to_physics)
        try:
            state = json.loads(self.physics.recv(65536))
        except (TimeoutError, ValueError):
            return
        self.time_s = state["timestamp"]
        self.booted_s = time.monotonic() - self.time_s
        self.rates = tuple(state["imu"]["gyro"])
        w, x, y, z = state["quaternion"]
        self.roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        self.pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        self.yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        north, east, down = state["velocity"]
        self.velocity, self.up = [north, east, -down], -state["position"][2]
        self.still_s = self.still_s + 0.001 if self.mode == LAND and abs(down) < 0.1 else 0.0
        if self.still_s > STANDS_S:
            self.armed = False

    def arm(self, wanted: float, magic: float) -> int:
        if wanted == 0.0 and self.armed and magic != 21196:
            return 4
        self.armed = wanted != 0.0
        self.height_ref, self.target = self.up, ("wait", [])
        return 0


def main() -> None:
    autopilot = FlyingAutopilot(int(sys.argv[1]), int(sys.argv[2]))
    threading.Thread(
        target=lambda: [autopilot.hear(line.split()) for line in sys.stdin if line.strip()], daemon=True
    ).start()
    due_s, turn = time.monotonic(), 0
    while True:
        autopilot.listen()
        autopilot.step()
        autopilot.tell(turn)
        turn += 1
        due_s = max(due_s + 0.01, time.monotonic() - 0.1)
        time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    main()
