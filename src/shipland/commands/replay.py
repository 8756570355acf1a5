"""`shipland replay`: vision and pilot again over a recorded flight or a video."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from shipland.commands.options import (
    ScenarioOptions,
    check_between,
    command_line,
    refuse_written_over,
    say,
    say_if_broken_off,
)
from shipland.errors import ConfigError

if TYPE_CHECKING:
    from shipland.evaluation.replays import Pair, Recording


@dataclass(frozen=True)
class Replay(ScenarioOptions):
    """Run vision and pilot again over a recorded flight, and say where they differ from what was recorded.

    Of a flight log, those that flew run again unless others are named, on the pictures that the log keeps, or on the
    recorded truth with `--vision geometric`; of the options of a scenario only --set counts then, laid over what was
    flown. Of a video there is nothing to compare with: what is seen and decided goes to --out and --viewer. The sticks
    move nothing.

    Example: shipland replay out/flight/flight.mcap --pilot horizon
    """

    recording: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="[FILE]")] = Path("out/flight/flight.mcap")
    """A flight log or its folder, or a video."""
    pilot: str = ""
    """Who flies, as in `shipland fly`; not given: who flew the log."""
    vision: str = ""
    """Who sees, as in `shipland fly`; not given: who saw the log."""
    calibration: Path | None = None
    """OpenCV's or ROS's calibration file of a video's camera; without one it is the scenario's."""
    pitch_deg: float = 0.0
    """Pitch of a video's camera against the horizon."""
    out: Path | None = None
    """Write the replay's log there, as shipland fly does."""
    viewer: bool = False
    """Show it in rerun (extra `viewer`); nothing leaves this machine."""
    viewer_file: Path | None = None
    """Write rerun's recording (.rrd) instead of opening its window."""

    def run(self) -> int:
        """Replay and print what differs; 1 where the log breaks off."""
        from shipland.evaluation.replays import differences
        from shipland.report.outputs import log_in

        written = [path for path in (self.out, self.viewer_file) if path is not None]
        path = log_in(self.recording)
        refuse_written_over(written, [path, self.calibration, self.config])
        check_between(-90.0, 90.0, pitch_deg=self.pitch_deg)
        recording = self._recording(path)
        print(*differences(self._replayed(recording)), sep="\n")
        if written:
            say(f"written: {', '.join(map(str, written))}")
        say_if_broken_off(path, len(recording.records), recording.complete)
        return 0 if recording.complete else 1

    def _replayed(self, recording: Recording) -> list[Pair]:
        from shipland.evaluation.replays import replay
        from shipland.report.viewer import Viewer
        from shipland.scenario.fly import flight_log

        scenario = recording.scenario
        with ExitStack() as stack:
            sinks = []
            if self.out is not None:
                log = flight_log(self.out, scenario, recording.pilot, recording.vision, recording.seed, command_line())
                sinks.append(stack.enter_context(log).append)
            if self.viewer or self.viewer_file is not None:
                viewer = Viewer(scenario.rig, self.viewer_file)
                stack.callback(viewer.close)
                sinks.append(viewer.show)
            return replay(recording, lambda record: [sink(record) for sink in sinks])

    def _recording(self, path: Path) -> Recording:
        from shipland.calibration_file import read_calibration
        from shipland.evaluation.replays import recorded_film, recorded_flight
        from shipland.vision.pictures import is_video

        if is_video(path):
            pilot, vision = self.pilot or "horizon", self.vision or "rendered"
            if self.calibration is None:
                say("camera: that of the scenario; --calibration gives another")
            camera = None if self.calibration is None else read_calibration(self.calibration)
            return recorded_film(path, self.load(), pilot, vision, self.pitch_deg, camera)
        if self.calibration is not None or self.pitch_deg:
            raise ConfigError(f"--calibration and --pitch-deg are of a video; the log {path} holds its own")
        return recorded_flight(path, self.pilot, self.vision, self.changes)
