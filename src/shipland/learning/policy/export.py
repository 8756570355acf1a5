"""A policy as ONNX: dense layers, what its action means, and what it wants to see."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from shipland.errors import ConfigError
from shipland.files import write_with_digest
from shipland.guidance.horizon.learned import FORMAT
from shipland.guidance.horizon.steering import ENTRIES, Action
from shipland.learning.export import model_bytes

ACTIONS = 2


class Dense(NamedTuple):
    """A layer, activation(weight @ x + bias): (outputs, inputs) and (outputs,), its activation by ONNX's name."""

    weight: npt.NDArray[np.float32]
    bias: npt.NDArray[np.float32]
    activation: Literal["Tanh", "Relu"]


def write_policy(path: Path, layers: Sequence[Dense], action: Action, note: str) -> None:
    """Write a policy that `--pilot residual` and `learned` fly, whole or not at all, with its digest.

    Raises:
        ConfigError: a layer does not take what the one before gives, or the last one gives no action.
    """
    from onnx import helper, numpy_helper

    widths = [len(ENTRIES), *(len(layer.bias) for layer in layers[:-1]), ACTIONS]
    for index, (layer, (inputs, outputs)) in enumerate(zip(layers, pairwise(widths), strict=True)):
        wanted, given = ((outputs, inputs), (outputs,)), (layer.weight.shape, layer.bias.shape)
        if given != wanted:
            raise ConfigError(f"layer {index} of {len(layers)}: expected weight and bias of {wanted}, got {given}")
    nodes, weights, before = [], [], "observation"
    for index, layer in enumerate(layers):
        after = "action" if index == len(layers) - 1 else f"hidden_{index}"
        names = [f"weight_{index}", f"bias_{index}"]
        for name, value in zip(names, (layer.weight, layer.bias), strict=True):
            weights.append(numpy_helper.from_array(np.asarray(value, np.float32), name))
        nodes.append(helper.make_node("Gemm", [before, *names], [f"sum_{index}"], transB=1))
        nodes.append(helper.make_node(layer.activation, [f"sum_{index}"], [after]))
        before = after
    entering, leaving = {"observation": ["batch", len(ENTRIES)]}, {"action": ["batch", ACTIONS]}
    about = {"format": FORMAT, "action": json.dumps(vars(action)), "entries": json.dumps(ENTRIES), "note": note}
    write_with_digest(path, model_bytes("policy", nodes, entering, leaving, weights, about))
