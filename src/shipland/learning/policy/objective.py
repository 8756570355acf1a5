"""What a policy is trained for and judged by: the offset at first contact."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from shipland.guidance.horizon.steering import Action
from shipland.learning.policy.phase import Batch, Flights, LastPhase, Policy, rollout

_WORST_M = 0.5
"""An offset counts as at most about this: a flight that is lost must not outweigh those that are not."""
_ON_THE_WAY = 0.2
"""Weight of the squared offset on the way."""
_EFFORT = 2e-4
"""Weight of the squared action and of its change from cycle to cycle."""


def offsets_m(phase: LastPhase, flights: Flights) -> Tensor:
    """(B, 2) at first contact: from the deck's centre where a ship carries the bar, else from the bar's point."""
    return flights.touch.deck_m if phase.bank.carried else flights.touch.own_m


def loss_of(
    phase: LastPhase, batch: Batch, policy: Policy, meaning: Action, begin: int, cycles: int
) -> tuple[Tensor, int]:
    """Loss of one batch, and its number of contacts; differentiable.

    Args:
        phase: what is flown.
        batch: its flights.
        policy: steers.
        meaning: of its actions.
        begin: cycles that are flown before, without gradients: what came long before matters little.
        cycles: flown then.
    """
    with torch.no_grad():
        flights = rollout(phase, batch, policy, meaning, cycles=begin)
    down_before = flights.touch.touched
    on_the_way, effort, weight = torch.zeros(()), torch.zeros(()), torch.zeros(())
    before: list[Tensor] = []
    table = phase.bank.deck_m if phase.bank.carried else phase.bank.point_m

    def watch(flights: Flights, actions: Tensor) -> None:
        nonlocal on_the_way, effort, weight
        place = flights.aircraft.position_m - batch.drawn.at(table, flights.cycle)
        counts = (~flights.touch.touched).to(place.dtype)
        change = actions - before[0] if before else torch.zeros_like(actions)
        on_the_way = on_the_way + (counts * _bounded(place[:, :2].square().sum(1))).sum()
        effort = effort + (counts * (actions.square().sum(1) + change.square().sum(1))).sum()
        weight = weight + counts.sum()
        before[:] = [actions]

    flights = rollout(phase, batch, policy, meaning, cycles=cycles, flights=flights, watch=watch)
    counts = flights.touch.touched & ~down_before
    off = torch.where(counts[:, None], offsets_m(phase, flights), torch.zeros(()))
    at_contact = _bounded(off.square().sum(1)).sum() / counts.sum().clamp_min(1)
    along = (_ON_THE_WAY * on_the_way + _EFFORT * effort) / weight.clamp_min(1.0)
    return at_contact + along, int(counts.sum())


def _bounded(squared_m2: Tensor) -> Tensor:
    return squared_m2 / (1.0 + squared_m2 / _WORST_M**2)


@dataclass(frozen=True)
class Score:
    """Of some flights.

    Attributes:
        touched: share that came down in time.
        rms_m: (2,) of the offset at contact, forward and starboard; offsets beyond 0.5 m and flights without a contact
            count as 0.5 m.
    """

    touched: float
    rms_m: tuple[float, float]

    @property
    def rms_all_m(self) -> float:
        """Of both components together."""
        return float((self.rms_m[0] ** 2 + self.rms_m[1] ** 2) ** 0.5)


def score_of(phase: LastPhase, batch: Batch, policy: Policy | None, meaning: Action, cycles: int) -> Score:
    """Fly a batch and judge it."""
    with torch.no_grad():
        flights = rollout(phase, batch, policy, meaning, cycles=cycles)
        off = torch.nan_to_num(offsets_m(phase, flights), nan=_WORST_M).clamp(-_WORST_M, _WORST_M)
        forward, starboard = off.square().mean(0).sqrt().tolist()
        return Score(float(flights.touch.touched.float().mean()), (forward, starboard))
