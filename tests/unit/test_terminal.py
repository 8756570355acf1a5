"""What a flight shows never keeps it: a terminal that stands still, a reader that has gone, words that move cursors."""

import logging
import os
import threading
from contextlib import contextmanager

import pytest
from made_up_flight import flight

from shipland.aside import Aside
from shipland.commands.fly import Fly, ProgressLine
from shipland.commands.terminal import Terminal
from shipland.errors import ConfigError, DataError, VehicleError
from shipland.evaluation.folder import claimed
from shipland.scenario.fly import Flown
from shipland.vehicles.checks import Check
from waiting import until


@contextmanager
def pipe():
    """Its two ends; a test may close one itself."""
    read_end, write_end = os.pipe()
    with os.fdopen(read_end, "rb", 0) as reader, os.fdopen(write_end, "wb", 0) as writer:
        yield reader, writer


def filled(write_end):
    """So that the next byte waits until somebody reads."""
    os.set_blocking(write_end, False)
    try:
        while True:
            os.write(write_end, bytes(4096))
    except BlockingIOError:
        os.set_blocking(write_end, True)


# Work aside


def test_whoever_gives_does_not_wait_and_what_is_too_much_is_counted():
    begun, go_on, done = threading.Event(), threading.Event(), []

    def slowly(thing):
        begun.set()
        go_on.wait()
        done.append(thing)

    aside = Aside(slowly, 3, "slow")
    aside.give(0)
    begun.wait()
    for thing in range(1, 10):
        aside.give(thing)
    assert (aside.waiting, aside.lost) == (3, 6)
    assert not aside.close(0.05)
    assert aside.lost == 9  # they will not be done
    go_on.set()
    assert aside.close()
    assert done == [0]


def test_all_that_was_given_is_done_in_order_before_the_end():
    done = []
    aside = Aside(done.append, 1000, "quick")
    for thing in range(500):
        aside.give(thing)
    assert aside.close()
    assert (done, aside.lost) == (list(range(500)), 0)


def test_work_that_raises_ends_alone():
    aside = Aside(lambda thing: 1 / thing, 10, "broken")
    for thing in (1, 0, 1):
        aside.give(thing)
    assert aside.close()
    aside.give(1)
    assert isinstance(aside.error, ZeroDivisionError)
    assert aside.lost == 3


# The terminal


def shown_by(act):
    with pipe() as (reader, writer):
        with Terminal(writer.fileno()) as terminal:
            act(terminal)
        writer.close()
        return reader.read().decode()


def test_lines_come_in_order_and_move_no_cursor():
    said = shown_by(lambda terminal: terminal.say("first [/red] 20°", "\x1b[2Jsecond\nthird\ud800"))
    assert said == "first [/red] 20°\n [2Jsecond third \n"


def test_a_terminal_that_stands_still_keeps_nobody_and_what_it_missed_is_counted():
    with pipe() as (_, writer):
        filled(writer.fileno())
        with Terminal(writer.fileno()) as terminal:
            progress = ProgressLine(terminal)
            for record in flight(pictures=False):
                progress.show(record)
            terminal.say(*map(str, range(5000)))
        assert terminal.lost > 3000


def test_a_reader_that_has_gone_ends_the_showing_only():
    with pipe() as (reader, writer):
        reader.close()
        with Terminal(writer.fileno()) as terminal:
            terminal.say("nobody reads this")
            until(lambda: terminal.lost == 1)
            terminal.say("nor this")
        assert terminal.lost == 2


def test_the_line_that_is_written_over_fits_and_stands_below_the_others():
    pty = pytest.importorskip("pty")
    master, slave = pty.openpty()
    try:
        with Terminal(slave) as terminal:
            assert terminal.is_live
            terminal.status("x" * 500)
            until(lambda: terminal._work.waiting == 0)
            terminal.say("a line")
        said = b""
        while not said.endswith(b"\r\x1b[K"):
            said += os.read(master, 65536)
    finally:
        os.close(slave)
        os.close(master)
    width = len(said.split(b"\r\x1b[K")[1])
    assert said.count(b"a line\r\n" + b"x" * width) == 1
    assert width < 500


