"""The aircraft's constants: airframe, operator's settings, inner loop and sensors (`[aircraft]` in TOML)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from shipland.config import require, require_within
from shipland.frames import GRAVITY_MPS2

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Shape:
    """Mass and what can touch the deck; places in `body`, forward-right-down from the centre of mass.

    Attributes:
        mass_kg: take-off mass.
        inertia_kgm2: about forward, right and down.
        body_size_m: fuselage (length, width, height), a box around the centre of mass.
        feet_m: lowest points of the feet.
        foot_radius_m: radius of a foot's round end.
        foot_friction: sliding friction coefficient of foot on deck.
        contact_time_s: time constant of a contact's spring and damper (critically damped).
        rotors_m: hubs.
        rotor_radius_m: radius of a rotor's disc.
    """

    mass_kg: float
    inertia_kgm2: Vector
    body_size_m: Vector
    feet_m: tuple[Vector, ...]
    foot_radius_m: float
    foot_friction: float
    contact_time_s: float
    rotors_m: tuple[Vector, ...]
    rotor_radius_m: float

    @property
    def foot_below_m(self) -> float:
        """The lowest foot below the centre of mass."""
        return max(foot[2] for foot in self.feet_m)

    @property
    def reach_m(self) -> float:
        """Radius of a sphere about the centre of mass that holds all of it."""
        rotors = (math.hypot(*rotor) + self.rotor_radius_m for rotor in self.rotors_m)
        return max(*rotors, *(math.hypot(*foot) for foot in self.feet_m), 0.5 * math.hypot(*self.body_size_m))


@dataclass(frozen=True)
class AirframeParameters:
    """Mass, geometry, rotors and drag of a quadrotor (`[aircraft.airframe]`).

    Attributes:
        mass_kg: take-off mass.
        inertia_kgm2: about the body's forward, right and down axes.
        motor_forward_m, motor_right_m: a motor's distance from the centre of mass, ahead and to the side.
        motor_above_m: rotor plane above the centre of mass.
        rotor_radius_m: radius of a rotor's disc.
        body_size_m: fuselage (length, width, height), a box around the centre of mass.
        foot_forward_m, foot_right_m: a foot's distance from the centre of mass.
        foot_below_m: sole of the feet below the centre of mass.
        foot_radius_m: radius of a foot's round end.
        foot_friction: sliding friction coefficient of foot on deck.
        contact_time_s: time constant of a contact's spring and damper (critically damped).
        motor_time_s: time constant of a rotor's thrust.
        thrust_to_weight: largest total thrust over weight.
        idle_thrust: least thrust of a running rotor over its hover thrust.
        torque_per_thrust_m: a rotor's drag torque over its thrust.
        rotor_drag_per_s: in-plane rotor drag over mass and air speed, at hover's rotor speed.
        inflow_loss_per_s: thrust lost over mass and axial air speed.
        body_drag_per_m: fuselage drag over mass and air speed squared.
        ground_effect: whether rotors over the deck gain thrust near it.
    """

    mass_kg: float
    inertia_kgm2: Vector
    motor_forward_m: float
    motor_right_m: float
    motor_above_m: float
    rotor_radius_m: float
    body_size_m: Vector
    foot_forward_m: float
    foot_right_m: float
    foot_below_m: float
    foot_radius_m: float
    foot_friction: float
    contact_time_s: float
    motor_time_s: float
    thrust_to_weight: float
    idle_thrust: float
    torque_per_thrust_m: float
    rotor_drag_per_s: float
    inflow_loss_per_s: float
    body_drag_per_m: float
    ground_effect: bool

    def __post_init__(self) -> None:
        zero_allowed = ("rotor_drag_per_s", "inflow_loss_per_s", "motor_above_m", "ground_effect")
        for name, value in vars(self).items():
            if isinstance(value, tuple):
                require(all(item > 0.0 for item in value), f"{name} must be positive, got {value}")
            elif name not in zero_allowed:
                require(value > 0.0, f"{name} must be positive, got {value}")
        require(min(self.rotor_drag_per_s, self.inflow_loss_per_s) >= 0.0, "drag coefficients must not be negative")
        require(self.thrust_to_weight > 1.2, "thrust_to_weight must be above 1.2: the aircraft must be able to fly")
        require(self.idle_thrust < 0.5, "idle_thrust must be below half of hover thrust")
        require(self.foot_below_m > 0.5 * self.body_size_m[2], "the feet must reach below the fuselage")

    @property
    def hover_thrust_n(self) -> float:
        """A rotor's thrust in still hover [N]."""
        return 0.25 * self.mass_kg * GRAVITY_MPS2

    @property
    def top_thrust_n(self) -> float:
        """A rotor's largest thrust [N]."""
        return self.thrust_to_weight * self.hover_thrust_n

    @property
    def shape(self) -> Shape:
        """Mass and what can touch the deck; front right, front left, rear right, rear left."""

        def corners(x: float, y: float, z: float) -> tuple[Vector, ...]:
            return (x, y, z), (x, -y, z), (-x, y, z), (-x, -y, z)

        return Shape(
            mass_kg=self.mass_kg,
            inertia_kgm2=self.inertia_kgm2,
            body_size_m=self.body_size_m,
            feet_m=corners(self.foot_forward_m, self.foot_right_m, self.foot_below_m),
            foot_radius_m=self.foot_radius_m,
            foot_friction=self.foot_friction,
            contact_time_s=self.contact_time_s,
            rotors_m=corners(self.motor_forward_m, self.motor_right_m, -self.motor_above_m),
            rotor_radius_m=self.rotor_radius_m,
        )

    def level_speed_mps(self, tilt_rad: float) -> float:
        """Air speed at which the nominal drag balances a tilt in level flight [m/s]."""
        push = GRAVITY_MPS2 * math.tan(tilt_rad)
        linear, square = self.rotor_drag_per_s, self.body_drag_per_m
        return (math.sqrt(linear * linear + 4.0 * square * push) - linear) / (2.0 * square)


