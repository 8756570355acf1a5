"""A stand-in autopilot in a process of its own: MAVLink's common dialect over UDP, and a kinematic multicopter.

It knows nothing of shipland. It keeps to what real ones were seen to do: ArduPilot drops SET_ATTITUDE_TARGET whose
rates are partly ignored, takes thrust 0.5 as holding the height, obeys set-points in GUIDED and attitudes alone in
GUIDED_NOGPS, holds when they stop, and refuses a plain disarm while the deck moves; PX4 gives OFFBOARD only after
set-points, leaves it without them, and says a heartbeat a second whatever rate it is asked for, and one whenever one is
requested; where it is to wait for sticks without set-points, and obeys none (COM_RC_IN_MODE = 4), it flies the last one
on.

Words on standard input: `mode N`, `sticks ROLL PITCH THROTTLE YAW` (pulse widths; the rest stay, and none is no
receiver), `silent S`, `mute S` (it hears and obeys, and says nothing), `lag S` (what it says comes so late), `set NAME
VALUE` (of a parameter), `reboot`, `deck` (a moving deck just below), `updraft` (it sinks evenly at 0.59 of the hover
throttle), `lose NAME` (no answer for that parameter), `deaf N` (the next N requests for a mode are lost), `deny MODE …`
(requests for them are denied), `withhold NAME` (messages that it does not send), `halt NAME` (the same, until their
rate is asked for), `refuse NUMBER` (commands that it denies), `miss NUMBER` (the next such command is lost), `swallow
NUMBER` (its answer is), `sick` (an unhealthy gyroscope), `well`, `report`. `report` answers a line of JSON on standard
output.
"""

from __future__ import annotations

import json
import math
import socket
import sys
import threading
import time
from collections import deque
from typing import Any

from pymavlink.dialects.v20 import common as m

STEP_S = 0.01
PARAMETERS = {
    "ANGLE_MAX": 3000.0, "WPNAV_SPEED": 500.0, "WPNAV_SPEED_UP": 250.0, "WPNAV_SPEED_DN": 150.0, "GUID_OPTIONS": 0.0,
    "GUID_TIMEOUT": 3.0, "MOT_THST_HOVER": 0.39, "FENCE_ENABLE": 1.0, "FENCE_ACTION": 1.0,
}  # fmt: skip
PX4_PARAMETERS = {
    "MPC_TILTMAX_AIR": 45.0, "MPC_XY_VEL_MAX": 12.0, "MPC_Z_VEL_MAX_UP": 3.0, "MPC_Z_VEL_MAX_DN": 1.0,
    "MPC_THR_HOVER": 0.4, "COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 0.0, "GF_ACTION": 2.0,
    "GF_MAX_HOR_DIST": 150.0,
}  # fmt: skip
GUIDED, GUIDED_NOGPS, OFFBOARD = 4, 20, 6 << 16


