"""Pilots that fly an agent's actions: sticks, a bounded residual on another pilot's, or the input of `horizon`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from shipland.frames import Array
from shipland.guidance.horizon.pilot import HorizonPilot
from shipland.guidance.horizon.steering import Action, Steered, Steering, steered
from shipland.guidance.pilot import Pilot, PilotSetup
from shipland.guidance.view import View, box_elevation_rad, search, smoothed_rad
from shipland.messages import Decision, Intent, Observation, PilotCommand, Telemetry

STICKS = 4
"""Pitch (forward positive), roll (right), heave (up), yaw (clockwise), in this order, each -1 … 1 of the full stick."""


class ActionPilot(Pilot, Protocol):
    """A pilot that flies what `action` says, an array (4,)."""

    action: Array


class StickPilot:
    """Flies the action as it is, and adds what four sticks do not say: the camera's pitch and the command's intent.

    The camera follows what is seen: the bar by its pose, else the bar's or the ship's box; when nothing has been seen
    for `stale_s` it looks around as the packaged search does. The intent is LAND while the heave stick is down, so
    that the safety lets the aircraft through the floor over the deck, else FLY. When nothing has been seen for
    `stale_s`, where the safety would hold every stick, yaw and a climb alone are flown, to look for the ship.
    """

    def __init__(self, setup: PilotSetup, stale_s: float) -> None:
        self.action: Array = np.zeros(STICKS)
        self._view = View.of(setup.camera)
        self._search, self._lag_s = setup.guidance.search, setup.guidance.approach.gimbal_time_constant_s
        self._pitch_rad = math.radians(self._search.camera_pitch_deg[0])
        self._stale_s = stale_s
        self._seen_s = -math.inf
        self._first_s: float | None = None
        self._now_s = 0.0

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:  # noqa: ARG002
        """See `Pilot`."""
        now_s = telemetry.t_s
        step_s = 0.0 if self._first_s is None else now_s - self._now_s
        self._first_s, self._now_s = now_s if self._first_s is None else self._first_s, now_s
        wanted_rad = self._elevation_rad(observation)
        if wanted_rad is not None:
            self._seen_s = observation.t_s
        blind = now_s - self._seen_s > self._stale_s
        if blind:
            searching_s = now_s - max(self._seen_s + self._stale_s, self._first_s)
            wanted_rad = search(searching_s, self._search)[1]
        self._pitch_rad = smoothed_rad(self._pitch_rad, wanted_rad, step_s, self._lag_s)
        pitch, roll, heave, yaw = (100.0 * self.action).tolist()
        intent, reason = Intent.LAND if heave < 0.0 else Intent.FLY, "action"
        if blind:
            pitch, roll, heave, intent, reason = 0.0, 0.0, max(heave, 0.0), Intent.SEARCH, "action: nothing seen"
        command = PilotCommand(now_s, pitch, roll, heave, yaw, self._pitch_rad, intent)
        return Decision(command, None, reason)

    def _elevation_rad(self, observation: Observation) -> float | None:
        """Elevation of the seen target above the horizon [rad]; None without one."""
        if observation.bar_pose is not None:
            ahead_m, right_m, down_m = observation.bar_pose.position_in_bar_m.tolist()
            return math.atan2(down_m, max(math.hypot(ahead_m, right_m), 0.1))
        box = observation.bar_box or observation.ship_box
        return None if box is None else box_elevation_rad(box, observation, self._view)


class ResidualPilot:
    """Another pilot's sticks plus the action times a bound, (4,) shares of the full stick; the rest is the other's.

    Added while the other flies or lands; while it searches, holds or goes around it flies alone.
    """

    def __init__(self, inner: Pilot, bound: Array) -> None:
        self.action: Array = np.zeros(STICKS)
        self._inner, self._bound_percent = inner, 100.0 * bound

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """See `Pilot`."""
        decision = self._inner.decide(observation, telemetry, sent)
        command = decision.command
        if command.intent not in (Intent.FLY, Intent.LAND):
            return decision
        pitch, roll, heave, yaw = (command.sticks_percent + self._bound_percent * self.action).tolist()
        command = PilotCommand(command.t_s, pitch, roll, heave, yaw, command.gimbal_pitch_rad, command.intent)
        return replace(decision, command=command)


class SteeredPilot(Steering):
    """The pilot `horizon` with the action in the place of a learned policy; it plans before the action is known."""

    def __init__(self, setup: PilotSetup, meaning: Action) -> None:
        self.action: Array = np.zeros(2)
        self.note = ""
        self._meaning, self._pilot = meaning, HorizonPilot(setup, self)

    def look(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Steered | None:
        """Plan a cycle; what a policy sees of it, None where it would not be asked."""
        self._planned = self._pilot.plan(observation, telemetry, sent)
        asked = self._pilot.own_input(self._planned)
        seen = None if asked is None else steered(*asked)
        return seen if seen is not None and self._meaning.applies(seen) else None

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:  # noqa: ARG002
        """Command what `look` planned; see `Pilot`."""
        return self._pilot.command(self._planned)

    def input_mps2(self, seen: Steered) -> Array:
        """See `Steering`."""
        return self._meaning.input_mps2(seen, self.action) if self._meaning.applies(seen) else seen.wanted_mps2
