"""The wire to a MAVLink vehicle: one port, a receiving thread, signing, and counts of what was refused.

Whoever listens does so on loopback unless another address is typed. Nothing received can raise here: what is no
message, has a wrong checksum or signature, or comes from another sender is dropped and counted.
"""

from __future__ import annotations

import contextlib
import hashlib
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Protocol

from shipland.errors import ConfigError, VehicleError
from shipland.vehicles.mavlink.dialect import Message, dialect

LOOPBACK = "127.0.0.1"
_RADIO_STATUS = 109
"""Made by the telemetry radio itself, which knows no key."""
_SIGNING_EPOCH_S = 1420070400.0
"""1 January 2015: MAVLink signing counts 10 µs steps since then."""
_RECEIVE_BYTES = 65536


@dataclass
class LinkCounts:
    """What came and what was refused.

    Attributes:
        accepted: messages handed on.
        malformed: no message, a wrong checksum, a wrong or missing signature.
        foreign: sound messages of another sender.
        failed: messages whose handling failed.
        sent: messages sent.
        unsent: messages that the system would not take.
    """

    accepted: int = 0
    malformed: int = 0
    foreign: int = 0
    failed: int = 0
    sent: int = 0
    unsent: int = 0


class Port(Protocol):
    """Bytes in and out; `stream` says whether messages may be cut anywhere, as on a serial line."""

    stream: bool

    def receive(self) -> tuple[bytes, object] | None:
        """Bytes and their sender, within a tenth of a second; None where nothing came."""

    def send(self, data: bytes, to: object) -> None:
        """Send to a sender known from `receive`, or to the one fixed end; OSError when it cannot."""

    def close(self) -> None:
        """Let go."""


class UdpPort:
    """UDP; `listen` binds the address, otherwise it is where we send to."""

    stream = False

    def __init__(self, host: str, port: int, listen: bool) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.1)
        self._to = None if listen else (host, port)
        try:
            self._socket.bind((host, port) if listen else ("", 0))
        except OSError as error:
            self._socket.close()
            raise VehicleError(f"cannot listen on {host}:{port}: {error.strerror}") from None

    def receive(self) -> tuple[bytes, object] | None:
        """See `Port`."""
        with contextlib.suppress(TimeoutError, ConnectionError):
            return self._socket.recvfrom(_RECEIVE_BYTES)
        return None

    def send(self, data: bytes, to: object) -> None:
        """See `Port`."""
        place = self._to or to
        if isinstance(place, tuple):
            self._socket.sendto(data, place)

    def close(self) -> None:
        """See `Port`."""
        self._socket.close()


class TcpPort:
    """TCP to a listening autopilot or bridge."""

    stream = True

    def __init__(self, host: str, port: int) -> None:
        try:
            self._socket = socket.create_connection((host, port), 5.0)
        except OSError as error:
            raise VehicleError(f"cannot connect to {host}:{port}: {error.strerror or error}") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(0.1)
        self._sender = (host, port)

    def receive(self) -> tuple[bytes, object] | None:
        """See `Port`."""
        with contextlib.suppress(TimeoutError, ConnectionError):
            data = self._socket.recv(_RECEIVE_BYTES)
            if data:
                return data, self._sender
            time.sleep(0.1)  # the other end is closed; the vehicle's silence is noticed above
        return None

    def send(self, data: bytes, to: object) -> None:  # noqa: ARG002 - one fixed end
        """See `Port`."""
        self._socket.sendall(data)

    def close(self) -> None:
        """See `Port`."""
        self._socket.close()


class SerialPort:
    """A serial line; needs pyserial."""

    stream = True

    def __init__(self, device: str, baud: int) -> None:
        try:
            import serial
        except ModuleNotFoundError:
            raise VehicleError("serial: needs pyserial; install it with: pip install 'shipland[mavlink]'") from None
        try:
            self._port: Any = serial.Serial(device, baud, timeout=0.1, write_timeout=0.1)
        except (OSError, ValueError) as error:
            raise VehicleError(f"serial port {device} cannot be opened: {error}") from None
        self._sender = (device, baud)

    def receive(self) -> tuple[bytes, object] | None:
        """See `Port`."""
        data = self._port.read(max(1, self._port.in_waiting))
        return (data, self._sender) if data else None

    def send(self, data: bytes, to: object) -> None:  # noqa: ARG002 - one fixed end
        """See `Port`."""
        self._port.write(data)

    def close(self) -> None:
        """See `Port`."""
        self._port.close()


def open_port(place: str) -> Port:
    """The port of an address's place.

    `udp:HOST:PORT` and `udpin:HOST:PORT` listen, `udpout:HOST:PORT` and `tcp:HOST:PORT` connect, `serial:DEVICE:BAUD`
    opens a line. A host left out (`udp::14550`) is loopback.

    Raises:
        ConfigError: it is none of these.
        VehicleError: it cannot be opened.
    """
    kind, _, rest = place.partition(":")
    host, _, number = rest.rpartition(":")
    if kind in ("udp", "udpin", "udpout", "tcp", "serial") and number.isdecimal():
        value = int(number)
        if kind == "serial" and host:
            return SerialPort(host, value)
        if kind != "serial" and 0 < value < 65536:
            host = host or LOOPBACK
            return TcpPort(host, value) if kind == "tcp" else UdpPort(host, value, listen=kind != "udpout")
    raise ConfigError(
        f"mavlink://{place}: expected udp:HOST:PORT (listens), udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"
    )


class _Codec(dialect.MAVLink):  # type: ignore[misc] # untyped library
    """The dialect's codec; a bad signature leaves no trace.

    The library notes a stream's time stamp before it compares the signature, so that one forged message with a late
    stamp would lock the real sender out.
    """

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:  # noqa: N803
        """Whether a message is signed with our key and newer than the last."""
        stamps = self.signing.stream_timestamps
        before = dict(stamps)
        good = bool(super().check_signature(msgbuf, srcSystem, srcComponent))
        if not good:
            stamps.clear()
            stamps.update(before)
        return good