def test_errors_of_the_program_are_shown_there_and_not_written_where_they_happen(capfd):
    def fail(_):
        try:
            raise ValueError("no sticks")
        except ValueError:
            logging.getLogger("shipland.flight").exception("pilot failed at 1 s")

    said = shown_by(fail)
    assert said.startswith("pilot failed at 1 s\nTraceback")
    assert said.endswith("ValueError: no sticks\n")
    assert capfd.readouterr().err == ""


class Handed:
    """A vehicle whose commander is told from elsewhere."""

    in_command = "shipland"


def test_who_is_in_command_is_shown_though_the_flight_stands():
    vehicle = Handed()
    with pipe() as (reader, writer), Terminal(writer.fileno()) as terminal, ProgressLine(terminal, vehicle):
        assert reader.readline() == b"in command: shipland\n"
        vehicle.in_command = "the pilot: LOITER"
        assert reader.readline() == b"in command: the pilot: LOITER\n"


# The checklist


class Fit:
    """A real vehicle, with nothing to find fault with."""

    def connect(self):
        pass

    def checks(self):
        return []

    def response(self):
        return None

    def close(self):
        pass


def test_a_check_leaves_an_earlier_flight_s_messages_alone(tmp_path, monkeypatch):
    logs = []

    def made(address, scenario, calibration, config, log):
        logs.append(log.name)
        return Fit()

    monkeypatch.setattr("shipland.scenario.real_vehicle.make_vehicle", made)
    monkeypatch.setattr("shipland.scenario.real_vehicle.checklist", lambda *_: [])
    monkeypatch.setattr("shipland.scenario.fly.fly_quietly", lambda *_, **__: Flown(None, None))
    monkeypatch.setattr("shipland.scenario.fly.Flown.reason", "")
    monkeypatch.setattr("shipland.commands.fly._LISTENING_S", 0.0)
    assert Fly(vehicle="fake://here", out=tmp_path, check=True).run() == 0
    assert logs == ["check.tlog"]
    monkeypatch.setattr("shipland.scenario.real_vehicle.checklist", lambda *_: [Check("battery", False, "12 %")])
    with pytest.raises(VehicleError, match="not fit to fly: battery: 12 %"):  # a script goes by it
        Fly(vehicle="fake://here", out=tmp_path, check=True).run()


def test_a_vehicle_that_was_connected_is_let_go_of_whatever_keeps_the_flight_from_beginning(tmp_path, monkeypatch):
    class Counted(Fit):
        camera, closed = None, 0

        def close(self):
            self.closed += 1

    vehicle = Counted()

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("shipland.commands.fly.Fly._outside", lambda *_: vehicle)
    monkeypatch.setattr("shipland.api.fly", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Fly(vehicle="fake://here", out=tmp_path).run()
    assert vehicle.closed == 1


@pytest.mark.parametrize("option", [{"check": True}, {"wind_mps": 9.0}])
def test_options_of_a_vehicle_outside_are_refused_with_a_recording(option, tmp_path, monkeypatch):
    monkeypatch.setattr("shipland.scenario.real_vehicle.make_vehicle", lambda *_: object())
    with pytest.raises(ConfigError, match="nothing to check, and no wind"):
        Fly(vehicle="replay://film.mp4", out=tmp_path, **option).run()


def test_two_programs_do_not_write_over_one_another_s_record(tmp_path, monkeypatch):
    """The second is refused before it connects: the link's log of the first would be gone too."""
    monkeypatch.setattr("shipland.scenario.real_vehicle.make_vehicle", lambda *_: pytest.fail("made"))
    with claimed(tmp_path), pytest.raises(DataError, match="in this folder; wait"):
        Fly(vehicle="fake://here", out=tmp_path).run()
