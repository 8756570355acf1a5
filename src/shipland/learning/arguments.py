"""What `shipland synth | train | evaluate` take; light to import, so that the command line starts at once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from shipland.errors import ConfigError

Kind = Literal["ship", "bar"]
Profile = Literal["far", "photos"]
Device = Literal["auto", "cpu", "cuda"]


@dataclass(frozen=True)
class SynthArguments:
    """Make labelled pictures from the simulator's scene.

    Attributes:
        out: folder to fill; run the command again to resume an interrupted run.
        kind: what the labels are of.
        count: number of pictures; default as in the paper, 2,000 of the ship and 1,000 of the bar.
        seed: the same seed gives the same pictures.
        crop_px: side of square windows around target or decoy at native size; 0 gives whole frames.
        config: TOML laid over the packaged settings.
        coco: write `coco.json` too.
        workers: processes that draw.
        minutes: begin nothing new after so long; the set then holds fewer pictures.
    """

    out: Path
    kind: Kind = "ship"
    count: int | None = None
    seed: int = 0
    crop_px: int = 0
    config: Path | None = None
    coco: bool = False
    workers: int = 1
    minutes: float | None = None

    def __post_init__(self) -> None:
        at_least(0, seed=self.seed, crop_px=self.crop_px)
        at_least(1, count=self.count, workers=self.workers)
        positive(minutes=self.minutes)


@dataclass(frozen=True)
class TrainArguments:
    """Train a detector on labelled pictures in YOLO's layout.

    Attributes:
        data: folders with images/ and labels/; several are put together.
        out: folder for checkpoints, curves, the detector (.onnx, -int8.onnx) and its model card.
        classes: names of the classes; default from classes.txt or data.yaml.
        profile: far for native windows and small targets, photos for targets that fill the picture.
        steps: optimiser steps; default from the profile.
        minutes: stop in order after so long, however many steps that gives; the learning rate falls accordingly.
        batch: pictures a step; default from the profile.
        window_px: side of the training window, a multiple of 32; default from the profile.
        width: factor on the network's filters; 1.0 is the paper's network.
        weights: start from packaged weights (ship, bar), a checkpoint (.safetensors), a detector (.onnx), or Darknet's
            (.weights of the same shape).
        resume: go on from the last checkpoint in `out`.
        device: `auto` takes a GPU where there is one.
        memory: where pictures wait: on disk, decoded in the device's memory, or auto: there on a GPU that has room.
        threads: CPU threads; more than the free cores makes it much slower.
        seed: of the split, the first weights and the windows.
        config: TOML laid over the packaged settings.
    """

    data: tuple[Path, ...]
    out: Path
    classes: tuple[str, ...] = ()
    profile: Profile = "far"
    steps: int | None = None
    minutes: float | None = None
    batch: int | None = None
    window_px: int | None = None
    width: float = 0.25
    weights: Path | None = None
    resume: bool = False
    device: Device = "auto"
    memory: Literal["auto", "disk", "device"] = "auto"
    threads: int = 1
    seed: int = 0
    config: Path | None = None

    def __post_init__(self) -> None:
        at_least(0, seed=self.seed)
        at_least(1, steps=self.steps, batch=self.batch, threads=self.threads)
        positive(minutes=self.minutes, width=self.width)


@dataclass(frozen=True)
class EvaluateArguments:
    """Measure a detector: on a labelled set, or on fresh scenes of the simulator over range.

    Attributes:
        weights: packaged weights (ship, bar, frigate) or an ONNX file; default those that fly, by kind.
        kind: what is looked for, on fresh scenes.
        data: a labelled set; without one, fresh scenes are made.
        classes: names of the set's classes, by which a detector of more classes is told which ones to look for
            (`--classes boat` for a set of ships and a detector of COCO's classes); default from the set.
        count: number of fresh scenes; a second each on a free core, with six frames. 120 tell a recall of 0.9 to
            ±0.06, 2,000 to ±0.015.
        frames: consecutive frames a scene, for temporal confirmation.
        seed: of the scenes; keep it off those trained on.
        out: folder for the table (JSON) and the plot.
        confidence: least confidence of a box; default from [detector].
        runtime: what runs the network; `auto` takes the fastest that is installed.
        precision: of its arithmetic; `auto` takes bf16 where the processor has it.
        threads: CPU threads of each process.
        workers: processes that draw and look at fresh scenes.
        keep_boxes: search every frame whole and keep its boxes in scenes.jsonl, for studies/confirmation.py.
        config: TOML laid over the packaged settings.
    """

    weights: str | None = None
    kind: Kind = "ship"
    data: Path | None = None
    classes: tuple[str, ...] = ()
    count: int = 120
    frames: int = 6
    seed: int = 2_000_000
    out: Path = Path("out/evaluate")
    confidence: float | None = None
    runtime: Literal["auto", "openvino", "onnxruntime"] = "auto"
    precision: Literal["auto", "bf16", "fp32"] = "auto"
    threads: int = 0
    workers: int = 1
    keep_boxes: bool = False
    config: Path | None = None

    def __post_init__(self) -> None:
        at_least(0, seed=self.seed, threads=self.threads)
        at_least(1, count=self.count, frames=self.frames, workers=self.workers)


def at_least(least: int, **options: int | None) -> None:
    """ConfigError, by its flag, for an option that is given and smaller."""
    for name, value in options.items():
        if value is not None and value < least:
            raise ConfigError(f"--{name.replace('_', '-')} must be {least} or more, got {value}")


def positive(**options: float | None) -> None:
    """ConfigError, by its flag, for an option that is given and not above zero."""
    for name, value in options.items():
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ConfigError(f"--{name.replace('_', '-')} must be positive, got {value}")
