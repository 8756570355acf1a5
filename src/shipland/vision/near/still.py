"""A film in which nothing moves: its pictures are one measurement, repeated.

What a sensor's noise moves from picture to picture averages out; what stays, as where pixels and compression lie on the
cue, does not. The scatter of the corners over the pictures says how much of their stated error is of the first kind.
What seems to stand still may creep, by less than one picture's noise: the last pictures are taken, and their corners
along a straight line in time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shipland.frames import Array
from shipland.vision.near.edges import MeasuredCorners
from shipland.vision.near.pose import Known, PoseCandidate, solve_pose

_STILL_SIGMAS, _STILL_PX = 4.0, 0.05
"""Standard deviations, and pixels besides, that the cue as a whole, and its corners, root mean square, may differ by
from what the earlier pictures show on average."""

_MOST_PICTURES = 12
"""Pictures that count together: over more of them a camera in the hand leaves a straight line."""

_LEAST_LASTING = 0.2
"""Least share of the corners' variance that does not average out."""


@dataclass(frozen=True)
class Still:
    """The last pictures, since the cue moved.

    Attributes:
        model: the cue's polygons that were seen.
        shown_px: (m,k,n,2) their corners, undistorted, picture by picture.
    """

    model: tuple[int, ...]
    shown_px: Array

    @staticmethod
    def of(candidate: PoseCandidate, last: Still | None) -> Still:
        """With one more picture; it begins anew where the cue moved."""
        measured, model = candidate.measured, candidate.match.model
        shown_px = measured.corners_px[None]
        if last is not None and last.model == model and last.agrees(measured):
            shown_px = np.concatenate([last.shown_px[1 - _MOST_PICTURES :], shown_px])
        return Still(model, shown_px)

    def agrees(self, measured: MeasuredCorners) -> bool:
        """Whether corners are where they were, but for their errors."""
        off_px = measured.corners_px - self.shown_px.mean(axis=0)
        corners = off_px.size // 2
        noise_px = measured.noise_px
        whole_px, each_px = math.hypot(*off_px.mean(axis=(0, 1))), math.sqrt(float(np.vdot(off_px, off_px)) / corners)
        return (
            whole_px <= _STILL_PX + _STILL_SIGMAS * noise_px / math.sqrt(corners)
            and each_px <= _STILL_PX + _STILL_SIGMAS * noise_px
        )

    def fused(self, candidate: PoseCandidate, known: Known) -> PoseCandidate:
        """The pose of all pictures together at the last one; the last one's where it cannot be had."""
        measured, count = candidate.measured, len(self.shown_px)
        if count < 3 or measured.hidden is not None:
            return candidate
        before = np.column_stack([np.ones(count), np.arange(1 - count, 1)])
        line_px, square_px2, *_ = np.linalg.lstsq(before, self.shown_px.reshape(count, -1), rcond=None)
        scatter_px2 = float(square_px2.mean()) / (count - 2)
        scattered = min(scatter_px2 / max(measured.noise_px**2, 1e-9), 1.0 - _LEAST_LASTING)
        left = 1.0 - scattered + scattered * (4.0 * count - 2.0) / (count * (count + 1.0))  # of a line's end
        together = replace(
            measured,
            corners_px=line_px[0].reshape(measured.corners_px.shape),
            whiten=measured.whiten / math.sqrt(left),
            noise_px=measured.noise_px * math.sqrt(left),
        )
        return solve_pose(candidate.match, together, candidate.setup, known) or candidate
