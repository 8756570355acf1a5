"""The pilot `horizon` over the deck, batched: estimate, reference, gains, descent, sticks.

Its matrices are the pilot's own (`filter`, `guidance.horizon.gains`); its rules are those of
`guidance.horizon.pilot` and `descent`, written for batches. Left out: search, boxes, headings, broken-off landings
(a batch that strays goes back to the approach), and the moment's choice by lulls.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from shipland.estimation.relative_state import ACTUATION, GUST, POSITION, VELOCITY, WAVE, WAVE_RATE, WIND, AxisModel
from shipland.estimation.wave_motion import WAVE_STATES, WaveMotion
from shipland.frames import GRAVITY_MPS2 as G
from shipland.frames import Array
from shipland.guidance.horizon.descent import NEWTON_STEPS, SLOWEST_FALL_MPS
from shipland.guidance.horizon.gains import INPUT_RATE_SHARE, gains_of
from shipland.guidance.horizon.steering import AXIS_ENTRIES, LIMIT, LONGEST_CONTACT_S, WHOLE_ENTRIES
from shipland.learning.policy.filter import estimator_tables
from shipland.learning.policy.setup import PhaseSetup

_NONE, _SINK, _WAIT, _DROP = range(4)
_SLOWEST_MPS = 0.1


@dataclass(frozen=True)
class Memory:
    """What the pilots of B flights remember; axes forward, starboard, down first.

    Attributes:
        mean: (3, B, 10) of the estimate at the newest picture.
        inputs: (3, B, m) commanded, newest first: accelerations, and the speed downward.
        sticks: (B, 3) sent last, in shares.
        place_m, speed_mps, rate_mps2: (2, B) the reference.
        held_s: (B,) for how long the landing condition has held.
        phase: (B,) of the descent; 0 before a landing.
        since_s: (B,) for how long it has waited.
        height_m: (B,) that the descent flies to.
    """

    mean: Tensor
    inputs: Tensor
    sticks: Tensor
    place_m: Tensor
    speed_mps: Tensor
    rate_mps2: Tensor
    held_s: Tensor
    phase: Tensor
    since_s: Tensor
    height_m: Tensor


@dataclass(frozen=True)
class Seen:
    """What reaches the pilots in a cycle.

    Attributes:
        picture_m: (3, B) the place by the newest picture.
        velocity_mps: (3, B) the velocity reading of the picture's own time; used in phase 0.
        waiting_mps: (3, B) the reading that is younger than the picture.
        view: (B,) 1 where the optical flow sees the ship at the picture, else 0; `waiting_view` at that reading.
    """

    picture_m: Tensor
    velocity_mps: Tensor
    waiting_mps: Tensor
    view: Tensor
    waiting_view: Tensor


@dataclass(frozen=True)
class Ahead:
    """The estimate at the command's effect, and what the gains make of it.

    Attributes:
        state: (3, B, 10).
        offset_m, speed_mps: (2, B) from the point that is followed.
        height_m, sink_mps, contact_s: (B,) over the neutral deck.
        wanted_mps2: (2, B) by the pilot's own gains.
        memory: after the cycle's estimate, reference and descent.
        heave_mps: (B,) commanded, upward.
    """

    state: Tensor
    offset_m: Tensor
    speed_mps: Tensor
    height_m: Tensor
    sink_mps: Tensor
    contact_s: Tensor
    wanted_mps2: Tensor
    memory: Memory
    heave_mps: Tensor


class BatchedHorizon:
    """`horizon` over the deck, for batches; pure functions of `Memory`.

    Args:
        setup: of the phase.
        wave: of the bar, as the pilot takes it.
    """

    def __init__(self, setup: PhaseSetup, wave: WaveMotion) -> None:
        self._setup, self._wave = setup, wave
        tables = estimator_tables(setup, wave)
        self._tables = {name: _tensor(value) for name, value in vars(tables).items()}
        self._every, self._reads = setup.velocity_every, setup.velocity_hz > 0.0
        horizon = setup.horizon
        step_ms = round(1e3 * setup.cycle_s)
        motion = AxisModel(setup.response.lag_s, setup.response.drag_per_s)
        self._near, self._gentle = (
            [_tensor(value) for value in (found.steady, found.to_contact, found.offset_to_contact)]
            for found in (
                gains_of(motion, horizon.horizontal, wave, weights, step_ms)
                for weights in (horizon.weights if self._reads else horizon.weights_blind, horizon.weights_blind)
            )
        )
        self._later = _tensor(_later_rate(wave, setup.response.climb_lag_s))
        self._most = INPUT_RATE_SHARE * setup.response.max_input_rate * setup.cycle_s

    @property
    def commands(self) -> int:
        """How many commands it remembers."""
        return int(self._tables["step_inputs"].shape[-1])

    def start(
        self, offset_m: Tensor, trim_mps2: Tensor, wave: Tensor, level: Tensor, generator: torch.Generator
    ) -> Memory:
        """An estimate as uncertain as after some seconds of flight.

        Args:
            offset_m: (B, 3) from the neutral landing point, at rest.
            trim_mps2: (B, 2) tilted by against the wind.
            wave: (2, B, 3) of the point that the bar defines, and its rate.
            level: (B,) of gusts.
            generator: draws the estimate's errors.
        """
        batch = len(offset_m)
        mean = torch.zeros(3, batch, 10)
        mean[:, :, POSITION] = offset_m.T
        mean[:2, :, ACTUATION], mean[:2, :, WIND] = trim_mps2.T, -trim_mps2.T
        if self._wave.bar_moves:
            mean[:, :, WAVE], mean[:, :, WAVE_RATE] = wave[0].T, wave[1].T
        deviation = self._tables["deviation"][level].permute(1, 0, 2).clone()
        deviation[:, :, [ACTUATION, WIND]] = 0.0
        mean = mean + deviation * torch.randn(mean.shape, generator=generator)
        inputs = torch.zeros(3, batch, self.commands)
        inputs[:2] = trim_mps2.T[:, :, None]
        sticks = torch.zeros(batch, 3)
        sticks[:, :2] = torch.atan(trim_mps2 / G) / self._setup.response.max_tilt_rad
        zero = torch.zeros(batch)
        return Memory(
            mean,
            inputs,
            sticks,
            offset_m.T[:2].clone(),
            torch.zeros(2, batch),
            torch.zeros(2, batch),
            zero,
            torch.zeros(batch, dtype=torch.long),
            zero,
            offset_m[:, 2].neg(),
        )

    def look(self, memory: Memory, seen: Seen, level: Tensor, cycle: int) -> Ahead:
        """Take a cycle's news; the estimate at the effect of the command that is decided now."""
        mean, state = self._estimate(memory, seen, level, cycle % self._every)
        wave, aimed = state[..., WAVE], self._wave.tracked_share
        rate = state[..., WAVE_RATE]
        offset, speed = (state[..., POSITION] - aimed * wave)[:2], (state[..., VELOCITY] - aimed * rate)[:2]
        shown = self._wave.observed_share
        height = shown * wave[2] - state[2, :, POSITION]
        sink = state[2, :, VELOCITY] - shown * rate[2]
        contact = self._contact_s(height, sink)
        memory = self._with_reference(replace(memory, mean=mean), offset, speed)
        control = self._control_state(memory, state)
        memory, heave = self._with_descent(memory, state, offset, height, contact, control)
        wanted = self._wanted(memory, control, offset, contact)
        return Ahead(state, offset, speed, height, sink, contact, wanted, memory, heave)

    def observation(self, ahead: Ahead) -> Tensor:
        """(B, n) what a policy sees, scaled: `guidance.horizon.steering.ENTRIES`."""
        state, memory = ahead.state, ahead.memory
        values = {
            "offset_m": ahead.offset_m,
            "speed_mps": ahead.speed_mps,
            "thrust_mps2": state[:2, :, ACTUATION],
            "gust_mps2": state[:2, :, GUST],
            "wind_mps2": state[:2, :, WIND],
            "wave_m": state[:2, :, WAVE],
            "wave_mps": state[:2, :, WAVE_RATE],
            "input_mps2": memory.inputs[:2, :, 0],
            "wanted_mps2": ahead.wanted_mps2,
            "height_m": ahead.height_m,
            "sink_mps": ahead.sink_mps,
            "contact_s": ahead.contact_s.clamp_max(LONGEST_CONTACT_S),
            "landing": (memory.phase > _NONE).to(state.dtype),
            "in_final_descent": (memory.phase == _DROP).to(state.dtype),
        }
        columns = [values[name][axis] / scale for name, scale in AXIS_ENTRIES for axis in range(2)]
        columns += [values[name] / scale for name, scale in WHOLE_ENTRIES]
        return torch.stack(columns, 1).clamp(-LIMIT, LIMIT)

    def command(self, ahead: Ahead, wanted_mps2: Tensor) -> Memory:
        """The memory after commanding an input (2, B) and the heave of `ahead`; its `sticks` are what is sent."""
        setup, memory = self._setup, ahead.memory
        response, before = setup.response, memory.inputs[:2, :, 0]
        wanted = before + (wanted_mps2 - before).clamp(-self._most, self._most)
        levelling = setup.horizon.levelling
        early_s = (ahead.contact_s - levelling.before_contact_s(response)).clamp_min(0.0)
        most = levelling.tilt_mps2 + response.max_input_rate * early_s
        level = wanted * (most / _length(wanted)).clamp_max(1.0)
        wanted = torch.where(memory.phase == _DROP, level, wanted)
        tilt = (torch.atan(wanted / G) / response.max_tilt_rad).clamp(-1.0, 1.0).T
        heave = (ahead.heave_mps / response.max_climb_mps).clamp(-1.0, 1.0)
        sticks = torch.cat([tilt, heave[:, None]], 1)
        slew = setup.slew_per_s * setup.cycle_s
        sticks = memory.sticks + (sticks - memory.sticks).clamp(-slew, slew)
        steps = 0.01 * response.stick_step_percent
        if steps > 0.0:
            sticks = sticks + (steps * (sticks / steps).round() - sticks).detach()
        flown = torch.cat(
            [
                (G * torch.tan(sticks[:, :2] * response.max_tilt_rad)).T,
                (-response.max_climb_mps * sticks[:, 2])[None],
            ]
        )
        return replace(memory, sticks=sticks, inputs=torch.cat([flown[:, :, None], memory.inputs[:, :, :-1]], 2))

    # --- estimate ----------------------------------------------------------------------------------------------

    def _estimate(self, memory: Memory, seen: Seen, level: Tensor, phase: int) -> tuple[Tensor, Tensor]:
        t = self._tables
        mean = _moved(memory.mean, memory.inputs, t["step"], t["step_inputs"])
        if self._reads and phase == 0:
            row = t["velocity"][seen.view].permute(1, 0, 2)
            gain = t["velocity_gain"][level, seen.view, 0].permute(1, 0, 2)
            mean = mean + gain * (seen.velocity_mps - (row * mean).sum(-1))[..., None]
        row = t["seen"][:, None]
        gain = t["picture_gain"][level, seen.view, phase].permute(1, 0, 2)
        mean = mean + gain * (seen.picture_m - (row * mean).sum(-1))[..., None]
        state = _moved(mean, memory.inputs, t["ahead"], t["ahead_inputs"])
        if not self._reads:
            return mean, state
        at_reading = _moved(mean, memory.inputs, t["reading"][phase], t["reading_inputs"][phase])
        row = t["velocity"][seen.waiting_view].permute(1, 0, 2)
        gain = t["ahead_gain"][level, seen.waiting_view, phase].permute(1, 0, 2)
        change = gain * (seen.waiting_mps - (row * at_reading).sum(-1))[..., None]
        return mean, state + torch.bmm(change, t["rest"][phase].transpose(1, 2))

    # --- reference and gains -----------------------------------------------------------------------------------

    def _with_reference(self, memory: Memory, offset: Tensor, speed: Tensor) -> Memory:
        """`reference.moved` towards the landing point, then `reference.reference_reset`."""
        path, margins, h = self._setup.horizon.path, self._setup.horizon.margins, self._setup.cycle_s
        short = path.line_up * (offset[1].abs() - margins.on_axis_m).clamp_min(0.0)
        short = torch.where(memory.phase > _NONE, torch.zeros_like(short), short)
        goal = torch.stack([-short, torch.zeros_like(short)])
        to_goal = goal - memory.place_m
        distance = _length(to_goal)
        pace = torch.minimum((2.0 * path.near_brake_mps2 * distance).sqrt(), path.closing_per_s * distance)
        wanted = to_goal * (pace.clamp_max(path.near_mps) / distance)
        change = wanted - memory.speed_mps
        most = path.acceleration_mps2 * h
        change = change * (most / _length(change)).clamp_max(1.0)
        place = memory.place_m + h * (memory.speed_mps + 0.5 * change)
        reference = memory.speed_mps + change
        ahead = reference - speed
        apart = _length(ahead)
        abort_reason = (_length(place - offset) > path.tracking_error_max_m) | (apart > path.tracking_error_max_mps)
        reset = speed + ahead * (path.tracking_error_max_mps / apart).clamp_max(1.0)
        return replace(
            memory,
            place_m=torch.where(abort_reason, offset, place),
            speed_mps=torch.where(abort_reason, reset, reference),
            rate_mps2=torch.where(abort_reason, torch.zeros_like(change), change / h),
        )

    def _control_state(self, memory: Memory, state: Tensor) -> Tensor:
        """(2, B, 11) against the reference."""
        thrust = memory.rate_mps2 + self._setup.response.drag_per_s * memory.speed_mps
        shift = torch.zeros_like(state[:2])
        shift[..., POSITION], shift[..., VELOCITY], shift[..., ACTUATION] = memory.place_m, memory.speed_mps, thrust
        return torch.cat([state[:2] - shift, (memory.inputs[:2, :, 0] - thrust)[..., None]], -1)

    def _wanted(self, memory: Memory, control: Tensor, offset: Tensor, contact: Tensor) -> Tensor:
        gentle = (_length(offset) > self._setup.horizon.margins.gentle_m)[:, None]
        left = (contact / self._setup.cycle_s).round().long()
        count = len(self._near[1])
        last = ((memory.phase == _DROP) & (left <= count))[:, None]
        index = (left - 1).clamp(0, count - 1)
        near = torch.where(last, self._near[1][index], self._near[0])
        far = torch.where(last, self._gentle[1][index], self._gentle[0])
        change = -(torch.where(gentle, far, near) * control).sum(-1)
        return memory.inputs[:2, :, 0] + change.clamp(-self._most, self._most)

    # --- descent -----------------------------------------------------------------------------------------------

    def _contact_s(self, height: Tensor, sink: Tensor) -> Tensor:
        """`descent.contact_in_s`."""
        descent, lag_s = self._setup.horizon.descent, self._setup.response.climb_lag_s
        left, drop = (height - descent.contact_height_m).clamp_min(0.0), descent.final_descent_mps
        slower = (drop - sink).clamp_min(0.0)
        time = left / drop + lag_s * slower / drop
        for _ in range(NEWTON_STEPS):
            kept = torch.exp(-time / lag_s)
            fallen = drop * time - slower * lag_s * (1.0 - kept)
            time = (time - (fallen - left) / (drop - slower * kept).clamp_min(SLOWEST_FALL_MPS)).clamp_min(0.0)
        return time

    def _with_descent(
        self, memory: Memory, state: Tensor, offset: Tensor, height: Tensor, contact: Tensor, control: Tensor
    ) -> tuple[Memory, Tensor]:
        """The landing condition, `descent.next_descent`, and the climb rate that they ask for."""
        setup, h = self._setup, self._setup.cycle_s
        horizon, descent, path = setup.horizon, setup.horizon.descent, setup.horizon.path
        off = _length(offset.detach())
        height, contact, control = height.detach(), contact.detach(), control.detach()
        phase, before = memory.phase, memory.phase
        committed = (phase == _DROP) | (height < horizon.margins.committed_m)
        phase = torch.where((off > horizon.abort_offset_m) & ~committed, torch.full_like(phase, _NONE), phase)
        ready = (off <= horizon.land_offset_m) & ((height - setup.hover_height_m).abs() <= 0.5) & (phase == _NONE)
        held = torch.where(ready, memory.held_s + h, torch.zeros_like(height))
        begins = ready & (held > setup.settle_s)
        phase = torch.where(begins, torch.full_like(phase, _SINK), phase)
        lower = torch.where(begins, height, memory.height_m)
        # Sink.
        sinks = phase == _SINK
        pace = _SLOWEST_MPS + descent.slow_per_s * (lower - descent.wait_height_m)
        sunk = torch.maximum(lower - pace.clamp_max(descent.sink_mps) * h, lower.new_tensor(descent.wait_height_m))
        lower = torch.where(sinks & (off <= descent.pause_m), sunk, lower)
        low = height <= descent.wait_height_m + descent.wait_band_m
        waits = sinks & low & (lower <= descent.wait_height_m)
        phase = torch.where(waits, torch.full_like(phase, _WAIT), phase)
        since = torch.where(phase == _WAIT, memory.since_s + h, torch.zeros_like(height))
        # Drop.
        rows = self._near[2]
        left = (contact / h).round().long().clamp(0, len(rows) - 1)
        at_contact = _length((rows[left] * control).sum(-1))
        allowed = descent.final_descent_offset_m * (1.0 + descent.relax_per_s) ** (
            since - descent.relax_after_s
        ).clamp_min(0.0)
        drops = (phase == _WAIT) & (at_contact <= allowed)
        drops |= (phase > _NONE) & self._contact_imminent(state, height, at_contact)
        phase = torch.where(drops, torch.full_like(phase, _DROP), phase)
        # Climb rate.
        lands, drops = phase > _NONE, phase == _DROP
        higher = 0.15 * (off - horizon.margins.overhead_m).clamp_min(0.0)
        wanted = torch.where(lands, lower, setup.hover_height_m + higher)
        deck = -self._wave.observed_share * (state[2, :, WAVE : WAVE + WAVE_STATES].detach() @ self._later)
        rate = torch.where(lands, deck, torch.zeros_like(deck))
        rate = rate + torch.where(lands & (before > _NONE), (lower - memory.height_m) / h, torch.zeros_like(deck))
        climb = (path.climb_per_s * (wanted - height)).clamp(-path.climb_mps, path.climb_mps)
        heave = torch.where(drops, deck - descent.final_descent_mps, rate + climb)
        return replace(memory, held_s=held, phase=phase, since_s=since, height_m=lower), heave

    def _contact_imminent(self, state: Tensor, height: Tensor, at_contact: Tensor) -> Tensor:
        """(B,) a contact is near that would find the aircraft tilted too much."""
        levelling, descent = self._setup.horizon.levelling, self._setup.horizon.descent
        near = (height < descent.contact_height_m + levelling.touch_m) & (at_contact <= levelling.touch_offset_m)
        return near & (_length(state[:2, :, WIND].detach()) > levelling.touch_mps2)


def _later_rate(wave: WaveMotion, passed_s: float) -> Array:
    """(4,) row that gives the wave motion's rate `passed_s` later from its states."""
    return np.array([wave.later(unit, passed_s)[1] for unit in np.eye(WAVE_STATES)])


def _moved(mean: Tensor, inputs: Tensor, transition: Tensor, gains: Tensor) -> Tensor:
    """(3, B, 10) after a transition (3, 10, 10) and commands (3, B, m)."""
    return torch.baddbmm(torch.bmm(inputs, gains.transpose(1, 2)), mean, transition.transpose(1, 2))


def _length(vectors: Tensor) -> Tensor:
    """(B,) of vectors (2, B), never zero."""
    return (vectors.square().sum(0) + 1e-12).sqrt()


def _tensor(value: Array) -> Tensor:
    return torch.as_tensor(value, dtype=torch.float32)
