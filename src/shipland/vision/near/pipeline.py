"""The near chain: a frame in, an observation out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.frames import Array, Pose
from shipland.messages import Frame, GimbalAttitude, Observation
from shipland.rig import Target
from shipland.vision.near.candidate import Evidence, Judge, PoseCandidate, jumps
from shipland.vision.near.matching import Match, match_by_geometry, match_by_prediction
from shipland.vision.near.parameters import VisionParameters
from shipland.vision.near.pose import LevelPrior
from shipland.vision.near.refusal import Refusal, gimbal_off
from shipland.vision.near.regions import Window, adapted, coloured_window, find_quads, find_regions, is_cut_quad
from shipland.vision.near.rows import Followed

__all__ = ["NearVision", "Refusal", "VisionParameters"]

_MOST_JUDGED = 8
"""Hypotheses that are measured in one picture; each takes about a millisecond."""


_LIKE_SIZE = 2.0
"""Ratio of areas up to which two quadrilaterals are thought to belong together."""


@dataclass(frozen=True)
class _Track:
    """The last pose: when, where its corners were (n,4,2), how fast they moved (2,), how blurred the picture was.

    And its corners as measured (n,4,2), undistorted, where all of the cue was seen.
    """

    t_s: float
    camera_from_plane: Pose
    corners_px: Array
    drift_px_s: Array
    blur_px: float | None
    measured_px: Array | None


def _cut_or(refusal: Refusal, evidence: Evidence) -> Refusal:
    """That the cue is cut, where what the picture's edge cuts could be part of one; else another reason."""
    return Refusal.CUT_BY_FRAME if any(is_cut_quad(region) for region in evidence.cut) else refusal


def _in_company(match: Match, area_px2: Array) -> bool:
    """Whether a quadrilateral that the hypothesis does not use is as large as one that it uses, within a factor."""
    used = area_px2[list(match.candidates)]
    others = np.delete(area_px2, match.candidates)
    ratio = others[:, None] / np.maximum(used, 1e-9)
    return bool(np.any((ratio > 1.0 / _LIKE_SIZE) & (ratio < _LIKE_SIZE)))


