"""What the aircraft measures of itself, with errors, the gimbal that carries the camera, and the surface below."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipland.camera import CameraParameters
from shipland.compiled import compiled
from shipland.frames import Array, euler_from_quaternion, wrap_angle
from shipland.rig import Rig, view_share
from shipland.sim.aircraft.loops import clip
from shipland.sim.aircraft.parameters import LoopParameters, SensorParameters, Vector
from shipland.sim.aircraft.record import Constants, Record, Records, Sensed, State, at

euler_of_quaternion = compiled(euler_from_quaternion)

_FAR = 10.0
"""Platform lengths beyond which no part of the ship is in view."""

_share = compiled(view_share)


def set_surface(record: Record, rig: Rig, sensors: SensorParameters, water: bool, full_ship: bool) -> None:
    """Set the constants of the ship and its surroundings, which the downward camera's square view straight down shows.

    At sea (`water`) the surface drifts; land stands still. A `full_ship`'s platform has the deck's motions.
    """
    record.set(
        flow_slope=math.tan(math.radians(0.5 * sensors.flow_view_deg)),
        water=float(water),
        water_drift=sensors.water_drift_share if water else 0.0,
        stern=-rig.deck_ahead_of_stern_m,
        bow=rig.platform_length_m - rig.deck_ahead_of_stern_m,
        half_width=0.5 * rig.platform_width_m,
        half_deck=0.5 * rig.deck_size_m,
        far=_FAR * rig.platform_length_m,
        full_ship=float(full_ship),
        deck_height=rig.deck_height_m,
        front=float(rig.bar_in_ship_m[0]),
    )


@compiled
def reach_m(states: Records) -> float:
    """Distance from the deck's centre."""
    s = states[0]
    x, y, z = s.x - s.deck_x, s.y - s.deck_y, s.z - s.deck_z
    return float(math.sqrt(x * x + y * y + z * z))


@compiled
def clearance_m(states: Records, constants: Records) -> float:
    """From the aircraft down to the highest that the deck reaches, or on to what stands ahead; at least."""
    s, k = states[0], constants[0]
    tilt = math.sin(min(abs(s.deck_roll) + abs(s.deck_pitch), 1.5))
    top = max(1.5 * k.half_deck * tilt - s.deck_z, k.deck_height)
    ahead = math.cos(s.course) * (s.x - s.ship_n) + math.sin(s.course) * (s.y - s.ship_e)
    front = k.front - ahead - (abs(s.deck_x - s.ship_n) if k.full_ship > 0.0 else 0.0)
    upright = 1.0 - 2.0 * (s.qx * s.qx + s.qy * s.qy)
    below = k.foot_below + k.radius * math.sqrt(max(1.0 - upright * upright, 0.0))
    return float(min(-s.z - top - below, front - k.radius))


@compiled
def surface_below(s: State, k: Constants) -> tuple[float, float, float]:
    """Velocity north and east of what is in view, averaged over the view; part of the view that is water."""
    north, east = k.water_drift * s.air_n, k.water_drift * s.air_e
    x, y, z = s.x - s.deck_x, s.y - s.deck_y, s.z - s.deck_z
    if max(abs(x), abs(y)) > k.far or z > 0.0:
        return north, east, k.water
    ahead, right = s.deck_fn * x + s.deck_fe * y + s.deck_fd * z, s.deck_rn * x + s.deck_re * y + s.deck_rd * z
    half = max(-z * k.flow_slope, 0.02)
    deck_share = _share(ahead, right, half, (-k.half_deck, k.half_deck, -k.half_deck, k.half_deck))
    hull_share = max(_share(ahead, right, half, (k.stern, k.bow, -k.half_width, k.half_width)) - deck_share, 0.0)
    rest = 1.0 - deck_share - hull_share
    deck_n, deck_e = s.deck_u - s.deck_turn_d * y, s.deck_v + s.deck_turn_d * x
    hull_n, hull_e = deck_n, deck_e
    if k.full_ship == 0.0:
        hull_n, hull_e = s.ship_u - s.course_rate * y, s.ship_v + s.course_rate * x
    return (
        rest * north + deck_share * deck_n + hull_share * hull_n,
        rest * east + deck_share * deck_e + hull_share * hull_e,
        rest if k.water > 0.0 else 0.0,
    )


_BLOCK = 1024


