"""What the aircraft measures of itself, with errors, and the gimbal that carries the camera."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipland.camera import CameraParameters
from shipland.frames import Array, euler_from_quaternion, wrap_angle
from shipland.sim.aircraft.aircraft import RigidBodyState
from shipland.sim.aircraft.autopilot import Sensed, State
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

    def draws(self, count: int) -> list[float]:
        """The next `count`."""
        left = len(self._values) - count
        if left < 0:
            return [self.draw() for _ in range(count)]
        drawn = self._values[left:][::-1]
        del self._values[left:]
        return drawn


class Coloured:
    """First-order noise of a given standard deviation, from its start on, and time constant, at a fixed step."""

    def __init__(self, deviation: float, time_s: float, step_s: float, normals: Normals) -> None:
        self._normals = normals
        self.keep = math.exp(-step_s / time_s)
        self.add = deviation * math.sqrt(1.0 - self.keep * self.keep)
        self.value = deviation * normals.draw()

    def step(self) -> float:
        """The next value."""
        self.value = self.keep * self.value + self.add * self._normals.draw()
        return self.value


class Gimbal:
    """Holds the horizon but for a bias and a residual motion; slews its pitch at a limited rate.

    Args:
        camera: rate, range, bias and residual.
        sensors: the residual's time constant.
        step_s: time between steps [s].
        normals: noise.
    """

    def __init__(self, camera: CameraParameters, sensors: SensorParameters, step_s: float, normals: Normals) -> None:
        self._camera = camera
        self._step_s = step_s
        self._normals = normals
        self._bias_rad = (camera.gimbal_bias_rad * normals.draw(), camera.gimbal_bias_rad * normals.draw())
        residual = (camera.gimbal_noise_rad, sensors.gimbal_noise_time_s, step_s, normals)
        self._roll, self._pitch = Coloured(*residual), Coloured(*residual)
        self.pitch_rad = 0.0
        """What the gimbal itself believes: neither bias nor residual motion."""
        self.pitch_rate_rad_s = 0.0

    @property
    def residual(self) -> tuple[float, float]:
        """What a step keeps of the residual motion, and what it adds to it in standard normal numbers."""
        return self._roll.keep, self._roll.add

    @property
    def state(self) -> State:
        """What it remembers between steps: pitch, its rate, residual roll and pitch."""
        return self.pitch_rad, self.pitch_rate_rad_s, self._roll.value, self._pitch.value

    @state.setter
    def state(self, values: State) -> None:
        self.pitch_rad, self.pitch_rate_rad_s, self._roll.value, self._pitch.value = values

    def draw(self, count: int) -> Array:
        """The next `count` standard normal numbers of the residual motion."""
        return np.array(self._normals.draws(count))

    @property
    def roll_error_rad(self) -> float:
        """True roll of the camera; the gimbal believes it zero."""
        return self._bias_rad[0] + self._roll.value

    @property
    def pitch_error_rad(self) -> float:
        """True pitch of the camera minus `pitch_rad`."""
        return self._bias_rad[1] + self._pitch.value

    def step(self, wanted_rad: float) -> None:
        """One step towards the commanded pitch."""
        wanted_rad = min(max(wanted_rad, self._camera.gimbal_min_rad), self._camera.gimbal_max_rad)
        most = self._camera.gimbal_rate_rad_s * self._step_s
        change = min(max(wanted_rad - self.pitch_rad, -most), most)
        self.pitch_rad += change
        self.pitch_rate_rad_s = change / self._step_s
        self._roll.step()
        self._pitch.step()


class Surface(NamedTuple):
    """What the downward camera sees.

    Attributes:
        north_mps, east_mps: its velocity over ground.
        water_share: part of the view that is water.
    """

    north_mps: float
    east_mps: float
    water_share: float


class Senses:
    """The aircraft's estimates of itself: what its autopilot flies on, and what telemetry reports.

    Velocity is over ground, or over the surface in view: optical flow with its slow bias, the water's own motion, and
    losses over water, during which the autopilot flies on by its accelerometers and nothing is reported. Place is the
    integral of velocity.

    Args:
        sensors: sizes of the errors.
        over_ground: velocity comes from GPS, not from optical flow.
        step_s: time between `sense` calls [s].
        slow_step_s: time between `look` calls [s].
        rng: draws the errors.
    """

    def __init__(
        self, sensors: SensorParameters, over_ground: bool, step_s: float, slow_step_s: float, rng: np.random.Generator
    ) -> None:
        self._sensors, self._over_ground, self._step_s = sensors, over_ground, step_s
        self._normals, self._rng = Normals(rng), rng
        draw = self._normals.draw
        velocity = (sensors.velocity_noise_mps, sensors.velocity_noise_time_s, slow_step_s, self._normals)
        bias = (sensors.flow_bias_mps, sensors.flow_bias_time_s, slow_step_s, self._normals)
        waves = (sensors.flow_wave_mps, sensors.flow_wave_time_s, slow_step_s, self._normals)
        self._noise = [Coloured(*velocity) for _ in range(3)]
        self._bias = [Coloured(*bias) for _ in range(2)]
        self._waves = [Coloured(*waves) for _ in range(2)]
        self._roll_bias_rad, self._pitch_bias_rad = (sensors.attitude_bias_rad * draw() for _ in range(2))
        self._heading_bias_rad = sensors.heading_bias_rad * draw()
        self._drift_m, self._drift_step_m = 0.0, sensors.height_drift_m_per_sqrt_s * math.sqrt(slow_step_s)
        self._settle = -math.expm1(-slow_step_s / sensors.flow_settle_s)
        self._back_share = slow_step_s / sensors.flow_lost_s
        self._lose_share = self._back_share * sensors.flow_lost_share / (1.0 - sensors.flow_lost_share)
        self._seen: tuple[float, float] | None = None
        self._error = (self._noise[0].value, self._noise[1].value, self._noise[2].value)
        self.stray_m = (0.0, 0.0)
        """What the integrated velocity has strayed by."""
        self.flow_lost = False
        """Whether there is no velocity to report."""

    @property
    def state(self) -> State:
        """Errors of velocity, what place has strayed by, height's drift, biases of the three angles."""
        biases = (self._roll_bias_rad, self._pitch_bias_rad, self._heading_bias_rad)
        return *self._error, *self.stray_m, self._drift_m, *biases

    def look(self, surface: Surface) -> None:
        """Advance the slow errors, with the surface now in view."""
        error_n, error_e, error_d = (noise.step() for noise in self._noise)
        self._drift_m += self._drift_step_m * self._normals.draw()
        chance = self._rng.random()
        if not self._over_ground:
            waves = [wave.step() * surface.water_share for wave in self._waves]
            seen = (surface.north_mps + waves[0], surface.east_mps + waves[1])
            old = self._seen or seen
            self._seen = (
                old[0] + self._settle * (seen[0] - old[0]),
                old[1] + self._settle * (seen[1] - old[1]),
            )
            error_n += self._bias[0].step() - self._seen[0]
            error_e += self._bias[1].step() - self._seen[1]
            change = self._back_share if self.flow_lost else self._lose_share * surface.water_share
            if chance < change or surface.water_share <= 0.0:
                self.flow_lost = surface.water_share > 0.0 and not self.flow_lost
        self._error = (error_n, error_e, error_d)

    def sense(self, motion: RigidBodyState) -> Sensed:
        """The motion as the aircraft believes it; one step."""
        u, v, w = self._error
        self.stray_m = stray_m = (self.stray_m[0] + u * self._step_s, self.stray_m[1] + v * self._step_s)
        north, east, down = motion.position_m
        v_north, v_east, v_down = motion.velocity_mps
        roll, pitch, heading = euler_from_quaternion(motion.quaternion)
        return Sensed(
            north + stray_m[0],
            east + stray_m[1],
            down - self._drift_m,
            v_north + u,
            v_east + v,
            v_down + w,
            roll + self._roll_bias_rad,
            pitch + self._pitch_bias_rad,
            heading + self._heading_bias_rad,
            *motion.rates_rad_s,
        )


