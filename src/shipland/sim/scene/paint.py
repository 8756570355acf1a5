"""Painted textures: square-root of an albedo factor in 8 bits, drawn once from a seeded generator."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from shipland.rig import Rig

Picture = npt.NDArray[np.uint8]
_SIZE = 1024


def tileable_noise(rng: np.random.Generator, size: int, falloff: float) -> npt.NDArray[np.float32]:
    """(size,size) periodic noise of a power-law spectrum, mean 0, deviation 1."""
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]) * size
    gain = np.where(frequency > 0.0, np.maximum(frequency, 1.0) ** -falloff, 0.0)
    spectrum = gain * np.exp(2j * np.pi * rng.random(gain.shape))
    field = np.fft.irfft2(spectrum, s=(size, size))
    return np.asarray(field / field.std(), np.float32)


def clouds(rng: np.random.Generator) -> Picture:
    """(512,512,1) cloud density."""
    field = tileable_noise(rng, 512, 1.75)
    return np.asarray(np.clip(128.0 + 52.0 * field, 0, 255), np.uint8)[..., None]


def _stained(rng: np.random.Generator, strength: float) -> npt.NDArray[np.float32]:
    fine, coarse = tileable_noise(rng, _SIZE // 2, 0.4), tileable_noise(rng, _SIZE // 2, 1.6)
    return np.asarray(np.tile(1.0 + strength * (0.35 * fine + 0.65 * coarse), (2, 2)), np.float32)


def _three(field: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    return np.repeat(field[..., None], 3, axis=2)


def _deck(rng: np.random.Generator, rig: Rig) -> npt.NDArray[np.float32]:
    """Seen from above with u forward and v starboard: dark non-skid, white landing square, yellow rim."""
    picture = _three(0.30 * _stained(rng, 0.10))
    scale = _SIZE / rig.deck_size_m
    half = int(0.5 * _SIZE)

    def frame(side_m: float, width_m: float, rgb: tuple[float, float, float]) -> None:
        reach, thick = int(0.5 * side_m * scale), max(2, int(width_m * scale))
        cv2.rectangle(picture, (half - reach, half - reach), (half + reach, half + reach), rgb, thick)

    white, yellow = (1.5, 1.5, 1.5), (1.45, 1.05, 0.12)
    frame(rig.deck_size_m - 0.05, 0.025, yellow)
    cv2.circle(picture, (half, half), int(0.40 * rig.deck_size_m * scale), white, int(0.022 * scale), cv2.LINE_AA)
    frame(rig.landing_square_m, 0.025, white)
    reach = int(0.40 * rig.deck_size_m * scale)
    gap = int(0.5 * rig.landing_square_m * scale)
    for sign in (-1, 1):
        for a, b in (((sign * gap, 0), (sign * reach, 0)), ((0, sign * gap), (0, sign * reach))):
            cv2.line(picture, (half + a[0], half + a[1]), (half + b[0], half + b[1]), white, int(0.018 * scale))
    letter = int(0.055 * scale)
    for y in (-letter, letter):
        cv2.line(picture, (half - letter, half + y), (half + letter, half + y), white, int(0.016 * scale))
    cv2.line(picture, (half, half - letter), (half, half + letter), white, int(0.016 * scale))
    return picture * (0.9 + 0.1 * _three(_stained(rng, 0.5)))


def _flight_deck(rng: np.random.Generator, rig: Rig) -> npt.NDArray[np.float32]:
    """Seen from above with u forward and v starboard: dark non-skid, touchdown circle, landing circle, lines."""
    picture = _three(0.30 * _stained(rng, 0.10))
    scale = _SIZE / rig.deck_size_m
    half = int(0.5 * _SIZE)
    white, yellow = (1.5, 1.5, 1.5), (1.45, 1.05, 0.12)

    def line(start: tuple[float, float], end: tuple[float, float], width_m: float) -> None:
        a, b = (tuple(half + round(value * scale) for value in place) for place in (start, end))
        cv2.line(picture, (a[0], a[1]), (b[0], b[1]), white, max(2, round(width_m * scale)), cv2.LINE_AA)

    edge = 0.5 * rig.deck_size_m
    inner, outer = 0.5 * rig.landing_square_m, _TOUCHDOWN_SHARE * rig.deck_size_m
    cv2.circle(picture, (half, half), round(outer * scale), yellow, round(0.5 * scale), cv2.LINE_AA)
    cv2.circle(picture, (half, half), round(inner * scale), white, round(0.2 * scale), cv2.LINE_AA)
    line((-edge, 0.0), (-inner, 0.0), 0.3)  # the line-up line and the one abeam of the circle
    line((inner, 0.0), (edge, 0.0), 0.3)
    line((0.0, -edge), (0.0, -inner), 0.3)
    line((0.0, inner), (0.0, edge), 0.3)
    for side in (-1.0, 1.0):
        line((-edge, side * (edge - 0.3)), (edge, side * (edge - 0.3)), 0.15)
    return picture * (0.9 + 0.1 * _three(_stained(rng, 0.5)))


_TOUCHDOWN_SHARE = 0.366
"""Radius of the touchdown circle over the deck's side: 0.5 D across for D = 19.8 m, an SH-60B's length (CAP 437)."""


def _hangar(rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """The superstructure's face towards the deck: u to starboard, v down; a roller door and panel lines."""
    picture = _three(_stained(rng, 0.05))
    left, right, top, bottom = int(0.20 * _SIZE), int(0.80 * _SIZE), int(0.34 * _SIZE), _SIZE
    picture[top:bottom, left:right] *= 0.62
    for row in range(top, bottom, 34):
        picture[row : row + 5, left:right] *= 0.72
    cv2.rectangle(picture, (left, top), (right, bottom), (0.35, 0.35, 0.35), 8)
    for column in (0.10, 0.90):
        x = int(column * _SIZE)
        cv2.rectangle(picture, (x - 60, int(0.55 * _SIZE)), (x + 60, int(0.97 * _SIZE)), (0.62, 0.62, 0.62), 5)
        cv2.circle(picture, (x, int(0.63 * _SIZE)), 26, (0.16, 0.17, 0.2), -1, cv2.LINE_AA)
    picture[int(0.30 * _SIZE) : int(0.30 * _SIZE) + 4] *= 0.8
    for _ in range(26):
        left, y, length, width = (
            int(rng.integers(*ends)) for ends in ((0, _SIZE), (0, _SIZE // 2), (60, 320), (3, 10))
        )
        rust = np.array([0.5, 0.9, 1.2], np.float32)
        streak = np.linspace(0.16, 0.0, length, dtype=np.float32)[:, None, None] * rust
        part = picture[y : y + length, left : left + width]
        part *= 1.0 - streak[: part.shape[0]]
    return picture


def paints(rng: np.random.Generator, rig: Rig) -> Picture:
    """(4,1024,1024,3) RGB layers PLAIN, DECK, HANGAR, HULL of `mesh`."""
    plain = _three(_stained(rng, 0.06))
    hull = _three(_stained(rng, 0.09))
    hull[:: _SIZE // 8] *= 0.75
    hull[:, :: _SIZE // 4] *= 0.75
    deck = _flight_deck if rig.hull == "frigate" else _deck
    layers = [plain, deck(rng, rig), _hangar(rng), hull]
    # Half of full scale is a factor of 1: white lines on grey paint need factors above it.
    return np.stack([np.asarray(255.0 * np.sqrt(np.clip(layer, 0.0, 4.0) / 4.0), np.uint8) for layer in layers])