class Autopilot:
    def __init__(self, port: int, px4: bool, key: bytes | None) -> None:
        self.px4 = px4
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.to = ("127.0.0.1", port)
        self.out = m.MAVLink(None, srcSystem=1, srcComponent=1)
        self.parser = m.MAVLink(None)
        self.parser.robust_parsing = True
        if key is not None:
            for end in (self.out, self.parser):
                end.signing.secret_key = key
                end.signing.timestamp = int((time.time() - 1420070400) * 1e5)
            self.out.signing.sign_outgoing = True
            self.parser.signing.allow_unsigned_callback = None
        self.booted_s = time.monotonic() - 5.0
        self.mode, self.armed = (OFFBOARD if px4 else GUIDED), True
        self.silent_until_s = self.mute_until_s = 0.0
        self.sticks_us = [1500] * 4
        self.heartbeat_every = 100
        self.lag_s = 0.0
        self.late: deque[tuple[float, bytes]] = deque()
        self.unanswered: set[str] = set()
        self.sick, self.deaf = False, 0
        self.denied: set[int] = set()
        self.withheld: set[str] = set()
        self.halted: set[int] = set()
        self.refused: set[int] = set()
        self.missed: set[int] = set()
        self.swallowed: set[int] = set()
        self.north = self.east = 0.0
        self.up = 10.0
        self.velocity = [0.0, 0.0, 0.0]  # north, east, up
        self.roll = self.pitch = self.yaw = 0.0
        self.target: tuple[str, list[float]] = ("hold", [])
        self.target_s = -math.inf
        self.deck = self.updraft = False
        self.deck_s = 0.0
        self.throttle = 0.39
        self.counts: dict[str, int] = {}
        self.commands: list[list[float]] = []
        self.gaps_s: list[float] = []
        self.refusals = 0

    # in

    def listen(self) -> None:
        while True:
            try:
                data, _ = self.socket.recvfrom(65536)
            except OSError:
                return
            for message in self.parser.parse_buffer(data) or []:
                name = message.get_type()
                self.counts[name] = self.counts.get(name, 0) + 1
                handler = getattr(self, "on_" + name.lower(), None)
                if handler is not None and time.monotonic() > self.silent_until_s:
                    handler(message)

    def obey(self, kind: str, values: list[float]) -> None:
        now_s = time.monotonic()
        if math.isfinite(self.target_s):
            self.gaps_s.append(now_s - self.target_s)
        self.target_s = now_s
        if self.mode == (OFFBOARD if self.px4 else GUIDED) or (self.mode == GUIDED_NOGPS and kind == "tilt"):
            self.target = (kind, values)

    def on_set_attitude_target(self, it: Any) -> None:
        mask = it.type_mask & 7
        if self.px4 or mask not in (0, 7) or it.type_mask & 64:
            self.refusals += 1
            return
        w, x, y, z = it.q
        if abs(w * w + x * x + y * y + z * z - 1.0) > 2e-3:
            self.refusals += 1
            return
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        climb = (it.thrust - 0.5) * 2.0 * (2.5 if it.thrust > 0.5 else 1.5)
        self.obey("tilt", [roll, pitch, yaw, climb])

    def on_set_position_target_local_ned(self, it: Any) -> None:
        if it.type_mask != 0b010111000111 or it.coordinate_frame not in (8, 9):
            self.refusals += 1
            return
        self.obey("speed", [it.vx, it.vy, -it.vz, it.yaw_rate])

    def on_command_long(self, it: Any) -> None:
        self.commands.append([it.command, it.param1, it.param2])
        result = 0
        if it.command == 511:
            self.halted.discard(int(it.param1))
        if it.command in self.missed:
            self.missed.discard(it.command)
            return
        if it.command in self.refused:
            result = 4
        elif it.command == 400:
            result = self.arm(it.param1, it.param2)
        elif it.command == 176 and self.deaf:
            self.deaf -= 1
            return
        elif it.command == 176:
            result = self.change_mode(int(it.param2), int(it.param3))
        elif it.command == 511 and it.param1 == 0.0 and self.px4:
            result = 4
        elif it.command == 511 and it.param1 == 0.0:
            self.heartbeat_every = max(1, round(it.param2 * 1e-6 / STEP_S))
        elif it.command == 512 and it.param1 == 0.0:
            self.tell_heartbeat()
        elif it.command == 22 and self.target[0] == "up":
            result = 4
        elif it.command == 22:
            self.target, self.target_s = ("up", [it.param7]), time.monotonic() + 1e6
        if it.command in self.swallowed:
            self.swallowed.discard(it.command)
            return
        self.send(m.MAVLink_command_ack_message(it.command, result))

    def arm(self, wanted: float, magic: float) -> int:
        if wanted == 0.0 and (self.deck or self.up > 0.1) and magic != 21196:
            return 4
        self.armed = wanted != 0.0
        return 0

    def change_mode(self, main: int, sub: int) -> int:
        if main in self.denied:
            return 4
        if self.px4:
            if main == 6 and time.monotonic() - self.target_s > 0.5:
                return 1
            self.mode = main << 16 | sub << 24
        else:
            self.mode = main
        self.target = ("hold", [])
        return 0

    def on_param_request_read(self, it: Any) -> None:
        values = PX4_PARAMETERS if self.px4 else PARAMETERS
        if it.param_id in values and it.param_id not in self.unanswered:
            self.tell_parameter(it.param_id, values)

    def tell_parameter(self, name: str, values: dict[str, float]) -> None:
        kind = m.MAV_PARAM_TYPE_REAL32
        self.send(m.MAVLink_param_value_message(name.encode(), values[name], kind, len(values), 0))

    def on_timesync(self, it: Any) -> None:
        if it.tc1 == 0:
            self.send(m.MAVLink_timesync_message(int((time.monotonic() - self.booted_s) * 1e9), it.ts1))

    # physics

    def step(self) -> None:
        now_s = time.monotonic()
        kind, values = self.target
        age_s = now_s - self.target_s
        deaf = self.px4 and PX4_PARAMETERS["COM_OBL_RC_ACT"] < 2.0 and PX4_PARAMETERS.get("COM_RC_IN_MODE") == 4.0
        if self.px4 and self.mode == OFFBOARD and 1.8 < age_s < 1e5 and math.isfinite(age_s) and not deaf:
            self.mode = 3 << 16
        if age_s > (1.0 if self.px4 else 3.0) and not deaf:
            kind, values = "hold", []
        tilt, wanted, turn = [0.0, 0.0], [0.0, 0.0, 0.0], 0.0
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        if kind == "tilt":
            tilt = [values[0], values[1]]
            off = (values[2] - self.yaw + math.pi) % (2 * math.pi) - math.pi
            turn, wanted[2] = 3.0 * off, values[3]
        elif kind == "speed":
            forward, right, up, turn = values
            wanted = [c * forward - s * right, s * forward + c * right, up]
        elif kind == "up":
            wanted[2] = max(-1.0, min(1.0, values[0] - self.up))
        if kind != "tilt":
            push = [1.5 * (wanted[0] - self.velocity[0]), 1.5 * (wanted[1] - self.velocity[1])]
            ahead, aside = c * push[0] + s * push[1], c * push[1] - s * push[0]
            tilt = [math.atan(aside / 9.81), -math.atan(ahead / 9.81)]
        self.roll += (tilt[0] - self.roll) * STEP_S / 0.15
        self.pitch += (tilt[1] - self.pitch) * STEP_S / 0.15
        self.yaw = (self.yaw + turn * STEP_S + math.pi) % (2 * math.pi) - math.pi
        ahead, aside = -9.81 * math.tan(self.pitch), 9.81 * math.tan(self.roll)
        drag = 0.3 if kind == "tilt" else 0.0
        self.velocity[0] += (c * ahead - s * aside - drag * self.velocity[0]) * STEP_S
        self.velocity[1] += (s * ahead + c * aside - drag * self.velocity[1]) * STEP_S
        self.velocity[2] += (wanted[2] - self.velocity[2]) * STEP_S / 0.3
        throttle = 0.39
        if self.deck:  # stands on a deck that heaves; a commanded descent runs the throttle down
            self.velocity[2] = 0.6 * math.sin(1.2 * (now_s - self.deck_s))
            throttle = 0.05 if wanted[2] < -0.05 else 0.39
        if self.updraft:
            self.velocity[2], throttle = -0.4, 0.59 * 0.39
        self.throttle += (throttle - self.throttle) * STEP_S / 0.3
        if not self.armed:
            self.velocity, self.throttle = [0.0, 0.0, 0.0], 0.0
        self.north += self.velocity[0] * STEP_S
        self.east += self.velocity[1] * STEP_S
        self.up += self.velocity[2] * STEP_S

    # out

    def send(self, message: Any) -> None:
        if message.get_type() in self.withheld or message.get_msgId() in self.halted:
            return
        if time.monotonic() > max(self.silent_until_s, self.mute_until_s):
            data = message.pack(self.out)
            self.out.seq = (self.out.seq + 1) % 256
            self.late.append((time.monotonic() + self.lag_s, data))
            self.deliver()

    def deliver(self) -> None:
        while self.late and self.late[0][0] <= time.monotonic():
            self.socket.sendto(self.late.popleft()[1], self.to)

    def tell(self, turn: int) -> None:
        boot_ms = int((time.monotonic() - self.booted_s) * 1000)
        north, east, up = self.velocity
        if turn % self.heartbeat_every == 0:
            self.tell_heartbeat()
        if turn % 100 == 0:
            self.send(m.MAVLink_battery_status_message(0, 0, 0, 300, [65535] * 10, 0, 0, 0, 87))
        if turn % 4 == 0:
            self.send(m.MAVLink_attitude_message(boot_ms, self.roll, self.pitch, self.yaw, 0, 0, 0))
            self.send(m.MAVLink_local_position_ned_message(boot_ms, self.north, self.east, -self.up, north, east, -up))
        if turn % 8 == 0:
            self.send(m.MAVLink_vfr_hud_message(0, 0, 0, int(100 * self.throttle), self.up, up))
            height_mm = int(1000 * self.up)
            self.send(m.MAVLink_global_position_int_message(boot_ms, 0, 0, height_mm, height_mm, 0, 0, 0, 0))
        if turn % 10 == 0:
            sticks = [*self.sticks_us, *[0] * (18 - len(self.sticks_us))]
            self.send(m.MAVLink_rc_channels_message(boot_ms, 8 if self.sticks_us else 0, *sticks, 255))
            healthy = 0x7FFFFFFE if self.sick else 0x7FFFFFFF
            self.send(m.MAVLink_sys_status_message(0xFFFF, 0xFFFF, healthy, 0, 12000, 0, 87, 0, 0, 0, 0, 0, 0))

    def tell_heartbeat(self) -> None:
        kind = m.MAV_AUTOPILOT_PX4 if self.px4 else m.MAV_AUTOPILOT_ARDUPILOTMEGA
        base = (128 if self.armed else 0) | 1
        self.send(m.MAVLink_heartbeat_message(m.MAV_TYPE_QUADROTOR, kind, base, self.mode, 4, 3))

    def report(self) -> dict[str, Any]:
        return {
            "mode": self.mode, "armed": self.armed, "up": self.up, "speed": math.hypot(*self.velocity[:2]),
            "target": self.target[0], "values": self.target[1], "age_s": time.monotonic() - self.target_s,
            "counts": self.counts, "commands": self.commands, "refusals": self.refusals,
            "gaps_s": self.gaps_s[-2000:],
        }  # fmt: skip

    def hear(self, words: list[str]) -> None:
        now_s = time.monotonic()
        if words[0] == "mode":
            self.mode = int(words[1])
        elif words[0] == "sticks":
            given = [int(word) for word in words[1:]]
            self.sticks_us = [*given, *self.sticks_us[len(given) :]] if given else []
        elif words[0] == "silent":
            self.silent_until_s = now_s + float(words[1])
        elif words[0] == "mute":
            self.mute_until_s = now_s + float(words[1])
        elif words[0] == "lag":
            self.lag_s = float(words[1])
        elif words[0] == "set":
            values = PX4_PARAMETERS if self.px4 else PARAMETERS
            values[words[1]] = float(words[2])
            self.tell_parameter(words[1], values)  # as to every ground station that listens
        elif words[0] == "reboot":
            self.booted_s = now_s
        elif words[0] == "deck":
            self.deck, self.deck_s, self.up = True, now_s, 0.0
        elif words[0] == "updraft":
            self.updraft = True
        elif words[0] == "lose":
            self.unanswered.add(words[1])
        elif words[0] == "deny":
            self.denied = {int(word) for word in words[1:]}
        elif words[0] in ("refuse", "miss", "swallow"):
            {"refuse": self.refused, "miss": self.missed, "swallow": self.swallowed}[words[0]].add(int(words[1]))
        elif words[0] == "halt":
            self.halted.add(getattr(m, f"MAVLINK_MSG_ID_{words[1]}"))
        elif words[0] == "withhold":
            self.withheld = set(words[1:])
        elif words[0] == "deaf":
            self.deaf = int(words[1])
        elif words[0] in ("sick", "well"):
            self.sick = words[0] == "sick"
        elif words[0] == "report":
            print(json.dumps(self.report()), flush=True)


def main() -> None:
    key = bytes.fromhex(sys.argv[3]) if len(sys.argv) > 3 else None
    run(Autopilot(int(sys.argv[1]), sys.argv[2] == "px4", key))


def run(autopilot: Autopilot) -> None:
    def obey_input() -> None:
        for line in sys.stdin:
            if line.strip():
                autopilot.hear(line.split())

    threading.Thread(target=obey_input, daemon=True).start()
    due_s, turn = time.monotonic(), 0
    while True:
        autopilot.listen()
        autopilot.step()
        autopilot.tell(turn)
        autopilot.deliver()
        turn += 1
        due_s = max(due_s + STEP_S, time.monotonic() - 0.1)
        time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    main()
