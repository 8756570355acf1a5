"""Calibration: a known camera comes out again, outliers go with a reason, bad input ends in words."""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from shipland.calibration_file import read_calibration
from shipland.camera import Camera
from shipland.errors import DataError
from shipland.vision.calibration import Board, calibrate

PHOTOGRAPHS = Path(__file__).resolve().parents[3] / "shared" / "data" / "chessboard"
MATRIX = np.array([[520.0, 0.0, 322.0], [0.0, 515.0, 236.0], [0.0, 0.0, 1.0]])
CAMERA = Camera(640, 480, MATRIX, np.array([-0.2, 0.06, 0.001, -0.0008, 0.0]))
SQUARE_M = 0.03
VIEWS = [
    (0.5, -0.3, 0.2),
    (-0.5, 0.2, -0.1),
    (0.1, 0.6, 0.4),
    (-0.2, -0.55, -0.5),
    (0.35, 0.35, 1.2),
    (-0.4, 0.45, 0.7),
]


def board_texture(charuco, corners=(9, 6), legacy=False):
    """A board of so many inner corners with a margin of one square, 40 px a square, and the size of it in squares."""
    squares, margin = (corners[0] + 1, corners[1] + 1), 40
    if charuco:
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        board = cv2.aruco.CharucoBoard(squares, SQUARE_M, 0.75 * SQUARE_M, dictionary)
        board.setLegacyPattern(legacy)
        inside = board.generateImage((squares[0] * 40, squares[1] * 40))
    else:
        rows, columns = np.mgrid[0 : squares[1] * 40, 0 : squares[0] * 40] // 40
        inside = np.where((rows + columns) % 2, 30, 225).astype(np.uint8)
    return cv2.copyMakeBorder(inside, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=240)


FINE = 2


@cache
def camera_rays():
    """(n,3) of every pixel of CAMERA, four to a pixel, interpolated between the pixels' own."""
    rows, columns = np.mgrid[0:480, 0:640]
    plane = (CAMERA.undistort(np.column_stack([columns.ravel(), rows.ravel()])) - MATRIX[:2, 2]) / [520.0, 515.0]
    fine = cv2.resize(plane.reshape(480, 640, 2), None, fx=FINE, fy=FINE).reshape(-1, 2)
    return np.column_stack([fine, np.ones(len(fine))])


def photograph(texture, turn, shift_m=(0.0, 0.0), bent_px=0.0):
    """The board seen by CAMERA, every pixel from four rays; `bent_px` bends it."""
    rays = camera_rays()
    rotation = cv2.Rodrigues(np.array(turn))[0]
    middle_m = np.array([shift_m[0], shift_m[1], 0.42])
    # The plane through `middle_m` with the rotation's third column as its normal.
    normal = rotation[:, 2]
    on_plane = rays * ((middle_m @ normal) / (rays @ normal))[:, None] - middle_m
    board_px = (on_plane @ rotation)[:, :2] / SQUARE_M * 40.0 + 0.5 * np.array(texture.shape[::-1]) - 0.5
    board_px[:, 1] += bent_px * np.sin(board_px[:, 0] / 60.0)
    maps = board_px.astype(np.float32).reshape(480 * FINE, 640 * FINE, 2)
    seen = cv2.remap(texture, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderValue=90)
    return cv2.cvtColor(cv2.resize(seen, (640, 480), interpolation=cv2.INTER_AREA), cv2.COLOR_GRAY2BGR)


@cache
def photographed(charuco):
    """The board in all views, by number."""
    texture = board_texture(charuco)
    shifts_m = [(0.06 * (index % 3 - 1), 0.04 * (index % 2 - 0.5)) for index in range(len(VIEWS))]
    return [photograph(texture, turn, shift_m) for turn, shift_m in zip(VIEWS, shifts_m, strict=True)]


def write_views(folder, charuco=False, count=None):
    for index, picture in enumerate(photographed(charuco)[:count]):
        cv2.imwrite(str(folder / f"{index}.png"), picture)


def half(picture):
    """Of half the size, in which a board is looked for four times as fast."""
    return cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


@pytest.mark.parametrize("charuco", [False, True])
def test_a_known_camera_comes_out_again(charuco, tmp_path):
    (tmp_path / "views").mkdir()
    write_views(tmp_path / "views", charuco)
    out = tmp_path / "camera.yaml"
    result = calibrate((tmp_path / "views",), Board("9x6", SQUARE_M, charuco), out)
    camera = read_calibration(out)
    assert len(result.used) == len(VIEWS)
    assert abs(camera.focal_px / CAMERA.focal_px - 1.0) < 0.005
    points = np.array([[x, y, 1.0] for x in (-0.45, 0.0, 0.45) for y in (-0.3, 0.0, 0.3)])
    # All over the picture; the principal point trades with the views' tilts, a pixel is what six views leave.
    assert np.abs(camera.project(points) - CAMERA.project(points)).max() < 3.0
    assert result.rms_px < 0.15
    assert cv2.imread(str(out.with_suffix(".png"))) is not None
    assert "focal length" in result.to_text()


def test_a_charuco_board_whose_first_square_is_white_is_found(tmp_path):
    """As OpenCV drew boards of an even number of rows before 4.6, and others draw them still."""
    texture = board_texture(charuco=True, corners=(9, 5), legacy=True)
    for index, turn in enumerate(VIEWS[:4]):
        cv2.imwrite(str(tmp_path / f"{index}.png"), photograph(texture, turn))
    result = calibrate((tmp_path,), Board("9x5", SQUARE_M, charuco=True), tmp_path / "out" / "camera.yaml")
    assert [item.count for item in result.used] == [45] * 4
    assert abs(result.camera.focal_px / CAMERA.focal_px - 1.0) < 0.02


