"""The wire to a MAVLink vehicle: one port, a receiving thread, signing, and counts of what was refused.

Nothing received can raise here: what is no message, has a wrong checksum or signature, or comes from another sender is
dropped and counted.
"""

from __future__ import annotations

import hashlib
import logging
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from shipland.aside import LogAside
from shipland.errors import ConfigError
from shipland.soundness import log_failure
from shipland.vehicles.mavlink.dialect import AUTOPILOT, Codec, Message, dialect

if TYPE_CHECKING:
    from shipland.vehicles.mavlink.guard_process import GuardedPort

_log = logging.getLogger(__name__)


@dataclass
class LinkCounts:
    """What came and what was refused.

    Attributes:
        malformed: no message, a wrong checksum, a wrong or missing signature.
        foreign: sound messages of another sender.
        failed: messages whose handling failed.
    """

    malformed: int = 0
    foreign: int = 0
    failed: int = 0


class MavlinkLink:
    """Receives on a thread of its own and hands sound messages of the one vehicle on.

    Args:
        port: the bytes.
        system, component: our own ids.
        vehicle: system id to follow; None for the first autopilot that says a heartbeat.
        on_message: called on the receiving thread with a message and its time of receipt [s, `time.monotonic`].
        key: 32 bytes: what is sent is signed, what is not signed with it is refused.
        log: raw messages of both directions, as a telemetry log (.tlog) has them; written aside, since a disk that
            stalls must keep neither a set-point nor the news of a takeover.
    """

    def __init__(
        self,
        port: GuardedPort,
        system: int,
        component: int,
        vehicle: int | None,
        on_message: Callable[[Message, float], None],
        key: bytes | None = None,
        log: BinaryIO | None = None,
    ) -> None:
        self.port, self._wanted, self._on_message = port, vehicle, on_message
        self._log: LogAside[bytes] | None = None if log is None else LogAside(log, "mavlink-log")
        self._codec = Codec(system, component, key, link=component)
        self._lock = threading.Lock()
        self._peer: object = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._receive, name="mavlink-receive", daemon=True)
        self._known = set[type[BaseException]]()
        self.counts = LinkCounts()
        """What came and what was refused."""
        self.vehicle = 0
        """System id of the vehicle; 0 before it is heard."""
        self.others: set[tuple[int, int]] = set()
        """System and component ids of everybody else whose heartbeat was heard."""

    @property
    def own(self) -> tuple[int, int]:
        """Our system and component id."""
        return self._codec.srcSystem, self._codec.srcComponent

    def start(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def send(self, message: Message) -> bool:
        """Send to the vehicle; False when that is not possible now. Never raises."""
        with self._lock:
            try:
                data = self._codec.encode(message)
                self.port.send(data, self._peer)
            except (OSError, struct.error, ValueError, TypeError, OverflowError):
                return False
            self._write(data)
        return True

    def close(self) -> None:
        """Stop receiving and let go of the port."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(1.0)
        self.port.close()
        if self._log is not None:
            self._log.close()

    def take(self, data: bytes, sender: object, received_s: float) -> None:
        """Take in bytes of a sender; the receiving thread's work, and what a test feeds."""
        messages, malformed = self._codec.decode_some(data, self.port.stream)
        self.counts.malformed += malformed
        for message in messages:
            if not self._is_ours(message, sender):
                self.counts.foreign += 1
                if message.get_type() == "HEARTBEAT":
                    self.others.add((message.get_srcSystem(), message.get_srcComponent()))
            else:
                self._hand_on(message, received_s)

    def _is_ours(self, message: Message, sender: object) -> bool:
        """Whether a message is of the vehicle that is followed; the first autopilot's heartbeat makes it that.

        A telemetry radio has a system id of its own, and speaks from the vehicle's address.
        """
        system, component = message.get_srcSystem(), message.get_srcComponent()
        if self._peer is None:
            autopilot = message.get_type() == "HEARTBEAT" and component == AUTOPILOT
            if not autopilot or message.autopilot == dialect.MAV_AUTOPILOT_INVALID:
                return False
            if self._wanted not in (None, system):
                return False
            self._peer, self.vehicle = sender, system
        return sender == self._peer and (system == self.vehicle or message.get_type() == "RADIO_STATUS")

    def _hand_on(self, message: Message, received_s: float) -> None:
        self._write(bytes(message.get_msgbuf()))
        try:
            self._on_message(message, received_s)
        except Exception as error:  # a message must not end the thread that hears the next one
            self.counts.failed += 1
            log_failure(_log, f"a message's handling failed: {message.get_type()}", error, self._known)

    def _receive(self) -> None:
        while not self._stopping.is_set():
            try:
                got = self.port.receive()
            except Exception:  # a port that is gone is silence
                time.sleep(0.1)
                continue
            if got is not None:
                self.take(*got)

    def _write(self, data: bytes) -> None:
        if self._log is not None:
            self._log.give(struct.pack(">Q", int(time.time() * 1e6)) + data)


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
