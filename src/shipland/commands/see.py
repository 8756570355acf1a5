"""`shipland see`: the near vision on pictures and videos."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class See:
    """Find the cue in pictures or a video with the same near vision that flies.

    One JSON line a picture: file, found, reason, distance_m, position_in_bar_m, yaw_deg, reprojection_px, corners_px.

    Example: shipland see photo.jpg --target bar.toml --camera calibration.yaml --json
    """

    paths: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Pictures, folders of pictures, videos."""
    target: Path | None = None
    """TOML with one [[quad]] a quadrilateral, corners_m = [[right, down], …] in metres from the cue's origin, in the
    order top-left, top-right, bottom-right, bottom-left. Default: the rig's bar."""
    camera: Path | None = None
    """OpenCV calibration YAML. Default: the rig's camera."""
    json: bool = False
    """JSON lines instead of a table for people."""

    def run(self) -> int:
        """Look at every picture and say what is in it."""
        from shipland.camera import Camera
        from shipland.rig import Target, default_rig
        from shipland.vision.near.files import default_camera, see_paths

        target = default_rig().target if self.target is None else Target.from_file(self.target)
        camera = default_camera() if self.camera is None else Camera.from_opencv_yaml(self.camera)
        for result in see_paths(self.paths, target, camera):
            print(json.dumps(result.to_json()) if self.json else result.to_line(), flush=True)
        return 0
