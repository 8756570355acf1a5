"""The ship, the bar and the aircraft: meshes on the card, and the passes that draw them."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.rig import Rig, Solid, layout
from shipland.sim.scene import gl as scene_gl
from shipland.sim.scene import mesh as scene_mesh
from shipland.sim.scene import paint as scene_paint
from shipland.sim.scene import view as scene_view
from shipland.sim.scene.mesh import Mesh
from shipland.sim.scene.view import Crop
from shipland.sim.state import SceneState

HULL, HOUSE, DECK, BOARD, AIRCRAFT = 1, 2, 4, 8, 16
"""Bits of the shadow casters, in the order of `ShipLayer.casters`."""
ID_SHIP, ID_BAR, ID_AIRCRAFT = 1, 2, 3
_PAINT_UNIT = 3
_CLIP_DISTANCE_0 = 0x3000
_LAMP_RGB = np.array([0.01, 1.0, 0.03])
_FORMAT = "3f 3f 2f 4f 1f"
_NAMES = ("in_position", "in_normal", "in_uv", "in_paint", "in_open")


@dataclass(frozen=True)
class _Part:
    lit: moderngl.VertexArray
    flat: moderngl.VertexArray
    identity: int


@dataclass(frozen=True)
class Placed:
    """A part with its pose and bounds.

    Attributes:
        part: what to draw.
        ned_from_mesh: pose.
        bounds: an upright box around it in its own frame.
    """

    part: _Part
    ned_from_mesh: Pose
    bounds: Solid


class ShipLayer:
    """Everything solid. The uniform block must be bound and written before a draw.

    Args:
        context: OpenGL.
        rig: dimensions and cue.
        lamp: luminous green of the cue, in radiance of sunlit white.
        rng: stains.
    """

    def __init__(self, context: moderngl.Context, rig: Rig, lamp: float, rng: np.random.Generator) -> None:
        self._context, self._layout = context, layout(rig)
        self._quads_m = rig.target.points_in_bar_m[:, 1:].reshape(-1, 4, 2)
        self._solids: dict[int, moderngl.Program] = {}
        self._paints = scene_gl.mipmapped(context, scene_paint.paints(rng, rig), layers=True)
        self._paints.use(_PAINT_UNIT)
        fragment = ("paint.glsl", "board.frag")
        self._face_program = scene_gl.program(context, "solid.vert", fragment, QUADS=len(self._quads_m), SHADOWS=0)
        self._face_program["paints"] = _PAINT_UNIT
        self._face_program["lamp_rgb"] = tuple(lamp * _LAMP_RGB)
        self._flat_program = scene_gl.program(context, "solid.vert", ("identity.frag",), SHADOWS=0)
        parts = self._layout
        face, board = scene_mesh.board(parts)
        self._hull = self._part(scene_mesh.hull(parts), HOUSE | DECK | BOARD | AIRCRAFT)
        self._house = self._part(scene_mesh.house(rig, parts), DECK | BOARD | AIRCRAFT)
        self._deck = self._part(scene_mesh.deck(parts), HOUSE | BOARD | AIRCRAFT)
        self._board = self._part(board, 0, ID_BAR)
        self._aircraft = self._part(scene_mesh.quadrotor(), HOUSE, ID_AIRCRAFT)
        veil = scene_gl.program(context, "solid.vert", ("paint.glsl", "rotor.frag"), SHADOWS=HOUSE)
        veil["paints"] = _PAINT_UNIT
        self._rotors = self._part_of(context.buffer(scene_mesh.rotors().tobytes()), veil, ID_AIRCRAFT)
        self._face = self._part_of(context.buffer(face.tobytes()), self._face_program, ID_BAR)
        self._leg_buffer = context.buffer(scene_mesh.legs(parts, Pose.identity()).tobytes(), dynamic=True)
        self._legs = self._part_of(self._leg_buffer, self._solid(DECK), ID_SHIP)

    def _solid(self, shadows: int) -> moderngl.Program:
        if shadows not in self._solids:
            fragment = ("paint.glsl", "solid.frag")
            self._solids[shadows] = scene_gl.program(self._context, "solid.vert", fragment, SHADOWS=shadows)
            self._solids[shadows]["paints"] = _PAINT_UNIT
        return self._solids[shadows]

    def _part(self, mesh: Mesh, shadows: int, identity: int = ID_SHIP) -> _Part:
        return self._part_of(self._context.buffer(mesh.tobytes()), self._solid(shadows), identity)

    def _part_of(self, buffer: moderngl.Buffer, program: moderngl.Program, identity: int) -> _Part:
        lit = self._context.vertex_array(program, [(buffer, _FORMAT, *_NAMES)])
        flat = self._context.vertex_array(self._flat_program, [(buffer, "3f 40x", "in_position")])
        return _Part(lit, flat, identity)

    def casters(self, state: SceneState) -> list[tuple[Solid, Pose]]:
        """Boxes that throw shadows, with ned_from_box."""
        parts = self._layout
        return [
            (parts.hull, state.ned_from_ship),
            (parts.house, state.ned_from_ship),
            (parts.deck, state.ned_from_deck),
            (parts.board, state.ned_from_bar),
            (scene_mesh.AIRCRAFT_SHADE, state.ned_from_body),
        ]

    def place(self, state: SceneState, draw_aircraft: bool) -> list[Placed]:
        """What there is to draw, front to back as seen from the approach, as hidden pixels cost nothing; veils last."""
        parts = self._layout
        ship_from_deck = state.ned_from_ship.inverse() @ state.ned_from_deck
        self._leg_buffer.write(scene_mesh.legs(parts, ship_from_deck).tobytes())
        placed = [
            Placed(self._face, state.ned_from_bar, parts.board),
            Placed(self._board, state.ned_from_bar, parts.board),
            Placed(self._deck, state.ned_from_deck, parts.deck),
            Placed(self._legs, state.ned_from_ship, parts.hull),
            Placed(self._house, state.ned_from_ship, parts.house),
            Placed(self._hull, state.ned_from_ship, parts.hull),
        ]
        if draw_aircraft:
            placed.insert(0, Placed(self._aircraft, state.ned_from_body, scene_mesh.AIRCRAFT))
            placed.append(Placed(self._rotors, state.ned_from_body, scene_mesh.AIRCRAFT))
        return placed

    def aim(self, camera: Camera, state: SceneState) -> None:
        """Set the cue's edge lines for a camera."""
        lines = scene_view.edge_lines(camera, state.ned_from_camera.inverse() @ state.ned_from_bar, self._quads_m)
        scene_gl.write_uniform(self._face_program, "edge_lines", lines)

    def draw(self, placed: list[Placed], eye: Pose) -> None:
        """Draw into the bound target."""
        self._begin()
        for item in placed:
            if item.part is self._rotors:
                self._context.enable(moderngl.BLEND)
                self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
                scene_gl.write_depth(self._context, False)
            scene_gl.write_uniform(item.part.lit.program, "rel_from_mesh", _relative(item, eye))
            item.part.lit.render()
        self._end()

    def draw_identities(self, placed: list[Placed], eye: Pose) -> None:
        """Draw every part's number / 255 into the bound target's red."""
        self._begin()
        for item in placed:
            scene_gl.write_uniform(self._flat_program, "rel_from_mesh", _relative(item, eye))
            self._flat_program["identity"] = item.part.identity / 255.0
            item.part.flat.render()
        self._end()

    def _begin(self) -> None:
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._context.enable_direct(_CLIP_DISTANCE_0)
        self._context.front_face = "cw"

    def _end(self) -> None:
        scene_gl.write_depth(self._context, True)
        self._context.enable_only(moderngl.NOTHING)
        self._context.disable_direct(_CLIP_DISTANCE_0)


