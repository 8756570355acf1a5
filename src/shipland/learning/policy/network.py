"""The policy's network, and its ONNX file."""

from __future__ import annotations

import json
from pathlib import Path

import torch
from torch import Tensor, nn

from shipland.guidance.horizon.learned import FORMAT
from shipland.guidance.horizon.steering import ENTRIES, Action
from shipland.learning.dataset import write_atomically

ACTIONS = 2


class PolicyNetwork(nn.Module):
    """Two hidden layers, actions in -1 … 1; it begins with actions of zero."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.hidden = hidden
        self.layers = nn.Sequential(
            nn.Linear(len(ENTRIES), hidden),
            nn.Tanh(),
            nn.Linear(hidden, hidden),
            nn.Tanh(),
            nn.Linear(hidden, ACTIONS),
            nn.Tanh(),
        )
        last = self.layers[4]
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)

    def forward(self, observation: Tensor) -> Tensor:
        """(B, 2) from (B, n)."""
        actions: Tensor = self.layers(observation)
        return actions


def write_policy(path: Path, network: nn.Sequential, action: Action, note: str) -> None:
    """Write layers of `Linear`, `Tanh` and `ReLU` as ONNX, with what its action means and what it wants to see."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    nodes, weights, before = [], [], "observation"
    for index, layer in enumerate(network):
        after = "action" if index == len(network) - 1 else f"layer_{index}"
        if isinstance(layer, nn.Linear):
            for name, value in (("weight", layer.weight), ("bias", layer.bias)):
                array = value.detach().cpu().float().numpy()
                weights.append(numpy_helper.from_array(array, f"{name}_{index}"))
            nodes.append(helper.make_node("Gemm", [before, f"weight_{index}", f"bias_{index}"], [after], transB=1))
        else:
            nodes.append(helper.make_node({nn.Tanh: "Tanh", nn.ReLU: "Relu"}[type(layer)], [before], [after]))
        before = after
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["batch", len(ENTRIES)])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["batch", ACTIONS])],
        weights,
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9, producer_name="shipland"
    )
    about = {"format": FORMAT, "action": json.dumps(vars(action)), "entries": json.dumps(ENTRIES), "note": note}
    helper.set_model_props(model, about)
    onnx.checker.check_model(model)
    write_atomically(path, model.SerializeToString())


def seeded_network(hidden: int, seed: int) -> PolicyNetwork:
    """A network with first weights of its own, whatever else torch has drawn."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return PolicyNetwork(hidden)
