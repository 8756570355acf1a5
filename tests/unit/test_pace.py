"""A thread at a steady rate."""

import os
import threading

from shipland.vehicles.pace import Pace


def test_a_turn_that_raises_is_counted_and_the_next_one_comes() -> None:
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
    assert min(steps_s) >= 0.0


def test_the_process_goes_first_only_while_it_runs() -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    seen: list[int] = []
    main, done = threading.main_thread().native_id, threading.Event()
    assert main is not None

    def turn(_: float) -> None:
        seen.append(os.getpriority(os.PRIO_PROCESS, main))
        done.set()

    pace = Pace(turn, 100.0, "turns")
    pace.start()
    assert done.wait(10.0)
    pace.stop()
    assert os.getpriority(os.PRIO_PROCESS, 0) == before
    assert (seen[0] < before) == pace.preferred or before <= -15
