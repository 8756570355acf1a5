"""Sky and sea: drawn at less than a sample a pixel, enlarged, and joined at the horizon."""

from __future__ import annotations

import cv2
import moderngl
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.sim.scene import gl
from shipland.sim.scene.block import RenderView
from shipland.sim.scene.light import Light
from shipland.sim.scene.mirror import AroundShip
from shipland.sim.scene.motion import average
from shipland.sim.scene.paint import clouds
from shipland.sim.scene.picture import horizon_rows, join_at_horizon
from shipland.sim.scene.sea import WaveTiles
from shipland.sim.scene.tone import Light16
from shipland.sim.scene.view import Crop, horizon_line, picture_polygon, rays, without

_SEA_PX, _SKY_PX = (3, 1), (3, 3)
"""Pixels a sample: what mipmaps leave of waves at grazing view is longer across than that, and the sky is smooth."""
_RAREST_FACET = 4.2
"""Steepest facet that glitters, in rms slopes; the glitter of steeper ones is below a display step."""


class Background:
    """Sky, sea, and the water around the ship. The uniform block must be bound and written before a draw."""

    def __init__(
        self, context: moderngl.Context, waves: WaveTiles, light: Light, rng: np.random.Generator, wake: float = 0.0
    ) -> None:
        self._context, self._waves, self._light = context, waves, light
        self._targets: dict[tuple[int, int], gl.RenderTarget] = {}
        self._sky = gl.program(context, "background.vert", ("sky.frag",))
        sea = ("waves.glsl", "sea.frag")
        self._sea, self._around = (
            [
                gl.program(context, "background.vert", sea, GLITTER=on, SHIP=ship, WAKE=int(ship and wake > 0.0))
                for on in (0, 1)
            ]
            for ship in (0, 1)
        )
        self._long = gl.mipmapped(context, waves.long_texels(0.0))
        self._textures = (
            self._long,
            gl.mipmapped(context, waves.short_texels),
            gl.mipmapped(context, clouds(rng)),
        )
        for unit, texture in zip(
            (gl.LONG_WAVES_UNIT, gl.SHORT_WAVES_UNIT, gl.CLOUDS_UNIT), self._textures, strict=True
        ):
            texture.use(unit)
        self._sky["clouds"] = gl.CLOUDS_UNIT
        for program in (*self._sea, *self._around):
            program["long_waves"], program["short_waves"] = gl.LONG_WAVES_UNIT, gl.SHORT_WAVES_UNIT
        for program in self._around:
            program["mirrored_ship"] = gl.MIRROR_UNIT
            if wake > 0.0:
                program["wake"] = wake
        self._corners = context.buffer(reserve=8 * 8, dynamic=True)
        self._areas = {
            program: context.vertex_array(program, [(self._corners, "2f", "in_ndc")])
            for program in (self._sky, *self._sea, *self._around)
        }

    def move(self, t_s: float) -> None:
        """Bring the waves to a time [s]."""
        self._long.write(self._waves.long_texels(t_s).tobytes())
        self._long.build_mipmaps()

    def draw(
        self, view: RenderView, around: AroundShip | None, blurs: tuple[list[Array], list[Array]], hidden: Crop
    ) -> Light16:
        """The light (H,W,4) of the picture without the ship.

        `around` is None where the water shows nothing of the ship; `blurs` are the maps of the sky and of the sea. What
        is in `hidden` is undefined: it takes most of the time.
        """
        camera, eye = view.camera, view.ned_from_camera
        width, height = camera.width_px, camera.height_px
        line = horizon_line(camera, eye)
        # To the last sample's far edge, which may lie outside the picture.
        whole = Crop(0, 0, *(-(-side // step) * step for side, step in zip((width, height), _SKY_PX, strict=True)))
        first, last = horizon_rows(line, width, height)
        picture = np.empty((height, width, 4), np.uint16)
        if last > 0:
            target = self._fill(self._sky, -line, camera, _SKY_PX, [whole])
            sky = self._enlarged(target, camera, _SKY_PX, (0, last), blurs[0])
            picture[:first] = sky[:first]
        if first < height:
            glitters = self._glitters(view)
            parts = [whole] if around is None else without(whole, around.crop)
            parts = [rest for part in parts for rest in without(part, hidden)]
            target = self._fill(self._sea[glitters], line, camera, _SEA_PX, parts)
            if around is not None:
                polygons_px = [picture_polygon(part, line, 4.0) for part in without(around.crop, hidden)]
                self._draw_around_ship(target, view, around, polygons_px, glitters)
            sea = self._enlarged(target, camera, _SEA_PX, (first, height), blurs[1])
            picture[last:] = sea[last - first :]
        if last > first:
            join_at_horizon(sky[first:last], sea[: last - first], line, (first, last), picture)
        return picture

    def _glitters(self, view: RenderView) -> bool:
        """Whether any facet that mirrors the sun into the picture is less steep than the sea's rarest."""
        camera, sun = view.camera, self._light.sun_in_ned
        if self._light.glare <= 0.0 or sun[2] > 0.03 or self._light.sun_rgb.max() < 1e-3:
            return False
        columns, rows = np.meshgrid(np.linspace(0, camera.width_px, 9), np.linspace(0, camera.height_px, 9))
        pixels = np.column_stack([columns.ravel(), rows.ravel(), np.ones(81)])
        directions = pixels @ rays(camera, view.ned_from_camera).T
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        half_way = sun - directions[directions[:, 2] > -0.05]
        steepness = np.hypot(half_way[:, 0], half_way[:, 1]) / np.maximum(-half_way[:, 2], 1e-3)
        return bool((steepness < _RAREST_FACET * np.sqrt(self._waves.slope_variance)).any())

    def _target(self, camera: Camera, step: tuple[int, int]) -> gl.RenderTarget:
        size = -(-camera.width_px // step[0]), -(-camera.height_px // step[1])
        if size not in self._targets:
            self._targets[size] = gl.RenderTarget(self._context, *size, depth=False)
        return self._targets[size]

    def _fill(
        self, program: moderngl.Program, line: Array, camera: Camera, step: tuple[int, int], parts: list[Crop]
    ) -> gl.RenderTarget:
        """Draw parts of the picture on one side of a line, some pixels wider than they need."""
        target = self._target(camera, step)
        target.use(*target.size)
        for part in parts:
            self._draw_polygon(program, picture_polygon(part, line, 4.0), target, step)
        return target

    def _draw_polygon(
        self, program: moderngl.Program, polygon_px: Array, target: gl.RenderTarget, step: tuple[int, int]
    ) -> None:
        if len(polygon_px) < 3:
            return
        program["px_a_sample"] = float(step[0]), float(step[1])
        ndc = 2.0 * (polygon_px + 0.5) / (target.size[0] * step[0], target.size[1] * step[1]) - 1.0
        self._corners.write(ndc.astype(np.float32).tobytes())
        self._areas[program].render(moderngl.TRIANGLE_FAN, vertices=len(ndc))

    def _draw_around_ship(
        self, target: gl.RenderTarget, view: RenderView, around: AroundShip, polygons_px: list[Array], glitters: bool
    ) -> None:
        program = self._around[glitters]
        pose, hull, eye = around.ned_from_ship, around.hull, view.ned_from_camera
        forward = pose.rotation[:2, 0] / np.linalg.norm(pose.rotation[:2, 0])
        low, high = np.array(hull.low_m[:2]), np.array(hull.high_m[:2])
        program["ship_axis"] = (*forward, *(pose.translation_m - eye.translation_m)[:2])
        program["hull_plan"] = (*0.5 * (low + high), *0.5 * (high - low))
        program["picture_size"] = view.camera.width_px, view.camera.height_px
        program["mirror_area"], program["mirror_used"] = around.mirror.area, around.mirror.used
        for polygon_px in polygons_px:
            self._draw_polygon(program, polygon_px, target, _SEA_PX)

    @staticmethod
    def _enlarged(
        target: gl.RenderTarget, camera: Camera, step: tuple[int, int], rows: tuple[int, int], blur: list[Array]
    ) -> Light16:
        """Some rows of the picture from a target with a sample every `step` pixels."""
        first, last = rows[0] // step[1], -(-rows[1] // step[1])
        drawn = target.read(0, first, target.size[0], last - first)
        if blur:
            x, y = 1.0 / step[0], 1.0 / step[1]
            scaled = np.array([[x, 0.0, 0.5 * (x - 1.0)], [0.0, y, 0.5 * (y - 1.0) - first], [0.0, 0.0, 1.0]])
            drawn = average(drawn, blur, scaled)
        full = cv2.resize(drawn, (step[0] * target.size[0], step[1] * (last - first)))
        return np.asarray(full[rows[0] - first * step[1] : rows[1] - first * step[1], : camera.width_px], np.uint16)
