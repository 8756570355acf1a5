"""What comes between the scene and the picture: rain, sun in the lens, drops on the lens, the sensor's noise.

Everything is a function of the scene's generator and the time, so that the same instant looks the same.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.frames import Array
from shipland.sim.scene.tone import FULL_SCALE, Image, Light16
from shipland.sim.state import SceneState

_RAIN_TILE = 1024
_RAIN_SPEED_MPS = 7.0
_RAIN_SHUTTER_S = 0.006
_STRAY = 0.5
"""Light of the sun that a lens spreads, in units of the sensor's saturation; chosen."""


class Rain:
    """Streaks of drops near the camera."""

    def __init__(self, rain_mm_h: float, rng: np.random.Generator) -> None:
        self._tile = np.zeros((_RAIN_TILE, _RAIN_TILE), np.uint8)
        count = int(np.clip(900.0 * rain_mm_h**0.45, 0, 6000))
        # Uniform in the volume of the view out to 12 m; length and width shrink with distance.
        distance_m = np.maximum(12.0 * rng.random(count) ** (1.0 / 3.0), 0.8)
        place = rng.integers(0, _RAIN_TILE, (count, 2))
        length_px = np.clip(_RAIN_SPEED_MPS * _RAIN_SHUTTER_S * 930.0 / distance_m, 4.0, 60.0)
        bright = np.clip(620.0 / distance_m, 48.0, 215.0) * rng.uniform(0.6, 1.0, count)
        for (x, y), length, light, far in zip(place, length_px, bright, distance_m, strict=True):
            for wrap in (0, _RAIN_TILE):
                end = (int(x), int(y + length) - wrap)
                cv2.line(self._tile, (int(x), int(y) - wrap), end, float(light), 2 if far < 1.6 else 1, cv2.LINE_AA)
        self._tile = np.tile(np.asarray(cv2.GaussianBlur(self._tile, (3, 5), 0), np.uint8), (3, 3))

    def fall(self, picture: Light16, state: SceneState, camera: Camera, colour: Array) -> None:
        """Draw on a picture of light (H,W,4) in place; `colour` (3,) is the streaks' light, BGR."""
        height, width = picture.shape[:2]
        falling = np.array([0.0, 0.0, _RAIN_SPEED_MPS]) - state.camera_velocity_in_ned_mps
        seen = state.ned_from_camera.rotation.T @ falling
        slant = np.arctan2(seen[0], max(seen[1], 0.3))
        scale = 1.0 / max(camera.focal_px / 930.0, 0.3)
        cosine, sine = scale * np.cos(slant), scale * np.sin(slant)
        # Drops of one frame are gone in the next: a new place on the tile each time.
        jump = (0.5 + np.modf(np.array([0.754877, 0.569840]) * (1e3 * state.t_s))[0]) * _RAIN_TILE
        matrix = np.array([[cosine, -sine, jump[0]], [sine, cosine, jump[1]]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        mask = cv2.warpAffine(self._tile, matrix, (width, height), flags=flags, borderMode=cv2.BORDER_REFLECT)
        where = np.flatnonzero(mask)
        share = mask.reshape(-1)[where].astype(np.uint32)[:, None]
        pixels = picture.reshape(-1, 4)
        streak = np.array([*colour, 65535.0]).astype(np.uint32)
        pixels[where] = (((255 - share) * pixels[where] + share * streak) // 255).astype(np.uint16)


def sun_in_lens(
    picture: Light16, state: SceneState, camera: Camera, sun_in_ned: Array, sun_bgr: Array, strength: float
) -> None:
    """Add veil and ghosts of the sun to a picture of light (H,W,4) in place; nothing when it is behind or hidden.

    `sun_in_ned` (3,) is the unit vector to the sun, `sun_bgr` (3,) its colour, 0 … 1.
    """
    ray = state.ned_from_camera.rotation.T @ sun_in_ned
    if ray[2] < 0.2 or sun_bgr.max() < 0.02:
        return
    at = camera.matrix @ (ray / ray[2])
    height, width = picture.shape[:2]
    half = 3
    column, row = int(np.clip(at[0], half, width - 1 - half)), int(np.clip(at[1], half, height - 1 - half))
    inside = -width < at[0] < 2 * width and -height < at[1] < 2 * height
    if not inside:
        return
    in_picture = 0.0 <= at[0] < width and 0.0 <= at[1] < height
    open_share = 1.0
    if in_picture:
        patch = picture[row - half : row + half + 1, column - half : column + half + 1, :3]
        open_share = float(np.clip(patch.max(axis=2).mean() * (FULL_SCALE / 65535.0) - 1.0, 0.0, 1.0))
    if open_share <= 0.0:
        return
    small = 8
    v, u = np.mgrid[0 : -(-height // small), 0 : -(-width // small)].astype(np.float32) * small
    unit = camera.focal_px
    radius = np.hypot(u - at[0], v - at[1]) / unit
    veil = 0.16 / (1.0 + (radius / 0.10) ** 2) + 0.10 * np.exp(-radius / 0.45)
    centre = camera.matrix[:2, 2]
    for reach, size, light in ((-0.55, 0.05, 0.05), (-0.95, 0.09, 0.035), (0.45, 0.03, 0.06)):
        ghost = centre + reach * (at[:2] - centre)
        ring = np.hypot(u - ghost[0], v - ghost[1]) / unit
        veil += light * np.clip((size - ring) / 0.01, 0.0, 1.0) * in_picture
    saturated = 65535.0 / FULL_SCALE
    glow = (_STRAY * saturated * strength * open_share) * veil[..., None] * sun_bgr.astype(np.float32)
    layer = np.dstack([np.clip(glow, 0.0, 65535.0), np.zeros_like(veil)]).astype(np.uint16)
    full = cv2.resize(layer, (layer.shape[1] * small, layer.shape[0] * small))[:height, :width]
    cv2.add(picture, full, dst=picture)


class LensDrops:
    """Water drops on the lens, some forty at a time at a strength of 1.

    Each shows the scene upside down and blurred, comes with spray, slides and goes.
    """

    def __init__(self, strength: float, rng: np.random.Generator) -> None:
        count = round(40 * strength)
        self._place = rng.random((count, 2))
        self._radius_share = 0.006 + 0.022 * rng.random(count) ** 3.0
        self._period_s = rng.uniform(5.0, 14.0, count)
        self._phase = rng.random(count)
        self._life_share = rng.uniform(0.5, 0.9, count)

    def cover(self, picture: Light16, t_s: float) -> None:
        """Draw on a picture of light (H,W,4) in place."""
        height, width = picture.shape[:2]
        quarter = cv2.resize(picture, (width // 4, height // 4), interpolation=cv2.INTER_AREA)
        small: Light16 = np.asarray(cv2.blur(quarter, (3, 3)), np.uint16)
        for index in range(len(self._phase)):
            cycle, age = divmod(t_s / self._period_s[index] + self._phase[index], 1.0)
            if age > self._life_share[index]:
                continue
            step = np.modf((cycle + 1.0) * np.array([0.754877, 0.569840]) + self._place[index])[0]
            radius = float(self._radius_share[index] * width)
            centre = (float(step[0] * width), float(step[1] * height + 0.25 * height * age * age))
            self._drop(picture, small, centre, radius)

    @staticmethod
    def _drop(picture: Light16, small: Light16, centre: tuple[float, float], radius: float) -> None:
        height, width = picture.shape[:2]
        reach = int(radius) + 2
        left, right = max(int(centre[0]) - reach, 0), min(int(centre[0]) + reach + 1, width)
        top, bottom = max(int(centre[1]) - reach, 0), min(int(centre[1]) + reach + 1, height)
        if right <= left or bottom <= top:
            return
        v, u = np.mgrid[top:bottom, left:right].astype(np.float32)
        dx, dy = (u - centre[0]) / radius, (v - centre[1]) / (1.12 * radius)
        angle = np.arctan2(dy, dx)
        uneven = 0.86 + 0.09 * np.sin(2.0 * angle + centre[0]) + 0.05 * np.sin(3.0 * angle + 1.7 * radius)
        square = (dx * dx + dy * dy) / (uneven * uneven)
        bend = 2.5 + 7.0 * square
        columns = np.clip((centre[0] - bend * dx * radius) / 4.0, 0, small.shape[1] - 1)
        rows = np.clip((centre[1] - bend * dy * radius) / 4.0, 0, small.shape[0] - 1)
        seen = cv2.remap(small, columns.astype(np.float32), rows.astype(np.float32), cv2.INTER_LINEAR)
        shade = (1.03 - 0.38 * square**3 + 0.18 * np.clip(-dy - 0.4, 0.0, 1.0))[..., None]
        cover = np.clip((1.0 - np.sqrt(square)) * radius * 0.45, 0.0, 0.94)[..., None]
        part = picture[top:bottom, left:right]
        part[:] = np.clip(part * (1.0 - cover) + seen * shade * cover, 0, 65535).astype(np.uint16)


class SensorNoise:
    """Shot and read noise, its standard deviation in display values 0 … 255, cut from a bank that `rng` fills.

    It is about constant over the display scale, since its gamma undoes the root of the signal.
    """

    def __init__(self, deviation: float, rng: np.random.Generator) -> None:
        self._deviation, self._rng = deviation, rng
        self._bank: npt.NDArray[np.int8] = np.zeros((0, 0, 3), np.int8)

    def add(self, picture: Image, rng: np.random.Generator) -> Image:
        """A noisy copy of a picture (H,W,3); `rng` says which part of the bank."""
        height, width = picture.shape[:2]
        if self._bank.shape[0] < height + 64 or self._bank.shape[1] < width + 64:
            drawn = self._rng.standard_normal((height + 128, width + 128, 3), dtype=np.float32)
            self._bank = np.clip(np.rint(self._deviation * drawn), -127, 127).astype(np.int8)
        top, left = rng.integers(0, self._bank.shape[0] - height), rng.integers(0, self._bank.shape[1] - width)
        cut = self._bank[top : top + height, left : left + width]
        return np.asarray(cv2.add(picture, cut, dtype=cv2.CV_8U), np.uint8)
