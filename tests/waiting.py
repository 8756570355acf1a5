"""Tests wait for conditions, never for times."""

import time
from collections.abc import Callable


def until(what: Callable[[], object], timeout_s: float = 30.0) -> bool:
    """Wait until something is so; a failure where that takes too long."""
    end_s = time.monotonic() + timeout_s
    while not what():
        assert time.monotonic() < end_s, f"not so within {timeout_s:g} s"
        time.sleep(0.01)
    return True
