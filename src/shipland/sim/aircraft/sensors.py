"""What the aircraft measures of itself, with errors, and the gimbal that carries the camera."""

from __future__ import annotations

import math

import numpy as np

from shipland.camera import CameraParameters
from shipland.frames import wrap_angle
from shipland.messages import Telemetry
from shipland.sim.aircraft.parameters import SensorParameters, Vector

_BLOCK = 1024


class Normals:
    """Standard normal draws, taken from the generator in blocks because single draws are slow."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._values: list[float] = []

    def draw(self) -> float:
        """The next one."""
        if not self._values:
            self._values = self._rng.standard_normal(_BLOCK).tolist()
        return self._values.pop()


class Coloured:
    """First-order noise of a given standard deviation and time constant, at a fixed step; starts from its spread."""

    def __init__(self, deviation: float, time_s: float, step_s: float, normals: Normals) -> None:
        self._normals = normals
        self._keep = math.exp(-step_s / time_s)
        self._add = deviation * math.sqrt(1.0 - self._keep * self._keep)
        self.value = deviation * normals.draw()

    def step(self) -> float:
        """The next value."""
        self.value = self._keep * self.value + self._add * self._normals.draw()
        return self.value


class Gimbal:
    """Holds the horizon in roll and pitch but for a residual motion; slews its pitch at a limited rate.

    Args:
        camera: rate, range and residual.
        sensors: the residual's time constant.
        step_s: time between steps [s].
        normals: noise.
    """

    def __init__(self, camera: CameraParameters, sensors: SensorParameters, step_s: float, normals: Normals) -> None:
        self._camera = camera
        self._step_s = step_s
        residual = (camera.gimbal_noise_rad, sensors.gimbal_noise_time_s, step_s, normals)
        self._roll, self._pitch = Coloured(*residual), Coloured(*residual)
        self.pitch_rad = 0.0
        """What the gimbal itself believes: residual motion not included."""
        self.pitch_rate_rad_s = 0.0
        self.roll_error_rad, self.pitch_error_rad = self._roll.value, self._pitch.value

    def step(self, wanted_rad: float) -> None:
        """One step towards the pitch asked for."""
        wanted_rad = min(max(wanted_rad, self._camera.gimbal_min_rad), self._camera.gimbal_max_rad)
        most = self._camera.gimbal_rate_rad_s * self._step_s
        change = min(max(wanted_rad - self.pitch_rad, -most), most)
        self.pitch_rad += change
        self.pitch_rate_rad_s = change / self._step_s
        self.roll_error_rad, self.pitch_error_rad = self._roll.step(), self._pitch.step()


class Instruments:
    """Telemetry's errors.

    Args:
        parameters: their sizes.
        rng: draws them; used by nothing else, so that asking for telemetry changes no flight.
    """

    def __init__(self, parameters: SensorParameters, rng: np.random.Generator) -> None:
        self._parameters = parameters
        self._rng = rng
        self._heading_bias_rad = parameters.heading_bias_rad * float(rng.standard_normal())
        self._drift_m = 0.0
        self._drift_s = 0.0

    def telemetry(
        self,
        t_s: float,
        attitude: Vector,
        height_m: float,
        velocity_in_level_mps: Vector,
        distance_m: float,
        flying: bool,
    ) -> Telemetry:
        """One report at `t_s` [s].

        Args:
            t_s: now; must not decrease between calls.
            attitude: roll, pitch, heading [rad], true.
            height_m: above the sea plane, true.
            velocity_in_level_mps: the aircraft's own estimate.
            distance_m: to the base station, for the link.
            flying: whether the motors run.
        """
        p = self._parameters
        noise = self._rng.standard_normal(5).tolist()
        passed_s, self._drift_s = max(t_s - self._drift_s, 0.0), max(t_s, self._drift_s)
        self._drift_m += p.height_drift_m_per_sqrt_s * math.sqrt(passed_s) * noise[4]
        roll, pitch, heading = attitude
        return Telemetry(
            t_s=t_s,
            roll_rad=roll + p.attitude_noise_rad * noise[0],
            pitch_rad=pitch + p.attitude_noise_rad * noise[1],
            heading_rad=wrap_angle(heading + self._heading_bias_rad + p.heading_noise_rad * noise[2]),
            height_m=height_m + self._drift_m + p.height_noise_m * noise[3],
            velocity_in_level_mps=np.array(velocity_in_level_mps),
            battery_percent=max(0.0, 100.0 * (1.0 - t_s / p.endurance_s)),
            link_percent=max(0.0, 100.0 * (1.0 - distance_m / p.link_range_m)),
            flying=flying,
        )
