"""The rendered camera: sky, sea, ship, bar and aircraft, drawn with OpenGL off screen."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.rig import Rig, layout
from shipland.sim.scene import gl as scene_gl
from shipland.sim.scene import light as scene_light
from shipland.sim.scene import motion as scene_motion
from shipland.sim.scene import picture as scene_picture
from shipland.sim.scene import ship as scene_ship
from shipland.sim.scene import view as scene_view
from shipland.sim.scene.background import Background
from shipland.sim.scene.block import BLOCK_BYTES, View, block
from shipland.sim.scene.labels import Label, Labels, area_px2, label
from shipland.sim.scene.parameters import SceneParameters
from shipland.sim.scene.picture import Image
from shipland.sim.scene.sea import WaveTiles
from shipland.sim.scene.ship import Placed, ShipLayer
from shipland.sim.scene.spray import Spray
from shipland.sim.scene.view import Crop
from shipland.sim.scene.weather import LensDrops, Rain, SensorNoise, sun_in_lens
from shipland.sim.state import SceneState

__all__ = ["Label", "Labels", "Scene", "SceneParameters"]

_LABEL_SAMPLES = 512
_LAYER_SIZE = (2048, 1280)
_LAYER_SAMPLES = 600_000
"""What the ship may cost in samples before it is multisampled instead of supersampled."""


class Scene:
    """Draws what a camera sees. Bit-identical for the same inputs on the same OpenGL driver.

    Args:
        rig: dimensions.
        parameters: light and weather.
        seed: of waves, clouds, stains and drops.

    Raises:
        SystemLibraryError: EGL or OpenGL is missing.
    """

    def __init__(self, rig: Rig, parameters: SceneParameters, seed: int) -> None:
        p = self._parameters = parameters
        rng = np.random.default_rng(seed)
        self._light = scene_light.light(p)
        self._hull = layout(rig).hull
        self._waves = WaveTiles(p.significant_wave_height_m, p.wind_speed_mps, np.radians(p.wave_direction_deg), rng)
        self._context = scene_gl.open_context()
        self._block = self._context.buffer(reserve=BLOCK_BYTES, dynamic=True)
        self._background = Background(self._context, self._waves, self._light, rng)
        self._ship = ShipLayer(self._context, rig, p.lamp * self._light.dimming, rng)
        self._spray = Spray(self._context, self._hull, p.spray, seed) if p.spray > 0.0 else None
        self._rain = Rain(p.rain_mm_h, rng) if p.rain_mm_h > 0.0 else None
        self._drops = LensDrops(p.lens_drops, rng) if p.lens_drops > 0.0 else None
        noise = p.sensor_noise * self._light.gain
        self._noise = SensorNoise(noise, rng) if noise > 0.0 else None
        self._targets: dict[tuple[int, int, int], scene_gl.Target] = {}
        self._remaps: dict[bytes, tuple[Camera, Any, Any]] = {}

    def close(self) -> None:
        """Give the OpenGL context back; the scene cannot be used any more."""
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
        with self._context:  # another scene's context may be current
            return self._render(state, camera, draw_aircraft, rng)

    def _render(self, state: SceneState, camera: Camera, draw_aircraft: bool, rng: np.random.Generator | None) -> Image:
        if camera.has_distortion:
            wide, columns, rows = self._remap(camera)
            picture = cv2.remap(self._render_pinhole(state, wide, draw_aircraft), columns, rows, cv2.INTER_CUBIC)
        else:
            picture = self._render_pinhole(state, camera, draw_aircraft)
        image = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGRA2BGR), np.uint8)
        return image if rng is None or self._noise is None else self._noise.add(image, rng)

    def labels(self, state: SceneState, camera: Camera, *, draw_aircraft: bool = False) -> Labels:
        """Boxes and visible shares of ship and bar as `camera` sees them, without its distortion.

        Args:
            state: poses in ned.
            camera: intrinsics.
            draw_aircraft: the aircraft hides what is behind it.
        """
        with self._context:
            return self._labels(state, camera, draw_aircraft)

    def _labels(self, state: SceneState, camera: Camera, draw_aircraft: bool) -> Labels:
        eye = state.ned_from_camera
        self._block.bind_to_uniform_block(0)
        placed = self._ship.place(state, draw_aircraft)
        near_m, far_m = scene_ship.clip_range(placed, eye)
        corners = scene_ship.corners_in_camera_m(placed, eye)
        crop = scene_view.screen_box(camera, corners, near_m, 1.0)
        around = scene_view.screen_box(camera, corners, near_m, 1.0, beyond=1.0)
        if crop is None or around is None:
            return Labels(None, None)

        def identities(parts: list[Placed], part: Crop, most: int) -> Image:
            samples = min(most / max(part.width, part.height), 8.0)
            size = max(round(part.width * samples), 1), max(round(part.height * samples), 1)
            target = self._target(_LABEL_SAMPLES, _LABEL_SAMPLES, 0)
            target.use(*size)
            target.fbo.clear(viewport=(0, 0, *size))
            self._look(View(camera, eye, part, 1, near_m, far_m, state.t_s), state)
            self._ship.draw_identities(parts, eye)
            return target.read(0, 0, *size)[..., 0]

        seen = identities(placed, crop, _LABEL_SAMPLES)
        ship = [item for item in placed if item.part.identity != scene_ship.ID_AIRCRAFT]
        bar = [item for item in placed if item.part.identity == scene_ship.ID_BAR]
        areas = [area_px2(identities(parts, around, _LABEL_SAMPLES // 2) > 0, around) for parts in (ship, bar)]
        return Labels(
            ship=label((seen > 0) & (seen != scene_ship.ID_AIRCRAFT), crop, areas[0]),
            bar=label(seen == scene_ship.ID_BAR, crop, areas[1]),
        )

    def _remap(self, camera: Camera) -> tuple[Camera, Any, Any]:
        key = repr((camera.width_px, camera.height_px)).encode() + camera.matrix.tobytes() + camera.distortion.tobytes()
        if key not in self._remaps:
            self._remaps[key] = scene_view.pinhole_around(camera)
        return self._remaps[key]

    def _render_pinhole(self, state: SceneState, camera: Camera, draw_aircraft: bool) -> Image:
        eye = state.ned_from_camera
        self._block.bind_to_uniform_block(0)
        placed = self._ship.place(state, draw_aircraft)
        near_m, far_m = scene_ship.clip_range(placed, eye)
        corners = scene_ship.corners_in_camera_m(placed, eye)
        if self._spray is not None:
            spray = state.ned_from_ship.apply(self._spray.bounds.corners_m)
            corners = np.concatenate([corners, eye.inverse().apply(spray)])
        blur = self._ship_blur(state, camera)
        margin = 2.0 + scene_motion.longest_way_px(blur, scene_view.picture_corners(camera))
        crop = scene_view.screen_box(camera, corners, near_m, margin)
        layer = None
        if crop is not None:
            behind = bool(corners[:, 2].min() <= near_m)
            count = scene_ship.samples_a_px(crop, _LAYER_SIZE, _LAYER_SAMPLES, behind)
            self._ship.aim(camera, state)
            self._look(View(camera, eye, crop, count, near_m, far_m, state.t_s), state)
            layer = scene_picture.reduce(self._draw_ship(placed, state, camera, crop, count), crop, count)
            if blur:
                shift = np.array([[1.0, 0.0, -crop.left], [0.0, 1.0, -crop.top], [0.0, 0.0, 1.0]])
                layer = scene_motion.average(layer, blur, shift)
        whole = View(camera, eye, Crop(0, 0, camera.width_px, camera.height_px), 1, near_m, far_m, state.t_s)
        self._background.move(state.t_s)
        self._look(whole, state)
        blurs = self._background_blur(state, camera)
        picture = self._background.draw(whole, self._hull, state.ned_from_ship, self._light.on_grey_rgb, blurs)
        if crop is not None and layer is not None:
            scene_picture.lay_over(picture, layer, crop)
        self._weather(picture, state, camera)
        return picture

    def _look(self, view: View, state: SceneState) -> None:
        self._block.write(block(view, self._light, self._waves, self._ship.casters(state), 1.0))

    def _draw_ship(
        self, placed: list[Placed], state: SceneState, camera: Camera, crop: Crop, samples_a_px: int
    ) -> Image:
        width, height = crop.width * samples_a_px, crop.height * samples_a_px
        direct = samples_a_px == 1
        size = _LAYER_SIZE
        if direct:  # resolving takes as long as the target is large
            quarters = max(-(-4 * width // camera.width_px), -(-4 * height // camera.height_px), 2)
            size = -(-quarters * camera.width_px // 4), -(-quarters * camera.height_px // 4)
        target = self._target(*size, 4 if direct else 0)
        target.use(width, height)
        target.fbo.clear(viewport=(0, 0, width, height))
        self._ship.draw(placed, state.ned_from_camera)
        if self._spray is not None:
            self._spray.draw(state.t_s, state.ned_from_ship, state.ned_from_camera)
        if direct:
            resolved = self._target(*size, 0)
            self._context.copy_framebuffer(resolved.fbo, target.fbo)
            target = resolved
        return target.read(0, 0, width, height)

    def _target(self, width_px: int, height_px: int, samples: int) -> scene_gl.Target:
        key = (width_px, height_px, samples)
        if key not in self._targets:
            self._targets[key] = scene_gl.Target(self._context, width_px, height_px, samples=samples)
        return self._targets[key]

    def _ship_blur(self, state: SceneState, camera: Camera) -> list[Array]:
        """Motion blur of what stands in the bar's plane, or as far away as the bar where that is seen from its edge."""
        if self._parameters.shutter_s <= 0.0:
            return []
        camera_from_bar = state.ned_from_camera.inverse() @ state.ned_from_bar
        normal, distance = camera_from_bar.rotation[:, 0], float(np.linalg.norm(camera_from_bar.translation_m))
        along = float(normal @ camera_from_bar.translation_m)
        plane = (normal, along) if along > 0.5 * distance else (np.array([0.0, 0.0, 1.0]), max(distance, 0.3))
        bar_px = scene_view.clipped_polygon(camera, camera_from_bar.apply(np.eye(3)[[0, 1, 1]] * 0.5))
        points = bar_px if len(bar_px) else scene_view.picture_corners(camera)
        return scene_motion.homographies(camera, state, self._parameters.shutter_s, plane, points)

    def _background_blur(self, state: SceneState, camera: Camera) -> tuple[list[Array], list[Array]]:
        shutter_s, corners = self._parameters.shutter_s, scene_view.picture_corners(camera)
        if shutter_s <= 0.0:
            return [], []
        down = state.ned_from_camera.rotation.T @ np.array([0.0, 0.0, 1.0])
        height_m = max(-float(state.ned_from_camera.translation_m[2]), 0.2)
        below = scene_view.picture_polygon(
            camera.width_px, camera.height_px, scene_view.horizon_line(camera, state.ned_from_camera)
        )
        sky = scene_motion.homographies(camera, state, shutter_s, None, corners)
        sea = scene_motion.homographies(camera, state, shutter_s, (down, height_m), below) if len(below) else []
        return sky, sea

    def _weather(self, picture: Image, state: SceneState, camera: Camera) -> None:
        sky = self._light
        if self._parameters.glare > 0.0:
            sun_in_lens(picture, state, camera, sky.sun_in_ned, sky.sun_rgb[::-1], self._parameters.glare)
        if self._rain is not None:
            bright = 0.6 * sky.horizon_rgb + 0.4 * sky.zenith_rgb
            self._rain.fall(picture, state, camera, scene_light.display(1.6 * bright, sky.exposure)[::-1])
        if self._drops is not None:
            self._drops.cover(picture, state.t_s)
