"""Drawings of the flight's video: corners and boxes over the picture, and the strip of instruments below it."""

from __future__ import annotations

import math
from collections import deque

import cv2
import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from shipland.frames import Array
from shipland.messages import Box, FlightRecord, Observation, TouchdownVerdict
from shipland.record.columns import Derived
from shipland.report.lettering import Bgr, Image, put_text, text_width, wrap_text
from shipland.report.palette import BLUE, GREEN, ORANGE, SKY, STICKS, VERMILION, bgr, mode_colour, mode_name

STRIP_HEIGHT_PX = 100
STRIP_WIDTH_PX = 960
TRACES_WIDTH_PX = 640

_INK: Bgr = (235, 235, 235)
_FAINT: Bgr = (150, 150, 150)
_GROUND: Bgr = (32, 30, 28)
_RAIL: Bgr = (70, 66, 62)
_SUBPIXEL_BITS = 4

_TRACE_POINTS = 200
"""Points of a trace: one for each pixel."""
_SPARE_S = 2.0
"""Time kept beyond a trace's beginning: the newest row may be a detector's cycle ahead of the picture."""

_ZOOM_SIZE_PX = (280, 140)
_LEAST_ZOOM, _LARGEST_ZOOM = 2.0, 12.0

_PLACE_COLUMNS_PX = (396, 478, 560, 642)
_STICKS_PX = (722, 776, 910)  # names, left and right end of the rails
_TRACES = (("roll", "°", 15.0, BLUE), ("pitch", "°", 15.0, VERMILION), ("heave", " m", 0.7, GREEN))
"""Name, unit, half the range shown at first, colour; the range doubles when a ship moves by more."""
_LANES_PX = tuple(STRIP_WIDTH_PX + 6 + 211 * lane for lane in range(len(_TRACES)))


def draw_sight(image: Image, observation: Observation, scale: float) -> None:
    """Corners, quadrilaterals and boxes over a picture that was shrunk by `scale`, in place."""
    if observation.bar_pose is not None:
        _draw_corners(image, (observation.bar_pose.corners_px + 0.5) * scale - 0.5)
    bar_box, ship_box = observation.bar_box, observation.ship_box
    if bar_box is not None:
        _draw_box(image, bar_box, "bar", bgr(ORANGE), scale, below=False)
    if ship_box is not None:
        _draw_box(image, ship_box, "ship", bgr(SKY), scale, below=bar_box is not None)


