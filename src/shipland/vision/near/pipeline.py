"""The near chain, a frame in and an observation out: segment → associate → edges → pose → validate.

A cue that was seen is looked for around its predicted place first, then in the whole picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.cue import Cue
from shipland.frames import Array
from shipland.messages import Frame, GimbalAttitude, Observation
from shipland.vision.near.associate import Match
from shipland.vision.near.choice import Choice
from shipland.vision.near.edges import MeasuredCorners, measure_corners
from shipland.vision.near.gates import Refusal, gimbal_off, jumps
from shipland.vision.near.hidden import cut_sides, hidden_sides, without
from shipland.vision.near.planar_pose import LevelPrior
from shipland.vision.near.pose import Known, PoseCandidate, Setup, solve_pose
from shipland.vision.near.regions import find_regions
from shipland.vision.near.segment import Image, QuadsOf, RegionsOf, Window, find_quads, joined_quads, segment
from shipland.vision.near.status_light import is_red
from shipland.vision.near.still import Still
from shipland.vision.near.strokes import measure_strokes, stroke_polygons
from shipland.vision.near.track import Track, window_around
from shipland.vision.near.validate import Screen, corners_are_sharp, validate
from shipland.vision.parameters import VisionParameters

MeasureCorners = Callable[[Image, Array, Camera, VisionParameters, float | None], MeasuredCorners | None]
"""Image, corners (n,4,2) to within two pixels, camera, parameters, blur of the last picture: corners at sub-pixel."""


@dataclass(frozen=True)
class Steps:
    """The steps in which our chain and the published one differ.

    Attributes:
        regions_of: finds the regions of the cue's colour.
        quads_of: finds quadrilaterals among them.
        measure: measures their corners at sub-pixel.
        screen: a further test of the pose's sides.
        screen_corners: the same of corners (k,4,2) [px] before their pose is solved.
        parts: whether a cue that is not whole will do.
    """

    regions_of: RegionsOf = find_regions
    quads_of: QuadsOf = find_quads
    measure: MeasureCorners = measure_corners
    screen: Screen = lambda _: True
    screen_corners: Callable[[Array], Refusal | None] = lambda _: None
    parts: bool = True


class NearVision:
    """Sees one cue with one camera; holds the last pose to look near it first and to choose by continuity.

    Args:
        cue: what is looked for.
        camera: of the pictures.
        parameters: of the chain.
        steps: of another chain.
        fuse: pictures in which the cue does not move count together, as in a film that was made for measuring.
    """

    def __init__(
        self,
        cue: Cue,
        camera: Camera,
        parameters: VisionParameters,
        steps: Steps | None = None,
        *,
        fuse: bool = False,
    ) -> None:
        self._setup, self._steps, self._fuse = Setup.of(cue, camera, parameters), steps or Steps(), fuse
        self._status_light = cue.status_light
        self._track: Track | None = None
        self._still: Still | None = None

    def reset(self) -> None:
        """Forget the last pose: the next frame is searched whole."""
        self._track = self._still = None

    def see(self, frame: Frame) -> Observation:
        """The cue's pose in one frame, or the reason why there is none (`Refusal`).

        A cue hangs level. Where it contradicts the gimbal it is followed and its pose is refused: the pilot uses a pose
        together with the gimbal's attitude.
        """
        found = self._find(frame)
        if isinstance(found, Refusal):
            return Observation(frame.t_s, frame.gimbal, reason=found.value)
        if found.level_off_rad > 0.0:
            return gimbal_off(frame, found.level_off_rad)
        waves_off, light = False, self._status_light
        if light is not None and frame.image is not None:
            waves_off = is_red(frame.image, self._setup.camera, found.camera_from_plane, light)
        return Observation(frame.t_s, frame.gimbal, bar_pose=found.bar_pose, waves_off=waves_off)

    def _find(self, frame: Frame) -> PoseCandidate | Refusal:
        setup, image, t_s = self._setup, frame.image, frame.t_s
        if image is None:
            return Refusal.NO_PICTURE
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            return Refusal.BAD_PICTURE
        if image.shape[:2] != (setup.camera.height_px, setup.camera.width_px):
            return Refusal.WRONG_SIZE
        track = self._track if self._track is not None and self._track.holds(t_s, setup) else None
        level = _level(frame.gimbal, setup.parameters.gimbal_noise_rad)
        known = Known(level) if track is None else track.known(t_s, level)
        found: PoseCandidate | Refusal = Refusal.NO_MATCH
        if known.predicted_px is not None:
            found = self._look(image, window_around(known.predicted_px, setup), known, parts=False)
        if isinstance(found, Refusal):
            found = self._look(image, Window.whole(image), known, parts=self._steps.parts)
        if isinstance(found, Refusal):
            return found
        if track is not None and jumps(found.bar_pose, track.camera_from_plane, t_s - track.t_s, setup.parameters):
            return Refusal.JUMP
        self._track = Track.of(found, t_s, track)
        if self._fuse:
            self._still = Still.of(found, None if track is None else self._still)
            return self._still.fused(found, known)
        return found

    def _look(self, image: Image, window: Window, known: Known, *, parts: bool) -> PoseCandidate | Refusal:
        """The cue in a part of the picture; `parts` says whether a cue that is not whole will do."""
        steps, parameters = self._steps, self._setup.parameters
        if window.empty:
            return Refusal.NOTHING_GREEN
        regions = steps.regions_of(image, window, parameters, self._setup.hue, len(self._setup.plane_m))
        if not (regions or self._setup.strokes):
            return Refusal.NOTHING_GREEN
        segments = segment(image, regions, parameters, self._setup.plane_m.shape[1], steps.quads_of)
        choice = Choice(partial(self._pose_of, image, known), self._setup, known.predicted_px, segments.cut)
        result = choice.cue_among(segments.quads, parts=parts)
        if isinstance(result, Refusal) and self._setup.strokes:
            strokes = stroke_polygons(image, window, parameters, self._setup.hue, self._setup.plane_m)
            narrow = choice.cue_among(strokes, parts=False)
            return narrow if isinstance(narrow, PoseCandidate) or result is Refusal.NO_QUADRILATERAL else result
        if not (isinstance(result, Refusal) and parts):
            return result
        joined = [] if self._setup.strokes else joined_quads(segments.quads, parameters.min_side_px)
        for more in (segments.flush, joined):
            if more:
                other = choice.cue_among(segments.quads + more, parts=parts)
                if isinstance(other, PoseCandidate):
                    return other
        return result

    def _pose_of(self, image: Image, known: Known, match: Match) -> PoseCandidate | Refusal:
        """One hypothesis through edges, pose and validation."""
        setup, steps = self._setup, self._steps
        measured = steps.measure(image, match.quads_px, setup.camera, setup.parameters, known.blur_px)
        if measured is None or not corners_are_sharp(measured, setup.parameters):
            plane_m = setup.plane_m[list(match.model)]
            measured = measure_strokes(image, match.quads_px, plane_m, setup.camera) if setup.strokes else None
            if measured is None:
                return Refusal.CORNERS_UNSURE
        screened = steps.screen_corners(measured.corners_px)
        if screened is not None:
            return screened
        candidate = solve_pose(match, measured, setup, known)
        if candidate is None:
            return Refusal.NO_SOLUTION
        refusal = validate(candidate, steps.screen)
        some = hidden_sides(candidate) if refusal in (Refusal.REPROJECTION, Refusal.BLOOM) else []
        for hidden in some + (cut_sides(candidate) if refusal is not None else []):
            rest = solve_pose(match, without(measured, hidden), setup, known)
            if rest is not None and validate(rest, steps.screen) is None:
                return rest
        return refusal or candidate


def _level(gimbal: GimbalAttitude, noise_rad: float) -> LevelPrior | None:
    """The gimbal's vertical; None without a finite attitude, or where the noise is 0, which leaves the gimbal out."""
    if noise_rad <= 0.0 or not (math.isfinite(gimbal.roll_rad) and math.isfinite(gimbal.pitch_rad)):
        return None
    level = level_from_camera(GimbalAttitude(gimbal.roll_rad, gimbal.pitch_rad))
    return LevelPrior(level[2].copy(), noise_rad)
