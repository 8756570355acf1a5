"""The choice among the hypotheses of one picture: whole cues first, then parts of one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.vision.near.associate import Match, match_by_geometry, match_by_prediction
from shipland.vision.near.edge_pixels import distort
from shipland.vision.near.gates import Refusal
from shipland.vision.near.pose import PoseCandidate, Setup
from shipland.vision.near.segment import Region, is_cut_quad
from shipland.vision.near.validate import explains_absence

_MOST_POSED = 8
"""Hypotheses in one picture whose rough pose is looked at; each takes a tenth of a millisecond."""

_MOST_MEASURED = 2
"""Hypotheses that are measured in one picture; each takes about a millisecond."""

_ROUGH_PX, _ROUGH = 3.0, 0.06
"""Largest reprojection error, root mean square, of a rough pose: in pixels, and as a share of the hypothesis's extent
besides."""

_NUDGE_PX = 1e-3
"""What corners are moved by for a rough pose."""

_LENS_PX = 0.05
"""How far off a pixel its undistorted place may be shown."""

_LIKE_SIZE = 2.0
"""Ratio of areas up to which two quadrilaterals may belong together."""


@dataclass(frozen=True)
class Choice:
    """The hypotheses of one picture, and what they are chosen by.

    Attributes:
        pose_of: a hypothesis's pose, or why it has none.
        setup: cue, camera, parameters.
        predicted_px: (n,4,2) the cue's corners by the last pose, or None.
        cut: regions that the picture's edge cuts.
    """

    pose_of: Callable[[Match], PoseCandidate | Refusal]
    setup: Setup
    predicted_px: Array | None
    cut: list[Region]

    def cue_among(self, quads: list[Array], *, parts: bool) -> PoseCandidate | Refusal:
        """Whole cues first, where the last pose predicts them and then anywhere; then parts in the same order.

        Args:
            quads: (4,2) corners [px] each, of the picture's quadrilaterals.
            parts: whether a cue that is not whole will do.
        """
        if not quads:
            return self._cut_or(Refusal.NO_QUADRILATERAL)
        setup = self.setup
        quads_px = _undistorted(np.stack(quads), setup.camera)
        count = len(setup.plane_m)
        predicted = None if self.predicted_px is None else match_by_prediction(quads_px, self.predicted_px)
        refusal = Refusal.NO_MATCH
        if predicted is not None and len(predicted.model) == count:
            result = self.pose_of(predicted)
            if isinstance(result, PoseCandidate):
                return result
            refusal = result
        hypotheses = match_by_geometry(quads_px, setup.plane_m, math.radians(setup.parameters.max_roll_deg))
        found, why = self._poses_of([match for match in hypotheses if len(match.model) == count])
        if found:
            return self._one_of(found)
        if not parts:
            return why or refusal
        if predicted is not None and len(predicted.model) < count:
            result = self.pose_of(predicted)
            if isinstance(result, PoseCandidate):
                return result
        some = [match for match in hypotheses if len(match.model) < count and (self.cut or len(match.model) > 1)]
        refused = why or refusal
        part = self._part_of(some, quads_px)
        return part or (refused if refused in (Refusal.REPROJECTION, Refusal.BLOOM) else self._cut_or(refused))

    def _poses_of(self, hypotheses: list[Match]) -> tuple[list[PoseCandidate], Refusal | None]:
        """Poses, and the first reason among the others; a quadrilateral that a pose uses is not used again."""
        found: list[PoseCandidate] = []
        refusal: Refusal | None = None
        used: set[int] = set()
        plausible = [match for match in hypotheses[:_MOST_POSED] if rough_poses(match, self.setup)]
        for match in plausible[:_MOST_MEASURED]:
            if used.intersection(match.candidates):
                continue
            result = self.pose_of(match)
            if isinstance(result, PoseCandidate):
                found.append(result)
                used.update(match.candidates)
            elif refusal is None:
                refusal = result
        return found, refusal

    def _one_of(self, found: list[PoseCandidate]) -> PoseCandidate | Refusal:
        """Of several whole cues the one that the last pose predicts, else the nearest."""
        if len(found) == 1:
            return found[0]
        if self.predicted_px is not None:
            wanted = self.predicted_px.mean(axis=(0, 1))
            return min(found, key=lambda candidate: math.dist(candidate.corners_px.mean(axis=(0, 1)), wanted))
        if self.setup.parameters.several_cues == "refuse":
            return Refusal.AMBIGUOUS
        return min(found, key=lambda candidate: candidate.distance_m)

    def _part_of(self, hypotheses: list[Match], quads_px: Array) -> PoseCandidate | Refusal | None:
        """A cue that is not whole: the one hypothesis that explains what is missing; None when there is none."""
        area_px2 = np.array([cv2.contourArea(quad.astype(np.float32)) for quad in quads_px])
        alone = [match for match in hypotheses if not _in_company(match, area_px2)]
        explained = [match for match in alone[:_MOST_POSED] if self._may_be_cut(match)]
        results = [self.pose_of(match) for match in explained[:_MOST_MEASURED]]
        proven = [
            result
            for result in results
            if isinstance(result, PoseCandidate)
            and explains_absence(self.setup, result.camera_from_plane, result.match.model, self.cut)
        ]
        most = max((len(candidate.match.model) for candidate in proven), default=0)
        best = [candidate for candidate in proven if len(candidate.match.model) == most]
        return (best[0] if len(best) == 1 else Refusal.AMBIGUOUS) if best else None

    def _may_be_cut(self, match: Match) -> bool:
        """Whether the picture's edge may explain what a hypothesis lacks."""
        poses = rough_poses(match, self.setup)
        return any(explains_absence(self.setup, pose, match.model, self.cut) for pose in poses)

    def _cut_or(self, refusal: Refusal) -> Refusal:
        """That the cue is cut, where a cut region could be a part of one; else another reason."""
        return Refusal.CUT_BY_FRAME if any(is_cut_quad(region) for region in self.cut) else refusal


