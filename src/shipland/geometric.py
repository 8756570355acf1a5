"""What vision would make of a picture, with its errors, from the truth alone (`[geometric]` in TOML).

Near: the pose that corner errors lead to, unrolled and compiled for campaigns. The solver of `vision.near.pose`
minimises the whitened residuals of corners and level prior. A few Gauss-Newton steps from the true pose end in the same
minimum; what they leave out is another planar solution. The solver is their test.

Far: the true boxes of ship and bar with the detectors' measured errors and misses, taken from `shipland evaluate` on
rendered pictures (docs/results/far-vision.md). False boxes are not modelled: flights that must meet them fly the
rendered camera.

Down: the true place of the deck with the errors of the rendered one's. Its attitude goes with it as a tag on the deck
would give it: true but for noise, without the second solution that a small plane's pose has, and seen wherever the
deck's centre is. No drawn picture gives it.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple, Protocol

import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.compiled import compiled
from shipland.config import key, parameters, require
from shipland.cue import Cue
from shipland.frames import Array, Pose
from shipland.messages import Box, DeckSight, Frame, GimbalAttitude, Observation
from shipland.rig import Rig
from shipland.sim.state import SceneState, target_box
from shipland.vehicles.vehicle import GroundTruthSource
from shipland.vision.near.covariance import bar_pose_of
from shipland.vision.near.gates import Refusal, gimbal_off, jumps, largest_reprojection_px, within_reach
from shipland.vision.near.planar_pose import (
    CONTRADICTION_CHI2,
    DOUBTFUL_CHI2,
    NO_COMMON_ERROR,
    Corners,
    LevelPrior,
    Solution,
    exp_rotation,
    level_off,
    ordered,
    solve,
)
from shipland.vision.parameters import VisionParameters


@parameters
class BoxErrors:
    """`[geometric.ship]` and `[geometric.bar]`: a detector's errors at some ranges, linear between them."""

    range_m: tuple[float, ...] = key(..., "ascending; beyond the last nothing is found")
    miss_rate: tuple[float, ...] = key(..., "share of frames without a box")
    centre_px: tuple[float, ...] = key(..., "standard deviation of a box's centre, column and row each")
    area: tuple[float, ...] = key(..., "standard deviation of a box's area, as a share of it")

    def __post_init__(self) -> None:
        require(len(self.range_m) > 1 and bool(np.all(np.diff(self.range_m) > 0.0)), "range_m must ascend")
        for name in ("miss_rate", "centre_px", "area"):
            values = getattr(self, name)
            require(len(values) == len(self.range_m), f"{name} must have as many values as range_m")
            require(min(values) >= 0.0, f"{name} must not be negative")
        require(max(self.miss_rate) <= 1.0, "miss_rate must not exceed 1")


@parameters
class BoxParameters:
    """`[geometric.boxes]`: what counts as visible, and when a box is believed."""

    least_visible: float = key(0.5, "share of the box that must lie in the picture", "as in [synth]")
    least_facing: float = key(0.17, "sine of the flattest angle at which the bar is seen", "as in [synth]")
    confirm_hits: int = key(3, "a target is believed after so many hits", "as in [detector]", ge=1)
    confirm_frames: int = key(4, "in so many frames", "as in [detector]")

    def __post_init__(self) -> None:
        require(self.confirm_hits <= self.confirm_frames, "confirm_hits must lie in 1 … confirm_frames")


@parameters
class DeckErrors:
    """`[geometric.deck]`."""

    least_m: float = key(0.5, "from the camera; nearer, too little of the markings is in view", gt=0)
    most_m: float = key(2.5, "from the camera; farther, they are too small")
    noise_m: float = key(0.004, "standard deviation of a place along each axis", gt=0)
    miss_rate: float = key(0.02, "share of frames without a sight", ge=0, lt=1)

    def __post_init__(self) -> None:
        require(self.least_m < self.most_m, "least_m < most_m must hold")