class Normals:
    """Standard normal draws, taken from the generator in blocks because single draws are slow."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._values, self._next = np.empty(0), 0

    def draws(self, count: int) -> Array:
        """The next `count`."""
        first, self._next = self._next, self._next + count
        if self._next <= len(self._values):
            return self._values[first : self._next]
        left = self._values[first:]
        self._values, self._next = self._rng.standard_normal(_BLOCK)[::-1].copy(), 0
        return np.concatenate([left, self.draws(count - len(left))])


@compiled
def step_gimbal(states: Records, constants: Records, normals: Array) -> None:
    """One tick of the gimbal: towards the commanded pitch at a limited rate.

    It holds the horizon but for a bias and a residual motion, a first-order noise that standard normal numbers (2,)
    drive.
    """
    s, k = states[0], constants[0]
    wanted = clip(s.gimbal_wanted, k.gimbal_min, k.gimbal_max)
    change = clip(wanted - s.gimbal_pitch, -k.gimbal_most, k.gimbal_most)
    s.gimbal_pitch += change
    s.gimbal_rate = change / k.tick_s
    s.gimbal_roll_noise = k.gimbal_keep * s.gimbal_roll_noise + k.gimbal_add * normals[0]
    s.gimbal_pitch_noise = k.gimbal_keep * s.gimbal_pitch_noise + k.gimbal_add * normals[1]


@compiled
def sense(states: Records, constants: Records) -> None:
    """One tick of the aircraft's estimate of itself: the motion with its errors; place is the integral of velocity."""
    s, k = states[0], constants[0]
    s.stray_n += s.error_n * k.tick_s
    s.stray_e += s.error_e * k.tick_s
    s.w_at_tick = s.w
    s.north, s.east, s.down = s.x + s.stray_n, s.y + s.stray_e, s.z - s.drift
    s.v_north, s.v_east, s.v_down = s.u + s.error_n, s.v + s.error_e, s.w + s.error_d
    roll, pitch, heading = euler_of_quaternion((s.qw, s.qx, s.qy, s.qz))
    s.roll, s.pitch, s.heading = roll + s.roll_bias, pitch + s.pitch_bias, heading + s.heading_bias
    s.roll_rate, s.pitch_rate, s.yaw_rate = s.p, s.q, s.r


@compiled
def drift(states: Records, constants: Records, normals: Array, chance: float, flow_normals: Array) -> None:
    """Advance the slow errors: of velocity, over ground or by optical flow, and of height.

    By flow the velocity of the surface in view, the water's own motion in it, is missing as the estimate follows it; a
    slow bias comes on top. Over water the flow is lost and found again at random. Standard normal numbers drive
    velocity and height, `normals` (4,), waves and bias, `flow_normals` (4,); `chance`, uniform in 0 … 1, a loss.
    """
    s, k = states[0], constants[0]
    s.noise_n = k.noise_keep * s.noise_n + k.noise_add * normals[0]
    s.noise_e = k.noise_keep * s.noise_e + k.noise_add * normals[1]
    s.noise_d = k.noise_keep * s.noise_d + k.noise_add * normals[2]
    s.drift += k.drift_add * normals[3]
    s.error_n, s.error_e, s.error_d = s.noise_n, s.noise_e, s.noise_d
    if k.over_ground > 0.0:
        return
    north, east, water_share = surface_below(s, k)
    s.wave_n = k.wave_keep * s.wave_n + k.wave_add * flow_normals[0]
    s.wave_e = k.wave_keep * s.wave_e + k.wave_add * flow_normals[1]
    north, east = north + s.wave_n * water_share, east + s.wave_e * water_share
    if s.seeing == 0.0:
        s.seeing, s.seen_n, s.seen_e = 1.0, north, east
    s.seen_n += k.flow_settle * (north - s.seen_n)
    s.seen_e += k.flow_settle * (east - s.seen_e)
    s.flow_n = k.flow_keep * s.flow_n + k.flow_add * flow_normals[2]
    s.flow_e = k.flow_keep * s.flow_e + k.flow_add * flow_normals[3]
    s.error_n += s.flow_n - s.seen_n
    s.error_e += s.flow_e - s.seen_e
    change = k.back_share if s.flow_lost > 0.0 else k.lose_share * water_share
    if chance < change or water_share <= 0.0:
        s.flow_lost = 1.0 if water_share > 0.0 and s.flow_lost == 0.0 else 0.0


def _coloured(deviation: float, time_s: float, step_s: float) -> tuple[float, float]:
    """What a step keeps of a first-order noise of this standard deviation, and adds to it in normal numbers."""
    keep = math.exp(-step_s / time_s)
    return keep, deviation * math.sqrt(1.0 - keep * keep)


