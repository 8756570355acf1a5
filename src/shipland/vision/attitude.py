"""A film's camera attitude over time: from a table beside it, or from an autopilot's log."""

from __future__ import annotations

import csv
import logging
import math
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shipland.errors import DataError
from shipland.frames import Array, euler_from_quaternion, euler_from_rotation, rotation_from_euler
from shipland.messages import GimbalAttitude

COLUMNS = ("t_s", "roll_deg", "pitch_deg")
"""Of the table: time, right side down positive, upward positive; columns beside them are left alone."""

SUFFIXES = (".csv", ".bin", ".tlog", ".ulg")
"""Files that `read_attitude` takes."""

MOST_GAP_S = 0.5
"""Longest time between two readings over which they are interpolated, and from the last one on over which it holds."""
_SAME_S = 0.02
"""Nearer than this a picture and a reading are of one cycle of a flight."""

_MOST_DEG = 180.0
"""Largest angle that a table may give."""

_MOST_BACK_S = 1.0
"""By so much a restarted vehicle's clock goes back at least; a link may bring messages in another order."""

_CANNOT = "{path} cannot be read as {kind}: {error}"

Reading = tuple[float, float, float]
"""Time [s], roll and pitch [rad]."""


@dataclass(frozen=True)
class AttitudeTrack:
    """Roll and pitch of a camera against the horizon over time.

    Attributes:
        t_s: (n,) rising.
        roll_rad, pitch_rad: (n,) of the camera, as in `GimbalAttitude`.
        std_rad: standard deviation of either.
        source: in words.
    """

    t_s: Array
    roll_rad: Array
    pitch_rad: Array
    std_rad: float
    source: str

    @staticmethod
    def of(readings: Iterable[Reading], std_rad: float, source: str) -> AttitudeTrack:
        """Of readings in any order; those that are not finite are left out. DataError when none is left."""
        rows = np.array([row for row in readings if all(math.isfinite(value) for value in row)]).reshape(-1, 3)
        t_s, first = np.unique(rows[:, 0], return_index=True)
        if not len(t_s):
            raise DataError(f"{source} holds no reading of an attitude")
        roll_rad, pitch_rad = np.unwrap(rows[first, 1:], axis=0).T
        return AttitudeTrack(t_s, roll_rad, pitch_rad, std_rad, source)

    @property
    def words(self) -> str:
        """Source and span."""
        if len(self.t_s) == 1:
            return f"{self.source}, one reading"
        return f"{self.source}, {len(self.t_s)} readings from {self.t_s[0]:.2f} to {self.t_s[-1]:.2f} s"

    def from_clock(self, start_s: float) -> AttitudeTrack:
        """The same on the clock of a film whose time 0 is `start_s` here."""
        return replace(self, t_s=self.t_s - start_s)

    def on_body(self, mount_pitch_rad: float) -> AttitudeTrack:
        """Of a camera that is fixed to the body whose attitude this is, pitched up against it."""
        mount = rotation_from_euler(0.0, mount_pitch_rad, 0.0)
        turned = [
            euler_from_rotation(rotation_from_euler(roll, pitch, 0.0) @ mount)[:2]
            for roll, pitch in zip(self.roll_rad.tolist(), self.pitch_rad.tolist(), strict=True)
        ]
        roll_rad, pitch_rad = np.unwrap(np.array(turned), axis=0).T
        return replace(self, roll_rad=roll_rad, pitch_rad=pitch_rad)

    def at(self, t_s: float) -> GimbalAttitude:
        """Attitude at a time, interpolated; NaN between readings that are too far apart, but for their own pictures.

        A single reading is that of a camera which does not move.
        """
        if len(self.t_s) == 1:
            return GimbalAttitude(float(self.roll_rad[0]), float(self.pitch_rad[0]))
        after = int(np.searchsorted(self.t_s, t_s))
        near_s = self.t_s[max(after - 1, 0) : after + 1]
        apart_s = near_s[1] - near_s[0] if len(near_s) == 2 else abs(near_s[0] - t_s)
        if not (apart_s <= MOST_GAP_S or np.abs(near_s - t_s).min() <= _SAME_S):
            return GimbalAttitude(math.nan, math.nan)
        roll_rad, pitch_rad = (float(np.interp(t_s, self.t_s, values)) for values in (self.roll_rad, self.pitch_rad))
        return GimbalAttitude(roll_rad, pitch_rad)


