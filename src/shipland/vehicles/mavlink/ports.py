"""Ports that carry MAVLink: UDP, TCP, a serial line. Whoever listens does so on loopback unless told otherwise."""

from __future__ import annotations

import contextlib
import socket
from dataclasses import dataclass
from typing import Any, Protocol

from shipland.errors import ConfigError, VehicleError
from shipland.extras import require

LOOPBACK = "127.0.0.1"
_RECEIVE_BYTES = 65536
_CONNECT_S = 5.0
_SEND_S = 0.1
"""How long a line may take to accept a message."""
_UNHEARD_MS = 3000
"""A TCP end that confirms nothing for so long is given up with what waits for it: commands must not come late."""

Sender = tuple[str, int]
"""Host and port, or device and baud rate."""


class Port(Protocol):
    """Bytes in and out; `stream` says whether messages may be cut anywhere, as on a serial line."""

    stream: bool

    def fileno(self) -> int:
        """To be waited for; `receive` is called once something is there."""

    def receive(self) -> tuple[bytes, Sender] | None:
        """What has come and its sender; None where that is nothing. OSError when the port is gone."""

    def send(self, data: bytes, to: Sender | None) -> None:
        """Send to the one fixed end, or else to `to`; OSError when it cannot."""

    def close(self) -> None:
        """Let go."""


class _EndPort:
    _end: Any
    """A socket, or a serial line."""

    def fileno(self) -> int:
        """See `Port`."""
        return int(self._end.fileno())

    def close(self) -> None:
        """See `Port`."""
        self._end.close()


class UdpPort(_EndPort):
    """UDP; `listen` binds the address and hears anyone, otherwise the address is the only one that is heard."""

    stream = False

    def __init__(self, host: str, port: int, listen: bool) -> None:
        self._end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._listens = listen
        try:
            self._end.bind((host, port)) if listen else self._end.connect((host, port))
        except OSError as error:
            self._end.close()
            verb = "listen on" if listen else "send to"
            raise VehicleError(f"cannot {verb} {host}:{port}: {error.strerror}") from None
        self._end.setblocking(False)

    def receive(self) -> tuple[bytes, Sender] | None:
        """See `Port`."""
        with contextlib.suppress(OSError):  # refused or unreachable, for now
            data, sender = self._end.recvfrom(_RECEIVE_BYTES)
            return data, sender
        return None

    def send(self, data: bytes, to: Sender | None) -> None:
        """See `Port`."""
        if not self._listens:
            self._end.send(data)
        elif to is not None:
            self._end.sendto(data, to)


class TcpPort(_EndPort):
    """TCP to a listening autopilot or bridge."""

    stream = True

    def __init__(self, host: str, port: int) -> None:
        try:
            self._end = socket.create_connection((host, port), _CONNECT_S)
        except OSError as error:
            raise VehicleError(f"cannot connect to {host}:{port}: {error.strerror or error}") from None
        self._end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._end.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNHEARD_MS)
        self._end.settimeout(_SEND_S)
        self._sender = (host, port)

    def receive(self) -> tuple[bytes, Sender] | None:
        """See `Port`."""
        with contextlib.suppress(TimeoutError):
            if data := self._end.recv(_RECEIVE_BYTES):
                return data, self._sender
            raise ConnectionResetError("the other end is closed")
        return None

    def send(self, data: bytes, to: Sender | None) -> None:  # noqa: ARG002 - one fixed end
        """See `Port`."""
        self._end.sendall(data)


class SerialPort(_EndPort):
    """A serial line; needs pyserial."""

    stream = True

    def __init__(self, device: str, baud: int) -> None:
        require("mavlink", "serial:", VehicleError, "serial")
        import serial

        try:
            self._end = serial.Serial(device, baud, timeout=0, write_timeout=_SEND_S, exclusive=True)
        except (OSError, ValueError) as error:
            raise VehicleError(f"serial port {device} cannot be opened: {error}") from None
        self._sender = (device, baud)

    def receive(self) -> tuple[bytes, Sender] | None:
        """See `Port`."""
        data = self._end.read(_RECEIVE_BYTES)
        return (data, self._sender) if data else None

    def send(self, data: bytes, to: Sender | None) -> None:  # noqa: ARG002 - one fixed end
        """See `Port`."""
        self._end.write(data)


@dataclass(frozen=True)
class Place:
    """Where a port leads.

    Attributes:
        kind: udp and udpin listen, udpout and tcp connect, serial opens a line.
        name: host or device.
        number: port or baud rate.
    """

    kind: str
    name: str
    number: int

    @staticmethod
    def of(words: str) -> Place:
        """From an address's place; a host left out (`udp::14550`) is loopback. ConfigError when it is none."""
        kind, _, rest = words.partition(":")
        name, _, number = rest.rpartition(":")
        if number.isdecimal() and len(number) < 10:
            value = int(number)
            if kind == "serial" and name:
                return Place(kind, name, value)
            if kind in ("udp", "udpin", "udpout", "tcp") and 0 < value < 65536:
                return Place(kind, name or LOOPBACK, value)
        raise ConfigError(
            f"mavlink://{words}: expected udp:HOST:PORT (listens), udpout:HOST:PORT, tcp:HOST:PORT or "
            "serial:DEVICE:BAUD"
        )

    def open(self) -> Port:
        """The port; VehicleError when it cannot be opened."""
        if self.kind == "serial":
            return SerialPort(self.name, self.number)
        if self.kind == "tcp":
            return TcpPort(self.name, self.number)
        return UdpPort(self.name, self.number, listen=self.kind != "udpout")
