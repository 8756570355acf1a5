"""The search for one kind of target: candidates over whole frames, then the one that is believed, in tiles.

A whole frame is searched until a candidate convinces, and again from time to time: a believed target is replaced by a
rival with a higher score. The horizon is known from the gimbal; what stands above it does not stand on the sea.

Evidence is a sum of log-odds, one term a frame in which the target was looked for: a box adds what its confidence says
above `neutral_confidence` (the sequential test of [Wald, "Sequential tests of statistical hypotheses", 1945]), a frame
without a box takes some away. A decoy of middling confidence never gathers enough; a faint ship may in time. What its
size says (`horizon_consistency.py`) is the same in every frame and counts once.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.messages import Box, Frame, GimbalAttitude
from shipland.vision.far.detector import Detector, Picture
from shipland.vision.far.horizon_consistency import HorizonConsistency, apart
from shipland.vision.parameters import Confirmation, DetectorParameters

_MOST_LOG_ODDS = 3.0


def log_odds(confidence: float) -> float:
    """ln(p / (1 − p)), at most ±3 (0.95): single confidences beyond that are not to be trusted."""
    bounded = min(max(confidence, 1e-6), 1.0 - 1e-6)
    return min(max(math.log(bounded / (1.0 - bounded)), -_MOST_LOG_ODDS), _MOST_LOG_ODDS)


@dataclass
class Track:
    """A candidate, or the target.

    Attributes:
        settings, confirmation, focal_px: of its search.
        t_s: time of the last hit.
        centre_px, size_px: (2,) last box.
        velocity_px_s: (2,) of the centre, the gimbal's own turning taken out.
        gimbal: the camera's attitude at the last hit.
        hits: the last frames that it was looked for in, whether each was a hit.
        evidence: log-odds gathered.
        score: running mean of the log-odds of the boxes' confidence.
        horizon_odds: log-odds of the last box by the horizon (`HorizonConsistency.evidence`).
        misses: frames since the last hit.
    """

    settings: DetectorParameters
    confirmation: Confirmation
    focal_px: float
    t_s: float
    centre_px: Array
    size_px: Array
    velocity_px_s: Array
    gimbal: GimbalAttitude
    hits: deque[bool]
    evidence: float
    score: float
    horizon_odds: float = 0.0
    misses: int = 0

    def turned_px(self, gimbal: GimbalAttitude) -> Array:
        """(2,) by how much the gimbal's turning since the last hit moves the picture's content [px]."""
        turned_rad = np.array([-(gimbal.yaw_rad - self.gimbal.yaw_rad), gimbal.pitch_rad - self.gimbal.pitch_rad])
        return self.focal_px * turned_rad

    def predicted_px(self, frame: Frame) -> Array:
        """(2,) where the centre should be in `frame`."""
        elapsed_s = max(frame.t_s - self.t_s, 0.0)
        return self.centre_px + self.velocity_px_s * elapsed_s + self.turned_px(frame.gimbal)

    def reach_px(self, frame: Frame) -> float:
        """How far from the prediction the target may be in `frame`."""
        elapsed_s, settings = max(frame.t_s - self.t_s, 0.0), self.settings
        longer = float(self.size_px.max())
        return settings.gate_px + settings.gate_px_s * elapsed_s + settings.gate_sizes * longer

    def off_px(self, box: Box, frame: Frame) -> float:
        """How far from the prediction a box of `frame` lies; infinite where it cannot be this target."""
        off_px = float(np.hypot(*(np.array(box.centre_px) - self.predicted_px(frame))))
        growth, most = max(box.size_px) / float(self.size_px.max()), self.settings.gate_growth
        return off_px if off_px <= self.reach_px(frame) and 1.0 / most <= growth <= most else math.inf

    def hit(self, box: Box, horizon_odds: float, frame: Frame) -> None:
        """Take a box of `frame`, with its log-odds by the horizon."""
        centre, settings, confirmation = np.array(box.centre_px), self.settings, self.confirmation
        elapsed_s = frame.t_s - self.t_s
        if elapsed_s > 0.0:
            measured = (centre - self.centre_px - self.turned_px(frame.gimbal)) / elapsed_s
            self.velocity_px_s = self.velocity_px_s + settings.velocity_gain * (measured - self.velocity_px_s)
        odds = log_odds(box.confidence)
        self.t_s, self.gimbal = frame.t_s, frame.gimbal
        self.centre_px, self.size_px = centre, np.array(box.size_px)
        self.horizon_odds = horizon_odds
        self.hits.append(True)
        self.misses = 0
        gathered = self.evidence + odds - log_odds(confirmation.neutral_confidence)
        self.evidence = min(gathered, confirmation.most_evidence)
        self.score += settings.score_gain * (odds - self.score)

    def miss(self) -> None:
        """Note a frame without a box; the velocity is set to zero, since a nose that yaws comes back."""
        self.hits.append(False)
        self.velocity_px_s = np.zeros(2)
        self.misses += 1
        self.evidence -= self.confirmation.miss_evidence

    def support(self) -> float:
        """Log-odds of its boxes and of their size, weighted."""
        return self.evidence + self.confirmation.size_weight * self.horizon_odds

    def rank(self) -> float:
        """The rival with the largest is taken."""
        return self.score + self.horizon_odds

    def convincing(self) -> bool:
        """Whether to believe it."""
        confirmation = self.confirmation
        return sum(self.hits) >= confirmation.confirm_hits and self.support() >= confirmation.believe_evidence

    def hopeless(self) -> bool:
        """Whether a candidate can no longer be confirmed in its time."""
        return len(self.hits) - sum(self.hits) > self.confirmation.confirm_frames - self.confirmation.confirm_hits

    def lost(self) -> bool:
        """Whether to give up a target that was believed: unseen for too long, or more and more doubtful."""
        return self.misses >= self.settings.lost_frames or self.evidence < -self.confirmation.doubt_evidence


NETWORK_STEP_PX = 32


@dataclass
class TargetSearch:
    """One detector over a stream of frames: candidates, `tracks`, and the one that is believed, `target`."""

    name: str
    detector: Detector
    camera: Camera
    parameters: DetectorParameters
    confirmation: Confirmation
    horizon: HorizonConsistency
    tracks: list[Track] = field(default_factory=list)
    target: Track | None = None
    _since_search: int = 0

    def reset(self) -> None:
        """Forget everything."""
        self.tracks, self.target, self._since_search = [], None, 0

    @property
    def search_due(self) -> bool:
        """Whether the whole frame should be searched: always without a target, often while it is doubtful."""
        if self.target is None:
            return True
        sure = self.target.score >= log_odds(self.parameters.sure_confidence) and len(self.tracks) == 0
        return self._since_search >= (self.parameters.recheck_frames if sure else self.parameters.doubt_frames)

    def search(self, frame: Frame, picture: Picture) -> Box | None:
        """Search the whole frame; the target's box in it."""
        self._since_search = 0
        return self._take(self.detector.detect(picture, self.confirmation.track_confidence), frame)

    def search_tile(self, frame: Frame, picture: Picture, around: Track) -> Box | None:
        """Search the tile around another target, for boxes inside it."""
        tile_px, reduction = tile_for(float(around.size_px.max()), self.parameters)
        centre = (float(around.centre_px[0]), float(around.centre_px[1]))
        found = self.detector.detect_in_tile(picture, centre, tile_px, reduction, self.confirmation.track_confidence)
        return self._take([box for box in found if inside(box, around)], frame)

    def follow(self, frame: Frame, picture: Picture) -> Box | None:
        """The target's box, in a tile around where it should be."""
        if self.target is None:
            return None
        self._since_search += 1
        predicted_px = self.target.predicted_px(frame)
        reach_px = self.target.reach_px(frame) if self.target.misses > 0 else 0.0
        tile_px, reduction = tile_for(float(self.target.size_px.max()), self.parameters, reach_px)
        centre = (float(predicted_px[0]), float(predicted_px[1]))
        found = self.detector.detect_in_tile(picture, centre, tile_px, reduction, self.confirmation.track_confidence)
        return self._update_target(apart(self.horizon.on_the_sea(found, frame.gimbal)), frame)

    def reason(self) -> str:
        """Why no box is reported."""
        if self.target is not None:
            return f"{self.name}: missed ({self.target.misses} frames)"
        if not self.tracks:
            return f"{self.name}: not found"
        confirmation, best = self.confirmation, max(self.tracks, key=Track.support)
        return (
            f"{self.name}: not confirmed ({sum(best.hits)} of {confirmation.confirm_hits} sightings, "
            f"evidence {best.support():.1f} of {confirmation.believe_evidence:g})"
        )

    def _take(self, found: list[Box], frame: Frame) -> Box | None:
        """Give boxes to the target and the candidates, the most confident first; the target's box."""
        boxes = apart(self.horizon.on_the_sea(found, frame.gimbal))
        reported = self._update_target(boxes, frame)
        given: dict[int, Box] = {}
        fresh = []
        for box in (box for box in boxes if box is not reported):
            free = [(track.off_px(box, frame), index) for index, track in enumerate(self.tracks) if index not in given]
            off_px, nearest = min(free, default=(math.inf, 0))
            if off_px < math.inf:
                given[nearest] = box
            elif box.confidence >= self.confirmation.start_confidence:
                fresh.append(box)
        for index, track in enumerate(self.tracks):
            if index in given:
                self._hit(track, given[index], frame)
            else:
                track.miss()
        boxes_of = {id(self.tracks[index]): box for index, box in given.items()}
        alive = [track for track in self.tracks if not track.hopeless()]
        room = max(self.parameters.most_candidates - len(alive), 0)
        self.tracks = alive + [self._start(box, frame) for box in fresh[:room]]
        best = max((track for track in self.tracks if track.convincing()), key=Track.rank, default=None)
        if best is not None and (
            self.target is None or best.rank() > self.target.rank() + self.parameters.recheck_margin
        ):
            self.tracks = [track for track in self.tracks if track is not best]
            self.target, reported = best, boxes_of.get(id(best))
        return reported

    def _start(self, box: Box, frame: Frame) -> Track:
        """A track from its first box."""
        odds = log_odds(box.confidence)
        return Track(
            self.parameters,
            self.confirmation,
            self.camera.focal_px,
            frame.t_s,
            np.array(box.centre_px),
            np.array(box.size_px),
            np.zeros(2),
            frame.gimbal,
            deque([True], maxlen=self.confirmation.confirm_frames),
            evidence=odds - log_odds(self.confirmation.neutral_confidence),
            score=odds,
            horizon_odds=self.horizon.evidence(box, frame),
        )

    def _hit(self, track: Track, box: Box, frame: Frame) -> None:
        track.hit(box, self.horizon.evidence(box, frame), frame)

    def _update_target(self, boxes: list[Box], frame: Frame) -> Box | None:
        target = self.target
        if target is None:
            return None
        box = next((item for item in boxes if target.off_px(item, frame) < math.inf), None)
        if box is not None:
            self._hit(target, box, frame)
        else:
            target.miss()
        if target.lost():
            self.target, self._since_search = None, 0
            return None
        return box


def tile_for(longer_px: float, parameters: DetectorParameters, reach_px: float = 0.0) -> tuple[int, int]:
    """Side of the tile that the network sees and the reduction.

    Args:
        longer_px: longer side of the target; the reduction goes by it alone.
        parameters: sizes of tiles.
        reach_px: how far from the tile's middle the target may be; the tile covers as much of that as it may.
    """
    wanted = parameters.tile_per_target * longer_px
    reduction = max(1, int(np.ceil(wanted / parameters.tile_max_px)))
    side = NETWORK_STEP_PX * int(np.ceil(max(wanted, 2.0 * reach_px) / reduction / NETWORK_STEP_PX))
    return min(max(side, parameters.tile_min_px), parameters.tile_max_px), reduction


def inside(box: Box, around: Track) -> bool:
    """Whether a bar's centre lies in the ship's box, a quarter of it as margin."""
    offset = np.abs(np.array(box.centre_px) - around.centre_px)
    return bool(np.all(offset <= 0.75 * around.size_px + 2.0))