@parameters
class GeometricParameters:
    """`[geometric]`: the error model of the vision, fitted to rendered pictures.

    Poses err as on rendered pictures, whose corners err by more, but together: tools/fit_geometric.py.
    """

    corner_noise_px: float = key(0.018, "standard deviation of a corner's column and row, each, at range zero", gt=0)
    corner_noise_px_per_m: float = key(0.0008, "its growth with range", ge=0)
    max_range_m: float = key(22.0, "beyond it nothing is found", gt=0)
    miss_rate: float = key(0.0, "share of frames without a pose within that range", ge=0, lt=1)
    border_px: float = key(3.0, "a corner nearer than this to the picture's edge is cut off", ge=0)
    ship: BoxErrors = key(
        BoxErrors(
            range_m=(12.5, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0, 340.0),
            miss_rate=(0.0, 0.05, 0.0, 0.0, 0.02, 0.05, 0.05, 0.26),
            centre_px=(2.6, 1.7, 1.0, 0.8, 0.8, 0.9, 0.9, 0.8),
            area=(0.12, 0.17, 0.13, 0.2, 0.14, 0.24, 0.2, 0.27),
        ),
        "boxes of the ship",
        "tools/fit_boxes.py on 240 rendered scenes of three frames: docs/results/far-vision.md",
    )
    bar: BoxErrors = key(
        BoxErrors(
            range_m=(5.0, 15.0, 30.0, 60.0, 100.0, 130.0, 150.0),
            miss_rate=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.03),
            centre_px=(1.3, 0.8, 0.4, 0.3, 0.3, 0.3, 0.3),
            area=(0.06, 0.11, 0.11, 0.14, 0.21, 0.14, 0.12),
        ),
        "boxes of the bar",
        "tools/fit_boxes.py on 240 rendered scenes of three frames: docs/results/far-vision.md",
    )
    boxes: BoxParameters = BoxParameters()
    deck: DeckErrors = key(DeckErrors(), "of the look down")


_STEPS = 3
"""Gauss-Newton steps: quadratic convergence from a true pose."""


class CornerMeasurement(NamedTuple):
    """The cue's corners as a camera measured them, and the vertical as the gimbal has it.

    Attributes:
        plane_m: (n,2) corners, right and down in the plane.
        matrix: (3,3) of an ideal camera.
        corners_px: (n,2) measured.
        sigma_px: their standard deviation.
        down_in_camera: (3,) the plane's down axis as the gimbal has it, a unit vector.
        level_rad: what that is known to; 0 for not at all.
    """

    plane_m: Array
    matrix: Array
    corners_px: Array
    sigma_px: float
    down_in_camera: Array
    level_rad: float


@compiled
def relative_pose(
    ned_from_camera: Array, camera_in_ned_m: Array, ned_from_bar: Array, bar_in_ned_m: Array
) -> tuple[Array, Array]:
    """Rotation (3,3) and translation (3,) [m] camera_from_plane: `plane` is `bar` with axes right, down, forward."""
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for i in range(3):
        total = 0.0
        for k in range(3):
            total += ned_from_camera[k, i] * (bar_in_ned_m[k] - camera_in_ned_m[k])
        translation[i] = total
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += ned_from_camera[k, i] * ned_from_bar[k, (j + 1) % 3]
            rotation[i, j] = total
    return rotation, translation


@compiled
def projected(rotation: Array, translation_m: Array, plane_m: Array, matrix: Array) -> Array:
    """(n,2) pixels of points (n,2) of the plane in an ideal camera; NaN for those not in front of it."""
    pixels = np.empty((len(plane_m), 2))
    for i in range(len(plane_m)):
        right, down = plane_m[i]
        x = rotation[0, 0] * right + rotation[0, 1] * down + translation_m[0]
        y = rotation[1, 0] * right + rotation[1, 1] * down + translation_m[1]
        z = rotation[2, 0] * right + rotation[2, 1] * down + translation_m[2]
        near = 1.0 / z if z > 1e-9 else math.nan
        pixels[i, 0] = matrix[0, 0] * x * near + matrix[0, 1] * y * near + matrix[0, 2]
        pixels[i, 1] = matrix[1, 1] * y * near + matrix[1, 2]
    return pixels


@compiled
def inside(corners_px: Array, low_px: float, high_px: Array) -> bool:
    """Whether points (n,2) lie between a lowest column and row and the highest (2,); NaN does not."""
    for i in range(len(corners_px)):
        for k in range(2):
            if not low_px <= corners_px[i, k] <= high_px[k]:
                return False
    return True


