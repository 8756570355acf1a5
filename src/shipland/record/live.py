"""A flight as it is flown, for Foxglove: the log's channels over a WebSocket on loopback."""

from __future__ import annotations

import threading
import time
from contextlib import AbstractContextManager

import foxglove
from foxglove import Context
from foxglove.websocket import ChannelView, Client, ServerListener

from shipland.aside import Aside
from shipland.camera import Camera
from shipland.errors import ConfigError
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.record.channels import FlightChannels, LogParameters
from shipland.record.info import FlightInfo
from shipland.rig import Rig

_MOST_WAITING = 30
"""Cycles that wait to be shown; what comes beyond them is left out: the flight does not wait for a viewer."""
_CLOSING_S = 2.0
_LAST_S = 0.5
"""In which what was told last leaves: the server does not say when it has."""


class LiveView(AbstractContextManager["LiveView"]):
    """Serves a flight to viewers on this machine, port 0 taking a free one; a context manager.

    Raises:
        ConfigError: the port is taken.
    """

    def __init__(self, info: FlightInfo, rig: Rig, camera: Camera, port: int = 8765) -> None:
        context = Context()
        self._channels = FlightChannels(context, info, rig, camera, LogParameters())
        self._listener = _Viewers()
        try:
            self._server = foxglove.start_server(
                name="shipland", host="127.0.0.1", port=port, context=context, server_listener=self._listener
            )
        except Exception as error:
            raise ConfigError(
                f"--live cannot serve on 127.0.0.1:{port}: {error}; --live-port N takes another"
            ) from None
        self._aside = Aside(self._show, _MOST_WAITING, "live")

    @property
    def address(self) -> str:
        """What a viewer opens."""
        return f"ws://127.0.0.1:{self._server.port}"

    @property
    def left_out(self) -> int:
        """Cycles that were not shown."""
        return self._aside.lost

    def wait(self, timeout_s: float) -> bool:
        """Wait until somebody looks; whether one does."""
        return self._listener.came.wait(timeout_s)

    def append(self, record: FlightRecord) -> None:
        """Show one cycle; never waits."""
        self._aside.give(record)

    def finish(self, verdict: TouchdownVerdict | None, end: str) -> None:
        """Show how it ended."""
        if self._aside.close(_CLOSING_S):
            self._channels.finish(verdict, end)
            if self._listener.came.is_set():
                time.sleep(_LAST_S)

    def __exit__(self, *_: object) -> None:
        self._aside.close(_CLOSING_S)
        self._server.stop()

    def _show(self, record: FlightRecord) -> None:
        if self._listener.newcomer.is_set() and self._channels.started:
            self._listener.newcomer.clear()
            self._channels.begin()  # what is told once
        self._channels.append(record)


class _Viewers(ServerListener):
    """Notices who comes."""

    def __init__(self) -> None:
        self.came, self.newcomer = threading.Event(), threading.Event()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        """Somebody looks at a channel."""
        self.came.set()
        self.newcomer.set()
