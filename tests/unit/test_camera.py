"""The camera: hand-computed pixels, round trips through distortion and files, the gimbal's signs, every bad file."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from shipland.calibration_file import read_calibration, write_calibration
from shipland.camera import Camera, level_from_camera
from shipland.errors import DataError
from shipland.messages import GimbalAttitude

DISTORTIONS = {
    "none": np.zeros(5),
    "mild": np.array([-0.1, 0.02, 0.001, -0.0005, 0.0]),
    "wide": np.array([-0.28, 0.09, 0.0005, 0.0003, -0.012]),  # an action camera's barrel
    "pincushion": np.array([0.1, -0.02, 0.0, 0.0]),
    "rational": np.array([0.02, 0.01, 0.0, 0.0, 0.001, 0.05, 0.01, 0.0]),
}
ROUND_TRIP_PX = 1e-6
"""Undistortion iterates to 1e-10 of the focal length (1e-7 px); corner detection is no better than 0.01 px."""

columns, rows = st.floats(0.0, 1279.0), st.floats(0.0, 719.0)


@pytest.fixture(scope="module", params=list(DISTORTIONS))
def distorted(request, camera):
    return Camera(camera.width_px, camera.height_px, camera.matrix, DISTORTIONS[request.param])


class TestProjection:
    @pytest.mark.parametrize(
        ("point_m", "k1", "pixel"),
        [
            ([1.0, 0.5, 4.0], 0.0, [124.5, 62.0]),  # 100·1/4 right and 100·0.5/4 down of the principal point
            ([1.0, 0.0, 1.0], 0.0, [199.5, 49.5]),  # the picture's edge: half a pixel beyond the last pixel's centre
            ([1.0, 0.0, 2.0], -0.4, [99.5 + 45.0, 49.5]),  # x = 0.5, r² = 0.25: x·(1 + k1·r²) = 0.45
        ],
    )
    def test_pixels_by_hand(self, point_m, k1, pixel):
        # f = 100 px at 90° over 200 px; the principal point is between the middle pixels: (99.5, 49.5).
        camera = Camera(200, 100, Camera.from_fov(200, 100, 90.0).matrix, np.array([k1, 0.0, 0.0, 0.0]))
        np.testing.assert_allclose(camera.project(np.array(point_m)), [pixel], atol=1e-9)

    @given(columns, rows, st.floats(0.01, 1000.0))
    def test_back_projection_then_projection_gives_the_pixel_again(self, distorted, column_px, row_px, distance_m):
        pixel = np.array([[column_px, row_px]])
        ray = distorted.back_project(pixel)
        assert np.linalg.norm(ray) == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(distorted.project(distance_m * ray), pixel, atol=ROUND_TRIP_PX)

    @given(columns, rows)
    def test_undistorted_pixels_are_what_a_camera_without_distortion_sees(self, camera, distorted, column_px, row_px):
        pixel = np.array([[column_px, row_px]])
        seen_px = camera.project(distorted.back_project(pixel))
        np.testing.assert_allclose(distorted.undistort(pixel), seen_px, atol=ROUND_TRIP_PX)

    def test_points_beside_and_behind_the_camera_have_no_pixel(self, distorted):
        points = np.array([[0.1, 0.1, 2.0], [1.0, 1.0, 0.0], [0.1, 0.1, -2.0], [np.nan, 0.0, 1.0]])
        seen = np.isfinite(distorted.project(points)).all(axis=1)
        assert seen.tolist() == [True, False, False, False]

    def test_no_points_give_no_pixels(self, distorted):
        assert distorted.project(np.zeros((0, 3))).shape == (0, 2)
        assert distorted.undistort(np.zeros((0, 2))).shape == (0, 2)
        assert distorted.back_project(np.zeros((0, 2))).shape == (0, 3)

    @given(columns, rows)
    def test_a_scaled_camera_sees_the_same_ray_through_the_same_place(self, distorted, column_px, row_px):
        # Pixel edges scale, not centres: pixel u covers [u - 0.5, u + 0.5].
        half = distorted.scaled(640, 360)
        assert (half.width_px, half.height_px) == (640, 360)
        pixel = np.array([[column_px, row_px]])
        np.testing.assert_allclose(
            half.back_project(0.5 * (pixel + 0.5) - 0.5), distorted.back_project(pixel), atol=1e-8
        )


class TestGimbal:
    @staticmethod
    def pixel_of_level_direction(camera, gimbal, direction_in_level):
        return camera.project(level_from_camera(gimbal).T @ np.asarray(direction_in_level, dtype=float))[0]

    @given(st.floats(-0.3, 0.3))
    def test_looking_up_or_right_moves_what_is_ahead_down_or_left_by_f_tan_of_the_angle(self, camera, angle_rad):
        off_px = camera.focal_px * np.tan(angle_rad)
        up, right = GimbalAttitude(0.0, angle_rad), GimbalAttitude(0.0, 0.0, angle_rad)
        for gimbal, pixel in ((up, (639.5, 359.5 + off_px)), (right, (639.5 - off_px, 359.5))):
            assert self.pixel_of_level_direction(camera, gimbal, [1.0, 0.0, 0.0]) == pytest.approx(pixel, abs=1e-6)

    def test_rolling_right_lets_the_horizon_on_the_right_rise(self, camera):
        # The right wing goes down: what is level and to the right moves up in the picture (a smaller row).
        _, row_px = self.pixel_of_level_direction(camera, GimbalAttitude(0.05, 0.0), [1.0, 0.3, 0.0])
        assert row_px < 359.5 - 5.0

    def test_what_is_right_and_below_is_right_and_below(self, camera):
        column_px, row_px = self.pixel_of_level_direction(camera, GimbalAttitude(0.0, 0.0), [10.0, 1.0, 2.0])
        np.testing.assert_allclose(
            [column_px, row_px], [639.5 + 0.1 * camera.focal_px, 359.5 + 0.2 * camera.focal_px], atol=1e-6
        )


class TestCalibrationFiles:
    @pytest.mark.parametrize("suffix", ["yaml", "yml", "xml", "json"])
    def test_round_trip(self, distorted, tmp_path, suffix):
        path = tmp_path / f"camera.{suffix}"
        write_calibration(distorted, path)
        read = read_calibration(path)
        assert (read.width_px, read.height_px) == (1280, 720)
        np.testing.assert_array_equal(read.matrix, distorted.matrix)  # OpenCV writes all 17 digits
        np.testing.assert_array_equal(read.distortion, distorted.distortion)

    def test_a_folder_that_is_not_there_is_refused_when_writing(self, camera, tmp_path):
        with pytest.raises(DataError, match="its folder does not exist"):
            write_calibration(camera, tmp_path / "nowhere" / "camera.yaml")

    def test_a_path_that_is_a_folder_is_refused_when_writing(self, camera, tmp_path):
        with pytest.raises(DataError, match="cannot be written"):
            write_calibration(camera, tmp_path)


MATRIX = "600., 0., 320., 0., 600., 240., 0., 0., 1."


def calibration(width="640", height="480", shape=(3, 3), kind="d", matrix=MATRIX, distortion=None) -> str:
    """An OpenCV calibration file in YAML."""
    if distortion is None:
        distortion = as_matrix("distortion_coefficients", (1, 5), "d", "0., 0., 0., 0., 0.")
    return (
        f"%YAML:1.0\n---\nimage_width: {width}\nimage_height: {height}\n"
        + as_matrix("camera_matrix", shape, kind, matrix)
        + distortion
    )


def as_matrix(name, shape, kind, values) -> str:
    return f"{name}: !!opencv-matrix\n   rows: {shape[0]}\n   cols: {shape[1]}\n   dt: {kind}\n   data: [ {values} ]\n"


def distortion(shape, values) -> str:
    return calibration(distortion=as_matrix("distortion_coefficients", shape, "d", values))


NOT_OPENCV = "is not an OpenCV YAML, XML or JSON file"
LACKS = "lacks camera_matrix, or whole image_width and image_height"
BAD_FILES = {
    "empty": ("", NOT_OPENCV),
    "prose": ("hello world\n", NOT_OPENCV),
    "only a header": ("%YAML:1.0\n---\n", LACKS),
    "YAML without OpenCV's header": (calibration().removeprefix("%YAML:1.0\n---\n"), NOT_OPENCV),
    "ROS camera_info": (
        "image_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [600, 0, 320]\n",
        NOT_OPENCV,
    ),
    "cut off in the matrix": (calibration()[:120], NOT_OPENCV),
    "XML cut off": ('<?xml version="1.0"?>\n<opencv_storage>\n', NOT_OPENCV),
    "JSON cut off": ('{"image_width": 640,', NOT_OPENCV),
    "JSON list": ("[1, 2]", NOT_OPENCV),
    "matrix as a number": ("%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: 7\n", NOT_OPENCV),
    "too few numbers": (calibration(matrix="1., 2."), NOT_OPENCV),
    "2 × 2 matrix": (calibration(shape=(2, 2), matrix="1., 2., 3., 4."), r"wants shape \(3, 3\), got \(2, 2\)"),
    "unknown element type": (calibration(kind="q"), NOT_OPENCV),
    "absurd matrix size": (calibration(shape=(2000000000, 2000000000)), NOT_OPENCV),
    "matrix with a NaN": (calibration(matrix=MATRIX.replace("600.", ".Nan", 1)), "finite"),
    "matrix with an infinity": (calibration(matrix=MATRIX.replace("600.", ".Inf", 1)), "finite"),
    "negative focal length": (calibration(matrix=MATRIX.replace("600.", "-600.", 1)), "positive focal lengths"),
    "last row not 0 0 1": (calibration(matrix=MATRIX.replace("1.", "2.")), "wants the form"),
    "no width": (calibration().replace("image_width", "width"), LACKS),
    "width in words": (calibration(width='"wide"'), LACKS),
    "width a list": (calibration(width="[1, 2]"), LACKS),
    "width NaN": (calibration(width=".Nan"), LACKS),
    "width infinite": (calibration(width=".Inf"), LACKS),
    "width zero": (calibration(width="0"), "1 to 65535 px a side, got 0 × 480"),
    "height negative": (calibration(height="-480"), "1 to 65535 px a side, got 640 × -480"),
    "width beyond any camera": (calibration(width="99999999999999999999"), "1 to 65535 px a side"),
    "three distortion coefficients": (distortion((1, 3), "0., 0., 0."), "wants 4, 5, 8, 12 or 14 values, got"),
    "distortion with a NaN": (distortion((1, 4), "0., .Nan, 0., 0."), "finite"),
    "distortion in words": (calibration(distortion="distortion_coefficients: none\n"), NOT_OPENCV),
    "distortion as a plain list": (calibration(distortion="distortion_coefficients: [0.1, 0., 0., 0.]\n"), NOT_OPENCV),
}


class TestBadCalibrationFiles:
    @pytest.mark.parametrize("name", list(BAD_FILES))
    def test_is_a_data_error_that_names_the_file_and_the_fault_in_one_line(self, tmp_path, name):
        text, fault = BAD_FILES[name]
        path = tmp_path / "camera.yaml"
        path.write_text(text)
        with pytest.raises(DataError, match=fault) as caught:
            read_calibration(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)

    def test_binary_junk(self, tmp_path, rng):
        path = tmp_path / "camera.yaml"
        path.write_bytes(rng.bytes(2000))
        with pytest.raises(DataError, match=NOT_OPENCV):
            read_calibration(path)

    @pytest.mark.parametrize(("name", "words"), [("missing.yaml", "does not exist"), (".", "is a folder")])
    def test_missing_file_and_folder(self, tmp_path, name, words):
        with pytest.raises(DataError, match=words):
            read_calibration(tmp_path / name)

    @pytest.mark.parametrize("text", [calibration(), calibration(distortion="")])
    def test_the_file_these_are_made_from_is_good_also_without_distortion(self, tmp_path, text):
        path = tmp_path / "camera.yaml"
        path.write_text(text)
        read = read_calibration(path)
        assert (read.focal_px, read.has_distortion) == (600.0, False)


ROS = """image_width: 640
image_height: 480
camera_name: camera
camera_matrix:
  rows: 3
  cols: 3
  data: [600.5, 0, 320.1,
         0, 601, 240,
         0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.25, 0.001, 0, 0]
