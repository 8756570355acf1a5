"""The truth between cycles, and the pilot's estimate beside the truth of the estimate's own time."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

from scipy.spatial.transform import Rotation

from shipland.frames import Pose
from shipland.messages import Estimate, FlightRecord, GroundTruth

_KEPT_S = 2.0
"""Time for which moments are kept: longer than a pilot's prediction and a detector's cycle."""


class Moments:
    """The estimates and truths of the last two seconds."""

    def __init__(self) -> None:
        self._estimates: deque[Estimate] = deque()
        self._truths: deque[GroundTruth] = deque()
        self._has_estimate = False

    def note(self, record: FlightRecord) -> None:
        """Take a cycle."""
        estimate = record.decision.estimate
        self._has_estimate = estimate is not None
        if estimate is not None:
            self._estimates.append(estimate)
            while self._estimates[0].t_s < estimate.t_s - _KEPT_S:
                self._estimates.popleft()
        if record.truth is not None:
            self.note_truth(record.truth)

    def note_truth(self, truth: GroundTruth) -> None:
        """Take a truth; one already taken changes nothing."""
        if not self._truths or truth.t_s > self._truths[-1].t_s:
            self._truths.append(truth)
            while self._truths[0].t_s < truth.t_s - _KEPT_S:
                self._truths.popleft()

    def at(self, t_s: float, truth: GroundTruth | None) -> tuple[Estimate | None, GroundTruth | None]:
        """The newest estimate whose time has come by `t_s` with the truth of that time; else None and `truth`."""
        due = [item for item in self._estimates if t_s - _KEPT_S < item.t_s <= t_s + 1e-6]
        if not self._has_estimate or not due:
            return None, truth
        estimate = max(due, key=lambda item: item.t_s)
        return estimate, self._truth_at(estimate.t_s)

    def _truth_at(self, t_s: float) -> GroundTruth | None:
        for before, after in pairwise(self._truths):
            if before.t_s - 1e-6 <= t_s <= after.t_s + 1e-6:
                return between(before, after, t_s)
        return next((truth for truth in self._truths if abs(truth.t_s - t_s) <= 1e-6), None)


def between(before: GroundTruth, after: GroundTruth, t_s: float) -> GroundTruth:
    """The truth at a time between two, or nearest to it: places by line, turns by the shortest arc."""
    span_s = after.t_s - before.t_s
    share = 0.0 if span_s <= 0.0 else min(1.0, max(0.0, (t_s - before.t_s) / span_s))

    def pose(first: Pose, last: Pose) -> Pose:
        turn = Rotation.from_matrix(first.rotation.T @ last.rotation).as_rotvec()
        rotation = first.rotation @ Rotation.from_rotvec(share * turn).as_matrix()
        return Pose(rotation, first.translation_m + share * (last.translation_m - first.translation_m))

    return GroundTruth(
        t_s=before.t_s + share * span_s,
        ned_from_body=pose(before.ned_from_body, after.ned_from_body),
        velocity_in_ned_mps=before.velocity_in_ned_mps
        + share * (after.velocity_in_ned_mps - before.velocity_in_ned_mps),
        ned_from_ship=pose(before.ned_from_ship, after.ned_from_ship),
        ned_from_deck=pose(before.ned_from_deck, after.ned_from_deck),
        ned_from_bar=pose(before.ned_from_bar, after.ned_from_bar),
        ned_from_camera=pose(before.ned_from_camera, after.ned_from_camera),
        wind_in_ned_mps=before.wind_in_ned_mps + share * (after.wind_in_ned_mps - before.wind_in_ned_mps),
    )