def test_a_bent_board_and_a_picture_without_one_are_left_out_with_the_reason(tmp_path):
    write_views(tmp_path)
    texture = board_texture(charuco=False)
    cv2.imwrite(str(tmp_path / "bent.png"), photograph(texture, (0.2, -0.2, 0.0), bent_px=6.0))
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((480, 640, 3), 90, np.uint8))
    (tmp_path / "empty.png").write_bytes(b"")
    cv2.imwrite(str(tmp_path / "other.png"), half(photographed(False)[0]))
    result = calibrate((tmp_path,), Board("9x6", SQUARE_M), tmp_path / "camera.yaml")
    reasons = {item.path.stem: item.left_out for item in result.pictures}
    assert "median" in reasons["bent"]
    assert reasons["grey"] == "no board found"
    assert "empty.png is not a whole picture" in reasons["empty"]
    assert "left out: no board found" in result.to_text()
    assert "320 × 240" in reasons["other"]
    assert not any(reasons[str(index)] for index in range(len(VIEWS)))
    assert abs(result.camera.focal_px / CAMERA.focal_px - 1.0) < 0.005


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"corners": "nine"}, "inner corners across"),
        ({"corners": "2x1"}, "inner corners across"),
        ({"square_m": 0.0}, "side of a square"),
        ({"square_m": float("nan")}, "side of a square"),
        ({"charuco": True, "marker_m": 0.05}, "does not fit"),
        ({"charuco": True, "dictionary": "DICT_OF_MINE"}, "not known"),
        ({"charuco": True, "corners": "40x40"}, "more than DICT"),
        ({"out": Path("/dev/null/at all/camera.yaml")}, "cannot be written: Not a directory"),
        ({"out": Path()}, "--out . is a folder"),
        ({"paths": ()}, "nothing to calibrate"),
        ({"paths": (Path("missing.png"),)}, "does not exist"),
        ({}, "found in none"),
    ],
)
def test_bad_input_ends_in_words(changes, words, tmp_path):
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((48, 64, 3), 90, np.uint8))
    board = {"corners": "9x6", "square_m": SQUARE_M} | changes
    paths, out = board.pop("paths", (tmp_path,)), board.pop("out", tmp_path / "camera.yaml")
    with pytest.raises(DataError, match=words):
        calibrate(paths, Board(**board), out)
    assert not (tmp_path / "camera.yaml").exists()


@pytest.mark.parametrize(("picture", "out"), [("0.png", "0.yaml"), ("0.png", "camera.png"), ("0.jpg", "0.jpg")])
def test_neither_the_calibration_nor_its_coverage_picture_overwrites_what_is_there(picture, out, tmp_path):
    write_views(tmp_path, count=1)
    there = (tmp_path / "0.png").rename(tmp_path / picture)
    before = there.read_bytes()
    with pytest.raises(DataError, match="would overwrite"):
        calibrate((tmp_path,), Board("9x6", SQUARE_M), tmp_path / out)
    assert there.read_bytes() == before


def test_a_larger_board_of_which_a_part_is_found_is_named_beside_a_broken_picture_too(tmp_path):
    (tmp_path / "0.png").write_bytes(b"")
    for number, view in enumerate(VIEWS[:2], 1):
        cv2.imwrite(str(tmp_path / f"{number}.png"), half(photograph(board_texture(False, (9, 9)), view)))
    with pytest.raises(DataError, match=r"found in .* of 2 pictures; .*shows 9x9: give --board 9x9"):
        calibrate((tmp_path,), Board("9x6", SQUARE_M), tmp_path / "camera.yaml")


def test_too_few_pictures(tmp_path):
    write_views(tmp_path, count=1)
    with pytest.raises(DataError, match="at least 4"):
        calibrate((tmp_path,), Board("9x6", SQUARE_M), tmp_path / "camera.yaml")


def test_boards_that_all_stand_alike_settle_no_focal_length(tmp_path):
    frontal = photograph(board_texture(False), (0.0, 0.0, 0.0))
    for number in range(4):
        cv2.imwrite(str(tmp_path / f"{number}.png"), frontal)
    with pytest.raises(DataError, match="do not settle a camera"):
        calibrate([tmp_path], Board("9x6", SQUARE_M), tmp_path / "camera.yaml")
    assert not (tmp_path / "camera.yaml").exists()


@pytest.mark.slow
@pytest.mark.skipif(not PHOTOGRAPHS.is_dir(), reason="the photographs are not beside this checkout")
def test_photographed_boards(tmp_path):
    result = calibrate((PHOTOGRAPHS,), Board("10x10", 0.0254), tmp_path / "camera.yaml")
    assert 705.0 <= result.camera.focal_px <= 715.0  # px, what others found
    assert result.rms_px < 0.5
    assert len(result.used) >= 12


@pytest.mark.parametrize(
    ("printed_charuco", "asked", "words"),
    [
        (False, Board("8x5", SQUARE_M), "shows 9x6: give --board 9x6"),
        (False, Board("9x6", SQUARE_M, charuco=True), "shows 9x6: give --board 9x6 without --charuco"),
        (True, Board("8x5", SQUARE_M), "shows markers: give --charuco"),
        (True, Board("8x5", SQUARE_M, charuco=True), "shows markers: give --board as many as it has"),
    ],
)
def test_another_board_than_described_is_named(printed_charuco, asked, words, tmp_path):
    cv2.imwrite(str(tmp_path / "view.png"), half(photographed(printed_charuco)[0]))
    with pytest.raises(DataError, match=words):
        calibrate((tmp_path,), asked, tmp_path / "camera.yaml")
