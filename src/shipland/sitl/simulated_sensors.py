"""What a flight controller's sensors say of a simulated motion: inertial unit, magnetometer, barometer, GPS."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipland.frames import Array, rotation_from_quaternion
from shipland.sim.aircraft.aircraft import RigidBodyState
from shipland.sim.aircraft.parameters import Vector

HOME_LATITUDE_DEG, HOME_LONGITUDE_DEG, HOME_HEIGHT_M = 60.0, 4.0, 0.0
"""Where the aircraft waits: at sea, off Norway."""
_DECLINATION_RAD, _INCLINATION_RAD, _FIELD_GAUSS = math.radians(1.9), math.radians(72.8), 0.513
"""The earth's field there: World Magnetic Model 2025."""
EARTH_RADIUS_M = 6371000.0
"""Radius of the sphere on which PX4 projects."""

# noise, all chosen: small MEMS sensors, and a GPS with a clear sky
_ACCELEROMETER_MPS2, _GYROSCOPE_RAD_S, _MAGNETOMETER_GAUSS, _BAROMETER_HPA = 0.05, 0.002, 0.003, 0.02
_GPS_LEVEL_M, _GPS_HEIGHT_M, _GPS_WANDER_S, _GPS_VELOCITY_MPS = 0.3, 0.5, 30.0, 0.03


class Inertial(NamedTuple):
    """Accelerometers [m/s²], gyroscopes [rad/s], magnetometers [gauss], each along `body`; the air's pressure [hPa]."""

    force_mps2: Vector
    rates_rad_s: Vector
    field_gauss: Vector
    pressure_hpa: float
    height_m: float


class Fix(NamedTuple):
    """A GPS fix: degrees, height over the sea [m], velocity in `ned` [m/s]."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    velocity_mps: Vector


class SimulatedSensors:
    """Sensors with white noise, and a GPS whose place wanders.

    Args:
        rng: of the noise.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        level = _FIELD_GAUSS * math.cos(_INCLINATION_RAD)
        self._field_in_ned = np.array(
            [
                level * math.cos(_DECLINATION_RAD),
                level * math.sin(_DECLINATION_RAD),
                _FIELD_GAUSS * math.sin(_INCLINATION_RAD),
            ]
        )
        self._wander_m = self._rng.normal(0.0, (_GPS_LEVEL_M, _GPS_LEVEL_M, _GPS_HEIGHT_M))
        self._fix_t_s = math.nan

    def inertial(self, motion: RigidBodyState, force_in_body_mps2: Vector) -> Inertial:
        """Everything of the inertial unit's board.

        Args:
            motion: true; its place from home in `ned`.
            force_in_body_mps2: specific force, averaged since the last reading.
        """
        height_m = HOME_HEIGHT_M - motion.position_m[2]
        body_from_ned = rotation_from_quaternion(np.array(motion.quaternion)).T
        return Inertial(
            self._noisy(force_in_body_mps2, _ACCELEROMETER_MPS2),
            self._noisy(motion.rates_rad_s, _GYROSCOPE_RAD_S),
            self._noisy(body_from_ned @ self._field_in_ned, _MAGNETOMETER_GAUSS),
            pressure_hpa(height_m) + float(self._rng.normal(0.0, _BAROMETER_HPA)),
            height_m,
        )

    def fix(self, t_s: float, motion: RigidBodyState) -> Fix:
        """A fix at `t_s`, later than the last."""
        step_s = t_s - self._fix_t_s if math.isfinite(self._fix_t_s) else 0.0
        keep, std_m = math.exp(-step_s / _GPS_WANDER_S), (_GPS_LEVEL_M, _GPS_LEVEL_M, _GPS_HEIGHT_M)
        self._wander_m = keep * self._wander_m + math.sqrt(1.0 - keep * keep) * self._rng.normal(0.0, std_m)
        self._fix_t_s = t_s
        north_m, east_m, down_m = (np.array(motion.position_m) + self._wander_m).tolist()
        return Fix(
            HOME_LATITUDE_DEG + math.degrees(north_m / EARTH_RADIUS_M),
            HOME_LONGITUDE_DEG + math.degrees(east_m / EARTH_RADIUS_M / math.cos(math.radians(HOME_LATITUDE_DEG))),
            HOME_HEIGHT_M - down_m,
            self._noisy(motion.velocity_mps, _GPS_VELOCITY_MPS),
        )

    def _noisy(self, value: Vector | Array, std: float) -> Vector:
        first, second, third = (np.asarray(value) + self._rng.normal(0.0, std, 3)).tolist()
        return first, second, third


def pressure_hpa(height_m: float) -> float:
    """The standard atmosphere's pressure.

    >>> round(pressure_hpa(0.0), 2), round(pressure_hpa(100.0), 2)
    (1013.25, 1001.29)
    """
    return 1013.25 * math.pow(1.0 - 0.0065 * height_m / 288.15, 5.25588)
