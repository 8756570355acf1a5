"""The near vision over pictures, folders and videos: what `shipland see` does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera, CameraParameters
from shipland.config import build
from shipland.errors import DataError
from shipland.messages import Frame, GimbalAttitude, Observation
from shipland.rig import Target, default_rig, packaged_table
from shipland.vision.near.pipeline import NearVision, VisionParameters

PICTURE_SUFFIXES = frozenset({".bmp", ".jp2", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp"})
"""What is taken from a folder."""

VIDEO_SUFFIXES = frozenset({".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".ts", ".webm"})
"""What is read as a video; every other file is read as a picture."""

_UNKNOWN_GIMBAL = GimbalAttitude(0.0, 0.0)
"""A file does not say how its camera was held; the near vision is told not to use it."""


@dataclass(frozen=True)
class SeeRequest:
    """What to look at.

    Attributes:
        paths: pictures, folders of pictures, videos.
        target: TOML file of the cue; None for the rig's bar.
        camera: OpenCV calibration file; None for the rig's camera.
    """

    paths: tuple[Path, ...]
    target: Path | None = None
    camera: Path | None = None


@dataclass(frozen=True)
class SeeResult:
    """What was found in one picture.

    Attributes:
        file: its path as given; of a video's picture, with `#` and its number from 000000.
        observation: what the near vision says of it.
    """

    file: str
    observation: Observation

    @property
    def found(self) -> bool:
        """Whether there is a pose."""
        return self.observation.bar_pose is not None

    def to_json(self) -> dict[str, object]:
        """For a JSON line; what is not known is None. Lengths to 0.1 mm, angles to 0.0001°, pixels to 0.001."""
        pose = self.observation.bar_pose
        return {
            "file": self.file,
            "found": pose is not None,
            "reason": self.observation.reason,
            "distance_m": None if pose is None else round(float(np.linalg.norm(pose.position_in_bar_m)), 4),
            "position_in_bar_m": None if pose is None else np.round(pose.position_in_bar_m, 4).tolist(),
            "yaw_deg": None if pose is None else round(float(np.degrees(pose.yaw_rad)), 4),
            "reprojection_px": None if pose is None else round(pose.reprojection_px, 4),
            "corners_px": None if pose is None else np.round(pose.corners_px, 3).tolist(),
        }

    def to_line(self) -> str:
        """For people."""
        pose = self.observation.bar_pose
        if pose is None:
            return f"{self.file}: not found: {self.observation.reason}"
        forward_m, right_m, down_m = pose.position_in_bar_m
        return (
            f"{self.file}: {float(np.linalg.norm(pose.position_in_bar_m)):.3f} m away; "
            f"camera {-forward_m:.3f} m astern, {abs(right_m):.3f} m {'right' if right_m >= 0.0 else 'left'}, "
            f"{abs(down_m):.3f} m {'below' if down_m >= 0.0 else 'above'}; "
            f"yaw {np.degrees(pose.yaw_rad):+.2f}°; reprojection {pose.reprojection_px:.2f} px"
        )


def see_paths(request: SeeRequest) -> Iterator[SeeResult]:
    """One result a picture, in the order given; a folder's pictures by name, a video's in time.

    Raises:
        DataError: a picture, video or calibration is missing or broken, or of another aspect than the calibration.
        ConfigError: the target file is wrong.
    """
    if not request.paths:
        raise DataError("nothing to look at; give at least one picture, folder of pictures or video")
    target = default_rig().target if request.target is None else Target.from_file(request.target)
    if request.camera is None:
        camera = Camera.from_parameters(build(CameraParameters, packaged_table("camera"), "camera"))
    else:
        camera = Camera.from_opencv_yaml(request.camera)
    eyes = _Eyes(target, camera)
    for path in request.paths:
        yield from _see_path(path, eyes)


class _Eyes:
    """One near vision a picture size, made when it is first needed."""

    def __init__(self, target: Target, camera: Camera) -> None:
        self._target, self._camera = target, camera
        parameters = build(VisionParameters, packaged_table("vision"), "vision")
        self._parameters = replace(parameters, gimbal_noise_rad=0.0)
        self._by_size: dict[tuple[int, int], NearVision] = {}

    def see(self, name: str, image: npt.NDArray[np.uint8], t_s: float, follows: bool) -> SeeResult:
        """One picture; `follows` when it comes after the last one in a video."""
        size = (image.shape[1], image.shape[0])
        if size not in self._by_size:
            self._by_size[size] = NearVision(self._target, self._camera_at(name, *size), self._parameters)
        vision = self._by_size[size]
        if not follows:
            vision.reset()
        return SeeResult(name, vision.see(Frame(t_s, image, _UNKNOWN_GIMBAL)))

    def _camera_at(self, name: str, width_px: int, height_px: int) -> Camera:
        camera = self._camera
        if (width_px, height_px) == (camera.width_px, camera.height_px):
            return camera
        if abs(width_px * camera.height_px / camera.width_px - height_px) > 1.0:
            raise DataError(
                f"{name} is {width_px} × {height_px} px, the calibration is for {camera.width_px} × "
                f"{camera.height_px} px; expected that size or the same aspect: give the picture's own calibration"
            )
        return camera.scaled(width_px, height_px)


def _see_path(path: Path, eyes: _Eyes) -> Iterator[SeeResult]:
    if path.is_dir():
        names = sorted(item for item in path.iterdir() if item.suffix.lower() in PICTURE_SUFFIXES and item.is_file())
        if not names:
            raise DataError(f"folder {path} holds no pictures; expected {', '.join(sorted(PICTURE_SUFFIXES))}")
        for name in names:
            yield eyes.see(str(name), read_picture(name), 0.0, follows=False)
    elif path.suffix.lower() in VIDEO_SUFFIXES:
        for index, (t_s, image) in enumerate(read_video(path)):
            yield eyes.see(f"{path}#{index:06d}", image, t_s, follows=index > 0)
    else:
        yield eyes.see(str(path), read_picture(path), 0.0, follows=False)


def read_picture(path: Path) -> npt.NDArray[np.uint8]:
    """A picture file as (H,W,3) BGR: grey becomes BGR, 16 bits become 8, transparency is dropped.

    Raises:
        DataError: it is missing, or not a whole picture.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise DataError(f"picture {path} does not exist") from None
    except OSError as error:
        raise DataError(f"picture {path} cannot be read: {error.strerror}") from None
    image = None
    if data and not _breaks_off(data):
        level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        except cv2.error:
            image = None
        finally:
            cv2.utils.logging.setLogLevel(level)
    if image is None:
        raise DataError(f"{path} is not a whole picture; expected JPEG, PNG, TIFF, BMP, WebP or PNM")
    return np.asarray(image, np.uint8)


