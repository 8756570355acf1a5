"""Every delay of the loop in one place (`[delays]` in TOML)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shipland.config import require
from shipland.messages import Observation
from shipland.vehicles.telemetry import TelemetryParameters


@dataclass(frozen=True)
class DelayParameters:
    """Video latency, processing time and uplink.

    Attributes:
        video_s: from a picture's exposure to its arrival.
        video_jitter_s: standard deviation of what is added to that, always positive; pictures stay in order.
        video_loss_share: part of the pictures that never arrive.
        video_clock_s: standard deviation of what the pictures' time stamps are off by, constant in a flight.
        uplink_s: from a command's being ready to its effect.
        processing: what a cycle's processing takes: the paper's figures, the measured time, or nothing.
        near_s: the paper's cycle on corners [Lee2022, §Experimental Setup].
        learned_s: the paper's cycle on a learned detector.
        telemetry: rate and latency of what the vehicle says of itself.
    """

    video_s: float
    video_jitter_s: float
    video_loss_share: float
    video_clock_s: float
    uplink_s: float
    processing: Literal["paper", "measured", "zero"]
    near_s: float
    learned_s: float
    telemetry: TelemetryParameters

    def __post_init__(self) -> None:
        for name in ("video_s", "video_jitter_s", "video_clock_s", "uplink_s", "near_s", "learned_s"):
            require(getattr(self, name) >= 0.0, f"{name} must not be negative")
        require(0.0 <= self.video_loss_share < 1.0, "video_loss_share must be at least 0 and below 1")

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