def draw_zoom(image: Image, picture: Image, observation: Observation) -> None:
    """A magnified cut of the whole `picture` around a bar or box that is small, in a corner of `image`, in place."""
    pose, box = observation.bar_pose, observation.bar_box or observation.ship_box
    if pose is not None:
        middle_px, extent_px = pose.corners_px.mean(axis=0), float(np.ptp(pose.corners_px, axis=0).max())
    elif box is not None:
        middle_px, extent_px = np.array(box.centre_px), max(box.size_px)
    else:
        return
    width, height = _ZOOM_SIZE_PX
    zoom = float(np.clip(0.7 * width / max(extent_px, 1.0), 1.0, _LARGEST_ZOOM))
    if zoom < _LEAST_ZOOM or not np.isfinite(middle_px).all():
        return
    shift = np.array([0.5 * (width - 1), 0.5 * (height - 1)]) - zoom * middle_px
    matrix = np.array([[zoom, 0.0, shift[0]], [0.0, zoom, shift[1]]])
    cut = np.empty((height, width, 3), np.uint8)
    cv2.warpAffine(picture, matrix, _ZOOM_SIZE_PX, dst=cut, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    if pose is not None:
        _draw_corners(cut, zoom * pose.corners_px + shift)
    put_text(cut, f"× {zoom * picture.shape[1] / image.shape[1]:.0f}", (8, height - 9), 14, _INK, bold=True)
    left = image.shape[1] - width - 12
    image[10 : 14 + height, left - 2 : left + width + 2] = _INK
    image[12 : 12 + height, left : left + width] = cut


def draw_verdict(image: Image, verdict: TouchdownVerdict) -> None:
    """The verdict as a banner across the picture, in place."""
    height, width = image.shape[:2]
    title = verdict.reason.partition(",")[0].upper() if verdict.landed else "NOT LANDED"
    figures = f"{verdict.t_s:.1f} s"
    if verdict.touched:
        place = f"{100.0 * verdict.error_m:.0f} cm from the centre"
        figures = f"{place}   ·   {verdict.sink_mps:.2f} m/s down   ·   {figures}"
    middle = height - 50  # low in the picture, so that the bar stays in sight
    band = image[middle - 58 :]
    band[:] = band // 4
    band[:6] = bgr(GREEN if verdict.success else VERMILION)
    lines = [(title, 30, True, -10), (figures, 17, False, 24)]
    if not verdict.success:
        reason = wrap_text(verdict.reason, 15, width - 40, lines=1)[0]
        lines = [(title, 30, True, -18), (figures, 17, False, 11), (reason, 15, False, 37)]
    for text, size_px, bold, below in lines:
        column = (width - text_width(text, size_px, bold)) // 2
        put_text(image, text, (column, middle + below), size_px, _INK, bold)


class Instruments:
    """Draws the strip below the pictures: mode and reason, place against the pad, sticks; and the deck's motion."""

    def __init__(self, with_traces: bool, trace_s: float) -> None:
        self._with_traces, self._trace_s = with_traces, trace_s
        self._deck: deque[tuple[float, float, float, float]] = deque()
        self._spans = [span for _, _, span, _ in _TRACES]
        self.width_px = STRIP_WIDTH_PX + (TRACES_WIDTH_PX if with_traces else 0)
        self._blank = np.full((STRIP_HEIGHT_PX, self.width_px, 3), _GROUND, np.uint8)
        for column, name in zip(_PLACE_COLUMNS_PX, ("forward", "right", "up", "heading"), strict=True):
            put_text(self._blank, name, (column, 26), 13, _FAINT)
        put_text(self._blank, "pilot", (352, 53), 13, _FAINT)
        put_text(self._blank, "truth", (352, 81), 13, _FAINT)
        names_px, left_px, right_px = _STICKS_PX
        for index, name in enumerate(STICKS):
            row = 20 + 20 * index
            put_text(self._blank, name, (names_px, row + 5), 13, _FAINT)
            self._blank[row - 5 : row + 6, left_px : right_px + 1] = _RAIL
        for left in _LANES_PX if self._with_traces else ():
            self._blank[30:92, left : left + 200] = (44, 41, 38)
            self._blank[61, left : left + 200] = _RAIL

    def note(self, t_s: float, derived: Derived) -> None:
        """Take the deck's motion at one instant into the traces; an instant already taken changes nothing.

        Between instants, half a second apart while a detector runs, the traces are cubic splines.
        """
        if self._deck and t_s <= self._deck[-1][0]:
            return
        roll_deg, pitch_deg, _ = np.degrees(derived.deck_turn_rad)
        values = (roll_deg, pitch_deg, derived.deck_shift_m[2])
        if math.isfinite(values[2]):
            self._deck.append((t_s, *values))
            for lane, value in enumerate(values):
                while abs(value) > self._spans[lane]:
                    self._spans[lane] *= 2.0
        while self._deck and self._deck[0][0] < t_s - self._trace_s - _SPARE_S:
            self._deck.popleft()

    def _deck_at(self, t_s: Array) -> Array:
        """(n,3) roll [°], pitch [°] and heave [m]; before the first instant and after the last what they were then."""
        samples = np.array(self._deck).reshape(-1, 4)
        if len(samples) < 2:
            return np.repeat(samples[:, 1:], len(t_s), axis=0)
        curve = CubicSpline(samples[:, 0], samples[:, 1:])
        return np.asarray(curve(np.clip(t_s, samples[0, 0], samples[-1, 0])))

    def draw(self, record: FlightRecord, places: Derived, t_s: float) -> Image:
        """The strip (STRIP_HEIGHT_PX, width, 3) of a video's frame at `t_s`, the newest cycle then being `record`.

        In `places` the pilot's estimate and the truth are of one and the same time.
        """
        strip = self._blank.copy()
        _draw_mode(strip, record, t_s)
        _draw_place(strip, places)
        _draw_sticks(strip, record)
        if self._with_traces:
            self._draw_traces(strip, t_s)
        return strip

    def _draw_traces(self, strip: Image, t_s: float) -> None:
        times_s = np.linspace(t_s - self._trace_s, t_s, _TRACE_POINTS)
        times_s = times_s[times_s >= self._deck[0][0] - 1e-9] if self._deck else times_s[:0]
        lanes = zip(_LANES_PX, _TRACES, self._spans, self._deck_at(times_s).T, strict=True)
        for left, (name, suffix, _, colour), span, values in lanes:
            if not len(values):
                put_text(strip, f"deck {name}  –", (left, 22), 14, _FAINT)
                continue
            put_text(strip, f"deck {name}", (left, 22), 14, _FAINT)
            newest = _signed(float(values[-1]), 2 if suffix == " m" else 1)
            put_text(strip, newest + suffix, (left + 100, 22), 15, _INK)
            columns = left + 199.0 * (1.0 - (t_s - times_s) / self._trace_s)
            points = _fixed(np.column_stack([columns, 61.0 - 30.0 * np.clip(values / span, -1.0, 1.0)]))
            lighter = tuple((value + 255) // 2 for value in bgr(colour))
            cv2.polylines(strip, [points[:, None]], False, lighter, 2, cv2.LINE_AA, _SUBPIXEL_BITS)


def _draw_mode(strip: Image, record: FlightRecord, t_s: float) -> None:
    decision = record.decision
    colour = mode_colour(decision.mode)
    light = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2] > 140.0
    strip[12:42, 14:174] = bgr(colour)
    ink = (20, 20, 20) if light else (255, 255, 255)
    put_text(strip, mode_name(decision.mode).upper(), (24, 33), 16, ink, bold=True)
    put_text(strip, f"{t_s:.1f} s", (190, 33), 16, _INK)
    if decision.landing_probability is not None:
        put_text(strip, f"{100.0 * decision.landing_probability:.0f} %", (270, 33), 16, _INK)
    for index, line in enumerate(wrap_text(decision.reason, 14, 330, lines=2)):
        put_text(strip, line, (14, 64 + 20 * index), 14, _INK)


def _draw_place(strip: Image, places: Derived) -> None:
    rows = [(54, 16, _INK, places.estimate_in_pad_m, places.estimate_yaw_rad)]
    if np.isfinite(places.truth_in_pad_m).all():
        rows.append((82, 14, _FAINT, places.truth_in_pad_m, places.truth_yaw_rad))
    for row, size_px, colour, place_m, yaw_rad in rows:
        texts = [_metres(float(value)) for value in place_m]
        texts.append(f"{_signed(math.degrees(yaw_rad), 1)}°" if math.isfinite(yaw_rad) else "–")
        for column, text in zip(_PLACE_COLUMNS_PX, texts, strict=True):
            put_text(strip, text, (column, row), size_px, colour)


def _draw_sticks(strip: Image, record: FlightRecord) -> None:
    values = record.decision.command.sticks_percent
    _, left_px, right_px = _STICKS_PX
    middle, half = (left_px + right_px) // 2, (right_px - left_px) // 2
    for index, (percent, colour) in enumerate(zip(values, STICKS.values(), strict=True)):
        row = 20 + 20 * index
        tip = middle + round(half * max(-100.0, min(100.0, percent)) / 100.0)
        strip[row - 5 : row + 6, min(middle, tip) : max(middle, tip) + 1] = bgr(colour)
        strip[row - 7 : row + 8, middle] = _INK
        put_text(strip, _signed(percent, 0), (right_px + 8, row + 5), 13, _INK)


def _metres(value_m: float) -> str:
    if not math.isfinite(value_m):
        return "–"
    digits = 2 if abs(value_m) < 10.0 else 1 if abs(value_m) < 1000.0 else 0  # what the column has room for
    return f"{_signed(value_m, digits)} m"


def _signed(value: float, digits: int) -> str:
    return f"{round(value, digits) + 0.0:+.{digits}f}".replace("-", "−")  # + 0.0: no minus before a zero


def _fixed(points_px: Array) -> npt.NDArray[np.int32]:
    """In OpenCV's fixed point."""
    return np.round(points_px * (1 << _SUBPIXEL_BITS)).astype(np.int32)


def _draw_corners(image: cv2.typing.MatLike, corners_px: npt.NDArray[np.float64]) -> None:
    quads = corners_px.reshape(-1, 4, 2)
    fixed = _fixed(quads)
    cv2.polylines(image, list(fixed[:, :, None]), True, bgr(VERMILION), 1, cv2.LINE_AA, _SUBPIXEL_BITS)
    side_px = float(np.linalg.norm(quads[:, 3] - quads[:, 0], axis=1).min())
    if side_px >= 12.0:
        for column, row in fixed.reshape(-1, 2):
            centre, radius = (int(column), int(row)), 4 << _SUBPIXEL_BITS
            cv2.circle(image, centre, radius, (255, 255, 255), 1, cv2.LINE_AA, _SUBPIXEL_BITS)


def _draw_box(image: Image, box: Box, name: str, colour: Bgr, scale: float, *, below: bool) -> None:
    half = 0.5 * np.array(box.size_px)
    first, last = ((np.array(box.centre_px) + side * half) * scale for side in (-1.0, 1.0))
    cv2.rectangle(image, np.round(first).astype(int).tolist(), np.round(last).astype(int).tolist(), colour, 2)
    label = f"{name} {box.size_px[0]:.0f} × {box.size_px[1]:.0f} px  {100.0 * box.confidence:.0f} %"
    above_row, below_row = round(float(first[1])) - 7, round(float(last[1])) + 18
    below = (below and below_row < image.shape[0] - 4) or above_row <= 14
    column, row = max(2, round(float(first[0]))), below_row if below else above_row
    right = max(0, column + text_width(label, 14, bold=True) + 3)
    ground = image[max(0, row - 13) : max(0, row + 5), column - 2 : right]
    ground //= 2  # a coloured label on a sky of its brightness is lost in the film's coarse colours
    put_text(image, label, (column, row), 14, colour, bold=True)
