"""What a policy is trained for and judged by: the offset at first contact."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from shipland.guidance.horizon.steering import Action
from shipland.learning.policy.phase import Batch, Flights, LastPhase, Policy, rollout

_WORST_M = 0.5
"""An offset counts as at most about this: a flight that is lost must not outweigh those that are not."""
_ON_THE_WAY, _LOW_M = 0.2, 1.5
"""Weight of the squared offset on the way, below this height."""
_EFFORT = 2e-4
"""Weight of the squared action and of its change from cycle to cycle."""


def offsets_m(phase: LastPhase, flights: Flights) -> Tensor:
    """(B, 2) at first contact: from the deck's centre where a ship carries the bar, else from the bar's point."""
    return flights.touch.deck_m if phase.bank.carried else flights.touch.own_m


def loss_of(phase: LastPhase, batch: Batch, policy: Policy, meaning: Action, cycles: int) -> Tensor:
    """Of one batch; differentiable."""
    on_the_way = torch.zeros(())
    effort = torch.zeros(())
    before: list[Tensor] = []
    carried = phase.bank.carried

    def watch(flights: Flights, actions: Tensor) -> None:
        nonlocal on_the_way, effort
        table = phase.bank.deck_m if carried else phase.bank.point_m
        place = flights.aircraft.position_m - batch.drawn.at(table, flights.cycle)
        counts = (~flights.touch.touched & (-place[:, 2] < _LOW_M)).to(place.dtype)
        squared = _bounded(place[:, :2].square().sum(1))
        on_the_way = on_the_way + (counts * squared).mean()
        change = actions - before[0] if before else actions
        effort = effort + (counts * (actions.square().sum(1) + change.square().sum(1))).mean()
        before[:] = [actions]

    flights = rollout(phase, batch, policy, meaning, cycles=cycles, watch=watch)
    off = offsets_m(phase, flights)
    touched = flights.touch.touched
    at_contact = _bounded(torch.where(touched[:, None], off, torch.zeros_like(off)).square().sum(1))
    missing = (~touched).to(off.dtype).mean() * _WORST_M**2
    return at_contact.mean() + missing + (_ON_THE_WAY * on_the_way + _EFFORT * effort) / cycles


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