@dataclass(frozen=True)
class PilotingSettings:
    """What the operator sets on the aircraft; full sticks mean these (`[aircraft.settings]`).

    Attributes:
        max_tilt_deg: what full pitch or roll stick means to the loop kind `attitude`: a tilt.
        max_speed_mps: what it means to the loop kind `velocity`: a speed.
        max_vertical_speed_mps: climb or descent at full heave stick.
        max_yaw_rate_deg_s: turn rate at full yaw stick.
        max_tilt_rate_deg_s: largest roll and pitch rate.
        stick_step_percent: sticks are rounded to multiples of this; 0 leaves them as they are.
        command_timeout_s: without a command for so long the aircraft brakes and holds.
    """

    max_tilt_deg: float
    max_speed_mps: float
    max_vertical_speed_mps: float
    max_yaw_rate_deg_s: float
    max_tilt_rate_deg_s: float
    stick_step_percent: float
    command_timeout_s: float

    def __post_init__(self) -> None:
        require(1.0 <= self.max_tilt_deg <= 40.0, "max_tilt_deg must be 1 to 40, as on the ANAFI")
        require(0.5 <= self.max_speed_mps <= 20.0, "max_speed_mps must be 0.5 to 20")
        require(0.1 <= self.max_vertical_speed_mps <= 4.0, "max_vertical_speed_mps must be 0.1 to 4, as on the ANAFI")
        require(3.0 <= self.max_yaw_rate_deg_s <= 200.0, "max_yaw_rate_deg_s must be 3 to 200, as on the ANAFI")
        require(40.0 <= self.max_tilt_rate_deg_s <= 300.0, "max_tilt_rate_deg_s must be 40 to 300, as on the ANAFI")
        require(0.0 <= self.stick_step_percent <= 10.0, "stick_step_percent must be 0 to 10")
        require_within(self, command_timeout_s=(0.05, 10.0))


