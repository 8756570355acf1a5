"""The near vision over pictures, folders and videos."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shipland.calibration_file import read_calibration
from shipland.camera import Camera, CameraParameters
from shipland.compiled import say_that_it_compiles
from shipland.cue import Cue
from shipland.errors import DataError
from shipland.messages import Frame, GimbalAttitude, Observation
from shipland.rig import Rig
from shipland.vision.attitude import AttitudeTrack
from shipland.vision.near.pipeline import NearVision
from shipland.vision.parameters import VisionParameters
from shipland.vision.pictures import FilePicture, Picture, is_film, pictures_of, read_picture

_UNKNOWN_GIMBAL = GimbalAttitude(math.nan, math.nan)
"""Of a picture without attitude: the near vision then uses none."""

_MAX_OBLIQUITY_DEG = 65.0
"""Largest angle between sight and the cue's normal: a flight comes from astern, a photograph from anywhere."""

COLUMNS = (
    "file", "t_s", "found", "reason", "distance_m", "forward_m", "right_m", "down_m", "yaw_deg", "forward_sd_m",
    "right_sd_m", "down_sd_m", "yaw_sd_deg", "reprojection_px", "waves_off",
)  # fmt: skip
"""Of the table; the place is the camera's in `bar`."""


@dataclass(frozen=True, repr=False)
class SeeResult:
    """What was found in one picture.

    Attributes:
        picture: where.
        observation: what the near vision says of it; its `gimbal` is NaN where no attitude was known.
    """

    picture: FilePicture
    observation: Observation

    def __repr__(self) -> str:
        return f"<{self.to_line()}>"

    @property
    def found(self) -> bool:
        """Whether there is a pose."""
        return self.observation.bar_pose is not None

    def to_json(self) -> dict[str, object]:
        """For a JSON line; what is not known is None. Lengths to 0.1 mm, angles to 0.0001°, pixels to 0.001."""
        pose = self.observation.bar_pose
        return {
            "file": self.picture.name,
            "t_s": self.picture.stamp_s,
            "found": pose is not None,
            "reason": self.observation.reason,
            "distance_m": None if pose is None else round(float(np.linalg.norm(pose.position_in_bar_m)), 4),
            "position_in_bar_m": None if pose is None else np.round(pose.position_in_bar_m, 4).tolist(),
            "yaw_deg": None if pose is None else round(float(np.degrees(pose.yaw_rad)), 4),
            "covariance": None if pose is None else [[float(f"{c:.9g}") for c in row] for row in pose.covariance],
            "reprojection_px": None if pose is None else round(pose.reprojection_px, 4),
            "corners_px": None if pose is None else np.round(pose.corners_px, 3).tolist(),
            "waves_off": self.observation.waves_off,
        }

    def to_rows(self) -> list[dict[str, object]]:
        """For a table: one row; deviations are the roots of the covariance's diagonal."""
        pose, found = self.observation.bar_pose, self.to_json()
        row = {name: found[name] for name in COLUMNS if name in found}
        if pose is not None:
            std = np.sqrt(np.diag(pose.covariance))
            values = [*pose.position_in_bar_m, *std[:3], np.degrees(std[3])]
            row |= {
                name: round(float(value), 5) for name, value in zip(COLUMNS[5:8] + COLUMNS[9:13], values, strict=True)
            }
        return [row]

    def to_line(self) -> str:
        """For people."""
        pose = self.observation.bar_pose
        if pose is None:
            return f"{self.picture.name}: not found: {self.observation.reason}"
        forward_m, right_m, down_m = pose.position_in_bar_m
        return (
            f"{self.picture.name}: {float(np.linalg.norm(pose.position_in_bar_m)):.3f} m away; "
            f"camera {-forward_m:.3f} m astern, {abs(right_m):.3f} m {'right' if right_m >= 0.0 else 'left'}, "
            f"{abs(down_m):.3f} m {'below' if down_m >= 0.0 else 'above'}; "
            f"yaw {np.degrees(pose.yaw_rad):+.2f}°; reprojection {pose.reprojection_px:.2f} px"
            f"{'; waves off' if self.observation.waves_off else ''}"
        )


