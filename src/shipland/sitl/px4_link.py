"""The interface by which a PX4 flies somebody's physics: MAVLink's HIL messages over TCP, in lockstep.

The server's HIL_SENSOR is the flight controller's clock: it reckons one step and answers with HIL_ACTUATOR_CONTROLS,
for which the world waits. The world keeps to real time, because the pilot does.
"""

from __future__ import annotations

import math
import select
import socket
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager

import numpy as np

from shipland.errors import ConfigError
from shipland.frames import Array, rotation_from_quaternion
from shipland.sim.aircraft.parameters import Vector
from shipland.sim.aircraft.record import RigidBodyState
from shipland.sitl.physics import STEP_S, FlightStep, ServedFlight
from shipland.vehicles.mavlink.dialect import Codec, Message, dialect

HOME_LATITUDE_DEG, HOME_LONGITUDE_DEG, HOME_HEIGHT_M = 60.0, 4.0, 0.0
"""Where the aircraft waits: at sea, off Norway."""
_DECLINATION_RAD, _INCLINATION_RAD, _FIELD_GAUSS = math.radians(1.9), math.radians(72.8), 0.513
"""The earth's field there: World Magnetic Model 2025."""
EARTH_RADIUS_M = 6371000.0
"""Radius of the sphere on which PX4 projects."""

# noise, all chosen: small MEMS sensors, and a GPS with a clear sky
_ACCELEROMETER_MPS2, _GYROSCOPE_RAD_S, _MAGNETOMETER_GAUSS, _BAROMETER_HPA = 0.05, 0.002, 0.003, 0.02
_GPS_PLACE_M, _GPS_WANDER_S, _GPS_VELOCITY_MPS = (0.3, 0.3, 0.5), 30.0, 0.03
_ALL_SENSORS = 0x1BFF
"""HIL_SENSOR's `fields_updated` without differential pressure: three axes three times, pressure, height, degrees."""
_TEMPERATURE_C = 15.0
_FIX_3D, _SATELLITES, _UNKNOWN_COURSE = 3, 12, 65535
_FIX_LEVEL_CM, _FIX_HEIGHT_CM = 40, 60
"""Claimed accuracy."""


class SimulatedSensors:
    """Sensors with white noise, and a GPS whose place wanders."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        level, down = _FIELD_GAUSS * math.cos(_INCLINATION_RAD), _FIELD_GAUSS * math.sin(_INCLINATION_RAD)
        self._field_in_ned = np.array([level * math.cos(_DECLINATION_RAD), level * math.sin(_DECLINATION_RAD), down])
        self._wander_m = self._rng.normal(0.0, _GPS_PLACE_M)
        self._fix_t_s = math.nan

    def inertial(self, t_us: int, motion: RigidBodyState, force_in_body_mps2: Vector) -> Message:
        """HIL_SENSOR: forces [m/s²], rates [rad/s] and field [gauss] along `body`, the air's pressure [hPa].

        Args:
            t_us: the flight controller's time.
            motion: true; its place from home in `ned`.
            force_in_body_mps2: specific force, averaged since the last reading.
        """
        height_m = HOME_HEIGHT_M - motion.position_m[2]
        body_from_ned = rotation_from_quaternion(np.array(motion.quaternion)).T
        return dialect.MAVLink_hil_sensor_message(
            t_us,
            *self._noisy(force_in_body_mps2, _ACCELEROMETER_MPS2),
            *self._noisy(motion.rates_rad_s, _GYROSCOPE_RAD_S),
            *self._noisy(body_from_ned @ self._field_in_ned, _MAGNETOMETER_GAUSS),
            pressure_hpa(height_m) + float(self._rng.normal(0.0, _BAROMETER_HPA)),
            0.0, height_m, _TEMPERATURE_C, _ALL_SENSORS,
        )  # fmt: skip

    def fix(self, t_s: float, motion: RigidBodyState) -> Message:
        """HIL_GPS: a fix at `t_s`, later than the last."""
        step_s = t_s - self._fix_t_s if math.isfinite(self._fix_t_s) else 0.0
        keep = math.exp(-step_s / _GPS_WANDER_S)
        self._wander_m = keep * self._wander_m + math.sqrt(1.0 - keep * keep) * self._rng.normal(0.0, _GPS_PLACE_M)
        self._fix_t_s = t_s
        north_m, east_m, down_m = (np.array(motion.position_m) + self._wander_m).tolist()
        latitude_deg = HOME_LATITUDE_DEG + math.degrees(north_m / EARTH_RADIUS_M)
        longitude_deg = HOME_LONGITUDE_DEG + math.degrees(
            east_m / EARTH_RADIUS_M / math.cos(math.radians(HOME_LATITUDE_DEG))
        )
        cm_s = [round(100.0 * value) for value in self._noisy(motion.velocity_mps, _GPS_VELOCITY_MPS)]
        return dialect.MAVLink_hil_gps_message(
            round(1e6 * t_s), _FIX_3D, round(1e7 * latitude_deg), round(1e7 * longitude_deg),
            round(1e3 * (HOME_HEIGHT_M - down_m)), _FIX_LEVEL_CM, _FIX_HEIGHT_CM, round(math.hypot(*cm_s[:2])), *cm_s,
            _UNKNOWN_COURSE, _SATELLITES,
        )  # fmt: skip

    def _noisy(self, value: Vector | Array, std: float) -> Vector:
        first, second, third = (np.asarray(value) + self._rng.normal(0.0, std, 3)).tolist()
        return first, second, third


def pressure_hpa(height_m: float) -> float:
    """The standard atmosphere's pressure.

    >>> round(pressure_hpa(0.0), 2), round(pressure_hpa(100.0), 2)
    (1013.25, 1001.29)
    """
    return 1013.25 * math.pow(1.0 - 0.0065 * height_m / 288.15, 5.25588)


_STEPS = 4
"""Physics steps for each step of the flight controller: 250 Hz, as in PX4's own simulators."""
_FIX_EVERY = 25
"""Steps of the flight controller between two GPS fixes: 10 Hz."""
_ANSWER_S, _BOOT_ANSWER_S = 0.5, 0.01
"""Timeout of an answer, in flight and while the flight controller boots, when it does not answer."""
_CATCH_UP_S = 0.1
"""Largest delay behind the clock that the world catches up with."""
_GIMBAL_CHANNEL = 8
"""Output 9, from 0; -1 is straight down, 1 straight up."""
_IDLE_US = 1050.0
"""Least pulse of armed rotors: they turn."""


