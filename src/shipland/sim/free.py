"""Where the compiled free flight and the readable world meet: state is carried in, flown on, and given back."""

from __future__ import annotations

import math

import numpy as np

from shipland.camera import CameraParameters
from shipland.sim.aircraft.aircraft import Aircraft, Quadrotor, RigidBodyState, Wrench
from shipland.sim.aircraft.attitude_loop import AttitudeLoop
from shipland.sim.aircraft.autopilot import Sensed, Sticks
from shipland.sim.aircraft.free_flight import (
    GIMBAL,
    LOOP,
    MOTION,
    SENSED,
    SENSES,
    STATE,
    STATE_TYPE,
    THRUSTS,
    WRENCH,
    fly_free,
)
from shipland.sim.aircraft.parameters import AircraftParameters, Vector
from shipland.sim.aircraft.sensors import Gimbal, Senses
from shipland.sim.aircraft.velocity_loop import HOLD_MPS, VelocityLoop
from shipland.sim.contact.deck_drive import DeckState


def _places(first: str, last: str) -> slice:
    """Where a run of names lies in `STATE_TYPE`."""
    names = STATE_TYPE.names or ()
    return slice(names.index(first), names.index(last) + 1)


_MOTION, _WRENCH, _SENSES = (_places(names[0], names[-1]) for names in (MOTION, WRENCH, SENSES))
_THRUSTS, _GIMBAL, _STRAY = (
    _places(THRUSTS[0], THRUSTS[-1]),
    _places(GIMBAL[0], GIMBAL[-1]),
    _places("stray_n", "stray_e"),
)
_SENSED, _LOOP = _places(SENSED[0], SENSED[-1]), _places(LOOP[0], LOOP[-1])
_PILOTED, _MET, _DECK_AGE = (
    _places(*ends) for ends in (("stick_pitch", "gimbal_wanted"), ("air_n", "deck_ar"), ("deck_s",) * 2)
)

LOW_M = 0.3
"""Height of the feet over the sea below which `World` steps in Python instead of compiled code."""


