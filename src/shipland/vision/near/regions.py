"""The gate of our chain: regions in the cue's colour, each judged at half of its own peak.

A threshold for a whole picture fails where tape is dim, or where something beside it is lit as well. Here the picture's
saturated light (value × saturation, in the cue's band of hue) is cut into connected parts above a low floor. Each part
is cut again at half of its own peak; what lies below that, and is not the rim of what lies above, is judged by its own
peak in turn. White regions that the colour surrounds count too: a lamp too bright for the camera has a white core.
"""

from __future__ import annotations

import cv2
import numpy as np

from shipland.compiled import compiled
from shipland.cue import Hue
from shipland.vision.near.segment import Contour, Image, Region, Window, opened_and_closed, outlines, region_of
from shipland.vision.parameters import VisionParameters

FLOOR = 20
"""Least saturated light of a cue's pixel [grey levels]: above what JPEG leaves of grey."""

_HALF = 0.5
"""Grey level over that of the peak at which a region is cut: half the light of a linear camera, a fifth of that of a
tone curve of 1/2.2."""

_PEAK = 0.9
"""Share of a region's pixels below its peak: a few brighter ones do not count."""

_CLIPPED = 250
"""Value from which a pixel may be the white core of a lamp, whatever its colour."""

_CORE = 188
"""Luma from which it belongs to one: half the light of white."""

_COLOURED = 0.5
"""Least share of a region's outline, or of what is just outside of a white one, that has the cue's colour."""

_RIM_PX = 5
"""Width of the rim of a region that is not judged by itself, and of what is looked at around a white one."""

_RIM = np.ones((_RIM_PX, _RIM_PX), np.uint8)

_MOST_PARTS = 8
"""Parts of one picture that are cut, the largest; more for a cue of many. Bounds the time that foliage takes."""

_MOST_COVERED, _MOST_COVERED_PX2 = 0.4, 60_000
"""What the parts' boxes may cover until a picture is crowded: a share of it, and pixels at half its resolution."""

_LEAST_LEFT = 0.25
"""Pixels left of a part, over those above half of its peak, from which they are judged by their own: fewer are its rim.
"""

_MOST_CUTS = 2
"""How often a part is cut at half of its peak, what is left of it included."""

_SPARSE_PX2 = 40_000
"""Least size of a picture in which parts are looked for on every second pixel of every second row: opening removes
whatever has none of them."""


_SATURATIONS, _HUES, _PART = np.float32(255 * 4096), np.float32(30 * 4096), np.float32(1 / 4096)
"""OpenCV's saturation by value, and hue by the spread of the colours, times 2¹²."""

_LIGHTS, _HALF_LEVEL, _ROUND = np.float32(254.0 / 255.0**2), np.float32(0.5), np.float32(180.0)
"""Light by saturation times value; half a level, which rounds up; all hues."""