@compiled
def pose_from_truth(
    rotation: Array, translation_m: Array, measured: CornerMeasurement
) -> tuple[bool, Array, Array, float, Array, Array]:
    """The pose that a solver would find: Gauss-Newton steps from the true one.

    Args:
        rotation: (3,3) of the true camera_from_plane.
        translation_m: (3,) of the same.
        measured: see there.

    Returns:
        Whether the corners settle it; rotation and translation found; χ²; (6,6) covariance of the left rotation vector
        and the translation, both in `camera`; (n,2) reprojected minus measured [px].
    """
    covariance, settled = np.zeros((6, 6)), False
    for _ in range(_STEPS):
        partial, residual = _linearised(rotation, translation_m, measured)
        covariance, settled = _inverse_gram(partial)
        step = np.zeros(6)
        for k in range(len(residual)):
            for i in range(6):
                for j in range(6):
                    step[i] -= covariance[i, j] * partial[k, j] * residual[k]
        rotation, translation_m = exp_rotation(step[:3], rotation), translation_m + step[3:]
    residual_px = projected(rotation, translation_m, measured.plane_m, measured.matrix) - measured.corners_px
    # The last step's χ² is that of its linear model: the next residual would cost a linearisation for the prior's sake.
    chi2 = 0.0
    for k in range(len(residual)):
        left = residual[k]
        for j in range(6):
            left += partial[k, j] * step[j]
        chi2 += left * left
    return settled, rotation, translation_m, chi2, covariance, residual_px


@compiled
def _linearised(rotation: Array, translation_m: Array, measured: CornerMeasurement) -> tuple[Array, Array]:
    """Jacobian (2n+3,6) and residual (2n+3,) in standard deviations; the last three rows are the level prior's."""
    plane_m, matrix, corners_px, sigma_px, down_in_camera, level_rad = measured
    count = len(plane_m)
    partial, residual = np.zeros((2 * count + 3, 6)), np.zeros(2 * count + 3)
    fx, skew, fy = matrix[0, 0] / sigma_px, matrix[0, 1] / sigma_px, matrix[1, 1] / sigma_px
    predicted_px = projected(rotation, translation_m, plane_m, matrix)
    for i in range(count):
        right, down = plane_m[i]
        x = rotation[0, 0] * right + rotation[0, 1] * down
        y = rotation[1, 0] * right + rotation[1, 1] * down
        z = rotation[2, 0] * right + rotation[2, 1] * down
        near = 1.0 / (z + translation_m[2])
        u, v = (x + translation_m[0]) * near, (y + translation_m[1]) * near
        x, y, z = x * near, y * near, z * near
        across = (-y * u, x * u + z, -y, near, 0.0, -near * u)
        along = (-y * v - z, x * v, x, 0.0, near, -near * v)
        for j in range(6):
            partial[2 * i, j] = fx * across[j] + skew * along[j]
            partial[2 * i + 1, j] = fy * along[j]
        for j in range(2):
            residual[2 * i + j] = (predicted_px[i, j] - corners_px[i, j]) / sigma_px
    if level_rad > 0.0:
        # The cross product of the gimbal's down and the plane's, which turns with the camera, should be zero.
        a, b, c = rotation[0, 1], rotation[1, 1], rotation[2, 1]
        d, e, f = down_in_camera
        crossed = (e * c - f * b, f * a - d * c, d * b - e * a)
        turning = ((e * b + f * c, -e * a, -f * a), (-d * b, f * c + d * a, -f * b), (-d * c, -e * c, d * a + e * b))
        for k in range(3):
            residual[2 * count + k] = crossed[k] / level_rad
            for j in range(3):
                partial[2 * count + k, j] = turning[k][j] / level_rad
    return partial, residual


