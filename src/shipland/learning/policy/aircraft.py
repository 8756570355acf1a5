"""A batch of quadrotors under sticks that mean tilts: inner loop, rotors, drag and ground effect of `sim.aircraft`.

The nose stays along the bar's axis. Roll and pitch are two equal, uncoupled chains: the attitude loop's limited rate,
the rate loop, and the rotors' lag, discretised exactly. Thrust, climb loop and drag are the simulator's equations.
Released sticks, which brake and hold the place there, are a level attitude here: the pilots of this model never
release them in flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from shipland.frames import GRAVITY_MPS2 as G
from shipland.learning.policy.setup import PhaseSetup, Randomisation

_TILT, _RATE, _MOMENT = range(3)


@dataclass(frozen=True)
class Airframes:
    """What is particular to each of B aircraft.

    Attributes:
        rotor_drag_per_s, body_drag_per_m, inflow_loss_per_s: (B,).
        attitude_per_s: (B,) gain of the attitude loop.
        settle: (B,) share by which thrust settles in a substep.
        chain: (B, 3, 4) tilt, its rate and the moment after a substep, from these and the commanded rate.
        tilt_bias: (B, 2) error of the measured tilt [rad].
    """

    rotor_drag_per_s: Tensor
    body_drag_per_m: Tensor
    inflow_loss_per_s: Tensor
    attitude_per_s: Tensor
    settle: Tensor
    chain: Tensor
    tilt_bias: Tensor


@dataclass(frozen=True)
class AircraftState:
    """Of B aircraft; places and velocities forward, starboard, down from the neutral landing point.

    Attributes:
        position_m, velocity_mps: (B, 3).
        tilt: (B, 3, 2) tilt, its rate, and the moment's angular acceleration, towards forward and starboard.
        thrust_mps2: (B,) over mass.
        climb: (B, 3) the climb loop's reference, how far below the aircraft its height reference is, its integral.
    """

    position_m: Tensor
    velocity_mps: Tensor
    tilt: Tensor
    thrust_mps2: Tensor
    climb: Tensor


def draw_airframes(
    setup: PhaseSetup, random: Randomisation, batch: int, substep_s: float, generator: torch.Generator
) -> Airframes:
    """Draw a batch's airframes."""
    frame, loop = setup.aircraft.airframe, setup.aircraft.loop

    def varied(value: float) -> Tensor:
        return value * (1.0 + random.airframe * (2.0 * torch.rand(batch, generator=generator) - 1.0))

    attitude, rate, motor_s = varied(loop.attitude_per_s), varied(loop.rate_per_s), varied(frame.motor_time_s)
    continuous = torch.zeros(batch, 4, 4)
    continuous[:, _TILT, _RATE] = continuous[:, _RATE, _MOMENT] = 1.0
    continuous[:, _MOMENT, _RATE] = -rate / motor_s
    continuous[:, _MOMENT, _MOMENT] = -1.0 / motor_s
    continuous[:, _MOMENT, 3] = rate / motor_s
    bias = setup.aircraft.sensors.attitude_bias_rad * torch.randn(batch, 2, generator=generator)
    return Airframes(
        varied(frame.rotor_drag_per_s),
        varied(frame.body_drag_per_m),
        varied(frame.inflow_loss_per_s),
        attitude,
        -torch.expm1(-substep_s / motor_s),
        torch.linalg.matrix_exp(substep_s * continuous)[:, :3],
        bias,
    )


def hovering(airframes: Airframes, position_m: Tensor, wind_mps: Tensor) -> AircraftState:
    """At rest over ground at places (B, 3), tilted against a wind (B, 3)."""
    batch = len(position_m)
    tilt = torch.zeros(batch, 3, 2)
    thrust = torch.full((batch,), G)
    for _ in range(20):
        drag = air_acceleration(airframes, tilt[:, _TILT], thrust, -wind_mps)
        push = -drag[:, :2]
        lift = G + drag[:, 2]
        forward = torch.atan2(push[:, 0], lift)
        starboard = torch.atan2(push[:, 1] * forward.cos(), lift)
        tilt[:, _TILT] = torch.stack([forward, starboard], 1)
        thrust = torch.stack([push[:, 0], push[:, 1], lift], 1).norm(dim=1)
    climb = torch.zeros(batch, 3)
    climb[:, 2] = drag[:, 2]
    return AircraftState(position_m, torch.zeros_like(position_m), tilt, thrust, climb)


