"""Pictures and videos from files."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from shipland.errors import DataError
from shipland.extras import require
from shipland.vision.log_pictures import read_pictures

Picture = npt.NDArray[np.uint8]

PICTURE_SUFFIXES = frozenset({".bmp", ".jp2", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp"})
"""What is taken from a folder."""

LOG_SUFFIX = ".mcap"
"""What is read as a flight log with pictures."""

LARGEST_PX = 50_000_000
"""A larger picture is refused: looking at it takes the near vision more than ten seconds."""

VIDEO_SUFFIXES = frozenset(
    {".3gp", ".avi", ".flv", ".m2ts", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".mts", ".ts", ".webm", ".wmv"}
)
"""What is read as a video; every other file is read as a picture."""


_MISSED, _MISSED_SHARE = 2, 0.02
"""By so many pictures, at the longest time between two, or this share of its duration a video may end before its file
says: a picture's own duration counts, and editors leave some out."""


@dataclass(frozen=True)
class FilePicture:
    """One picture of a file.

    Attributes:
        name: the file's path as given; of a video's picture, with `#` and its number from 000000.
        source: the file.
        image: (H,W,3) BGR.
        t_s: time since its video's first picture, or by its log's clock; 0 for a single picture.
        follows: it comes after the one before in a video.
        of: pictures in its video, as the file says; 0 where it does not.
    """

    name: str
    source: Path
    image: Picture
    t_s: float = 0.0
    follows: bool = False
    of: int = 0

    @property
    def stamp_s(self) -> float | None:
        """Its time in its video or log [s]; None for a single picture."""
        return round(self.t_s, 6) if is_film(self.source) else None

    @property
    def progress(self) -> str:
        """How far its video is, in words."""
        return f"{self.t_s:.1f} s" + (f", {self.of} pictures in all" if self.of else "")


def is_video(path: Path) -> bool:
    """Whether a file is read as a video."""
    return path.suffix.lower() in VIDEO_SUFFIXES


def is_log(path: Path) -> bool:
    """Whether a file is read as a flight log."""
    return path.suffix.lower() == LOG_SUFFIX


def is_film(path: Path) -> bool:
    """Whether a file is read as a video or a flight log: pictures with times."""
    return is_video(path) or is_log(path)


def pictures_of(
    paths: Sequence[Path], broken: Callable[[Path, DataError], None] | None = None
) -> Iterator[FilePicture]:
    """The pictures of files, in the order given; a folder's pictures by name, a video's in time.

    Args:
        paths: pictures, folders of pictures, videos, flight logs.
        broken: called with a picture or video that is missing or broken, or a folder without pictures, before the rest
            follows; None raises.

    Raises:
        DataError: no path, or, without `broken`, what it would be called with.
    """
    if not paths:
        raise DataError("nothing to look at; give at least one picture, folder of pictures or video")
    named = broken or _raise
    for path in _files_of(paths, named):
        try:
            if is_film(path):
                of = 0 if is_log(path) else _count_of(path)
                for index, (t_s, image) in enumerate(_read_log(path) if is_log(path) else read_video(path)):
                    yield FilePicture(f"{path}#{index:06d}", path, image, t_s, index > 0, of)
            else:
                yield FilePicture(str(path), path, read_picture(path))
        except DataError as error:
            named(path, error)


def _raise(_path: Path, error: DataError) -> None:
    raise error


def _files_of(paths: Sequence[Path], broken: Callable[[Path, DataError], None]) -> Iterator[Path]:
    for path in paths:
        try:
            yield from picture_files(path) if path.is_dir() else [path]
        except DataError as error:
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
    if size := _too_large(data):
        raise DataError(
            f"{path} has {size}; expected at most {LARGEST_PX / 1e6:.0f} million: shrink it, or cut out what is to be "
            "looked at"
        )
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


def _too_large(data: bytes) -> str:
    """What a picture of more than `LARGEST_PX` has, by its head, before anything is decoded; empty for others."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            with Image.open(io.BytesIO(data)) as picture:
                width_px, height_px = picture.size
        except Image.DecompressionBombError:
            return "hundreds of millions of pixels"
        except (OSError, ValueError):
            return ""
    return f"{width_px} × {height_px} px" if width_px * height_px > LARGEST_PX else ""


def _read_log(path: Path) -> Iterator[tuple[float, Picture]]:
    """Time [s] and picture of each that a flight log keeps; DataError when there is none."""
    count = 0
    for time_ns, image in read_pictures(path, whole=True):
        yield 1e-9 * time_ns, image
        count += 1
    if count == 0:
        raise DataError(f"{path} keeps no pictures (its log.image_rate_hz was 0, or it is no flight log)")


def _require_video(path: Path) -> None:
    """DataError where there is no such file, SystemLibraryError without the extra that reads it."""
    if not path.is_file():
        raise DataError(f"video {path} does not exist")
    require("film", f"looking at {path}")


def _count_of(path: Path) -> int:
    """Pictures in a video as its file says; 0 where it does not. Errors as of `_require_video`."""
    _require_video(path)
    import av

    try:
        with av.open(_file_name(path)) as container:
            return int(container.streams.video[0].frames) if container.streams.video else 0
    except (av.error.FFmpegError, OSError):
        return 0


def _file_name(path: Path) -> str:
    """A path for FFmpeg, which takes what stands before a colon, as in 10:30.mp4, for a protocol, but after a slash."""
    return str(path.absolute())


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


def read_video(path: Path) -> Generator[tuple[float, Picture], None, None]:
    """A video's pictures with their times: t [s] since the first and (H,W,3) BGR, turned as the file says.

    The file's own stamps may begin anywhere: a camera that cuts its films into parts counts on from one to the next.

    Raises:
        DataError: it is missing, not a video, or breaks off.
    """
    _require_video(path)
    import av

    stamps_s: list[float] = []
    sound_s = -math.inf
    try:
        with av.open(_file_name(path)) as container:
            if not container.streams.video:
                raise DataError(f"{path} holds no video stream")
            stream = container.streams.video[0]
            step_s = float(1 / stream.average_rate) if stream.average_rate else 1.0 / 30.0
            # Without a number of pictures the file has a duration (Matroska), which counts from 0.
            begin_s = float((stream.start_time or 0) * (stream.time_base or 0))
            end_s = begin_s + stream.frames * step_s if stream.frames else 1e-6 * (container.duration or 0)
            for packet in container.demux():
                if packet.stream.index == stream.index:
                    for picture in stream.decode(packet):
                        stamps_s.append(float(len(stamps_s) * step_s if picture.time is None else picture.time))
                        pixels = np.asarray(picture.to_ndarray(format="bgr24"), np.uint8)
                        turned = np.ascontiguousarray(np.rot90(pixels, round(picture.rotation / 90.0)))
                        yield stamps_s[-1] - stamps_s[0], turned
                elif packet.pts is not None:
                    sound_s = max(sound_s, float(packet.pts * (packet.time_base or 0)))
    except (av.error.FFmpegError, OSError) as error:
        place = f"breaks off after picture {len(stamps_s) - 1}" if stamps_s else "is not a video that can be read"
        raise DataError(f"{path} {place}: {error.strerror or error}") from None
    if not stamps_s:
        raise DataError(f"video {path} holds no pictures")
    reached_s, longest_s = max(stamps_s[-1], sound_s), max(np.diff(stamps_s), default=step_s)
    if end_s - reached_s > max(_MISSED * longest_s, _MISSED_SHARE * (end_s - begin_s)):
        raise DataError(
            f"{path} breaks off after picture {len(stamps_s) - 1}: {reached_s:.2f} of {end_s:.2f} s could be read"
        )