"""


class TestFilesOfOthers:
    def read(self, tmp_path, text):
        path = tmp_path / "camera.yaml"
        path.write_text(text)
        return read_calibration(path)

    def test_what_ros_writes_is_read(self, tmp_path):
        camera = self.read(tmp_path, ROS)
        assert (camera.width_px, camera.height_px) == (640, 480)
        assert np.array_equal(camera.matrix, [[600.5, 0.0, 320.1], [0.0, 601.0, 240.0], [0.0, 0.0, 1.0]])
        assert camera.distortion.tolist() == [0.1, -0.25, 0.001, 0.0, 0.0]

    def test_opencv_s_are_read_as_before(self, tmp_path):
        assert self.read(tmp_path, calibration()).focal_px == 600.0
        assert self.read(tmp_path, calibration() + "distortion_model: plumb_bob\nfisheye_model: 0\n").focal_px == 600.0

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            (ROS.replace("plumb_bob", "equidistant"), "distortion model equidistant, expected one of plumb_bob"),
            (calibration() + "distortion_model: equidistant\n", "distortion model equidistant"),
            (calibration() + "fisheye_model: 1\n", "distortion model fisheye"),
            ("<?xml version='1.0'?><opencv_storage><fisheye_model>1</fisheye_model></opencv_storage>", "fisheye"),
            (ROS.replace("640", "wide"), "whole image_width"),
            (ROS.replace(", 0, 1]", "]"), "camera_matrix has 7 numbers, expected 3 × 3"),
            (ROS.replace("rows: 3", "rows: .Inf"), "camera_matrix has 9 numbers, expected inf × 3"),
            (ROS.replace("600.5", "-600.5"), "positive focal lengths"),
            (ROS.replace("[0.1, -0.25, 0.001, 0, 0]", "[]"), "distortion_coefficients has 0 numbers, expected 1 × 5"),
        ],
    )
    def test_others_are_refused_in_a_line_that_names_the_file(self, tmp_path, text, words):
        with pytest.raises(DataError, match=words) as caught:
            self.read(tmp_path, text)
        assert str(tmp_path / "camera.yaml") in str(caught.value)


class TestDigest:
    """What is written carries a digest of its numbers; a file without one is taken as it is."""

    CAMERA = Camera(
        1280,
        720,
        np.array([[926.0, 0.0, 640.1], [0.0, 925.5, 359.2], [0.0, 0.0, 1.0]]),
        np.array([0.1, -0.25, 1e-4, -2e-4, 1.0 / 3.0]),
        1.2e-5,
    )

    @pytest.mark.parametrize("name", ["camera.yaml", "camera.xml", "camera.json"])
    def test_a_number_that_was_changed_is_known(self, tmp_path, name):
        path = tmp_path / name
        write_calibration(self.CAMERA, path)
        assert read_calibration(path).digest == self.CAMERA.digest
        text = path.read_text()
        for whole, changed in (("925.5", "955.5"), ("1280", "1288"), ("row_time_s", "row_tome_s"), ("-0.25", "-0.24")):
            path.write_text(text.replace(whole, changed))
            with pytest.raises(DataError, match=r"not have its digest; copy it again, or take out the line"):
                read_calibration(path)

    def test_edited_by_hand_without_its_digest_it_is_taken(self, tmp_path):
        path = tmp_path / "camera.yaml"
        write_calibration(self.CAMERA, path)
        kept = [line for line in path.read_text().splitlines() if not line.startswith("digest")]
        path.write_text("\n".join(kept).replace("925.5", "955.5"))
        assert read_calibration(path).matrix[1, 1] == 955.5

    def test_a_zero_byte_does_not_hide_what_comes_after_it(self, tmp_path):
        path = tmp_path / "camera.json"
        write_calibration(self.CAMERA, path)
        path.write_bytes(path.read_bytes().replace(b'   "distortion', b'\0  "distortion'))
        with pytest.raises(DataError, match="zero byte"):
            read_calibration(path)

    def test_with_one_bit_turned_it_is_refused_or_means_the_same(self, tmp_path, rng):
        path = tmp_path / "camera.yaml"
        write_calibration(self.CAMERA, path)
        whole, refused = path.read_bytes(), 0
        for _ in range(300):
            damaged = bytearray(whole)
            damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
            path.write_bytes(damaged)
            try:
                assert read_calibration(path).digest == self.CAMERA.digest
            except DataError:
                refused += 1
        assert refused > 100


class TestConstruction:
    @pytest.mark.parametrize(
        ("matrix", "coefficients", "fault"),
        [
            (np.eye(4), np.zeros(5), r"shape \(3, 3\), got \(4, 4\)"),
            (np.eye(3), np.zeros(6), r"4, 5, 8, 12 or 14 values, got \(6,\)"),
            (np.eye(3), np.zeros((1, 5)), r"got \(1, 5\)"),
            (np.diag([0.0, 1.0, 1.0]), np.zeros(5), "positive focal lengths"),
        ],
    )
    def test_wrong_intrinsics_are_refused_with_what_they_are(self, matrix, coefficients, fault):
        with pytest.raises(ValueError, match=fault):
            Camera(640, 480, matrix, coefficients)