@dataclass(frozen=True)
class LoopParameters:
    """The inner loop's constants (`[aircraft.loop]`).

    Attributes:
        kind: what a stick means: `attitude`, `velocity`, an installed name of the group `loops`, or `module:factory`.
        velocity_reference: what the vehicle's own velocity is measured against: the ground (GPS), or the surface that
            its optical flow sees, deck or water.
        wind_trim_s: kind `attitude`: time constant of the trim against wind under deflected sticks; 0 is without.
        acceleration_mps2, velocity_time_s: kind `velocity`: largest acceleration and time constant of the reference.
        tilt_limit_deg: what the loop may tilt in all while it holds, brakes or tracks a velocity.
        hold_below_percent: released means both pitch and roll sticks are below this.
        tilt_time_s: time constant of the reference's acceleration, about that of the attitude loop.
        brake_time_s: time constant of the velocity reference when braking.
        brake_mps2: largest deceleration of the velocity reference when braking.
        position_per_s, velocity_per_s, velocity_integral_per_s2: horizontal gains.
        climb_time_s, climb_mps2: time constant and largest acceleration of the climb reference.
        height_per_s, climb_per_s, climb_integral_per_s2: vertical gains.
        attitude_per_s, rate_per_s: attitude and rate gains of roll and pitch.
        heading_per_s, yaw_rate_per_s: heading and rate gains of yaw.
        yaw_rad_s2: largest acceleration of the yaw rate reference.
        land_range_m: downward range under which the aircraft may take itself for landed.
        land_confirm_s: for how long, with an impact or no more descent.
    """

    kind: str
    velocity_reference: Literal["ground", "surface"]
    wind_trim_s: float
    acceleration_mps2: float
    velocity_time_s: float
    tilt_limit_deg: float
    hold_below_percent: float
    tilt_time_s: float
    brake_time_s: float
    brake_mps2: float
    position_per_s: float
    velocity_per_s: float
    velocity_integral_per_s2: float
    climb_time_s: float
    climb_mps2: float
    height_per_s: float
    climb_per_s: float
    climb_integral_per_s2: float
    attitude_per_s: float
    rate_per_s: float
    heading_per_s: float
    yaw_rate_per_s: float
    yaw_rad_s2: float
    land_range_m: float
    land_confirm_s: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == "wind_trim_s":
                require(value >= 0.0, f"{name} must not be negative, got {value}")
            elif not isinstance(value, str):
                require(value > 0.0, f"{name} must be positive, got {value}")
        require(self.tilt_limit_deg <= 60.0, "tilt_limit_deg must be at most 60")


@dataclass(frozen=True)
class SensorParameters:
    """Errors of what the aircraft measures (`[aircraft.sensors]`); standard deviations.

    The autopilot flies on these measurements, and telemetry reports them with a reading's noise on top. A bias is drawn
    once a flight.

    Attributes:
        velocity_noise_mps, velocity_noise_time_s: of the velocity estimate; a first-order process.
        flow_bias_mps, flow_bias_time_s: of a velocity from optical flow, as well; slow.
        flow_view_deg: width of the downward camera's view: what part of it is deck.
        flow_settle_s: time in which the estimate follows when another surface comes into view.
        flow_wave_mps, flow_wave_time_s: of the water's own motion as the flow sees it.
        water_drift_share: of the wind, with which the water's surface drifts.
        flow_lost_share, flow_lost_s: part of the time without flow over water, and how long one loss lasts on average.
        attitude_noise_rad, attitude_bias_rad: roll and pitch.
        heading_noise_rad, heading_bias_rad: magnetometer.
        height_noise_m, height_drift_m_per_sqrt_s: barometer; the drift is a random walk.
        range_noise_m: downward rangefinder, each reading.
        gimbal_noise_time_s: time constant of the gimbal's residual motion (its size: `[camera]`).
        endurance_s: hover time on a full battery.
        link_range_m: distance at which the link is gone.
    """

    velocity_noise_mps: float
    velocity_noise_time_s: float
    flow_bias_mps: float
    flow_bias_time_s: float
    flow_view_deg: float
    flow_settle_s: float
    flow_wave_mps: float
    flow_wave_time_s: float
    water_drift_share: float
    flow_lost_share: float
    flow_lost_s: float
    attitude_noise_rad: float
    attitude_bias_rad: float
    heading_noise_rad: float
    heading_bias_rad: float
    height_noise_m: float
    height_drift_m_per_sqrt_s: float
    range_noise_m: float
    gimbal_noise_time_s: float
    endurance_s: float
    link_range_m: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name.endswith(("_time_s", "endurance_s", "range_m", "settle_s", "lost_s", "view_deg")):
                require(value > 0.0, f"{name} must be positive, got {value}")
            else:
                require(value >= 0.0, f"{name} must not be negative, got {value}")
        require(self.flow_lost_share < 1.0, f"flow_lost_share must be below 1, got {self.flow_lost_share}")
        require(self.flow_view_deg < 150.0, f"flow_view_deg must be below 150, got {self.flow_view_deg}")


@dataclass(frozen=True)
class AircraftParameters:
    """Section `[aircraft]`.

    Attributes:
        kind: `quadrotor`, an installed name of the group `aircraft`, or `module:factory`.
        airframe, settings, loop, sensors: see there.
    """

    kind: str
    airframe: AirframeParameters
    settings: PilotingSettings
    loop: LoopParameters
    sensors: SensorParameters
