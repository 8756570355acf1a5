"""A pilot for tests: the same sticks whatever it sees, as a go-around, which the safety lets through unseen."""

from shipland.messages import Decision, Intent, Observation, PilotCommand, Telemetry

PITCH_PERCENT = 40.0


class Steady:
    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        command = PilotCommand(telemetry.t_s, PITCH_PERCENT, 0.0, 0.0, 0.0, -0.2, Intent.GO_AROUND)
        return Decision(command, None, "steady")


def steady(setup: object) -> Steady:
    return Steady()
