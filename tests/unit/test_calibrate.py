"""A known camera is found again from drawn boards; the sample chessboards give their known focal length."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from shipland.calibrate import CalibrateRequest, calibrate
from shipland.camera import Camera
from shipland.errors import DataError

SAMPLES = Path(__file__).parents[3] / "shared" / "data" / "chessboard"
MATRIX = np.array([[620.0, 0.0, 318.0], [0.0, 622.0, 243.0], [0.0, 0.0, 1.0]])
SQUARE_M = 0.03


def draw(folder: Path, count: int = 14) -> None:
    """Pictures of a 7×5-corner board by a known camera without distortion, four samples a pixel each way."""
    across, down, cell = 8, 6, 40
    board = 255 * np.ones(((down + 2) * cell, (across + 2) * cell), np.uint8)
    for row in range(down):
        for column in range(across):
            if (row + column) % 2 == 0:
                board[(row + 1) * cell : (row + 2) * cell, (column + 1) * cell : (column + 2) * cell] = 0
    metres = SQUARE_M / cell
    middle = 0.5 * np.array([board.shape[1], board.shape[0]])
    rng = np.random.default_rng(1)
    for index in range(count):
        turn = cv2.Rodrigues(rng.uniform([-0.6, -0.6, -0.3], [0.6, 0.6, 0.3]))[0]
        way = np.array([*rng.uniform([-0.06, -0.05], [0.06, 0.05]), rng.uniform(0.4, 0.55)])
        board_to_m = np.array([[metres, 0.0, -metres * middle[0]], [0.0, metres, -metres * middle[1]], [0.0, 0.0, 1.0]])
        to_px = MATRIX @ np.column_stack([turn[:, 0], turn[:, 1], way]) @ board_to_m
        fine = np.array([[4.0, 0.0, 1.5], [0.0, 4.0, 1.5], [0.0, 0.0, 1.0]]) @ to_px
        large = cv2.warpPerspective(board, fine, (2560, 1920), borderValue=200)
        cv2.imwrite(str(folder / f"{index:02d}.png"), cv2.resize(large, (640, 480), interpolation=cv2.INTER_AREA))


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    folder = tmp_path_factory.mktemp("boards")
    draw(folder)
    return folder


def test_a_known_camera_is_found_again(drawn, tmp_path):
    request = CalibrateRequest((drawn,), "7x5", SQUARE_M, out=tmp_path / "camera.yaml")
    result = calibrate(request)
    # Half a per cent of the focal length and 3 px of the centre: corners are found to some hundredths of a pixel.
    assert np.diag(result.camera.matrix)[:2] == pytest.approx(np.diag(MATRIX)[:2], rel=0.005)
    assert result.camera.matrix[:2, 2] == pytest.approx(MATRIX[:2, 2], abs=3.0)
    assert result.rms_px < 0.15
    again = Camera.from_opencv_yaml(tmp_path / "camera.yaml")
    assert again.matrix == pytest.approx(result.camera.matrix)
    assert (tmp_path / "camera.png").is_file()
    assert "focal length" in result.to_text()


def test_a_picture_without_a_board_is_left_out_with_the_reason(drawn, tmp_path):
    plain = tmp_path / "plain.png"
    cv2.imwrite(str(plain), np.full((480, 640, 3), 120, np.uint8))
    result = calibrate(CalibrateRequest((drawn, plain), "7x5", SQUARE_M, out=tmp_path / "camera.yaml"))
    (left_out,) = [item for item in result.pictures if item.left_out]
    assert left_out.file == str(plain)
    assert "no board" in left_out.left_out


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"board": "9x9"}, "found in none"),
        ({"board": "nine"}, "board"),
        ({"square_m": -1.0}, "square"),
        ({"charuco": True, "dictionary": "DICT_NONE"}, "dictionary"),
        ({"paths": (Path("nowhere.png"),)}, "nowhere.png"),
        ({"out": Path("no/such/folder/camera.yaml")}, "folder"),
    ],
)
def test_what_is_wrong_is_said(drawn, tmp_path, changes, words):
    request = {"paths": (drawn / "00.png",), "board": "7x5", "square_m": SQUARE_M, "out": tmp_path / "c.yaml"} | changes
    with pytest.raises(DataError, match=words):
        calibrate(CalibrateRequest(**request))


@pytest.mark.skipif(not SAMPLES.is_dir(), reason="the sample chessboards are not here")
def test_sample_chessboards_give_their_focal_length(tmp_path):
    result = calibrate(CalibrateRequest((SAMPLES,), "11x7", 0.03, out=tmp_path / "camera.yaml"))
    assert 705.0 <= result.camera.focal_px <= 715.0