class NearVision:
    """Sees one cue with one camera; holds the last pose to look near it first and to choose by continuity."""

    def __init__(self, target: Target, camera: Camera, parameters: VisionParameters) -> None:
        self._judge = Judge(target, camera, parameters)
        self._camera = camera
        self._parameters = parameters
        self._max_roll_rad = math.radians(parameters.max_roll_deg)
        self._track: _Track | None = None

    def reset(self) -> None:
        """Forget the last pose: the next frame is searched whole."""
        self._track = None

    def see(self, frame: Frame) -> Observation:
        """The cue's pose in one frame, or the reason why there is none (`Refusal`).

        A cue hangs level: where it contradicts the gimbal it is followed, and its pose is refused, because whoever
        takes that further also takes the gimbal at its word.
        """
        found = self._find(frame)
        if isinstance(found, Refusal):
            return Observation(frame.t_s, frame.gimbal, reason=found.value)
        if found.level_off_rad > 0.0:
            return gimbal_off(frame, found.level_off_rad)
        return Observation(frame.t_s, frame.gimbal, bar_pose=found.bar_pose)

    def _find(self, frame: Frame) -> PoseCandidate | Refusal:
        image = frame.image
        if image is None:
            return Refusal.NO_PICTURE
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            return Refusal.BAD_PICTURE
        if image.shape[:2] != (self._camera.height_px, self._camera.width_px):
            return Refusal.WRONG_SIZE
        predicted_px = self._predicted_px(frame.t_s)
        track = None if predicted_px is None else self._track
        last, blur_px = (None, None) if track is None else (track.camera_from_plane, track.blur_px)
        followed = None
        if track is not None and track.measured_px is not None and frame.t_s > track.t_s:
            followed = Followed(track.measured_px, frame.t_s - track.t_s)
        evidence = Evidence(image, (), self._prior(frame.gimbal), last, blur_px, followed)
        found: PoseCandidate | Refusal = Refusal.NO_MATCH
        if predicted_px is not None:
            found = self._look(self._around(predicted_px), predicted_px, evidence, self._parameters, parts=False)
        if isinstance(found, Refusal):
            found = self._search(predicted_px, evidence, self._parameters)
        if isinstance(found, Refusal) and self._parameters.adaptive:
            again = self._search(predicted_px, evidence, adapted(image, self._parameters))
            found = again if isinstance(again, PoseCandidate) else found
        if isinstance(found, PoseCandidate):
            since = None if track is None else (track.camera_from_plane, frame.t_s - track.t_s)
            if since is not None and jumps(found.bar_pose, *since, self._parameters):
                return Refusal.JUMP
            self._remember(frame.t_s, found)
        return found

    def _search(
        self, predicted_px: Array | None, evidence: Evidence, parameters: VisionParameters
    ) -> PoseCandidate | Refusal:
        """The cue in the whole picture, through the gate of `parameters`."""
        window = coloured_window(evidence.image, parameters)
        return self._look(window, predicted_px, evidence, parameters, parts=True)

    def _look(
        self,
        window: Window,
        predicted_px: Array | None,
        evidence: Evidence,
        parameters: VisionParameters,
        *,
        parts: bool,
    ) -> PoseCandidate | Refusal:
        """The cue in a part of the picture; `parts` says whether a cue that is not whole will do."""
        if window.empty:
            return Refusal.NOTHING_GREEN
        regions = find_regions(evidence.image, window, parameters)
        if not regions:
            return Refusal.NOTHING_GREEN
        found = find_quads(evidence.image, regions, parameters)
        evidence = replace(evidence, cut=found.cut)
        result = self._match(found.quads, predicted_px, evidence, parts)
        if isinstance(result, Refusal) and parts and found.flush:
            flush = self._match(found.quads + found.flush, predicted_px, evidence, parts)
            return flush if isinstance(flush, PoseCandidate) else result
        return result

    def _match(
        self, quads: list[Array], predicted_px: Array | None, evidence: Evidence, parts: bool
    ) -> PoseCandidate | Refusal:
        """Whole cues first, where the last pose foresees them and then anywhere; then parts in the same order."""
        if not quads:
            return _cut_or(Refusal.NO_QUADRILATERAL, evidence)
        quads_px = self._camera.undistort(np.concatenate(quads)).reshape(-1, 4, 2)
        count = len(self._judge.plane_m)
        followed = None if predicted_px is None else match_by_prediction(quads_px, predicted_px)
        refusal = Refusal.NO_MATCH
        if followed is not None and len(followed.model) == count:
            result = self._judge.judge(followed, evidence)
            if isinstance(result, PoseCandidate):
                return result
            refusal = result
        hypotheses = match_by_geometry(quads_px, self._judge.plane_m, self._max_roll_rad)
        found, why = self._judged([match for match in hypotheses if len(match.model) == count], evidence)
        if found:
            return self._one_of(found, predicted_px)
        if not parts:
            return why or refusal
        if followed is not None and len(followed.model) < count:
            result = self._judge.judge(followed, evidence)
            if isinstance(result, PoseCandidate):
                return result
        some = [match for match in hypotheses if len(match.model) < count and (evidence.cut or len(match.model) > 1)]
        return self._part(some, quads_px, evidence) or why or _cut_or(refusal, evidence)

    def _one_of(self, found: list[PoseCandidate], predicted_px: Array | None) -> PoseCandidate | Refusal:
        """Of several whole cues the one that the last pose foresees, else the nearest."""
        if len(found) == 1:
            return found[0]
        if predicted_px is not None:
            wanted = predicted_px.mean(axis=(0, 1))
            return min(found, key=lambda sighting: math.dist(sighting.corners_px.mean(axis=(0, 1)), wanted))
        if self._parameters.several_cues == "refuse":
            return Refusal.AMBIGUOUS
        return min(found, key=lambda sighting: sighting.distance_m)

    def _part(self, hypotheses: list[Match], quads_px: Array, evidence: Evidence) -> PoseCandidate | Refusal | None:
        """A cue that is not whole: the one hypothesis that explains what is missing; None when there is none.

        Another whole quadrilateral of like size tells of a row of them, not of the cue.
        """
        area_px2 = np.array([cv2.contourArea(quad.astype(np.float32)) for quad in quads_px])
        hypotheses = [match for match in hypotheses if not _in_company(match, area_px2)]
        sightings = [self._judge.judge(match, evidence) for match in hypotheses[:_MOST_JUDGED]]
        proven = [
            sighting
            for sighting in sightings
            if isinstance(sighting, PoseCandidate) and self._judge.explains_absence(sighting, evidence.cut)
        ]
        if not proven:
            return None
        most = max(len(sighting.match.model) for sighting in proven)
        best = [sighting for sighting in proven if len(sighting.match.model) == most]
        return best[0] if len(best) == 1 else Refusal.AMBIGUOUS

    def _judged(self, hypotheses: list[Match], evidence: Evidence) -> tuple[list[PoseCandidate], Refusal | None]:
        """Sightings, and why the first of the others is none; what a sighting uses is not used again."""
        found: list[PoseCandidate] = []
        refusal: Refusal | None = None
        used: set[int] = set()
        for match in hypotheses[:_MOST_JUDGED]:
            if used.intersection(match.candidates):
                continue
            result = self._judge.judge(match, evidence)
            if isinstance(result, PoseCandidate):
                found.append(result)
                used.update(match.candidates)
            elif refusal is None:
                refusal = result
        return found, refusal

    def _prior(self, gimbal: GimbalAttitude) -> LevelPrior | None:
        noise_rad = self._parameters.gimbal_noise_rad
        if noise_rad <= 0.0 or not (math.isfinite(gimbal.roll_rad) and math.isfinite(gimbal.pitch_rad)):
            return None
        level = level_from_camera(GimbalAttitude(gimbal.roll_rad, gimbal.pitch_rad))
        return LevelPrior(level[2].copy(), noise_rad)

    def _predicted_px(self, t_s: float) -> Array | None:
        track = self._track
        if track is None or not 0.0 <= t_s - track.t_s <= self._parameters.track_s:
            return None
        predicted_px = track.corners_px + track.drift_px_s * (t_s - track.t_s)
        return predicted_px if np.isfinite(predicted_px).all() else None

    def _around(self, predicted_px: Array) -> Window:
        points_px = predicted_px.reshape(-1, 2)
        margin_px = np.maximum(
            self._parameters.track_margin_px, self._parameters.track_margin * np.ptp(points_px, axis=0)
        )
        return Window.around(points_px, margin_px, self._camera.width_px, self._camera.height_px)

    def _remember(self, t_s: float, sighting: PoseCandidate) -> None:
        pose, last = sighting.camera_from_plane, self._track
        whole = len(sighting.match.model) == len(self._judge.plane_m)
        corners_px = sighting.corners_px if whole else self._judge.projected_px(pose)
        if not (math.isfinite(t_s) and np.isfinite(corners_px).all()):
            self._track = None
            return
        drift_px_s = np.zeros(2)
        if last is not None and 0.0 < t_s - last.t_s <= self._parameters.track_s:
            drift_px_s = (corners_px - last.corners_px).mean(axis=(0, 1)) / (t_s - last.t_s)
        measured_px = sighting.measured_px if whole else None
        self._track = _Track(t_s, pose, corners_px, drift_px_s, sighting.blur_px, measured_px)
