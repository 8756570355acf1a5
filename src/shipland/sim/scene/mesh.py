"""Meshes of what is drawn: ship, deck, legs, bar, aircraft. Lengths in metres, frames as in `frames`.

A vertex is 13 float32: position (3), outward normal (3), texture coordinates (2), albedo (3), paint layer, and the
share of the sky's light that comes through. Triangles run counter-clockwise seen from outside, in right-handed axes.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt

from shipland.frames import Array, Pose
from shipland.rig import Layout, Rig, Solid

Mesh = npt.NDArray[np.float32]
Colour = tuple[float, float, float]
Point = npt.ArrayLike

PLAIN, DECK, HANGAR, HULL = range(4)
"""Layers of the paint array."""

GREY: Colour = (0.34, 0.36, 0.38)
DARK: Colour = (0.09, 0.095, 0.10)
BOARD: Colour = (0.13, 0.13, 0.13)
METAL: Colour = (0.50, 0.51, 0.52)

_DRAUGHT_M = 0.4
_LIGHT, _LIGHTS_APART_M = 0.01, 3.0
"""Side of a deck light, as a share of the deck's, and the most between two."""
_FACES = ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0))


def quad(corners: Array, normal: Array, uv: Array, albedo: Colour, layer: int) -> Mesh:
    """A flat quadrilateral (4,3) with its outward normal and texture coordinates (4,2)."""
    rows = np.zeros((4, 13))
    rows[:, 0:3], rows[:, 3:6], rows[:, 6:8], rows[:, 8:11], rows[:, 11] = corners, normal, uv, albedo, layer
    rows[:, 12] = 1.0
    if np.dot(np.cross(corners[1] - corners[0], corners[2] - corners[0]), normal) < 0.0:
        rows = rows[::-1]
    return rows[[0, 1, 2, 0, 2, 3]].astype(np.float32)


def box(
    solid: Solid,
    albedo: Colour,
    paints: dict[int, int] | None = None,
    layer: int = PLAIN,
    cells: dict[int, int] | None = None,
    skip: tuple[int, ...] = (),
) -> Mesh:
    """An upright box.

    Args:
        solid: the box.
        albedo: of all its faces.
        paints: other paint layers, stretched once over a face (0 +x, 1 −x, 2 +y, 3 −y, 4 +z, 5 −z).
        layer: paint of the other faces, one repeat a metre.
        cells: faces to split in n × n, for light that changes over them.
        skip: faces to leave out.
    """
    low, high = np.array(solid.low_m), np.array(solid.high_m)
    parts = []
    for face, (axis, side) in enumerate(_FACES):
        if face in skip:
            continue
        u, v = [other for other in range(3) if other != axis]
        normal = np.zeros(3)
        normal[axis] = side
        own, count = (paints or {}).get(face), (cells or {}).get(face, 1)
        steps = np.linspace(0.0, 1.0, count + 1)
        for row in range(count):
            for column in range(count):
                share = np.array([(steps[column + i], steps[row + j]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))])
                corners = np.zeros((4, 3))
                corners[:, axis] = high[axis] if side > 0 else low[axis]
                corners[:, [u, v]] = low[[u, v]] + share * (high - low)[[u, v]]
                uv = corners[:, [u, v]] if own is None else share
                parts.append(quad(corners, normal, uv, albedo, layer if own is None else own))
    return np.concatenate(parts)


