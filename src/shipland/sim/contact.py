"""The bodies as MuJoCo has them: the model, the driven deck, and the aircraft's motion, forces and contacts.

MuJoCo's world is `mujoco` (north-west-up) and its bodies are forward-left-up; both are their NED and
forward-right-down siblings turned half round the first axis. The aircraft has a free joint; superstructure and board
are mocap bodies.

The deck must have velocity and acceleration in the contacts, or what stands on it slides off; so it has joints
(x, y, z, then yaw, pitch, roll), whose positions and velocities are set every step and whose forces give the wanted
accelerations. Its inertia is joint armature: the mass matrix is then diagonal, force = armature × acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from shipland.compiled import compiled
from shipland.frames import Array, quaternion_from_euler, rows_from_euler, rows_from_quaternion
from shipland.rig import Rig, Solid, layout
from shipland.sim.aircraft.parameters import Shape, Vector
from shipland.sim.aircraft.record import Record, RigidBodyState, at
from shipland.sim.ship.ship import ShipState
from shipland.sim.touchdown import Contacts, OnDeck

quaternion_of_euler = compiled(quaternion_from_euler)
rows_of_euler = compiled(rows_from_euler)
rows_of_quaternion = compiled(rows_from_quaternion)

if TYPE_CHECKING:
    import mujoco

DECK_ARMATURE = 1e4
DECK_THICKNESS_M = 0.10

FOOT, BODY, ROTOR = _PARTS = "foot", "body", "rotor"
DECK, SUPERSTRUCTURE, BOARD, BASE = "deck", "superstructure", "board", "base"


@dataclass(frozen=True)
class Model:
    """A compiled model and the part that each geometry belongs to.

    Attributes:
        mj: the MuJoCo model; qpos is aircraft (7), deck x y z yaw pitch roll (6); qvel aircraft (6), deck (6).
        part_of_geom: by geom id: foot, body, rotor, deck, superstructure, board or base.
        ship_mocap, board_mocap: mocap ids.
    """

    mj: mujoco.MjModel
    part_of_geom: tuple[str, ...]
    ship_mocap: int
    board_mocap: int


@lru_cache(maxsize=8)
def build_model(rig: Rig, aircraft: Shape, step_s: float) -> Model:
    """Compile the model for a rig and an aircraft with a physics step [s]; the model is shared, not to be changed."""
    import mujoco  # a tenth of a second that what flies nothing does without

    mj = mujoco.MjModel.from_xml_string(_xml(rig, aircraft, step_s))
    names = [mujoco.mj_id2name(mj, mujoco.mjtObj.mjOBJ_GEOM, index) for index in range(mj.ngeom)]
    return Model(
        mj,
        tuple(name.split("_")[0] for name in names),
        int(mj.body("ship").mocapid[0]),
        int(mj.body("bar").mocapid[0]),
    )


def _xml(rig: Rig, aircraft: Shape, step_s: float) -> str:
    shape = layout(rig)
    return f"""
<mujoco model="shipland">
  <option timestep="{step_s}" integrator="implicitfast" cone="elliptic" impratio="10" noslip_iterations="4"/>
  <size memory="2M"/>
  <compiler angle="radian"/>
  <default>
    <geom solref="{aircraft.contact_time_s} 1" friction="{aircraft.foot_friction} 0.005 0.0001"/>
    <default class="ship"><geom contype="2" conaffinity="1"/></default>
    <default class="aircraft"><geom contype="1" conaffinity="2" mass="0"/></default>
  </default>
  <worldbody>
    <body name="aircraft">{_aircraft(aircraft)}
    </body>
    <body name="deck" gravcomp="1" childclass="ship">{_deck(rig)}
    </body>
    <body name="ship" mocap="true" childclass="ship">{_box("base", shape.hull)}{_box("superstructure", shape.house)}
    </body>
    <body name="bar" mocap="true" childclass="ship">{_box("board", shape.board)}
    </body>
  </worldbody>