class MavlinkLink:
    """Receives on a thread of its own and hands sound messages of the one vehicle on.

    Args:
        port: the bytes.
        system, component: our own ids.
        on_message: called on the receiving thread with a message and its time of receipt [s, `time.monotonic`].
        key: 32 bytes: what is sent is signed, what is not signed with it is refused.
        log: raw messages of both directions, as a telemetry log (.tlog) has them.
    """

    def __init__(
        self,
        port: Port,
        system: int,
        component: int,
        on_message: Callable[[Message, float], None],
        key: bytes | None = None,
        log: BinaryIO | None = None,
    ) -> None:
        self._port, self._on_message, self._log = port, on_message, log
        self._codec = _Codec(None, srcSystem=system, srcComponent=component)
        self._codec.robust_parsing = True
        self._lock = threading.Lock()
        if key is not None:
            signing = self._codec.signing
            signing.secret_key, signing.sign_outgoing, signing.link_id = key, True, component
            signing.timestamp = int((time.time() - _SIGNING_EPOCH_S) * 1e5)
            signing.allow_unsigned_callback = lambda _codec, message_id: message_id == _RADIO_STATUS
        self._peer: object = None
        self._vehicle: int | None = None
        self._wanted: int | None = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._receive, name="mavlink-receive", daemon=True)
        self.counts = LinkCounts()
        """What came and what was refused."""

    @property
    def connected(self) -> bool:
        """Whether a vehicle has been heard."""
        return self._peer is not None

    @property
    def vehicle(self) -> int:
        """System id of the vehicle; 0 before it is heard."""
        return self._vehicle or 0

    @property
    def own(self) -> tuple[int, int]:
        """Our system and component id."""
        return self._codec.srcSystem, self._codec.srcComponent

    def follow(self, vehicle: int | None) -> None:
        """Take the next autopilot that says a heartbeat, or only the one with this system id."""
        self._wanted = vehicle

    def start(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def forget_peer(self) -> None:
        """The vehicle has fallen silent: it may come back from another port, with the same system id."""
        self._peer = None

    def send(self, message: Message) -> bool:
        """Send to the vehicle; False, and counted, when that is not possible now. Never raises."""
        with self._lock:
            try:
                data = message.pack(self._codec)
                self._codec.seq = (self._codec.seq + 1) % 256
                self._port.send(data, self._peer)
            except (OSError, struct.error, ValueError, TypeError, OverflowError):
                self.counts.unsent += 1
                return False
            self.counts.sent += 1
            self._write(data)
        return True

    def close(self) -> None:
        """Stop receiving and let go of the port."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(1.0)
        self._port.close()
        with self._lock:
            if self._log is not None:
                self._log.close()
                self._log = None

    def take(self, data: bytes, sender: object, received_s: float) -> None:
        """Take in bytes of a sender; the receiving thread's work, and what a test feeds."""
        try:
            if not self._port.stream:  # a datagram holds whole messages: what is left of the one before is rubbish
                self._codec.buf, self._codec.buf_index = bytearray(), 0
                self._codec.expected_length = dialect.HEADER_LEN_V1 + 2
            messages = self._codec.parse_buffer(data) or []
        except Exception:  # the parser is generated code over hostile bytes
            self.counts.malformed += 1
            self._codec.buf, self._codec.buf_index = bytearray(), 0
            return
        for message in messages:
            if message.get_type() == "BAD_DATA":
                self.counts.malformed += 1
            elif not self._is_ours(message, sender):
                self.counts.foreign += 1
            else:
                self._hand_on(message, received_s)

    def _is_ours(self, message: Message, sender: object) -> bool:
        """Whether a message is of the vehicle that is followed; the first autopilot's heartbeat makes it that.

        A telemetry radio has a system id of its own, and speaks from the vehicle's address.
        """
        system, component = message.get_srcSystem(), message.get_srcComponent()
        if self._peer is None:
            wanted = self._vehicle or self._wanted
            autopilot = message.get_type() == "HEARTBEAT" and component == dialect.MAV_COMP_ID_AUTOPILOT1
            if not autopilot or message.autopilot == dialect.MAV_AUTOPILOT_INVALID or wanted not in (None, system):
                return False
            self._peer, self._vehicle = sender, system
        return sender == self._peer and (system == self._vehicle or message.get_type() == "RADIO_STATUS")

    def _hand_on(self, message: Message, received_s: float) -> None:
        self.counts.accepted += 1
        with self._lock:
            self._write(bytes(message.get_msgbuf()))
        try:
            self._on_message(message, received_s)
        except Exception:  # a message must not end the thread that hears the next one
            self.counts.failed += 1

    def _receive(self) -> None:
        while not self._stopping.is_set():
            try:
                got = self._port.receive()
            except Exception:  # a port that is gone is silence
                time.sleep(0.1)
                continue
            if got is not None:
                self.take(got[0], got[1], time.monotonic())

    def _write(self, data: bytes) -> None:
        if self._log is not None:
            with contextlib.suppress(OSError, ValueError):
                self._log.write(struct.pack(">Q", int(time.time() * 1e6)) + data)


def read_key(path: Path) -> bytes:
    """A signing key: 32 bytes in a file, or any text, hashed as ground stations do.

    Raises:
        ConfigError: the file cannot be read or is empty.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"signing key {path} cannot be read: {error.strerror}") from None
    if len(data) == 32:
        return data
    text = data.strip()
    if not text:
        raise ConfigError(f"signing key {path} is empty")
    return hashlib.sha256(text).digest()
