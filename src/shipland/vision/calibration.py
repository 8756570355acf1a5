"""A camera's intrinsics from pictures of a chessboard or ChArUco board."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from shipland.calibration_file import write_calibration
from shipland.camera import Camera
from shipland.errors import DataError
from shipland.frames import Array
from shipland.vision.pictures import picture_files, read_picture

Image = npt.NDArray[np.uint8]

_LEAST_VIEWS = 4
"""Least number of pictures with the board; a dozen or more make a good calibration."""

_LEAST_CORNERS = 8
"""Least number of corners of a ChArUco board that is seen in part."""

_OUTLIER, _OUTLIER_PX = 3.0, 0.3
"""A picture is left out when its error is larger than both this multiple of the median and what a sharp picture of a
flat board reaches."""

_SIGNIFICANT = 3.0
"""Standard deviations that the sixth-power radial term must differ from zero by to be kept."""

_FOCAL_STD_MAX = 0.01
"""Largest standard deviation of the focal length, as a fraction of it, that passes without a warning."""

_CELLS, _COVERED = (8, 6), 0.6
"""Cells of the picture, and the share of them with a corner from which there is no warning."""

_LOOKED_AT = 5
"""Pictures that are searched for another board when the one described is in none."""

_SEARCH = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
_UNTIL = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)


@dataclass(frozen=True)
class Board:
    """A printed board.

    Attributes:
        corners: inner corners across × down, as "9x6".
        square_m: side of a square.
        charuco: it carries ArUco markers.
        marker_m: side of a marker; None for three quarters of a square.
        dictionary: OpenCV's name of the markers' dictionary.
    """

    corners: str
    square_m: float
    charuco: bool = False
    marker_m: float | None = None
    dictionary: str = "DICT_4X4_50"


Floats = npt.NDArray[np.float32]
Corners = tuple[Floats, Floats]
"""A board's corners that a picture shows: (n,3) on the board [m] and (n,2) in the picture [px]; n is 0 without one."""
_NO_CORNERS: Corners = np.zeros((0, 3), np.float32), np.zeros((0, 2), np.float32)
Finder = Callable[[Image], Corners]


@dataclass
class BoardPicture:
    """A picture and what became of it.

    Attributes:
        size: width and height [px]; zeros of one that cannot be read.
        corners: of the board in it.
        left_out: why it does not count; empty when it does.
        residuals_px: (n,2) corners reprojected minus found, by the last fit that it was part of.
    """

    path: Path
    size: tuple[int, int] = (0, 0)
    corners: Corners = _NO_CORNERS
    left_out: str = ""
    residuals_px: Array | None = None

    @property
    def count(self) -> int:
        """How many corners were found."""
        return len(self.corners[1])


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera with its pictures.

    Attributes:
        camera: intrinsics.
        focal_sd_px: standard deviation of the focal length.
        pictures: every picture, in the order given.
    """

    camera: Camera
    focal_sd_px: float
    pictures: tuple[BoardPicture, ...]

    @property
    def used(self) -> list[BoardPicture]:
        """The pictures that count."""
        return [item for item in self.pictures if not item.left_out]

    @property
    def rms_px(self) -> float:
        """Reprojection error of all pictures used."""
        return _rms_px(*self.used)

    @property
    def covered(self) -> float:
        """Share of the picture's 8 × 6 cells with a corner in them."""
        corners_px = np.concatenate([item.corners[1] for item in self.used])
        cells = np.floor((corners_px + 0.5) / self.used[0].size * _CELLS).astype(int)
        inside = cells[np.all((cells >= 0) & (cells < _CELLS), axis=1)]
        return len({(int(column), int(row)) for column, row in inside}) / (_CELLS[0] * _CELLS[1])

    def to_text(self) -> str:
        """For people: a line a picture, the camera, warnings."""
        widest = max(len(str(item.path)) for item in self.pictures)
        lines = []
        for item in self.pictures:
            error = "" if item.residuals_px is None else f"{_rms_px(item):7.3f} px"
            why = item.left_out and f"left out: {item.left_out}"
            lines.append(f"{item.path!s:{widest}s}  {item.count:4d} corners  {error:10s}  {why}".rstrip())
        (fx, _, cx), (_, fy, cy), _ = self.camera.matrix
        lines += [
            f"focal length {fx:.2f}, {fy:.2f} ± {self.focal_sd_px:.2f} px; principal point {cx:.2f}, {cy:.2f} px; "
            f"{self.camera.width_px} × {self.camera.height_px} px",
            f"distortion {', '.join(f'{value:.5g}' for value in self.camera.distortion)}",
            f"reprojection error {self.rms_px:.3f} px over {len(self.used)} pictures; "
            f"corners in {100.0 * self.covered:.0f} % of the picture's {_CELLS[0]} × {_CELLS[1]} cells",
        ]
        if self.focal_sd_px > _FOCAL_STD_MAX * self.camera.focal_px:
            lines.append("warning: the focal length is known to worse than 1 %: take pictures with the board tilted")
        if self.covered < _COVERED:
            lines.append("warning: large parts of the picture have no corner: move the board into its corners as well")
        return "\n".join(lines)


