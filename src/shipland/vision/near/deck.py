"""The look down: where the deck's centre is, by the markings of the deck.

The picture is drawn anew as a level camera would see it that looks straight down, north of the picture ahead. There a
deck that leans by a few degrees is nearly its own plan at some scale: the plan is found by correlation, then the
homography between the two by ECC (Evangelidis and Psarakis 2008), which tells the place of the deck's centre. Light
that changes over the deck changes nothing: both are compared by their local contrast.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera, level_from_camera
from shipland.config import require
from shipland.frames import Array
from shipland.messages import DeckSight, Frame, GimbalAttitude, Observation
from shipland.rig import DeckMark, Rig
from shipland.vision.near.refusal import Refusal

Float = npt.NDArray[np.float32]
_VIEW_PX, _HALF_VIEW = 256, math.tan(math.radians(50.0))
"""Of the level view: its side, and the slope that its edge is seen at."""
_FOCAL_PX = 0.5 * _VIEW_PX / _HALF_VIEW
_PLAN_PX = 144
_BLUR_PX, _LOCAL_PX = 1.0, 9.0
"""Of the contrast: what is smoothed, and what is local."""
_COARSE = 0.5
_SCALES = 1.1
"""From one height that the plan is tried at to the next."""
_UNTIL = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-4)
_FORWARD_RIGHT_DOWN: Array = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""`level` from the level camera's axes: right, back, down."""


@dataclass(frozen=True)
class DeckVisionParameters:
    """`[vision.deck]`.

    Attributes:
        least_m, most_m: height of the camera over the deck at which it is looked for.
        least_correlation: of plan and view; less is no deck.
        largest_tilt_deg, largest_turn_deg: of the deck against the level, and against the nose; more is no deck.
        deviation_m: standard deviation of a place along each axis, at a height of a metre; it goes with the height.
    """

    least_m: float
    most_m: float
    least_correlation: float
    largest_tilt_deg: float
    largest_turn_deg: float
    deviation_m: float

    def __post_init__(self) -> None:
        require(0.0 < self.least_m < self.most_m, "0 < least_m < most_m must hold")
        require(0.0 < self.least_correlation < 1.0, "least_correlation must be in (0, 1)")
        require(self.deviation_m > 0.0, "deviation_m must be positive")


