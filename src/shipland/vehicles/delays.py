"""Every delay of the loop in one place (`[delays]` in TOML)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shipland.config import require
from shipland.messages import Observation


@dataclass(frozen=True)
class DelayParameters:
    """Video latency, processing time and uplink.

    Attributes:
        video_s: from a picture's exposure to its arrival.
        uplink_s: from a command's being ready to its effect.
        processing: what a cycle's processing takes: the paper's figures, the measured time, or nothing.
        near_s: the paper's cycle on corners [Lee2022, §Experimental Setup].
        learned_s: the paper's cycle on a learned detector.
    """

    video_s: float
    uplink_s: float
    processing: Literal["paper", "measured", "zero"]
    near_s: float
    learned_s: float

    def __post_init__(self) -> None:
        for name in ("video_s", "uplink_s", "near_s", "learned_s"):
            require(getattr(self, name) >= 0.0, f"{name} must not be negative")

    def processing_s(self, observation: Observation, measured_s: float) -> float:
        """Time that a cycle's processing is taken to last [s].

        Args:
            observation: of the cycle; it tells whether a learned detector ran.
            measured_s: what it took by the clock.
        """
        if self.processing == "measured":
            return measured_s
        if self.processing == "zero":
            return 0.0
        return self.learned_s if observation.learned else self.near_s
