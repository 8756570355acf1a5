"""Two peers of the near vision on the same places: `cv2.aruco`'s board and `pyapriltags`, two tags each.

The tags together have the area of the bar's two green rectangles and hang where these do, on a white board as wide as
the bar's. They are put into the rendered picture by their homography, supersampled as the ship is, before the sensor's
noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera
from shipland.frames import Array, Pose
from shipland.rig import Rig

Picture = npt.NDArray[np.uint8]
Corners = dict[int, Array]
"""Corners (4,2) [px], clockwise from the upper left, of each tag found."""

_PX_PER_M = 2000
_WHITE, _BLACK = 230, 25
"""Grey levels of the board: more contrast than the bar has."""

_SAMPLES_PX = 5.0e6
_MOST_SAMPLES = 8


@dataclass(frozen=True)
class Board:
    """A white board with tags in the bar's plane.

    Attributes:
        picture: (h,w) of the whole board.
        outline_m: (4,2) its corners (right, down) in `bar` [m].
        tags_m: of each tag, by its number, corners (4,2) (right, down) [m].
    """

    picture: Picture
    outline_m: Array
    tags_m: dict[int, Array]

    @staticmethod
    def of(family: int, rig: Rig) -> Board:
        """Two tags of an OpenCV dictionary in the middles of the rectangles."""
        side_m = float(np.sqrt(rig.rectangle_width_m * rig.rectangle_height_m))
        offset_m = 0.5 * (rig.rectangle_gap_m + rig.rectangle_width_m)
        size_m = np.array([rig.board_width_m, 1.3 * side_m])
        width, height = (round(v * _PX_PER_M) for v in size_m)
        picture = np.full((height, width), _WHITE, np.uint8)
        dictionary = cv2.aruco.getPredefinedDictionary(family)
        side_px = round(side_m * _PX_PER_M)
        tags_m = {}
        for number, centre_m in enumerate((-offset_m, offset_m)):
            left = round(0.5 * width + centre_m * _PX_PER_M - 0.5 * side_px)
            top = (height - side_px) // 2
            tag = cv2.aruco.generateImageMarker(dictionary, number, side_px)
            picture[top : top + side_px, left : left + side_px] = np.where(tag > 0, _WHITE, _BLACK)
            low = np.array([left - 0.5 * width, top - 0.5 * height]) / _PX_PER_M
            tags_m[number] = low + side_px / _PX_PER_M * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        outline_m = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [width / _PX_PER_M, height / _PX_PER_M]
        return Board(picture, outline_m, tags_m)

    def hung(self, picture: Picture, camera: Camera, camera_from_bar: Pose) -> Picture:
        """A rendered picture with this board over the bar; the camera has no distortion."""
        outline_px = in_picture(self.outline_m, camera, camera_from_bar)
        size = np.array([camera.width_px, camera.height_px])
        low = np.clip(np.floor(outline_px.min(axis=0)) - 2, 0, size).astype(int)
        high = np.clip(np.ceil(outline_px.max(axis=0)) + 3, 0, size).astype(int)
        across, down = (int(v) for v in high - low)
        if across <= 0 or down <= 0:
            return picture
        samples = int(np.clip(np.sqrt(_SAMPLES_PX / (across * down)), 2, _MOST_SAMPLES))
        height, width = self.picture.shape
        # Pixel centres at whole numbers, on the board as in the picture.
        board_px = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32) - 0.5
        fine_px = ((outline_px - low + 0.5) * samples - 0.5).astype(np.float32)
        way = cv2.getPerspectiveTransform(board_px, fine_px)
        fine = (across * samples, down * samples)
        here = cv2.warpPerspective(self.picture, way, fine, flags=cv2.INTER_NEAREST, borderValue=0)
        there = cv2.warpPerspective(np.full_like(self.picture, 255), way, fine, flags=cv2.INTER_NEAREST, borderValue=0)
        colour, cover = (cv2.resize(v.astype(np.float32), (across, down), interpolation=cv2.INTER_AREA)
                         for v in (here, there))  # fmt: skip
        part = picture[low[1] : high[1], low[0] : high[0]].astype(np.float32)
        mixed = part * (1.0 - cover[..., None] / 255.0) + colour[..., None]
        result = picture.copy()
        result[low[1] : high[1], low[0] : high[0]] = np.clip(np.rint(mixed), 0, 255).astype(np.uint8)
        return result


def in_picture(plane_m: Array, camera: Camera, camera_from_bar: Pose) -> Array:
    """Pixels (n,2) of points (right, down) (n,2) [m] in the bar's plane."""
    points = np.column_stack([np.zeros(len(plane_m)), plane_m])
    return camera.project(camera_from_bar.apply(points))


