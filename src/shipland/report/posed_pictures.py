"""The pictures that flight logs keep, each with where its camera was: PNG in a zip, and a row a picture."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2

from shipland.camera import Camera
from shipland.errors import DataError
from shipland.files import replacing
from shipland.frames import euler_from_rotation, quaternion_from_rotation
from shipland.messages import FlightRecord
from shipland.record.foxglove_scene import nanoseconds
from shipland.record.reader import read_log
from shipland.report.lettering import Image
from shipland.rig import Rig
from shipland.vision.log_pictures import read_pictures

MEANINGS = {
    "picture": "its file in pictures.zip",
    "flight": "the log that it is of",
    "t_s": "exposure time, from the start of the flight",
    "focal_px": "focal length of the picture's camera",
    "centre_": "its principal point; pixel centres at whole numbers",
    "distortion_": "its distortion coefficient, in OpenCV's order; of a camera without distortion none",
    "camera_in_bar_": "the camera's optical centre in frame bar, true: forward, right, down",
    "bar_from_camera_": "turn of the camera, axes right, down, forward, into bar, true: unit quaternion",
    "camera_in_deck_": "the same place in frame deck, which has all motions: forward, starboard, down",
    "deck_from_camera_": "the same turn into deck",
    "body_": "attitude of the aircraft against north, east, down, true",
    "gimbal_": "attitude of the camera mount against level, as the vehicle says",
    "corner_": "corner of the cue in the picture, true, in the cue's order; beyond the edges where it is cut",
}
"""By the beginning of a column's name."""
_ANGLES = ("roll_rad", "pitch_rad", "yaw_rad")


def pack_pictures(logs: Mapping[str, Path], path: Path) -> list[dict[str, Any]]:
    """Write the pictures of logs as FLIGHT/NUMBER.png; a row each, with "" for unknown; DataError without any."""
    rows = []
    with replacing(path) as beside, zipfile.ZipFile(beside, "w", zipfile.ZIP_STORED) as packed:  # a PNG is compressed
        for flight, log_path in logs.items():
            log = read_log(log_path)
            exposures_s = (record.frame.t_s for record in log.records)
            for number, (cycle, image) in enumerate(pictures_of(log_path, exposures_s)):
                name = f"{flight}/{number:06d}.png"
                packed.writestr(zipfile.ZipInfo(name), cv2.imencode(".png", image)[1].tobytes())
                camera = log.header.camera.scaled(*image.shape[1::-1])
                row = _posed(log.records[cycle], camera, log.header.rig)
                rows.append({"picture": name, "flight": flight} | row)
        if not rows:
            raise DataError("no log keeps pictures: those of `shipland fly` do, unless its vision is geometric")
    columns = dict.fromkeys((name for row in rows for name in row), "")
    return [columns | row for row in rows]


def pictures_of(log: Path, exposures_s: Iterable[float]) -> Iterator[tuple[int, Image]]:
    """The BGR pictures of a log that belong to a cycle, with its number; the cycles are given by their exposures."""
    cycles = {nanoseconds(t_s): cycle for cycle, t_s in enumerate(exposures_s)}
    return ((cycles[time_ns], image) for time_ns, image in read_pictures(log) if time_ns in cycles)


def _posed(record: FlightRecord, camera: Camera, rig: Rig) -> dict[str, float]:
    """What is known of a picture; without ground truth neither poses nor corners."""
    gimbal, truth = record.frame.gimbal, record.truth
    row = {
        "t_s": record.frame.t_s,
        "focal_px": camera.focal_px,
        "centre_column_px": camera.matrix[0, 2],
        "centre_row_px": camera.matrix[1, 2],
        **{f"distortion_{number}": value for number, value in enumerate(camera.distortion, 1) if camera.has_distortion},
        **_named("gimbal", _ANGLES, (gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad)),
    }
    if truth is not None:
        row |= _named("body", _ANGLES, euler_from_rotation(truth.ned_from_body.rotation))
        for frame, right, pose in (("bar", "right", truth.ned_from_bar), ("deck", "starboard", truth.ned_from_deck)):
            camera_in = pose.inverse() @ truth.ned_from_camera
            row |= _named(f"camera_in_{frame}", ("forward_m", f"{right}_m", "down_m"), camera_in.translation_m)
            row |= _named(f"{frame}_from_camera", tuple("wxyz"), quaternion_from_rotation(camera_in.rotation))
        camera_from_bar = truth.ned_from_camera.inverse() @ truth.ned_from_bar
        for number, corner in enumerate(camera.project(camera_from_bar.apply(rig.cue.points_in_bar_m)), 1):
            row |= _named(f"corner_{number}", ("column_px", "row_px"), corner)
    return {name: round(float(value), 6) for name, value in row.items()}


def _named(what: str, parts: tuple[str, ...], values: Any) -> dict[str, float]:  # noqa: ANN401 - any sequence of numbers
    return {f"{what}_{part}": value for part, value in zip(parts, values, strict=True)}