def cue_light(image: Image, window: Window, hue: Hue, step: int = 1) -> Image:
    """(h,w) saturated light of a part's pixels of a hue, at most 254; 255 where another one clips; 0 below the floor.

    Of white, the light that all colours have in common. Of every pixel, or of every second one of every second row.
    """
    if hue == "white":
        return np.asarray(np.minimum(window.of(image)[::step, ::step].min(axis=2), 254), np.uint8)
    light: Image = np.empty(((window.bottom - window.top) // step, (window.right - window.left) // step), np.uint8)
    rows = np.ascontiguousarray(image).reshape(len(image), -1)
    low, width = np.float32(hue[0]), np.float32((hue[1] - hue[0]) % 180)
    _write_light(rows, window.left, window.top, step, low, width, light)
    return light


@compiled
def _write_light(rows: Image, left: int, top: int, step: int, low: np.float32, width: np.float32, light: Image) -> None:
    """Write `cue_light` of a picture's rows (H,3 W), for hues from `low` to `low` + `width`."""
    columns = light.shape[1]
    blue, green, red = np.empty(columns, np.uint8), np.empty(columns, np.uint8), np.empty(columns, np.uint8)
    for row in range(len(light)):
        pixels, lit = rows[top + step * row, 3 * left :], light[row]
        if step == 1:  # each step a loop of its own: vector code
            for column in range(columns):
                first = 3 * column
                blue[column], green[column], red[column] = pixels[first], pixels[first + 1], pixels[first + 2]
        else:
            for column in range(columns):
                first = 6 * column
                blue[column], green[column], red[column] = pixels[first], pixels[first + 1], pixels[first + 2]
        for column in range(columns):
            lit[column] = _light_of(blue[column], green[column], red[column], low, width)


@compiled
def _light_of(blue: np.uint8, green: np.uint8, red: np.uint8, low: np.float32, width: np.float32) -> np.uint8:
    """`cue_light` of one pixel: OpenCV's whole numbers, in floats that hold them all and without branches."""
    b, g, r = np.float32(blue), np.float32(green), np.float32(red)
    value = max(max(b, g), r)
    spread = value - min(min(b, g), r)
    by_green, by_red, by_blue = b - r + np.float32(2.0) * spread, g - b, r - g + np.float32(4.0) * spread
    turn = by_green if value == g else by_blue
    turn = by_red if value == r else turn
    per_turn = np.rint(_HUES / max(spread, _HALF_LEVEL))
    above_low = np.rint((turn * per_turn + _HALF_LEVEL) * _PART) - low
    around = above_low + _ROUND
    above_low = around if above_low < np.float32(0.0) else above_low
    around = above_low + _ROUND
    above_low = around if above_low < np.float32(0.0) else above_low
    saturation = np.rint((spread * np.rint(_SATURATIONS / max(value, _HALF_LEVEL)) + _HALF_LEVEL) * _PART)
    light = np.rint(saturation * value * _LIGHTS)
    light = light if above_low <= width else np.float32(0.0)
    clipped = np.float32(255.0) if value >= np.float32(_CLIPPED) else np.float32(0.0)
    lit = light if light >= np.float32(FLOOR) else np.float32(0.0)
    return np.uint8(clipped if light == np.float32(0.0) else lit)


def find_regions(
    image: Image, window: Window, parameters: VisionParameters, hue: Hue, polygons: int = 2
) -> list[Region]:
    """The largest regions of a hue in a part of the picture, largest first; too small ones are left out.

    Args:
        image: (H,W,3) BGR.
        window: where to look; not empty.
        parameters: kernel, least size and greatest number.
        hue: of the cue.
        polygons: of the cue.
    """
    height, width = window.bottom - window.top, window.right - window.left
    step = 2 if height * width >= _SPARSE_PX2 else 1
    light = cue_light(image, window, hue, step)
    parts = outlines(cv2.inRange(light, FLOOR, 254), (0, 0), parameters, step)
    lit = [part for part in parts if _HALF * int(_of_box(light, part).max()) >= FLOOR]
    lit = lit[: max(_MOST_PARTS, 2 * polygons)]
    boxes = [_box(part) for part in lit]
    # A crowded picture is cut as its parts were found, on every second pixel: a side is looked for within two.
    crowded = sum(box[2] * box[3] for box in boxes) > max(_MOST_COVERED * light.size, _MOST_COVERED_PX2)
    scale = step if crowded else 1
    found: list[Contour] = []
    for part in lit:
        outline = part * (step // scale)
        left, top, right, bottom = _box(outline)
        right, bottom = min(left + right, width // scale), min(top + bottom, height // scale)
        crop = Window(*(scale * side for side in (left, top, right, bottom)))
        crop = Window(
            crop.left + window.left, crop.top + window.top, crop.right + window.left, crop.bottom + window.top
        )
        own = light[top:bottom, left:right].copy() if scale == step else cue_light(image, crop, hue)
        corner = np.array([left, top], np.int32)
        picture = crop.of(image)[::scale, ::scale]
        found += [(contour + corner) * scale for contour in _regions_of(picture, own, outline - corner, parameters)]
    offset = np.array([window.left, window.top], np.int32)
    regions = (region_of(contour + offset, image, parameters) for contour in found)
    largest = sorted((it for it in regions if it is not None), key=lambda it: -it.area_px2)
    return largest[: parameters.max_candidates]


def _box(part: Contour) -> tuple[int, int, int, int]:
    """The box around an outline, with a rim: left, top, width, height."""
    left, top, width, height = cv2.boundingRect(part)
    left, top = max(left - _RIM_PX, 0), max(top - _RIM_PX, 0)
    return left, top, width + 2 * _RIM_PX, height + 2 * _RIM_PX


def _regions_of(image: Image, light: Image, part: Contour, parameters: VisionParameters) -> list[Contour]:
    """The regions in one part of a picture, which its outline encloses to within a few pixels.

    Args:
        image: the part's box, (h,w,3) BGR.
        light: of the cue's hue there.
        part: the outline in that box.
        parameters: kernel, least size and greatest number.
    """
    inside: Image = np.zeros(light.shape, np.uint8)
    cv2.drawContours(inside, [part], -1, 255, cv2.FILLED)
    inside = np.asarray(cv2.dilate(inside, _RIM), np.uint8)
    found = _cores(image, light, parameters)
    brighter = beside = np.zeros(light.shape, np.uint8)
    for _ in range(_MOST_CUTS):
        cut, left = _cut(light, inside, parameters)
        found += [contour for contour in cut if _has_rim(light, beside, contour)]
        if not cut or left < _LEAST_LEFT:
            break
        cv2.drawContours(brighter, cut, -1, 255, cv2.FILLED)
        rim = cv2.dilate(brighter, _RIM)
        inside = np.asarray(cv2.bitwise_and(inside, cv2.bitwise_not(rim)), np.uint8)
        beside = np.asarray(cv2.dilate(rim, _RIM), np.uint8)
    return found


def _of_box(light: Image, contour: Contour) -> Image:
    """The part of a picture in an outline's box."""
    left, top, width, height = cv2.boundingRect(contour)
    return light[top : top + height, left : left + width]


def _cut(light: Image, inside: Image, parameters: VisionParameters) -> tuple[list[Contour], float]:
    """What lies above half of the peak inside of a mask; nothing where that is below the floor.

    And the pixels that lie between floor and half, over those above.
    """
    above: Image = np.empty(light.shape, np.uint8)
    left = _write_above(light, inside, parameters.min_side_px**2, above)
    found = [] if left < 0.0 else outlines(opened_and_closed(above, parameters.kernel_px), (0, 0), parameters)
    return found, left


@compiled
def _write_above(light: Image, inside: Image, least_px2: float, above: Image) -> float:
    """Write what lies above half of the peak inside of a mask; `left` of `_cut`, -1 where nothing does."""
    counts = np.zeros(256, np.int64)
    for row in range(len(light)):
        for column in range(light.shape[1]):
            counts[light[row, column]] += 1 if inside[row, column] else 0
    counted = 0
    for level in range(FLOOR, 255):
        counted += counts[level]
    peak, below, left = FLOOR, counts[FLOOR], 0
    while peak < 254 and below < np.float32(_PEAK) * np.float32(counted):
        peak += 1
        below += counts[peak]
    half = round(_HALF * peak)
    if counted < least_px2 or half < FLOOR:
        return -1.0
    for level in range(FLOOR, half):
        left += counts[level]
    for row in range(len(light)):
        for column in range(light.shape[1]):
            above[row, column] = inside[row, column] if light[row, column] >= half else np.uint8(0)
    return float(np.float32(left) / np.float32(counted - left))


@compiled
def _has_rim(light: Image, beside: Image, contour: Contour) -> bool:
    """Whether the outline of a region has the cue's colour, and is not that of something white or of a gap.

    Args:
        light: of the cue's colour.
        beside: around brighter regions.
        contour: the outline.
    """
    coloured = bounded = 0
    for column, row in contour[:, 0]:
        coloured += FLOOR <= light[row, column] < 255
        bounded += beside[row, column] > 0
    return coloured >= _COLOURED * len(contour) and bounded < _COLOURED * len(contour)


def _cores(image: Image, light: Image, parameters: VisionParameters) -> list[Contour]:
    """White regions that the cue's colour surrounds."""
    if np.count_nonzero(light == 255) < parameters.min_side_px**2:
        return []
    luma = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    mask = opened_and_closed(cv2.threshold(luma, _CORE - 1, 255, cv2.THRESH_BINARY)[1], parameters.kernel_px)
    return [contour for contour in outlines(mask, (0, 0), parameters) if _has_halo(light, contour)]


def _has_halo(light: Image, contour: Contour) -> bool:
    """Whether what is just outside of a region has the cue's colour."""
    left, top, width, height = _box(contour)
    seen = light[top : top + height, left : left + width]
    core = np.zeros(seen.shape, np.uint8)
    cv2.drawContours(core, [contour], -1, 255, cv2.FILLED, offset=(-left, -top))
    ring = cv2.bitwise_and(cv2.dilate(core, _RIM, iterations=2), cv2.bitwise_not(core))
    coloured = cv2.bitwise_and(ring, cv2.inRange(seen, FLOOR, 254))
    return bool(cv2.countNonZero(coloured) >= _COLOURED * max(cv2.countNonZero(ring), 1))