def calibrate(paths: Sequence[Path], board: Board, out: Path) -> Calibration:
    """Find the board, fit the camera, drop outliers, write the calibration and the coverage picture.

    Args:
        paths: pictures, folders of pictures.
        board: what is in them.
        out: calibration file; the coverage picture goes beside it, as .png.

    Raises:
        DataError: every picture is missing or broken, the board is described wrongly or found too rarely, the views do
            not settle a camera, or the output is a folder or cannot be written.
    """
    if out.is_dir():
        raise DataError(f"--out {out} is a folder; expected a file's name in it, as {out / 'camera.yaml'}")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"calibration file {out} cannot be written: {error.strerror}") from None
    finder = _finder(board)
    pictures = [_searched(path, finder) for path in _pictures(paths)]
    read = [item for item in pictures if item.size != (0, 0)]
    if not read:
        raise DataError(pictures[0].left_out)
    sizes = Counter(item.size for item in read if item.count)
    if sizes.total() < min(_LEAST_VIEWS, len(read)):
        instead = _seen_instead([item.path for item in read if not item.count], board.charuco)
        if instead or not sizes:
            raise DataError(
                f"the board was found in {sizes.total() or 'none'} of {len(read)} pictures; expected {board.corners} "
                f"inner corners ({'with' if board.charuco else 'without'} markers)"
                f"{instead or ': count the corners where four squares meet'}"
            )
    size = sizes.most_common(1)[0][0]
    for item in read:
        if item.count and item.size != size:
            item.left_out = f"{item.size[0]} × {item.size[1]} px, most are {size[0]} × {size[1]} px"
    coverage = out.with_suffix(".png")
    written = {out.resolve(), coverage.resolve()}
    if len(written) < 2 or any(item.count and item.path.resolve() in written for item in read):
        raise DataError(f"--out {out}: it and the coverage picture {coverage} would overwrite a picture; rename it")
    result = Calibration(*_fit_without_outliers(pictures), tuple(pictures))
    write_calibration(result.camera, out)
    if not cv2.imwrite(str(coverage), coverage_picture(result)):
        raise DataError(f"coverage picture {coverage} cannot be written")
    return result


def _searched(path: Path, finder: Finder) -> BoardPicture:
    try:
        image = read_picture(path)
    except DataError as error:
        return BoardPicture(path, left_out=str(error))
    corners = finder(image)
    return BoardPicture(path, (image.shape[1], image.shape[0]), corners, "" if len(corners[1]) else "no board found")


def _rms_px(*pictures: BoardPicture) -> float:
    """Reprojection error of pictures that were part of a fit."""
    residuals_px = np.concatenate([item.residuals_px for item in pictures if item.residuals_px is not None])
    return float(np.sqrt(np.mean(np.sum(residuals_px**2, axis=1))))


_LEAST_TURN_RAD = math.radians(10.0)
"""Least angle between the boards of two of the views."""
_UNSETTLED = (
    "the pictures do not settle a camera; expected views of one flat board from different sides: "
    "tilt it by 20–40° about either axis"
)


def _fit_without_outliers(pictures: Sequence[BoardPicture]) -> tuple[Camera, float]:
    """The camera and its focal length's deviation; the worst picture is left out until none stands out."""
    found = [item for item in pictures if not item.left_out]
    while True:
        kept = [item for item in found if not item.left_out]
        if len(kept) < _LEAST_VIEWS:
            raise DataError(
                f"the board was found in {len(found)} pictures of one size, {len(kept)} of which agree; "
                f"at least {_LEAST_VIEWS} are needed: take more, sharp, the board tilted and all over the picture"
            )
        fit = _fit(kept)
        errors = [_rms_px(item) for item in kept]
        middle_px, worst_px = float(np.median(errors)), max(errors)
        if worst_px <= max(_OUTLIER * middle_px, _OUTLIER_PX) or len(kept) == _LEAST_VIEWS:
            return fit
        worst = kept[errors.index(worst_px)]
        worst.left_out = f"error {worst_px / middle_px:.1f} × the median of {middle_px:.3f} px"