def _breaks_off(data: bytes) -> bool:
    """Whether a JPEG or PNG lacks its end mark; their decoders fill up what is missing, or print to the terminal."""
    if data.startswith(b"\xff\xd8"):
        return b"\xff\xd9" not in data[-65536:]
    return data.startswith(b"\x89PNG") and b"IEND" not in data[-65536:]


def read_video(path: Path) -> Iterator[tuple[float, npt.NDArray[np.uint8]]]:
    """A video's pictures with their times: t [s] and (H,W,3) BGR.

    Raises:
        DataError: it is missing, not a video, or breaks off.
    """
    import av

    if not path.is_file():
        raise DataError(f"video {path} does not exist")
    count = 0
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise DataError(f"{path} holds no video stream")
            stream = container.streams.video[0]
            step_s = float(1 / stream.average_rate) if stream.average_rate else 1.0 / 30.0
            for picture in container.decode(stream):
                t_s = picture.time if picture.time is not None else count * step_s
                yield float(t_s), np.asarray(picture.to_ndarray(format="bgr24"), np.uint8)
                count += 1
    except (av.error.FFmpegError, OSError) as error:
        place = f"breaks off after picture {count - 1}" if count else "is not a video that can be read"
        raise DataError(f"{path} {place}: {error.strerror or error}") from None
    if count == 0:
        raise DataError(f"video {path} holds no pictures")
