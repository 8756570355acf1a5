"""A cue or a chessboard on paper: a PDF in true size, on several sheets where it is larger than one."""

from __future__ import annotations

import colorsys
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shipland.cue import Cue, Hue
from shipland.errors import ConfigError
from shipland.files import replacing, writing
from shipland.frames import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPERS_MM = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
    "Letter": (215.9, 279.4),
    "Tabloid": (279.4, 431.8),
}
"""Width and height, upright."""
_MARGIN_MM = 12.0
"""Most printers reach to within 4 to 6 mm of the edge."""
_OVERLAP_MM = 15.0
_CROSS_MM = 5.0
_RULER_MM = 100.0
_BORDER, _LEAST_BORDER_MM = 0.25, 10.0
"""Black around a cue, as a share of its polygons' least side; with a tenth the rig's bar is lost from 8 m on."""
_INCH_MM = 25.4
Colour = tuple[float, float, float]
_WHITE, _BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Drawing:
    """What is printed, in colours of red, green and blue from 0 to 1.

    Attributes:
        outlines_mm: (k, 2) corners (right, down) of each area, from the drawing's top-left corner.
        size_mm: width and height.
        ink, ground: of the areas, and around them.
    """

    outlines_mm: tuple[Array, ...]
    size_mm: tuple[float, float]
    ink: Colour
    ground: Colour = _WHITE


@dataclass(frozen=True)
class Sheets:
    """How a drawing lies on paper.

    Attributes:
        page_mm: width and height of a sheet, as it is turned.
        step_mm: (2,) from one sheet's part of the drawing to the next one's.
        across, down: sheets.
        origin_mm: (2,) (right, down) place of the drawing's corner from that of the first sheet's printed part.
    """

    page_mm: tuple[float, float]
    step_mm: Array
    across: int
    down: int
    origin_mm: Array


def cue_drawing(cue: Cue, hue: Hue) -> Drawing:
    """A cue's polygons in the middle of their hue, on black: near vision looks for what is lighter than around it."""
    plane_mm = 1e3 * cue.plane_m
    low, high = plane_mm.min(axis=(0, 1)), plane_mm.max(axis=(0, 1))
    border_mm = max(_LEAST_BORDER_MM, _BORDER * float(np.ptp(plane_mm, axis=1).min()))
    width_mm, height_mm = high - low + 2.0 * border_mm
    outlines_mm = tuple(outline - low + border_mm for outline in plane_mm)
    band, ink = cue.hue or hue, _WHITE
    if band != "white":
        first, last = band
        middle = (first + 0.5 * ((last - first) % 180)) % 180
        ink = colorsys.hsv_to_rgb(middle / 180.0, 1.0, 1.0)
    return Drawing(outlines_mm, (width_mm, height_mm), ink, _BLACK)


def chessboard_drawing(corners: str, square_m: float) -> Drawing:
    """A chessboard with so many inner corners, across x down, as `9x6`; ConfigError where text or square is wrong."""
    match = re.fullmatch(r"(\d+)[x×](\d+)", corners.strip().lower())
    if match is None or not all(3 <= int(count) <= 200 for count in match.groups()):
        raise ConfigError(f"--board {corners} is no board; expected inner corners across × down, each 3–200, as 9x6")
    if not 0.001 <= square_m <= 1.0:
        raise ConfigError(f"--square-m {square_m} is no side of a square; expected 0.001 to 1 m, as 0.025")
    across, down, side_mm = int(match[1]) + 1, int(match[2]) + 1, 1e3 * square_m
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places = [(i, j) for j in range(down) for i in range(across) if (i + j) % 2 == 0]
    outlines_mm = tuple(side_mm * (square + place) for place in places)
    return Drawing(outlines_mm, (side_mm * across, side_mm * down), _BLACK)


def sheets_for(size_mm: tuple[float, float], paper: str) -> Sheets:
    """The way of turning the paper, one of `PAPERS_MM` in any case, that takes fewest sheets; ConfigError else."""
    upright = {name.lower(): page for name, page in PAPERS_MM.items()}.get(paper.lower())
    if upright is None:
        raise ConfigError(f"--paper {paper} is not known; there are: {', '.join(PAPERS_MM)}")
    laid = []
    for page_mm in (upright, upright[::-1]):
        step_mm = np.array(page_mm) - 2.0 * _MARGIN_MM - _OVERLAP_MM
        counts = np.maximum(1, np.ceil((np.array(size_mm) - _OVERLAP_MM) / step_mm - 1e-9))
        across, down = map(int, counts)
        laid.append(Sheets(page_mm, step_mm, across, down, 0.5 * (counts * step_mm + _OVERLAP_MM - size_mm)))
    return min(laid, key=lambda it: it.across * it.down)


