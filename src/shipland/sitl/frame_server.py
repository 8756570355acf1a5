"""The camera of a served world: a process of its own draws what physics shows it and sends it to whoever looks."""

from __future__ import annotations

import math
import multiprocessing
import signal
import socket
import threading
from contextlib import AbstractContextManager, suppress
from multiprocessing.connection import Connection
from typing import NamedTuple

import numpy as np

from shipland.camera import Camera
from shipland.errors import ShiplandError, VehicleError
from shipland.messages import TouchdownVerdict
from shipland.scenario.autonomy import build_scene, drawn_ship
from shipland.scenario.scenario import Scenario
from shipland.scenario.seeds import generators_of
from shipland.sim.state import Snapshot, scene_of, truth_of
from shipland.vehicles.frame_link import frame_record, verdict_record

_GONE = "the camera's process has ended"


class _Shown(NamedTuple):
    """An exposure on the way to the process; `t_s` is the served clock's, which runs on while the world is held."""

    t_s: float
    snapshot: Snapshot


class FrameServer(AbstractContextManager["FrameServer"]):
    """Takes exposures from the physics and never makes it wait.

    Frames leave `delays.video_s` after their exposure; while a picture is drawn, those that come are left out.

    VehicleError where the port is not ours to listen on, or where pictures cannot be drawn.
    """

    def __init__(self, scenario: Scenario, seed: int, host: str, port: int, pictures: bool) -> None:
        context = multiprocessing.get_context("spawn")  # an OpenGL context does not survive a fork
        try:
            self._listener = socket.create_server((host, port))
        except OSError as error:
            raise VehicleError(f"cannot listen on {host}:{port}: {error.strerror}") from None
        near, self._link = context.Pipe()
        self._process = context.Process(
            target=_serve_frames, args=(near, self._listener, scenario, seed, pictures), daemon=True
        )
        self._process.start()
        near.close()
        self._listener.close()  # the process has it: without the process nobody is to connect
        self._ended = False
        problem = _GONE
        with suppress(EOFError, OSError):
            problem = self._link.recv()
        if problem:
            self.__exit__()
            raise VehicleError(problem)

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            self._link.send(None)
        self._process.join(2.0)
        self._process.kill()
        self._process.join()
        self._link.close()

    def show(self, t_s: float, snapshot: Snapshot) -> None:
        """An exposure at the served clock's `t_s`; VehicleError where the process that takes it is gone."""
        try:
            self._link.send(_Shown(t_s, snapshot))
        except OSError:
            raise VehicleError(_GONE) from None

    def end(self, verdict: TouchdownVerdict) -> None:
        """The flight is over; once is enough."""
        if not self._ended:
            self._ended = True
            with suppress(OSError):
                self._link.send(verdict)


def _serve_frames(link: Connection, listener: socket.socket, scenario: Scenario, seed: int, pictures: bool) -> None:
    """The process: says why it cannot draw, or nothing; then exposures in, frames out; whoever serves ends it."""
    for which in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):  # they reach the whole group
        signal.signal(which, signal.SIG_IGN)
    clients: list[socket.socket] = []
    threading.Thread(target=_accept, args=(listener, clients), daemon=True).start()
    ship, camera = drawn_ship(scenario, seed), Camera.from_parameters(scenario.camera)
    rng = generators_of(seed).picture
    try:
        scene = build_scene(scenario, seed) if pictures else None
    except ShiplandError as error:
        link.send(str(error))
        return
    link.send("")
    waiting: list[tuple[float, _Shown, bytes]] = []
    while True:
        try:
            item = link.recv()
            while isinstance(item, _Shown) and link.poll() and scene is not None:
                item = link.recv()  # the newest: drawing takes longer than exposing
        except (EOFError, OSError):
            return
        if item is None:
            return
        if isinstance(item, TouchdownVerdict):
            _send(clients, verdict_record(item))
            continue
        at = item.snapshot
        picture = b""
        if scene is not None:
            state = scene_of(at, ship.at(at.t_s), scenario.camera)
            picture = np.ascontiguousarray(scene.render(state, camera, rng=rng)).tobytes()
        waiting.append((item.t_s + scenario.delays.video_s, item, picture))
        while waiting and waiting[0][0] <= item.t_s + 1e-9:
            _, shown, drawn = waiting.pop(0)
            truth = truth_of(shown.snapshot, ship.at(shown.snapshot.t_s), scenario.camera)
            age_s = max(0.0, item.t_s - shown.t_s) if math.isfinite(shown.t_s) else 0.0
            _send(clients, frame_record(age_s, shown.snapshot.reported_gimbal, truth, drawn))


def _accept(listener: socket.socket, clients: list[socket.socket]) -> None:
    while True:
        try:
            client, _ = listener.accept()
        except OSError:
            return
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.settimeout(1.0)
        clients.append(client)


def _send(clients: list[socket.socket], data: bytes) -> None:
    for client in list(clients):
        try:
            client.sendall(data)
        except OSError:
            clients.remove(client)
            client.close()
