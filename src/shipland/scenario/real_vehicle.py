"""Vehicles that are not simulated here: made from an address, checked first, and with keys for the pilot."""

from __future__ import annotations

import math
import os
import re
import select
import signal
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shipland import factories
from shipland.calibration_file import read_calibration
from shipland.camera import Camera
from shipland.config import build, read_toml
from shipland.errors import ConfigError, VehicleError
from shipland.factories import Factory
from shipland.frames import GRAVITY_MPS2
from shipland.guidance.response import Response
from shipland.messages import Override
from shipland.record.reader import read_log
from shipland.scenario.scenario import Scenario
from shipland.scenario.visions import VisionSetup, needs_pictures
from shipland.stopping import ignored
from shipland.vehicles.address import Address, VehicleSetup, vehicle_table
from shipland.vehicles.checks import Check, PreflightParameters
from shipland.vehicles.replay import Recorded, ReplayVehicle, recorded_video
from shipland.vehicles.vehicle import Real, Vehicle


def make_vehicle(
    address: str, scenario: Scenario, calibration: Path | None, config: Path | None, log: Path | None = None
) -> Vehicle:
    """The vehicle at an address, not yet connected.

    Args:
        address: `scheme://place?option=value`.
        scenario: its `[camera]` holds where there is no calibration.
        calibration: OpenCV's or ROS's calibration file of the camera.
        config: file of sections of vehicles.
        log: file for raw messages of the link.

    Raises:
        ConfigError: the address, an option or a file is wrong.
        DataError: a recording cannot be read.
        VehicleError: an extra is missing.
    """
    where = Address.parse(address)
    camera = Camera.from_parameters(scenario.camera) if calibration is None else read_calibration(calibration)
    setup = VehicleSetup(where, camera, vehicle_table(config), log, calibration is not None)
    vehicle: Vehicle = factories.resolve("vehicles", where.scheme)(setup)
    return vehicle


def rehearse_vision(scenario: Scenario, vision: str | Factory, vehicle: Vehicle) -> None:
    """Show a vision that takes pictures those of `vision.rehearsal`, once, before the vehicle is connected."""
    from shipland.vision.rehearsal import rehearse

    factory = factories.resolve("visions", vision)
    if needs_pictures(factory):
        camera, rng = Camera.from_parameters(scenario.camera), np.random.default_rng(0)
        rehearse(factory(VisionSetup(scenario, camera, vehicle, rng, rng)), scenario.rig.cue, camera)


def replay(setup: VehicleSetup) -> Vehicle:
    """`replay://flight.mcap` and `replay://film.mp4?pitch_deg=-5&latency_s=0.2`."""
    from shipland.vision.pictures import is_video

    address = setup.address
    path = Path(address.place)
    if not is_video(path):
        address.only()
        if setup.calibrated:
            raise ConfigError(f"--calibration is of a video; the log {path} holds its own")
        return replayed_log(path)
    address.only("pitch_deg", "latency_s")
    pitch_rad, latency_s = math.radians(address.number("pitch_deg", 0.0)), address.number("latency_s", 0.0)
    if latency_s < 0.0:
        raise ConfigError(f"replay://…?latency_s={latency_s:g}: expected 0 or more")
    return ReplayVehicle(recorded_video(path, setup.camera, pitch_rad, latency_s), setup.camera)


def replayed_log(path: Path) -> ReplayVehicle:
    """The vehicle of a flight log: the cycles whose pictures it keeps, or all without pictures where it keeps none.

    What was received at a cycle's decision counts as received then. DataError when the log cannot be read.
    """
    from shipland.vision.log_pictures import read_pictures

    log = read_log(path)
    rows = {round(record.frame.t_s * 1e9): record for record in log.records}
    first = next(read_pictures(path), None)
    if first is None:
        recorded: list[Recorded] | Iterator[Recorded] = [
            Recorded(row.frame, row.telemetry.t_s, row.telemetry, row.truth) for row in log.records
        ]
        return ReplayVehicle(recorded, log.header.camera, log.verdict)
    height_px, width_px = first[1].shape[:2]
    camera = log.header.camera.scaled(width_px, height_px)

    def with_pictures() -> Iterator[Recorded]:
        for time_ns, image in read_pictures(path):
            row = rows.get(time_ns)
            if row is not None and image.shape[:2] == (height_px, width_px):
                yield Recorded(replace(row.frame, image=image), row.telemetry.t_s, row.telemetry, row.truth)

    return ReplayVehicle(with_pictures(), camera, log.verdict)


def identified(path: Path, assumed: Response) -> Response:
    """What `shipland identify` wrote of a vehicle, over what was assumed of it.

    Raises:
        ConfigError: the file is missing, broken, or of a vehicle of another kind.
    """
    tables = read_toml(path).get("response", {})
    if assumed.kind not in tables:
        held = f"; it holds {', '.join(f'[response.{kind}]' for kind in tables)}" if tables else ""
        raise ConfigError(f"{path} holds no [response.{assumed.kind}], what this vehicle's sticks mean{held}")
    return build(Response, {**vars(assumed), **tables[assumed.kind]}, f"response.{assumed.kind}")


