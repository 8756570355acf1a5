"""The last phase of a landing, batched and differentiable: from at most 12 m to the first contact with the deck.

A cycle is a picture: the pilots look, a policy steers, the sticks arrive after the uplink, and the aircraft fly on
until the next cycle in a few substeps. What is modelled and what is left out: docs/explanation/learned-policies.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from shipland.guidance.horizon.steering import Action
from shipland.learning.policy import air, aircraft, motion
from shipland.learning.policy.filter import POSE_M, POSE_POWERS, POSE_RANGE_M, estimated_wave, level_of
from shipland.learning.policy.pilot import Ahead, BatchedHorizon, Memory, Seen
from shipland.learning.policy.setup import PhaseSetup, Randomisation

Policy = Callable[[Tensor], Tensor]
"""From observations (B, n) to actions (B, 2) in -1 … 1, forward and starboard of the bar."""
SUBSTEPS = 2
"""Of a cycle."""
_HISTORY = 16
"""Cycles of places that late pictures are taken from."""


NOTHING = Action("residual", 0.0, 0.0)
"""The pilot alone."""


@dataclass(frozen=True)
class FirstContact:
    """First contacts of B flights.

    Attributes:
        touched: (B,) whether there was one.
        t_s: (B,) of it, from the flight's begin.
        own_m: (B, 2) of the aircraft from the point that the bar defines.
        deck_m: (B, 2) from the deck's centre.
        slide_mps: (B, 2) over ground.
    """

    touched: Tensor
    t_s: Tensor
    own_m: Tensor
    deck_m: Tensor
    slide_mps: Tensor


@dataclass(frozen=True)
class Flights:
    """B flights at one cycle; what a step needs and nothing else.

    Attributes:
        cycle: how many have been flown.
        aircraft: true state.
        memory: of the pilots.
        ahead: what the pilots see now; None before the first look.
        places: (history, B, 3) true places from the point that the bar defines, oldest first; `velocities` over what
            the optical flow sees.
        gust: (B, 8) of the air.
        flow_noise: (B, 3) of the velocity.
        over_deck_m: (B,) of the centre.
        touch: first contacts so far.
    """

    cycle: int
    aircraft: aircraft.AircraftState
    memory: Memory
    ahead: Ahead | None
    places: Tensor
    velocities: Tensor
    gust: Tensor
    flow_noise: Tensor
    over_deck_m: Tensor
    touch: FirstContact


@dataclass(frozen=True)
class Batch:
    """What is drawn once a flight, for B flights.

    Attributes:
        airframes, air, drawn: of aircraft, air and ship.
        late: (B,) how much older pictures are than they say, in cycles.
        level: (B,) of gusts, as the pilot takes it.
        flow_bias_mps: (B, 3) of the velocity.
        start_m: (B, 3) from the neutral landing point.
        generator: of everything random during the flights.
    """

    airframes: aircraft.Airframes
    air: air.Air
    drawn: motion.Drawn
    late: Tensor
    level: Tensor
    flow_bias_mps: Tensor
    start_m: Tensor
    generator: torch.Generator

    @property
    def size(self) -> int:
        """Flights."""
        return len(self.level)


class LastPhase:
    """A scenario's last phase.

    Args:
        setup: the scenario.
        random: what differs from flight to flight.
        bank: motions of its ship; drawn by `seed` where None is given.
        motions: how many are drawn.
        seed: of the bank.
    """

    def __init__(
        self,
        setup: PhaseSetup,
        random: Randomisation | None = None,
        bank: motion.MotionBank | None = None,
        motions: int = 32,
        seed: int = 0,
    ) -> None:
        self.setup, self.random = setup, random or Randomisation()
        self.bank = bank or motion.draw_motions(setup, motions, np.random.default_rng(seed))
        wave = estimated_wave(setup, self.bank.heave_m, self.bank.heave_mps)
        self.pilot = BatchedHorizon(setup, wave)
        self._substep_s = setup.cycle_s / SUBSTEPS
        self._arrived = [min(max(setup.response.uplink_s / self._substep_s - i, 0.0), 1.0) for i in range(SUBSTEPS)]
        self._eddy_m = setup.wind.airwake.eddy_heights * (setup.rig.superstructure_height_m - setup.rig.deck_height_m)
        self._to_bar_m = float(-setup.rig.deck_in_bar_m[0])

    def draw(self, size: int, seed: int) -> Batch:
        """What `size` flights meet; the same seed, the same flights."""
        generator = torch.Generator().manual_seed(seed)
        setup, random = self.setup, self.random
        airframes = aircraft.draw_airframes(setup, random, size, self._substep_s, generator)
        blowing = air.draw_air(setup, random, size, generator)
        late = random.latency_s / setup.cycle_s * (2.0 * torch.rand(size, generator=generator) - 1.0)
        nearest, farthest = random.start_m
        distance = nearest + (farthest - nearest) * torch.rand(size, generator=generator)
        # Near starts lie on every side, far ones astern, within 10° of the axis as flights of the scenarios do.
        spread = math.pi * (1.0 - (distance / 2.0).clamp_max(1.0)) + math.radians(10.0)
        bearing = spread * (2.0 * torch.rand(size, generator=generator) - 1.0)
        height = setup.hover_height_m + 0.1 * torch.randn(size, generator=generator)
        start = torch.stack([-distance * bearing.cos(), distance * bearing.sin(), -height], 1)
        sensors = setup.aircraft.sensors
        bias = sensors.flow_bias_mps * torch.randn(size, 3, generator=generator)
        bias[:, 2] = 0.0
        frame, carried = setup.aircraft.airframe, self.bank.carried
        speeds = blowing.mean_mps.tolist()
        pushes = [frame.rotor_drag_per_s * v + frame.body_drag_per_m * v * v for v in speeds]
        level = torch.tensor([level_of(setup, push, carried) for push in pushes])
        drawn = motion.choose(self.bank, size, generator)
        return Batch(airframes, blowing, drawn, late, level, bias, start, generator)

    def start(self, batch: Batch) -> Flights:
        """The flights at their begin, and their first look."""
        size = batch.size
        point = batch.drawn.at(self.bank.point_m, 0)
        state = aircraft.hovering(batch.airframes, batch.start_m, batch.air.mean_in_bar_mps)
        axis = aircraft.thrust_axis(state.tilt[:, 0])
        trim = -state.thrust_mps2[:, None] * axis[:, :2]
        wave = torch.stack([point, (batch.drawn.at(self.bank.point_m, 1) - point) / self.setup.cycle_s])
        memory = self.pilot.start(batch.start_m, trim, wave, batch.level, batch.generator)
        gust = air.first_gust(batch.air, batch.generator)
        nan = torch.full((size,), math.nan)
        nothing = torch.zeros(size, dtype=torch.bool)
        touch = FirstContact(
            nothing, nan, nan[:, None].repeat(1, 2), nan[:, None].repeat(1, 2), nan[:, None].repeat(1, 2)
        )
        noise = self.setup.aircraft.sensors.velocity_noise_mps * torch.randn(size, 3, generator=batch.generator)
        place = (batch.start_m - point).expand(_HISTORY, size, 3)
        still = torch.zeros(_HISTORY, size, 3)
        over = self._clearance_m(batch, state.position_m, 0)
        flights = Flights(0, state, memory, None, place, still, gust, noise, over, touch)
        return self._look(batch, flights)

    def observation(self, flights: Flights) -> Tensor:
        """(B, n) what a policy sees now."""
        assert flights.ahead is not None
        return self.pilot.observation(flights.ahead)

    def step(self, batch: Batch, flights: Flights, actions: Tensor, meaning: Action) -> Flights:
        """A cycle later, steered by actions (B, 2)."""
        ahead = flights.ahead
        assert ahead is not None
        own, bound = ahead.wanted_mps2, meaning.bound_mps2 * actions.clamp(-1.0, 1.0).T
        wanted = own + bound if meaning.kind == "residual" else bound
        near = ahead.offset_m.square().sum(0) <= meaning.reach_m**2
        before = flights.memory.sticks
        memory = self.pilot.command(ahead, torch.where(near, wanted, own))
        flights = self._flown(batch, replace(flights, memory=memory), before)
        return self._look(batch, flights)

    def _flown(self, batch: Batch, flights: Flights, before: Tensor) -> Flights:
        """The aircraft a cycle later, under the sticks before until the new ones have arrived."""
        setup, cycle = self.setup, flights.cycle + 1
        normal = torch.randn(batch.size, 8, generator=batch.generator)
        gust = air.next_gust(batch.air, flights.gust, setup.cycle_s, self._eddy_m, normal)
        state, sticks, over = flights.aircraft, flights.memory.sticks, flights.over_deck_m
        begin = state
        wind = air.wind_at(setup, batch.air, gust, state.position_m)
        for share in self._arrived:
            flown = sticks if share == 0.0 else share * before + (1.0 - share) * sticks
            state = aircraft.step(setup, batch.airframes, state, flown, wind, over, self._substep_s)
        clear = self._clearance_m(batch, state.position_m, cycle)
        touch = self._touched(batch, flights, begin, state, clear)
        return replace(flights, cycle=cycle, aircraft=state, gust=gust, over_deck_m=clear, touch=touch)

    def _touched(
        self, batch: Batch, flights: Flights, begin: aircraft.AircraftState, end: aircraft.AircraftState, clear: Tensor
    ) -> FirstContact:
        """First contacts within the cycle, at the instant at which the feet reach the deck."""
        setup, touch, cycle = self.setup, flights.touch, flights.cycle
        limit = setup.horizon.descent.contact_height_m
        before = flights.over_deck_m
        now = (clear <= limit) & ~touch.touched
        share = ((before - limit) / (before - clear).clamp_min(1e-6)).clamp(0.0, 1.0)[:, None]
        place = begin.position_m + share * (end.position_m - begin.position_m)
        velocity = begin.velocity_mps + share * (end.velocity_mps - begin.velocity_mps)

        def at(table: Tensor) -> Tensor:
            first, second = batch.drawn.at(table, cycle), batch.drawn.at(table, cycle + 1)
            return first + share * (second - first)

        own = (place - at(self.bank.point_m))[:, :2]
        deck = (place - at(self.bank.deck_m))[:, :2]
        t_s = (cycle + share[:, 0]) * setup.cycle_s
        pick = now[:, None]
        return FirstContact(
            touch.touched | now,
            torch.where(now, t_s, touch.t_s),
            torch.where(pick, own, touch.own_m),
            torch.where(pick, deck, touch.deck_m),
            torch.where(pick, velocity[:, :2], touch.slide_mps),
        )

    def _clearance_m(self, batch: Batch, position_m: Tensor, cycle: int) -> Tensor:
        """(B,) of the aircraft's centre over the deck below it."""
        off = position_m - batch.drawn.at(self.bank.deck_m, cycle)
        slope = (batch.drawn.at(self.bank.tilt, cycle) * off[:, :2]).sum(1)
        return slope - off[:, 2]

    def _look(self, batch: Batch, flights: Flights) -> Flights:
        """Take a picture's and a reading's news, late and with their errors."""
        setup, generator, cycle = self.setup, batch.generator, flights.cycle
        state = flights.aircraft
        place = state.position_m - batch.drawn.at(self.bank.point_m, cycle)
        keep = math.exp(-setup.cycle_s / setup.aircraft.sensors.velocity_noise_time_s)
        spread = setup.aircraft.sensors.velocity_noise_mps * math.sqrt(1.0 - keep * keep)
        noise = keep * flights.flow_noise + spread * torch.randn(batch.size, 3, generator=generator)
        view = self._over_ship(place)
        flow = torch.cat([batch.drawn.at(self.bank.flow_mps, cycle), torch.zeros(batch.size, 1)], 1)
        velocity = state.velocity_mps + batch.flow_bias_mps + noise - view[:, None] * flow
        places = torch.cat([flights.places[1:], place[None]])
        velocities = torch.cat([flights.velocities[1:], velocity[None]])
        age = setup.picture_age_s / setup.cycle_s
        picture = _late(places, age + batch.late)
        range_m = (self._to_bar_m - picture[:, 0]).clamp_min(0.5)
        errors = [
            deviation * (range_m / POSE_RANGE_M) ** power for deviation, power in zip(POSE_M, POSE_POWERS, strict=True)
        ]
        picture = picture + torch.stack(errors, 1) * torch.randn(batch.size, 3, generator=generator)
        phase, every = cycle % setup.velocity_every, setup.velocity_every
        whole = round(age)
        waiting = max(whole - (every - phase), 0)
        seen = Seen(
            picture.T,
            velocities[_HISTORY - 1 - whole].T,
            velocities[_HISTORY - 1 - waiting].T,
            self._over_ship(picture).long(),
            self._over_ship(places[_HISTORY - 1 - waiting]).long(),
        )
        ahead = self.pilot.look(flights.memory, seen, batch.level, cycle)
        return replace(
            flights, memory=ahead.memory, ahead=ahead, places=places, velocities=velocities, flow_noise=noise
        )

    def _over_ship(self, place_m: Tensor) -> Tensor:
        """(B,) 1 where the view downward shows more ship than water."""
        rig = self.setup.rig
        slope = math.tan(math.radians(0.5 * self.setup.aircraft.sensors.flow_view_deg))
        half = (-place_m[:, 2]).clamp_min(0.05) * slope
        along = torch.minimum(place_m[:, 0] + half, half.new_tensor(rig.platform_length_m - rig.deck_ahead_of_stern_m))
        along = along - torch.maximum(place_m[:, 0] - half, half.new_tensor(-rig.deck_ahead_of_stern_m))
        return (along.clamp_min(0.0) > half).to(place_m.dtype)


