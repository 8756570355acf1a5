"""The gate of our chain: regions in the cue's colour, each judged at half of its own peak.

A threshold for a whole picture fails where tape is dim, or where something beside it is lit as well. Here the picture's
saturated light (value × saturation, in the cue's band of hue) is cut into connected parts above a low floor. Each part
is cut again at half of its own peak, as light has it; what lies below that, and is not the rim of what lies above, is
judged by its own peak in turn.
"""

from __future__ import annotations

import cv2
import numpy as np

from shipland.vision.near.parameters import Band, VisionParameters
from shipland.vision.near.segment import (
    Contour,
    Image,
    Region,
    Window,
    coloured_window,
    opened_and_closed,
    outlines,
    region_of,
)

_FLOOR = 20
"""Least saturated light of a cue's pixel [grey levels]: above what JPEG leaves of grey."""

_HALF = 0.5
"""Grey level over that of the peak at which a region is cut: between half the light of a tone curve of 1/2.2 (0.73) and
of a linear one (0.5)."""

_PEAK = 0.9
"""Share of a region's pixels below its peak: a few brighter ones do not count."""

_CLIPPED = 250
"""Value from which a pixel may be the white core of a lamp that is too bright, whatever its colour."""

_RIM = 0.5
"""Least share of a region's outline, or of what is just outside of it, that has the cue's colour: a white lamp has
none."""

_CORE = 188
"""Luma from which a pixel belongs to the white core of a lamp that is too bright: half the light of white."""

_RIM_PX = 5
"""Side of the square by which a region is dilated before what is left beside it is judged."""

_MOST_PARTS = 30
"""Parts of one picture that are cut, the largest first; bounds the time that foliage takes."""

_MOST_CUTS = 3
"""How often a part is cut at half of its peak, what is left of it included."""


def cue_light(image: Image, hue: Band) -> Image:
    """(H,W) saturated light of the pixels in a band of hue; full where a pixel clips, 0 elsewhere."""
    split = cv2.split(cv2.cvtColor(image, cv2.COLOR_BGR2HSV))
    light = cv2.multiply(split[1], split[2], scale=1.0 / 255.0)
    light = cv2.bitwise_and(light, _in_band(split[0], hue))
    return np.asarray(cv2.bitwise_or(light, cv2.threshold(split[2], _CLIPPED - 1, 255, cv2.THRESH_BINARY)[1]), np.uint8)


def _in_band(hues: cv2.typing.MatLike, hue: Band) -> cv2.typing.MatLike:
    """255 where a hue lies in a band; one whose first number is the larger reaches over red."""
    low, high = hue
    if low <= high:
        return cv2.inRange(hues, low, high)
    return cv2.bitwise_not(cv2.inRange(hues, high + 1, low - 1))


def find_regions(image: Image, window: Window, parameters: VisionParameters) -> list[Region]:
    """The largest regions in the cue's colour in a part of the picture, largest first; too small ones are left out.

    Args:
        image: (H,W,3) BGR.
        window: where to look; not empty.
        parameters: hue, kernel, least size and greatest number.
    """
    light = cue_light(window.of(image), parameters.hue)
    mask = cv2.threshold(light, _FLOOR - 1, 255, cv2.THRESH_BINARY)[1]
    parts = [(contour, 0) for contour in outlines(mask, (0, 0), parameters)]
    found: list[Contour] = []
    for _ in range(_MOST_PARTS):
        if not parts:
            break
        part, cuts = parts.pop(0)
        inner, rest = _cut(light, part, parameters)
        found += inner
        if cuts + 1 < _MOST_CUTS:
            parts += [(contour, cuts + 1) for contour in rest]
    found += _cores(window.of(image), light, parameters)
    offset = np.array([window.left, window.top], np.int32)
    regions = (region_of(contour + offset, image, parameters) for contour in found)
    largest = sorted((it for it in regions if it is not None), key=lambda it: -it.area_px2)
    return largest[: parameters.max_candidates]


