"""One target followed over frames: where it should be next, and how much speaks for it.

Evidence is a sum of log-odds, one term a frame in which the target was looked for: a box adds what its confidence says
above `neutral_confidence` (the sequential test of [Wald, "Sequential tests of statistical hypotheses", 1945]), a frame
without a box takes some away. A decoy of middling confidence never gathers enough; a faint ship may in time. What its
size says (`horizon_consistency.py`) is the same in every frame and counts once.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from shipland.frames import Array
from shipland.messages import Box, Frame, GimbalAttitude
from shipland.vision.far.parameters import Confirmation, DetectorParameters

_MOST_LOG_ODDS = 3.0


def log_odds(confidence: float) -> float:
    """ln(p / (1 − p)), at most ±3 (0.95): single confidences beyond that are not to be trusted."""
    bounded = min(max(confidence, 1e-6), 1.0 - 1e-6)
    return min(max(math.log(bounded / (1.0 - bounded)), -_MOST_LOG_ODDS), _MOST_LOG_ODDS)


@dataclass
class Track:
    """A candidate, or the target.

    Attributes:
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

    @staticmethod
    def start(box: Box, horizon_odds: float, frame: Frame, confirmation: Confirmation) -> Track:
        """A track from its first box, with its log-odds by the horizon."""
        odds = log_odds(box.confidence)
        return Track(
            frame.t_s,
            np.array(box.centre_px),
            np.array(box.size_px),
            np.zeros(2),
            frame.gimbal,
            deque([True], maxlen=confirmation.confirm_frames),
            evidence=odds - log_odds(confirmation.neutral_confidence),
            score=odds,
            horizon_odds=horizon_odds,
        )

    def turned_px(self, gimbal: GimbalAttitude, focal_px: float) -> Array:
        """(2,) by how much the gimbal's turning since the last hit moves the picture's content [px]."""
        return focal_px * np.array([-(gimbal.yaw_rad - self.gimbal.yaw_rad), gimbal.pitch_rad - self.gimbal.pitch_rad])

    def predicted_px(self, frame: Frame, focal_px: float) -> Array:
        """(2,) where the centre should be in `frame`."""
        elapsed_s = max(frame.t_s - self.t_s, 0.0)
        return self.centre_px + self.velocity_px_s * elapsed_s + self.turned_px(frame.gimbal, focal_px)

    def reach_px(self, frame: Frame, parameters: DetectorParameters) -> float:
        """How far from the prediction the target may be in `frame`."""
        elapsed_s = max(frame.t_s - self.t_s, 0.0)
        longer = float(self.size_px.max())
        return parameters.gate_px + parameters.gate_px_s * elapsed_s + parameters.gate_sizes * longer

    def takes(self, box: Box, frame: Frame, predicted_px: Array, parameters: DetectorParameters) -> bool:
        """Whether a box of `frame` can be this target: near the prediction, and of like size."""
        growth = max(box.size_px) / float(self.size_px.max())
        return (
            float(np.hypot(*(np.array(box.centre_px) - predicted_px))) <= self.reach_px(frame, parameters)
            and 1.0 / parameters.gate_growth <= growth <= parameters.gate_growth
        )

    def hit(
        self,
        box: Box,
        horizon_odds: float,
        frame: Frame,
        focal_px: float,
        parameters: DetectorParameters,
        confirmation: Confirmation,
    ) -> None:
        """Take a box of `frame`, with its log-odds by the horizon."""
        centre = np.array(box.centre_px)
        elapsed_s = frame.t_s - self.t_s
        if elapsed_s > 0.0:
            measured = (centre - self.centre_px - self.turned_px(frame.gimbal, focal_px)) / elapsed_s
            self.velocity_px_s = self.velocity_px_s + parameters.velocity_gain * (measured - self.velocity_px_s)
        odds = log_odds(box.confidence)
        self.t_s, self.gimbal = frame.t_s, frame.gimbal
        self.centre_px, self.size_px = centre, np.array(box.size_px)
        self.horizon_odds = horizon_odds
        self.hits.append(True)
        self.misses = 0
        gathered = self.evidence + odds - log_odds(confirmation.neutral_confidence)
        self.evidence = min(gathered, confirmation.most_evidence)
        self.score += parameters.score_gain * (odds - self.score)

    def miss(self, confirmation: Confirmation) -> None:
        """Note a frame without a box; the velocity is set to zero, since a nose that yaws comes back."""
        self.hits.append(False)
        self.velocity_px_s = np.zeros(2)
        self.misses += 1
        self.evidence -= confirmation.miss_evidence

    def support(self, confirmation: Confirmation) -> float:
        """Log-odds of its boxes and of their size, weighted."""
        return self.evidence + confirmation.size_weight * self.horizon_odds

    def rank(self) -> float:
        """The rival with the largest is taken."""
        return self.score + self.horizon_odds

    def convincing(self, confirmation: Confirmation) -> bool:
        """Whether to believe it."""
        return (
            sum(self.hits) >= confirmation.confirm_hits and self.support(confirmation) >= confirmation.believe_evidence
        )

    def hopeless(self, confirmation: Confirmation) -> bool:
        """Whether a candidate can no longer be confirmed in its time."""
        return len(self.hits) - sum(self.hits) > confirmation.confirm_frames - confirmation.confirm_hits

    def lost(self, parameters: DetectorParameters, confirmation: Confirmation) -> bool:
        """Whether to give up a target that was believed: unseen for too long, or more and more doubtful."""
        return self.misses >= parameters.lost_frames or self.evidence < -confirmation.doubt_evidence
