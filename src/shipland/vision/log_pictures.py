"""The pictures that a flight log keeps, read back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.mcap_records import IMAGE_TOPIC, mcap_records

_DATA_FIELD = 2
"""Number of `data` in foxglove.CompressedImage."""


def read_pictures(path: Path, *, whole: bool = False) -> Iterator[tuple[int, npt.NDArray[np.uint8]]]:
    """Exposure time [ns] and (H,W,3) BGR of each picture, in order; of a broken-off file, those there are.

    Raises:
        DataError: the file cannot be read, or, when it must be `whole`, breaks off after its last picture.
    """
    from mcap.records import Channel, Footer, Message

    channel_id, count, complete = None, 0, False
    for item in mcap_records(path):
        complete |= isinstance(item, Footer)
        if isinstance(item, Channel) and item.topic == IMAGE_TOPIC:
            channel_id = item.id
        elif isinstance(item, Message) and item.channel_id == channel_id:
            jpeg = _bytes_field(item.data, _DATA_FIELD)
            try:
                image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR) if jpeg else None
            except cv2.error:  # a damaged head asks for a picture larger than OpenCV takes
                image = None
            if image is not None:
                yield item.log_time, np.asarray(image, np.uint8)
                count += 1
    if whole and not complete:
        raise DataError(f"{path} breaks off: {count} pictures read, the log was not closed")


def _bytes_field(message: bytes, number: int) -> bytes:
    """A field of bytes of a Protocol Buffers message; empty when it is not there."""
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        if kind == 2:
            length, at = _varint(message, at)
            if key >> 3 == number:
                return message[at : at + length]
            at += length
        elif kind == 0:
            _, at = _varint(message, at)
        else:
            at += {1: 8, 5: 4}.get(kind, len(message))
    return b""


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """A variable-length integer and where the next thing stands."""
    value = shift = 0
    while at < len(message) and shift < 64:
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if not byte & 0x80:
            break
    return value, at
