"""Mesh of a frigate's hull and upperworks, in `ship`: forward-starboard-down from the flight deck's centre [m].

Shapes are those of an FFG-7-like ship as one sees it from astern: a fine bow with flare and a sheer line that rises
forward, a wide transom, the hangar with the bridge ahead of it, funnel, masts, and what stands on the roofs. Places are
shares of the boxes in `Layout`, all chosen; nothing here collides.
"""

from __future__ import annotations

import itertools

import numpy as np

from shipland.frames import Array, Pose
from shipland.rig import Layout, Rig, Solid
from shipland.sim.scene import mesh
from shipland.sim.scene.mesh import GREY, HANGAR, HULL, METAL, Colour, Mesh

_SHEER_M = 3.6
"""How much higher than the flight deck the stem is."""
_KEEL_M = 7.0
"""Hull drawn below the mean sea, for heave and pitch."""
_DECK_GREY: Colour = (0.13, 0.135, 0.14)
_BLACK: Colour = (0.03, 0.03, 0.03)
_WHITE: Colour = (0.62, 0.63, 0.64)
_STATIONS = 28


def _stations(parts: Layout) -> tuple[Array, Array, Array, Array]:
    """Along the hull from the stern: forward, half breadth at the deck and at the water, deck (down)."""
    share = np.linspace(0.0, 1.0, _STATIONS)
    low, high = parts.hull.low_m, parts.hull.high_m
    fore = np.clip((share - 0.62) / 0.38, 0.0, 1.0)
    deck_half = high[1] * (1.0 - fore**2.2) * np.interp(share, [0.0, 0.2], [0.975, 1.0])
    fine = np.clip((share - 0.45) / 0.52, 0.0, 1.0)
    water_half = high[1] * (1.0 - fine**1.7) * np.interp(share, [0.0, 0.3], [0.86, 0.97])
    sheer = low[2] - _SHEER_M * np.clip((share - 0.5) / 0.5, 0.0, 1.0) ** 2
    return low[0] + share * (high[0] - low[0]), deck_half, water_half, sheer


def hull(parts: Layout) -> Mesh:
    """Sides, transom and decks."""
    forward, deck_half, water_half, deck = _stations(parts)
    water = parts.hull.high_m[2]
    quads = []
    for here, there in itertools.pairwise(range(_STATIONS)):
        for side in (-1.0, 1.0):
            rows = [
                [(forward[i], side * half[i], down) for i, down in ((here, ends[0]), (there, ends[1]))]
                for half, ends in (
                    (deck_half, (deck[here], deck[there])),
                    (water_half, (water, water)),
                    (0.8 * water_half, (water + _KEEL_M, water + _KEEL_M)),
                )
            ]
            for upper, lower in itertools.pairwise(rows):
                quads.append(_face([*upper, *lower[::-1]], (0.0, side, 0.0), GREY, HULL))
        around = ((here, 1.0), (here, -1.0), (there, -1.0), (there, 1.0))  # at the stem the last two are one
        corners = [(forward[i], side * deck_half[i], deck[i]) for i, side in around]
        quads.append(_face(corners, (0.0, 0.0, -1.0), _DECK_GREY, mesh.PLAIN))
    for (top, top_down), (foot, foot_down) in itertools.pairwise(
        ((deck_half[0], deck[0]), (water_half[0], water), (0.8 * water_half[0], water + _KEEL_M))
    ):
        corners = [
            (forward[0], y, z) for y, z in ((-top, top_down), (top, top_down), (foot, foot_down), (-foot, foot_down))
        ]
        quads.append(_face(corners, (-1.0, 0.0, 0.0), GREY, HULL))
    return np.concatenate(quads)


def _face(
    corners: list[tuple[float, float, float]], outward: tuple[float, float, float], rgb: Colour, layer: int
) -> Mesh:
    """A quadrilateral (4,3), nearly flat, whose normal lies on the side of `outward`."""
    points = np.array(corners, dtype=float)
    normal = np.cross(points[2] - points[0], points[3] - points[1])
    length = float(np.linalg.norm(normal))
    normal = np.array(outward) if length < 1e-9 else normal / length
    normal = normal if float(normal @ np.array(outward)) >= 0.0 else -normal
    across = (0, 2) if abs(outward[1]) > 0.5 else ((1, 2) if abs(outward[0]) > 0.5 else (0, 1))
    return mesh.quad(points, normal, _PLATING_PER_M * points[:, across], rgb, layer)


