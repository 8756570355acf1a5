"""Small charts as SVG text, for pages that stand alone: shares with intervals, and points in a plane."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from shipland.report.palette import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, Rgb

SERIES: tuple[Rgb, ...] = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
"""Colours of the pilots, in their order; from the seventh on they repeat."""


def colour_of(index: int) -> str:
    """CSS colour of a series."""
    return "rgb({},{},{})".format(*SERIES[index % len(SERIES)])


class Share(NamedTuple):
    """One share with its interval, 0…1, the index of its colour, and the words that are shown on pointing at it."""

    series: int
    share: float
    low: float
    high: float
    words: str


class Column(NamedTuple):
    """What stands at one place of the horizontal axis, shares side by side; the oracle rate, 0…1, is drawn across."""

    label: str
    shares: Sequence[Share]
    oracle_rate: float | None = None


def share_chart(columns: Sequence[Column], title: str, unit: str, joined: bool) -> str:
    """Shares against a quantity in bins, or over categories; `joined`, a line joins the marks of a series."""
    width, height, left, top, foot = max(320, 104 * len(columns) + 70), 240, 44, 30, 46
    plot = height - top - foot
    step = (width - left - 12) / len(columns)

    def y(share: float) -> float:
        return top + plot * (1.0 - share)

    parts = [_text(0, 14, title, "title")]
    for tick in (0.0, 0.25, 0.5, 0.75, 1.0):
        parts.append(f'<line class="grid" x1="{left}" x2="{width - 8}" y1="{y(tick):.1f}" y2="{y(tick):.1f}"/>')
        parts.append(_text(left - 6, y(tick) + 4, f"{100 * tick:.0f} %", "tick end"))
    lines: dict[int, list[str]] = {}
    marks: list[str] = []
    for index, column in enumerate(columns):
        middle = left + (index + 0.5) * step
        parts.append(_text(middle, height - foot + 16, column.label, "tick middle"))
        if column.oracle_rate is not None:
            at, half = y(column.oracle_rate), 0.42 * step
            parts.append(
                f'<line class="oracle" x1="{middle - half:.1f}" x2="{middle + half:.1f}" y1="{at:.1f}" y2="{at:.1f}">'
                f"<title>oracle {100 * column.oracle_rate:.1f} %</title></line>"
            )
        for place, item in enumerate(column.shares):
            x, colour = middle + 13.0 * (place - 0.5 * (len(column.shares) - 1)), colour_of(item.series)
            lines.setdefault(item.series, []).append(f"{x:.1f},{y(item.share):.1f}")
            marks.append(
                f'<g><title>{html.escape(item.words)}</title><line stroke="{colour}" stroke-width="2" x1="{x:.1f}" '
                f'x2="{x:.1f}" y1="{y(item.low):.1f}" y2="{y(item.high):.1f}"/>'
                f'<circle class="dot" fill="{colour}" cx="{x:.1f}" cy="{y(item.share):.1f}" r="4.5"/></g>'
            )
    if joined:
        parts += [
            f'<polyline fill="none" stroke="{colour_of(series)}" stroke-width="2" stroke-opacity="0.5" '
            f'points="{" ".join(points)}"/>'
            for series, points in lines.items()
        ]
    parts += [*marks, _text(left + 0.5 * (width - left), height - 8, unit, "tick middle")]
    return _svg(width, height, title, parts)


class Point(NamedTuple):
    """A flight, by its number on the page, the index of its colour, and its place; a cross where it is not `good`."""

    flight: int
    series: int
    good: bool
    across: float
    up: float


def point_chart(
    points: Iterable[Point],
    title: str,
    axes: tuple[str, str],
    half: tuple[float, float],
    outlines: Sequence[tuple[str, float]] = (),
    low: float = -1.0,
) -> str:
    """Points in a plane about zero, where they are finite.

    The axes have names with units, horizontal and vertical (up), and reach `half` of each either side, the vertical one
    from `low` of its half on, -1 or 0; points beyond are drawn at the edge. Outlines are (`square`, side) and
    (`circle`, diameter) about zero.
    """
    size, left, top, foot = 300, 50, 30, 40
    width, height = left + size + 12, top + size + foot

    def x(value: float) -> float:
        return left + 0.5 * size * (1.0 + max(-1.0, min(1.0, value / half[0])))

    def y(value: float) -> float:
        return top + size * (1.0 - max(low, min(1.0, value / half[1]))) / (1.0 - low)

    parts = [_text(0, 14, title, "title"), f'<rect class="frame" x="{left}" y="{top}" width="{size}" height="{size}"/>']
    for tick in (-1.0, -0.5, 0.0, 0.5, 1.0):
        upward = low + 0.5 * (1.0 - low) * (tick + 1.0)
        across, up = x(tick * half[0]), y(upward * half[1])
        parts.append(f'<line class="grid" x1="{across:.1f}" x2="{across:.1f}" y1="{top}" y2="{top + size}"/>')
        parts.append(f'<line class="grid" x1="{left}" x2="{left + size}" y1="{up:.1f}" y2="{up:.1f}"/>')
        parts.append(_text(across, top + size + 15, f"{tick * half[0]:g}", "tick middle"))
        parts.append(_text(left - 6, up + 4, f"{upward * half[1]:g}", "tick end"))
    shown: list[str] = []
    marks: dict[tuple[int, bool], str] = {}
    for flight, series, good, across, up in sorted(points, key=lambda it: (it.series, not it.good)):
        if math.isfinite(across) and math.isfinite(up):
            a, b = x(across), y(up)
            shown.append(f"{flight} {a:.1f} {b:.1f} {series} {int(good)}")
            mark = f"M{a:.1f} {b:.1f}h0" if good else f"M{a - 3:.1f} {b - 3:.1f}l6 6m0 -6l-6 6"
            marks[series, good] = marks.get((series, good), "") + mark
    parts.append('<g class="marks">')
    for (series, good), path in marks.items():
        look = 'class="dots" stroke-width="6" stroke-linecap="round"' if good else 'stroke-width="2"'
        look = f'fill="none" stroke="{colour_of(series)}" {look} data-series="{series}"'
        parts.append(f'<path {look} d="{path}"/>')
    parts.append("</g>")
    for shape, side in outlines:
        a, b = x(-0.5 * side), y(0.5 * side)
        wide, high = x(0.5 * side) - a, y(-0.5 * side) - b
        round_off = f' rx="{0.5 * wide:.1f}" ry="{0.5 * high:.1f}"' if shape == "circle" else ""
        box = f'x="{a:.1f}" y="{b:.1f}" width="{wide:.1f}" height="{high:.1f}"'
        parts.append(f'<rect class="outline" {box}{round_off}/>')
    parts.append(_text(left + 0.5 * size, height - 6, axes[0], "tick middle"))
    turned = f'transform="rotate(-90 12 {top + 0.5 * size:.0f})"'
    parts.append(f'<text class="tick middle" x="12" y="{top + 0.5 * size:.0f}" {turned}>{html.escape(axes[1])}</text>')
    return _svg(width, height, title, parts, f' data-points="{"|".join(shown)}"' if shown else "")


def _text(x: float, y: float, words: str, classes: str) -> str:
    return f'<text class="{classes}" x="{x:.1f}" y="{y:.1f}">{html.escape(words)}</text>'


def _svg(width: float, height: float, title: str, parts: Sequence[str], data: str = "") -> str:
    head = f'<svg viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}" role="img"'
    return f'{head} aria-label="{html.escape(title, quote=True)}"{data}>{"".join(parts)}</svg>'