class Readings(NamedTuple):
    """One reading of every instrument.

    Attributes:
        t_s: when the values were true.
        roll_rad, pitch_rad, heading_rad: attitude; heading clockwise from north.
        height_m: above the sea plane.
        velocity_in_level_mps: over the velocity reference, forward-right-down; None while the flow is lost.
    """

    t_s: float
    roll_rad: float
    pitch_rad: float
    heading_rad: float
    height_m: float
    velocity_in_level_mps: Vector | None


def read_instruments(
    sensors: SensorParameters, t_s: float, sensed: Sensed, flow_lost: bool, rng: np.random.Generator
) -> Readings:
    """What the instruments say at `t_s` [s]: the autopilot's estimates with a reading's noise."""
    a, b, c, d = rng.standard_normal(4).tolist()
    cos_heading, sin_heading = math.cos(sensed.heading_rad), math.sin(sensed.heading_rad)
    north, east = sensed.north_mps, sensed.east_mps
    level = (cos_heading * north + sin_heading * east, cos_heading * east - sin_heading * north, sensed.down_mps)
    return Readings(
        t_s,
        sensed.roll_rad + sensors.attitude_noise_rad * a,
        sensed.pitch_rad + sensors.attitude_noise_rad * b,
        wrap_angle(sensed.heading_rad + sensors.heading_noise_rad * c),
        -sensed.down_m + sensors.height_noise_m * d,
        None if flow_lost else level,
    )


