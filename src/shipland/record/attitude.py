"""The camera's attitude in a flight log."""

from __future__ import annotations

import math
from pathlib import Path

from shipland.record.reader import FlightLog
from shipland.vision.attitude import AttitudeTrack, Reading, no_attitude
from shipland.vision.parameters import VisionParameters

_MOST_AGE_S = 0.5
"""Largest age of a gimbal's reading that a picture is seen with."""


def logged_attitude(log: FlightLog, path: Path, *, body: bool = False) -> AttitudeTrack:
    """The gimbal's attitude, or the body's, by the clock of a flight log, as exact as the flight took it to be.

    DataError where the log holds none.
    """
    readings: list[Reading] = []
    for record in log.records:
        frame, telemetry = record.frame, record.telemetry
        if not body and frame.gimbal_age_s <= _MOST_AGE_S:
            readings.append((frame.t_s, frame.gimbal.roll_rad, frame.gimbal.pitch_rad))
        elif body and telemetry.roll_rad is not None and telemetry.pitch_rad is not None:
            t_s = telemetry.t_s if telemetry.attitude_t_s is None else telemetry.attitude_t_s
            readings.append((t_s, telemetry.roll_rad, telemetry.pitch_rad))
    if not readings:
        raise no_attitude(path, body, ("/flight",))
    flown = log.header.info.table().get("vision", {}).get("gimbal_noise_rad", VisionParameters().gimbal_noise_rad)
    return AttitudeTrack.of(readings, float(flown) if math.isfinite(float(flown)) else 0.0, str(path))
