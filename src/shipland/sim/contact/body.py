"""The aircraft as MuJoCo has it: motion in `ned` and `body`, forces on it, contacts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from shipland.frames import quaternion_from_euler, rows_from_quaternion
from shipland.rig import Rig
from shipland.sim.aircraft.aircraft import Clearance
from shipland.sim.aircraft.parameters import Shape, Vector
from shipland.sim.aircraft.record import Record, RigidBodyState, at
from shipland.sim.contact.deck_drive import DeckState
from shipland.sim.contact.model import BASE, BOARD, BODY, DECK, FOOT, ROTOR, SUPERSTRUCTURE, Model
from shipland.sim.contact.touchdown import Contacts

if TYPE_CHECKING:
    import mujoco

_PARTS = (FOOT, BODY, ROTOR)
_FAULTS = {
    (ROTOR, DECK): "a rotor struck the deck",
    (BODY, DECK): "the fuselage struck the deck",
    **dict.fromkeys([(part, SUPERSTRUCTURE) for part in _PARTS], "struck the superstructure"),
    **dict.fromkeys([(part, BOARD) for part in _PARTS], "struck the horizon bar"),
    **dict.fromkeys([(part, BASE) for part in _PARTS], "came down beside the deck"),
}

_PLACE_SIGNS = np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
"""MuJoCo's place and quaternion of those in `ned`, and back."""
_VELOCITY_SIGNS = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""Velocity and rates; force in the world and moment in the body, as `qfrc_applied` wants them."""

AT_REST: Vector = (0.0, 0.0, 0.0)
"""Velocity of what stands still."""


class Body:
    """The aircraft's part of MuJoCo's data.

    Args:
        rig: the deck's size.
        shape: of the aircraft.
        model: the compiled model.
        data: its state.
        record: the aircraft's state: where it is and how it moves, and the wrench on it.
    """

    def __init__(self, rig: Rig, shape: Shape, model: Model, data: mujoco.MjData, record: Record) -> None:
        import mujoco

        self._shape, self._model, self._data, self._record = shape, model, data, record
        self._mj_step, self._mj_contact_force = mujoco.mj_step, mujoco.mj_contactForce
        self._half_deck_m = 0.5 * rig.deck_size_m
        self._place, self._velocity, self._force = data.qpos[0:7], data.qvel[0:6], data.qfrc_applied[0:6]
        motion = record.values[at("motion")]
        self._own_place, self._own_velocity = motion[:7], motion[7:]
        self._own_wrench = record.values[at("wrench")]
        self._force_of_contact = np.zeros(6)
        self._motion: RigidBodyState | None = None
        self._moved = False

    def put(
        self, position_m: Vector, roll_rad: float, pitch_rad: float, heading_rad: float, velocity_mps: Vector = AT_REST
    ) -> None:
        """Place it."""
        self._own_place[:3] = position_m
        self._own_place[3:] = quaternion_from_euler(roll_rad, pitch_rad, heading_rad)
        self._own_velocity[:] = (*velocity_mps, *AT_REST)
        self.moved()

    def step(self, count: int) -> None:
        """Step the physics, of all that is in it, so many times, under the wrench of the record."""
        if self._moved:
            np.multiply(self._own_place, _PLACE_SIGNS, out=self._place)
            np.multiply(self._own_velocity, _VELOCITY_SIGNS, out=self._velocity)
        np.multiply(self._own_wrench, _VELOCITY_SIGNS, out=self._force)
        self._mj_step(self._model.mj, self._data, count)
        np.multiply(self._place, _PLACE_SIGNS, out=self._own_place)
        np.multiply(self._velocity, _VELOCITY_SIGNS, out=self._own_velocity)
        self._motion, self._moved = None, False

    def motion(self) -> RigidBodyState:
        """Where it is and how it moves."""
        if self._motion is None:
            self._motion = self._record.motion
        return self._motion

    def moved(self) -> None:
        """The record's motion has changed by other means than `step`."""
        self._motion, self._moved = None, True

    @property
    def down_m(self) -> float:
        """`ned` z of the centre of mass."""
        return self.motion().position_m[2]

    @property
    def in_contact(self) -> bool:
        """Whether anything touches."""
        return bool(self._data.ncon)

    def over_deck(self, motion: RigidBodyState, deck: DeckState) -> Clearance:
        """Heights of points of the aircraft over the deck; infinite beside or below it."""
        rows, half, position_m = rows_from_quaternion(*motion.quaternion), self._half_deck_m, motion.position_m

        def clearance_m(place_in_body_m: Vector) -> float:
            x, y, z = deck.point_in_deck(position_m, rows, place_in_body_m)
            return -z if abs(x) < half and abs(y) < half and z < 0.0 else math.inf

        return clearance_m

    def range_m(self, motion: RigidBodyState, deck: DeckState) -> float:
        """Clearance of the lowest foot over the deck's plane, as a downward range finder gives it; infinite beside."""
        half = self._half_deck_m
        rows = rows_from_quaternion(*motion.quaternion)
        feet = [deck.point_in_deck(motion.position_m, rows, foot) for foot in self._shape.feet_m]
        over = [-foot[2] for foot in feet if abs(foot[0]) < half and abs(foot[1]) < half]
        return max(min(over), 0.0) if over else float("inf")

    def touch(self) -> Contacts:
        """The contacts of the last physics step."""
        parts = self._model.part_of_geom
        feet: set[int] = set()
        force_n, fault = 0.0, ""
        for index, pair in enumerate(self._data.contact.geom[: self._data.ncon].tolist()):
            own, other = sorted(pair)
            if parts[own] == FOOT and parts[other] == DECK:
                self._mj_contact_force(self._model.mj, self._data, index, self._force_of_contact)
                if self._force_of_contact[0] > 0.0:
                    feet.add(own)
                    force_n += float(self._force_of_contact[0])
            else:
                fault = fault or _FAULTS[parts[own], parts[other]]
        return Contacts(len(feet), force_n, fault)