def _fit(pictures: Sequence[BoardPicture]) -> tuple[Camera, float]:
    """The camera and its focal length's deviation [px] by pictures of one size; gives each its residuals."""
    size = pictures[0].size
    boards = [item.corners[0] for item in pictures]
    corners = [item.corners[1].reshape(-1, 1, 2) for item in pictures]
    flags = 0
    try:
        for flags in (0, cv2.CALIB_FIX_K3):
            _, matrix, distortion, rotations, translations, deviations, _, _ = cv2.calibrateCameraExtended(
                boards, corners, size, np.eye(3), np.zeros(5), flags=flags
            )
            coefficients, stds = np.asarray(distortion, float).ravel()[:5], np.asarray(deviations, float).ravel()
            # Deviations are in the order fx, fy, cx, cy, k1, k2, p1, p2, k3.
            if abs(coefficients[4]) > _SIGNIFICANT * stds[8]:
                break
        camera = Camera(*size, np.asarray(matrix, float), coefficients)
    except (cv2.error, ValueError):
        raise DataError(_UNSETTLED) from None
    # Boards that all stand alike fit many a focal length, and the deviation of the one that is found says nothing.
    normals = np.array([cv2.Rodrigues(rotation)[0][:, 2] for rotation in rotations])
    if np.min(normals @ normals.T) > math.cos(_LEAST_TURN_RAD):
        raise DataError(_UNSETTLED)
    for item, rotation, translation in zip(pictures, rotations, translations, strict=True):
        board_m, found_px = item.corners
        shown_px, _ = cv2.projectPoints(board_m, rotation, translation, camera.matrix, camera.distortion)
        item.residuals_px = np.asarray(shown_px.reshape(-1, 2), np.float64) - found_px
    return camera, float(np.hypot(stds[0], stds[1]) / math.sqrt(2.0))


def _pictures(paths: Sequence[Path]) -> Iterator[Path]:
    if not paths:
        raise DataError("nothing to calibrate from; give pictures of the board or a folder of them")
    for path in paths:
        yield from picture_files(path) if path.is_dir() else [path]


