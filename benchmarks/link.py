"""What the guard process between the port and us adds to a message's way: one way over loopback, with it and without.

python benchmarks/link.py 2000
"""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Callable

import numpy as np

from shipland.vehicles.mavlink.guard_process import GuardedPort

PERIOD_S = 0.005
"""Between two messages: about as a vehicle sends them."""
BYTES = 40


def ways_us(send: Callable[[], object], receive: Callable[[], object], count: int) -> str:
    """A message's time from end to end."""
    times_us = []
    for _ in range(count):
        time.sleep(PERIOD_S)
        begun_s = time.perf_counter()
        send()
        while receive() is None:
            pass
        times_us.append(1e6 * (time.perf_counter() - begun_s))
    return f"{np.median(times_us):6.0f} {np.quantile(times_us, 0.99):6.0f} {max(times_us):7.0f}"


def bound() -> socket.socket:
    """A UDP socket on loopback."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    return made


def main() -> None:
    """Measure and print."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    data = bytes(BYTES)
    with bound() as vehicle, bound() as here:
        direct = ways_us(lambda: vehicle.sendto(data, here.getsockname()), lambda: here.recvfrom(100), count)
        place = here.getsockname()
        here.close()
        port = GuardedPort(f"udp:{place[0]}:{place[1]}")
        up = ways_us(lambda: vehicle.sendto(data, place), port.receive, count)
        peer = f"127.0.0.1:{vehicle.getsockname()[1]}"
        down = ways_us(lambda: port.send(data, peer), lambda: vehicle.recvfrom(100), count)
        port.close()
    print(f"{count} messages of {BYTES} bytes, one way [us]: median, 99 %, most")
    for name, row in (("without a guard", direct), ("vehicle to us", up), ("us to vehicle", down)):
        print(f"{name:16} {row}")


if __name__ == "__main__":
    main()
