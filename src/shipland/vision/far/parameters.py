"""What `[detector]` in TOML says of the far detectors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from shipland.config import build, layered, require, require_within

Precision = Literal["auto", "bf16", "fp32"]
Runtime = Literal["auto", "openvino", "onnxruntime"]


@dataclass(frozen=True)
class Confirmation:
    """When a candidate is believed (`[detector.ship]`, `[detector.bar]`).

    Attributes:
        start_confidence: least confidence that starts a candidate, on the whole frame.
        track_confidence: least confidence that continues one, or the target.
        confirm_hits, confirm_frames: a track is believed after so many hits in so many frames, and enough evidence.
        neutral_confidence: a box of this confidence, where the track expects it, speaks neither for nor against.
        believe_evidence: log-odds above neutral that a track must gather, its size's included.
        doubt_evidence: a target whose boxes have gathered less than minus this is given up.
        most_evidence: log-odds that it can gather at most.
        miss_evidence: log-odds that a frame without a box takes away.
        size_weight: what the log-odds of the box's size at its place count by, against those of single frames, which
            repeat one another.
    """

    start_confidence: float
    track_confidence: float
    confirm_hits: int
    confirm_frames: int
    neutral_confidence: float
    believe_evidence: float
    doubt_evidence: float
    most_evidence: float
    miss_evidence: float
    size_weight: float

    def __post_init__(self) -> None:
        for name in ("start_confidence", "track_confidence", "neutral_confidence"):
            require(0.0 < getattr(self, name) <= 1.0, f"{name} must lie in 0 … 1, got {getattr(self, name)}")
        require(1 <= self.confirm_hits <= self.confirm_frames, "confirm_hits must lie in 1 … confirm_frames")
        require(0.0 <= self.believe_evidence <= self.most_evidence, "believe_evidence must lie in 0 … most_evidence")
        for name in ("doubt_evidence", "miss_evidence", "size_weight"):
            require(getattr(self, name) >= 0.0, f"{name} must not be negative, got {getattr(self, name)}")


@dataclass(frozen=True)
class DetectorParameters:
    """How the far detectors run (`[detector]` in configs/learning.toml).

    Attributes:
        ship_weights, bar_weights: name of packaged weights (`ship`, `bar`) or path of an ONNX file.
        runtime: auto, openvino or onnxruntime.
        precision: auto, bf16 or fp32.
        threads: CPU threads; 0 leaves it to the runtime.
        acquire_confidence: least confidence of a box in a single picture, where nothing else is known.
        ship, bar: when a candidate is believed.
        max_iou: overlap above which the less confident of two boxes goes.
        tile_min_px, tile_max_px: side of the square tile around a track, multiples of 32.
        tile_per_target: the tile's side over the target's longer side, at least.
        gate_px, gate_px_s, gate_sizes: a track takes a box whose centre lies within gate_px + gate_px_s × the time
            since its last box + gate_sizes × its longer side.
        gate_growth: largest ratio of the sides of two boxes one frame apart that a track takes.
        most_candidates: candidates at a time.
        horizon_margin_deg: how far above the horizon the foot of a ship may seem to lie: the gimbal's error.
        ship_rise, bar_rise: how far above the horizon the box's middle may lie besides, in its own longer sides;
            negative for a box whose foot must lie below.
        height_sd_m, horizon_sd_deg: errors of the camera's height over the water and of the horizon.
        span_sd: standard deviation of the target's apparent width, by its aspect and the box's error, as a share of it.
        other_sd: that of the width of other objects.
        lost_frames: a track ends after so many frames without a hit.
        stale_s: a track ends when no frame came for so long.
        sure_confidence: a target of at least this mean confidence, without a rival, is sure.
        recheck_frames: a whole frame is searched again every so many frames while the target is sure,
        doubt_frames: or every so many while it is not.
        recheck_margin: log-odds by which a rival's mean must be better to take over.
        score_gain: weight of a new box in the running mean of a track's confidence, 0 … 1.
        bar_search_ship_px: width of the ship's box from which on the bar is looked for inside it.
        velocity_gain: weight of a new box's displacement in a track's velocity, 0 … 1.
    """

    ship_weights: str
    bar_weights: str
    runtime: Runtime
    precision: Precision
    threads: int
    acquire_confidence: float
    ship: Confirmation
    bar: Confirmation
    max_iou: float
    tile_min_px: int
    tile_max_px: int
    tile_per_target: float
    gate_px: float
    gate_px_s: float
    gate_sizes: float
    gate_growth: float
    most_candidates: int
    horizon_margin_deg: float
    ship_rise: float
    bar_rise: float
    height_sd_m: float
    horizon_sd_deg: float
    span_sd: float
    other_sd: float
    lost_frames: int
    stale_s: float
    sure_confidence: float
    recheck_frames: int
    doubt_frames: int
    recheck_margin: float
    score_gain: float
    bar_search_ship_px: float
    velocity_gain: float

    def __post_init__(self) -> None:
        shares = "acquire_confidence sure_confidence max_iou velocity_gain"
        for name in (*shares.split(), "score_gain"):
            require(0.0 < getattr(self, name) <= 1.0, f"{name} must lie in 0 … 1, got {getattr(self, name)}")
        require(
            0 < self.tile_min_px <= self.tile_max_px and not (self.tile_min_px % 32 or self.tile_max_px % 32),
            "tile_min_px ≤ tile_max_px must be multiples of 32",
        )
        for name in ("height_sd_m", "horizon_sd_deg", "span_sd", "other_sd"):
            require(getattr(self, name) > 0.0, f"{name} must be positive, got {getattr(self, name)}")
        require(self.tile_per_target > 1.0, "tile_per_target must exceed 1")
        require(self.gate_growth > 1.0, "gate_growth must exceed 1")
        for name in ("recheck_frames", "doubt_frames"):
            require(getattr(self, name) >= 1, f"{name} must be positive")
        require_within(self, threads=(0, 256), stale_s=(0.1, 10.0), lost_frames=(1, 1000), most_candidates=(1, 100))


def detector_parameters(config: Path | None = None) -> DetectorParameters:
    """The packaged `[detector]` of configs/learning.toml, that of the file `config` laid over it."""
    return build(DetectorParameters, layered("learning", config)["detector"], "detector")
