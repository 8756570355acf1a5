"""Pictures and videos from files."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from shipland.errors import DataError

Picture = npt.NDArray[np.uint8]

PICTURE_SUFFIXES = frozenset({".bmp", ".jp2", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp"})
"""What is taken from a folder."""

VIDEO_SUFFIXES = frozenset({".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".ts", ".webm"})
"""What is read as a video; every other file is read as a picture."""


@dataclass(frozen=True)
class FilePicture:
    """One picture of a file.

    Attributes:
        name: the file's path as given; of a video's picture, with `#` and its number from 000000.
        source: the file.
        image: (H,W,3) BGR.
        t_s: time in its video; 0 for a single picture.
        follows: it comes after the one before in a video.
    """

    name: str
    source: Path
    image: Picture
    t_s: float = 0.0
    follows: bool = False


def is_video(path: Path) -> bool:
    """Whether a file is read as a video."""
    return path.suffix.lower() in VIDEO_SUFFIXES


def pictures_of(
    paths: Sequence[Path], broken: Callable[[Path, DataError], None] | None = None
) -> Iterator[FilePicture]:
    """The pictures of files, in the order given; a folder's pictures by name, a video's in time.

    Args:
        paths: pictures, folders of pictures, videos.
        broken: is told of a picture or video that is missing or broken, and the rest follows; None raises.

    Raises:
        DataError: no path, an empty folder, or, without `broken`, a picture or video is missing or broken.
    """
    if not paths:
        raise DataError("nothing to look at; give at least one picture, folder of pictures or video")
    files = itertools.chain.from_iterable(picture_files(path) if path.is_dir() else [path] for path in paths)
    for path in files:
        try:
            if is_video(path):
                for index, (t_s, image) in enumerate(read_video(path)):
                    yield FilePicture(f"{path}#{index:06d}", path, image, t_s, index > 0)
            else:
                yield FilePicture(str(path), path, read_picture(path))
        except DataError as error:
            if broken is None:
                raise
            broken(path, error)


def picture_files(folder: Path) -> list[Path]:
    """The pictures in a folder, by name; DataError when it holds none."""
    found = sorted(item for item in folder.iterdir() if item.suffix.lower() in PICTURE_SUFFIXES and item.is_file())
    if not found:
        raise DataError(f"folder {folder} holds no pictures; expected {', '.join(sorted(PICTURE_SUFFIXES))}")
    return found


def read_picture(path: Path) -> Picture:
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
    """Whether a JPEG or PNG lacks its end mark; their decoders fill up what is missing, or print to the terminal.

    What cameras and editors append after the end mark does no harm.
    """
    if data.startswith(b"\xff\xd8"):
        return b"\xff\xd9" not in data[_scan_of(data) :]
    return data.startswith(b"\x89PNG") and b"IEND" not in data[-65536:]


def _scan_of(data: bytes) -> int:
    """Where a JPEG's first scan begins, past every header; a preview within a header has an end mark of its own."""
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
        padding = data[at + 1] == 0xFF
        at += 1 if padding else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return at


def read_video(path: Path) -> Iterator[tuple[float, Picture]]:
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
