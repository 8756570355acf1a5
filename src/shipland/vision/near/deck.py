"""The look down: where the deck's centre is, by the markings of the deck.

The picture is resampled to the view of a level camera that looks straight down, ahead up. There a deck that is tilted
by a few degrees is nearly its own plan at some scale. The plan is found by correlation, then the homography between the
two by ECC (Evangelidis and Psarakis 2008), which gives the place of the deck's centre. Plan and view are compared by
their local contrast, so that uneven light on the deck has no effect.
"""

from __future__ import annotations

import math
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera, level_from_camera
from shipland.frames import Array
from shipland.messages import DeckSight, Frame, GimbalAttitude, Observation
from shipland.rig import DeckMark, Rig
from shipland.vision.near.gates import Refusal
from shipland.vision.parameters import DeckVisionParameters

Float = npt.NDArray[np.float32]
Grey = npt.NDArray[np.uint8]

_VIEW_PX, _HALF_VIEW = 256, math.tan(math.radians(50.0))
"""Side of the level view, and the slope of the ray at its edge."""

_FOCAL_PX, _MIDDLE_PX = 0.5 * _VIEW_PX / _HALF_VIEW, 0.5 * (_VIEW_PX - 1)
"""Focal length and centre of the searched view; ECC refines in a view that shows the deck as large as its plan."""

_LEAST_AHEAD = 0.2
"""Cosine to the optical axis from which a direction is in the picture."""

_PLAN_PX, _FINE, _BARE = 144, 4, 0.3
"""Side of the plan, oversampling of its drawing, brightness of a bare deck."""

_BLUR_PX, _LOCAL_PX = 1.0, 9.0
"""Standard deviations of the smoothing and of the neighbourhood of the local contrast."""

_LEAST_STD = 0.1
"""Regularisation of the local contrast, as a share of the mean standard deviation: flat areas have none."""

_COARSE, _SCALES = 0.5, 1.1
"""Scale of the searched pictures, and the ratio of neighbouring heights that are searched."""

_LEAST_DRAWN = 0.5
"""Least share of the plan's contrast in the picture, against the best place at the same height."""

_UNTIL = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 1e-4)
_FORWARD_RIGHT_DOWN: Array = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""`level` from the level camera's axes: right, back, down."""


