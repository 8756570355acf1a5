"""The rendered camera: sky, sea, ship, bar and aircraft, drawn with OpenGL off screen."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.rig import Rig, layout
from shipland.sim.scene import gl, mirror, motion
from shipland.sim.scene.background import Background
from shipland.sim.scene.block import BLOCK_BYTES, RenderView, block
from shipland.sim.scene.labels import Labels, area_px2, label
from shipland.sim.scene.light import light
from shipland.sim.scene.mirror import AroundShip
from shipland.sim.scene.picture import hidden_behind, lay_over, reduce
from shipland.sim.scene.sea import WaveTiles
from shipland.sim.scene.ship import (
    ID_AIRCRAFT,
    ID_BAR,
    Placed,
    ShipLayer,
    clip_range,
    corners_in_ned_m,
    samples_a_px,
)
from shipland.sim.scene.spray import Spray
from shipland.sim.scene.tone import Image, Light16, develop, encoded, sharpen
from shipland.sim.scene.view import (
    Crop,
    box_before,
    clipped_polygon,
    horizon_line,
    picture_corners,
    picture_polygon,
    pinhole_around,
    screen_box,
)
from shipland.sim.scene.weather import LensDrops, Rain, SensorNoise, sun_in_lens
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import SceneState

_LABEL_SAMPLES = 512
_LAYER_SIZE = (2048, 1280)
_WAKE_M = 400.0
"""Where the wake has faded to a twentieth: as in `sea.frag`."""
_SEEN_BESIDE_PX = 8.0
"""Margin about what the ship hides within which the sea's samples are seen, enlarged."""
_LAYER_SAMPLES = 600_000
"""Most samples of the ship's layer that are supersampled; above, it is multisampled."""