_PLATING_PER_M = 1.0 / 12.0
"""Repeats of the hull's plating a metre."""


def upperworks(rig: Rig, parts: Layout) -> Mesh:
    """Hangar and superstructure, bridge, funnel, masts, and the bar's brackets."""
    house, floor = parts.house, parts.house.high_m[2]
    face, fore, half, roof = house.low_m[0], house.high_m[0], house.high_m[1], house.low_m[2]
    bar = Pose(np.eye(3), rig.bar_in_ship_m)
    wall = mesh.box(house, GREY, {1: HANGAR}, cells={1: 10}, skip=(4,))
    wall = mesh.shaded(wall, [(parts.board, bar), (parts.deck, Pose.identity()), (parts.hull, Pose.identity())])

    def at(share: float) -> float:
        return float(face + share * (fore - face))

    def block(aft: float, ahead: float, breadth: float, top_m: float, foot_m: float, rgb: Colour = GREY) -> Mesh:
        y = breadth * half
        return mesh.box(Solid((at(aft), -y, roof - top_m), (at(ahead), y, roof - foot_m)), rgb, skip=(4,))

    meshes = [
        wall,
        block(0.70, 0.97, 0.80, 4.6, 0.0),  # bridge
        block(0.72, 0.95, 0.55, 6.4, 4.6),
        block(0.30, 0.42, 0.32, 4.2, 0.0),  # funnel
        block(0.31, 0.41, 0.28, 4.7, 4.2, _BLACK),
        mesh.box(Solid((at(0.972), -0.7 * half, roof - 4.1), (at(0.974), 0.7 * half, roof - 3.2)), _BLACK),  # windows
    ]
    for x, top_m, radius_m in ((at(0.60), 17.0, 0.45), (at(0.48), 11.0, 0.30)):  # masts with yards
        meshes.append(mesh.cylinder((x, 0.0, roof), (x, 0.0, roof - top_m), radius_m, GREY))
        for side in (-1.0, 1.0):
            foot = (x - 2.5, 1.8 * side, roof)
            meshes.append(mesh.cylinder(foot, (x, 0.0, roof - 0.75 * top_m), 0.2, GREY))
        for height in (0.55, 0.75, 0.92):
            reach = 3.6 * (1.2 - height)
            yard = roof - height * top_m
            meshes.append(mesh.cylinder((x, -reach, yard), (x, reach, yard), 0.12, METAL))
    radar = at(0.60), 0.0, roof - 9.0
    meshes.append(mesh.box(Solid((radar[0] - 0.9, -2.4, radar[2] - 1.2), (radar[0] - 0.6, 2.4, radar[2])), METAL))
    dome = at(0.07)  # the close-in weapon on the hangar's roof
    meshes.append(mesh.cylinder((dome, 0.0, roof), (dome, 0.0, roof - 1.4), 1.2, GREY, 10, caps=True))
    meshes.append(mesh.cylinder((dome, 0.0, roof - 1.4), (dome, 0.0, roof - 3.6), 0.75, _WHITE, 10, caps=True))
    meshes.append(mesh.cylinder((at(0.76), 0.0, roof - 6.4), (at(0.76), 0.0, roof - 8.6), 1.1, _WHITE, 10, caps=True))
    for side in (-1.0, 1.0):  # the bar's brackets, boats
        y = side * 0.40 * rig.board_size_m[0]
        x, _, z = rig.bar_in_ship_m.tolist()
        meshes.append(mesh.cylinder((x + 0.03, y, z), (face, y, z), 0.05, METAL))
        meshes.append(
            mesh.cylinder(
                (at(0.50), side * 0.8 * half, roof - 0.9),
                (at(0.62), side * 0.8 * half, roof - 0.9),
                0.8,
                _WHITE,
                10,
                caps=True,
            )
        )
    gun = parts.hull.low_m[0] + 0.83 * (parts.hull.high_m[0] - parts.hull.low_m[0])
    meshes.append(mesh.cylinder((gun, 0.0, floor), (gun, 0.0, floor - 4.2), 1.3, GREY, 10, caps=True))
    return np.concatenate(meshes)
