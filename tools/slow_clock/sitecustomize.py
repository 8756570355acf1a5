"""A clock that runs at `SHIPLAND_CLOCK_SPEED` of real time, for every Python process that has this folder on its path.

A machine that draws a picture in a third of a second then flies in its own time with the camera in the loop: what
sleeps, waits and reads the clock does so in slow motion. `tools/land_outside.py --speed` puts it there; what is waited
for in the kernel (sockets) is not slowed.
"""

from __future__ import annotations

import os
import threading
import time


def _slow_down(speed: float) -> None:
    monotonic, perf_counter, sleep, wait = time.monotonic, time.perf_counter, time.sleep, threading.Condition.wait
    epoch, clock = time.time, time.clock_gettime

    def waiting(self: threading.Condition, timeout: float | None = None) -> bool:
        return wait(self, None if timeout is None else timeout / speed)

    time.monotonic = lambda: speed * monotonic()
    time.monotonic_ns = lambda: int(1e9 * speed * monotonic())
    time.time = lambda: speed * epoch()  # stamps that two processes exchange
    time.clock_gettime = lambda which: speed * clock(which)
    time.perf_counter = lambda: speed * perf_counter()
    time.sleep = lambda seconds: sleep(seconds / speed)
    threading.Condition.wait = waiting  # type: ignore[method-assign]


_speed = float(os.environ.get("SHIPLAND_CLOCK_SPEED", "1"))
if 0.0 < _speed < 1.0:
    _slow_down(_speed)