class Px4Link(AbstractContextManager["Px4Link"]):
    """The TCP port to which a PX4's simulator module connects.

    Raises:
        ConfigError: the port is taken.
    """

    def __init__(self, host: str, port: int, seed: int) -> None:
        self.address = f"tcp:{host}:{port}"
        """For people."""
        try:
            self._listener = socket.create_server((host, port))
        except OSError as error:
            raise ConfigError(f"cannot listen on {host}:{port}: {error.strerror}") from None
        self._listener.settimeout(1.0)
        self._client: socket.socket | None = None
        self._sensors = SimulatedSensors(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(4560,))))
        self._codec = Codec(1, 1)
        self.motors_us: Sequence[float] = (1000.0,) * 4
        """Asked of the motors: front right, rear left, front left, rear right, as PX4 numbers a quadrotor in X."""
        self.gimbal_pitch_rad: float | None = None
        """Asked of the gimbal, against the horizon."""

    def __exit__(self, *_: object) -> None:
        if self._client is not None:
            self._client.close()
        self._listener.close()

    def fly(self, flight: ServedFlight) -> None:
        """Step after step, until the flight is done or the flight controller goes."""
        client = self._accept(flight)
        due_s, count = time.monotonic(), 0
        while not flight.done:
            steps = [flight.step(self.motors_us, self.gimbal_pitch_rad) for _ in range(_STEPS)]
            try:
                self._tell(client, steps, count % _FIX_EVERY == 0)
                self._hear(client, _ANSWER_S if flight.held.released else _BOOT_ANSWER_S)
            except OSError:
                flight.say("the flight controller has gone")
                return
            count += 1
            due_s = max(due_s + _STEPS * STEP_S, time.monotonic() - _CATCH_UP_S)
            time.sleep(max(0.0, due_s - time.monotonic()))

    def _accept(self, flight: ServedFlight) -> socket.socket:
        while True:
            try:
                client, (host, port) = self._listener.accept()
            except TimeoutError:
                continue
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.settimeout(1.0)
            self._client = client
            flight.say(f"a flight controller at {host}:{port}, {1.0 / (_STEPS * STEP_S):.0f} Hz")
            return client

    def _tell(self, client: socket.socket, steps: list[FlightStep], with_fix: bool) -> None:
        step = steps[-1]
        north, east, down = np.mean([each.force_in_body_mps2 for each in steps], axis=0).tolist()
        messages = [self._sensors.inertial(round(1e6 * step.t_s), step.motion, (north, east, down))]
        if with_fix:
            messages.insert(0, self._sensors.fix(step.t_s, step.motion))  # the sensors' message starts the step
        client.sendall(b"".join(self._codec.encode(message) for message in messages))

    def _hear(self, client: socket.socket, timeout_s: float) -> None:
        """Take what has come; wait for an answer to the step."""
        until_s = time.monotonic() + timeout_s
        answered = False
        while not answered and (left_s := until_s - time.monotonic()) > 0.0:
            if not select.select([client], [], [], left_s)[0]:
                return
            data = client.recv(65536)
            if not data:
                raise ConnectionResetError
            for message in self._codec.decode_some(data, stream=True)[0]:
                if message.get_type() == "HIL_ACTUATOR_CONTROLS":
                    self._take(message)
                    answered = True

    def _take(self, message: Message) -> None:
        """The newest HIL_ACTUATOR_CONTROLS; one with a value that is not finite changes nothing."""
        controls = message.controls
        if not all(map(math.isfinite, controls[:4])):
            return
        armed = bool(message.mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        self.motors_us = tuple(
            max(_IDLE_US, 1000.0 + 1000.0 * min(max(value, 0.0), 1.0)) if armed else 1000.0 for value in controls[:4]
        )
        pitch = controls[_GIMBAL_CHANNEL]
        if armed and math.isfinite(pitch):
            self.gimbal_pitch_rad = 0.5 * math.pi * min(max(pitch, -1.0), 1.0)
