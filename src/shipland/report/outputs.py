"""Everything that a flight leaves in its folder: log, video, plots, figures."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from shipland.aside import Aside
from shipland.camera import Camera
from shipland.errors import DataError
from shipland.extras import installed
from shipland.messages import FlightRecord, GroundTruth, TouchdownVerdict
from shipland.record.channels import LogParameters
from shipland.record.info import FlightInfo
from shipland.record.layout import LAYOUT_NAME, write_layout
from shipland.record.reader import FlightLog, read_log
from shipland.record.writer import LogWriter
from shipland.report.lettering import Image
from shipland.report.plots import plot_flight
from shipland.report.summary import summarise, write_json
from shipland.report.video import Chase, FlightVideo, VideoParameters
from shipland.rig import Rig

LOG_NAME, VIDEO_NAME, PLOTS_NAME = "flight.mcap", "flight.mp4", "plots.png"
SUMMARY_NAME, TIMING_NAME = "summary.json", "timing.json"

_MOST_ROWS, _MOST_PICTURES = 3000, 30
"""Most rows that wait for the disk in real time, and the number of waiting rows from which pictures are left out."""


def log_in(path: Path) -> Path:
    """The log in a flight's folder; any other path is as it is."""
    return path / LOG_NAME if (path / LOG_NAME).is_file() else path


def _words(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename} cannot be written: {error.strerror}" if error.filename else error.strerror
    return str(error) or type(error).__name__


class Recorder(AbstractContextManager["Recorder"]):
    """Takes a flight cycle by cycle and leaves it in a folder.

    In flight nothing raises: an output that fails is given up, the others go on, and `problems` says what happened.
    A context manager: a flight that is broken off leaves a closed log and video, plots and figures too.
    """

    def __init__(
        self,
        folder: Path,
        info: FlightInfo,
        rig: Rig,
        camera: Camera,
        chase: Chase | None = None,
        video: bool = True,
        aside: bool = False,
    ) -> None:
        """Open the files in `folder`, made when it does not exist, writing over those of an earlier flight.

        `chase` renders the outside view of a moment (`chase.chase_view`); without it the onboard view stands alone.
        With `aside` the flight does not wait for a slow disk or encoder: a thread writes, and where it falls far behind
        pictures are left out, then rows, which `problems` says. DataError where folder or log cannot be written.
        """
        self.folder = folder
        self.problems: list[str] = []
        self._finished = False
        self._flown: FlightLog | None = None
        self._cost_s = {"log": 0.0, "video": 0.0, "chase": 0.0}
        self._cycles = 0
        self._log = LogWriter(folder / LOG_NAME, info, rig, camera, LogParameters())
        try:
            for name in (VIDEO_NAME, PLOTS_NAME, SUMMARY_NAME, TIMING_NAME, LAYOUT_NAME):
                (folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise DataError(f"output folder {folder} cannot be written: {error.strerror}") from None
        self._outputs: dict[str, LogWriter | FlightVideo] = {"log": self._log}
        self._attempt("layout", partial(write_layout, folder / LAYOUT_NAME))
        if video:
            timed = None if chase is None else partial(self._timed, chase)
            self._outputs["video"] = FlightVideo(folder / VIDEO_NAME, rig, camera, VideoParameters(), timed)
        self._aside = Aside(self._write, _MOST_ROWS, "recorder") if aside else None

    def append(self, record: FlightRecord) -> None:
        """Take one cycle; never raises."""
        if self._aside is None:
            self._write(record)
            return
        if self._aside.waiting >= _MOST_PICTURES:
            record = replace(record, frame=replace(record.frame, image=None))
        self._aside.give(record)

    def _write(self, record: FlightRecord) -> None:
        self._cycles += 1
        for name, output in list(self._outputs.items()):
            self._attempt(name, partial(output.append, record))

    def finish(
        self, verdict: TouchdownVerdict | None, end: str = "", cost_s: Mapping[str, float] | None = None
    ) -> None:
        """Close log and video; write plots, summary and timing, with the wall-clock time of each stage `cost_s` [s]."""
        self._finished = True
        if self._aside is not None:
            self._aside.close()
            if self._aside.lost:
                self.problems.append(f"{self._aside.lost} cycles left out: the disk was too slow")
        if "log" in self._outputs:
            self._attempt("log", partial(self._log.finish, verdict, end))
        if isinstance(video := self._outputs.get("video"), FlightVideo):
            self._attempt("video", partial(video.finish, verdict))
        if "log" in self._outputs:  # they are made from it
            self._attempt("summary", partial(self._write_summary, end))
            self._attempt("plots", self._write_plots)
        self._attempt("timing", partial(self._write_timing, cost_s or {}))

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if not self._finished:
            self.finish(None, "broken off" if error is None else f"broken off: {str(error) or type(error).__name__}")
        for name, output in list(self._outputs.items()):
            self._attempt(name, output.close)

    def _attempt(self, name: str, act: Callable[[], None]) -> None:
        started_s = time.perf_counter()
        try:
            act()
        except Exception as error:
            self.problems.append(f"{name} given up: {_words(error)}")
            output = self._outputs.pop(name, None)
            if output is not None:
                with suppress(Exception):  # what stopped it is noted
                    output.close()
        self._cost_s[name] = self._cost_s.get(name, 0.0) + time.perf_counter() - started_s

    def _timed(self, chase: Chase, truth: GroundTruth) -> Image:
        started_s = time.perf_counter()
        image = chase(truth)
        self._cost_s["chase"] += time.perf_counter() - started_s
        return image

    def _write_summary(self, end: str) -> None:
        self._flown = read_log(self.folder / LOG_NAME)
        configuration = self._flown.header.info.table()
        write_json(self.folder / SUMMARY_NAME, summarise(self._flown, end), configuration=configuration)

    def _write_plots(self) -> None:
        if self._flown is not None and self._flown.records and installed("plots"):
            plot_flight(self.folder / PLOTS_NAME, self._flown)

    def _write_timing(self, cost_s: Mapping[str, float]) -> None:
        own_s = self._cost_s | {"video": self._cost_s["video"] - self._cost_s["chase"]}
        stages = {
            name: {"total_s": value, "per_cycle_ms": 1e3 * value / max(1, self._cycles)}
            for name, value in (*cost_s.items(), *own_s.items())
        }
        write_json(self.folder / TIMING_NAME, {"cycles": self._cycles, "stages": stages})
