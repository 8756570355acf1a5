"""Checkpoints of a training run as safetensors: numbers and JSON, never pickles; written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from shipland.errors import DataError
from shipland.files import json_of, write_atomically
from shipland.vision.far.decode import DetectorSpec

FORMAT = "shipland-checkpoint-2"

Tensors = dict[str, dict[str, Tensor]]
"""By the part of a run, such as its network, and by name."""


@dataclass
class Progress:
    """Where a run stands.

    Attributes:
        step, best, since_best: optimiser steps done, best validation score so far, and evaluations since then.
        hard: places that fooled the detector in the last round: number of the picture, column and row [px].
        history: one row an evaluation.
        losses: step and running means of the loss's parts (box, objectness, class), every few steps.
        seconds, run: time spent on training, and what must stay the same when it is resumed, by name.
    """

    step: int = 0
    best: float = -1.0
    since_best: int = 0
    hard: list[tuple[int, float, float]] = field(default_factory=list)
    history: list[dict[str, float]] = field(default_factory=list)
    losses: list[tuple[float, float, float, float]] = field(default_factory=list)
    seconds: float = 0.0
    run: dict[str, str] = field(default_factory=dict)


def write_tensors(path: Path, tensors: Tensors, metadata: dict[str, str]) -> None:
    """Write tensors, as `part.name`, and text, by name."""
    from safetensors.torch import save

    whole = {
        f"{part}.{name}": tensor.detach().cpu().contiguous().clone()
        for part, named in tensors.items()
        for name, tensor in named.items()
    }
    write_atomically(path, bytes(save(whole, metadata)))


def read_tensors(path: Path, form: str, command: str) -> tuple[Tensors, dict[str, str]]:
    """What `write_tensors` wrote with `form` as its format, by `command`; DataError where there is no such file."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(str(path), framework="pt") as stream:
            metadata: dict[str, str] = stream.metadata() or {}
            if metadata.get("format") != form:
                raise DataError(f"checkpoint {path} was not written by this version's `shipland {command}`")
            tensors: Tensors = {}
            for key in stream.keys():  # noqa: SIM118 - no mapping
                part, _, name = key.partition(".")
                tensors.setdefault(part, {})[name] = stream.get_tensor(key)
    except (OSError, SafetensorError) as error:
        reason = "does not exist" if not path.exists() else f"is truncated or no checkpoint ({error})"
        raise DataError(f"checkpoint {path} {reason}") from None
    return tensors, metadata


def save_checkpoint(path: Path, tensors: Tensors, spec: DetectorSpec, progress: Progress) -> None:
    """Write tensors, the detector's spec and the run's progress."""
    metadata = {"format": FORMAT, "spec": spec.to_json(), "progress": json.dumps(asdict(progress))}
    write_tensors(path, tensors, metadata)


def load_checkpoint(path: Path) -> tuple[Tensors, DetectorSpec, Progress]:
    """Read what `save_checkpoint` wrote; DataError when it is missing, truncated or another file."""
    tensors, metadata = read_tensors(path, FORMAT, "train")
    try:
        progress: dict[str, Any] = json_of(metadata["progress"])
        progress["hard"] = [tuple(point) for point in progress["hard"]]
        return tensors, DetectorSpec.from_json(metadata["spec"], str(path)), Progress(**progress)
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"checkpoint {path} is damaged: its progress cannot be read: {error}") from None


def check_begun(last: Path, *, resume: bool) -> None:
    """DataError where a run's checkpoint is there that is not to be resumed."""
    if last.exists() and not resume:
        raise DataError(f"{last} is there already: give --resume to go on with it, or another folder")


def check_resumable(last: Path, begun: Mapping[str, str], wanted: Mapping[str, str]) -> None:
    """DataError where a run was begun with another value than is wanted."""
    for name, value in wanted.items():
        if begun.get(name, value) != value:
            raise DataError(f"{last} was begun with {name} {begun[name]}, not {value}: give that, or another folder")


def optimizer_tensors(optimizer: torch.optim.Optimizer) -> dict[str, Tensor]:
    """An optimiser's state, flat."""
    state = optimizer.state_dict()["state"]
    return {f"{index}.{name}": torch.as_tensor(value) for index, row in state.items() for name, value in row.items()}


def restore_optimizer(optimizer: torch.optim.Optimizer, tensors: dict[str, Tensor]) -> None:
    """Put back what `optimizer_tensors` gave, in the parameters' layout: the fused step walks all by address."""
    parameters = [parameter for group in optimizer.param_groups for parameter in group["params"]]
    table = optimizer.state_dict()
    rows: dict[int, dict[str, Tensor]] = {}
    for key, tensor in tensors.items():
        index, name = key.split(".", 1)
        parameter = parameters[int(index)]
        laid = torch.empty_like(parameter).copy_(tensor) if tensor.shape == parameter.shape else tensor
        rows.setdefault(int(index), {})[name] = laid.detach()
    table["state"] = rows
    optimizer.load_state_dict(table)
