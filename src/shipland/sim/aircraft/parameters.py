"""The aircraft's constants: airframe, operator's settings, inner loop and sensors (`[aircraft]` in TOML)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from shipland.config import key, parameters, require
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


@parameters
class AirframeParameters:
    """Mass, geometry, rotors and drag of a quadrotor (`[aircraft.airframe]`).

    An ANAFI-like quadrotor; "data sheet" is Parrot's of the ANAFI.
    """

    mass_kg: float = key(0.32, "take-off mass", "data sheet: 320 g", gt=0)
    inertia_kgm2: Vector = key(
        (0.00165, 0.00093, 0.00235), "about forward, right and down", "chosen: a homogeneous box of 175 × 240 × 65 mm"
    )
    motor_forward_m: float = key(
        0.071, "from the centre of mass ahead to a motor", "chosen: motor diagonal 0.24 m", gt=0
    )
    motor_right_m: float = key(0.097, "from the centre of mass sideways to a motor", gt=0)
    motor_above_m: float = key(0.02, "rotor plane above the centre of mass")
    rotor_radius_m: float = key(0.065, "radius of a rotor's disc", gt=0)
    body_size_m: Vector = key(
        (0.175, 0.065, 0.05), "fuselage (length, width, height) about the centre of mass", "chosen: without its arms"
    )
    foot_forward_m: float = key(
        0.071, "from the centre of mass ahead to a foot", "chosen: the arms' ends carry the feet", gt=0
    )
    foot_right_m: float = key(0.085, "from the centre of mass sideways to a foot", gt=0)
    foot_below_m: float = key(
        0.045,
        "sole of the feet below the centre of mass",
        "chosen: half of the data sheet's height and a short foot",
        gt=0,
    )
    foot_radius_m: float = key(0.006, "radius of a foot's round end", gt=0)
    foot_friction: float = key(
        0.8, "sliding friction coefficient of foot on deck", "chosen: rubber on a painted non-skid deck", gt=0
    )
    contact_time_s: float = key(
        0.008, "of a contact's spring, critically damped", "chosen: four physics steps, some mm of give", gt=0
    )
    motor_time_s: float = key(0.05, "time constant of a rotor's thrust", "chosen: typical of 6-inch rotors", gt=0)
    thrust_to_weight: float = key(
        2.2, "largest total thrust over weight", "chosen: 40° of tilt at 15 m/s, and room for control", gt=1.2
    )
    idle_thrust: float = key(0.1, "least thrust of a running rotor over its hover thrust", lt=0.5, gt=0)
    torque_per_thrust_m: float = key(
        0.012, "a rotor's drag torque over its thrust", "chosen: typical of small rotors", gt=0
    )
    rotor_drag_per_s: float = key(
        0.2, "in-plane, over mass and air speed, at hover", "chosen; 0.2–0.5 published of small quadrotors", ge=0
    )
    inflow_loss_per_s: float = key(
        0.4, "thrust lost over mass and axial air speed", "chosen: blade-element estimate", ge=0
    )
    body_drag_per_m: float = key(
        0.019,
        "fuselage drag over mass and air speed squared",
        "chosen: 40° of tilt end at the data sheet's 15 m/s",
        gt=0,
    )
    ground_effect: bool = key(True, "whether rotors over the deck gain thrust near it", "Cheeseman and Bennett 1955")

    def __post_init__(self) -> None:
        for name in ("inertia_kgm2", "body_size_m"):
            require(min(getattr(self, name)) > 0.0, f"{name} must be positive, got {getattr(self, name)}")
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
    def motor_diagonal_m(self) -> float:
        """From the front right motor to the rear left one."""
        return 2.0 * math.hypot(self.motor_forward_m, self.motor_right_m)

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


@parameters
class PilotingSettings:
    """What the operator sets on the aircraft; full sticks mean these (`[aircraft.settings]`).

    Ranges: Parrot's MaxTilt 1–40°, MaxVerticalSpeed 0.1–4 m/s, MaxRotationSpeed 3–200°/s.
    """

    max_tilt_deg: float = key(
        15.0, "at full pitch or roll stick, kind `attitude`", "chosen; public drivers have 10° and 20°", ge=1, le=40
    )
    max_speed_mps: float = key(
        7.5, "at full stick, loop kind `velocity`", "chosen: where 15° of tilt end in still air", ge=0.5, le=20
    )
    max_vertical_speed_mps: float = key(
        1.0, "climb or descent at full heave stick", "the default in two public ANAFI drivers", ge=0.1, le=4
    )
    max_yaw_rate_deg_s: float = key(
        40.0, "turn rate at full yaw stick", "factory setting noted in a public ANAFI driver", ge=3, le=200
    )
    max_tilt_rate_deg_s: float = key(
        116.0, "largest roll and pitch rate", "factory setting noted in a public ANAFI driver", ge=40, le=300
    )
    stick_step_percent: float = key(
        1.0, "sticks are rounded to multiples of this; 0: not", "Parrot's PCMD carries whole percents", ge=0, le=10
    )
    command_timeout_s: float = key(
        1.0, "without a command for so long it holds", "chosen: [Lee2022]'s longest cycle is 0.5 s", ge=0.05, le=10
    )


@parameters
class LoopParameters:
    """The inner loop's constants (`[aircraft.loop]`).

    All chosen: the real autopilot's gains are not published; docs/results/aircraft.md shows the responses.
    """

    kind: str = key(
        "attitude",
        "what a stick means: `attitude`, `velocity`, an installed name of the group `loops`, or `module:factory`",
        "attitude (an ANAFI's PCMD) | velocity (PX4 OFFBOARD, ArduPilot guided velocity) | module:factory",
    )
    velocity_reference: Literal["ground", "surface"] = key(
        "surface", "of its own velocity", "ground (GPS) | surface (optical flow); [Lee2022]: no GPS"
    )
    wind_trim_s: float = key(
        0.0, "kind `attitude`: of the trim against wind; 0: none", "Parrot's forum, thread 12864: it drifts", ge=0
    )
    acceleration_mps2: float = key(
        3.0, "kind `velocity`: largest, of the reference", "PX4's MPC_ACC_HOR as delivered", gt=0
    )
    velocity_time_s: float = key(0.5, "kind `velocity`: time constant of the reference", gt=0)
    tilt_limit_deg: float = key(
        40.0, "largest tilt to hold, brake or track a velocity", "the highest MaxTilt holds against 14 m/s", gt=0, le=60
    )
    hold_below_percent: float = key(1.0, "pitch and roll sticks below this are released", "PCMD's smallest stick", gt=0)
    tilt_time_s: float = key(
        0.15, "time constant of the reference's acceleration, about that of the attitude loop", gt=0
    )
    brake_time_s: float = key(0.5, "time constant of the velocity reference when braking", gt=0)
    brake_mps2: float = key(3.0, "largest deceleration of the velocity reference when braking", gt=0)
    position_per_s: float = key(0.8, "horizontal gain on position", gt=0)
    velocity_per_s: float = key(2.0, "horizontal gain on velocity", gt=0)
    velocity_integral_per_s2: float = key(1.0, "horizontal gain on the integral of velocity", gt=0)
    climb_time_s: float = key(0.25, "time constant of the climb reference", gt=0)
    climb_mps2: float = key(3.0, "largest acceleration of the climb reference", gt=0)
    height_per_s: float = key(1.0, "vertical gain on height", gt=0)
    climb_per_s: float = key(4.0, "vertical gain on climb", gt=0)
    climb_integral_per_s2: float = key(3.0, "vertical gain on the integral of climb", gt=0)
    attitude_per_s: float = key(8.0, "gain on roll and pitch", gt=0)
    rate_per_s: float = key(18.0, "gain on the rates of roll and pitch", gt=0)
    heading_per_s: float = key(2.0, "gain on heading", gt=0)
    yaw_rate_per_s: float = key(6.0, "gain on the yaw rate", gt=0)
    yaw_rad_s2: float = key(2.0, "largest acceleration of the yaw rate reference", gt=0)
    land_range_m: float = key(0.02, "downward range under which the aircraft may take itself for landed", gt=0)
    land_confirm_s: float = key(0.05, "for how long, with an impact or no more descent", gt=0)


@parameters
class SensorParameters:
    """Errors of what the aircraft measures (`[aircraft.sensors]`); standard deviations.

    The autopilot flies on these measurements, and telemetry reports them with a reading's noise on top. A bias is drawn
    once a flight.
    """

    velocity_noise_mps: float = key(0.02, "of the velocity estimate; a first-order process", ge=0)
    velocity_noise_time_s: float = key(0.5, "time constant of the velocity's noise", gt=0)
    flow_bias_mps: float = key(0.03, "of a velocity from optical flow; a slow first-order process", ge=0)
    flow_bias_time_s: float = key(60.0, "time constant of the flow's bias", gt=0)
    flow_view_deg: float = key(60.0, "width of the downward camera's view: what part of it is deck", gt=0, lt=150)
    flow_settle_s: float = key(
        0.3, "the estimate follows a new surface in so long", "the fusion with the accelerometers", gt=0
    )
    flow_wave_mps: float = key(
        0.1, "of the water's own motion as the flow sees it", "orbital motion, averaged over the view", ge=0
    )
    flow_wave_time_s: float = key(0.5, "time constant of the water's own motion", gt=0)
    water_drift_share: float = key(0.03, "of the wind, with which the water's surface drifts", "the rule of 3 %", ge=0)
    flow_lost_share: float = key(
        0.1, "part of the time without flow over water", "water gives few features", ge=0, lt=1
    )
    flow_lost_s: float = key(0.5, "how long one loss of flow lasts on average", gt=0)
    attitude_noise_rad: float = key(0.005, "of roll and pitch", ge=0)
    attitude_bias_rad: float = key(0.005, "of roll and pitch", "0.3°: a levelled accelerometer", ge=0)
    heading_noise_rad: float = key(0.01, "of the magnetometer", ge=0)
    heading_bias_rad: float = key(0.035, "of the magnetometer", "2°: a calibrated magnetometer near steel", ge=0)
    height_noise_m: float = key(0.05, "of the barometer", ge=0)
    height_drift_m_per_sqrt_s: float = key(0.02, "of the barometer; a random walk", ge=0)
    range_noise_m: float = key(0.002, "downward rangefinder, each reading", "time of flight, at close range", ge=0)
    gimbal_noise_time_s: float = key(0.1, "time constant of the gimbal's residual motion (its size: `[camera]`)", gt=0)
    endurance_s: float = key(1500.0, "hover time on a full battery", "data sheet: 25 min", gt=0)
    link_range_m: float = key(4000.0, "distance at which the link is gone", "data sheet: 4 km", gt=0)


@parameters
class AircraftParameters:
    """Section `[aircraft]`."""

    kind: str = key(
        "quadrotor",
        "`quadrotor`, an installed name of the group `aircraft`, or `module:factory`",
        "quadrotor | module:factory",
    )
    airframe: AirframeParameters = AirframeParameters()
    settings: PilotingSettings = PilotingSettings()
    loop: LoopParameters = LoopParameters()
    sensors: SensorParameters = SensorParameters()