def _seen_instead(files: Sequence[Path], charuco: bool) -> str:
    """Advice: the board that the first pictures show; empty where they show none."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_1000)
    markers = cv2.aruco.ArucoDetector(family)
    for file in files[:_LOOKED_AT]:
        grey = cv2.cvtColor(read_picture(file), cv2.COLOR_BGR2GRAY)
        if markers.detectMarkers(grey)[1] is not None:
            advice = "give --board as many as it has, and its --dictionary" if charuco else "give --charuco"
            return f"; {file} shows markers: {advice}"
        good, _, meta = cv2.findChessboardCornersSBWithMeta(grey, (3, 3), _SEARCH | cv2.CALIB_CB_LARGER)
        if good:
            down, across = sorted(meta.shape[:2])
            without = " without --charuco" if charuco else ""
            return f"; {file} shows {across}x{down}: give --board {across}x{down}{without}"
    return ""


def _finder(board: Board) -> Finder:
    match = re.fullmatch(r"(\d+)[x×](\d+)", board.corners.strip().lower())
    if match is None or min(int(match[1]), int(match[2])) < 3 or max(int(match[1]), int(match[2])) > 200:
        raise DataError(
            f"--board {board.corners} is no board; expected inner corners across × down, each 3–200, as 9x6"
        )
    across, down = int(match[1]), int(match[2])
    if not 0.0 < board.square_m < 10.0:
        raise DataError(f"--square-m {board.square_m} is no side of a square; expected metres, as 0.025")
    return _charuco(board, across, down) if board.charuco else _chessboard(board, across, down)


def _chessboard(board: Board, across: int, down: int) -> Finder:
    board_m = np.zeros((across * down, 3), np.float32)
    board_m[:, :2] = board.square_m * np.mgrid[0:across, 0:down].T.reshape(-1, 2)

    def find(image: Image) -> Corners:
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        good, corners = cv2.findChessboardCornersSB(grey, (across, down), flags=_SEARCH)
        if not good:
            good, corners = cv2.findChessboardCorners(grey, (across, down))
            if not good:
                return _NO_CORNERS
            points = corners.reshape(down, across, 2)
            apart_px = min(float(np.linalg.norm(np.diff(points, axis=axis), axis=-1).min()) for axis in (0, 1))
            half = int(np.clip(0.35 * apart_px, 1, 11))
            corners = cv2.cornerSubPix(grey, corners, (half, half), (-1, -1), _UNTIL)
        return board_m, np.asarray(corners, np.float32).reshape(-1, 2)

    return find


def _charuco(board: Board, across: int, down: int) -> Finder:
    marker_m = 0.75 * board.square_m if board.marker_m is None else board.marker_m
    if not 0.0 < marker_m < board.square_m:
        raise DataError(f"--marker-m {marker_m} does not fit into a square of {board.square_m} m")
    family = getattr(cv2.aruco, board.dictionary, None)
    if not (board.dictionary.startswith("DICT_") and isinstance(family, int)):
        names = ", ".join(sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_")))
        raise DataError(f"--dictionary {board.dictionary} is not known; expected one of {names}")
    dictionary = cv2.aruco.getPredefinedDictionary(family)
    markers = (across + 1) * (down + 1) // 2
    if markers > len(dictionary.bytesList):
        raise DataError(
            f"a ChArUco board of {board.corners} inner corners has {markers} markers, more than {board.dictionary}; "
            "expected the dictionary that it was printed with"
        )
    printed = cv2.aruco.CharucoBoard((across + 1, down + 1), board.square_m, marker_m, dictionary)
    board_m = np.asarray(printed.getChessboardCorners(), np.float32)
    detectors = []
    for legacy in (False, True):  # of an even number of rows the first square is black, or white: before OpenCV 4.6
        printed.setLegacyPattern(legacy)
        detectors.append(cv2.aruco.CharucoDetector(printed))

    def find(image: Image) -> Corners:
        for detector in detectors:
            corners, numbers, _, _ = detector.detectBoard(image)
            if numbers is not None and len(numbers) >= _LEAST_CORNERS:
                break
        else:
            return _NO_CORNERS
        seen = np.asarray(numbers).ravel()
        extent_m = np.linalg.svd(board_m[seen] - board_m[seen].mean(axis=0), compute_uv=False)
        if extent_m[1] < board.square_m:  # all in one row: no plane
            return _NO_CORNERS
        return board_m[seen], np.asarray(corners, np.float32).reshape(-1, 2)

    return find


def coverage_picture(calibration: Calibration) -> Image:
    """(H,W,3) where the corners of each picture lay, coloured by their error, on the grid of cells."""
    camera = calibration.camera
    scale = max(1.0, 960.0 / camera.width_px)
    width, height = round(camera.width_px * scale), round(camera.height_px * scale)
    canvas = np.full((height, width, 3), 255, np.uint8)
    for column in range(1, _CELLS[0]):
        cv2.line(canvas, (column * width // _CELLS[0], 0), (column * width // _CELLS[0], height), (225, 225, 225))
    for row in range(1, _CELLS[1]):
        cv2.line(canvas, (0, row * height // _CELLS[1]), (width, row * height // _CELLS[1]), (225, 225, 225))
    worst_px = max(2.0 * calibration.rms_px, 1e-6)
    for item in calibration.used:
        assert item.residuals_px is not None
        points = np.round(item.corners[1] * scale).astype(int)
        outline = cv2.convexHull(points.astype(np.int32))
        cv2.polylines(canvas, [outline], isClosed=True, color=(190, 190, 190), lineType=cv2.LINE_AA)
        for point, off_px in zip(points, np.linalg.norm(item.residuals_px, axis=1), strict=True):
            share = min(float(off_px) / worst_px, 1.0)
            cv2.circle(canvas, point.tolist(), 3, (200 * (1.0 - share), 80, 230 * share), cv2.FILLED, cv2.LINE_AA)
    words = (
        f"{len(calibration.used)} pictures, rms {calibration.rms_px:.3f} px; "
        f"blue 0, red {worst_px:.2f} px and more; {100.0 * calibration.covered:.0f} % of the cells"
    )
    cv2.putText(canvas, words, (10, height - 12), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (60, 60, 60), 1, cv2.LINE_AA)
    return canvas
