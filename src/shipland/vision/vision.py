"""What the loop asks of a vision, and the one place where a vision that fails becomes an observation."""

from __future__ import annotations

import logging
from typing import Protocol

from shipland.messages import Frame, Observation
from shipland.soundness import is_new, sound_observation, words_of

_log = logging.getLogger(__name__)


class Vision(Protocol):
    """Frame in, observation out."""

    def see(self, frame: Frame) -> Observation:
        """The best that can be made of one frame; what the picture cannot give is a reason, not an exception."""


def see_or_degrade(vision: Vision, frame: Frame, known: set[type[Exception]] | None = None) -> Observation:
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
    except Exception as error:  # whatever a foreign vision raises
        if is_new(error, known):
            _log.exception("vision failed on the frame of %.3f s", frame.t_s)
        return Observation(frame.t_s, frame.gimbal, reason=f"vision failed: {words_of(error)}")
