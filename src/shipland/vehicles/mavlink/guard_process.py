"""The process that owns the port of a MAVLink vehicle, and our end of it.

It carries every message between the port and us. When no set-point of ours comes any more, because our process hangs,
was stopped or has died, it holds the vehicle in our place (`Guard`). It is in a session of its own, hears no signal
that ends us, and goes when our end of the socket is closed and nothing is left to hold.

    python -P -m shipland.vehicles.mavlink.guard_process PLACE SOCKET

PLACE is as in `mavlink://PLACE`, SOCKET the number of an inherited SOCK_SEQPACKET socket. Its records begin with a
letter. To the process: D, a message; W and orders, or W alone. From it: R (port open; 1: a stream), E (why it could not
be opened), D, P (what went on without us, in words). After D stand when it was sent or came (`time.monotonic`), the
length of the other end's address, the address, and the bytes.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import struct
import subprocess
import sys
import time
from contextlib import suppress

from shipland.errors import VehicleError
from shipland.vehicles.mavlink.guard import FRESH_S, Guard, Orders
from shipland.vehicles.mavlink.ports import Place, Port, Sender
from shipland.vehicles.priority import go_first

_RECORD_BYTES = 70_000
_START_S = 20.0
"""Timeout of opening the port: on a busy machine, to a TCP end that answers late."""
_GOODBYE_S = 2.0
_LATE_S = 0.5
"""A message of ours that has waited for longer is not sent: a line that is slow, or a process that stood still, would
fly what was decided for another time."""
_TURN_S = 0.05
"""Longest turn of the process. One that takes longer than a heartbeat is fresh has stood still, as a machine that is
suspended or starved does: what waits then is old."""
_HEAD = struct.Struct("<cdB")


def _message_record(peer: str, data: bytes) -> bytes:
    address = peer.encode()
    return _HEAD.pack(b"D", time.monotonic(), len(address)) + address + data


def _message_of(record: bytes) -> tuple[str, bytes, float]:
    _, at_s, length = _HEAD.unpack_from(record)
    end = _HEAD.size + length
    return record[_HEAD.size : end].decode(), record[end:], at_s


class GuardedPort:
    """The port as the link sees it; `stream` says whether messages may be cut anywhere, as on a serial line.

    Raises:
        ConfigError: the place is none.
        VehicleError: the process cannot be started or the port not be opened.
    """

    def __init__(self, place: str) -> None:
        Place.of(place)
        self.problem = ""
        """What is wrong at our end, or went on without us: the flight is over; empty while all is well."""
        self._watched = False
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        command = [sys.executable, "-P", "-m", __name__, place, str(theirs.fileno())]
        paths = os.pathsep.join(filter(None, sys.path))  # the very code that runs here
        with theirs:
            try:
                self._process = subprocess.Popen(  # noqa: S603 - our own module
                    command, env=os.environ | {"PYTHONPATH": paths}, pass_fds=[theirs.fileno()],
                    stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                    start_new_session=True,
                )  # fmt: skip
            except OSError as error:
                self._socket.close()
                raise VehicleError(f"the guard process of the link cannot be started: {error.strerror}") from None
        try:
            self.stream = self._opened()
        except BaseException:
            self.close()
            raise
        self._socket.setblocking(False)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)

    def _opened(self) -> bool:
        """Whether the port, once open, is a stream."""
        self._socket.settimeout(_START_S)
        try:
            record = self._socket.recv(_RECORD_BYTES)
        except TimeoutError:
            raise VehicleError(f"the guard process of the link did not start within {_START_S:g} s") from None
        if record[:1] != b"R":
            words = record[1:].decode() or f"the guard process of the link ended (status {self._process.wait()})"
            raise VehicleError(words)
        return record[1:] == b"1"

    def receive(self) -> tuple[bytes, object, float] | None:
        """Bytes, their sender and when they came, within a tenth of a second; None where nothing came."""
        if not self._poll.poll(100):
            return None
        with suppress(BlockingIOError, ConnectionError):
            record = self._socket.recv(_RECORD_BYTES)
            if record[:1] == b"D":
                peer, data, came_s = _message_of(record)
                return data, peer, came_s
            if record[:1] == b"P":
                self.problem = record[1:].decode()
            elif not record:
                self.problem = "the guard process of the link has ended"
                time.sleep(0.1)  # silence, which is noticed above
        return None

    def send(self, data: bytes, to: object) -> None:
        """Send to a sender known from `receive`, or to the one fixed end; OSError when it cannot."""
        self._socket.send(_message_record(str(to or ""), data))

    def watch(self, orders: Orders | None) -> None:
        """Hold the vehicle when no set-point of ours comes any more; None: silence is meant from now on."""
        if orders is None and not self._watched:
            return
        self._watched = orders is not None
        with suppress(OSError):  # it has ended: `receive` says so
            self._socket.send(b"W" + (b"" if orders is None else orders.to_json()))

    def close(self) -> None:
        """Let go of the port; nothing is held from then on."""
        self.watch(None)
        self._socket.close()
        try:
            self._process.wait(_GOODBYE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class _Relay:
    """Both directions, and what is due in our place."""

    def __init__(self, port: Port, ours: socket.socket) -> None:
        self._port, self._ours = port, ours
        self._poll = select.poll()
        for end in (port, ours):
            self._poll.register(end.fileno(), select.POLLIN)
        self._guard: Guard | None = None
        self._peer = ""
        self._gone = self._reported = self._backlog = False
        self._turn_s = time.monotonic()
        self._ready = set[int]()

    def run(self) -> None:
        """Until our process has gone and nothing is left to hold; what fails in a step keeps none from its turn."""
        steps = self._wait, self._tell_news, self._from_vehicle, self._from_us, self._send_due
        while not (self._gone and (self._guard is None or self._guard.over(time.monotonic()))):
            for step in steps:
                try:
                    step()
                except Exception as error:  # without it nothing reaches the vehicle, a hold neither
                    self._tell(f"the guard process of the link failed: {type(error).__name__}: {error}")

    def _wait(self) -> None:
        due_s = _TURN_S if self._guard is None else self._guard.due_s() - time.monotonic()
        self._ready = {number for number, _ in self._poll.poll(1e3 * min(max(0.0, due_s), _TURN_S))}
        late_s, self._turn_s = time.monotonic() - self._turn_s, time.monotonic()
        self._backlog = late_s > FRESH_S or (self._backlog and self._port.fileno() in self._ready)

    def _tell_news(self) -> None:
        """Before the vehicle's next message, which may report the mode that we requested."""
        if self._guard is not None:
            self._tell(self._guard.news)

    def _send_due(self) -> None:
        for data in [] if self._guard is None else self._guard.due(time.monotonic()):
            self._send(data)

    def _from_vehicle(self) -> None:
        if self._port.fileno() not in self._ready:
            return
        try:
            got = self._port.receive()
        except OSError:  # the port is gone: silence, which our process notices
            self._poll.unregister(self._port.fileno())
            return
        if got is not None:
            data, (name, number) = got
            peer = f"{name}:{number}"
            with suppress(OSError):  # our process hangs, or has gone
                self._ours.send(_message_record(peer, data))
            if self._guard is not None and peer == self._peer:
                self._guard.hear_vehicle(data, time.monotonic(), self._backlog)

    def _from_us(self) -> None:
        if self._ours.fileno() not in self._ready:
            return
        try:
            record = self._ours.recv(_RECORD_BYTES)
        except OSError:  # it went with messages unread; what it sent before comes next
            return
        if record[:1] == b"D":
            self._peer, data, sent_s = _message_of(record)
            taken, now_s = self._guard is not None and self._guard.taken, time.monotonic()
            if taken or now_s - sent_s > _LATE_S:
                return
            self._send(data)
            if self._guard is not None:
                self._guard.hear_us(data, now_s)
        elif record[:1] == b"W":
            self._guard = Guard(Orders.from_json(record[1:]), self._port.stream) if record[1:] else None
        else:
            self._gone = True
            self._poll.unregister(self._ours.fileno())
            if self._guard is not None:
                self._guard.lose_us(time.monotonic())

    def _send(self, data: bytes) -> None:
        name, _, number = self._peer.rpartition(":")
        to: Sender | None = (name, int(number)) if name else None
        with suppress(OSError):  # the port will not take it now: the next one
            self._port.send(data, to)

    def _tell(self, news: str) -> None:
        """What our process is to know when it wakes, once."""
        if news and not self._reported:
            with suppress(OSError):  # full until our process reads: later
                self._ours.send(b"P" + news.encode())
                self._reported = True


def main() -> None:
    """Open the port, say so, carry messages until our process has gone and the vehicle holds."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    place, descriptor = sys.argv[1:]
    ours = socket.socket(fileno=int(descriptor))
    try:
        port = Place.of(place).open()
    except Exception as error:  # of whatever opens it
        words = str(error) if isinstance(error, VehicleError) else f"{place}: {type(error).__name__}: {error}"
        ours.send(b"E" + words.encode())
        return
    ours.send(b"R1" if port.stream else b"R0")
    ours.setblocking(False)
    go_first("thread")
    _Relay(port, ours).run()


if __name__ == "__main__":
    main()