def print_sheets(path: Path, drawing: Drawing, paper: str, title: str) -> Sheets:
    """Write the PDF, with a title at the foot of each sheet; how it lies on the paper.

    ConfigError where there is no such paper, DataError where the file cannot be written.
    """
    from matplotlib.backends.backend_pdf import PdfPages

    sheets = sheets_for(drawing.size_mm, paper)
    about = {"Title": title, "CreationDate": None, "Creator": None, "Producer": None}
    with writing(path), replacing(path) as beside, PdfPages(beside, metadata=about) as pdf:
        for row, column in product(range(sheets.down), range(sheets.across)):
            pdf.savefig(_sheet(drawing, sheets, column, row, title))
    return sheets


def _sheet(drawing: Drawing, sheets: Sheets, column: int, row: int, title: str) -> Figure:
    """One page, drawn in millimetres from its top-left corner; its part of the drawing, marks and a ruler."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon, Rectangle

    width_mm, height_mm = sheets.page_mm
    figure = Figure(figsize=(width_mm / _INCH_MM, height_mm / _INCH_MM))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, width_mm), ylim=(height_mm, 0.0))
    axes.set_axis_off()
    shift_mm = _MARGIN_MM + sheets.origin_mm - sheets.step_mm * [column, row]
    printed = Rectangle(
        (_MARGIN_MM, _MARGIN_MM), width_mm - 2.0 * _MARGIN_MM, height_mm - 2.0 * _MARGIN_MM, transform=axes.transData
    )
    if drawing.ground != _WHITE:
        axes.add_patch(Rectangle(tuple(shift_mm), *drawing.size_mm, color=drawing.ground, lw=0.0, clip_path=printed))
    for outline_mm in drawing.outlines_mm:
        axes.add_patch(Polygon(outline_mm + shift_mm, color=drawing.ink, lw=0.0, clip_path=printed))
    for place_mm in _crosses(sheets, column, row):
        axes.plot(*place_mm, "+", color="0.5", markersize=72.0 / _INCH_MM * _CROSS_MM, markeredgewidth=0.3)
    foot_mm = height_mm - 0.55 * _MARGIN_MM
    axes.plot([_MARGIN_MM, _MARGIN_MM + _RULER_MM], [foot_mm, foot_mm], color="black", lw=0.6)
    for end_mm in (_MARGIN_MM, _MARGIN_MM + _RULER_MM):
        axes.plot([end_mm, end_mm], [foot_mm - 1.5, foot_mm + 1.5], color="black", lw=0.6)
    where = f", sheet {column + 1} of {sheets.across} across, {row + 1} of {sheets.down} down"
    words = f"{title}{where if sheets.across * sheets.down > 1 else ''}; the line is 100 mm"
    axes.text(_MARGIN_MM + _RULER_MM + 3.0, foot_mm, words, fontsize=6.0, va="center", parse_math=False)
    return figure


def _crosses(sheets: Sheets, column: int, row: int) -> Iterator[tuple[float, float]]:
    """Marks in the middle of what a sheet and its neighbour both print."""
    (width_mm, height_mm), edge_mm = sheets.page_mm, _MARGIN_MM + 0.5 * _OVERLAP_MM
    first_mm, last_mm = _MARGIN_MM + _OVERLAP_MM, _MARGIN_MM + 1.5 * _OVERLAP_MM
    for x, shared in ((edge_mm, column > 0), (width_mm - edge_mm, column + 1 < sheets.across)):
        if shared:
            yield from ((x, first_mm), (x, height_mm - last_mm))
    for y, shared in ((edge_mm, row > 0), (height_mm - edge_mm, row + 1 < sheets.down)):
        if shared:
            yield from ((first_mm, y), (width_mm - last_mm, y))


def words_of(drawing: Drawing, sheets: Sheets, paper: str) -> str:
    """Size of what is printed, and how it lies on the paper, for the terminal."""
    width_mm, height_mm = np.ptp(np.concatenate(drawing.outlines_mm), axis=0)
    turned = "landscape" if sheets.page_mm[0] > sheets.page_mm[1] else "portrait"
    count = sheets.across * sheets.down
    on = f"{count} sheets of {paper}, {sheets.across} × {sheets.down}" if count > 1 else f"one sheet of {paper}"
    return f"{width_mm:.1f} × {height_mm:.1f} mm on {on}, {turned}"
