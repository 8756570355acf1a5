"""The interface by which an ArduPilot flies somebody's physics: servo pulses in, one JSON line of state out, over UDP.

The flight controller sends a packet a step and waits for the answer; its clock is our time stamp.
"""

from __future__ import annotations

import json
import math
import struct
from dataclasses import dataclass

import numpy as np

from shipland.frames import GRAVITY_MPS2, Array, rotation_from_quaternion
from shipland.sim.aircraft.aircraft import Motion
from shipland.sim.aircraft.parameters import Vector

_MAGIC_16, _MAGIC_32 = 18458, 29569
_HEAD = struct.Struct("<HHI")


@dataclass(frozen=True)
class ServoPacket:
    """What the flight controller sends.

    Attributes:
        rate_hz: steps a second that it wants.
        count: of steps; it starts anew when the flight controller does.
        pulses_us: 16 or 32 servo outputs.
    """

    rate_hz: int
    count: int
    pulses_us: tuple[int, ...]

    @staticmethod
    def parse(data: bytes) -> ServoPacket | None:
        """The packet; None for what is none."""
        if len(data) < _HEAD.size:
            return None
        magic, rate_hz, count = _HEAD.unpack_from(data)
        channels = {_MAGIC_16: 16, _MAGIC_32: 32}.get(magic, 0)
        if not channels or len(data) != _HEAD.size + 2 * channels:
            return None
        return ServoPacket(rate_hz, count, struct.unpack_from(f"<{channels}H", data, _HEAD.size))


def state_line(t_s: float, motion: Motion, force_in_body_mps2: Vector, origin_m: Vector) -> bytes:
    """The answer.

    Args:
        t_s: physics time.
        motion: of the centre of mass in `ned`.
        force_in_body_mps2: what accelerometers feel.
        origin_m: `ned` place that the flight controller takes for its home.
    """
    where = [value - home for value, home in zip(motion.position_m, origin_m, strict=True)]
    state = {
        "timestamp": t_s,
        "imu": {"gyro": list(motion.rates_rad_s), "accel_body": list(force_in_body_mps2)},
        "position": where,
        "quaternion": list(motion.quaternion),
        "velocity": list(motion.velocity_mps),
    }
    # a parser that knows no blanks
    return b"\n" + json.dumps(state, separators=(",", ":")).encode() + b"\n"


def felt_in_body_mps2(before: Motion, after: Motion, step_s: float) -> Vector:
    """Specific force along `body`: acceleration without gravity, contacts included.

    Args:
        before: motion at the step's start.
        after: at its end.
        step_s: that step [s].
    """
    change = np.array(after.velocity_mps) - np.array(before.velocity_mps)
    felt_in_ned: Array = change / step_s - np.array([0.0, 0.0, GRAVITY_MPS2])
    forward, right, down = (rotation_from_quaternion(np.array(after.quaternion)).T @ felt_in_ned).tolist()
    return forward, right, down


def mount_pitch_rad(pulse_us: float) -> float | None:
    """Pitch that a gimbal's servo output asks for, 1000 µs being straight down and 2000 µs up; None without one."""
    if not 800.0 <= pulse_us <= 2200.0:
        return None
    return 0.5 * math.pi * min(max((pulse_us - 1500.0) / 500.0, -1.0), 1.0)