def set_gimbal(
    record: Record, camera: CameraParameters, sensors: SensorParameters, tick_s: float, normals: Normals
) -> None:
    """Set the gimbal's constants, and draw its bias and the beginning of its residual motion."""
    record.values[at("gimbal_bias")] = camera.gimbal_bias_rad * normals.draws(2)
    record.values[at("gimbal_noise")] = camera.gimbal_noise_rad * normals.draws(2)
    keep, add = _coloured(camera.gimbal_noise_rad, sensors.gimbal_noise_time_s, tick_s)
    record.set(
        gimbal_min=camera.gimbal_min_rad,
        gimbal_max=camera.gimbal_max_rad,
        gimbal_most=camera.gimbal_rate_rad_s * tick_s,
        gimbal_keep=keep,
        gimbal_add=add,
    )


class Senses:
    """The aircraft's estimates of itself in its record: what its autopilot flies on, and what telemetry reports.

    Velocity is over ground by GPS, or over the surface in view: optical flow with its slow bias, the water's own
    motion, and losses over water, during which the autopilot flies on by its accelerometers and nothing is reported.
    Place is the integral of velocity. `look` is called every `slow_step_s`.
    """

    def __init__(
        self, record: Record, sensors: SensorParameters, over_ground: bool, slow_step_s: float, rng: np.random.Generator
    ) -> None:
        self._record, self._over_ground, self._normals, self._rng = record, over_ground, Normals(rng), rng
        velocity_mps, flow_mps, wave_mps = sensors.velocity_noise_mps, sensors.flow_bias_mps, sensors.flow_wave_mps
        attitude_rad = sensors.attitude_bias_rad
        sizes = np.array([*[velocity_mps] * 3, *[flow_mps] * 2, *[wave_mps] * 2])
        record.values[at("noises")] = sizes * self._normals.draws(7)
        biases = np.array([attitude_rad, attitude_rad, sensors.heading_bias_rad])
        record.values[at("biases")] = biases * self._normals.draws(3)
        record.values[at("errors")][:3] = record.values[at("noises")][:3]
        noise_keep, noise_add = _coloured(velocity_mps, sensors.velocity_noise_time_s, slow_step_s)
        flow_keep, flow_add = _coloured(flow_mps, sensors.flow_bias_time_s, slow_step_s)
        wave_keep, wave_add = _coloured(wave_mps, sensors.flow_wave_time_s, slow_step_s)
        back_share = slow_step_s / sensors.flow_lost_s
        record.set(
            over_ground=float(over_ground),
            noise_keep=noise_keep,
            noise_add=noise_add,
            flow_keep=flow_keep,
            flow_add=flow_add,
            wave_keep=wave_keep,
            wave_add=wave_add,
            drift_add=sensors.height_drift_m_per_sqrt_s * math.sqrt(slow_step_s),
            flow_settle=-math.expm1(-slow_step_s / sensors.flow_settle_s),
            back_share=back_share,
            lose_share=back_share * sensors.flow_lost_share / (1.0 - sensors.flow_lost_share),
        )

    def look(self) -> None:
        """Advance the slow errors, with the surface now in view."""
        record = self._record
        normals, chance = self._normals.draws(4), self._rng.random()
        flow_normals = normals if self._over_ground else self._normals.draws(4)
        drift(record.states, record.constants, normals, chance, flow_normals)


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

    Two low-passes of the range, one noisy reading every `step_s`, give it and its rate.
    """

    LISTEN_M = 0.1
    """Readings above this, and above three times `land_range_m`, count as no surface."""
    _FILTER_S = 0.03
    _STILL_MPS = 0.05

    def __init__(self, loop: LoopParameters, noise_m: float, step_s: float, rng: np.random.Generator) -> None:
        self._loop, self._noise_m, self._step_s, self._normals = loop, noise_m, step_s, Normals(rng)
        self.listen_m = max(self.LISTEN_M, 3.0 * loop.land_range_m)
        self._share = -math.expm1(-step_s / self._FILTER_S)
        self.reset()

    def reset(self) -> None:
        """No surface in range, or no landing wanted."""
        self._range_m = self._slow_m = math.inf
        self._landed_for_s, self._impact = 0.0, False

    def landed(self, range_m: float, impact: bool) -> bool:
        """One reading: the lowest foot's true clearance, infinite without a surface, and whether an impact is felt."""
        if range_m > self.listen_m:
            self.reset()
            return False
        reading_m = range_m + self._noise_m * float(self._normals.draws(1)[0])
        if math.isinf(self._range_m):
            self._range_m = self._slow_m = reading_m
        self._range_m += self._share * (reading_m - self._range_m)
        self._slow_m += self._share * (self._range_m - self._slow_m)
        if self._range_m > self._loop.land_range_m:
            self._landed_for_s, self._impact = 0.0, False
            return False
        self._impact = self._impact or impact
        ended = (self._slow_m - self._range_m) / self._FILTER_S < self._STILL_MPS
        self._landed_for_s = self._landed_for_s + self._step_s if self._impact or ended else 0.0
        return self._landed_for_s >= self._loop.land_confirm_s
