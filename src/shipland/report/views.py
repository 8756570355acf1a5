"""A flight as it is now, from the side and from above: drawn in a millisecond or two, without OpenGL."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from shipland.frames import Array
from shipland.messages import GroundTruth
from shipland.report.lettering import Image, put_text, wrap_text
from shipland.report.palette import BLACK, BLUE, GREEN, GREY, ORANGE, Rgb
from shipland.rig import Rig, Solid, layout

WIDTH_PX, TEXT_PX, SIDE_PX, TOP_PX = 640, 28, 192, 260
_PAPER: Rgb = (255, 255, 255)
_SHIP: Rgb = (226, 230, 234)
_SEA: Rgb = (200, 220, 235)
_LEAST_REACH_M = 2.0
_LEAST_AIRCRAFT_PX = 12
_SHIFT = 4
"""OpenCV's fixed point: sixteenths of a pixel."""
_SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
_CIRCLE = np.array([[math.sin(0.2 * at), math.cos(0.2 * at), 0.0] for at in range(32)])
"""Around the origin of `deck`, one to either side."""


@dataclass(frozen=True)
class _Panel:
    """A picture (h,WIDTH_PX,3) of `ship`: ahead to the right, another `axis`, 1 or 2, downward.

    `zero_m` of that axis lies at row `zero_px`, `ahead_m` at the right edge; `scale` is in px/m.
    """

    image: Image
    axis: int
    zero_m: float
    zero_px: float
    ahead_m: float
    scale: float

    def fill(self, points_m: Array, colour: Rgb) -> None:
        cv2.fillPoly(self.image, [self._fixed(points_m)], colour, cv2.LINE_AA, _SHIFT)

    def line(self, points_m: Array, colour: Rgb, thick_px: int, *, closed: bool = False) -> None:
        cv2.polylines(self.image, [self._fixed(points_m)], closed, colour, thick_px, cv2.LINE_AA, _SHIFT)

    def _fixed(self, points_m: Array) -> cv2.typing.MatLike:
        columns = WIDTH_PX - (self.ahead_m - points_m[:, 0]) * self.scale
        rows = self.zero_px + (points_m[:, self.axis] - self.zero_m) * self.scale
        fixed = np.round(np.clip(np.column_stack([columns, rows]), -1e4, 1e4) * 2**_SHIFT)
        return np.asarray(fixed.astype(np.int32)).reshape(-1, 1, 2)


class FlightViews:
    """Takes the truth moment by moment, and draws: ship and trail in `ship`, ahead to the right."""

    def __init__(self, rig: Rig, aircraft_m: float) -> None:
        self._rig, self._boxes, self._aircraft_m = rig, layout(rig), aircraft_m
        self._ahead_m = self._boxes.hull.high_m[0] + 0.2 * _LEAST_REACH_M
        self._trail_m: list[Array] = []
        self._truth: GroundTruth | None = None

    def note(self, truth: GroundTruth) -> None:
        """Take a moment."""
        self._truth = truth
        self._trail_m.append((truth.ned_from_ship.inverse() @ truth.ned_from_body).translation_m)

    def picture(self, words: str = "", whole: bool = False) -> Image:
        """Of the moment taken last, (480,640,3) uint8 RGB, with a line of words above; ValueError before the first.

        It holds the whole trail, or comes nearer as the aircraft does.
        """
        if self._truth is None:
            raise ValueError("a picture of a flight wants a moment of it")
        rig, boxes, trail_m = self._rig, self._boxes, np.array(self._trail_m)
        shown_m = trail_m if whole else trail_m[-1:]
        reach_m = max(_LEAST_REACH_M, 1.1 * float(np.abs(shown_m[:, :2]).max()))
        up_m = max(rig.superstructure_height_m, rig.deck_height_m - float(shown_m[:, 2].min()))
        span_m = max(reach_m + self._ahead_m, 1.2 * up_m * WIDTH_PX / SIDE_PX)
        if not whole:  # in steps: a film that always zooms is hard to look at
            span_m = 2.0 ** (math.ceil(2.0 * math.log2(span_m)) / 2.0)
        scale = WIDTH_PX / span_m
        image = np.full((TEXT_PX + SIDE_PX + TOP_PX, WIDTH_PX, 3), _PAPER, np.uint8)
        _, side, top = np.split(image, [TEXT_PX, TEXT_PX + SIDE_PX])
        ground_px = SIDE_PX - 10
        side[ground_px:] = _SEA
        beside = _Panel(side, 2, rig.deck_height_m, ground_px, self._ahead_m, scale)
        above = _Panel(top, 1, 0.0, 0.5 * TOP_PX, self._ahead_m, scale)
        for panel, solids, half_bar_m in (
            (beside, (boxes.hull, boxes.house), [0.0, 0.0, 0.5 * rig.rectangle_height_m]),
            (above, (boxes.hull,), [0.0, 0.5 * rig.board_size_m[0], 0.0]),
        ):
            for solid in solids:
                panel.fill(_outline(solid), _SHIP)
            panel.line(rig.bar_in_ship_m + np.outer([-1.0, 1.0], half_bar_m), GREEN, 4)
            self._draw_moving(panel, trail_m, self._truth)
        top[0] = GREY
        put_text(image, wrap_text(f"{self._truth.t_s:.1f} s  {words}", 14, WIDTH_PX - 16, 1)[0], (8, 20), 14, BLACK)
        return image

    def _draw_moving(self, panel: _Panel, trail_m: Array, truth: GroundTruth) -> None:
        """Deck, trail and aircraft."""
        ship_from_ned = truth.ned_from_ship.inverse()
        ship_from_deck, ship_from_body = ship_from_ned @ truth.ned_from_deck, ship_from_ned @ truth.ned_from_body
        landing = _CIRCLE if self._rig.landing_area == "circle" else _SQUARE
        panel.line(ship_from_deck.apply(0.5 * self._rig.deck_size_m * _SQUARE), GREY, 1, closed=True)
        panel.line(ship_from_deck.apply(0.5 * self._rig.landing_square_m * landing), GREEN, 1, closed=True)
        panel.line(trail_m, BLUE, 1)
        half_m = 0.5 * max(self._aircraft_m, _LEAST_AIRCRAFT_PX / panel.scale)
        for arm_m in ([[-1.0, 0, 0], [1, 0, 0]], [[0.0, -1, 0], [0, 1, 0]]):
            panel.line(ship_from_body.apply(half_m * np.array(arm_m)), ORANGE, 3)


def _outline(solid: Solid) -> Array:
    """(4,3) corners, in order both from the side and from above."""
    (back, left, top), (fore, right, bottom) = solid.low_m, solid.high_m
    return np.array([[back, left, top], [back, right, bottom], [fore, right, bottom], [fore, left, top]])