class FreeFlight:
    """Flies the packaged quadrotor where nothing can touch it.

    Args:
        parameters: the aircraft.
        flier: its rotors.
        loop: its inner loop.
        senses: its sensors.
        gimbal: its camera's.
        camera: the gimbal's rate and range.
        deck_size_m: side of the deck.
        near_deck_m: from the deck's centre, within which rotors feel the ground.
        step_s: physics step; two make a control tick.
    """

    def __init__(
        self,
        parameters: AircraftParameters,
        flier: Quadrotor,
        loop: AttitudeLoop | VelocityLoop,
        senses: Senses,
        gimbal: Gimbal,
        camera: CameraParameters,
        deck_size_m: float,
        near_deck_m: float,
        step_s: float,
    ) -> None:
        self._flier, self._loop, self._senses, self._gimbal = flier, loop, senses, gimbal
        frame, settings, gains = parameters.airframe, parameters.settings, parameters.loop
        tick_s = 2.0 * step_s
        settle = -math.expm1(-tick_s / frame.motor_time_s)
        inertia_x, inertia_y, inertia_z = frame.inertia_kgm2
        constants = {
            "step_s": step_s,
            "tick_s": tick_s,
            "lowest_z": -frame.foot_below_m - LOW_M,
            "near_deck": near_deck_m,
            "half_deck": 0.5 * deck_size_m,
            "gimbal_min": camera.gimbal_min_rad,
            "gimbal_max": camera.gimbal_max_rad,
            "gimbal_most": camera.gimbal_rate_rad_s * tick_s,
            "gimbal_keep": gimbal.residual[0],
            "gimbal_add": gimbal.residual[1],
            "mass": frame.mass_kg,
            "inertia_x": inertia_x,
            "inertia_y": inertia_y,
            "inertia_z": inertia_z,
            "motor_forward": frame.motor_forward_m,
            "motor_right": frame.motor_right_m,
            "motor_above": frame.motor_above_m,
            "rotor_radius": frame.rotor_radius_m,
            "settle": settle,
            "mean": frame.motor_time_s / tick_s * settle,
            "low_n": frame.idle_thrust * frame.hover_thrust_n,
            "hover_n": frame.hover_thrust_n,
            "top_n": frame.top_thrust_n,
            "torque_per_thrust": frame.torque_per_thrust_m,
            "rotor_drag": frame.rotor_drag_per_s,
            "inflow_loss": frame.inflow_loss_per_s,
            "body_drag": frame.body_drag_per_m,
            "ground_effect": float(frame.ground_effect),
            "max_tilt": math.radians(settings.max_tilt_deg),
            "max_speed": settings.max_speed_mps,
            "max_climb": settings.max_vertical_speed_mps,
            "max_yaw_rate": math.radians(settings.max_yaw_rate_deg_s),
            "max_tilt_rate": math.radians(settings.max_tilt_rate_deg_s),
            "velocity_kind": float(isinstance(loop, VelocityLoop)),
            "trim_s": gains.wind_trim_s,
            "trim_share": -math.expm1(-tick_s / gains.wind_trim_s) if gains.wind_trim_s > 0.0 else 0.0,
            "acceleration_mps2": gains.acceleration_mps2,
            "velocity_time_s": gains.velocity_time_s,
            "hold_mps": HOLD_MPS,
            "max_slope": math.tan(math.radians(gains.tilt_limit_deg)),
            "hold_below": gains.hold_below_percent,
            "tilt_settle": min(1.0, tick_s / gains.tilt_time_s),
            "brake_time_s": gains.brake_time_s,
            "brake_mps2": gains.brake_mps2,
            "position_per_s": gains.position_per_s,
            "velocity_per_s": gains.velocity_per_s,
            "velocity_integral_per_s2": gains.velocity_integral_per_s2,
            "climb_time_s": gains.climb_time_s,
            "climb_mps2": gains.climb_mps2,
            "height_per_s": gains.height_per_s,
            "climb_per_s": gains.climb_per_s,
            "climb_integral_per_s2": gains.climb_integral_per_s2,
            "attitude_per_s": gains.attitude_per_s,
            "rate_per_s": gains.rate_per_s,
            "heading_per_s": gains.heading_per_s,
            "yaw_rate_per_s": gains.yaw_rate_per_s,
            "yaw_rad_s2": gains.yaw_rad_s2,
        }
        self._constants = np.array([tuple(constants.values())], dtype=[(name, float) for name in constants])
        self._states = np.zeros(1, STATE_TYPE)
        self._values = self._states.view(float)
        self.flying = False
        """The aircraft's state is here."""

    def take(self, motion: RigidBodyState, wrench: Wrench, sensed: Sensed) -> None:
        """Carry the aircraft's state in.

        Args:
            motion: now.
            wrench: held since the last control tick.
            sensed: at the last control tick.
        """
        self.flying = True
        self._values[: len(STATE)] = (
            *motion.position_m,
            *motion.quaternion,
            *motion.velocity_mps,
            *motion.rates_rad_s,
            *wrench.force_in_ned_n,
            *wrench.moment_in_body_nm,
            *self._flier.thrusts_n,
            *self._gimbal.state,
            *self._senses.state,
            *sensed,
            *self._loop.state,
        )

    def give_back(self) -> Wrench | None:
        """Carry rotors and loop out and give the wrench held; None where nothing was carried in."""
        if not self.flying:
            return None
        self.flying = False
        after = self._values[: len(STATE)].tolist()
        self._flier.thrusts_n = tuple(after[_THRUSTS])
        self._loop.state = tuple(after[_LOOP])
        a, b, c, d, e, f = after[_WRENCH]
        return Wrench((a, b, c), (d, e, f))

    def meet(self, wind_mps: Vector, deck: DeckState) -> None:
        """After a look around: the wind in `ned`, held, the deck, which moves on, and the errors of the senses."""
        self._values[_SENSES] = self._senses.state
        self._values[_MET] = (
            *wind_mps,
            *deck.origin_m,
            *deck.velocity_mps,
            *deck.acceleration_mps2,
            *deck.angles_rad,
            *deck.rates_rad_s,
            *deck.accelerations_rad_s2,
        )

    def fly(
        self, sticks: Sticks, gimbal_wanted_rad: float, deck_age_s: float, phase: int, count: int
    ) -> tuple[int, RigidBodyState, Sensed]:
        """Fly on what `take` carried in for `count` physics steps, fewer if it gets low or tilts.

        Args:
            sticks: piloted.
            gimbal_wanted_rad: commanded pitch.
            deck_age_s: since `meet`; the deck moves on by its velocity and acceleration.
            phase: physics steps since the last control tick.
            count: physics steps.

        Returns:
            Steps flown; motion then; sensed at the last control tick. Gimbal and senses are carried out.
        """
        self._values[_PILOTED] = (*sticks, gimbal_wanted_rad)
        self._values[_DECK_AGE] = deck_age_s
        ticks = (phase + count + 1) // 2 - (phase + 1) // 2
        steps = fly_free(self._states, self._constants, self._gimbal.draw(2 * ticks), phase, count)
        after = self._values[: len(STATE)].tolist()
        self._gimbal.state = tuple(after[_GIMBAL])
        self._senses.stray_m = tuple(after[_STRAY])
        x, y, z, qw, qx, qy, qz, u, v, w, p, q, r = after[_MOTION]
        return steps, RigidBodyState((x, y, z), (qw, qx, qy, qz), (u, v, w), (p, q, r)), Sensed(*after[_SENSED])


def free_flight(
    parameters: AircraftParameters,
    flier: Aircraft,
    senses: Senses,
    gimbal: Gimbal,
    camera: CameraParameters,
    deck_size_m: float,
    near_deck_m: float,
    step_s: float,
) -> FreeFlight | None:
    """What flies this aircraft compiled; None for one from outside the package, which flies as it is written."""
    if type(flier) is not Quadrotor:
        return None
    loop = flier.loop
    if not isinstance(loop, AttitudeLoop | VelocityLoop) or type(loop) not in (AttitudeLoop, VelocityLoop):
        return None
    return FreeFlight(parameters, flier, loop, senses, gimbal, camera, deck_size_m, near_deck_m, step_s)
