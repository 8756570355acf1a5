"""What spoils a picture on its way: spray, glare, fog, motion blur, H.264, rolling shutter, JPEG, noise."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence

import cv2
import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]
FaultInjector = Callable[[Picture, np.random.Generator], Picture]

FRAME_RATE_HZ = 30

_HUE_TURNED = 0.4
"""Share of pictures with all hues turned."""


def _over(picture: Picture, level: int, cover: npt.NDArray[np.floating]) -> Picture:
    """A grey level laid over a picture with a cover (H,W), 0 … 1."""
    weights = np.asarray(cover, np.float32)
    return np.asarray(cv2.blendLinear(picture, np.full_like(picture, level), 1.0 - weights, weights), np.uint8)


def spray(picture: Picture, rng: np.random.Generator) -> Picture:
    """White blobs and drops, soft, some large."""
    layer = np.zeros(picture.shape[:2], np.uint8)
    for _ in range(int(rng.integers(20, 200))):
        at = tuple(int(v) for v in rng.uniform(0, picture.shape[1::-1]))
        cv2.circle(layer, at, int(np.exp(rng.uniform(0.0, 3.2))), int(rng.integers(60, 230)), cv2.FILLED)
    cover = cv2.GaussianBlur(layer, (0, 0), float(rng.uniform(0.8, 4.0))).astype(np.float32) / 255.0
    return _over(picture, 235, cover)


def glare(picture: Picture, rng: np.random.Generator) -> Picture:
    """A veil around a point in or near the picture."""
    height, width = picture.shape[:2]
    rows, columns = np.mgrid[0:height:8, 0:width:8].astype(np.float32)
    at, reach = rng.uniform(-0.2, 1.2, 2) * [width, height], rng.uniform(0.1, 0.8) * width
    spot = np.exp(-((columns - at[0]) ** 2 + (rows - at[1]) ** 2) / reach**2)
    return _over(picture, 255, rng.uniform(0.3, 0.95) * cv2.resize(spot, (width, height)))


def fog(picture: Picture, rng: np.random.Generator) -> Picture:
    """Less contrast, toward a light grey."""
    left = rng.uniform(0.25, 0.9)
    return np.asarray(cv2.convertScaleAbs(picture, alpha=left, beta=(1.0 - left) * rng.uniform(170.0, 220.0)), np.uint8)


def motion_blur(picture: Picture, rng: np.random.Generator) -> Picture:
    """Along a line of 2–25 px."""
    length, angle = rng.uniform(2.0, 25.0), rng.uniform(0.0, np.pi)
    side = 2 * int(np.ceil(0.5 * length)) + 3
    kernel = np.zeros((side, side), np.uint8)
    half = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
    ends = [tuple(int(v) for v in np.round(256.0 * (side // 2 + sign * half))) for sign in (-1.0, 1.0)]
    cv2.line(kernel, ends[0], ends[1], 255, 1, cv2.LINE_AA, 8)
    return np.asarray(cv2.filter2D(picture, -1, kernel / kernel.sum()), np.uint8)


def rolling_shutter(
    picture: Picture, rng: np.random.Generator, shake_px: float | None = None, still_row: float | None = None
) -> Picture:
    """Rows exposed one after the other while the camera shakes and pans: each is shifted by its own time.

    Args:
        picture: (H,W,3) of a camera at rest.
        rng: of the motion.
        shake_px: its size; None for 0.5–6 px.
        still_row: the row that stays where it is, as when the time of the frame is that row's; None for the camera at
            rest, from which all rows are shifted.
    """
    height, width = picture.shape[:2]
    rows, columns = np.arange(height, dtype=np.float32)[:, None], np.arange(width, dtype=np.float32)
    shake = float(rng.uniform(0.5, 6.0)) if shake_px is None else shake_px
    pan, waves, phase = rng.uniform(-1.0, 1.0, 2), rng.uniform(0.5, 4.0, 2), rng.uniform(0.0, 2.0 * np.pi, 2)

    def shift(row: npt.NDArray[np.float32]) -> list[npt.NDArray[np.float32]]:
        when = row / height
        return [
            (shake * (p * when + np.sin(2.0 * np.pi * w * when + a))).astype(np.float32)
            for p, w, a in zip(pan, waves, phase, strict=True)
        ]

    moved_px = shift(rows)
    if still_row is not None:
        moved_px = [m - still for m, still in zip(moved_px, shift(np.float32([[still_row]])), strict=True)]
    column_map = columns + moved_px[0]
    row_map = np.broadcast_to(rows + moved_px[1], (height, width)).copy()
    moved = cv2.remap(picture, column_map, row_map, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.uint8)


def jpeg(picture: Picture, rng: np.random.Generator) -> Picture:
    """Of quality 20–90."""
    coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(20, 91))])[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), np.uint8)


def exposed(picture: Picture, exposure_ev: float) -> Picture:
    """As from another exposure, by the renderer's tone curve √(1 − exp(−light)); what it had clipped stays bright."""
    light = -np.log(1.0 - (np.minimum(np.arange(256), 254.5) / 255.0) ** 2)
    table = 255.0 * np.sqrt(1.0 - np.exp(-light * 2.0**exposure_ev))
    return np.asarray(cv2.LUT(picture, np.round(table).astype(np.uint8)), np.uint8)


