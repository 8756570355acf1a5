"""A pilot of one's own in twenty lines: it stays up for a while before the packaged pilot may go down.

shipland fly --pilot own_pilot:patient --vision geometric --out out/patient      # in this folder
shipland campaign --pilot horizon,own_pilot:patient --runs 100                    # side by side with another
"""

from dataclasses import replace

from shipland.guidance.pilot import Pilot, PilotSetup, horizon
from shipland.messages import Decision, Observation, PilotCommand, Telemetry

CALM_S = 5.0


class Patient:
    """Flies as `inner` does, but does not go down before it has seen the bar for `CALM_S`."""

    def __init__(self, inner: Pilot) -> None:
        self.inner, self.seen_since_s = inner, None

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """One cycle: what was seen, what the vehicle says, and what was sent last."""
        if observation.bar_pose is not None and self.seen_since_s is None:
            self.seen_since_s = telemetry.t_s
        decision = self.inner.decide(observation, telemetry, sent)
        waits = self.seen_since_s is None or telemetry.t_s - self.seen_since_s < CALM_S
        heave = max(decision.command.heave_percent, 0.0) if waits else decision.command.heave_percent
        return replace(decision, command=replace(decision.command, heave_percent=heave))


def patient(setup: PilotSetup) -> Pilot:
    """The factory: called once a flight."""
    return Patient(horizon(setup))
