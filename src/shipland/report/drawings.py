"""Pictures and videos with what was found drawn on them."""

from __future__ import annotations

import itertools
from contextlib import AbstractContextManager
from pathlib import Path

import cv2
import numpy as np

from shipland.errors import DataError
from shipland.extras import require
from shipland.messages import Box, Observation
from shipland.report.overlay import draw_sight
from shipland.report.video import VideoParameters, VideoWriter
from shipland.vision.pictures import FilePicture, Picture, is_film

_FILM = VideoParameters(crf=23.0, preset="medium", tune="film")
_OUTLINED = ((3, (20, 20, 20)), (1, (80, 230, 40)))
"""Thickness and colour of a line and of what stands out around it."""


class Drawings(AbstractContextManager["Drawings"]):
    """The folder that drawings go to; a context manager. Pictures become .jpg, films .mp4 with their times."""

    def __init__(self, out: Path) -> None:
        self._out, self._first_s = out, 0.0
        self._taken: set[Path] = set()
        self._video: VideoWriter | None = None

    def __exit__(self, *_: object) -> None:
        if self._video is not None:
            self._video.close()

    def add(self, picture: FilePicture, drawn: Picture) -> None:
        """Write `drawn` under the name of `picture`, or name-2 and so on; DataError where that is the picture."""
        if is_film(picture.source):
            height_px, width_px = (side // 2 * 2 for side in drawn.shape[:2])  # H.264 wants even sides
            if self._video is None or not picture.follows:
                require("film", "a film with drawings")
                self.__exit__()
                place, self._first_s = self._place(picture.source, ".mp4"), picture.t_s
                self._video = VideoWriter(place, width_px, height_px, _FILM)
            self._video.write(np.ascontiguousarray(drawn[:height_px, :width_px]), picture.t_s - self._first_s)
        else:
            place = self._place(picture.source, ".jpg")
            place.write_bytes(cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes())

    def _place(self, source: Path, suffix: str) -> Path:
        self._out.mkdir(parents=True, exist_ok=True)
        names = (f"{source.stem}{count}{suffix}" for count in itertools.chain([""], itertools.count(-2, -1)))
        place = next(self._out / name for name in names if self._out / name not in self._taken)
        if place.exists() and place.samefile(source):
            raise DataError(f"{source} would be drawn over: give another folder than {self._out}")
        self._taken.add(place)
        return place


def draw_observation(picture: Picture, observation: Observation) -> Picture:
    """A copy of a picture (h,w,3) BGR with the corners of the cue and a line of text below."""
    drawn, pose = picture.copy(), observation.bar_pose
    draw_sight(drawn, observation, 1.0)
    text = f"not found: {observation.reason}"
    if pose is not None:
        forward_m, right_m, down_m = pose.position_in_bar_m
        place = f"{-forward_m:.2f} m astern, {right_m:+.2f} m right, {down_m:+.2f} m down"
        text = f"{place}, {np.degrees(pose.yaw_rad):+.1f} deg"
    _write(drawn, text, (12, drawn.shape[0] - 14))
    return drawn


def draw_boxes(picture: Picture, boxes: tuple[tuple[Box, str], ...]) -> Picture:
    """A copy of a picture (h,w,3) BGR with frames just outside the boxes, each with its class and confidence."""
    drawn, scale = picture.copy(), _scale(picture)
    for box, name in boxes:
        centre, half = np.array(box.centre_px), 0.5 * np.array(box.size_px) + 2.0 * scale
        left, top, right, bottom = (int(value) for value in np.round([*(centre - half), *(centre + half)]))
        for thick, colour in _OUTLINED:
            cv2.rectangle(drawn, (left, top), (right, bottom), colour, thick * scale)
        above = top - 6 * scale if top > 24 * scale else bottom + 18 * scale
        _write(drawn, f"{name} {100.0 * box.confidence:.0f} %", (left, above))
    return drawn


def _scale(picture: Picture) -> int:
    return int(max(1, round(picture.shape[1] / 1280)))


def _write(picture: Picture, text: str, place_px: tuple[int, int]) -> None:
    scale = _scale(picture)
    for thick, colour in _OUTLINED:
        cv2.putText(picture, text, place_px, cv2.FONT_HERSHEY_SIMPLEX, 0.5 * scale, colour, thick * scale, cv2.LINE_AA)
