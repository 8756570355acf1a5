"""The ablation's other side: a pilot that matches the deck's attitude while landing, as most of the literature does.

It receives the deck's true attitude without error or delay, which no real system has. So a worse result is caused by
following alone, not by errors of measurement.
"""

from __future__ import annotations

import math
from dataclasses import replace

from shipland.frames import euler_from_rotation
from shipland.guidance.pilot import Pilot
from shipland.guidance.response import clamp
from shipland.messages import Decision, Mode, Observation, PilotCommand, Telemetry
from shipland.scenario.scenario import FollowParameters
from shipland.vehicles.vehicle import GroundTruthSource


class DeckFollower:
    """Adds to another pilot's sticks the tilt that the deck has."""

    def __init__(
        self, pilot: Pilot, truth_source: GroundTruthSource, max_tilt_rad: float, parameters: FollowParameters
    ) -> None:
        self._pilot, self._truth_source = pilot, truth_source
        self._max_tilt_rad, self._parameters = max_tilt_rad, parameters

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """The other pilot's decision; while landing low, with the deck's roll and pitch added."""
        decision = self._pilot.decide(observation, telemetry, sent)
        truth = self._truth_source.truth_at(observation.t_s)
        if truth is None or decision.mode is not Mode.LAND or -truth.aircraft_in_deck_m[2] > self._parameters.below_m:
            return decision
        heading_rad = euler_from_rotation(truth.ned_from_body.rotation)[2]
        normal = truth.ned_from_deck.rotation[:, 2]
        forward = math.cos(heading_rad) * normal[0] + math.sin(heading_rad) * normal[1]
        right = math.cos(heading_rad) * normal[1] - math.sin(heading_rad) * normal[0]
        # Upright on the deck, the aircraft's down axis is the deck's: its forward part is the tangent of pitch.
        pitch = -100.0 * math.atan2(forward, normal[2]) / self._max_tilt_rad
        roll = -100.0 * math.atan2(right, normal[2]) / self._max_tilt_rad
        command = decision.command
        return replace(
            decision,
            command=replace(
                command,
                pitch_percent=clamp(command.pitch_percent + pitch, 100.0),
                roll_percent=clamp(command.roll_percent + roll, 100.0),
            ),
        )