def grain(picture: Picture, noise: float, rng: np.random.Generator) -> Picture:
    """The picture with a sensor's noise, standard deviation in grey levels."""
    values = picture.astype(np.float32) + noise * rng.standard_normal(picture.shape, dtype=np.float32)
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Peer:
    """A tag library: its board, and how it looks for it.

    Attributes:
        name: for tables.
        board: its tags.
        find: corners of all tags in a picture (H,W,3).
    """

    name: str
    board: Board
    find: Callable[[Picture], Corners]

    def detect(self, picture: Picture) -> Corners:
        """Corners of the board's own tags in a picture (H,W,3)."""
        return {number: quad for number, quad in self.find(picture).items() if number in self.board.tags_m}

    def pose(self, found: Corners, camera: Camera) -> Pose | None:
        """camera_from_bar from the corners of the board's tags found, by `cv2.solvePnP`; None without a tag."""
        if not found:
            return None
        plane_m = np.concatenate([self.board.tags_m[number] for number in found])
        points = np.column_stack([plane_m, np.zeros(len(plane_m))])
        pixels = np.concatenate(list(found.values()))
        good, turn, translation = cv2.solvePnP(points, pixels, camera.matrix, camera.distortion)
        if not good:
            return None
        # The board's plane is (right, down, forward), `bar` is (forward, right, down).
        plane_from_bar = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
        return Pose(cv2.Rodrigues(turn)[0] @ plane_from_bar, translation.ravel())


def aruco(rig: Rig, *, refined: bool = True) -> Peer:
    """OpenCV's detector, markers of 4 × 4 bits; with its sub-pixel corners, or as it comes."""
    family = cv2.aruco.DICT_4X4_50
    parameters = cv2.aruco.DetectorParameters()
    if refined:
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(family), parameters)

    def find(picture: Picture) -> Corners:
        quads, numbers, _ = detector.detectMarkers(picture)
        if numbers is None:
            return {}
        return {int(n): quad.reshape(4, 2).astype(float) for n, quad in zip(numbers.ravel(), quads, strict=True)}

    return Peer("cv2.aruco, sub-pixel" if refined else "cv2.aruco, as it comes", Board.of(family, rig), find)


def apriltag(rig: Rig, decimate: float = 2.0) -> Peer:
    """The AprilTag 3 library through `pyapriltags`, family 36h11, one thread; `decimate` 2 is its default."""
    from pyapriltags import Detector

    detector = Detector(families="tag36h11", nthreads=1, quad_decimate=decimate)

    def find(picture: Picture) -> Corners:
        found = {}
        for tag in detector.detect(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)):
            # Its pixels' centres lie at halves; its corners run the other way, from wherever the tag's own first is.
            quad = np.asarray(tag.corners, float)[::-1] - 0.5
            found[int(tag.tag_id)] = np.roll(quad, -int(np.argmin(quad.sum(axis=1))), axis=0)
        return found

    name = f"pyapriltags, decimate {decimate:.0f}"
    return Peer(name, Board.of(cv2.aruco.DICT_APRILTAG_36h11, rig), find)