def see(
    image: Picture | str | Path, *, cue: Cue | str | Path | None = None, camera: Camera | str | Path | None = None
) -> SeeResult:
    """Find the cue in one picture, as `shipland see` does in many.

    Args:
        image: (H,W,3) uint8 BGR, as OpenCV reads it, or the path of a picture.
        cue: what is looked for, or the path of its TOML file; None: the packaged rig's bar.
        camera: of pictures of its size and of others of the same aspect, or the path of its OpenCV calibration YAML;
            None: the packaged one.

    Returns:
        What was found: `found`, `observation` with the pose, `to_json()` and `to_line()` as the command prints them.

    Raises:
        DataError: no such picture, a picture of another shape, or of another aspect than the camera's.
        ConfigError: the cue's file is wrong.
    """
    path = Path("picture") if isinstance(image, np.ndarray) else Path(image)
    pixels = image if isinstance(image, np.ndarray) else read_picture(path)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape or pixels.dtype != np.uint8:
        raise DataError(f"a picture is (H,W,3) uint8 BGR, got {pixels.shape} {pixels.dtype}")
    cue = Rig().cue if cue is None else cue if isinstance(cue, Cue) else Cue.from_file(Path(cue))
    if camera is None:
        camera = default_camera()
    elif not isinstance(camera, Camera):
        camera = read_calibration(Path(camera))
    return _FilmVision(cue, camera, VisionParameters()).see(FilePicture(str(path), path, pixels))


def see_paths(
    paths: Sequence[Path],
    cue: Cue,
    camera: Camera,
    broken: Callable[[Path, DataError], None] | None = None,
    parameters: VisionParameters | None = None,
    attitude_of: Callable[[Path], AttitudeTrack | None] = lambda _: None,
) -> Iterator[SeeResult]:
    """One result a picture, in the order of `pictures_of`.

    Args:
        paths: pictures, folders of pictures, videos.
        cue: what is looked for.
        camera: of pictures of its size, and of others of the same aspect.
        broken: called with a picture or video that is missing or broken or of another aspect than the camera's, before
            the rest follows; None raises.
        parameters: of the near vision; None for the packaged ones. What a flight never sees obliquely is left out, and
            so is the gimbal's noise: an attitude has its own.
        attitude_of: the camera's attitude in a video or log; None where it is not known.

    Raises:
        DataError: without `broken`, what it would be called with.
    """
    visions = _FilmVision(cue, camera, parameters or VisionParameters(), attitude_of)
    for some in [[path] for path in paths] or [[]]:
        for picture in pictures_of(some, broken):
            try:
                result = visions.see(picture)
            except DataError as error:
                if broken is None:
                    raise
                broken(picture.source, error)
                if is_film(picture.source):
                    break  # all of its pictures have that aspect
            else:
                yield result


def default_camera() -> Camera:
    """The camera of the packaged configuration."""
    return Camera.from_parameters(CameraParameters())


class _FilmVision:
    """The near vision of a picture and of those that follow it at its size."""

    def __init__(
        self,
        cue: Cue,
        camera: Camera,
        parameters: VisionParameters,
        attitude_of: Callable[[Path], AttitudeTrack | None] = lambda _: None,
    ) -> None:
        self._cue, self._camera, self._attitude_of = cue, camera, attitude_of
        self._parameters = replace(parameters, max_obliquity_deg=max(parameters.max_obliquity_deg, _MAX_OBLIQUITY_DEG))
        self._vision: NearVision | None = None
        self._size_px = (0, 0)
        self._attitudes: dict[Path, AttitudeTrack | None] = {}

    def see(self, picture: FilePicture) -> SeeResult:
        """What is in one picture; a video's pictures are followed."""
        source = picture.source
        if source not in self._attitudes:
            self._attitudes[source] = self._attitude_of(source) if is_film(source) else None
        attitude = self._attitudes[source]
        size_px = (picture.image.shape[1], picture.image.shape[0])
        if self._vision is None:
            say_that_it_compiles()
        if self._vision is None or not picture.follows or size_px != self._size_px:
            camera = self._camera.for_pictures(picture.name, *size_px)
            std_rad = 0.0 if attitude is None else attitude.std_rad
            parameters = replace(self._parameters, gimbal_noise_rad=std_rad)
            self._vision, self._size_px = NearVision(self._cue, camera, parameters, fuse=True), size_px
        gimbal = _UNKNOWN_GIMBAL if attitude is None else attitude.at(picture.t_s)
        return SeeResult(picture, self._vision.see(Frame(picture.t_s, picture.image, gimbal)))