def prism(triangle: Array, thickness_m: float, albedo: Colour) -> Mesh:
    """A triangular plate (3,3) in a plane y = constant, thick towards +y."""
    near = np.asarray(triangle, dtype=float)
    far = near + np.array([0.0, thickness_m, 0.0])
    middle = 0.5 * (near.mean(axis=0) + far.mean(axis=0))
    parts = []
    for face, side in ((near, -1.0), (far, 1.0)):
        corners = np.concatenate([face, face[2:]])
        parts.append(quad(corners, np.array([0.0, side, 0.0]), corners[:, [0, 2]], albedo, PLAIN)[:3])
        if np.dot(np.cross(parts[-1][1, :3] - parts[-1][0, :3], parts[-1][2, :3] - parts[-1][0, :3]), [0, side, 0]) < 0:
            parts[-1] = parts[-1][::-1]
    for index in range(3):
        after = (index + 1) % 3
        corners = np.array([near[index], near[after], far[after], far[index]])
        normal = np.cross(near[after] - near[index], [0.0, 1.0, 0.0])
        normal /= np.linalg.norm(normal)
        normal *= np.sign(np.dot(normal, corners.mean(axis=0) - middle))
        parts.append(quad(corners, normal, corners[:, [0, 2]], albedo, PLAIN))
    return np.concatenate(parts)


def _unit_cylinder(sides: int, caps: bool) -> Mesh:
    angles = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides + 1)])
    up = np.array([0.0, 0.0, 1.0])
    parts = []
    for here, there in itertools.pairwise(ring):
        rows = np.zeros((4, 13), np.float32)
        rows[:, 0:3] = here, there, there + up, here + up
        rows[:, 3:6] = here, there, there, here
        parts.append(rows[[0, 1, 2, 0, 2, 3]])
        if caps:
            for level, outward, order in ((0.0, -up, (0, 2, 1)), (1.0, up, (0, 1, 2))):
                fan = np.zeros((3, 13), np.float32)
                fan[:, 0:3] = level * up, here + level * up, there + level * up
                fan[:, 3:6] = outward
                parts.append(fan[list(order)])
    mesh = np.concatenate(parts)
    mesh[:, 12] = 1.0
    return mesh


_TUBES = {key: _unit_cylinder(*key) for key in ((6, False), (10, True), (24, True))}


def cylinder(start: Point, end: Point, radius_m: float, albedo: Colour, sides: int = 6, caps: bool = False) -> Mesh:
    """A round bar between two points."""
    mesh = _TUBES[sides, caps].copy()
    foot, axis = np.asarray(start, dtype=float), np.subtract(end, start).astype(float)
    length = float(np.linalg.norm(axis))
    along = axis / max(length, 1e-9)
    first = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    first /= np.linalg.norm(first)
    turn = np.column_stack([first, np.cross(along, first), along])
    mesh[:, 0:3] = (mesh[:, 0:3] * [radius_m, radius_m, length]) @ turn.T + foot
    mesh[:, 3:6] = mesh[:, 3:6] @ turn.T
    mesh[:, 8:11] = albedo
    return mesh


