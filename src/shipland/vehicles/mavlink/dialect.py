"""The MAVLink dialect that is spoken, ArduPilot's, which holds the common messages that PX4 speaks; and its codec."""

from __future__ import annotations

import time
from typing import Any

from shipland.errors import VehicleError
from shipland.extras import require

require("mavlink", "mavlink://", VehicleError)
from pymavlink.dialects.v20 import ardupilotmega  # noqa: E402 - the line above says what to install

dialect: Any = ardupilotmega
"""Generated classes and constants, without types."""
Message = Any
"""A decoded message of the dialect."""
AUTOPILOT: int = dialect.MAV_COMP_ID_AUTOPILOT1
"""Component id of the autopilot, which set-points and commands are for."""

_SIGNING_EPOCH_S = 1420070400.0
"""1 January 2015: MAVLink signing counts 10 µs steps since then."""


class Codec(dialect.MAVLink):  # type: ignore[misc] # untyped library
    """Messages to bytes and back.

    A bad signature leaves no trace: the library notes a stream's time stamp before it compares the signature, so that
    one forged message with a late stamp would lock the real sender out.

    Args:
        system, component: ids of whoever sends.
        key: 32 bytes: what is sent is signed, what is not signed with it is refused. None: neither.
        link: id of the signed stream; two senders with the same ids and key need two.
    """

    def __init__(self, system: int, component: int, key: bytes | None = None, link: int = 0) -> None:
        super().__init__(None, srcSystem=system, srcComponent=component)
        self.robust_parsing, self.seq = True, 0
        if key is not None:
            signing = self.signing
            signing.secret_key, signing.sign_outgoing, signing.link_id = key, True, link
            # a telemetry radio knows no key
            signing.allow_unsigned_callback = lambda _codec, number: number == dialect.MAVLINK_MSG_ID_RADIO_STATUS

    def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:  # noqa: N803
        """Whether a message is signed with our key and newer than the last."""
        stamps = self.signing.stream_timestamps
        before = dict(stamps)
        good = bool(super().check_signature(msgbuf, srcSystem, srcComponent))
        if not good:
            stamps.clear()
            stamps.update(before)
        return good

    def encode(self, message: Message) -> bytes:
        """The next message's bytes; struct.error, ValueError, TypeError or OverflowError where it has none.

        Its signature is stamped with now: an autopilot refuses a stream that begins a minute behind its own clock.
        """
        self.signing.timestamp = max(self.signing.timestamp, int((time.time() - _SIGNING_EPOCH_S) * 1e5))
        data = bytes(message.pack(self))
        self.seq = (self.seq + 1) % 256
        return data

    def decode_some(self, data: bytes, stream: bool) -> tuple[list[Message], int]:
        """The messages in some bytes, and how much was none. Never raises.

        Args:
            data: what came.
            stream: a message may have begun in the bytes before; otherwise these are whole messages.
        """
        try:
            if not stream:  # what is left of the bytes before is rubbish
                self.buf, self.buf_index = bytearray(), 0
                self.expected_length = dialect.HEADER_LEN_V1 + 2
            parsed = self.parse_buffer(data) or []
        except Exception:  # the parser is generated code over hostile bytes
            self.buf, self.buf_index = bytearray(), 0
            return [], 1
        messages = [message for message in parsed if message.get_type() != "BAD_DATA"]
        return messages, len(parsed) - len(messages)