@compiled
def _inverse_gram(partial: Array) -> tuple[Array, bool]:
    """(JᵀJ)⁻¹ of J (m,6) by its Cholesky factor, and whether there is one."""
    lower, inverse = np.zeros((6, 6)), np.zeros((6, 6))
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(len(partial)):
                total += partial[k, i] * partial[k, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > 0.0:
                    return inverse, False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    columns = np.zeros((6, 6))  # the factor's inverse
    for j in range(6):
        for i in range(j, 6):
            total = 1.0 if i == j else 0.0
            for k in range(j, i):
                total -= lower[i, k] * columns[k, j]
            columns[i, j] = total / lower[i, i]
    for i in range(6):
        for j in range(6):
            total = 0.0
            for k in range(max(i, j), 6):
                total += columns[k, i] * columns[k, j]
            inverse[i, j] = total
    return inverse, True


class GeometricVision:
    """Near vision without a picture, for a vehicle whose truth is known and whose camera has no distortion."""

    def __init__(
        self,
        truth_source: GroundTruthSource,
        cue: Cue,
        camera: Camera,
        parameters: GeometricParameters,
        near: VisionParameters,
        rng: np.random.Generator,
    ) -> None:
        self._truth_source, self._camera, self._near = truth_source, camera, near
        self._matrix = np.ascontiguousarray(camera.matrix)
        self._parameters = parameters
        self._least_facing = math.cos(math.radians(near.max_obliquity_deg))
        self._rng = rng
        self._tolerance, self._status_light = cue.manufacturing_tolerance, cue.status_light is not None
        self._plane_m = np.ascontiguousarray(cue.points_in_bar_m[:, 1:])
        border_px = parameters.border_px
        self._last: tuple[float, Pose] | None = None
        self._low_px = border_px
        self._high_px = np.array([camera.width_px - 1 - border_px, camera.height_px - 1 - border_px])

    def see(self, frame: Frame) -> Observation:
        """What near vision would make of the picture; never raises."""
        # Drawn for every frame, seen or not: the random numbers of later frames do not depend on this one's outcome.
        noise = self._rng.standard_normal(self._plane_m.shape)
        missed = self._rng.random() < self._parameters.miss_rate
        truth = self._truth_source.truth_at(frame.t_s if frame.stamp_s is None else frame.stamp_s)
        if truth is None:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_PICTURE.value)
        camera, bar = truth.ned_from_camera, truth.ned_from_bar
        rotation, sight_m = relative_pose(camera.rotation, camera.translation_m, bar.rotation, bar.translation_m)
        across_m, down_m, ahead_m = sight_m.tolist()
        range_m = math.hypot(across_m, down_m, ahead_m)
        if missed or range_m > self._parameters.max_range_m:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NOTHING_GREEN.value)
        a, b, c = rotation[:, 2].tolist()
        if a * across_m + b * down_m + c * ahead_m < self._least_facing * range_m:  # the board has no cue on its back
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.OUT_OF_REACH.value)
        sigma_px = self._parameters.corner_noise_px + self._parameters.corner_noise_px_per_m * range_m
        corners_px = projected(rotation, sight_m, self._plane_m, self._matrix) + sigma_px * noise
        if not inside(corners_px, self._low_px, self._high_px):
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.CUT_BY_FRAME.value)
        down, noise_rad = _down_in_camera(frame.gimbal), self._near.gimbal_noise_rad
        measured = CornerMeasurement(self._plane_m, self._matrix, corners_px, sigma_px, down, noise_rad)
        last = self._last if self._last is not None and 0.0 <= frame.t_s - self._last[0] <= self._near.track_s else None
        solutions = self._solved(rotation, sight_m, measured, None if last is None else last[1])
        quads_px = corners_px.reshape(-1, 4, 2)
        if not solutions:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_SOLUTION.value)
        bar_pose = bar_pose_of(solutions, quads_px)
        if solutions[0].level_off_rad > 0.0:
            return gimbal_off(frame, solutions[0].level_off_rad)
        refused = self._refused(solutions[0], bar_pose.reprojection_px, quads_px, sigma_px)
        if not refused and last is not None and jumps(bar_pose, last[1], frame.t_s - last[0], self._near):
            refused = Refusal.JUMP.value
        if refused:
            return Observation(frame.t_s, frame.gimbal, reason=refused)
        self._last = frame.t_s, solutions[0].camera_from_plane
        waves_off = self._status_light and truth.waves_off
        return Observation(frame.t_s, frame.gimbal, bar_pose=bar_pose, waves_off=waves_off)

    def _solved(
        self, rotation: Array, sight_m: Array, measured: CornerMeasurement, last: Pose | None
    ) -> list[Solution]:
        """What the solver makes of measured corners, the pose to take first."""
        held = _solution(rotation, sight_m, measured)
        prior = LevelPrior(measured.down_in_camera, measured.level_rad) if measured.level_rad > 0.0 else None
        if held is not None and held.chi2 < DOUBTFUL_CHI2 * measured.corners_px.size:
            free = None
            if prior is not None and held.chi2 > CONTRADICTION_CHI2:
                free = _solution(rotation, sight_m, measured._replace(level_rad=0.0))
            if prior is None or free is None or level_off(held, free, prior) == 0.0:
                return [held]
        quads_px, quads_m = measured.corners_px.reshape(-1, 4, 2), measured.plane_m.reshape(-1, 4, 2)
        corners = Corners(quads_px, np.broadcast_to(np.eye(8) / measured.sigma_px, (len(quads_px), 8, 8)), quads_m)
        return ordered(solve(corners, self._camera, prior, last), last)

    def _refused(self, taken: Solution, reprojection_px: float, quads_px: Array, sigma_px: float) -> str:
        """Why near vision would not believe a pose; empty where it would."""
        near = self._near
        if not reprojection_px <= largest_reprojection_px(quads_px, sigma_px, self._tolerance, near):
            return Refusal.REPROJECTION.value
        return "" if within_reach(taken.camera_from_plane, near) else Refusal.OUT_OF_REACH.value


