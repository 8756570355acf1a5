"""The keys of a flight: every one counts, the last one holds, and no terminal stops anything."""

import os
import pty
import signal
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from shipland.messages import Decision, GimbalAttitude, Intent, Observation, PilotCommand, Telemetry
from shipland.missions.outside import KeyedPilot, Keys

SEEN = Observation(0.0, GimbalAttitude(0.0, 0.0))
TOLD = Telemetry(1.0, 0.0, 0.0, 0.0, 1.0, np.zeros(3), 90.0, 90.0, True)


@contextmanager
def keyboard(monkeypatch):
    """Keys, and the descriptor that types them."""
    master, slave = pty.openpty()
    with os.fdopen(slave, "r") as stdin, monkeypatch.context() as patch, os.fdopen(master, "wb", 0) as typist:
        patch.setattr("sys.stdin", stdin)
        with Keys().listening() as keys:
            yield keys, typist


@pytest.mark.parametrize(("typed", "pressed"), [("hc", "c"), ("ch", "h"), ("chr", ""), ("hx", "h"), ("\x1b[Ahé", "h")])
def test_of_several_keys_in_one_cycle_the_last_holds(typed, pressed, monkeypatch):
    with keyboard(monkeypatch) as (keys, typist):
        typist.write(typed.encode())
        assert keys.pressed == pressed
        assert keys.pressed == pressed
        typist.write(b"r")
        assert keys.pressed == ""


def test_a_terminal_that_has_gone_presses_nothing_and_is_not_asked_again(monkeypatch):
    with keyboard(monkeypatch) as (keys, typist):
        typist.write(b"h")
        assert keys.pressed == "h"
        typist.close()
        assert keys.pressed == "h"
        monkeypatch.setattr("select.select", lambda *_: pytest.fail("asked again"))
        assert keys.pressed == "h"


@pytest.mark.parametrize("closed", [True, False])
def test_without_a_terminal_there_are_no_keys(closed, monkeypatch):
    with Path(os.devnull).open() as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        if closed:
            stdin.close()
        with Keys().listening() as keys:
            assert keys.pressed == ""
    monkeypatch.setattr("sys.stdin", None)
    with Keys().listening() as keys:
        assert keys.pressed == ""


def test_no_key_of_the_terminal_suspends_a_flight(monkeypatch):
    before = signal.getsignal(signal.SIGTSTP)
    with keyboard(monkeypatch):
        assert signal.getsignal(signal.SIGTSTP) is signal.SIG_IGN
    assert signal.getsignal(signal.SIGTSTP) is before


class Failing:
    def decide(self, observation, telemetry, sent):
        raise RuntimeError("no idea")


class Blind:
    """Its camera's pitch is no number."""

    def decide(self, observation, telemetry, sent):
        return Decision(PilotCommand(telemetry.t_s, 50.0, 0.0, 0.0, 0.0, float("nan")), None, "")


@pytest.mark.parametrize("pilot", [Failing(), Blind()])
@pytest.mark.parametrize(("key", "intent", "heave_percent"), [("h", Intent.HOLD, 0.0), ("c", Intent.CLIMB_OUT, 50.0)])
def test_a_key_holds_whatever_becomes_of_the_pilot(pilot, key, intent, heave_percent):
    keys = Keys()
    keys.press(key)
    sent = PilotCommand.hold(0.9, -0.3)
    command = KeyedPilot(pilot, keys).decide(SEEN, TOLD, sent).command
    assert command == PilotCommand(1.0, 0.0, 0.0, heave_percent, 0.0, -0.3, intent)


def test_without_a_key_a_pilot_that_fails_is_the_loop_s_to_answer():
    with pytest.raises(RuntimeError, match="no idea"):
        KeyedPilot(Failing(), Keys()).decide(SEEN, TOLD, None)
