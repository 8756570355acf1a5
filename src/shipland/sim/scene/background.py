"""Sky and sea: drawn at less than a sample a pixel, spread, and joined at the horizon."""

from __future__ import annotations

import cv2
import moderngl
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.rig import Solid
from shipland.sim.scene import gl as scene_gl
from shipland.sim.scene import motion as scene_motion
from shipland.sim.scene import paint as scene_paint
from shipland.sim.scene import picture as scene_picture
from shipland.sim.scene import view as scene_view
from shipland.sim.scene.block import View
from shipland.sim.scene.light import Light
from shipland.sim.scene.picture import Image
from shipland.sim.scene.sea import WaveTiles

_SEA_PX, _SKY_PX = (3, 1), (3, 3)
"""Pixels a sample: what mipmaps leave of waves at grazing view is longer across than that, and the sky is smooth."""
_LONG, _SHORT, _CLOUDS = 0, 1, 2
_WATERLINE_M = 1.3
_FARTHEST_WATERLINE_M = 200.0
_RAREST_FACET = 4.2
"""Root mean squares of slope; the glitter of steeper facets is below a display step."""


class Background:
    """Sky, sea, and the water around the ship. The uniform block must be bound and written before a draw."""

    def __init__(self, context: moderngl.Context, waves: WaveTiles, light: Light, rng: np.random.Generator) -> None:
        self._context, self._waves, self._light = context, waves, light
        self._targets: dict[tuple[int, int], scene_gl.Target] = {}
        self._sky = scene_gl.program(context, "background.vert", ("sky.frag",))
        sea = ("waves.glsl", "sea.frag")
        self._sea, self._glittering = (scene_gl.program(context, "background.vert", sea, GLITTER=on) for on in (0, 1))
        self._waterline = scene_gl.program(context, "background.vert", ("waves.glsl", "waterline.frag"))
        self._long = scene_gl.mipmapped(context, waves.long_texels(0.0))
        self._textures = (
            self._long,
            scene_gl.mipmapped(context, waves.short_texels),
            scene_gl.mipmapped(context, scene_paint.clouds(rng)),
        )
        for unit, texture in zip((_LONG, _SHORT, _CLOUDS), self._textures, strict=True):
            texture.use(unit)
        self._sky["clouds"] = _CLOUDS
        for program in (self._sea, self._glittering, self._waterline):
            program["long_waves"], program["short_waves"] = _LONG, _SHORT
        self._corners = context.buffer(reserve=8 * 8, dynamic=True)
        self._areas = {
            program: context.vertex_array(program, [(self._corners, "2f", "in_ndc")])
            for program in (self._sky, self._sea, self._glittering, self._waterline)
        }

    def move(self, t_s: float) -> None:
        """Bring the waves to a time [s]."""
        self._long.write(self._waves.long_texels(t_s).tobytes())
        self._long.build_mipmaps()

    def draw(
        self, view: View, hull: Solid, ned_from_ship: Pose, hull_rgb: Array, blurs: tuple[list[Array], list[Array]]
    ) -> Image:
        """The picture (H,W,4) without the ship.

        Args:
            view: of the whole picture.
            hull: box of the hull in `ship`.
            ned_from_ship: its pose.
            hull_rgb: (3,) radiance of its paint, for the reflection.
            blurs: motion blur's maps of the sky and of the sea.
        """
        camera, eye = view.camera, view.ned_from_camera
        width, height = camera.width_px, camera.height_px
        line = scene_view.horizon_line(camera, eye)
        first, last = scene_picture.horizon_rows(line, width, height)
        picture = np.empty((height, width, 4), np.uint8)
        if last > 0:
            target = self._fill(self._sky, -line, camera, _SKY_PX)
            sky = self._spread(target, camera, _SKY_PX, (0, last), blurs[0])
            picture[:first] = sky[:first]
        if first < height:
            sea_program = self._glittering if self._glitters(view) else self._sea
            target = self._fill(sea_program, line, camera, _SEA_PX)
            self._draw_waterline(target, view, hull, ned_from_ship, hull_rgb)
            sea = self._spread(target, camera, _SEA_PX, (first, height), blurs[1])
            picture[last:] = sea[last - first :]
        if last > first:
            scene_picture.join_at_horizon(sky[first:last], sea[: last - first], line, (first, last), picture)
        return picture

    def _glitters(self, view: View) -> bool:
        """Whether any facet that mirrors the sun into the picture is less steep than the sea's rarest."""
        camera, sun = view.camera, self._light.sun_in_ned
        if self._light.glare <= 0.0 or sun[2] > 0.03 or self._light.sun_rgb.max() < 1e-3:
            return False
        columns, rows = np.meshgrid(np.linspace(0, camera.width_px, 9), np.linspace(0, camera.height_px, 9))
        pixels = np.column_stack([columns.ravel(), rows.ravel(), np.ones(81)])
        rays = pixels @ scene_view.rays(camera, view.ned_from_camera).T
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        half_way = sun - rays[rays[:, 2] > -0.05]
        steepness = np.hypot(half_way[:, 0], half_way[:, 1]) / np.maximum(-half_way[:, 2], 1e-3)
        return bool((steepness < _RAREST_FACET * np.sqrt(self._waves.slope_variance)).any())

    def _target(self, camera: Camera, step: tuple[int, int]) -> scene_gl.Target:
        size = -(-camera.width_px // step[0]), -(-camera.height_px // step[1])
        if size not in self._targets:
            self._targets[size] = scene_gl.Target(self._context, *size, depth=False)
        return self._targets[size]

    def _fill(self, program: moderngl.Program, line: Array, camera: Camera, step: tuple[int, int]) -> scene_gl.Target:
        """Draw the picture's part on one side of a line, some pixels wider than it needs."""
        target = self._target(camera, step)
        target.use(*target.size)
        polygon = scene_view.picture_polygon(camera.width_px, camera.height_px, line, 4.0)
        self._draw_polygon(program, polygon, target, step)
        return target

    def _draw_polygon(
        self, program: moderngl.Program, polygon_px: Array, target: scene_gl.Target, step: tuple[int, int]
    ) -> None:
        if len(polygon_px) < 3:
            return
        program["px_a_sample"] = float(step[0]), float(step[1])
        ndc = 2.0 * (polygon_px + 0.5) / (target.size[0] * step[0], target.size[1] * step[1]) - 1.0
        self._corners.write(ndc.astype(np.float32).tobytes())
        self._areas[program].render(moderngl.TRIANGLE_FAN, vertices=len(ndc))

    def _draw_waterline(
        self, target: scene_gl.Target, view: View, hull: Solid, ned_from_ship: Pose, hull_rgb: Array
    ) -> None:
        eye = view.ned_from_camera
        origin = ned_from_ship.translation_m - eye.translation_m
        if float(np.hypot(origin[0], origin[1])) > _FARTHEST_WATERLINE_M:
            return
        low, high = np.array(hull.low_m[:2]) - _WATERLINE_M, np.array(hull.high_m[:2]) + _WATERLINE_M
        plan = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
        forward = ned_from_ship.rotation[:2, 0] / np.linalg.norm(ned_from_ship.rotation[:2, 0])
        turn = np.array([[forward[0], -forward[1]], [forward[1], forward[0]]])
        ground = plan @ turn.T + ned_from_ship.translation_m[:2]
        corners = eye.inverse().apply(np.column_stack([ground, np.zeros(4)]))
        polygon = scene_view.clipped_polygon(view.camera, corners)
        if len(polygon) < 3:
            return
        middle = 0.5 * (np.array(hull.low_m[:2]) + np.array(hull.high_m[:2]))
        half = 0.5 * (np.array(hull.high_m[:2]) - np.array(hull.low_m[:2]))
        self._waterline["ship_axis"] = (*forward, *origin[:2])
        self._waterline["hull_plan"] = (*middle, *half)
        self._waterline["hull_rgb"] = tuple(hull_rgb)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._draw_polygon(self._waterline, polygon, target, _SEA_PX)
        self._context.disable(moderngl.BLEND)

    @staticmethod
    def _spread(
        target: scene_gl.Target, camera: Camera, step: tuple[int, int], rows: tuple[int, int], blur: list[Array]
    ) -> Image:
        """Some rows of the picture from a target with a sample every `step` pixels."""
        first, last = rows[0] // step[1], -(-rows[1] // step[1])
        drawn = target.read(0, first, target.size[0], last - first)
        if blur:
            x, y = 1.0 / step[0], 1.0 / step[1]
            scaled = np.array([[x, 0.0, 0.5 * (x - 1.0)], [0.0, y, 0.5 * (y - 1.0) - first], [0.0, 0.0, 1.0]])
            drawn = scene_motion.average(drawn, blur, scaled)
        spread = cv2.resize(drawn, (step[0] * target.size[0], step[1] * (last - first)))
        return np.asarray(spread[rows[0] - first * step[1] : rows[1] - first * step[1], : camera.width_px], np.uint8)