class LandingDetector:
    """Whether the aircraft takes itself for landed, from its downward rangefinder and a felt impact.

    Two low-passes of the noisy range give it and its rate.

    Args:
        range_m: under which the aircraft may take itself for landed.
        confirm_s: for how long, with an impact or no more descent.
        noise_m: of one reading.
        step_s: time between readings [s].
        rng: draws the noise.
    """

    LISTEN_M = 0.1
    """Readings above this, and above three times `range_m`, count as no surface."""
    _FILTER_S = 0.03
    _STILL_MPS = 0.05

    def __init__(
        self, range_m: float, confirm_s: float, noise_m: float, step_s: float, rng: np.random.Generator
    ) -> None:
        self._limit_m, self._confirm_s, self._noise_m, self._step_s = range_m, confirm_s, noise_m, step_s
        self._normals = Normals(rng)
        self.listen_m = max(self.LISTEN_M, 3.0 * range_m)
        self._share = -math.expm1(-step_s / self._FILTER_S)
        self.reset()

    def reset(self) -> None:
        """No surface in range, or no landing wanted."""
        self._range_m = self._slow_m = math.inf
        self._landed_for_s, self._impact = 0.0, False

    def landed(self, range_m: float, impact: bool) -> bool:
        """One reading.

        Args:
            range_m: true clearance of the lowest foot; infinite without a surface.
            impact: whether the accelerometers feel one now.
        """
        if range_m > self.listen_m:
            self.reset()
            return False
        reading_m = range_m + self._noise_m * self._normals.draw()
        if math.isinf(self._range_m):
            self._range_m = self._slow_m = reading_m
        self._range_m += self._share * (reading_m - self._range_m)
        self._slow_m += self._share * (self._range_m - self._slow_m)
        if self._range_m > self._limit_m:
            self._landed_for_s, self._impact = 0.0, False
            return False
        self._impact = self._impact or impact
        ended = (self._slow_m - self._range_m) / self._FILTER_S < self._STILL_MPS
        self._landed_for_s = self._landed_for_s + self._step_s if self._impact or ended else 0.0
        return self._landed_for_s >= self._confirm_s
