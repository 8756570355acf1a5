"""A film in which nothing moves: its pictures are one measurement, repeated.

What a sensor's noise moves from picture to picture averages out; what stays, as where pixels and compression lie on the
cue, does not. The scatter of the corners over the pictures says how much of their stated error is of the first kind.
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

_LEAST_LASTING = 0.2
"""Least share of the corners' variance that does not average out."""


@dataclass(frozen=True)
class Still:
    """The pictures since the cue last moved.

    Attributes:
        model: the cue's polygons that were seen.
        count: of pictures.
        mean_px: (k,n,2) their corners, undistorted, on average.
        square_px2: sum of their squared deviations from the average, over all coordinates.
    """

    model: tuple[int, ...]
    count: int
    mean_px: Array
    square_px2: float = 0.0

    @staticmethod
    def of(candidate: PoseCandidate, last: Still | None) -> Still:
        """With one more picture; it begins anew where the cue moved."""
        measured, model = candidate.measured, candidate.match.model
        if last is None or last.model != model or not last.agrees(measured):
            return Still(model, 1, measured.corners_px)
        count = last.count + 1
        off_px = measured.corners_px - last.mean_px
        more_px2 = float(np.vdot(off_px, off_px)) * last.count / count
        return Still(model, count, last.mean_px + off_px / count, last.square_px2 + more_px2)

    def agrees(self, measured: MeasuredCorners) -> bool:
        """Whether corners are where they were, but for their errors."""
        off_px = measured.corners_px - self.mean_px
        corners = off_px.size // 2
        noise_px = measured.noise_px
        whole_px, each_px = math.hypot(*off_px.mean(axis=(0, 1))), math.sqrt(float(np.vdot(off_px, off_px)) / corners)
        return (
            whole_px <= _STILL_PX + _STILL_SIGMAS * noise_px / math.sqrt(corners)
            and each_px <= _STILL_PX + _STILL_SIGMAS * noise_px
        )

    def fused(self, candidate: PoseCandidate, known: Known) -> PoseCandidate:
        """The pose of all pictures together; the last one's where it cannot be had."""
        measured = candidate.measured
        if self.count < 2 or measured.hidden is not None:
            return candidate
        scatter_px2 = self.square_px2 / ((self.count - 1) * self.mean_px.size)
        scattered = min(scatter_px2 / max(measured.noise_px**2, 1e-9), 1.0 - _LEAST_LASTING)
        left = 1.0 - scattered + scattered / self.count
        together = replace(
            measured,
            corners_px=self.mean_px,
            whiten=measured.whiten / math.sqrt(left),
            noise_px=measured.noise_px * math.sqrt(left),
        )
        return solve_pose(candidate.match, together, candidate.setup, known) or candidate