def _late(history: Tensor, age: Tensor) -> Tensor:
    """(B, 3) of a history (n, B, 3), newest last, `age` (B,) cycles ago."""
    age = age.clamp(0.0, len(history) - 1.001)
    whole = age.floor()
    index = (len(history) - 1 - whole.long())[None, :, None].expand(1, -1, history.shape[2])
    newer, older = history.gather(0, index)[0], history.gather(0, index - 1)[0]
    return newer + (age - whole)[:, None] * (older - newer)


def rollout(
    phase: LastPhase,
    batch: Batch,
    policy: Policy | None,
    meaning: Action = NOTHING,
    *,
    cycles: int,
    flights: Flights | None = None,
    watch: Callable[[Flights, Tensor], None] | None = None,
) -> Flights:
    """Fly a batch for a number of cycles; differentiable in the policy's parameters.

    Args:
        phase: what is flown.
        batch: its flights; one that is flown again meets other noise, one drawn again the same.
        policy: steers; None flies the pilot alone.
        meaning: of its actions.
        cycles: how many; an aircraft that has touched flies on and is not looked at again.
        flights: to go on with; None begins.
        watch: called with the flights before each cycle, and the actions (B, 2) taken.
    """
    flights = phase.start(batch) if flights is None else flights
    nothing = torch.zeros(batch.size, 2)
    for _ in range(cycles):
        actions = nothing if policy is None else policy(phase.observation(flights))
        if watch is not None:
            watch(flights, actions)
        flights = phase.step(batch, flights, actions, meaning)
    return flights
