"""A scenario as the batched last phase has it."""

from __future__ import annotations

from shipland.errors import ConfigError
from shipland.learning.policy.setup import PhaseSetup
from shipland.scenario.autonomy import response_of
from shipland.scenario.scenario import Scenario


def last_phase_of(scenario: Scenario) -> PhaseSetup:
    """The parts of a scenario that the batched last phase models.

    Raises:
        ConfigError: it does not model the aircraft's sticks or telemetry.
    """
    guidance, delays = scenario.guidance, scenario.delays
    try:
        return PhaseSetup(
            horizon=guidance.horizon,
            response=response_of(scenario),
            hover_height_m=guidance.approach.hover_height_m,
            settle_s=guidance.modes.settle_s,
            slew_per_s=0.01 * scenario.safety.slew_percent_per_s,
            rig=scenario.rig,
            aircraft=scenario.aircraft,
            ship=scenario.ship,
            wind=scenario.wind,
            cycle_s=1.0 / scenario.camera.frame_rate_hz,
            picture_age_s=delays.video_s + delays.near_s,
            velocity_hz=delays.telemetry.chosen.velocity.rate_hz,
        )
    except ValueError as error:
        raise ConfigError(str(error)) from None