def read_attitude(path: Path, std_rad: float, start_s: float | None, mount_pitch_rad: float | None) -> AttitudeTrack:
    """The attitude of a film's camera.

    Args:
        path: a table (.csv with `COLUMNS`), ArduPilot's log (.bin, .tlog) or PX4's (.ulg).
        std_rad: standard deviation of roll and of pitch.
        start_s: what the file's clock says at the film's time 0 [s]; None: a table has the film's clock.
        mount_pitch_rad: of a camera that is fixed to the body, against it: the body's attitude is read. None: the
            gimbal's.

    Raises:
        DataError: the file is missing or none of these, holds no such attitude, or its clock is not known.
        ConfigError: an extra that reads it is missing.
    """
    if not path.is_file():
        raise DataError(f"attitude file {path} does not exist")
    body = mount_pitch_rad is not None
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise DataError(f"{path} holds no attitude; expected {', '.join(SUFFIXES)} or a flight log (.mcap)")
    track = AttitudeTrack.of(read(path, body), std_rad, str(path))
    return placed(track, start_s if path.suffix.lower() != ".csv" else start_s or 0.0, mount_pitch_rad)


def placed(track: AttitudeTrack, start_s: float | None, mount_pitch_rad: float | None) -> AttitudeTrack:
    """A log's attitude as a film's camera has it; arguments and DataError as of `read_attitude`."""
    if start_s is None:
        raise DataError(f"{track.words}: give --attitude-start-s, what the log's clock says at the film's start")
    track = track.from_clock(start_s)
    return track if mount_pitch_rad is None else track.on_body(mount_pitch_rad)


def no_attitude(path: Path, body: bool, names: Iterable[str]) -> DataError:
    """What to do where a log lacks the attitude of what was asked for."""
    what, instead = (
        ("body", "leave --mount-pitch-deg out for a gimbal's")
        if body
        else ("gimbal", "give --mount-pitch-deg for a camera that is fixed to the body")
    )
    return DataError(f"{path} holds no attitude of the {what} ({', '.join(names)}); {instead}")


def _of_table(path: Path, _body: bool) -> list[Reading]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            table = csv.DictReader(file)
            missing = [name for name in COLUMNS if name not in (table.fieldnames or ())]
            if missing:
                raise DataError(
                    f"attitude file {path} lacks {', '.join(missing)}; expected a line of names and columns "
                    f"{', '.join(COLUMNS)}: the film's time, roll (right side down positive), pitch (upward positive)"
                )
            rows = []
            for row in table:
                rows.append([float(row[name]) for name in COLUMNS])
                if any(_MOST_DEG < abs(angle_deg) < math.inf for angle_deg in rows[-1][1:]):
                    raise DataError(
                        f"attitude file {path}: line {table.line_num} has an angle beyond ±{_MOST_DEG:g}°; "
                        f"expected degrees in {', '.join(COLUMNS[1:])}"
                    )
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(_CANNOT.format(path=path, kind="a table", error=error)) from None
    except (TypeError, ValueError):
        raise DataError(
            f"attitude file {path}: line {table.line_num} has no number in one of {', '.join(COLUMNS)}"
        ) from None
    return [(t_s, math.radians(roll_deg), math.radians(pitch_deg)) for t_s, roll_deg, pitch_deg in rows]


_BIN = {False: ("MNT",), True: ("ATT",)}
_TLOG = {False: ("GIMBAL_DEVICE_ATTITUDE_STATUS", "MOUNT_ORIENTATION"), True: ("ATTITUDE",)}
_ULOG = {False: ("gimbal_device_attitude_status", "mount_orientation"), True: ("vehicle_attitude",)}
"""Messages of the gimbal's and of the body's attitude, the first that a log holds is taken."""


def _of_ardupilot(path: Path, body: bool) -> list[Reading]:
    of_ground = path.suffix.lower() == ".tlog"
    names = (_TLOG if of_ground else _BIN)[body]
    rows: dict[str, list[Reading]] = {name: [] for name in names}
    senders: dict[str, set[tuple[int, int]]] = {name: set() for name in names}
    mounts: dict[str, int] = {}
    for message in _messages(path, names):
        name, mount = message.get_type(), getattr(message, "I", 0)
        if mount != mounts.setdefault(name, mount):
            continue  # another one than the first
        rows[name].append(_reading(message))
        if of_ground:
            senders[name].add((message.get_srcSystem(), message.get_srcComponent()))
    first = next((name for name in names if rows[name]), None)
    if first is None:
        raise no_attitude(path, body, names)
    _check_one_clock(f"{path}: {first}", rows[first], senders[first])
    return rows[first]


