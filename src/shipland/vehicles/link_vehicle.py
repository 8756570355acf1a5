"""What vehicles over a link share: they are connected once, taken, and left safe once."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from contextlib import ExitStack

from shipland.errors import VehicleError
from shipland.stopping import uninterrupted
from shipland.vehicles.pace import boot_s

_SUSPENDED_S = 1.0
"""A machine that was suspended for longer has commanded nothing meanwhile, and what it knows is old."""


class LinkVehicle(ABC):
    """A `Vehicle` on `time.monotonic`; a subclass speaks the link."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        """What is closed with the link."""
        self._connected = self._engaged = self._closed = False
        self._suspended_s = math.nan
        """Time for which the machine had been suspended, all in all, when the vehicle was connected."""
        self._end_reason = ""
        self._failure = ""
        """Why it could not be connected or taken, in words."""

    @property
    def end_reason(self) -> str:
        """Why the flight is over, in words; empty in flight."""
        return self._end_reason

    @abstractmethod
    def _connect(self) -> None:
        """Link and camera, without taking control; VehicleError when something does not answer."""

    @abstractmethod
    def _engage(self) -> None:
        """Take the vehicle, once connected, as far as that was allowed."""

    @abstractmethod
    def _leave(self) -> None:
        """Leave the vehicle holding, where it is still ours, before the link is closed; also of a failed `connect`."""

    def connect(self) -> None:
        """Link and camera, without taking control; once is enough. VehicleError when something does not answer."""
        if self._connected:
            return
        try:
            self._connect()
        except BaseException as error:
            self._failure = str(error)
            with uninterrupted(), self._stack:
                self._leave()
            raise
        self._connected, self._suspended_s = True, boot_s() - time.monotonic()

    @property
    def _suspended(self) -> str:
        """That the machine was suspended since it was connected, in words; empty where it was not."""
        lost_s = boot_s() - time.monotonic() - self._suspended_s
        return f"this machine was suspended for {lost_s:.0f} s" if lost_s > _SUSPENDED_S else ""

    def _refuse_if_suspended(self) -> None:
        """VehicleError where what is known of the vehicle is older than a suspension."""
        if words := self._suspended:
            raise VehicleError(f"{words} since it connected: what it knows of the vehicle is old; start again")

    def open(self) -> None:
        """Connect, and take the vehicle as far as that was allowed; VehicleError when it does not come to us."""
        if self._closed:
            raise VehicleError("this flight is over; make a new vehicle for the next one")
        self.connect()
        try:
            self._refuse_if_suspended()
            self._engage()
        except BaseException as error:
            self._failure = str(error)
            self.close()
            raise

    @uninterrupted()
    def close(self) -> None:
        """Leave the vehicle holding, where it is still ours, and let go of it; no signal cuts it short."""
        if self._closed:
            return
        self._closed = True
        with self._stack:
            self._leave()