def _cut(light: Image, part: Contour, parameters: VisionParameters) -> tuple[list[Contour], list[Contour]]:
    """What of a part lies above half of its peak and has the cue's colour around it, and the parts that are left."""
    left, top, width, height = cv2.boundingRect(part)
    margin = 2
    left, top = max(left - margin, 0), max(top - margin, 0)
    seen = light[top : top + height + 2 * margin, left : left + width + 2 * margin]
    inside = np.zeros(seen.shape, np.uint8)
    cv2.drawContours(inside, [part], -1, 255, cv2.FILLED, offset=(-left, -top))
    counts = cv2.calcHist([seen], [0], inside, [256], [0, 256]).ravel()
    counts[:_FLOOR] = 0.0
    counts[255] = 0.0
    if not counts.any():
        return [], []
    peak = int(np.searchsorted(np.cumsum(counts), _PEAK * counts.sum()))
    half = round(_HALF * peak)
    if half < _FLOOR:
        return [], []
    above = cv2.bitwise_and(cv2.threshold(seen, half - 1, 255, cv2.THRESH_BINARY)[1], inside)
    above = opened_and_closed(above, parameters.kernel_px)
    cores = outlines(above, (left, top), parameters)
    rimmed = [contour for contour in cores if _has_rim(light, contour)]
    cv2.drawContours(inside, cores, -1, 0, cv2.FILLED, offset=(-left, -top))
    cv2.drawContours(inside, cores, -1, 0, _RIM_PX, offset=(-left, -top))
    rest = cv2.bitwise_and(inside, cv2.threshold(seen, _FLOOR - 1, 255, cv2.THRESH_BINARY)[1])
    rest = opened_and_closed(rest, parameters.kernel_px)
    return rimmed, outlines(rest, (left, top), parameters)


def _has_rim(light: Image, contour: Contour) -> bool:
    """Whether the outline of a region has the cue's colour, and is not that of something white."""
    columns, rows = contour[:, 0].T
    on = light[rows, columns]
    return bool(np.count_nonzero((on >= _FLOOR) & (on < 255)) >= _RIM * len(on))


def _cores(image: Image, light: Image, parameters: VisionParameters) -> list[Contour]:
    """White regions that the cue's colour surrounds."""
    left, top, width, height = cv2.boundingRect(cv2.inRange(light, 255, 255))
    if not width:
        return []
    luma = cv2.cvtColor(image[top : top + height, left : left + width], cv2.COLOR_BGR2GRAY)
    mask = opened_and_closed(cv2.threshold(luma, _CORE - 1, 255, cv2.THRESH_BINARY)[1], parameters.kernel_px)
    return [contour for contour in outlines(mask, (left, top), parameters)[:_MOST_PARTS] if _has_halo(light, contour)]


def _has_halo(light: Image, contour: Contour) -> bool:
    """Whether what is just outside of a region has the cue's colour."""
    left, top, width, height = cv2.boundingRect(contour)
    left, top = max(left - _RIM_PX, 0), max(top - _RIM_PX, 0)
    seen = light[top : top + height + 2 * _RIM_PX, left : left + width + 2 * _RIM_PX]
    ring = np.zeros(seen.shape, np.uint8)
    cv2.drawContours(ring, [contour], -1, 255, 2 * _RIM_PX - 1, offset=(-left, -top))
    cv2.drawContours(ring, [contour], -1, 0, cv2.FILLED, offset=(-left, -top))
    coloured = cv2.bitwise_and(ring, cv2.inRange(seen, _FLOOR, 254))
    return bool(cv2.countNonZero(coloured) >= _RIM * max(cv2.countNonZero(ring), 1))


def lit_window(image: Image, parameters: VisionParameters) -> Window:
    """The part of a picture that holds all its regions in the cue's colour."""

    def lit(few: Image) -> Image:
        return np.asarray(cv2.inRange(cue_light(few, parameters.hue), _FLOOR, 254), np.uint8)

    return coloured_window(image, parameters.kernel_px, lit)