class DeckVision:
    """Finds the deck in pictures that look down.

    Args:
        rig: whose deck it is.
        camera: intrinsics of the pictures.
        parameters: what is a deck.
    """

    def __init__(self, rig: Rig, camera: Camera, parameters: DeckVisionParameters) -> None:
        self._camera, self._parameters, self._size_m = camera, parameters, rig.deck_size_m
        self._plan = _plan(rig.deck_marks, rig.deck_size_m)
        self._contrast = _contrast(self._plan, np.ones_like(self._plan))
        self._found: Array | None = None
        """(3,3) the last homography, from plan to view."""

    def see(self, frame: Frame) -> Observation:
        """The deck, or why there is none."""
        nothing = Observation(frame.t_s, frame.gimbal)
        image = frame.image
        if image is None:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_PICTURE.value)
        if image.shape != (self._camera.height_px, self._camera.width_px, 3):
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.WRONG_SIZE.value)
        view, valid = self._level_view(image, frame.gimbal)
        for start in self._starts(view, valid):
            sight = self._refined(view, valid, start)
            if sight is not None:
                return Observation(frame.t_s, frame.gimbal, deck=sight)
        self._found = None
        return Observation(nothing.t_s, nothing.gimbal, reason="the deck's markings are not in view")

    def _level_view(self, image: npt.NDArray[np.uint8], gimbal: GimbalAttitude) -> tuple[Float, Float]:
        """Local contrast (n,n) as seen straight down, and 1 where the picture reaches."""
        middle = 0.5 * (_VIEW_PX - 1)
        columns, rows = np.meshgrid(*[(np.arange(_VIEW_PX) - middle) / _FOCAL_PX] * 2)
        rays = np.stack([columns, rows, np.ones_like(columns)], axis=-1).reshape(-1, 3) @ _FORWARD_RIGHT_DOWN.T
        in_camera = rays @ level_from_camera(gimbal)
        ahead = in_camera[:, 2] > 0.2
        in_camera[~ahead] = (0.0, 0.0, 1.0)
        pixels = self._camera.project(in_camera).astype(np.float32)
        pixels[~ahead] = -1e4
        x, y = (pixels[:, i].reshape(_VIEW_PX, _VIEW_PX) for i in (0, 1))
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        shrink = max(self._camera.focal_px / (2.0 * _FOCAL_PX), 1.0)
        grey = cv2.GaussianBlur(grey, (0, 0), 0.4 * shrink)
        view = cv2.remap(grey, x, y, cv2.INTER_LINEAR, borderValue=0).astype(np.float32)
        inside = (x >= 0.0) & (x <= self._camera.width_px - 1) & (y >= 0.0) & (y <= self._camera.height_px - 1)
        valid = inside.astype(np.float32)
        return _contrast(view, valid), valid

    def _starts(self, view: Float, valid: Float) -> list[Array]:
        """Homographies to begin with: the last one, then where the plan correlates best."""
        found = [] if self._found is None else [self._found]
        return [*found, self._searched(view, valid)]

    def _searched(self, view: Float, valid: Float) -> Array:
        """The plan at every scale, everywhere: where it correlates best."""
        small = cv2.resize(view * valid, None, fx=_COARSE, fy=_COARSE, interpolation=cv2.INTER_AREA)
        room = cv2.resize(valid, None, fx=_COARSE, fy=_COARSE, interpolation=cv2.INTER_AREA)
        best = (-1.0, np.eye(3))
        parameters = self._parameters
        count = math.ceil(math.log(parameters.most_m / parameters.least_m) / math.log(_SCALES))
        for i in range(count + 1):
            height_m = parameters.least_m * _SCALES**i
            side = round(_COARSE * _FOCAL_PX * self._size_m / height_m)
            plan = cv2.resize(self._contrast, (side, side), interpolation=cv2.INTER_AREA)
            edge = side // 2
            padded, within = (cv2.copyMakeBorder(it, edge, edge, edge, edge, cv2.BORDER_CONSTANT) for it in (small, room))
            shared = cv2.matchTemplate(padded, plan, cv2.TM_CCORR)
            seen = cv2.matchTemplate(padded * padded, np.ones_like(plan), cv2.TM_CCORR)
            drawn = cv2.matchTemplate(within, plan * plan, cv2.TM_CCORR)
            enough = drawn > 0.3 * float((plan * plan).sum())
            score = np.where(enough, shared / np.sqrt(np.maximum(seen * drawn, 1e-6)), -1.0)
            _, most, _, (column, row) = cv2.minMaxLoc(score)
            if most > best[0]:
                scale = self._size_m * _FOCAL_PX / height_m / _PLAN_PX
                centre = np.array([column - edge + 0.5 * side, row - edge + 0.5 * side]) / _COARSE
                corner = centre - 0.5 * scale * _PLAN_PX
                best = (most, np.array([[scale, 0.0, corner[0]], [0.0, scale, corner[1]], [0.0, 0.0, 1.0]]))
        return best[1]

    def _refined(self, view: Float, valid: Float, start: Array) -> DeckSight | None:
        warp = start.astype(np.float32)
        mask = (valid > 0.5).astype(np.uint8)
        try:
            correlation, warp = cv2.findTransformECC(
                self._contrast, view, warp, cv2.MOTION_HOMOGRAPHY, _UNTIL, mask, 1
            )
        except cv2.error:  # it does not converge
            return None
        if correlation < self._parameters.least_correlation:
            return None
        sight = self._sight(np.asarray(warp, float))
        self._found = None if sight is None else np.asarray(warp, float)
        return sight

    def _sight(self, warp: Array) -> DeckSight | None:
        """The place that a homography tells, unless no deck lies so."""
        middle = 0.5 * (_VIEW_PX - 1)
        rays_from_view = np.array([[1.0, 0.0, -middle], [0.0, 1.0, -middle], [0.0, 0.0, _FOCAL_PX]]) / _FOCAL_PX
        plan_px_per_m = _PLAN_PX / self._size_m
        centre_px = 0.5 * (_PLAN_PX - 1)
        plan_from_deck = np.array([[plan_px_per_m, 0.0, centre_px], [0.0, plan_px_per_m, centre_px], [0.0, 0.0, 1.0]])
        right, back, place = (rays_from_view @ warp @ plan_from_deck).T
        lengths = math.hypot(*right.tolist()), math.hypot(*back.tolist())
        scale = math.sqrt(lengths[0] * lengths[1])
        if not (math.isfinite(scale) and scale > 1e-6):
            return None
        place_m = place / scale
        normal = np.cross(right, back) / (lengths[0] * lengths[1])
        tilt_deg = math.degrees(math.acos(min(max(float(normal[2]), -1.0), 1.0)))
        turn_deg = math.degrees(math.atan2(float(right[1]), float(right[0])))
        limits = self._parameters
        if tilt_deg > limits.largest_tilt_deg or abs(turn_deg) > limits.largest_turn_deg:
            return None
        if not limits.least_m <= float(place_m[2]) <= limits.most_m:
            return None
        return DeckSight(_FORWARD_RIGHT_DOWN @ place_m, np.full(3, limits.deviation_m * float(place_m[2])))


def _plan(marks: tuple[DeckMark, ...], size_m: float) -> Float:
    """(n,n) the deck from above, ahead up: how bright."""
    fine = 4
    picture = np.full((fine * _PLAN_PX, fine * _PLAN_PX), 0.3, np.float32)
    scale, half = fine * _PLAN_PX / size_m, 0.5 * fine * _PLAN_PX
    for mark in marks:
        thick = max(1, round(mark.width_m * scale))
        points = [tuple(np.rint([half + y * scale, half - x * scale]).astype(int).tolist()) for x, y in mark.points_m]
        if mark.radius_m > 0.0:
            cv2.circle(picture, points[0], round(mark.radius_m * scale), mark.brightness, thick, cv2.LINE_AA)
        for a, b in zip(points, points[1:], strict=False):
            cv2.line(picture, a, b, mark.brightness, thick, cv2.LINE_AA)
    return np.asarray(cv2.resize(picture, (_PLAN_PX, _PLAN_PX), interpolation=cv2.INTER_AREA), np.float32)


def _contrast(picture: Float, valid: Float) -> Float:
    """How much brighter than around it, in standard deviations of what is around it."""

    def around(values: Float) -> Float:
        return np.asarray(cv2.GaussianBlur(values * valid, (0, 0), _LOCAL_PX) / room, np.float32)

    room = np.maximum(cv2.GaussianBlur(valid, (0, 0), _LOCAL_PX), 1e-3)
    smooth = cv2.GaussianBlur(picture, (0, 0), _BLUR_PX)
    mean = around(smooth)
    spread = np.sqrt(np.maximum(around((smooth - mean) ** 2), 0.0))
    least = 0.1 * float(np.mean(spread)) + 1e-6
    return np.asarray((smooth - mean) / (spread + least) * valid, np.float32)
