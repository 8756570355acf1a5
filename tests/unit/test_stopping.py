"""Requests to stop: never lost, answered between two steps, and no worker outlives its parent."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from interrupts import receive
from shipland import stopping
from shipland.stopping import ENDING, check_stop, signals_interrupt, sleep_or_stop, stop_requests, uninterrupted
from shipland.workers import run_jobs


class Dying:
    """Its finaliser is interrupted: Python drops a KeyboardInterrupt raised there."""

    def __del__(self):
        receive(signal.SIGINT)
        time.sleep(0.0)


@pytest.fixture(autouse=True)
def the_usual_handlers():
    before = signal.getsignal(signal.SIGINT)
    yield
    assert signal.getsignal(signal.SIGINT) is before


def test_a_request_that_falls_into_a_finaliser_is_kept():
    with pytest.raises(KeyboardInterrupt), stop_requests():
        dying = Dying()
        del dying
        reached = True
        check_stop()
        reached = False
    assert reached


@pytest.mark.parametrize("how", ENDING)
def test_a_request_that_nobody_looked_for_is_answered_at_the_end(how):
    with pytest.raises(KeyboardInterrupt), stop_requests():
        receive(how)
        reached = True
    assert reached
    with stop_requests():
        check_stop()  # the next block begins without one


def test_work_on_another_thread_that_ends_does_not_answer_a_request():
    def work():
        with stop_requests():
            pass

    with pytest.raises(KeyboardInterrupt), stop_requests():
        receive(signal.SIGINT)
        beside = threading.Thread(target=work)
        beside.start()
        beside.join()
        check_stop()
        pytest.fail("the request was forgotten")


def test_an_answered_request_is_not_answered_again():
    with stop_requests():
        receive(signal.SIGINT)
        receive(signal.SIGINT)  # at once: the same request, passed on by a wrapper
        with pytest.raises(KeyboardInterrupt):
            check_stop()
        check_stop()


def test_a_second_signal_interrupts_where_it_falls(no_grace):
    reached = False
    with pytest.raises(KeyboardInterrupt), stop_requests():
        receive(signal.SIGINT)
        reached = True
        receive(signal.SIGINT)
        time.sleep(0.0)
        reached = False
    assert reached


@pytest.fixture
def no_grace(monkeypatch):
    monkeypatch.setattr(stopping, "_GRACE_S", -1.0)


def test_what_must_not_be_cut_short_is_not_by_any_number_of_signals(no_grace):
    done = []

    @uninterrupted()
    def let_go():
        for _ in range(3):
            receive(signal.SIGINT)
            check_stop()
        done.append("hold")

    with pytest.raises(KeyboardInterrupt), stop_requests():
        let_go()
        done.append("after")
        check_stop()
        done.append("never")
    assert done == ["hold", "after"]

    with pytest.raises(KeyboardInterrupt), stop_requests():
        try:
            receive(signal.SIGINT)
            check_stop()
        finally:
            let_go()
    assert done == ["hold", "after", "hold"]


@pytest.mark.parametrize("how", ENDING)
def test_where_signals_interrupt_they_do_so_after_what_must_not_be_cut_short(how):
    done, before = [], signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), signals_interrupt(), uninterrupted():
            receive(how)
            done.append("hold")
        with pytest.raises(KeyboardInterrupt), signals_interrupt():
            receive(how)
    finally:
        signal.signal(signal.SIGINT, before)
    assert done == ["hold"]


def test_a_second_signal_soon_after_the_answer_is_the_same_request():
    done = []
    with pytest.raises(KeyboardInterrupt), stop_requests():
        receive(signal.SIGINT)
        stopping._request.last_s -= 10.0  # it was not looked for so long
        try:
            check_stop()
        finally:
            receive(signal.SIGINT)
            done.append("let go of")
    assert done == ["let go of"]


def test_a_wait_answers_a_request():
    with pytest.raises(KeyboardInterrupt), stop_requests():
        receive(signal.SIGINT)
        sleep_or_stop(1e6)


def test_a_hang_up_that_nohup_has_taken_away_stays_away():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stop_requests():
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_request_ends_the_jobs_and_keeps_what_is_finished(workers):
    kept = {}
    with pytest.raises(KeyboardInterrupt), stop_requests():
        for job, _ in run_jobs(abs, range(1000), workers, kept.__setitem__, print):
            if job >= 3:
                receive(signal.SIGINT)
    assert 4 <= len(kept) <= 10


def test_workers_die_with_their_parent(tmp_path):
    (tmp_path / "idle.py").write_text(
        "import os, pathlib, time\n"
        "from shipland.workers import run_jobs\n"
        "def idle(path):\n"
        "    pathlib.Path(path).write_text(str(os.getpid()))\n"
        "    time.sleep(600)\n"
        f"list(run_jobs(idle, [{str(tmp_path / 'a')!r}, {str(tmp_path / 'b')!r}], 2, print, print))\n"
    )
    files = [tmp_path / "a", tmp_path / "b"]
    with subprocess.Popen([sys.executable, str(tmp_path / "idle.py")]) as parent:
        try:
            while not all(file.exists() and file.read_text() for file in files):
                assert parent.poll() is None
                time.sleep(0.05)
        finally:
            parent.kill()
    workers = [int(file.read_text()) for file in files]
    until_s = time.monotonic() + 60.0
    while any(_runs(worker) for worker in workers) and time.monotonic() < until_s:
        time.sleep(0.05)
    for worker in workers:
        if _runs(worker):
            os.kill(worker, signal.SIGKILL)
            pytest.fail("a worker outlived its parent")


def _runs(process):
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"
