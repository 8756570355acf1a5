"""A flight as it is now, from the side and from above: drawn in a millisecond or two, without OpenGL."""

from __future__ import annotations

import math
from collections.abc import Callable

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


_Projection = Callable[[Array], Array]
"""From points (n,3) in `ship` to columns and rows (n,2) of a panel."""


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
        trail_m = np.array(self._trail_m)
        shown_m = trail_m if whole else trail_m[-1:]
        reach_m = max(_LEAST_REACH_M, 1.1 * float(np.abs(shown_m[:, :2]).max()))
        up_m = max(self._rig.superstructure_height_m, self._rig.deck_height_m - float(shown_m[:, 2].min()))
        span_m = max(reach_m + self._ahead_m, 1.2 * up_m * WIDTH_PX / SIDE_PX)
        if not whole:  # in steps: a film that always zooms is hard to look at
            span_m = 2.0 ** (math.ceil(2.0 * math.log2(span_m)) / 2.0)
        scale = WIDTH_PX / span_m
        image = np.full((TEXT_PX + SIDE_PX + TOP_PX, WIDTH_PX, 3), _PAPER, np.uint8)
        self._side(image[TEXT_PX : TEXT_PX + SIDE_PX], scale, trail_m, self._truth)
        self._top(image[TEXT_PX + SIDE_PX :], scale, trail_m, self._truth)
        image[TEXT_PX + SIDE_PX] = GREY
        put_text(image, wrap_text(f"{self._truth.t_s:.1f} s  {words}", 14, WIDTH_PX - 16, 1)[0], (8, 20), 14, BLACK)
        return image

    def _side(self, panel: Image, scale: float, trail_m: Array, truth: GroundTruth) -> None:
        rig = self._rig
        ground_px = SIDE_PX - 10.0

        def px(points_m: Array) -> Array:
            forward, down = points_m[:, 0], points_m[:, 2]
            rows = ground_px + (down - rig.deck_height_m) * scale
            return np.column_stack([WIDTH_PX - (self._ahead_m - forward) * scale, rows])

        panel[round(ground_px) :] = _SEA
        for solid in (self._boxes.hull, self._boxes.house):
            _fill(panel, px(_outline(solid)), _SHIP)
        half_m = 0.5 * rig.rectangle_height_m
        _line(panel, px(rig.bar_in_ship_m + np.array([[0.0, 0.0, -half_m], [0.0, 0.0, half_m]])), GREEN, 4)
        self._moving(panel, px, scale, trail_m, truth)

    def _top(self, panel: Image, scale: float, trail_m: Array, truth: GroundTruth) -> None:
        rig = self._rig

        def px(points_m: Array) -> Array:
            columns = WIDTH_PX - (self._ahead_m - points_m[:, 0]) * scale
            return np.column_stack([columns, 0.5 * TOP_PX + points_m[:, 1] * scale])

        board_m = 0.5 * rig.board_size_m[0]
        _fill(panel, px(_outline(self._boxes.hull)), _SHIP)
        _line(panel, px(rig.bar_in_ship_m + np.array([[0.0, -board_m, 0.0], [0.0, board_m, 0.0]])), GREEN, 4)
        self._moving(panel, px, scale, trail_m, truth)

    def _moving(self, panel: Image, px: _Projection, scale: float, trail_m: Array, truth: GroundTruth) -> None:
        """Deck, trail and aircraft."""
        ship_from_ned = truth.ned_from_ship.inverse()
        landing = _CIRCLE if self._rig.landing_area == "circle" else _SQUARE
        for outline_m, colour in (
            (0.5 * self._rig.deck_size_m * _SQUARE, GREY),
            (0.5 * self._rig.landing_square_m * landing, GREEN),
        ):
            _line(panel, px((ship_from_ned @ truth.ned_from_deck).apply(outline_m)), colour, 1, closed=True)
        _line(panel, px(trail_m), BLUE, 1)
        half_m = 0.5 * max(self._aircraft_m, _LEAST_AIRCRAFT_PX / scale)
        ship_from_body = ship_from_ned @ truth.ned_from_body
        for arm_m in ([[-1.0, 0, 0], [1, 0, 0]], [[0.0, -1, 0], [0, 1, 0]]):
            _line(panel, px(ship_from_body.apply(half_m * np.array(arm_m))), ORANGE, 3)


def _outline(solid: Solid) -> Array:
    """(4,3) corners, in order both from the side and from above."""
    (back, left, top), (fore, right, bottom) = solid.low_m, solid.high_m
    return np.array([[back, left, top], [back, right, bottom], [fore, right, bottom], [fore, left, top]])


def _fixed(points_px: Array) -> cv2.typing.MatLike:
    fixed: cv2.typing.MatLike = np.round(np.clip(points_px, -1e4, 1e4) * 2**_SHIFT).astype(np.int32)
    return fixed.reshape(-1, 1, 2)


def _fill(panel: Image, points_px: Array, colour: Rgb) -> None:
    cv2.fillPoly(panel, [_fixed(points_px)], colour, cv2.LINE_AA, _SHIFT)


def _line(panel: Image, points_px: Array, colour: Rgb, thick_px: int, *, closed: bool = False) -> None:
    cv2.polylines(panel, [_fixed(points_px)], closed, colour, thick_px, cv2.LINE_AA, _SHIFT)
