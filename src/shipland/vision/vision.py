"""What the loop asks of a vision, the one place where a vision that fails becomes an observation, and the whole vision.

The whole is near and far vision as one: corners first, then the detectors, in one time budget a frame. The last
observation decides what is looked for: no corners while the boxes are too small for them, no detector while corners
are being followed.
"""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from typing import Protocol

from shipland.config import key, parameters
from shipland.messages import Frame, Observation
from shipland.soundness import ENDS_THE_PROCESS, log_failure, sound_observation, words_of

_log = logging.getLogger(__name__)


class Vision(Protocol):
    """Frame in, observation out."""

    def see(self, frame: Frame) -> Observation:
        """The best that can be made of one frame; what the picture cannot give is a reason, not an exception."""


def see_or_degrade(vision: Vision, frame: Frame, known: set[type[BaseException]] | None = None) -> Observation:
    """What a vision makes of a frame; where it raises or gives what is no observation, one that says so.

    The flight loop looks through this and nothing else does: in flight a fault in a vision, ours or a user's, must not
    stop the loop; anywhere else it must show.

    Args:
        vision: ours or a user's.
        frame: what it looks at.
        known: kinds of its errors whose traceback the log of this flight holds already; a new one is added.
    """
    try:
        return sound_observation(vision.see(frame))
    except ENDS_THE_PROCESS:
        raise
    except BaseException as error:  # whatever a foreign vision raises
        log_failure(_log, f"vision failed on the frame of {frame.t_s:.3f} s", error, known)
        return Observation(frame.t_s, frame.gimbal, reason=f"vision failed: {words_of(error)}")


@parameters
class VisionSelectorParameters:
    """`[selector]`."""

    corners_bar_px: float = key(
        45.0, "least width of the bar's box for which corners are looked for", "the bar at 29 m", ge=0
    )
    corners_ship_px: float = key(
        50.0, "least width of the ship's box for which they are, without a bar's box", "the platform at 33 m", ge=0
    )
    patience_s: float = key(
        0.35, "after a pose no detector runs for so long", "ten frames; less than guidance.modes.lost_s", ge=0, le=10
    )
    memory_s: float = key(
        2.0, "age from which boxes are ignored", "four cycles of the paper's learned detector", ge=0, le=30
    )
    deck_pitch_deg: float = key(
        -45.0, "camera pitch below which only the deck is looked for", "a search looks down by 25°", ge=-90, lt=-25
    )


class VisionSelector:
    """The whole vision: a pose where there are corners, else boxes; straight below, the deck.

    `near` looks for the cue's corners, `far` for bar and ship, `below`, if any, for the deck's markings.
    """

    def __init__(
        self, near: Vision, far: Vision, parameters: VisionSelectorParameters, below: Vision | None = None
    ) -> None:
        self._near, self._far, self._parameters, self._below = near, far, parameters, below
        self._down_rad = math.radians(parameters.deck_pitch_deg)
        self._pose_s = -math.inf
        self._boxes: Observation | None = None

    def see(self, frame: Frame) -> Observation:
        """A pose, or boxes with the reason why there is no pose."""
        if self._below is not None and frame.gimbal.pitch_rad < self._down_rad:
            self._pose_s = frame.t_s  # no detector runs while the camera turns up again either
            return self._below.see(frame)
        reason, off_rad = "too far for corners", 0.0
        if self._near_enough(frame.t_s):
            seen = self._near.see(frame)
            if seen.bar_pose is not None:
                self._pose_s = frame.t_s
            if 0.0 <= frame.t_s - self._pose_s <= self._parameters.patience_s:
                return seen
            reason, off_rad = seen.reason, seen.gimbal_off_rad
        boxes = self._far.see(frame)
        if boxes.bar_box is not None or boxes.ship_box is not None:
            self._boxes = boxes
        reason = "; ".join(text for text in (reason, boxes.reason) if text)
        return replace(boxes, learned=True, reason=reason, gimbal_off_rad=off_rad)

    def _near_enough(self, t_s: float) -> bool:
        boxes, parameters = self._boxes, self._parameters
        if boxes is None or not 0.0 <= t_s - boxes.t_s <= parameters.memory_s:
            return True
        if boxes.bar_box is not None:
            return boxes.bar_box.size_px[0] >= parameters.corners_bar_px
        return boxes.ship_box is None or boxes.ship_box.size_px[0] >= parameters.corners_ship_px
