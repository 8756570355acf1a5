"""`shipland doctor`: what works on this machine, and what to do about the rest."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess  # this Python alone
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from shipland.errors import ShiplandError
from shipland.extras import EXTRAS, installed

State = Literal["ok", "-", "FAIL"]
"""ok; `-` for what flying in the simulator does without; FAIL for what it needs."""
Finding = tuple[State, str, str]
"""One line: its state, what was looked at, what was found and what to do."""
_AUTOPILOTS = {"ArduCopter": "SHIPLAND_ARDUCOPTER", "PX4": "SHIPLAND_PX4"}
_LEAST_FREE_GB = 1.0
_USED = {"mavlink": "pymavlink.dialects.v20.ardupilotmega, serial", "ros2": "rosbags.typesys, cyclonedds.core"}
"""What is used of an extra, where its own module imports nothing."""
_IMPORT_S = 120.0
"""Timeout of an import; on a busy machine torch takes half a minute."""


@dataclass(frozen=True)
class Doctor:
    """Say what works on this machine, a line a thing, and what to do about what does not.

    `ok` works; `-` is missing, and only what the line names needs it; FAIL is needed by every rendered flight. Exit
    code: 0 without a FAIL, 1 with one.

    Example: shipland doctor
    """

    def run(self) -> int:
        """Look at everything."""
        failed = False
        for look in (_machine, _opengl, _compiled, _detectors, _extras, _autopilots, _priority):
            for state, name, words in _found(look):
                failed |= state == "FAIL"
                print(f"{state:<4}  {name:<14} {words}", flush=True)
        return int(failed)


def _found(look: Callable[[], Iterator[Finding]]) -> Iterator[Finding]:
    """What is looked at may be broken in any way: that is a finding."""
    try:
        yield from look()
    except Exception as error:
        yield "FAIL", look.__name__.strip("_"), f"{type(error).__name__}: {error}"


def _machine() -> Iterator[Finding]:
    from shipland.version import code_version

    cores = len(os.sched_getaffinity(0))
    yield "ok", "shipland", f"{code_version()}, Python {platform.python_version()}, {platform.machine()}"
    yield "ok", "cores", f"{cores}: shipland campaign --workers {cores}"
    free_gb = shutil.disk_usage(".").free / 1e9
    state: State = "ok" if free_gb >= _LEAST_FREE_GB else "-"
    yield state, "disk", f"{free_gb:.0f} GB free here; a rendered flight leaves 25 MB"


def _opengl() -> Iterator[Finding]:
    from shipland.sim.scene.gl import open_context

    try:
        context = open_context()
    except ShiplandError as error:
        yield "FAIL", "OpenGL", str(error)
        return
    renderer = str(context.info["GL_RENDERER"])
    context.release()
    on = "on the processor" if "llvmpipe" in renderer else "on the GPU"
    yield "ok", "OpenGL", f"off screen, {on}: {renderer}"


def _compiled() -> Iterator[Finding]:
    from shipland import compiled

    folder = compiled.cache_folder(Path(compiled.__file__).parent)
    if folder is None:
        yield "-", "compiled", "no cache folder can be written, each process compiles; set NUMBA_CACHE_DIR"
    elif compiled.is_compiled():
        yield "ok", "compiled", f"machine code in {folder}"
    else:
        yield "-", "compiled", "not yet: the first flight takes about a minute longer"


def _detectors() -> Iterator[Finding]:
    from shipland.vision.far.detector import Detector
    from shipland.vision.parameters import DetectorParameters

    for kind in ("ship", "bar"):
        try:
            network = Detector.load(kind, DetectorParameters()).reader.network
        except ShiplandError as error:
            yield "FAIL", f"detector {kind}", str(error)
        else:
            yield "ok", f"detector {kind}", network.description


def _extras() -> Iterator[Finding]:
    for name, extra in EXTRAS.items():
        words = extra.use
        if not installed(name):
            words += f": pip install 'shipland[{name}]'"
        elif broken := _broken(_USED.get(name, extra.module)):
            words += f": installed and broken: {broken}"
        yield "ok" if words == extra.use else "-", f"extra {name}", words


def _broken(modules: str) -> str:
    """Why modules cannot be imported, in words; in a process of its own, which a crash ends alone."""
    command = [sys.executable, "-P", "-c", f"import {modules}"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=_IMPORT_S)  # noqa: S603
    said = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
    return said[-1] if done.returncode else ""


def _autopilots() -> Iterator[Finding]:
    for name, variable in _AUTOPILOTS.items():
        path = os.environ.get(variable, "")
        if not path:
            yield "-", name, f"{variable} names no binary; only its simulator needs one (Fly SITL)"
        elif not os.access(path, os.X_OK) or Path(path).is_dir():
            yield "-", name, f"{variable}: {path} is no program that can be run"
        else:
            yield "ok", name, path


def _priority() -> Iterator[Finding]:
    """Whether set-points may leave before other processes' work: `vehicles.priority.go_first`."""
    tried = "import sys; from shipland.vehicles.priority import go_first; sys.exit(not go_first('process'))"
    # in a process of its own, which takes the priority with it
    done = subprocess.run([sys.executable, "-c", tried], check=False, timeout=60)  # noqa: S603
    if done.returncode == 0:
        yield "ok", "priority", "set-points may leave before other processes' work"
        return
    user = os.environ.get("USER", "you")
    lines = f"'{user} - rtprio 10' and '{user} - nice -15', and log in again"
    lack = "without the privilege a busy machine delays set-points to a vehicle"
    yield "-", "priority", f"{lack}; add to /etc/security/limits.conf: {lines}"
