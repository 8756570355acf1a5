"""The policy's network."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from shipland.guidance.horizon.steering import ENTRIES
from shipland.learning.policy.export import ACTIONS, Dense


class PolicyNetwork(nn.Module):
    """Two hidden layers, actions in -1 … 1; it begins with actions of zero."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
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

    def dense(self) -> list[Dense]:
        """Its layers, for a file."""
        rows = [layer for layer in self.layers if isinstance(layer, nn.Linear)]
        return [Dense(row.weight.detach().numpy(), row.bias.detach().numpy(), "Tanh") for row in rows]


def seeded_network(hidden: int, seed: int) -> PolicyNetwork:
    """A network with first weights of its own, whatever else torch has drawn."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return PolicyNetwork(hidden)
