"""The MuJoCo model: aircraft on a free joint, driven deck on six joints, superstructure and board as mocap bodies.

MuJoCo's world is `mujoco` (north-west-up) and its bodies are forward-left-up; both are their NED and
forward-right-down siblings turned half round the first axis.

The deck must have velocity and acceleration in the contacts, or what stands on it slides off; so it has joints
(x, y, z, then yaw, pitch, roll), whose positions and velocities are set every step and whose forces give the wanted
accelerations. Its inertia is joint armature: the mass matrix is then diagonal, force = armature × acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from shipland.rig import Rig, Solid, layout
from shipland.sim.aircraft.parameters import Shape

if TYPE_CHECKING:
    import mujoco

DECK_ARMATURE = 1e4
DECK_THICKNESS_M = 0.10

FOOT, BODY, ROTOR, DECK, SUPERSTRUCTURE, BOARD, BASE = (
    "foot",
    "body",
    "rotor",
    "deck",
    "superstructure",
    "board",
    "base",
)


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

    def start(self) -> mujoco.MjData:
        """A state of the model."""
        import mujoco

        return mujoco.MjData(self.mj)


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
        for kind, axis in (
            ("slide", "1 0 0"),
            ("slide", "0 1 0"),
            ("slide", "0 0 1"),
            ("hinge", "0 0 1"),
            ("hinge", "0 1 0"),
            ("hinge", "1 0 0"),
        )
    ]
    return "\n      ".join(
        [
            "",
            *joints,
            f'<geom name="deck" type="box" pos="0 0 {-0.5 * DECK_THICKNESS_M}" '
            f'size="{half} {half} {0.5 * DECK_THICKNESS_M}" mass="0.001"/>',
        ]
    )


def _box(name: str, solid: Solid) -> str:
    """A box of the drawn ship; from forward-right-down to forward-left-up."""
    middle = [0.5 * (low + high) for low, high in zip(solid.low_m, solid.high_m, strict=True)]
    half = [0.5 * (high - low) for low, high in zip(solid.low_m, solid.high_m, strict=True)]
    return (
        f'\n      <geom name="{name}" type="box" pos="{middle[0]} {-middle[1]} {-middle[2]}" '
        f'size="{half[0]} {half[1]} {half[2]}"/>'
    )