def _solution(rotation: Array, sight_m: Array, measured: CornerMeasurement) -> Solution | None:
    """The pose that the solver would find; None when the corners do not settle one."""
    settled, turn, place_m, chi2, covariance, residual_px = pose_from_truth(rotation, sight_m, measured)
    if not settled:
        return None
    freedom = residual_px.size - 6 + (2 if measured.level_rad > 0.0 else 0)
    return Solution(Pose(turn, place_m), chi2, covariance, NO_COMMON_ERROR, residual_px.reshape(-1, 4, 2), freedom)


def _down_in_camera(gimbal: GimbalAttitude) -> Array:
    """(3,) the vertical as the gimbal has it."""
    c, s = math.cos(gimbal.pitch_rad), math.sin(gimbal.pitch_rad)
    return np.array([c * math.sin(gimbal.roll_rad), c * math.cos(gimbal.roll_rad), -s])


class _Detector:
    """One target's hits and errors."""

    def __init__(self, kind: str, errors: BoxErrors, parameters: BoxParameters) -> None:
        self.kind = kind
        self._errors = errors
        self._parameters = parameters
        self._hits: deque[bool] = deque(maxlen=parameters.confirm_frames)
        self._believed = False

    def see(self, sides: tuple[float, float, float, float] | None, range_m: float, draws: np.ndarray) -> Box | None:
        """The box with its errors, if it is found and believed; `draws` (4,) holds a uniform and three normals."""
        errors = self._errors
        miss = float(np.interp(range_m, errors.range_m, errors.miss_rate, right=1.0))
        found = sides is not None and draws[0] >= miss
        self._hits.append(found)
        if not any(self._hits):
            self._believed = False
        self._believed = self._believed or sum(self._hits) >= self._parameters.confirm_hits
        if sides is None or not found or not self._believed:
            return None
        left, top, right, bottom = sides
        centre = np.array([0.5 * (left + right) - 0.5, 0.5 * (top + bottom) - 0.5])
        centre += float(np.interp(range_m, errors.range_m, errors.centre_px)) * draws[1:3]
        scale = np.exp(0.5 * float(np.interp(range_m, errors.range_m, errors.area)) * draws[3])
        size = ((right - left) * scale, (bottom - top) * scale)
        return Box((float(centre[0]), float(centre[1])), (float(size[0]), float(size[1])), 1.0 - miss)


class Scenes(Protocol):
    """Source of the scenes that a camera saw."""

    def scene_at(self, t_s: float) -> SceneState | None:
        """The scene at an exposure [s]; None where it is not known."""


