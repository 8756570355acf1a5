"""Antialiased text in OpenCV pictures; OpenCV's own fonts know neither degrees nor dashes."""

from __future__ import annotations

import functools
from importlib import resources
from io import BytesIO
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import ImageFont

from shipland.extras import installed

Image = npt.NDArray[np.uint8]
Bgr = tuple[int, int, int]

_LAYOUT = ImageFont.Layout.BASIC  # the other one raises on control characters
_PLAIN = str.maketrans("–−×", "--x")
"""What Pillow's own font lacks."""


@functools.cache
def _font(size_px: int, bold: bool) -> ImageFont.FreeTypeFont:
    if not installed("plots"):
        own: Any = ImageFont.load_default(size_px)
        return ImageFont.truetype(BytesIO(own.font_bytes), size_px, layout_engine=_LAYOUT)
    folder = resources.files("matplotlib") / "mpl-data" / "fonts" / "ttf"  # DejaVu Sans travels with it
    file = folder / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf")
    return ImageFont.truetype(str(file), size_px, layout_engine=_LAYOUT)


@functools.lru_cache(maxsize=1024)
def _mask(text: str, size_px: int, bold: bool) -> tuple[npt.NDArray[np.uint16], int]:
    """Coverage (h, w) 0 … 256 of a line of text, and its rise above the baseline [px]."""
    font = _font(size_px, bold)
    text = _written(text)
    left, top, right, bottom = font.getbbox(text, anchor="ls")
    if right <= left or bottom <= top:
        return np.zeros((0, 0), np.uint16), 0
    core, _ = font.getmask2(text, mode="L", anchor="ls")
    mask = np.array(core, dtype=np.uint16).reshape(core.size[1], core.size[0])
    return mask + (mask >> 7), round(-top)


def text_width(text: str, size_px: int, bold: bool = False) -> int:
    """Advance of a line of text [px]."""
    return round(_font(size_px, bold).getlength(_written(text)))


def _written(text: str) -> str:
    return text if installed("plots") else text.translate(_PLAIN)


def put_text(image: Image, text: str, at_px: tuple[int, int], size_px: int, colour: Bgr, bold: bool = False) -> None:
    """Draw one line from (column, baseline row) `at_px`; what falls outside of the picture is cut."""
    mask, rise = _mask(text, size_px, bold)
    column, row = at_px[0], at_px[1] - rise
    top, left = max(0, -row), max(0, -column)
    bottom, right = min(mask.shape[0], image.shape[0] - row), min(mask.shape[1], image.shape[1] - column)
    if bottom <= top or right <= left:
        return
    region = image[row + top : row + bottom, column + left : column + right]
    cover = mask[top:bottom, left:right, None]
    region[:] = (region * (256 - cover) + np.array(colour, np.uint16) * cover) >> 8


@functools.lru_cache(maxsize=64)
def wrap_text(text: str, size_px: int, width_px: int, lines: int) -> tuple[str, ...]:
    """The text in at most `lines` lines of at most `width_px`; what is left over becomes an ellipsis."""
    wrapped = [""]
    for word in text.split():
        longer = f"{wrapped[-1]} {word}".strip()
        if wrapped[-1] and text_width(longer, size_px) > width_px:
            wrapped.append(word)
        else:
            wrapped[-1] = longer
    if len(wrapped) <= lines and text_width(wrapped[-1], size_px) <= width_px:
        return tuple(wrapped)
    *before, last = wrapped[:lines]
    while last and text_width(f"{last}…", size_px) > width_px:
        last = last[:-1]
    return (*before, f"{last}…")