def thrust_axis(tilt: Tensor) -> Tensor:
    """(B, 3) body-down in forward, starboard, down for tilts (B, 2); thrust acts against it."""
    forward, starboard = tilt.unbind(1)
    cos = starboard.cos()
    return torch.stack([-cos * forward.sin(), -starboard.sin(), cos * forward.cos()], 1)


def air_acceleration(airframes: Airframes, tilt: Tensor, thrust_mps2: Tensor, air_mps: Tensor) -> Tensor:
    """(B, 3) drag and inflow loss over mass, at velocities (B, 3) through the air."""
    axis = thrust_axis(tilt)
    axial = (axis * air_mps).sum(1)
    spin = (thrust_mps2.clamp_min(0.0) / G + 1e-9).sqrt()
    plane = airframes.rotor_drag_per_s * spin
    square = airframes.body_drag_per_m * (air_mps.square().sum(1) + 1e-9).sqrt()
    along = (airframes.inflow_loss_per_s * spin - plane) * axial
    return -((plane + square)[:, None] * air_mps + along[:, None] * axis)


def step(
    setup: PhaseSetup,
    airframes: Airframes,
    state: AircraftState,
    sticks: Tensor,
    wind_mps: Tensor,
    over_deck_m: Tensor,
    substep_s: float,
) -> AircraftState:
    """The batch a substep later.

    Args:
        setup: of the phase.
        airframes: of the batch.
        state: before.
        sticks: (B, 3) pitch, roll, heave in shares of the full stick, as they have arrived.
        wind_mps: (B, 3) of the air, held.
        over_deck_m: (B,) of the centre over the deck, for the ground effect.
        substep_s: its length.
    """
    settings, frame = setup.aircraft.settings, setup.aircraft.airframe
    most = math.radians(settings.max_tilt_rate_deg_s)
    wanted = math.radians(settings.max_tilt_deg) * sticks[:, :2]
    believed = state.tilt[:, _TILT] + airframes.tilt_bias
    rate = (airframes.attitude_per_s[:, None] * (wanted - believed)).clamp(-most, most)
    tilt = torch.bmm(airframes.chain, torch.cat([state.tilt, rate[:, None]], 1))
    lift, climb = _lift(setup, state, sticks[:, 2], substep_s)
    # Forces act at the substep's middle.
    middle = 0.5 * (state.tilt[:, _TILT] + tilt[:, _TILT])
    upright = (believed[:, 0].cos() * believed[:, 1].cos()).clamp_min(0.5)
    low, top = 1.5 * frame.idle_thrust * G, 0.9 * frame.thrust_to_weight * G
    thrust = state.thrust_mps2 + airframes.settle * ((lift / upright).clamp(low, top) - state.thrust_mps2)
    acting = 0.5 * (state.thrust_mps2 + thrust)
    if frame.ground_effect:
        ratio = frame.rotor_radius_m / (4.0 * (over_deck_m + frame.motor_above_m).clamp_min(0.5 * frame.rotor_radius_m))
        acting = acting / (1.0 - ratio**2)
    drag = air_acceleration(airframes, middle, thrust, state.velocity_mps - wind_mps)
    acceleration = drag - acting[:, None] * thrust_axis(middle)
    acceleration = acceleration + acceleration.new_tensor([0.0, 0.0, G])
    velocity = state.velocity_mps + substep_s * acceleration
    position = state.position_m + 0.5 * substep_s * (state.velocity_mps + velocity)
    return replace(
        state, position_m=position, velocity_mps=velocity, tilt=tilt, thrust_mps2=thrust, climb=torch.stack(climb, 1)
    )


def _lift(setup: PhaseSetup, state: AircraftState, heave: Tensor, substep_s: float) -> tuple[Tensor, list[Tensor]]:
    """The climb loop: upward acceleration that thrust must give, and its memory after the substep."""
    loop = setup.aircraft.loop
    reference, below, integral = state.climb.unbind(1)
    down_mps = state.velocity_mps[:, 2]
    asked = heave * setup.aircraft.settings.max_vertical_speed_mps
    rate = ((asked - reference) / loop.climb_time_s).clamp(-loop.climb_mps2, loop.climb_mps2)
    reference = reference + rate * substep_s
    below = (below - (reference + down_mps) * substep_s).clamp(-0.25, 0.25)
    error = reference - loop.height_per_s * below + down_mps
    climb = rate + loop.climb_per_s * error + integral
    free = climb.abs() <= 0.6 * G
    grown = (integral + loop.climb_integral_per_s2 * error * substep_s).clamp(-0.4 * G, 0.4 * G)
    return G + climb.clamp(-0.6 * G, 0.6 * G), [reference, below, torch.where(free, grown, integral)]
