"""The records of an MCAP file, up to where it is broken off or damaged."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from shipland.errors import DataError

IMAGE_TOPIC = "/camera/image"
"""Of the pictures in a flight log."""


def mcap_records(path: Path) -> Iterator[Any]:
    """The records of `mcap.records`, chunks opened; of a file that is broken off or damaged, those before the damage.

    Raises:
        DataError: the file cannot be read, or is no MCAP file from its first record on.
    """
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader
    from zstandard import ZstdError

    # A damaged length asks for more than the file, the memory or a C integer holds; RuntimeError is LZ4's.
    damage = (McapError, ZstdError, RuntimeError, struct.error, ValueError, OverflowError, MemoryError)
    read = 0
    try:
        with path.open("rb") as stream:
            records = StreamReader(stream, record_size_limit=path.stat().st_size).records
            while True:
                try:
                    record = next(records, None)
                except damage as error:
                    if not read:
                        words = error if path.stat().st_size else "it is empty"
                        raise DataError(f"{path} is not an MCAP file, or broken off at its start: {words}") from None
                    return
                if record is None:
                    return
                read += 1
                yield record
    except OSError as error:
        raise DataError(f"flight log {path} cannot be read: {error.strerror}") from None