def checklist(
    vehicle: Vehicle,
    scenario: Scenario,
    calibration: Path | None,
    wind_mps: float,
    table: Mapping[str, Mapping[str, Any]],
) -> list[Check]:
    """Everything that is looked at before a flight; the vehicle is connected.

    The wind is what is expected, gusts included; `table` is of `vehicle_table`.
    """
    if not isinstance(vehicle, Real):
        return []
    limits = build(PreflightParameters, table["preflight"], "vehicles.preflight")
    target, safety, response = scenario.rig.cue, scenario.safety, vehicle.response()
    points_m = target.points_in_bar_m
    wide_m, tall_m = np.ptp(points_m[:, 1]), np.ptp(points_m[:, 2])
    words = str(calibration) if calibration is not None else "none: --calibration FILE (`shipland calibrate` makes it)"
    own = vehicle.checks()
    calibrated = [] if any(check.name == "calibration" for check in own) else [("calibration", calibration is not None)]
    return [
        *(Check(name, ok, words) for name, ok in calibrated),
        Check("cue", True, f"{target.count} quadrilaterals, {wide_m:.3f} × {tall_m:.3f} m: measure the real one"),
        *own,
        _keys_check(),
        wind_check(wind_mps, response, limits.wind_share),
        Check(
            "own fence", True,
            f"{safety.fence_distance_m:g} m from the bar, {safety.fence_height_m:g} m over the take-off point",
        ),
    ]  # fmt: skip


def _keys_check() -> Check:
    """Whether a person's keys will be heard; a flight without them is the user's to choose."""
    if _terminal() is not None:
        return Check("keys", True, "heard: h holds, c climbs, r gives back")
    return Check("keys", True, "WARNING: no terminal in the foreground: h, c and r are not heard, only Ctrl-C's signal")


def wind_check(wind_mps: float, response: Response, share: float) -> Check:
    """Whether a wind, gusts included, leaves enough of the tilt there is: g tan(tilt) holds against drag × wind.

    A vehicle that flies speeds tilts for them by its own limit; `share` is of the wind that full tilt holds against.
    """
    tilt_rad, drag_per_s = response.max_tilt_rad, response.drag_per_s
    if not (0.0 < tilt_rad < 0.5 * math.pi and 0.0 < drag_per_s < math.inf):
        words = "what it holds against is unknown: state its tilt limit, and drag_per_s in [response] (`identify`)"
        return Check("wind", False, f"{wind_mps:g} m/s expected; {words}")
    most_mps = share * GRAVITY_MPS2 * math.tan(tilt_rad) / drag_per_s
    words = f"{wind_mps:g} m/s expected, at most {most_mps:.1f} at {math.degrees(tilt_rad):.0f}° of tilt"
    return Check("wind", 0.0 <= wind_mps <= most_mps, words)


def require_passed(checks: list[Check]) -> None:
    """VehicleError naming every line that is not in order."""
    failed = [f"{check.name}: {check.words}" for check in checks if not check.ok]
    if failed:
        raise VehicleError(f"not fit to fly: {'; '.join(failed)}")


_OVERRIDES = {"h": Override.HOLD, "c": Override.CLIMB, "r": None}
"""Hold, climb, and back to the pilot."""
_SEQUENCE = re.compile(r"\x1b(\[\[?[0-?]*[ -/]*[@-Z\\-~]|O[0-?]*[@-~])")
"""What an arrow or a function key types, or a terminal answers; its last letter is no key."""
_BEGUN = re.compile(r"\x1b(\[\[?[0-?]*[ -/]*|O[0-?]*)?\Z")
"""One whose end has not been read yet."""


class Keys:
    """Single keys of the terminal: hold, climb, resume."""

    def __init__(self) -> None:
        self._override: Override | None = None
        self._terminal: int | None = None
        self._begun = ""

    def press(self, key: str) -> None:
        """A key was pressed, in either case; others than the three do nothing."""
        self._override = _OVERRIDES.get(key.lower(), self._override)

    def override(self) -> Override | None:
        """What the last key asks for; None while the pilot flies. Never waits, never raises."""
        keys = _SEQUENCE.sub("", self._begun + self._typed())
        begun = _BEGUN.search(keys)
        self._begun = "" if begun is None else begun[0]
        for key in keys.removesuffix(self._begun):
            self.press(key)
        return self._override

    def _typed(self) -> str:
        """Everything that was typed since; nothing from a terminal that has gone."""
        if self._terminal is None:
            return ""
        try:
            if not select.select([self._terminal], [], [], 0.0)[0]:
                return ""
            typed = os.read(self._terminal, 1024)  # not by sys.stdin, whose buffer `select` does not see
        except (OSError, ValueError):
            typed = b""
        if not typed:
            self._terminal = None
        return typed.decode("ascii", "ignore")

    @contextmanager
    def listening(self) -> Iterator[Keys]:
        """Take keys without the return key, where there is a terminal; one in the background stops nothing."""
        terminal = _terminal()
        if terminal is None:
            yield self
            return
        import termios
        import tty

        with ignored((signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)), ExitStack() as stack:
            with suppress(OSError, termios.error):  # it has gone
                before = termios.tcgetattr(terminal)
                termios.tcflush(terminal, termios.TCIFLUSH)  # what was typed before the flight is no key of it
                tty.setcbreak(terminal, termios.TCSANOW)
                self._terminal = terminal
                stack.callback(_restore, terminal, before)
            try:
                yield self
            finally:
                self._terminal = None


def _terminal() -> int | None:
    """The descriptor of standard input where that is a terminal and this process is in its foreground."""
    try:
        descriptor = sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # there is none, or it is closed
        return None
    with suppress(OSError):  # not the terminal that controls us
        if os.tcgetpgrp(descriptor) != os.getpgrp():
            return None
    return descriptor if os.isatty(descriptor) else None


def _restore(terminal: int, before: list[Any]) -> None:
    import termios

    with suppress(OSError, termios.error):  # it has gone
        termios.tcsetattr(terminal, termios.TCSANOW, before)  # TCSADRAIN waits for a terminal that stands still