class GeometricFar:
    """Far vision without a picture, for a vehicle whose scene is known."""

    def __init__(
        self,
        scenes: Scenes,
        camera: Camera,
        rig: Rig,
        ship: BoxErrors,
        bar: BoxErrors,
        parameters: BoxParameters,
        rng: np.random.Generator,
    ) -> None:
        self._scenes, self._camera, self._rig, self._rng = scenes, camera, rig, rng
        self._parameters = parameters
        self._detectors = (_Detector("ship", ship, parameters), _Detector("bar", bar, parameters))

    def see(self, frame: Frame) -> Observation:
        """What the detectors would make of the picture; never raises."""
        draws = np.column_stack([self._rng.random(2), self._rng.normal(size=(2, 3))])
        scene = self._scenes.scene_at(frame.t_s if frame.stamp_s is None else frame.stamp_s)
        if scene is None:
            return Observation(frame.t_s, frame.gimbal, reason="far: no picture")
        boxes = []
        for detector, numbers in zip(self._detectors, draws, strict=True):
            target = scene.ned_from_bar if detector.kind == "bar" else scene.ned_from_ship
            range_m = float(np.linalg.norm(scene.ned_from_camera.translation_m - target.translation_m))
            visible, facing = self._parameters.least_visible, self._parameters.least_facing
            sides = target_box(detector.kind, scene, self._camera, self._rig, visible, facing)
            boxes.append(detector.see(sides, range_m, numbers))
        ship, bar = boxes
        reasons = [f"{name}: not found" for name, box in (("ship", ship), ("bar", bar)) if box is None]
        return Observation(frame.t_s, frame.gimbal, None, bar, ship, "; ".join(reasons))


LEAST_FACING = 0.5
"""Cosine of the angle at which a deck is seen most steeply."""
NORMAL_NOISE_RAD = 0.01
"""Standard deviation of the deck's attitude, each way.

Derived: a 0.30 m tag 1.2 m below, each corner off by 0.3 px; a radian of tilt moves one by 14.5 px.
"""


class GeometricDeck:
    """Sees the deck's centre where it is in the picture, for a vehicle whose truth is known."""

    def __init__(
        self, truth_source: GroundTruthSource, camera: Camera, errors: DeckErrors, rng: np.random.Generator
    ) -> None:
        self._truth_source, self._camera, self._errors, self._rng = truth_source, camera, errors, rng
        self._normal_rng = rng.spawn(1)[0]

    def see(self, frame: Frame) -> Observation:
        """What the look down would find; never raises."""
        noise_m = self._errors.noise_m * self._rng.standard_normal(3)
        tilted = NORMAL_NOISE_RAD * self._normal_rng.standard_normal(2)
        missed = self._rng.random() < self._errors.miss_rate
        truth = self._truth_source.truth_at(frame.t_s if frame.stamp_s is None else frame.stamp_s)
        if truth is None:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_PICTURE.value)
        nothing = Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_DECK.value)
        camera, deck = truth.ned_from_camera, truth.ned_from_deck
        sight_m = deck.translation_m - camera.translation_m
        in_camera_m = camera.rotation.T @ sight_m
        range_m = math.hypot(*sight_m.tolist())
        facing = float(deck.rotation[:, 2] @ sight_m) / max(range_m, 1e-9)
        if missed or not self._errors.least_m <= range_m <= self._errors.most_m or facing < LEAST_FACING:
            return nothing
        column_px, row_px = self._camera.project(in_camera_m[None, :])[0].tolist()
        if not (0.0 <= column_px < self._camera.width_px and 0.0 <= row_px < self._camera.height_px):
            return nothing
        # Levelled as the vision levels it: by what the gimbal says of itself, which errs.
        gimbal = frame.gimbal
        centre_m = level_from_camera(gimbal) @ in_camera_m + noise_m
        normal = level_from_camera(gimbal) @ camera.rotation.T @ deck.rotation[:, 2] + np.array([*tilted, 0.0])
        normal /= math.hypot(*normal.tolist())
        return Observation(frame.t_s, gimbal, deck=DeckSight(centre_m, np.full(3, self._errors.noise_m), normal))