def _undistorted(quads_px: Array, camera: Camera) -> Array:
    """Polygons (m,k,2) [px] as a distortion-free camera would see them, without those where the lens has no inverse.

    The polynomials of a calibration may fold back outside of the part of the picture that they were fitted to.
    """
    shown_px = quads_px.reshape(-1, 2)
    straight_px = camera.undistort(shown_px)
    with np.errstate(invalid="ignore", over="ignore"):
        known = np.abs(distort(straight_px, camera) - shown_px) <= _LENS_PX
    return straight_px.reshape(quads_px.shape)[known.reshape(len(quads_px), -1).all(axis=1)]


def rough_poses(match: Match, setup: Setup) -> list[Pose]:
    """The planar poses that a hypothesis's corners, known to two pixels, may have; none where it is no view of the cue.

    A hidden side moves two corners by a tenth of the cue's extent at most.
    """
    plane_m = setup.plane_m[list(match.model)].reshape(-1, 2)
    points_px = match.quads_px.reshape(-1, 1, 2)
    # OpenCV's IPPE divides zero by zero on exact pixels of some symmetrical views.
    points_px = points_px + _NUDGE_PX * np.sin(np.arange(points_px.size)).reshape(points_px.shape)
    places = np.column_stack([plane_m, np.zeros(len(plane_m))])
    try:
        _, turns, shifts, errors_px = cv2.solvePnPGeneric(
            places, points_px, setup.camera.matrix, None, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:  # a homography that does not exist
        return []
    most_px = _ROUGH_PX + _ROUGH * math.hypot(*np.ptp(points_px[:, 0], axis=0))
    return [
        Pose(np.asarray(cv2.Rodrigues(turn)[0], float), np.asarray(shift, float).ravel())
        for turn, shift, error_px in zip(turns, shifts, errors_px.ravel(), strict=True)
        if error_px <= most_px and shift[2] > 0.0
    ]


def _in_company(match: Match, area_px2: Array) -> bool:
    """Whether a quadrilateral that the hypothesis does not use is as large as one that it uses, within a factor.

    Another whole quadrilateral of like size belongs to a row of them, not to a cue that is cut.
    """
    used = area_px2[list(match.candidates)]
    others = np.delete(area_px2, match.candidates)
    ratio = others[:, None] / np.maximum(used, 1e-9)
    return bool(np.any((ratio > 1.0 / _LIKE_SIZE) & (ratio < _LIKE_SIZE)))
