"""Hostile MAVLink: sound messages of every kind with random fields, the same with bits turned, and plain noise.

They come from the vehicle's own address and from a stranger's. Nothing may raise, and nothing may be commanded.
"""

from __future__ import annotations

import random
import time
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as m

from shipland.vehicles.mavlink.guard import Orders
from shipland.vehicles.mavlink.link import LinkCounts
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.setpoints import attitude_message
from shipland.vehicles.wanted import HeadingSetPoint, Wanted, thrust_of

OURS, STRANGER = ("127.0.0.1", 5760), ("127.0.0.1", 6666)


class Nowhere:
    """A port that keeps what is sent."""

    stream, problem = False, ""

    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def receive(self) -> tuple[bytes, object, float] | None:
        """Nothing comes by itself."""
        time.sleep(0.05)
        return None

    def send(self, data: bytes, to: object) -> None:
        """Keep it."""
        del to
        self.sent.append(data)

    def watch(self, orders: Orders | None) -> None:
        """Nobody holds in our place."""

    def close(self) -> None:
        """Nothing to let go."""


def random_field(kind: str, length: int, rng: random.Random) -> Any:  # noqa: ANN401 - any field
    """A value of a message's field, often an extreme one."""
    if kind == "char":
        return bytes(rng.randrange(256) for _ in range(length))
    if kind in ("float", "double"):
        values = [
            rng.choice([0.0, -1.0, 1e30, -1e30, 1e-40, float("nan"), float("inf"), -float("inf"), rng.uniform(-10, 10)])
            for _ in range(max(1, length))
        ]
    else:
        bits = int(kind.removeprefix("u").removeprefix("int").removesuffix("_t"))
        low, high = (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        values = [rng.choice([low, high, 0, rng.randint(low, high)]) for _ in range(max(1, length))]
    return values if length > 0 else values[0]


def random_message(kind: Any, codec: Any, rng: random.Random) -> bytes:  # noqa: ANN401 - generated
    """A sound message with random fields."""
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    values = [
        random_field(each, lengths[name], rng) for name, each in zip(kind.fieldnames, kind.fieldtypes, strict=True)
    ]
    return bytes(kind(*values).pack(codec))


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Bits turned, bytes cut off or added."""
    mutated = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        if mutated:
            mutated[rng.randrange(len(mutated))] ^= 1 << rng.randrange(8)
    if rng.random() < 0.2:
        del mutated[rng.randrange(len(mutated) + 1) :]
    if rng.random() < 0.2:
        mutated += rng.randbytes(rng.randint(1, 40))
    return bytes(mutated)


def fuzz(count: int, seed: int) -> tuple[LinkCounts, int, list[bytes], bool]:
    """Counts of the link, messages with impossible values, what was sent, and whether set-points still are sane."""
    rng, port = random.Random(seed), Nowhere()
    session = Session(port, 245, 191, None, None, None, lambda *_: None)
    codec = m.MAVLink(None, srcSystem=1, srcComponent=1)
    kinds = list(m.mavlink_map.values())
    heartbeat = m.MAVLink_heartbeat_message(2, m.MAV_AUTOPILOT_ARDUPILOTMEGA, 129, 4, 4, 3)
    session.link.take(heartbeat.pack(codec), OURS, 0.0)
    pool = [random_message(rng.choice(kinds), codec, rng) for _ in range(min(count, 20_000))]
    for index in range(count):
        data = rng.choice(pool)
        if index % 3 == 0:
            data = mutate(data, rng)
        elif index % 50 == 1:
            data = rng.randbytes(rng.randint(1, 280))
        session.link.take(data, STRANGER if index % 10 == 0 else OURS, 1e-3 * index)
    state = session.state
    heading_rad = state.heading_rad if state.heading_rad == state.heading_rad else 0.0
    to_rad = HeadingSetPoint().next_rad(0.0, heading_rad, 0.02)
    level = attitude_message(Wanted(0.0, 0.0, 0.0, 0.0), to_rad, thrust_of(0.0, 2.5, 1.5), 1, 0)
    w, x, y, z = level.q
    sane = abs(w * w + x * x + y * y + z * z - 1.0) < 1e-6 and max(abs(x), abs(y)) < 1e-9 and level.thrust == 0.5
    return session.link.counts, session.refused, port.sent, sane


def mavlink(rng: np.random.Generator) -> None:
    """Two thousand datagrams: no handler fails, nothing is answered, and the next set-point is level."""
    counts, _, sent, sane = fuzz(2000, int(rng.integers(2**31)))
    assert counts.failed == 0, counts
    assert sent == [], sent
    assert sane, "a level set-point is none any more"