def open_sky(points_m: Array, normals: Array, boxes: list[tuple[Solid, Pose]], rays: int = 96) -> Array:
    """(n,) share of the cosine-weighted half space over points (n,3) with unit normals (n,3) that no box covers.

    Boxes have their poses in the points' frame; directions are spread by the golden angle.
    """
    index = np.arange(rays) + 0.5
    radius, angle = np.sqrt(index / rays), index * np.pi * (3.0 - np.sqrt(5.0))
    local = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - radius**2)])
    helper = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(normals, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    directions = np.einsum("rk,nkx->nrx", local, np.stack([first, second, normals], axis=1))
    blocked = np.zeros(directions.shape[:2], dtype=bool)
    origins = points_m + 0.003 * normals
    for solid, pose in boxes:
        origin = pose.inverse().apply(origins)[:, None, :]
        direction = directions @ pose.rotation
        direction = np.where(np.abs(direction) < 1e-9, 1e-9, direction)
        a, b = (np.array(solid.low_m) - origin) / direction, (np.array(solid.high_m) - origin) / direction
        enter, leave = np.minimum(a, b).max(axis=2), np.maximum(a, b).min(axis=2)
        blocked |= (leave > np.maximum(enter, 0.0)) & (leave > 1e-6)
    return np.asarray(1.0 - blocked.mean(axis=1))


def shaded(mesh: Mesh, boxes: list[tuple[Solid, Pose]]) -> Mesh:
    """The mesh with the share of the sky that boxes leave open at its corners."""
    mesh[:, 12] = 0.03 + 0.97 * open_sky(mesh[:, 0:3].astype(float), mesh[:, 3:6].astype(float), boxes)
    return mesh


def hull(parts: Layout) -> Mesh:
    """The platform, in `ship`; light under the deck as with the deck at rest."""
    low, high = parts.hull.low_m, parts.hull.high_m
    floor = box(Solid((low[0], low[1], low[2]), (high[0], high[1], low[2] + 0.02)), DARK, cells={5: 10}, skip=(4,))
    keel = (high[0], high[1], high[2] + _DRAUGHT_M)  # what is under water is cut off when drawn
    side = box(Solid((low[0], low[1], low[2] + 0.02), keel), GREY, layer=HULL, skip=(4, 5))
    return np.concatenate([shaded(floor, [(parts.deck, Pose.identity()), (parts.house, Pose.identity())]), side])


def house(rig: Rig, parts: Layout) -> Mesh:
    """The superstructure with its knees and the bar's posts, in `ship`."""
    wall, floor = parts.house, parts.hull.low_m[2]
    bar = Pose(np.eye(3), rig.bar_in_ship_m)
    wall_mesh = shaded(
        box(wall, GREY, {1: HANGAR}, cells={1: 10}, skip=(4,)),
        [(parts.board, bar), (parts.deck, Pose.identity()), (parts.hull, Pose.identity())],
    )
    meshes = [wall_mesh]
    face, half = wall.low_m[0], wall.high_m[1]
    for y in (-half, half - 0.03):
        top = floor + 0.55 * (wall.low_m[2] - floor)
        knee = np.array([[face, y, floor], [face, y, top], [face - 0.28, y, floor]])
        meshes.append(prism(knee, 0.03, GREY))
    x = 0.5 * (rig.bar_in_ship_m[0] + face) + 0.01
    for side in (-1.0, 1.0):
        y = side * 0.40 * rig.board_size_m[0]
        meshes.append(cylinder((x, y, floor), (x, y, rig.bar_in_ship_m[2]), 0.012, METAL))
    return np.concatenate(meshes)


def scaled(solid: Solid, scale: float) -> Solid:
    """A box, larger about its frame's origin."""
    low, high = (tuple(scale * value for value in ends) for ends in (solid.low_m, solid.high_m))
    return Solid((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def bounds(mesh: Mesh) -> Solid:
    """The upright box around a mesh, in its frame."""
    low, high = mesh[:, 0:3].min(axis=0).tolist(), mesh[:, 0:3].max(axis=0).tolist()
    return Solid((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def at_height(mesh: Mesh, down_m: float) -> tuple[Mesh, Mesh]:
    """A mesh's triangles that reach below a height, `down_m` in its frame, and the rest."""
    low = np.repeat(mesh[:, 2].reshape(-1, 3).max(axis=1) > down_m, 3)
    return mesh[low], mesh[~low]


def deck(rig: Rig, parts: Layout) -> Mesh:
    """The motion deck, in `deck`; its upper face is at z = 0, and shaded as with the deck at rest."""
    around = [(parts.house, Pose.identity()), (parts.board, rig.ship_from_bar), (parts.hull, Pose.identity())]
    return shaded(box(parts.deck, GREY, {5: DECK}, cells={4: 4, 5: 8}), around)


def deck_lights(rig: Rig) -> Mesh:
    """The deck's perimeter lights, in `deck`: four or more a side, one in each corner, at most 3 m apart.

    Source: IMO MODU Code 2009, 13.5.
    """
    size_m, count = _LIGHT * rig.deck_size_m, max(4, math.ceil(rig.deck_size_m / _LIGHTS_APART_M) + 1)
    at_m = np.linspace(-0.5, 0.5, count) * (rig.deck_size_m - size_m)
    low, high = at_m - 0.5 * size_m, at_m + 0.5 * size_m
    ends = 0, count - 1
    return np.concatenate(
        [
            box(Solid((low[row], low[column], -size_m), (high[row], high[column], 0.0)), GREY, skip=(4,))
            for row, column in itertools.product(range(count), repeat=2)
            if row in ends or column in ends
        ]
    )


def board(parts: Layout) -> tuple[Mesh, Mesh]:
    """The bar in `bar`: the face towards the stern, and the rest."""
    mesh = box(parts.board, BOARD)
    aft = mesh[:, 3] < -0.5
    return mesh[aft], mesh[~aft]


_LEG_ANGLES = np.radians([30.0, 90.0, 150.0, 210.0, 270.0, 330.0])
_LEG_HALF_ANGLES_RAD = np.radians([-18.0, 18.0] * 3)


def legs(parts: Layout, ship_from_deck: Pose) -> Mesh:
    """The motion base's six legs in `ship`, from the hull to the deck's underside."""
    reach, floor = 0.45 * (parts.deck.high_m[0] - parts.deck.low_m[0]), parts.hull.low_m[2]
    meshes = []
    for angle, half in zip(_LEG_ANGLES, _LEG_HALF_ANGLES_RAD, strict=True):
        foot = np.array([reach * np.cos(angle + half), reach * np.sin(angle + half), floor])
        head = np.array([0.76 * reach * np.cos(angle - half), 0.76 * reach * np.sin(angle - half), 0.05])
        top = ship_from_deck.apply(head)
        middle = foot + 0.55 * (top - foot)
        meshes += [cylinder(foot, middle, 0.035, DARK), cylinder(middle, top, 0.02, METAL)]
    mesh = np.concatenate(meshes)
    mesh[:, 12] = 0.6
    return mesh


MOTOR_DIAGONAL_M = 0.24
"""Motor diagonal of the drawn aircraft at scale 1."""

AIRCRAFT = Solid((-0.17, -0.17, -0.05), (0.17, 0.17, 0.06))
"""Bounds of the aircraft in `body`."""

AIRCRAFT_SHADE = Solid((-0.10, -0.07, -0.03), (0.11, 0.07, 0.02))
"""The part of the aircraft that casts a shadow."""

_MOTORS_M = [(x, y) for x in (-0.085, 0.085) for y in (-0.085, 0.085)]


def quadrotor(scale: float = 1.0) -> Mesh:
    """A small quadrotor in `body` without its rotors, 0.24 m across the motors, as the rig's aircraft is; or larger."""
    shell: Colour = (0.10, 0.10, 0.11)
    meshes = [
        box(Solid((-0.080, -0.030, -0.020), (0.080, 0.030, 0.020)), shell),
        box(Solid((0.080, -0.016, -0.014), (0.108, 0.016, 0.016)), (0.02, 0.02, 0.025)),
        box(Solid((-0.060, -0.025, -0.032), (0.045, 0.025, -0.020)), (0.42, 0.43, 0.45)),
        box(Solid((-0.084, -0.012, -0.008), (-0.080, 0.012, 0.006)), (0.8, 0.05, 0.03)),
    ]
    for x, y in _MOTORS_M:
        meshes += [
            cylinder((0.55 * x, 0.28 * y, 0.0), (x, y, -0.006), 0.0075, shell),
            cylinder((x, y, 0.012), (x, y, -0.030), 0.011, (0.05, 0.05, 0.055), 10, caps=True),
            cylinder((x, y, 0.008), (1.04 * x, 1.04 * y, 0.050), 0.0045, shell),
        ]
    mesh = np.concatenate(meshes)
    mesh[:, 0:3] *= scale
    return mesh


def rotors(scale: float = 1.0) -> Mesh:
    """The four turning rotors in `body`: discs seen from both sides, with texture coordinates over the unit disc."""
    meshes = []
    for x, y in _MOTORS_M:
        disc = cylinder((x, y, -0.032), (x, y, -0.033), 0.072, (0.34, 0.34, 0.35), 24, caps=True)
        disc = disc[np.abs(disc[:, 5]) > 0.5]
        disc[:, 6:8] = (disc[:, 0:2] - [x, y]) / 0.072
        meshes.append(disc)
    mesh = np.concatenate(meshes)
    mesh[:, 0:3] *= scale
    return mesh
