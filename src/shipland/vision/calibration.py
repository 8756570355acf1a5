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


@dataclass(frozen=True)
class View:
    """The board in one picture: (n,3) float32 corners on the board [m], (n,2) float32 the same in the picture [px]."""

    board_m: npt.NDArray[np.float32]
    corners_px: npt.NDArray[np.float32]


Finder = Callable[[Image], View | None]


@dataclass(frozen=True)
class PictureResult:
    """One picture: corners found, reprojection error, None without, and why it was left out; empty when used."""

    file: str
    corners: int
    rms_px: float | None
    left_out: str = ""


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera with its pictures and errors.

    Attributes:
        camera: intrinsics.
        focal_sd_px: standard deviation of the focal length.
        rms_px: reprojection error of all pictures used.
        covered: share of the picture's 8 × 6 cells with a corner in them.
        pictures: every picture, in the order given.
        views: those used.
        residuals_px: (n,2) reprojected minus found, of each of `views`.
    """

    camera: Camera
    focal_sd_px: float
    rms_px: float
    covered: float
    pictures: tuple[PictureResult, ...]
    views: tuple[View, ...]
    residuals_px: tuple[Array, ...]

    def to_text(self) -> str:
        """For people: a line a picture, the camera, warnings."""
        widest = max(len(item.file) for item in self.pictures)
        lines = []
        for item in self.pictures:
            error = "" if item.rms_px is None else f"{item.rms_px:7.3f} px"
            lines.append(f"{item.file:{widest}s}  {item.corners:4d} corners  {error:10s}  {item.left_out}".rstrip())
        (fx, _, cx), (_, fy, cy), _ = self.camera.matrix
        lines += [
            f"focal length {fx:.2f}, {fy:.2f} ± {self.focal_sd_px:.2f} px; principal point {cx:.2f}, {cy:.2f} px; "
            f"{self.camera.width_px} × {self.camera.height_px} px",
            f"distortion {', '.join(f'{value:.5g}' for value in self.camera.distortion)}",
            f"reprojection error {self.rms_px:.3f} px over {len(self.views)} pictures; "
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
            not settle a camera, or the output cannot be written.
    """
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"calibration file {out} cannot be written: {error.strerror}") from None
    finder = _finder(board)
    found: list[tuple[str, tuple[int, int], View | None]] = []
    broken: dict[int, DataError] = {}
    for index, path in enumerate(_pictures(paths)):
        try:
            image = read_picture(path)
            found.append((str(path), (image.shape[1], image.shape[0]), finder(image)))
        except DataError as error:
            broken[index] = error
            found.append((str(path), (0, 0), None))
    read = len(found) - len(broken)
    if not read:
        raise broken[0]
    sizes = Counter(size for _, size, view in found if view is not None)
    if sizes.total() < min(_LEAST_VIEWS, read):
        without = [Path(file) for index, (file, _, view) in enumerate(found) if view is None and index not in broken]
        instead = _seen_instead(without, board.charuco)
        if instead or not sizes:
            raise DataError(
                f"the board was found in {sizes.total() or 'none'} of {read} pictures; expected {board.corners} "
                f"inner corners ({'with' if board.charuco else 'without'} markers)"
                f"{instead or ': count the corners where four squares meet'}"
            )
    size = sizes.most_common(1)[0][0]
    why = {index: f"left out: {error}" for index, error in broken.items()}
    for index, (_, other, view) in enumerate(found):
        if view is None:
            why.setdefault(index, "left out: no board found")
        elif other != size:
            why[index] = f"left out: {other[0]} × {other[1]} px, most are {size[0]} × {size[1]} px"
    views = {index: view for index, (_, _, view) in enumerate(found) if view is not None and index not in why}
    fit, rms_px = _fit_without_outliers(views, size, why)
    residuals_px = tuple(fit.residuals_px)
    pictures = tuple(
        PictureResult(file, 0 if view is None else len(view.corners_px), rms_px.get(index), why.get(index, ""))
        for index, (file, _, view) in enumerate(found)
    )
    used = tuple(view for index, view in views.items() if index not in why)
    all_px = np.concatenate(residuals_px)
    total_px = float(np.sqrt(np.mean(np.sum(all_px**2, axis=1))))
    result = Calibration(fit.camera, fit.focal_sd_px, total_px, _covered(used, size), pictures, used, residuals_px)
    result.camera.to_opencv_yaml(out)
    picture = out.with_suffix(".png")
    if not cv2.imwrite(str(picture), coverage_picture(result)):
        raise DataError(f"coverage picture {picture} cannot be written")
    return result


_LEAST_TURN_RAD = math.radians(10.0)
"""Least angle between the boards of two of the views."""
_UNSETTLED = (
    "the pictures do not settle a camera; expected views of one flat board from different sides: "
    "tilt it by 20–40° about either axis"
)