def _check_one_clock(what: str, readings: list[Reading], senders: set[tuple[int, int]]) -> None:
    """DataError where a ground station's log holds those of several senders, or of a vehicle that was restarted."""
    if len(senders) > 1:
        listed = ", ".join(f"{system}/{component}" for system, component in sorted(senders))
        raise DataError(
            f"{what} comes from several senders (system/component {listed}), each with a clock of its own; keep one "
            "with mavlogdump.py --source-system, --source-component"
        )
    back = np.flatnonzero(np.diff([t_s for t_s, _, _ in readings]) < -_MOST_BACK_S) if senders else np.zeros(0, int)
    if back.size:
        raise DataError(
            f"{what} begins again after {readings[back[0]][0]:.2f} s of its clock: the vehicle was restarted; keep one "
            "part with mavlogdump.py --condition"
        )


def _messages(path: Path, names: Iterable[str]) -> Iterator[Any]:
    """The messages of some names in ArduPilot's log."""
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
    try:
        while (message := log.recv_match(type=list(names))) is not None:
            yield message
    finally:
        log.close()


def _reading(message: Any) -> Reading:  # noqa: ANN401 - pymavlink has no types
    """Time since boot [s], roll and pitch [rad]."""
    name = message.get_type()
    if name in ("ATT", "MNT"):
        return 1e-6 * message.TimeUS, math.radians(message.Roll), math.radians(message.Pitch)
    t_s = 1e-3 * message.time_boot_ms
    if name == "ATTITUDE":
        return t_s, message.roll, message.pitch
    if name == "MOUNT_ORIENTATION":
        return t_s, math.radians(message.roll), math.radians(message.pitch)
    roll_rad, pitch_rad, _ = euler_from_quaternion(tuple(message.q))
    return t_s, roll_rad, pitch_rad


def _of_px4(path: Path, body: bool) -> list[Reading]:
    from pyulog import ULog

    names = _ULOG[body]
    level = logging.root.level
    try:
        log = ULog(str(path), list(names))
    finally:
        logging.root.setLevel(level)
    topics = {data.name: data.data for data in log.data_list if data.multi_id == 0}
    topic = next((topics[name] for name in names if name in topics), None)
    if topic is None:
        raise no_attitude(path, body, names)
    t_s = 1e-6 * topic["timestamp"]
    if "attitude_euler_angle[0]" in topic:
        roll_rad, pitch_rad = topic["attitude_euler_angle[0]"], topic["attitude_euler_angle[1]"]
        return list(zip(t_s.tolist(), roll_rad.tolist(), pitch_rad.tolist(), strict=True))
    quaternions = np.column_stack([topic[f"q[{i}]"] for i in range(4)]).astype(float).tolist()
    angles = [euler_from_quaternion((w, x, y, z))[:2] for w, x, y, z in quaternions]
    return [(t, roll, pitch) for t, (roll, pitch) in zip(t_s.tolist(), angles, strict=True)]


def _of_autopilot(path: Path, body: bool) -> list[Reading]:
    """What pymavlink or pyulog make of a log; of a damaged one they print to standard output and raise anything."""
    read, kind = (_of_px4, "PX4's log") if path.suffix.lower() == ".ulg" else (_of_ardupilot, "ArduPilot's log")
    try:
        with redirect_stdout(sys.stderr):
            return read(path, body)
    except DataError:
        raise
    except ModuleNotFoundError as error:
        raise DataError(f"{path} needs {error.name}; install it with: pip install 'shipland[mavlink]'") from None
    except Exception as error:
        said = f"{type(error).__name__} {error}".strip()
        raise DataError(_CANNOT.format(path=path, kind=kind, error=said)) from None


_READERS: dict[str, Callable[[Path, bool], list[Reading]]] = {
    ".csv": _of_table,
    ".bin": _of_autopilot,
    ".tlog": _of_autopilot,
    ".ulg": _of_autopilot,
}
