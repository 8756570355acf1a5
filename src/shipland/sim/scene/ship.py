"""The ship, the bar and the aircraft: meshes on the card, and the passes that draw them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import moderngl
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.rig import Layout, Rig, Solid, layout
from shipland.sim.scene import frigate, gl, mesh
from shipland.sim.scene.mesh import Mesh
from shipland.sim.scene.paint import paints
from shipland.sim.scene.view import Crop, edge_lines
from shipland.sim.state import SceneState

HULL, HOUSE, DECK, BOARD, AIRCRAFT = 1, 2, 4, 8, 16
"""Bits of the shadow casters, in the order of `ShipLayer.casters`."""
ID_SHIP, ID_BAR, ID_AIRCRAFT = 1, 2, 3
_PAINT_UNIT = gl.PAINT_UNIT
_HIGHEST_WAVE_M = 0.85
"""Highest wave and wash at the hull, as `solid.frag` cuts them off."""
_CLIP_DISTANCE_0 = 0x3000
_LAMP_RGB, _STATUS_RGB = np.array([0.01, 1.0, 0.03]), np.array([1.0, 0.01, 0.02])
_FORMAT = "3f 3f 2f 4f 1f"
_NAMES = ("in_position", "in_normal", "in_uv", "in_paint", "in_open")


@dataclass(frozen=True)
class _Part:
    lit: moderngl.VertexArray
    flat: moderngl.VertexArray
    identity: int


@dataclass(frozen=True)
class Placed:
    """A part with its pose, and an upright box around it in its own frame."""

    part: _Part
    ned_from_mesh: Pose
    bounds: Solid


class ShipLayer:
    """Everything solid. The uniform block must be bound and written before a draw.

    Args:
        context: of the scene.
        rig: dimensions.
        lamp: the luminous green of the cue, in radiance of sunlit white.
        deck_lit: the lights around the deck shine, as bright as the cue.
        rng: of stains.
        aircraft_scale: of the drawn aircraft.
    """

    def __init__(
        self,
        context: moderngl.Context,
        rig: Rig,
        lamp: float,
        deck_lit: bool,
        rng: np.random.Generator,
        aircraft_scale: float = 1.0,
    ) -> None:
        self._context, self._layout = context, layout(rig)
        self._aircraft_bounds = mesh.scaled(mesh.AIRCRAFT, aircraft_scale)
        self._aircraft_shade = mesh.scaled(mesh.AIRCRAFT_SHADE, aircraft_scale)
        self._quads_m = rig.cue.points_in_bar_m[:, 1:].reshape(-1, 4, 2)
        light = rig.cue.status_light
        self._status_m = None if light is None else np.array([light.corners_m])
        self._status_rgb = lamp * _STATUS_RGB
        self._solids: dict[tuple[int, bool], moderngl.Program] = {}
        self._paints = gl.mipmapped(context, paints(rng, rig), layers=True)
        self._paints.use(_PAINT_UNIT)
        fragment = ("paint.glsl", "board.frag")
        defines = {"QUADS": len(self._quads_m), "STATUS": int(self._status_m is not None), "SHADOWS": 0, "WATER": 0}
        self._face_program = gl.program(context, "solid.vert", fragment, **defines)
        self._face_program["paints"] = _PAINT_UNIT
        self._face_program["lamp_rgb"] = tuple(lamp * _LAMP_RGB)
        self._flat_program = gl.program(context, "solid.vert", ("identity.frag",), SHADOWS=0, WATER=0)
        parts = self._layout
        face, board = mesh.board(parts)
        ship = rig.hull == "frigate"
        hull, house = (frigate.hull(parts), frigate.upperworks(rig, parts)) if ship else platform(rig, parts)
        self._hull = self._part(hull, HOUSE | DECK | BOARD | AIRCRAFT, afloat=True)
        self._hull_bounds = mesh.bounds(hull) if ship else parts.hull
        self._house_bounds = mesh.bounds(house) if ship else parts.house
        wet, dry = mesh.at_height(house, parts.hull.high_m[2] - _HIGHEST_WAVE_M)
        self._house = self._part(dry, DECK | BOARD | AIRCRAFT)
        self._house_foot = self._part(wet, DECK | BOARD | AIRCRAFT, afloat=True) if len(wet) else None
        self._deck = self._part(mesh.deck(rig, parts), HOUSE | BOARD | AIRCRAFT)
        self._lights = self._lamps(mesh.deck_lights(rig), lamp) if deck_lit else None
        self._board = self._part(board, 0, ID_BAR)
        self._aircraft = self._part(mesh.quadrotor(aircraft_scale), HOUSE, ID_AIRCRAFT)
        veil = gl.program(context, "solid.vert", ("paint.glsl", "rotor.frag"), SHADOWS=HOUSE, WATER=0)
        veil["paints"] = _PAINT_UNIT
        self._rotors = self._part_of(context.buffer(mesh.rotors(aircraft_scale).tobytes()), veil, ID_AIRCRAFT)
        self._face = self._part_of(context.buffer(face.tobytes()), self._face_program, ID_BAR)
        self._legs: _Part | None = None
        if not ship:  # of a motion base
            self._leg_buffer = context.buffer(mesh.legs(parts, Pose.identity()).tobytes(), dynamic=True)
            self._legs = self._part_of(self._leg_buffer, self._solid(DECK, True), ID_SHIP)

    def _solid(self, shadows: int, afloat: bool) -> moderngl.Program:
        """The program of faces under these shadows; waves stand before what is `afloat`."""
        key = shadows, afloat
        if key not in self._solids:
            fragment = ("paint.glsl", "solid.frag")
            made = gl.program(self._context, "solid.vert", fragment, SHADOWS=shadows, WATER=int(afloat))
            made["paints"] = _PAINT_UNIT
            if afloat:
                made["long_waves"], made["short_waves"] = gl.LONG_WAVES_UNIT, gl.SHORT_WAVES_UNIT
            self._solids[key] = made
        return self._solids[key]

    def _part(self, vertices: Mesh, shadows: int, identity: int = ID_SHIP, *, afloat: bool = False) -> _Part:
        return self._part_of(self._context.buffer(vertices.tobytes()), self._solid(shadows, afloat), identity)

    def _part_of(self, buffer: moderngl.Buffer, program: moderngl.Program, identity: int) -> _Part:
        lit = self._context.vertex_array(program, [(buffer, _FORMAT, *_NAMES)])
        return _Part(lit, self._shape(self._flat_program, buffer), identity)

    def _lamps(self, vertices: Mesh, lamp: float) -> Placed:
        """Green lights on the deck, to be placed with it."""
        buffer = self._context.buffer(vertices.tobytes())
        program = gl.program(self._context, "solid.vert", ("lamp.frag",), SHADOWS=0, WATER=0)
        program["lamp_rgb"] = tuple(lamp * _LAMP_RGB)
        part = _Part(self._shape(program, buffer), self._shape(self._flat_program, buffer), ID_SHIP)
        return Placed(part, Pose.identity(), mesh.bounds(vertices))

    def _shape(self, program: moderngl.Program, buffer: moderngl.Buffer) -> moderngl.VertexArray:
        return self._context.vertex_array(program, [(buffer, "3f 40x", "in_position")])

    def casters(self, state: SceneState) -> list[tuple[Solid, Pose]]:
        """Boxes that throw shadows, with ned_from_box."""
        parts = self._layout
        return [
            (parts.hull, state.ned_from_ship),
            (parts.house, state.ned_from_ship),
            (parts.deck, state.ned_from_deck),
            (parts.board, state.ned_from_bar),
            (self._aircraft_shade, state.ned_from_body),
        ]

    def place(self, state: SceneState, draw_aircraft: bool) -> list[Placed]:
        """What there is to draw, front to back as seen from the approach, as hidden pixels cost nothing; veils last."""
        parts = self._layout
        placed = [
            Placed(self._face, state.ned_from_bar, parts.board),
            Placed(self._board, state.ned_from_bar, parts.board),
            Placed(self._deck, state.ned_from_deck, parts.deck),
        ]
        if self._lights is not None:
            placed.append(replace(self._lights, ned_from_mesh=state.ned_from_deck))
        if self._legs is not None:
            ship_from_deck = state.ned_from_ship.inverse() @ state.ned_from_deck
            self._leg_buffer.write(mesh.legs(parts, ship_from_deck).tobytes())
            placed.append(Placed(self._legs, state.ned_from_ship, parts.hull))
        placed.append(Placed(self._house, state.ned_from_ship, self._house_bounds))
        if self._house_foot is not None:
            placed.append(Placed(self._house_foot, state.ned_from_ship, self._house_bounds))
        placed.append(Placed(self._hull, state.ned_from_ship, self._hull_bounds))
        if draw_aircraft:
            placed.insert(0, Placed(self._aircraft, state.ned_from_body, self._aircraft_bounds))
            placed.append(Placed(self._rotors, state.ned_from_body, self._aircraft_bounds))
        return placed

    def aim(self, camera: Camera, state: SceneState, *, mirrored: bool = False) -> None:
        """Set cue's and status light's edge lines for a camera; `mirrored` for their image in a flat sea."""
        plane = state.ned_from_bar.rotation[:, 1:], state.ned_from_bar.translation_m[:, None]
        ned_from_plane = np.column_stack(plane)
        if mirrored:
            ned_from_plane[2] *= -1.0
        ned_from_plane[:, 2] -= state.ned_from_camera.translation_m
        camera_from_plane = state.ned_from_camera.rotation.T @ ned_from_plane
        gl.write_uniform(self._face_program, "edge_lines", edge_lines(camera, camera_from_plane, self._quads_m))
        if self._status_m is not None:
            gl.write_uniform(self._face_program, "status_lines", edge_lines(camera, camera_from_plane, self._status_m))
            self._face_program["status_rgb"] = tuple(float(state.waves_off) * self._status_rgb)

    def draw(self, placed: list[Placed], eye: Pose, *, mirrored: bool = False) -> None:
        """Draw into the bound target; `mirrored` when the block's view is."""
        self._begin()
        if mirrored:
            self._context.front_face = "ccw"
        for item in placed:
            if item.part is self._rotors:
                self._context.enable(moderngl.BLEND)
                self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
                gl.write_depth(self._context, False)
            gl.write_uniform(item.part.lit.program, "rel_from_mesh", _relative(item, eye))
            item.part.lit.render()
        self._end()

    def draw_identities(self, placed: list[Placed], eye: Pose) -> None:
        """Draw every part's number / 255 into the bound target's red."""
        self._begin()
        for item in placed:
            gl.write_uniform(self._flat_program, "rel_from_mesh", _relative(item, eye))
            self._flat_program["identity"] = item.part.identity / 255.0
            item.part.flat.render()
        self._end()

    def _begin(self) -> None:
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._context.enable_direct(_CLIP_DISTANCE_0)
        self._context.front_face = "cw"

    def _end(self) -> None:
        gl.write_depth(self._context, True)
        self._context.enable_only(moderngl.NOTHING)
        self._context.disable_direct(_CLIP_DISTANCE_0)


def platform(rig: Rig, parts: Layout) -> tuple[Mesh, Mesh]:
    """Hull and superstructure of the rig's platform."""
    return mesh.hull(parts), mesh.house(rig, parts)


def _relative(item: Placed, eye: Pose) -> Array:
    matrix = item.ned_from_mesh.matrix()
    matrix[:3, 3] -= eye.translation_m
    return np.asarray(matrix.T)


def corners_in_ned_m(placed: list[Placed]) -> Array:
    """(8n,3) corners of all bounds [m]."""
    return np.concatenate([item.ned_from_mesh.apply(item.bounds.corners_m) for item in placed])


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

    The target holds `limit` (width, height) samples, of which `most` are spent; `behind`: part of the ship is beside or
    behind the camera.
    """
    wanted = 8 if max(crop.width, crop.height) <= 64 else 4
    for count in (8, 4, 3, 2):
        fits = crop.width * count <= limit[0] and crop.height * count <= limit[1]
        if count <= wanted and fits and crop.area * count * count <= most and not behind:
            return count
    return 1