def _relative(item: Placed, eye: Pose) -> Array:
    matrix = item.ned_from_mesh.matrix()
    matrix[:3, 3] -= eye.translation_m
    return np.asarray(matrix.T)


def corners_in_camera_m(placed: list[Placed], eye: Pose) -> Array:
    """(8n,3) corners of all bounds in `camera` [m]."""
    corners = [item.ned_from_mesh.apply(item.bounds.corners_m) for item in placed]
    return eye.inverse().apply(np.concatenate(corners))


def clip_range(placed: list[Placed], eye: Pose) -> tuple[float, float]:
    """Near and far plane [m] for a view of all bounds: as far out as nothing is cut, for the depth's resolution."""
    near, far = np.inf, 0.0
    for item in placed:
        local = item.ned_from_mesh.inverse().apply(eye.translation_m)
        low, high = np.array(item.bounds.low_m), np.array(item.bounds.high_m)
        near = min(near, float(np.linalg.norm(np.maximum(np.maximum(low - local, local - high), 0.0))))
        far = max(far, float(np.linalg.norm(np.maximum(np.abs(local - low), np.abs(local - high)))))
    return max(0.02, 0.3 * near), far + 5.0


def samples_a_px(crop: Crop, limit: tuple[int, int], most: int, behind: bool) -> int:
    """Samples along a pixel's side for a crop of the picture; 1 stands for multisampling.

    Args:
        crop: the part to draw.
        limit: width and height of the target [samples].
        most: samples to spend.
        behind: part of the ship is beside or behind the camera.
    """
    wanted = 8 if max(crop.width, crop.height) <= 64 else 4
    for count in (8, 4, 3, 2):
        fits = crop.width * count <= limit[0] and crop.height * count <= limit[1]
        if count <= wanted and fits and crop.area * count * count <= most and not behind:
            return count
    return 1