@dataclass(frozen=True)
class _Fit:
    camera: Camera
    focal_sd_px: float
    residuals_px: list[Array]


def _fit_without_outliers(
    views: dict[int, View], size: tuple[int, int], why: dict[int, str]
) -> tuple[_Fit, dict[int, float]]:
    """The fit, and every view's error; the worst view is dropped, and `why` says so, until none stands out."""
    rms_px: dict[int, float] = {}
    while True:
        kept = [index for index in views if index not in why]
        if len(kept) < _LEAST_VIEWS:
            raise DataError(
                f"the board was found in {len(views)} pictures of one size, {len(kept)} of which agree; "
                f"at least {_LEAST_VIEWS} are needed: take more, sharp, the board tilted and all over the picture"
            )
        fit = _fit([views[index] for index in kept], size)
        errors = [float(np.sqrt(np.mean(np.sum(some**2, axis=1)))) for some in fit.residuals_px]
        rms_px |= dict(zip(kept, errors, strict=True))
        middle_px, worst_px = float(np.median(errors)), max(errors)
        if worst_px <= max(_OUTLIER * middle_px, _OUTLIER_PX) or len(kept) == _LEAST_VIEWS:
            return fit, rms_px
        worst = kept[errors.index(worst_px)]
        why[worst] = f"left out: error {worst_px / middle_px:.1f} × the median of {middle_px:.3f} px"


def _fit(views: list[View], size: tuple[int, int]) -> _Fit:
    boards = [view.board_m for view in views]
    corners = [view.corners_px.reshape(-1, 1, 2) for view in views]
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
    residuals_px: list[Array] = [
        np.asarray(
            cv2.projectPoints(view.board_m, rotation, translation, camera.matrix, camera.distortion)[0].reshape(-1, 2),
            np.float64,
        )
        - view.corners_px
        for view, rotation, translation in zip(views, rotations, translations, strict=True)
    ]
    return _Fit(camera, float(np.hypot(stds[0], stds[1]) / math.sqrt(2.0)), residuals_px)


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

    def find(image: Image) -> View | None:
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        good, corners = cv2.findChessboardCornersSB(grey, (across, down), flags=_SEARCH)
        if not good:
            good, corners = cv2.findChessboardCorners(grey, (across, down))
            if not good:
                return None
            points = corners.reshape(down, across, 2)
            apart_px = min(float(np.linalg.norm(np.diff(points, axis=axis), axis=-1).min()) for axis in (0, 1))
            half = int(np.clip(0.35 * apart_px, 1, 11))
            corners = cv2.cornerSubPix(grey, corners, (half, half), (-1, -1), _UNTIL)
        return View(board_m, np.asarray(corners, np.float32).reshape(-1, 2))

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
    detector = cv2.aruco.CharucoDetector(printed)
    board_m = np.asarray(printed.getChessboardCorners(), np.float32)

    def find(image: Image) -> View | None:
        corners, numbers, _, _ = detector.detectBoard(image)
        if numbers is None or len(numbers) < _LEAST_CORNERS:
            return None
        seen = np.asarray(numbers).ravel()
        extent_m = np.linalg.svd(board_m[seen] - board_m[seen].mean(axis=0), compute_uv=False)
        if extent_m[1] < board.square_m:  # all in one row: no plane
            return None
        return View(board_m[seen], np.asarray(corners, np.float32).reshape(-1, 2))

    return find


def _covered(views: tuple[View, ...], size: tuple[int, int]) -> float:
    corners_px = np.concatenate([view.corners_px for view in views])
    cells = np.floor((corners_px + 0.5) / size * _CELLS).astype(int)
    inside = cells[np.all((cells >= 0) & (cells < _CELLS), axis=1)]
    return len({(int(column), int(row)) for column, row in inside}) / (_CELLS[0] * _CELLS[1])


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
    for view, residuals_px in zip(calibration.views, calibration.residuals_px, strict=True):
        points = np.round(view.corners_px * scale).astype(int)
        outline = cv2.convexHull(points.astype(np.int32))
        cv2.polylines(canvas, [outline], isClosed=True, color=(190, 190, 190), lineType=cv2.LINE_AA)
        for point, off_px in zip(points, np.linalg.norm(residuals_px, axis=1), strict=True):
            share = min(float(off_px) / worst_px, 1.0)
            cv2.circle(canvas, point.tolist(), 3, (200 * (1.0 - share), 80, 230 * share), cv2.FILLED, cv2.LINE_AA)
    words = (
        f"{len(calibration.views)} pictures, rms {calibration.rms_px:.3f} px; "
        f"blue 0, red {worst_px:.2f} px and more; {100.0 * calibration.covered:.0f} % of the cells"
    )
    cv2.putText(canvas, words, (10, height - 12), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (60, 60, 60), 1, cv2.LINE_AA)
    return canvas
