"""The aircraft as MuJoCo has it: motion in `ned` and `body`, rotor thrusts, air forces, contacts."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from shipland.rig import Rig
from shipland.sim.aircraft.aerodynamics import (
    Quaternion,
    Rows,
    air_force_in_ned_n,
    ground_effect_gain,
    rows_from_quaternion,
)
from shipland.sim.aircraft.inner_loop import Thrusts
from shipland.sim.aircraft.parameters import AirframeParameters, Vector
from shipland.sim.contact.deck_drive import DeckState, mujoco_quaternion
from shipland.sim.contact.model import BASE, BOARD, BODY, DECK, FOOT, ROTOR, SUPERSTRUCTURE, Model
from shipland.sim.contact.touchdown import Touch

_PARTS = (FOOT, BODY, ROTOR)
_FAULTS = {
    (ROTOR, DECK): "a rotor struck the deck",
    (BODY, DECK): "the fuselage struck the deck",
    **dict.fromkeys([(part, SUPERSTRUCTURE) for part in _PARTS], "struck the superstructure"),
    **dict.fromkeys([(part, BOARD) for part in _PARTS], "struck the horizon bar"),
    **dict.fromkeys([(part, BASE) for part in _PARTS], "came down beside the deck"),
}


class Motion(NamedTuple):
    """Position and velocity of the centre of mass in `ned`, attitude (w, x, y, z) of `body` in `ned`, body rates."""

    position_m: Vector
    quaternion: Quaternion
    velocity_mps: Vector
    rates_rad_s: Vector


class Body:
    """The aircraft's part of MuJoCo's data.

    Args:
        rig: the deck's size.
        airframe: geometry and drag.
        model: the compiled model.
        data: its state.
    """

    def __init__(self, rig: Rig, airframe: AirframeParameters, model: Model, data: mujoco.MjData) -> None:
        self._airframe, self._model, self._data = airframe, model, data
        self._half_deck_m = 0.5 * rig.deck_size_m
        self._place, self._velocity, self._force = data.qpos[0:7], data.qvel[0:6], data.qfrc_applied[0:6]
        self._wanted, self._thrusts = data.ctrl, data.act
        self._wrench = np.zeros(6)

    def put(self, position_m: Vector, roll_rad: float, pitch_rad: float, heading_rad: float, thrust_n: float) -> None:
        """Place it at rest with a total thrust, shared alike."""
        self._place[:3] = (position_m[0], -position_m[1], -position_m[2])
        self._place[3:] = mujoco_quaternion(roll_rad, pitch_rad, heading_rad)
        self._velocity[:] = 0.0
        self._wanted[:] = self._thrusts[:] = 0.25 * thrust_n

    def motion(self) -> Motion:
        """Where it is and how it moves."""
        x, y, z, qw, qx, qy, qz = self._place.tolist()
        vx, vy, vz, wx, wy, wz = self._velocity.tolist()
        return Motion((x, -y, -z), (qw, qx, -qy, -qz), (vx, -vy, -vz), (wx, -wy, -wz))

    @property
    def down_m(self) -> float:
        """`ned` z of the centre of mass."""
        return -float(self._place[2])

    @property
    def in_contact(self) -> bool:
        """Whether anything touches."""
        return bool(self._data.ncon)

    def ask(self, thrusts_n: Thrusts) -> None:
        """Thrusts asked of the rotors, until the next call."""
        self._wanted[:] = thrusts_n

    def apply_air(self, motion: Motion, wind_mps: Vector, deck: DeckState | None) -> None:
        """Drag, and over a `deck` the ground effect; held until the next call."""
        rows = rows_from_quaternion(*motion.quaternion)
        (u, v, w), (a, b, c) = motion.velocity_mps, wind_mps
        thrusts = self._thrusts.tolist()
        north, east, down = air_force_in_ned_n(self._airframe, rows, (u - a, v - b, w - c), sum(thrusts))
        if deck is None:
            self._force[:] = (north, -east, -down, 0.0, 0.0, 0.0)
            return
        lift, roll, pitch = self._ground_effect(motion.position_m, rows, thrusts, deck)
        self._force[:] = (
            north - lift * rows[2],
            lift * rows[5] - east,
            lift * rows[8] - down,
            roll,
            -pitch,
            0.0,
        )

    def _ground_effect(
        self, position_m: Vector, rows: Rows, thrusts_n: list[float], deck: DeckState
    ) -> tuple[float, float, float]:
        """Extra thrust [N] and its roll and pitch moments [Nm] in `body`, rotor by rotor."""
        airframe = self._airframe
        x, y, up = airframe.motor_forward_m, airframe.motor_right_m, -airframe.motor_above_m
        lift = roll = pitch = 0.0
        for thrust, place in zip(thrusts_n, ((x, y, up), (x, -y, up), (-x, y, up), (-x, -y, up)), strict=True):
            ahead, aside, below = deck.point_in_deck(position_m, rows, place)
            if abs(ahead) < self._half_deck_m and abs(aside) < self._half_deck_m and below < 0.0:
                extra = thrust * (ground_effect_gain(-below, airframe.rotor_radius_m) - 1.0)
                lift += extra
                roll -= place[1] * extra
                pitch += place[0] * extra
        return lift, roll, pitch

    def range_m(self, motion: Motion, deck: DeckState) -> float:
        """Clearance of the lowest foot over the deck's plane, as a downward range finder gives it; infinite beside."""
        airframe, half = self._airframe, self._half_deck_m
        rows = rows_from_quaternion(*motion.quaternion)
        x, y, z = airframe.foot_forward_m, airframe.foot_right_m, airframe.foot_below_m
        feet = [deck.point_in_deck(motion.position_m, rows, (a, b, z)) for a in (x, -x) for b in (y, -y)]
        over = [-foot[2] for foot in feet if abs(foot[0]) < half and abs(foot[1]) < half]
        return max(min(over), 0.0) if over else float("inf")

    def touch(self) -> Touch:
        """The contacts of the last physics step."""
        parts = self._model.part_of_geom
        feet: set[int] = set()
        force_n, fault = 0.0, ""
        for index, pair in enumerate(self._data.contact.geom[: self._data.ncon].tolist()):
            own, other = sorted(pair)
            if parts[own] == FOOT and parts[other] == DECK:
                mujoco.mj_contactForce(self._model.mj, self._data, index, self._wrench)
                if self._wrench[0] > 0.0:
                    feet.add(own)
                    force_n += float(self._wrench[0])
            else:
                fault = fault or _FAULTS[parts[own], parts[other]]
        return Touch(len(feet), force_n, fault)
