"""Motions of deck and bar, drawn from the simulator's ship and kept as tables that batches read."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from shipland.learning.policy.setup import PhaseSetup
from shipland.sim.ship.ship import build_ship

LENGTH_S = 60.0
"""Of each motion."""


@dataclass(frozen=True)
class MotionBank:
    """Motions at the pictures' rate, in `ship` axes from the neutral landing point; what does not move is zero.

    Attributes:
        point_m: (motions, instants, 3) of the point that the bar defines.
        deck_m: (motions, instants, 3) of the deck's centre.
        tilt: (motions, instants, 2) the deck's slope: metres down for a metre forward, and starboard.
        flow_mps: (motions, instants, 2) the deck's horizontal velocity as the optical flow's fusion follows it.
        heave_m, heave_mps: standard deviations of the bar's own heave and of its rate.
    """

    point_m: Tensor
    deck_m: Tensor
    tilt: Tensor
    flow_mps: Tensor
    heave_m: float
    heave_mps: float

    @property
    def carried(self) -> bool:
        """A ship carries the bar."""
        return self.heave_m > 0.0

    @property
    def shape(self) -> tuple[int, int]:
        """Motions and instants."""
        return self.point_m.shape[0], self.point_m.shape[1]


def draw_motions(setup: PhaseSetup, count: int, rng: np.random.Generator, length_s: float = LENGTH_S) -> MotionBank:
    """`count` motions of the scenario's ship, lying still on its course."""
    instants = round(length_s / setup.cycle_s)
    points, decks, tilts, bars = [], [], [], []
    neutral_m = setup.rig.bar_in_ship_m + setup.rig.deck_in_bar_m
    for motion_rng in rng.spawn(count):
        ship = build_ship(setup.ship, setup.rig, motion_rng)
        point, deck, tilt, bar = [], [], [], []
        for instant in range(instants):
            state = ship.at(instant * setup.cycle_s)
            ship_from_ned = state.ned_from_ship.inverse()
            point.append(ship_from_ned.apply(state.ned_from_bar.apply(setup.rig.deck_in_bar_m)) - neutral_m)
            x, y, z, roll, pitch, _ = state.deck.displacement.tolist()
            deck.append((x, y, z))
            tilt.append((-math.tan(pitch), math.tan(roll)))
            bar.append(float(ship_from_ned.apply(state.ned_from_bar.translation_m)[2]))
        points.append(point)
        decks.append(deck)
        tilts.append(tilt)
        bars.append(bar)
    deck_m, bar_m = np.array(decks), np.array(bars)
    velocity_mps = np.gradient(deck_m[:, :, :2], setup.cycle_s, axis=1)
    keep = math.exp(-setup.cycle_s / setup.aircraft.sensors.flow_settle_s)
    flow_mps = np.empty_like(velocity_mps)
    flow_mps[:, 0] = velocity_mps[:, 0]
    for instant in range(1, instants):
        flow_mps[:, instant] = keep * flow_mps[:, instant - 1] + (1.0 - keep) * velocity_mps[:, instant]
    moves = setup.ship.full_ship and float(bar_m.std()) > 1e-6
    rate_mps = np.gradient(bar_m, setup.cycle_s, axis=1)
    return MotionBank(
        _tensor(points),
        _tensor(deck_m),
        _tensor(tilts),
        _tensor(flow_mps),
        float(bar_m.std()) if moves else 0.0,
        float(rate_mps.std()) if moves else 0.0,
    )


def _tensor(values: object) -> Tensor:
    return torch.as_tensor(np.asarray(values), dtype=torch.float32)


@dataclass(frozen=True)
class Drawn:
    """Which motion each flight of a batch meets.

    Attributes:
        bank: of all motions.
        motion, first: (B,) number of the motion, and the instant at which the flight begins.
    """

    bank: MotionBank
    motion: Tensor
    first: Tensor

    def at(self, table: Tensor, cycle: int) -> Tensor:
        """(B, …) a table's rows at a flight's cycle; a motion's end is met by its begin."""
        return table[self.motion, (self.first + cycle) % table.shape[1]]


def choose(bank: MotionBank, batch: int, generator: torch.Generator) -> Drawn:
    """Draw a motion and an instant for each flight of a batch."""
    motions, instants = bank.shape
    return Drawn(
        bank,
        torch.randint(motions, (batch,), generator=generator),
        torch.randint(instants, (batch,), generator=generator),
    )
