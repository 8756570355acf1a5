"""The wait for something that a vehicle is to say or to do."""

from __future__ import annotations

import time
from collections.abc import Callable

from shipland.errors import VehicleError
from shipland.stopping import check_stop

_LOOK_S = 0.02


def wait_until(
    what: Callable[[], object],
    timeout_s: float,
    otherwise: Callable[[], str],
    rest: Callable[[float], object] = time.sleep,
) -> None:
    """Wait until something is so; a request to stop is answered meanwhile, and first: a take-off may be next.

    Args:
        what: is to come true.
        timeout_s: how long.
        otherwise: what did not come, for the VehicleError.
        rest: waits between two looks, such as a held condition's `wait`.
    """
    end_s = time.monotonic() + timeout_s
    check_stop()
    while not what():
        if time.monotonic() > end_s:
            raise VehicleError(f"{otherwise()} within {timeout_s:g} s")
        rest(_LOOK_S)
        check_stop()
