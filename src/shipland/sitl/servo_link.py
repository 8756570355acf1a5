"""The interface by which an ArduPilot flies somebody's physics: servo pulses in, one JSON line of state out, over UDP.

The flight controller sends a packet a step and waits for the answer; its clock is our time stamp.
"""

from __future__ import annotations

import json
import math
import socket
import struct
from contextlib import AbstractContextManager
from dataclasses import dataclass

from shipland.errors import ConfigError
from shipland.sitl.physics import FlightStep, ServedFlight

_MAGIC_16, _MAGIC_32 = 18458, 29569
_HEAD = struct.Struct("<HHI")
_GIMBAL_CHANNEL = 8
"""Servo output 9, from 0."""


@dataclass(frozen=True)
class ServoPacket:
    """What the flight controller sends.

    Attributes:
        rate_hz: steps a second that it wants.
        count: of steps; it begins again when the flight controller does.
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


def state_line(step: FlightStep) -> bytes:
    """The answer to a packet."""
    motion = step.motion
    state = {
        "timestamp": step.t_s,
        "imu": {"gyro": list(motion.rates_rad_s), "accel_body": list(step.force_in_body_mps2)},
        "position": list(motion.position_m),
        "quaternion": list(motion.quaternion),
        "velocity": list(motion.velocity_mps),
    }
    # a parser that knows no blanks
    return b"\n" + json.dumps(state, separators=(",", ":")).encode() + b"\n"


class JsonLink(AbstractContextManager["JsonLink"]):
    """The UDP port of ArduPilot's `--model JSON`.

    Raises:
        ConfigError: the port is taken.
    """

    def __init__(self, host: str, port: int) -> None:
        self.address = f"udp:{host}:{port}"
        """For people."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise ConfigError(f"cannot listen on {host}:{port}: {error.strerror}") from None
        self._socket.settimeout(1.0)

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def fly(self, flight: ServedFlight) -> None:
        """One step a packet, until the flight is done, or has its verdict and the flight controller goes."""
        count, line = -1, b""
        while not flight.done:
            try:
                data, sender = self._socket.recvfrom(512)
            except TimeoutError:
                if flight.held.world.over():
                    return
                continue
            packet = ServoPacket.parse(data)
            if packet is None:
                continue
            if packet.count == count and line:
                self._socket.sendto(line, sender)  # it asks again for an answer that was lost
                continue
            if count < 0:
                flight.say(f"a flight controller at {sender[0]}:{sender[1]}, {packet.rate_hz} Hz")
            count = packet.count
            pulses_us = packet.pulses_us
            line = state_line(flight.step(pulses_us[:4], mount_pitch_rad(pulses_us[_GIMBAL_CHANNEL])))
            self._socket.sendto(line, sender)


def mount_pitch_rad(pulse_us: float) -> float | None:
    """Pitch that a gimbal's servo output asks for, 1000 µs being straight down and 2000 µs up; None without one."""
    if not 800.0 <= pulse_us <= 2200.0:
        return None
    return 0.5 * math.pi * min(max((pulse_us - 1500.0) / 500.0, -1.0), 1.0)
