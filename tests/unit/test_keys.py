"""The keys of a flight: every one counts, the last one holds, and no terminal stops anything."""

import os
import pty
import signal
from contextlib import contextmanager
from pathlib import Path

import pytest

from shipland.messages import Override
from shipland.scenario.real_vehicle import Keys

HOLD, CLIMB = Override.HOLD, Override.CLIMB


@contextmanager
def keyboard(monkeypatch):
    """Keys, and the descriptor that types them."""
    master, slave = pty.openpty()
    with os.fdopen(slave, "r") as stdin, monkeypatch.context() as patch, os.fdopen(master, "wb", 0) as typist:
        patch.setattr("sys.stdin", stdin)
        with Keys().listening() as keys:
            yield keys, typist


def test_what_was_typed_before_the_flight_is_no_key_of_it(monkeypatch):
    master, slave = pty.openpty()
    with os.fdopen(slave, "r") as stdin, os.fdopen(master, "wb", 0) as typist:
        monkeypatch.setattr("sys.stdin", stdin)
        typist.write(b"cd out; exec\n")
        with Keys().listening() as keys:
            assert keys.override() is None


@pytest.mark.parametrize(
    ("typed", "pressed"),
    [
        ("hc", CLIMB),
        ("ch", HOLD),
        ("chr", None),
        ("hx", HOLD),
        ("\x1b[Ahé", HOLD),
        ("C", CLIMB),
        ("H", HOLD),
        ("h\x1b[C\x1bOr", HOLD),
    ],
)
def test_of_several_keys_in_one_cycle_the_last_holds(typed, pressed, monkeypatch):
    with keyboard(monkeypatch) as (keys, typist):
        typist.write(typed.encode())
        assert keys.override() is pressed
        assert keys.override() is pressed
        typist.write(b"r")
        assert keys.override() is None


@pytest.mark.parametrize(
    ("reads", "pressed"),
    [
        (["h", "\x1b", "[C"], HOLD),
        (["h", "\x1b[", "C"], HOLD),
        (["h", "\x1b[1;", "5C"], HOLD),
        (["h", "\x1bO", "C"], HOLD),
        (["h", "\x1b[?1;2c"], HOLD),
        (["h", "\x1b[?1;", "2c"], HOLD),
        (["h", "\x1b[[C"], HOLD),
        (["c", "\x1b[", "H"], CLIMB),
        (["\x1b", "h"], HOLD),
        (["\x1b[C", "\x1b", "", "c"], CLIMB),
    ],
)
def test_a_sequence_presses_no_key_however_it_is_read(reads, pressed, monkeypatch):
    with keyboard(monkeypatch) as (keys, typist):
        for typed in reads:
            typist.write(typed.encode())
            keys.override()
        assert keys.override() is pressed


def test_a_terminal_that_has_gone_presses_nothing_and_is_not_asked_again(monkeypatch):
    with keyboard(monkeypatch) as (keys, typist):
        typist.write(b"h")
        assert keys.override() is HOLD
        typist.close()
        assert keys.override() is HOLD
        monkeypatch.setattr("select.select", lambda *_: pytest.fail("asked again"))
        assert keys.override() is HOLD


@pytest.mark.parametrize("closed", [True, False])
def test_without_a_terminal_there_are_no_keys(closed, monkeypatch):
    with Path(os.devnull).open() as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        if closed:
            stdin.close()
        with Keys().listening() as keys:
            assert keys.override() is None
    monkeypatch.setattr("sys.stdin", None)
    with Keys().listening() as keys:
        assert keys.override() is None


def test_no_key_of_the_terminal_suspends_a_flight(monkeypatch):
    before = signal.getsignal(signal.SIGTSTP)
    with keyboard(monkeypatch):
        assert signal.getsignal(signal.SIGTSTP) is signal.SIG_IGN
    assert signal.getsignal(signal.SIGTSTP) is before