class DeckVision:
    """Finds the deck in pictures that look down.

    Args:
        rig: whose deck it is.
        camera: intrinsics of the pictures.
        parameters: of the look down.
    """

    def __init__(self, rig: Rig, camera: Camera, parameters: DeckVisionParameters) -> None:
        self._camera, self._parameters, self._size_m = camera, parameters, rig.deck_size_m
        fine = _plan(rig.deck_marks, rig.deck_size_m)
        self._plan = _drawn(fine, _PLAN_PX)
        count = math.ceil(math.log(parameters.most_m / parameters.least_m) / math.log(_SCALES))
        heights_m = [parameters.least_m * _SCALES**i for i in range(count + 1)]
        self._plans = [(height_m, self._coarse(fine, height_m)) for height_m in heights_m]
        self._found: Array | None = None
        """(3,3) the last homography: `right, back, down` of the level camera from the plan's ahead-up pixels."""
        shrink = max(round(camera.focal_px / (2.0 * _FOCAL_PX)), 1)
        self._small = camera.scaled(camera.width_px // shrink, camera.height_px // shrink)

    def see(self, frame: Frame) -> Observation:
        """The deck, or why there is none."""
        image = frame.image
        if image is None:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_PICTURE.value)
        if image.shape != (self._camera.height_px, self._camera.width_px, 3):
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.WRONG_SIZE.value)
        if not all(map(math.isfinite, (frame.gimbal.roll_rad, frame.gimbal.pitch_rad, frame.gimbal.yaw_rad))):
            return Observation(frame.t_s, frame.gimbal, reason="the camera's attitude is not known")
        size = (self._small.width_px, self._small.height_px)
        small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)
        sight = None if self._found is None else self._refined(grey, frame.gimbal, self._found)
        if sight is None:
            sight = self._refined(grey, frame.gimbal, self._searched(grey, frame.gimbal))
        if sight is None:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_DECK.value)
        return Observation(frame.t_s, frame.gimbal, deck=sight)

    def _coarse(self, fine: Float, height_m: float) -> Float:
        """Local contrast of the plan, as large as the searched view shows it from a height."""
        side_px = _FOCAL_PX * self._size_m / height_m
        coarse = round(_COARSE * side_px)
        return _resized(_drawn(fine, round(side_px)), (coarse, coarse))

    def _level_view(self, grey: Grey, gimbal: GimbalAttitude, focal_px: float) -> tuple[Float, Float]:
        """Local contrast (n,n) as seen straight down, and 1 where the picture reaches."""
        small, level = self._small, level_from_camera(gimbal)
        rotation = (_FORWARD_RIGHT_DOWN.T @ level).astype(np.float32)
        straight, size = _straight(focal_px), (_VIEW_PX, _VIEW_PX)
        x, y = cv2.initUndistortRectifyMap(small.matrix, small.distortion, rotation, straight, size, cv2.CV_32FC1)
        side = (np.arange(_VIEW_PX) - _MIDDLE_PX) / focal_px
        along = _FORWARD_RIGHT_DOWN.T @ level[:, 2]
        ahead = along[0] * side[None, :] + along[1] * side[:, None] + along[2] > _LEAST_AHEAD
        view = cv2.remap(grey, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float32)
        inside = (x >= 0.0) & (x <= small.width_px - 1) & (y >= 0.0) & (y <= small.height_px - 1) & ahead
        valid = inside.astype(np.float32)
        return _contrast(view, valid), valid

    def _searched(self, grey: Grey, gimbal: GimbalAttitude) -> Array:
        """(3,3) homography as `_found` at the height and place of the best correlation with the plan."""
        view, valid = self._level_view(grey, gimbal, _FOCAL_PX)
        half = (round(_COARSE * _VIEW_PX), round(_COARSE * _VIEW_PX))
        small, room = _resized(view * valid, half), _resized(valid, half)
        best = (-1.0, np.eye(3))
        for height_m, plan in self._plans:
            side = plan.shape[0]
            edge = side // 2
            border = (edge, edge, edge, edge, cv2.BORDER_CONSTANT)
            padded, within = cv2.copyMakeBorder(small, *border), cv2.copyMakeBorder(room, *border)
            shared = cv2.matchTemplate(padded, plan, cv2.TM_CCORR)
            seen = cv2.matchTemplate(padded * padded, np.ones_like(plan), cv2.TM_CCORR)
            drawn = cv2.matchTemplate(within, plan * plan, cv2.TM_CCORR)
            enough = drawn > _LEAST_DRAWN * float(drawn.max())
            score = np.where(enough, shared / np.sqrt(np.maximum(seen * drawn, 1e-6)), -1.0)
            _, most, _, (column, row) = cv2.minMaxLoc(score)
            if most > best[0]:
                scale = self._size_m * _FOCAL_PX / height_m / _PLAN_PX
                centre = np.array([column - edge + 0.5 * side, row - edge + 0.5 * side]) / _COARSE
                corner = centre - 0.5 * scale * _PLAN_PX
                warp = np.array([[scale, 0.0, corner[0]], [0.0, scale, corner[1]], [0.0, 0.0, 1.0]])
                best = (most, np.linalg.inv(_straight(_FOCAL_PX)) @ warp)
        return best[1]

    def _refined(self, grey: Grey, gimbal: GimbalAttitude, start: Array) -> DeckSight | None:
        """The sight that ECC refines from a first homography; None, and nothing remembered, where it is no deck."""
        self._found = None
        focal_px = start[2, 2] / math.sqrt(abs(start[0, 0] * start[1, 1] - start[0, 1] * start[1, 0]))
        view, valid = self._level_view(grey, gimbal, focal_px)
        straight = _straight(focal_px)
        warp = straight @ start
        try:
            correlation, better = cv2.findTransformECC(
                self._plan,
                view,
                (warp / warp[2, 2]).astype(np.float32),
                cv2.MOTION_HOMOGRAPHY,
                _UNTIL,
                (valid > 0.5).astype(np.uint8),
                1,
            )
        except cv2.error:  # it does not converge
            return None
        found = np.linalg.inv(straight) @ np.asarray(better, dtype=float)
        sight = self._sight(found) if correlation >= self._parameters.least_correlation else None
        self._found = None if sight is None else found
        return sight

    def _sight(self, found: Array) -> DeckSight | None:
        """The deck's place by a homography; None where no deck can lie so."""
        plan_px_per_m = _PLAN_PX / self._size_m
        centre_px = 0.5 * (_PLAN_PX - 1)
        plan_from_deck = np.array([[plan_px_per_m, 0.0, centre_px], [0.0, plan_px_per_m, centre_px], [0.0, 0.0, 1.0]])
        right, back, place = (found @ plan_from_deck).T
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


def _straight(focal_px: float) -> Array:
    """Intrinsics of the level view."""
    return np.array([[focal_px, 0.0, _MIDDLE_PX], [0.0, focal_px, _MIDDLE_PX], [0.0, 0.0, 1.0]])


def _plan(marks: tuple[DeckMark, ...], size_m: float) -> Float:
    """(n,n) brightness of the deck from above, ahead up, oversampled."""
    side = _FINE * _PLAN_PX
    picture = np.full((side, side), _BARE, np.float32)
    scale, half = side / size_m, 0.5 * side
    for mark in marks:
        thick = max(1, round(mark.width_m * scale))
        points = [(round(half + right * scale), round(half - ahead * scale)) for ahead, right in mark.points_m]
        if mark.radius_m > 0.0:
            cv2.circle(picture, points[0], round(mark.radius_m * scale), mark.brightness, thick, cv2.LINE_AA)
        for a, b in pairwise(points):
            cv2.line(picture, a, b, mark.brightness, thick, cv2.LINE_AA)
    return picture


def _drawn(fine: Float, side_px: int) -> Float:
    """Local contrast of a plan resized to a side."""
    picture = _resized(fine, (side_px, side_px))
    return _contrast(picture, np.ones_like(picture))


def _resized(picture: Float, size: tuple[int, int]) -> Float:
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.float32)


def _contrast(picture: Float, valid: Float) -> Float:
    """Brightness relative to the neighbourhood, in the neighbourhood's standard deviations."""
    room = np.maximum(cv2.GaussianBlur(valid, (0, 0), _LOCAL_PX), 1e-3)
    smooth = cv2.GaussianBlur(picture, (0, 0), _BLUR_PX)
    over = smooth - cv2.GaussianBlur(smooth * valid, (0, 0), _LOCAL_PX) / room
    std = np.sqrt(cv2.GaussianBlur(over * over * valid, (0, 0), _LOCAL_PX) / room)
    least = _LEAST_STD * float(np.mean(std)) + 1e-6
    return (over / (std + least) * valid).astype(np.float32)
