"""`shipland see`: the near vision on pictures, videos and flight logs."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shipland.commands.pictures import PictureOptions, Results

if TYPE_CHECKING:
    from shipland.camera import Camera, CameraParameters
    from shipland.vision.pictures import Picture


@dataclass(frozen=True)
class See(PictureOptions):
    """Find the cue in pictures, videos or a flight log with the same near vision that flies.

    One JSON line a picture: file, t_s (time in its video), found, reason, distance_m, position_in_bar_m, yaw_deg,
    covariance (4 × 4 of forward, right, down [m] and yaw [rad]), reprojection_px, corners_px.
    What cannot be read is named on standard error and the rest is looked at; the exit code is then 1, and 2 when
    nothing could be read.

    Example: shipland see film.mp4 --cue bar.toml --calibration calibration.yaml --csv poses.csv --out out/drawn
    """

    cue: Path | None = None
    """TOML that says what the cue is: a scenario's file, or one with section [rig] alone, manufacturing_tolerance and
    hue, and one [[rig.polygon]] a polygon: corners_m = [[right, down], …] in metres from the cue's origin, clockwise
    from top-left. Default: the rig's bar, or that of --config."""
    config: Path | None = None
    """TOML with sections of the configuration, as a scenario has them: [vision], [camera], [rig]."""
    calibration: Path | None = None
    """OpenCV calibration YAML; a line row_time_s in it tells a rolling shutter's time from row to row. Default: the
    camera in the log, else the rig's camera."""

    def run(self) -> int:
        """Look at every picture and say what is in it."""
        from shipland.cue import Cue
        from shipland.report.drawings import draw_observation
        from shipland.scenario.scenario import load_scenario
        from shipland.vision.near.files import COLUMNS, see_paths

        scenario = load_scenario(self.config or {})
        cue = scenario.rig.cue if self.cue is None else Cue.from_file(self.cue)
        camera, whose = self._camera(scenario.camera)
        with Results(self, COLUMNS) as results:
            for number, result in enumerate(see_paths(self.paths, cue, camera, results.broken, scenario.vision)):
                if number == 0:
                    print(f"camera: {_words(camera, result.picture.image)}, {whose}", file=sys.stderr)
                    print(f"cue: {cue.size_words}", file=sys.stderr)
                results.add(result, lambda it=result: draw_observation(it.picture.image, it.observation))  # type: ignore[misc]
        return results.exit_code

    def _camera(self, configured: CameraParameters) -> tuple[Camera, str]:
        """The camera that is assumed, and where it comes from."""
        from shipland.camera import Camera
        from shipland.record.reader import read_log
        from shipland.vision.pictures import is_log

        if self.calibration is not None:
            return Camera.from_opencv_yaml(self.calibration), f"from {self.calibration}"
        for path in self.paths:
            if is_log(path):
                return read_log(path).header.camera, f"as {path} has it"
        return Camera.from_parameters(configured), "that of the configuration; --calibration gives another"


def _words(camera: Camera, picture: Picture) -> str:
    height_px, width_px = picture.shape[:2]
    scaled = "" if width_px == camera.width_px else f" scaled to the picture's {width_px} × {height_px} px"
    return f"{camera.width_px} × {camera.height_px} px, focal length {camera.focal_px:.0f} px{scaled}"
