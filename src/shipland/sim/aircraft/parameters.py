"""The aircraft's constants: airframe, operator's settings, inner loop and sensors (`[aircraft]` in TOML)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.config import require

GRAVITY_MPS2 = 9.81

Vector = tuple[float, float, float]


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

    def level_drag_mps2(self, air_speed_mps: float) -> float:
        """Drag over mass in level flight, the nominal model [m/s²]; `air_speed_mps` is not negative."""
        return (self.rotor_drag_per_s + self.body_drag_per_m * air_speed_mps) * air_speed_mps

    def level_speed_mps(self, tilt_rad: float) -> float:
        """Air speed at which the nominal drag balances a tilt in level flight [m/s]."""
        push = GRAVITY_MPS2 * math.tan(tilt_rad)
        linear, square = self.rotor_drag_per_s, self.body_drag_per_m
        return (math.sqrt(linear * linear + 4.0 * square * push) - linear) / (2.0 * square)


@dataclass(frozen=True)
class PilotingSettings:
    """What the operator sets on the aircraft; full sticks mean these (`[aircraft.settings]`).

    Attributes:
        max_tilt_deg: tilt that full pitch or roll stick asks for.
        max_vertical_speed_mps: climb or descent at full heave stick.
        max_yaw_rate_deg_s: turn rate at full yaw stick.
        max_tilt_rate_deg_s: largest roll and pitch rate.
        stick_step_percent: sticks are rounded to multiples of this; 0 leaves them as they are.
        command_timeout_s: without a command for so long the aircraft brakes and holds.
    """

    max_tilt_deg: float
    max_vertical_speed_mps: float
    max_yaw_rate_deg_s: float
    max_tilt_rate_deg_s: float
    stick_step_percent: float
    command_timeout_s: float

    def __post_init__(self) -> None:
        require(1.0 <= self.max_tilt_deg <= 40.0, "max_tilt_deg must be 1 to 40, as on the ANAFI")
        require(0.1 <= self.max_vertical_speed_mps <= 4.0, "max_vertical_speed_mps must be 0.1 to 4, as on the ANAFI")
        require(3.0 <= self.max_yaw_rate_deg_s <= 200.0, "max_yaw_rate_deg_s must be 3 to 200, as on the ANAFI")
        require(40.0 <= self.max_tilt_rate_deg_s <= 300.0, "max_tilt_rate_deg_s must be 40 to 300, as on the ANAFI")
        require(0.0 <= self.stick_step_percent <= 10.0, "stick_step_percent must be 0 to 10")
        require(self.command_timeout_s > 0.0, "command_timeout_s must be positive")


@dataclass(frozen=True)
class LoopParameters:
    """The inner loop's constants (`[aircraft.loop]`).

    Attributes:
        tilt_limit_deg: what the loop may tilt in all, wind and braking included.
        hold_below_percent: pitch-roll stick under which braking and holding fade in.
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
            require(value > 0.0, f"{name} must be positive, got {value}")
        require(self.tilt_limit_deg <= 60.0, "tilt_limit_deg must be at most 60")


@dataclass(frozen=True)
class SensorParameters:
    """Errors of what the aircraft measures (`[aircraft.sensors]`); standard deviations.

    Attributes:
        velocity_noise_mps, velocity_noise_time_s: of the velocity estimate that the inner loop flies on and
            telemetry reports; a first-order process.
        attitude_noise_rad: roll and pitch in telemetry.
        heading_noise_rad, heading_bias_rad: magnetometer; the bias is drawn once a flight.
        height_noise_m, height_drift_m_per_sqrt_s: barometer; the drift is a random walk.
        gimbal_noise_time_s: time constant of the gimbal's residual motion (its size: `[camera]`).
        endurance_s: hover time on a full battery.
        link_range_m: distance at which the link is gone.
    """

    velocity_noise_mps: float
    velocity_noise_time_s: float
    attitude_noise_rad: float
    heading_noise_rad: float
    heading_bias_rad: float
    height_noise_m: float
    height_drift_m_per_sqrt_s: float
    gimbal_noise_time_s: float
    endurance_s: float
    link_range_m: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name.endswith(("_time_s", "endurance_s", "range_m")):
                require(value > 0.0, f"{name} must be positive, got {value}")
            else:
                require(value >= 0.0, f"{name} must not be negative, got {value}")


@dataclass(frozen=True)
class AircraftParameters:
    """Section `[aircraft]`."""

    airframe: AirframeParameters
    settings: PilotingSettings
    loop: LoopParameters
    sensors: SensorParameters
