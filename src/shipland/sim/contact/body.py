"""The aircraft as MuJoCo has it: motion in `ned` and `body`, forces on it, contacts."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from shipland.frames import rows_from_quaternion
from shipland.rig import Rig
from shipland.sim.aircraft.aircraft import Clearance, RigidBodyState, Wrench
from shipland.sim.aircraft.parameters import Shape, Vector
from shipland.sim.contact.deck_drive import DeckState, mujoco_quaternion
from shipland.sim.contact.model import BASE, BOARD, BODY, DECK, FOOT, ROTOR, SUPERSTRUCTURE, Model
from shipland.sim.contact.touchdown import Contacts

_PARTS = (FOOT, BODY, ROTOR)
_FAULTS = {
    (ROTOR, DECK): "a rotor struck the deck",
    (BODY, DECK): "the fuselage struck the deck",
    **dict.fromkeys([(part, SUPERSTRUCTURE) for part in _PARTS], "struck the superstructure"),
    **dict.fromkeys([(part, BOARD) for part in _PARTS], "struck the horizon bar"),
    **dict.fromkeys([(part, BASE) for part in _PARTS], "came down beside the deck"),
}


class Body:
    """The aircraft's part of MuJoCo's data.

    Args:
        rig: the deck's size.
        shape: of the aircraft.
        model: the compiled model.
        data: its state.
    """

    def __init__(self, rig: Rig, shape: Shape, model: Model, data: mujoco.MjData) -> None:
        self._shape, self._model, self._data = shape, model, data
        self._half_deck_m = 0.5 * rig.deck_size_m
        self._place, self._velocity, self._force = data.qpos[0:7], data.qvel[0:6], data.qfrc_applied[0:6]
        self._wrench = np.zeros(6)
        self._motion: RigidBodyState | None = None
        """What MuJoCo has, once it has been read, or is to have before it steps."""
        self._moved = False

    def put(self, position_m: Vector, roll_rad: float, pitch_rad: float, heading_rad: float) -> None:
        """Place it at rest."""
        self._place[:3] = (position_m[0], -position_m[1], -position_m[2])
        self._place[3:] = mujoco_quaternion(roll_rad, pitch_rad, heading_rad)
        self._velocity[:] = 0.0
        self._motion, self._moved = None, False

    def step(self, count: int) -> None:
        """Step the physics, of all that is in it, so many times."""
        if self._moved:
            (x, y, z), (qw, qx, qy, qz), (u, v, w), (p, q, r) = self.motion()
            self._place[:] = (x, -y, -z, qw, qx, -qy, -qz)
            self._velocity[:] = (u, -v, -w, p, -q, -r)
        mujoco.mj_step(self._model.mj, self._data, count)
        self._motion, self._moved = None, False

    def motion(self) -> RigidBodyState:
        """Where it is and how it moves."""
        if self._motion is None:
            x, y, z, qw, qx, qy, qz = self._place.tolist()
            vx, vy, vz, wx, wy, wz = self._velocity.tolist()
            self._motion = RigidBodyState((x, -y, -z), (qw, qx, -qy, -qz), (vx, -vy, -vz), (wx, -wy, -wz))
        return self._motion

    def move(self, motion: RigidBodyState) -> None:
        """Set where it is and how it moves; `motion` gives it back."""
        self._motion, self._moved = motion, True

    @property
    def wrench(self) -> Wrench:
        """What `apply` was given last."""
        north, west, up, roll, left, turn = self._force.tolist()
        return Wrench((north, -west, -up), (roll, -left, -turn))

    @property
    def down_m(self) -> float:
        """`ned` z of the centre of mass."""
        return self.motion().position_m[2]

    @property
    def in_contact(self) -> bool:
        """Whether anything touches."""
        return bool(self._data.ncon)

    def apply(self, wrench: Wrench) -> None:
        """Forces and moments, held until the next call; MuJoCo takes forces in the world, moments in the body."""
        (north, east, down), (roll, pitch, yaw) = wrench
        self._force[:] = (north, -east, -down, roll, -pitch, -yaw)

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
                mujoco.mj_contactForce(self._model.mj, self._data, index, self._wrench)
                if self._wrench[0] > 0.0:
                    feet.add(own)
                    force_n += float(self._wrench[0])
            else:
                fault = fault or _FAULTS[parts[own], parts[other]]
        return Contacts(len(feet), force_n, fault)
