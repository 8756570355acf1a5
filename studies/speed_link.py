"""What the guard process between the port and us adds to a message's way: one way over loopback."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Sequence

import numpy as np

from shipland.vehicles.mavlink.guard_process import GuardedPort
from studies.harness import Case, Column, Row, Study

PERIOD_S = 0.005
"""Between two messages: about as a vehicle sends them."""
BYTES = 40
WAYS = ("without a guard", "vehicle to us", "us to vehicle")


def row_of(send: Callable[[], object], receive: Callable[[], object], count: int) -> Row:
    """A message's time from end to end."""
    times_s = []
    for _ in range(count):
        time.sleep(PERIOD_S)
        begun_s = time.perf_counter()
        send()
        while receive() is None:
            pass
        times_s.append(time.perf_counter() - begun_s)
    return {"median_s": float(np.median(times_s)), "late_s": float(np.quantile(times_s, 0.99)), "most_s": max(times_s)}


def bound() -> socket.socket:
    """A UDP socket on loopback."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    return made


def cases() -> Sequence[Case]:
    """Ways."""
    return [{"way": way} for way in WAYS]


def measure(case: Case, runs: int) -> Row:
    """`runs` messages."""
    data = bytes(BYTES)
    with bound() as vehicle, bound() as here:
        place = here.getsockname()
        if case["way"] == WAYS[0]:
            return row_of(lambda: vehicle.sendto(data, place), lambda: here.recvfrom(100), runs)
        here.close()
        port = GuardedPort(f"udp:{place[0]}:{place[1]}")
        try:
            vehicle.sendto(data, place)
            while port.receive() is None:
                pass
            peer = f"127.0.0.1:{vehicle.getsockname()[1]}"
            if case["way"] == WAYS[1]:
                return row_of(lambda: vehicle.sendto(data, place), port.receive, runs)
            return row_of(lambda: port.send(data, peer), lambda: vehicle.recvfrom(100), runs)
        finally:
            port.close()


STUDY = Study(
    question="What does the guard process add to a message's way?",
    columns={
        "way": Column("way"),
        "median_s": Column("median [ms]", ".2f", 1e3),
        "late_s": Column("99 % within [ms]", ".2f", 1e3),
        "most_s": Column("longest [ms]", ".1f", 1e3),
    },
    cases=cases,
    measure=measure,
    runs=2000,
    minutes=1,
    alone=True,
    files=("src/shipland/vehicles/mavlink",),
)
