"""The rendered camera: sky, sea, ship, bar and aircraft, drawn with OpenGL off screen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import moderngl
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.config import require
from shipland.frames import Array, Pose
from shipland.rig import Rig, Target
from shipland.sim import scene_gl, scene_mesh, scene_paint, scene_picture, scene_view
from shipland.sim.scene_light import light
from shipland.sim.scene_sea import WaveTiles, whitecap_cover
from shipland.sim.scene_view import Crop
from shipland.sim.state import SceneState

Image = npt.NDArray[np.uint8]

_FRAME_BLOCK_FLOATS = 16 + 4 * 16 + 4 * 16 + 4 * 4
_LAYER_SIZE = (2048, 1280)
_LAYER_SAMPLES = 600_000
_SEA_PX = (2, 1)
_SKY_PX = (2, 2)
"""Pixels a sample of the background: waves far away are longer than two pixels, and the sky is smooth."""
_CLOUD_DRIFT_PER_S = 2e-4
_SHADOW_EDGE_M = 0.02


@dataclass(frozen=True)
class SceneParameters:
    """What the picture looks like (`[scene]` in TOML); a strength of zero costs nothing.

    Attributes:
        sun_azimuth_deg, sun_elevation_deg: towards the sun, clockwise from north and above the horizon.
        visibility_m: distance at which 5 % of contrast is left.
        cloud_cover: 0 … 1.
        significant_wave_height_m: of the sea that is drawn; the rig does not move with it.
        wave_direction_deg: towards which the waves run, clockwise from north.
        wind_speed_mps: sets the small waves' slope and the whitecaps.
        exposure_ev: brighter by a power of two.
        auto_exposure: 0 (fixed) … 1 (the camera makes up for the light).
        lamp: luminous green of the bar, in radiance of sunlit white.
    """

    sun_azimuth_deg: float
    sun_elevation_deg: float
    visibility_m: float
    cloud_cover: float
    significant_wave_height_m: float
    wave_direction_deg: float
    wind_speed_mps: float
    exposure_ev: float
    auto_exposure: float
    lamp: float

    def __post_init__(self) -> None:
        require(-12.0 <= self.sun_elevation_deg <= 90.0, "sun_elevation_deg must be between -12 and 90")
        require(self.visibility_m >= 5.0, "visibility_m must be at least 5")
        for name in ("cloud_cover", "auto_exposure"):
            require(0.0 <= getattr(self, name) <= 1.0, f"{name} must be between 0 and 1")
        for name in ("significant_wave_height_m", "wind_speed_mps", "lamp"):
            require(getattr(self, name) >= 0.0, f"{name} must not be negative")


_HULL, _HOUSE, _DECK, _BOARD = 1, 2, 4, 8
"""Bits of the shadow casters, in the order of `Scene._casters`."""


@dataclass(frozen=True)
class _Object:
    vertices: moderngl.VertexArray
    ned_from_mesh: Pose
    solid: scene_mesh.Solid


class Scene:
    """Draws what a camera sees. Bit-identical for the same inputs on the same OpenGL driver.

    Args:
        rig: dimensions.
        parameters: light and weather.
        seed: of waves, clouds and stains.
        target: the cue; the rig's own when None.

    Raises:
        SystemLibraryError: EGL or OpenGL is missing.
    """

    def __init__(self, rig: Rig, parameters: SceneParameters, seed: int, target: Target | None = None) -> None:
        self._rig, self._parameters = rig, parameters
        self._target = rig.target if target is None else target
        self._quads_m = self._target.points_in_bar_m[:, 1:].reshape(-1, 4, 2)
        self._layout = scene_mesh.layout(rig, self._target)
        self._light = light(
            np.radians(parameters.sun_azimuth_deg),
            np.radians(parameters.sun_elevation_deg),
            parameters.visibility_m,
            parameters.cloud_cover,
            parameters.exposure_ev,
            parameters.auto_exposure,
        )
        rng = np.random.default_rng(seed)
        self._waves = WaveTiles(
            parameters.significant_wave_height_m,
            parameters.wind_speed_mps,
            np.radians(parameters.wave_direction_deg),
            rng,
        )
        self._context = scene_gl.open_context()
        self._solids: dict[int, moderngl.Program] = {}
        self._targets: dict[tuple[int, int, int], scene_gl.Target] = {}
        self._remaps: dict[bytes, tuple[Camera, Image, Image]] = {}
        self._build(rng)

    def _build(self, rng: np.random.Generator) -> None:
        gl = self._context
        self._sky = scene_gl.program(gl, "background.vert", ("sky.frag",))
        self._sea = scene_gl.program(gl, "background.vert", ("sea.frag",))
        quads = len(self._quads_m)
        self._face = scene_gl.program(gl, "solid.vert", ("paint.glsl", "board.frag"), QUADS=quads, SHADOWS=0)
        self._block = gl.buffer(reserve=4 * _FRAME_BLOCK_FLOATS, dynamic=True)
        self._block.bind_to_uniform_block(0)
        self._long_texture = scene_gl.mipmapped(gl, self._waves.long_texels(0.0))
        self._short_texture = scene_gl.mipmapped(gl, self._waves.short_texels)
        self._cloud_texture = scene_gl.mipmapped(gl, scene_paint.clouds(rng))
        self._paint_texture = scene_gl.mipmapped(gl, scene_paint.paints(rng, self._rig), layers=True)
        for unit, texture in enumerate(
            (self._long_texture, self._short_texture, self._cloud_texture, self._paint_texture)
        ):
            texture.use(unit)
        self._sea["long_waves"], self._sea["short_waves"], self._sky["clouds"] = 0, 1, 2
        self._face["paints"] = 3
        lamp = self._parameters.lamp * np.array([0.01, 1.0, 0.05])
        self._face["lamp_rgb"] = tuple(lamp)
        self._area_buffer = gl.buffer(reserve=8 * 8, dynamic=True)
        self._sky_area, self._sea_area = (
            gl.vertex_array(item, [(self._area_buffer, "2f", "in_ndc")]) for item in (self._sky, self._sea)
        )
        parts = self._layout
        face, board = scene_mesh.board(parts)
        legs = scene_mesh.legs(parts, Pose.identity())
        self._leg_buffer = gl.buffer(legs.tobytes(), dynamic=True)
        self._hull_mesh = self._mesh(scene_mesh.hull(parts), _HOUSE | _DECK | _BOARD)
        self._house_mesh = self._mesh(scene_mesh.house(self._rig, parts), _DECK | _BOARD)
        self._deck_mesh = self._mesh(scene_mesh.deck(parts), _HOUSE | _BOARD)
        self._board_mesh = self._mesh(board, 0)
        self._aircraft_mesh = self._mesh(scene_mesh.quadrotor(), _HOUSE)
        self._leg_mesh = self._vertices(self._leg_buffer, self._solid(_DECK))
        self._face_mesh = self._vertices(gl.buffer(face.tobytes()), self._face)

    def _solid(self, shadows: int) -> moderngl.Program:
        if shadows not in self._solids:
            self._solids[shadows] = scene_gl.program(
                self._context, "solid.vert", ("paint.glsl", "solid.frag"), SHADOWS=shadows
            )
            self._solids[shadows]["paints"] = 3
        return self._solids[shadows]

    def _mesh(self, mesh: scene_mesh.Mesh, shadows: int) -> moderngl.VertexArray:
        return self._vertices(self._context.buffer(mesh.tobytes()), self._solid(shadows))

    def _vertices(self, buffer: moderngl.Buffer, program: moderngl.Program) -> moderngl.VertexArray:
        names = ("in_position", "in_normal", "in_uv", "in_paint", "in_open")
        return self._context.vertex_array(program, [(buffer, "3f 3f 2f 4f 1f", *names)])

    def close(self) -> None:
        """Give the OpenGL context back."""
        self._targets.clear()
        self._context.release()

    def render(
        self,
        state: SceneState,
        camera: Camera,
        *,
        draw_aircraft: bool = False,
        rng: np.random.Generator | None = None,
    ) -> Image:
        """The picture (H,W,3) uint8 BGR that `camera` takes of `state`.

        Args:
            state: poses in ned.
            camera: intrinsics; pixel centres at whole numbers; distortion by a remap of a wider pinhole picture.
            draw_aircraft: draw the aircraft too (chase view).
            rng: of the sensor's noise; None for none.
        """
        if camera.has_distortion:
            wide, columns, rows = self._remap(camera)
            pinhole = self._render_pinhole(state, wide, draw_aircraft)
            return np.asarray(cv2.remap(pinhole, columns, rows, cv2.INTER_CUBIC), np.uint8)
        return self._render_pinhole(state, camera, draw_aircraft)

    def _remap(self, camera: Camera) -> tuple[Camera, Any, Any]:
        key = camera.matrix.tobytes() + camera.distortion.tobytes() + bytes(str((camera.width_px, camera.height_px)), "ascii")
        if key not in self._remaps:
            columns, rows = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
            pixels = camera.undistort(np.column_stack([columns.ravel(), rows.ravel()]).astype(float))
            low = np.floor(np.clip(pixels.min(axis=0), [-camera.width_px, -camera.height_px], 0.0)) - 2.0
            size = np.array([camera.width_px, camera.height_px], dtype=float)
            high = np.ceil(np.clip(pixels.max(axis=0), size, 2.0 * size)) + 2.0
            matrix = camera.matrix.copy()
            matrix[:2, 2] -= low
            width, height = (high - low + 1.0).astype(int)
            moved = (pixels - low).astype(np.float32).reshape(camera.height_px, camera.width_px, 2)
            wide = Camera(int(width), int(height), matrix)
            self._remaps[key] = (wide, moved[..., 0].copy(), moved[..., 1].copy())
        return self._remaps[key]

    def _objects(self, state: SceneState, draw_aircraft: bool) -> list[_Object]:
        parts = self._layout
        ship_from_deck = state.ned_from_ship.inverse() @ state.ned_from_deck
        self._leg_buffer.write(scene_mesh.legs(parts, ship_from_deck).tobytes())
        objects = [  # front to back from the approach: hidden pixels cost nothing
            _Object(self._face_mesh, state.ned_from_bar, parts.board),
            _Object(self._board_mesh, state.ned_from_bar, parts.board),
            _Object(self._deck_mesh, state.ned_from_deck, parts.deck),
            _Object(self._leg_mesh, state.ned_from_ship, parts.hull),
            _Object(self._house_mesh, state.ned_from_ship, parts.house),
            _Object(self._hull_mesh, state.ned_from_ship, parts.hull),
        ]
        if draw_aircraft:
            objects.append(_Object(self._aircraft_mesh, state.ned_from_body, scene_mesh.AIRCRAFT))
        return objects

    def _render_pinhole(self, state: SceneState, camera: Camera, draw_aircraft: bool) -> Image:
        width, height = camera.width_px, camera.height_px
        eye = state.ned_from_camera
        camera_from_ned = eye.inverse()
        objects = self._objects(state, draw_aircraft)
        corners = camera_from_ned.apply(
            np.concatenate([item.ned_from_mesh.apply(item.solid.corners_m) for item in objects])
        )
        ranges = self._ranges(objects, eye)
        near_m, far_m = max(0.02, 0.3 * ranges[0]), ranges[1] + 5.0
        crop = scene_view.screen_box(camera, corners, near_m)
        samples_a_px = 0 if crop is None else self._samples(crop, corners)

        lines = scene_view.edge_lines(camera, camera_from_ned @ state.ned_from_bar, self._quads_m)
        self._face["edge_lines"].write(lines.astype(np.float32).tobytes())
        self._long_texture.write(self._waves.long_texels(state.t_s).tobytes())
        self._long_texture.build_mipmaps()
        layer: Image | None = None
        if crop is not None:
            self._write_block(state, camera, crop, samples_a_px, near_m, far_m)
            layer = self._draw_layer(objects, eye, crop, samples_a_px, (width, height))
        self._write_block(state, camera, Crop(0, 0, width, height), 1, near_m, far_m)
        picture = self._draw_background(camera, eye)
        if crop is not None and layer is not None:
            scene_picture.lay_over(picture, layer, crop, samples_a_px)
        return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGRA2BGR), np.uint8)

    def _draw_layer(
        self, objects: list[_Object], eye: Pose, crop: Crop, samples_a_px: int, whole: tuple[int, int]
    ) -> Image:
        size = crop.width * samples_a_px, crop.height * samples_a_px
        direct = samples_a_px == 1
        target = self._target_of(*whole, 4) if direct else self._target_of(*_LAYER_SIZE, 0)
        target.fbo.use()
        target.fbo.viewport = (0, 0, *size)
        target.fbo.clear(viewport=target.fbo.viewport)
        self._draw(objects, eye)
        if direct:
            resolved = self._target_of(*whole, 0)
            self._context.copy_framebuffer(resolved.fbo, target.fbo)
            target = resolved
        return self._read(target, 0, size[0], size[1])

    @staticmethod
    def _read(target: scene_gl.Target, top: int, width: int, height: int) -> Image:
        pixels = np.empty((height, width, 4), np.uint8)
        target.fbo.read_into(pixels, viewport=(0, top, width, height), components=4)
        return pixels

    def _samples(self, crop: Crop, corners_in_camera_m: Array) -> int:
        if corners_in_camera_m[:, 2].min() <= 0.02:
            return 1
        wanted = 8 if max(crop.width, crop.height) <= 64 else 4
        for count in (8, 4, 3, 2):
            fits = crop.width * count <= _LAYER_SIZE[0] and crop.height * count <= _LAYER_SIZE[1]
            if count <= wanted and fits and crop.area * count * count <= _LAYER_SAMPLES:
                return count
        return 1

    @staticmethod
    def _ranges(objects: list[_Object], eye: Pose) -> tuple[float, float]:
        near, far = np.inf, 0.0
        for item in objects:
            local = item.ned_from_mesh.inverse().apply(eye.translation_m)
            low, high = np.array(item.solid.low_m), np.array(item.solid.high_m)
            near = min(near, float(np.linalg.norm(np.maximum(np.maximum(low - local, local - high), 0.0))))
            far = max(far, float(np.linalg.norm(np.maximum(np.abs(local - low), np.abs(local - high)))))
        return near, far

    def _target_of(self, width_px: int, height_px: int, samples: int) -> scene_gl.Target:
        key = (width_px, height_px, samples)
        if key not in self._targets:
            self._targets[key] = scene_gl.Target(self._context, width_px, height_px, samples)
        return self._targets[key]

    def _draw(self, objects: list[_Object], eye: Pose) -> None:
        gl = self._context
        gl.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        gl.front_face = "cw"
        for item in objects:
            relative = item.ned_from_mesh.matrix()
            relative[:3, 3] -= eye.translation_m
            item.vertices.program["rel_from_mesh"].write(relative.T.astype(np.float32).tobytes())
            item.vertices.render()
        gl.disable(moderngl.CULL_FACE | moderngl.DEPTH_TEST)

    def _draw_background(self, camera: Camera, eye: Pose) -> Image:
        width, height = camera.width_px, camera.height_px
        line = scene_view.horizon_line(camera, eye)
        first, last = scene_picture.horizon_rows(line, width, height)
        picture = np.empty((height, width, 4), np.uint8)
        sky = self._draw_area(self._sky_area, -line, camera, _SKY_PX, 0, last)
        sea = self._draw_area(self._sea_area, line, camera, _SEA_PX, first, height)
        picture[:first] = sky[:first]
        picture[last:] = sea[last - first :]
        if last > first:
            scene_picture.join_at_horizon(sky[first:last], sea[: last - first], line, (first, last), picture)
        return picture

    def _draw_area(
        self, area: moderngl.VertexArray, line: Array, camera: Camera, step: tuple[int, int], top: int, bottom: int
    ) -> Image:
        """Rows top … bottom of the sky or the sea, drawn at a sample every `step` pixels and spread."""
        width, height = camera.width_px, camera.height_px
        if bottom <= top:
            return np.empty((0, width, 4), np.uint8)
        target = self._target_of(-(-width // step[0]), -(-height // step[1]), 0)
        target.fbo.use()
        target.fbo.viewport = (0, 0, *target.size)
        area.program["px_a_sample"] = float(step[0]), float(step[1])
        self._fill(area, scene_view.picture_polygon(width, height, line, 4.0), target.size, step)
        first, last = top // step[1], -(-bottom // step[1])
        drawn = self._read(target, first, target.size[0], last - first)
        spread = cv2.resize(drawn, (step[0] * target.size[0], step[1] * (last - first)))
        return np.asarray(spread[top - first * step[1] : bottom - first * step[1], :width], np.uint8)

    def _fill(
        self, area: moderngl.VertexArray, polygon_px: Array, size: tuple[int, int], step: tuple[int, int]
    ) -> None:
        if len(polygon_px) < 3:
            return
        ndc = 2.0 * (polygon_px + 0.5) / (size[0] * step[0], size[1] * step[1]) - 1.0
        self._area_buffer.write(ndc.astype(np.float32).tobytes())
        area.render(moderngl.TRIANGLE_FAN, vertices=len(ndc))

    def _write_block(
        self, state: SceneState, camera: Camera, crop: Crop, samples_a_px: int, near_m: float, far_m: float
    ) -> None:
        p, sky, waves = self._parameters, self._light, self._waves
        eye = state.ned_from_camera
        ray = scene_view.rays(camera, eye)
        height_m = max(-float(eye.translation_m[2]), 0.05)
        whitecaps = whitecap_cover(p.wind_speed_mps)
        scale = np.array([1.0, 1.0 / 0.618, 1.0, 1.0]) / np.array(
            [waves.long_tile_m, waves.long_tile_m, waves.short_tile_m, waves.short_tile_m]
        )
        ground = eye.translation_m[:2]
        turn = np.array([[0.940, -0.342], [0.342, 0.940]])
        back = np.array([[0.766, 0.643], [-0.643, 0.766]])
        drift = 0.35 * np.sqrt(9.81 * waves.short_tile_m / (2.0 * np.pi)) * state.t_s
        direction = np.radians(p.wave_direction_deg)
        drifted = back @ ground - drift * np.array([np.cos(direction), np.sin(direction)])
        offsets = [ground * scale[0], turn @ ground * scale[1], drifted * scale[2]]
        offset = [np.mod(value, 1.0) for value in offsets]
        foam_from = 0.5 + (0.5 - min(3.0 * np.sqrt(whitecaps), 0.25))
        rows: list[Any] = [
            [*ray[:, 0], 0.0],
            [*ray[:, 1], 0.0],
            [*ray[:, 2], 0.0],
            [crop.left - 0.5, crop.top - 0.5, 1.0 / samples_a_px, samples_a_px],
            [*sky.sun_in_ned, np.cos(np.radians(0.265))],
            [*sky.sun_rgb, 1.0],
            [*sky.zenith_rgb, p.cloud_cover],
            [*sky.horizon_rgb, _CLOUD_DRIFT_PER_S * state.t_s],
            [*sky.glow_rgb, sky.exposure],
            [*sky.water_rgb, sky.extinction_per_m],
            [height_m, camera.focal_px, whitecaps, state.t_s],
            scale,
            [*offset[0], *offset[1]],
            [*offset[2], 0.0, 0.0],
            [waves.long_gain, waves.short_gain, waves.residual_variance, foam_from],
            [*scene_view.horizon_line(camera, eye), 0.0],
        ]
        boxes, suns = self._casters(state, eye)
        clip = scene_view.clip_from_rel(camera, eye, crop, near_m, far_m)
        data = np.concatenate([clip.T.ravel(), np.array(rows).ravel(), boxes.ravel(), suns.ravel()])
        self._block.write(data.astype(np.float32).tobytes())

    def _casters(self, state: SceneState, eye: Pose) -> tuple[Array, Array]:
        parts = self._layout
        boxes, suns = np.zeros((4, 4, 4)), np.zeros((4, 4))
        casters = (
            (parts.hull, state.ned_from_ship),
            (parts.house, state.ned_from_ship),
            (parts.deck, state.ned_from_deck),
            (parts.board, state.ned_from_bar),
        )
        for index, (solid, ned_from_mesh) in enumerate(casters):
            low, high = np.array(solid.low_m), np.array(solid.high_m)
            half = 0.5 * (high - low)
            matrix = np.eye(4)
            matrix[:3, :3] = ned_from_mesh.rotation.T / half[:, None]
            offset = ned_from_mesh.rotation.T @ (eye.translation_m - ned_from_mesh.translation_m)
            matrix[:3, 3] = (offset - 0.5 * (high + low)) / half
            boxes[index] = matrix.T
            direction = matrix[:3, :3] @ self._light.sun_in_ned
            direction = np.where(np.abs(direction) < 1e-5, 1e-5, direction)
            suns[index] = [*(1.0 / direction), 1.0 / _SHADOW_EDGE_M]
        return boxes, suns
