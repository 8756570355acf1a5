"""A thread at a steady rate."""

import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from shipland.vehicles.pace import Pace

ROOT = Path(__file__).parents[2]


def test_a_turn_that_raises_is_counted_and_logged_once_and_the_next_one_comes(caplog: pytest.LogCaptureFixture) -> None:
    done = threading.Event()
    steps_s: list[float] = []

    def turn(step_s: float) -> None:
        steps_s.append(step_s)
        if len(steps_s) == 5:
            done.set()
        raise ValueError

    pace = Pace(turn, 200.0, "turns")
    pace.start()
    assert done.wait(10.0)
    pace.stop()
    taken = len(steps_s)
    assert pace.failed == taken == len(pace.late_s)
    assert [record.getMessage() for record in caplog.records] == ["a turn of turns failed"]
    assert min(steps_s) >= 0.0


def test_only_its_own_thread_goes_before_other_processes() -> None:
    seen: list[tuple[int, int, int]] = []
    main, done = threading.main_thread().native_id, threading.Event()
    assert main is not None
    before = os.getpriority(os.PRIO_PROCESS, main), os.sched_getscheduler(main)

    def turn(_: float) -> None:
        own = os.sched_getscheduler(threading.get_native_id())
        seen.append((own, os.getpriority(os.PRIO_PROCESS, main), os.sched_getscheduler(main)))
        done.set()

    pace = Pace(turn, 100.0, "turns")
    pace.start()
    assert done.wait(10.0)
    pace.stop()
    assert seen[0] == (os.SCHED_FIFO if pace.preferred else os.SCHED_OTHER, *before)
    assert (os.getpriority(os.PRIO_PROCESS, main), os.sched_getscheduler(main)) == before


def test_all_of_the_process_goes_first_where_that_is_wanted_and_only_while_it_runs() -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    seen: list[int] = []
    main, done = threading.main_thread().native_id, threading.Event()
    assert main is not None

    def turn(_: float) -> None:
        seen.append(os.getpriority(os.PRIO_PROCESS, main))
        done.set()

    pace = Pace(turn, 100.0, "turns", "process")
    pace.start()
    assert done.wait(10.0)
    pace.stop()
    assert os.getpriority(os.PRIO_PROCESS, 0) == before
    assert (seen[0] < before) == pace.preferred or before <= -15


def slice_ns() -> int | None:
    """Of the main thread's time slices; None where the system does not say."""
    place = Path(f"/proc/self/task/{threading.main_thread().native_id}/sched")
    found = re.search(r"se\.slice\s*:\s*(\d+)", place.read_text()) if place.exists() else None
    return None if found is None else int(found.group(1))


@pytest.mark.skipif(slice_ns() is None, reason="this system does not tell its time slices")
def test_the_process_has_short_slices_only_while_it_runs() -> None:
    before, done = slice_ns(), threading.Event()
    pace = Pace(lambda _: done.set(), 100.0, "turns")
    pace.start()
    assert done.wait(10.0)
    during = slice_ns()
    pace.stop()
    assert during == 1_000_000 != before
    assert slice_ns() == before


def test_a_slow_clock_is_no_suspended_machine():
    """`tools/slow_clock` slows every clock by which a suspended machine is told."""
    script = (
        "import time; from shipland.vehicles.pace import boot_s\n"
        "apart_s = boot_s() - time.monotonic(); time.sleep(0.2)\n"
        "assert abs(boot_s() - time.monotonic() - apart_s) < 0.05"
    )
    paths = os.pathsep.join([str(ROOT / "tools" / "slow_clock"), str(ROOT / "src")])
    env = os.environ | {"PYTHONPATH": paths, "SHIPLAND_CLOCK_SPEED": "0.2"}
    subprocess.run([sys.executable, "-c", script], env=env, check=True)
