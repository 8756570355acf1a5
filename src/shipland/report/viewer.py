"""A replay in the rerun viewer (extra `viewer`): deck, bar and aircraft in 3-D, the picture with cues, curves."""

from __future__ import annotations

import os
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from shipland.errors import ConfigError
from shipland.extras import require
from shipland.messages import FlightRecord
from shipland.report.palette import STICKS
from shipland.rig import Rig


class Viewer:
    """Shows cycles as they are replayed, in a window or into a .rrd file; nothing leaves this machine.

    ConfigError where rerun is not installed.
    """

    def __init__(self, rig: Rig, save: Path | None = None) -> None:
        os.environ["RERUN_ANALYTICS"] = "0"  # before it is imported: no telemetry
        os.environ["DO_NOT_TRACK"] = "1"
        require("viewer", "--viewer", ConfigError)
        import rerun

        self._rr: ModuleType = rerun
        self._recording: Any = rerun.RecordingStream("shipland")
        if save is not None:
            self._recording.save(str(save))
        else:
            self._recording.spawn(connect=True)  # on loopback
        self._log("world", rerun.ViewCoordinates.FRD, static=True)
        deck, board = 0.5 * rig.deck_size_m, (0.5 * rig.board_width_m, 0.5 * rig.board_height_m)
        self._log("world/deck", rerun.Boxes3D(half_sizes=[[deck, deck, 0.01]], colors=[[120, 130, 140]]), static=True)
        self._log("world/bar", rerun.Boxes3D(half_sizes=[[0.01, *board]], colors=[[0, 158, 115]]), static=True)
        self._log("world/aircraft", rerun.Boxes3D(half_sizes=[[0.12, 0.12, 0.03]], colors=[[213, 94, 0]]), static=True)
        self._path: list[Any] = []

    def show(self, record: FlightRecord) -> None:
        """One cycle."""
        rerun, truth, decision = self._rr, record.truth, record.decision
        self._recording.set_time("flight", duration=record.telemetry.t_s)
        if truth is not None:
            poses = {"deck": truth.ned_from_deck, "bar": truth.ned_from_bar, "aircraft": truth.ned_from_body}
            for name, pose in poses.items():
                self._log(f"world/{name}", rerun.Transform3D(translation=pose.translation_m, mat3x3=pose.rotation))
            self._path.append(truth.ned_from_body.translation_m)
            self._log("world/path", rerun.LineStrips3D([self._path]))
        if record.frame.image is not None:
            rgb = np.ascontiguousarray(record.frame.image[:, :, ::-1])
            self._log("camera", rerun.Image(rgb).compress(jpeg_quality=80))
        seen = record.observation
        corners = np.zeros((0, 2)) if seen.bar_pose is None else seen.bar_pose.corners_px
        self._log("camera/corners", rerun.Points2D(corners, radii=4.0, colors=[[255, 200, 0]]))
        boxes = [box for box in (seen.bar_box, seen.ship_box) if box is not None]
        centres, sizes = [box.centre_px for box in boxes], [box.size_px for box in boxes]
        self._log("camera/boxes", rerun.Boxes2D(centers=centres, sizes=sizes))
        for name, percent in zip(STICKS, decision.command.sticks_percent, strict=True):
            self._log(f"sticks/{name}", rerun.Scalars(percent))
        if decision.estimate is not None:
            for name, value in zip(("forward", "starboard", "down"), decision.estimate.aircraft_in_bar_m, strict=True):
                self._log(f"place_in_bar/{name}", rerun.Scalars(float(value)))
        self._log("reason", rerun.TextLog(decision.reason))

    def close(self) -> None:
        """Write what is left."""
        self._recording.flush()

    def _log(self, path: str, what: object, static: bool = False) -> None:
        self._recording.log(path, what, static=static)