class Scene:
    """Draws what a camera sees. Bit-identical for the same inputs on the same OpenGL driver.

    Args:
        rig: dimensions.
        parameters: light and weather.
        rng: of waves, clouds, stains, drops and spray.
        aircraft_scale: of the drawn aircraft, 1 for one of 0.24 m across the motors.

    Raises:
        SystemLibraryError: EGL or OpenGL is missing.
    """

    def __init__(
        self, rig: Rig, parameters: SceneParameters, rng: np.random.Generator, aircraft_scale: float = 1.0
    ) -> None:
        p = self._parameters = parameters
        self._light = light(p)
        self._hull = layout(rig).hull
        self._waves = WaveTiles(p.significant_wave_height_m, p.wind_speed_mps, np.radians(p.wave_direction_deg), rng)
        self._context = gl.open_context()
        self._block = self._context.buffer(reserve=BLOCK_BYTES, dynamic=True)
        self._background = Background(self._context, self._waves, self._light, rng, p.wake)
        lamp, deck_lit = p.lamp * self._light.dimming, p.sun_elevation_deg < 0.0
        self._ship = ShipLayer(self._context, rig, lamp, deck_lit, rng, aircraft_scale)
        self._spray = Spray(self._context, self._hull, p.spray, rng.spawn(1)[0]) if p.spray > 0.0 else None
        self._rain = Rain(p.rain_mm_h, rng) if p.rain_mm_h > 0.0 else None
        self._drops = LensDrops(p.lens_drops, rng) if p.lens_drops > 0.0 else None
        noise = p.sensor_noise * self._light.gain
        self._noise = SensorNoise(noise, rng) if noise > 0.0 else None
        self._mirror = mirror.target(self._context)
        self._targets: dict[tuple[int, int, int], gl.RenderTarget] = {}
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
        tone = self._parameters.tone
        image = develop(self.light(state, camera, draw_aircraft=draw_aircraft), tone)
        if rng is not None and self._noise is not None:
            image = self._noise.add(image, rng)
        return sharpen(image, tone.sharpening)

    def light(self, state: SceneState, camera: Camera, *, draw_aircraft: bool = False) -> Light16:
        """The light (H,W,3) on the sensor, blue first, that `render` develops; arguments as there."""
        with self._context:  # another scene's context may be current
            if camera.has_distortion:
                wide, columns, rows = self._remap(camera)
                picture = cv2.remap(self._render_pinhole(state, wide, draw_aircraft), columns, rows, cv2.INTER_CUBIC)
            else:
                picture = self._render_pinhole(state, camera, draw_aircraft)
            return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGRA2BGR), np.uint16)

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
        near_m, far_m = clip_range(placed, eye)
        corners = eye.inverse().apply(corners_in_ned_m(placed))
        crop = screen_box(camera, corners, near_m, 1.0)
        around = screen_box(camera, corners, near_m, 1.0, beyond=1.0)
        if crop is None or around is None:
            return Labels(None, None)

        def identities(parts: list[Placed], part: Crop, most: int) -> Image:
            samples = min(most / max(part.width, part.height), 8.0)
            size = max(round(part.width * samples), 1), max(round(part.height * samples), 1)
            target = self._target(_LABEL_SAMPLES, _LABEL_SAMPLES, 0)
            target.use(*size)
            target.fbo.clear(viewport=(0, 0, *size))
            self._look(RenderView(camera, eye, part, 1, near_m, far_m, state.t_s), state)
            self._ship.draw_identities(parts, eye)
            return (target.read(0, 0, *size)[..., 0] // 257).astype(np.uint8)  # 255 steps of 16 bits

        seen = identities(placed, crop, _LABEL_SAMPLES)
        ship = [item for item in placed if item.part.identity != ID_AIRCRAFT]
        bar = [item for item in placed if item.part.identity == ID_BAR]
        areas = [area_px2(identities(parts, around, _LABEL_SAMPLES // 2) > 0, around) for parts in (ship, bar)]
        return Labels(
            ship=label((seen > 0) & (seen != ID_AIRCRAFT), crop, areas[0]),
            bar=label(seen == ID_BAR, crop, areas[1]),
        )

    def _remap(self, camera: Camera) -> tuple[Camera, Any, Any]:
        key = repr((camera.width_px, camera.height_px)).encode() + camera.matrix.tobytes() + camera.distortion.tobytes()
        if key not in self._remaps:
            self._remaps[key] = pinhole_around(camera)
        return self._remaps[key]

    def _render_pinhole(self, state: SceneState, camera: Camera, draw_aircraft: bool) -> Light16:
        eye = state.ned_from_camera
        self._block.bind_to_uniform_block(0)
        self._background.move(state.t_s)
        placed = self._ship.place(state, draw_aircraft)
        near_m, far_m = clip_range(placed, eye)
        solid_m = corners_in_ned_m(placed)
        wake_m = _WAKE_M if self._parameters.wake > 0.0 else 0.0
        around = mirror.around_ship(camera, eye, solid_m, self._hull, state.ned_from_ship, near_m, wake_m)
        if around is not None:
            self._draw_mirror(around, placed, state, camera, (near_m, far_m))
        corners = eye.inverse().apply(solid_m)
        if self._spray is not None:
            spray = state.ned_from_ship.apply(self._spray.bounds.corners_m)
            corners = np.concatenate([corners, eye.inverse().apply(spray)])
        blur = self._ship_blur(state, camera)
        margin = 2.0 + motion.longest_way_px(blur, picture_corners(camera))
        crop = screen_box(camera, corners, near_m, margin)
        layer = None
        if crop is not None:
            behind = bool(corners[:, 2].min() <= near_m)
            count = samples_a_px(crop, _LAYER_SIZE, _LAYER_SAMPLES, behind)
            self._ship.aim(camera, state)
            self._look(RenderView(camera, eye, crop, count, near_m, far_m, state.t_s), state)
            seen = box_before(camera, corners, near_m, crop)
            layer = reduce(self._draw_ship(placed, state, camera, crop, seen, count), crop, count)
            if blur:
                shift = np.array([[1.0, 0.0, -crop.left], [0.0, 1.0, -crop.top], [0.0, 0.0, 1.0]])
                layer = motion.average(layer, blur, shift)
        whole = RenderView(camera, eye, Crop(0, 0, camera.width_px, camera.height_px), 1, near_m, far_m, state.t_s)
        self._look(whole, state)
        blurs = self._background_blur(state, camera)
        hidden = Crop(0, 0, 0, 0)
        if crop is not None and layer is not None:
            margin_px = _SEEN_BESIDE_PX + motion.longest_way_px(blurs[1], picture_corners(camera))
            hidden = hidden_behind(layer, crop, margin_px)
        picture = self._background.draw(whole, around, blurs, hidden)
        if crop is not None and layer is not None:
            lay_over(picture, layer, crop)
        self._weather(picture, state, camera)
        return picture

    def _look(self, view: RenderView, state: SceneState) -> None:
        self._block.write(block(view, self._light, self._waves, self._ship.casters(state), 1.0))

    def _draw_mirror(
        self, around: AroundShip, placed: list[Placed], state: SceneState, camera: Camera, clip_m: tuple[float, float]
    ) -> None:
        """Draw the ship mirrored in the sea into the mirror's texture."""
        image, target = around.mirror, self._mirror
        target.use(mirror.SIZE, mirror.SIZE)
        target.fbo.clear()
        target.use(*image.drawn)
        self._ship.aim(camera, state, mirrored=True)
        far_m = clip_m[1] + 2.0 * abs(float(state.ned_from_camera.translation_m[2]))
        view = RenderView(
            camera, state.ned_from_camera, image.crop, image.samples_a_px, clip_m[0], far_m, state.t_s, mirrored=True
        )
        self._look(view, state)
        self._ship.draw(placed, state.ned_from_camera, mirrored=True)
        target.colour.build_mipmaps()

    def _draw_ship(
        self, placed: list[Placed], state: SceneState, camera: Camera, crop: Crop, seen: Crop, count: int
    ) -> Light16:
        """The ship's light in a crop of the picture, of which all that is drawn lies in the part `seen`."""
        width, height = crop.width * count, crop.height * count
        direct = count == 1
        size = (camera.width_px, camera.height_px) if direct else _LAYER_SIZE
        target = self._target(*size, 4 if direct else 0)
        target.use(width, height)
        target.fbo.clear(viewport=(0, 0, width, height))
        self._ship.draw(placed, state.ned_from_camera)
        if self._spray is not None:
            self._spray.draw(state.t_s, state.ned_from_ship, state.ned_from_camera)
        if not direct:
            return target.read(0, 0, width, height)
        layer, resolved = np.zeros((height, width, 4), np.uint16), self._target(*size, 0)
        if seen.area > 0:
            part = seen.left - crop.left, seen.top - crop.top, seen.width, seen.height
            gl.resolve(self._context, target, resolved, part)
            layer[part[1] : part[1] + seen.height, part[0] : part[0] + seen.width] = resolved.read(*part)
        return layer

    def _target(self, width_px: int, height_px: int, samples: int) -> gl.RenderTarget:
        key = (width_px, height_px, samples)
        if key not in self._targets:
            self._targets[key] = gl.RenderTarget(self._context, width_px, height_px, samples=samples)
        return self._targets[key]

    def _ship_blur(self, state: SceneState, camera: Camera) -> list[Array]:
        """Motion blur of what stands in the bar's plane, or as far away as the bar where that is seen from its edge."""
        if self._parameters.shutter_s <= 0.0:
            return []
        camera_from_bar = state.ned_from_camera.inverse() @ state.ned_from_bar
        normal, distance = camera_from_bar.rotation[:, 0], float(np.linalg.norm(camera_from_bar.translation_m))
        along = float(normal @ camera_from_bar.translation_m)
        plane = (normal, along) if along > 0.5 * distance else (np.array([0.0, 0.0, 1.0]), max(distance, 0.3))
        bar_px = clipped_polygon(camera, camera_from_bar.apply(np.eye(3)[[0, 1, 1]] * 0.5))
        points = bar_px if len(bar_px) else picture_corners(camera)
        return motion.homographies(camera, state, self._parameters.shutter_s, plane, points)

    def _background_blur(self, state: SceneState, camera: Camera) -> tuple[list[Array], list[Array]]:
        shutter_s, corners = self._parameters.shutter_s, picture_corners(camera)
        if shutter_s <= 0.0:
            return [], []
        down = state.ned_from_camera.rotation.T @ np.array([0.0, 0.0, 1.0])
        height_m = max(-float(state.ned_from_camera.translation_m[2]), 0.2)
        below = picture_polygon(
            Crop(0, 0, camera.width_px, camera.height_px), horizon_line(camera, state.ned_from_camera)
        )
        sky = motion.homographies(camera, state, shutter_s, None, corners)
        sea = motion.homographies(camera, state, shutter_s, (down, height_m), below) if len(below) else []
        return sky, sea

    def _weather(self, picture: Light16, state: SceneState, camera: Camera) -> None:
        sky = self._light
        if self._parameters.glare > 0.0:
            sun_in_lens(picture, state, camera, sky.sun_in_ned, sky.sun_rgb[::-1], self._parameters.glare)
        if self._rain is not None:
            bright = 0.6 * sky.horizon_rgb + 0.4 * sky.zenith_rgb
            self._rain.fall(picture, state, camera, encoded(1.6 * sky.exposure * bright)[::-1])
        if self._drops is not None:
            self._drops.cover(picture, state.t_s)