</mujoco>
"""


def _aircraft(aircraft: Shape) -> str:
    ixx, iyy, izz = aircraft.inertia_kgm2
    length, width, height = aircraft.body_size_m
    lines = [
        "<freejoint/>",
        f'<inertial pos="0 0 0" mass="{aircraft.mass_kg}" diaginertia="{ixx} {iyy} {izz}"/>',
        f'<geom class="aircraft" name="body" type="box" size="{length / 2} {width / 2} {height / 2}"/>',
    ]
    for index, (forward, right, down) in enumerate(aircraft.feet_m):
        lines.append(
            f'<geom class="aircraft" name="foot_{index}" type="sphere" size="{aircraft.foot_radius_m}" '
            f'pos="{forward} {-right} {aircraft.foot_radius_m - down}"/>'
        )
    for index, (forward, right, down) in enumerate(aircraft.rotors_m):
        lines.append(
            f'<geom class="aircraft" name="rotor_{index}" type="cylinder" '
            f'size="{aircraft.rotor_radius_m} 0.003" pos="{forward} {-right} {-down}"/>'
        )
    return "\n      ".join(["", *lines])


def _deck(rig: Rig) -> str:
    half = 0.5 * rig.deck_size_m
    joints = [
        f'<joint type="{kind}" axis="{axis}" armature="{DECK_ARMATURE}"/>'
        for kind, axes in (("slide", ("1 0 0", "0 1 0", "0 0 1")), ("hinge", ("0 0 1", "0 1 0", "1 0 0")))
        for axis in axes
    ]
    geom = (
        f'<geom name="deck" type="box" pos="0 0 {-0.5 * DECK_THICKNESS_M}" '
        f'size="{half} {half} {0.5 * DECK_THICKNESS_M}" mass="0.001"/>'
    )
    return "\n      ".join(["", *joints, geom])


def _box(name: str, solid: Solid) -> str:
    """A box of the drawn ship; from forward-right-down to forward-left-up."""
    middle = [0.5 * (low + high) for low, high in zip(solid.low_m, solid.high_m, strict=True)]
    half = [0.5 * (high - low) for low, high in zip(solid.low_m, solid.high_m, strict=True)]
    return (
        f'\n      <geom name="{name}" type="box" pos="{middle[0]} {-middle[1]} {-middle[2]}" '
        f'size="{half[0]} {half[1]} {half[2]}"/>'
    )


def deck_values(ship: ShipState) -> Array:
    """(30,) the deck's motion in `ned`.

    Place, velocity and acceleration of its centre; roll, pitch and yaw (course and the deck's own), their rates and
    accelerations; rotation ned_from_deck, row by row; angular velocity vector. As the group `deck` of the aircraft's
    record, where all these are named.
    """
    values = np.empty(30)
    deck_in_ned(ship.course.values, ship.deck.values, ship.rig.deck_height_m, values)
    return values


@compiled
def deck_in_ned(course: Array, deck_in_ship: Array, deck_height_m: float, deck: Array) -> None:
    """Course translation and turn combined with the deck's six coordinates.

    With d the deck's centre in `ship`, R the turn by the course and ω, α the course's rates about down:
    p = P + R d, v = P' + R (d' + ω×d), a = P'' + R (d'' + α×d + 2 ω×d' + ω×(ω×d)).
    The course and the deck's yaw turn about the same axis, so their angles add.

    Args:
        course: (9,) of `CourseState.values`.
        deck_in_ship: (18,) of `SixDof.values`.
        deck_height_m: of its neutral point over the sea plane.
        deck: (30,) written to, in the order of `deck_values`.
    """
    north, east, v_north, v_east, a_north, a_east, angle, w, e = course
    dx, dy, dz, roll, pitch, yaw = deck_in_ship[:6]
    vx, vy, vz, roll_rate, pitch_rate, yaw_rate = deck_in_ship[6:12]
    ax, ay, az, roll_acc, pitch_acc, yaw_acc = deck_in_ship[12:]
    c, s = math.cos(angle), math.sin(angle)
    ux, uy = vx - w * dy, vy + w * dx
    bx = ax - e * dy - 2.0 * w * vy - w * w * dx
    by = ay + e * dx + 2.0 * w * vx - w * w * dy
    yaw, yaw_rate, yaw_acc = yaw + angle, yaw_rate + w, yaw_acc + e
    cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
    deck[0], deck[1], deck[2] = north + c * dx - s * dy, east + s * dx + c * dy, dz - deck_height_m
    deck[3], deck[4], deck[5] = v_north + c * ux - s * uy, v_east + s * ux + c * uy, vz
    deck[6], deck[7], deck[8] = a_north + c * bx - s * by, a_east + s * bx + c * by, az
    deck[9], deck[10], deck[11] = roll, pitch, yaw
    deck[12], deck[13], deck[14] = roll_rate, pitch_rate, yaw_rate
    deck[15], deck[16], deck[17] = roll_acc, pitch_acc, yaw_acc
    rows = rows_of_euler(roll, pitch, yaw)
    for index in range(9):
        deck[18 + index] = rows[index]
    deck[27] = roll_rate * cy * cp - pitch_rate * sy
    deck[28] = roll_rate * sy * cp + pitch_rate * cy
    deck[29] = yaw_rate - roll_rate * sp


@compiled
def point_in_deck(deck: Array, motion: Array, place_in_body_m: Vector) -> Vector:
    """A point of a body with a motion (13,), as in `RigidBodyState`, in `deck`, whose motion (30,) is `deck_values`."""
    a, b, c = place_in_body_m
    r, m = rows_of_quaternion(motion[3], motion[4], motion[5], motion[6]), deck[18:27]
    x = motion[0] + r[0] * a + r[1] * b + r[2] * c - deck[0]
    y = motion[1] + r[3] * a + r[4] * b + r[5] * c - deck[1]
    z = motion[2] + r[6] * a + r[7] * b + r[8] * c - deck[2]
    return m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z, m[2] * x + m[5] * y + m[8] * z


@compiled
def against_deck(deck: Array, motion: Array) -> tuple[Vector, Vector, float]:
    """The values of `OnDeck` for a body; arguments as of `point_in_deck`."""
    x, y, z = motion[0] - deck[0], motion[1] - deck[1], motion[2] - deck[2]
    p, q, r = deck[27:]
    u = motion[7] - deck[3] - (q * z - r * y)
    v = motion[8] - deck[4] - (r * x - p * z)
    w = motion[9] - deck[5] - (p * y - q * x)
    m, rows = deck[18:27], rows_of_quaternion(motion[3], motion[4], motion[5], motion[6])
    upright = m[2] * rows[2] + m[5] * rows[5] + m[8] * rows[8]
    return (
        (m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z, m[2] * x + m[5] * y + m[8] * z),
        (m[0] * u + m[3] * v + m[6] * w, m[1] * u + m[4] * v + m[7] * w, m[2] * u + m[5] * v + m[8] * w),
        math.acos(min(max(upright, -1.0), 1.0)),
    )


@compiled
def _set_deck(deck: Array, half_step_s: float, joints: tuple[Array, Array, Array]) -> None:
    """Place, velocity, force: x y z yaw pitch roll in `mujoco`: east, down, yaw and pitch change sign."""
    for joint, (index, sign) in enumerate(_JOINTS):
        moved = deck[index + 3] - half_step_s * deck[index + 6]
        joints[0][joint] = sign * deck[index]
        joints[1][joint] = sign * moved
        joints[2][joint] = sign * DECK_ARMATURE * deck[index + 6]


_JOINTS = ((0, 1.0), (1, -1.0), (2, -1.0), (11, -1.0), (10, -1.0), (9, 1.0))
"""Of each joint of the deck: its coordinate in `deck_values`, three before its rate and six before its acceleration."""


@compiled
def _set_hull(
    deck: Array,
    course: Array,
    bar_in_ship_m: Array,
    deck_height_m: float,
    full_ship: bool,
    ship: tuple[Array, Array],
    bar: tuple[Array, Array],
) -> None:
    """Place and turn of the superstructure and of the board."""
    x, y, z = bar_in_ship_m
    if full_ship:
        north, east, down, roll, pitch, yaw = deck[0], deck[1], deck[2], deck[9], deck[10], deck[11]
        m = deck[18:27]
        arm = m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z
    else:
        north, east, down, roll, pitch, yaw = course[0], course[1], -deck_height_m, 0.0, 0.0, course[6]
        c, s = math.cos(yaw), math.sin(yaw)
        arm = c * x - s * y, s * x + c * y, z
    _set_pose(ship, (north, east, down), (roll, pitch, yaw))
    _set_pose(bar, (north + arm[0], east + arm[1], down + arm[2]), (0.0, 0.0, yaw))


@compiled
def _set_pose(pose: tuple[Array, Array], place_m: Vector, angles_rad: Vector) -> None:
    place, turn = pose
    place[0], place[1], place[2] = place_m[0], -place_m[1], -place_m[2]
    w, x, y, z = quaternion_of_euler(*angles_rad)
    turn[0], turn[1], turn[2], turn[3] = w, x, -y, -z


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


class Bodies:
    """MuJoCo's data: the aircraft, whose motion and wrench stand in its record as the deck's motion does, and the ship.

    MuJoCo's integrator is semi-implicit: its velocities belong half a step before its positions. The deck's velocity
    is set that way too, or what stands on a deck with acceleration a creeps at ½ a step_s (1 mm/s in a turn).
    """

    def __init__(self, rig: Rig, shape: Shape, step_s: float, record: Record) -> None:
        import mujoco

        self.model = build_model(rig, shape, step_s)
        self.data = data = mujoco.MjData(self.model.mj)
        self._mj_step, self._mj_contact_force = mujoco.mj_step, mujoco.mj_contactForce
        self._shape, self._record, self._half_step_s = shape, record, 0.5 * step_s
        self._half_deck_m, self._deck_height_m, self._bar_m = (
            0.5 * rig.deck_size_m,
            rig.deck_height_m,
            rig.bar_in_ship_m,
        )
        self._place, self._velocity, self._force = data.qpos[0:7], data.qvel[0:6], data.qfrc_applied[0:6]
        self._joints = data.qpos[7:13], data.qvel[6:12], data.qfrc_applied[6:12]
        ship, bar = self.model.ship_mocap, self.model.board_mocap
        self._ship = data.mocap_pos[ship], data.mocap_quat[ship]
        self._bar = data.mocap_pos[bar], data.mocap_quat[bar]
        values = record.values
        self._own_motion, self._deck, self._course = values[at("motion")], values[at("deck")], values[at("ship")]
        self._own_place, self._own_velocity = self._own_motion[:7], self._own_motion[7:]
        self._own_wrench = values[at("wrench")]
        self._force_of_contact = np.zeros(6)
        self._motion: RigidBodyState | None = None
        self._moved = False

    def set_deck(self) -> None:
        """Set the deck's joints by the record."""
        _set_deck(self._deck, self._half_step_s, self._joints)

    def set_hull(self, full_ship: bool) -> None:
        """Set the poses of the superstructure and of the board by the record."""
        _set_hull(self._deck, self._course, self._bar_m, self._deck_height_m, full_ship, self._ship, self._bar)

    def put(
        self, position_m: Vector, roll_rad: float, pitch_rad: float, heading_rad: float, velocity_mps: Vector = AT_REST
    ) -> None:
        """Place the aircraft."""
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
        self._mj_step(self.model.mj, self.data, count)
        np.multiply(self._place, _PLACE_SIGNS, out=self._own_place)
        np.multiply(self._velocity, _VELOCITY_SIGNS, out=self._own_velocity)
        self._motion, self._moved = None, False

    def motion(self) -> RigidBodyState:
        """Where the aircraft is and how it moves."""
        if self._motion is None:
            self._motion = self._record.motion
        return self._motion

    def moved(self) -> None:
        """The record's motion has changed by other means than `step`."""
        self._motion, self._moved = None, True

    @property
    def in_contact(self) -> bool:
        """Whether anything touches."""
        return bool(self.data.ncon)

    def over_deck(self, place_in_body_m: Vector) -> float:
        """Height of a point of the aircraft over the deck; infinite beside or below it."""
        x, y, z = point_in_deck(self._deck, self._own_motion, place_in_body_m)
        half = self._half_deck_m
        return -z if abs(x) < half and abs(y) < half and z < 0.0 else math.inf

    def range_m(self) -> float:
        """Clearance of the lowest foot over the deck's plane, as a downward range finder gives it; infinite beside."""
        half = self._half_deck_m
        feet = [point_in_deck(self._deck, self._own_motion, foot) for foot in self._shape.feet_m]
        over = [-foot[2] for foot in feet if abs(foot[0]) < half and abs(foot[1]) < half]
        return max(min(over), 0.0) if over else math.inf

    def on_deck(self) -> OnDeck:
        """The aircraft against the deck."""
        return OnDeck(*against_deck(self._deck, self._own_motion))

    def touch(self) -> Contacts:
        """The contacts of the last physics step."""
        parts = self.model.part_of_geom
        feet: set[int] = set()
        force_n, fault = 0.0, ""
        for index, pair in enumerate(self.data.contact.geom[: self.data.ncon].tolist()):
            own, other = sorted(pair)
            if parts[own] == FOOT and parts[other] == DECK:
                self._mj_contact_force(self.model.mj, self.data, index, self._force_of_contact)
                if self._force_of_contact[0] > 0.0:
                    feet.add(own)
                    force_n += float(self._force_of_contact[0])
            else:
                fault = fault or _FAULTS[parts[own], parts[other]]
        return Contacts(len(feet), force_n, fault)