def hue_turned(picture: Picture, turn: int) -> Picture:
    """As from a wrong white balance: all hues turned, in OpenCV's units of 2°."""
    hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
    hsv[..., 0] = (hsv[..., 0].astype(np.int16) + turn) % 180
    return np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR), np.uint8)


def h264(picture: Picture, rng: np.random.Generator) -> Picture:
    """The last picture of `panned`, at 1–4 Mbit/s."""
    film = panned(picture, rng)
    return through_h264(film, float(rng.uniform(1.0, 4.0)))[-1]


def panned(picture: Picture, rng: np.random.Generator) -> list[Picture]:
    """Six frames of a film that pans over the picture; the last is the picture."""
    across, down = (int(v) for v in rng.integers(-6, 7, 2))
    return [np.roll(picture, (step * down, step * across), (0, 1)) for step in range(-5, 1)]


def through_h264(film: Sequence[Picture], megabit_s: float) -> list[Picture]:
    """Pictures of a film after H.264 (libx264, low latency, baseline's 4:2:0) at a rate it may not exceed for long."""
    return from_h264(to_h264(film, megabit_s))


def to_h264(film: Sequence[Picture], megabit_s: float, container_format: str = "h264") -> bytes:
    """A film's stream, or a file of it."""
    import av

    rate = round(1e6 * megabit_s)
    packed = io.BytesIO()
    with av.open(packed, "w", format=container_format) as container:
        stream = container.add_stream("libx264", rate=FRAME_RATE_HZ)
        stream.height, stream.width = film[0].shape[:2]
        stream.pix_fmt, stream.bit_rate, stream.thread_count = "yuv420p", rate, 1
        buffer = {"maxrate": str(rate), "bufsize": str(rate // 4)}
        stream.options = {"preset": "veryfast", "tune": "zerolatency", **buffer}
        for picture in film:
            for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return packed.getvalue()


def from_h264(stream: bytes) -> list[Picture]:
    """The pictures (H,W,3) BGR of a stream."""
    import av

    with av.open(io.BytesIO(stream), "r", format="h264") as container:
        return [np.asarray(frame.to_ndarray(format="bgr24"), np.uint8) for frame in container.decode(video=0)]


SPOILERS: dict[str, FaultInjector] = {
    "spray": spray,
    "glare": glare,
    "fog": fog,
    "motion blur": motion_blur,
    "H.264": h264,
    "rolling shutter": rolling_shutter,
    "JPEG": jpeg,
}


def vary(picture: Picture, rng: np.random.Generator) -> Picture:
    """Another picture of the same scene: cut, turned, mirrored, of other exposure, white balance and hues.

    Turned hues make green seas, skies and ships of what was blue and grey.
    """
    height, width = picture.shape[:2]
    zoom, angle = rng.uniform(1.0, 2.2), rng.uniform(-4.0, 4.0)
    centre = tuple(rng.uniform(0.3, 0.7, 2) * [width, height])
    way = cv2.getRotationMatrix2D(centre, angle, zoom)
    result = cv2.warpAffine(picture, way, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    if rng.random() < 0.5:
        result = result[:, ::-1]
    levels = np.arange(256) / 255.0
    gains = rng.uniform(0.5, 1.6) * rng.uniform(0.85, 1.15, 3)
    table = [255.0 * np.clip(gain * levels**2.2, 0.0, 1.0) ** (1.0 / 2.2) for gain in gains]
    table_bgr = np.clip(np.stack(table, axis=1) + 0.5, 0, 255).astype(np.uint8)[None]
    result = cv2.LUT(np.ascontiguousarray(result), table_bgr)
    if rng.random() < _HUE_TURNED:
        hsv = cv2.cvtColor(result, cv2.COLOR_BGR2HSV)
        hues = (np.arange(256) + rng.integers(0, 180)) % 180
        saturations = np.clip(np.arange(256) * rng.uniform(1.0, 2.5), 0, 255)
        turns = np.stack([hues, saturations, np.arange(256)], axis=1).astype(np.uint8)[None]
        result = cv2.cvtColor(cv2.LUT(hsv, turns), cv2.COLOR_HSV2BGR)
    return np.asarray(result, np.uint8)


def noise(picture: Picture, rng: np.random.Generator, spread: float) -> Picture:
    """A sensor's noise, standard deviation in grey levels; a tile is used again at another place, for speed."""
    tile = np.clip(np.round(spread * rng.standard_normal((256, 256, 3), dtype=np.float32)), -127, 127).astype(np.int16)
    height, width = picture.shape[:2]
    whole = np.tile(tile, (-(-height // 256), -(-width // 256), 1))[:height, :width]
    return np.asarray(cv2.add(picture, whole, dtype=cv2.CV_8U), np.uint8)
