"""`shipland see`: the near vision on pictures, videos and flight logs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from shipland.commands.options import check_between, refuse_written_over, say
from shipland.commands.pictures import PictureOptions, look
from shipland.errors import ConfigError, DataError

if TYPE_CHECKING:
    from shipland.camera import Camera, CameraParameters
    from shipland.cue import Cue
    from shipland.record.reader import FlightLog
    from shipland.vision.attitude import AttitudeTrack
    from shipland.vision.near.files import SeeResult
    from shipland.vision.pictures import Picture


@dataclass(frozen=True)
class See(PictureOptions):
    """Find the cue in pictures, videos or a flight log with the same near vision that flies.

    With --json, a line a picture: file, t_s (time in its video), found, reason, distance_m, position_in_bar_m, yaw_deg,
    covariance (4 × 4 of forward, right, down [m] and yaw [rad]), reprojection_px, corners_px, waves_off (a red
    status light).
    What cannot be read, or breaks off, is named on standard error and the rest is looked at; the exit code is then 1,
    and 2 when nothing could be read. Pictures of a film in which nothing moves count together.

    Example: shipland see film.mp4 --cue bar.toml --calibration calibration.yaml --csv poses.csv --out out/drawn
    """

    cue: Path | None = None
    """TOML that says what the cue is: a scenario's file, or one with section [rig] alone, manufacturing_tolerance, hue
    and status_light_m, and one [[rig.polygon]] a polygon: corners_m = [[right, down], …] in metres from the cue's
    origin, clockwise from top-left. Default: the rig's bar, or that of --config."""
    config: Path | None = None
    """TOML with sections of the configuration, as a scenario has them: [vision], [camera], [rig]."""
    calibration: Path | None = None
    """OpenCV's or ROS's calibration file; a line row_time_s in OpenCV's tells a rolling shutter's time from row to row.
    Default: the camera in the log, else the rig's camera."""
    attitude: Path | None = None
    """Roll and pitch of a film's camera against the horizon: CSV with the columns t_s (the film's time), roll_deg
    (right side down positive) and pitch_deg (upward positive), one row for a camera that stands; a flight log (.mcap);
    ArduPilot's log (.bin, .tlog) or PX4's (.ulg), both with the extra mavlink. A flight log's own pictures have the
    log's. Without one the tilt of a pose may have either sign, and its covariance says so."""
    attitude_start_s: float | None = None
    """What the clock of --attitude says at the film's start; a CSV may go without."""
    attitude_std_deg: float = 0.5
    """Standard deviation of the attitude of --attitude, its mounting included."""
    mount_pitch_deg: float | None = None
    """Of a camera that is fixed to the body, its pitch against it: the body's attitude is read from the log. Not given:
    the gimbal's is."""

    def run(self) -> int:
        """Look at every picture and say what is in it."""
        from shipland.record.reader import read_log
        from shipland.report.drawings import draw_observation
        from shipland.scenario.scenario import load_scenario
        from shipland.vision.attitude import MOST_GAP_S
        from shipland.vision.near.files import COLUMNS, see_paths
        from shipland.vision.pictures import is_film, is_log

        refuse_written_over([self.csv], [*self.paths, self.cue, self.config, self.calibration, self.attitude])
        check_between(-1e10, 1e10, attitude_start_s=self.attitude_start_s)
        check_between(0.01, 10.0, attitude_std_deg=self.attitude_std_deg)
        check_between(-90.0, 90.0, mount_pitch_deg=self.mount_pitch_deg)
        if self.attitude is None and self.attitude_start_s is not None:
            raise ConfigError("--attitude-start-s is of --attitude, which is not given")
        scenario = load_scenario(self.config or {})
        logs: dict[Path, FlightLog] = {}
        unread: dict[Path, DataError] = {}
        for path in filter(is_log, self.paths):
            try:
                logs[path] = read_log(path)
            except DataError as error:
                unread[path] = error
        self._check_alike(logs)
        cue, (camera, whose) = self._cue(scenario.rig.cue, logs), self._camera(scenario.camera, logs)
        attitudes, known = self._attitudes(logs), dict[Path, list[bool]]()

        def seen(broken: Callable[[Path, DataError], None]) -> Iterator[SeeResult]:
            for path, error in unread.items():
                broken(path, error)
            readable = [path for path in self.paths if path not in unread]
            if unread and not readable:
                return
            found = see_paths(readable, cue, camera, broken, scenario.vision, attitudes.get)
            for number, result in enumerate(found):
                if number == 0:
                    say(f"camera: {_words(camera, result.picture.image)}, {whose}")
                    say(f"cue: {cue.size_words}")
                film = result.picture.source
                if is_film(film):
                    if film not in known:
                        say(f"attitude: {attitudes[film].words if film in attitudes else _NONE}")
                    known.setdefault(film, []).append(math.isfinite(result.observation.gimbal.pitch_rad))
                yield result
            for film, of_pictures in known.items():
                if film in attitudes and not all(of_pictures):
                    of = len(of_pictures)
                    without = f"{of - sum(of_pictures)} of {of} pictures are without attitude"
                    wanted = f"expected readings at most {MOST_GAP_S:g} s apart along the film (--attitude-start-s)"
                    got = f"got {attitudes[film].words} on the film's clock"
                    broken(film, DataError(f"{film}: {without}; {wanted}, {got}"))

        return look(self, COLUMNS, lambda it: draw_observation(it.picture.image, it.observation), seen)

    def _check_alike(self, logs: Mapping[Path, FlightLog]) -> None:
        """DataError where flight logs have different cameras or cues, and none was given."""
        for what, given, of_logs in (
            ("camera", self.calibration, [log.header.camera.digest for log in logs.values()]),
            ("cue", self.cue or self.config, [log.header.rig.cue for log in logs.values()]),
        ):
            other = next((path for path, of_log in zip(logs, of_logs, strict=True) if of_log != of_logs[0]), None)
            if given is None and other is not None:
                raise DataError(f"{other} has another {what} than {next(iter(logs))}: look at them one by one")

    def _cue(self, configured: Cue, logs: Mapping[Path, FlightLog]) -> Cue:
        """The cue that is looked for."""
        from shipland.cue import Cue

        if self.cue is not None:
            return Cue.from_file(self.cue)
        if self.config is None and logs:
            return next(iter(logs.values())).header.rig.cue
        return configured

    def _camera(self, configured: CameraParameters, logs: Mapping[Path, FlightLog]) -> tuple[Camera, str]:
        """The camera that is assumed, and where it comes from."""
        from shipland.calibration_file import read_calibration
        from shipland.camera import Camera

        if self.calibration is not None:
            return read_calibration(self.calibration), f"from {self.calibration}"
        for path, log in logs.items():
            return log.header.camera, f"as {path} has it"
        return Camera.from_parameters(configured), "that of the configuration; --calibration gives another"

    def _attitudes(self, logs: Mapping[Path, FlightLog]) -> dict[Path, AttitudeTrack]:
        """Of each film whose camera's attitude is known."""
        from shipland.record.reader import read_log
        from shipland.vision.attitude import placed, read_attitude
        from shipland.vision.pictures import is_film, is_log

        body = self.mount_pitch_deg is not None
        mount_rad = None if self.mount_pitch_deg is None else math.radians(self.mount_pitch_deg)
        own = {}
        for path, log in logs.items():
            with suppress(DataError):  # the log holds none
                own[path] = placed(log.attitude(path, body=body), 0.0, mount_rad)
        films = [path for path in self.paths if is_film(path) and path not in own]
        if self.attitude is None:
            return own
        if not films:
            raise DataError(f"--attitude {self.attitude}: none of the paths is a film")
        std_rad = math.radians(self.attitude_std_deg)
        if is_log(self.attitude):
            logged = replace(read_log(self.attitude).attitude(self.attitude, body=body), std_rad=std_rad)
            track = placed(logged, self.attitude_start_s, mount_rad)
        else:
            track = read_attitude(self.attitude, std_rad, self.attitude_start_s, mount_rad)
        return own | dict.fromkeys(films, track)


_NONE = "none, a pose's tilt may have either sign; --attitude gives it"


def _words(camera: Camera, picture: Picture) -> str:
    height_px, width_px = picture.shape[:2]
    scaled = "" if width_px == camera.width_px else f" scaled to the picture's {width_px} × {height_px} px"
    return f"{camera.width_px} × {camera.height_px} px, focal length {camera.focal_px:.0f} px{scaled}"
