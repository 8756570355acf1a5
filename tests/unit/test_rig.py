"""The rig against the paper's figures, and the cue's geometry."""

import numpy as np
import pytest

from shipland.cue import Cue, Polygon
from shipland.errors import ConfigError
from shipland.rig import view_share

# [Lee2022, §Experimental Setup]
PAPER = {
    "platform_length_m": 3.0,
    "platform_width_m": 1.8,
    "superstructure_height_m": 1.8,
    "deck_size_m": 1.22,
    "landing_square_m": 0.35,
    "surge_limit_m": 1.02,
    "sway_limit_m": 1.02,
    "heave_limit_m": 0.64,
    "roll_limit_deg": 13.0,
    "pitch_limit_deg": 15.0,
    "yaw_limit_deg": 16.0,
}


@pytest.mark.parametrize("name", list(PAPER))
def test_the_papers_dimensions(rig, name):
    assert getattr(rig, name) == PAPER[name]


def test_setpoints_of_the_far_controller_lie_at_10_3_and_23_7_m(rig, camera):
    # [Lee2022, Table 1]: areas of the boxes there. The bar's is drawn around the board; 10.3 m leaves the near range
    # (from 15 m) to begin before it.
    board_m2, ship_m2 = rig.board_width_m * rig.board_height_m, rig.platform_width_m * rig.superstructure_height_m
    got_m = camera.focal_px * np.sqrt([board_m2 / 3400.0, ship_m2 / 5000.0])
    assert got_m == pytest.approx([10.35, 23.7], abs=0.05)


def test_platform_at_250_m_is_seven_pixels_wide(rig, camera):
    # The paper's longest range: no detector that shrinks the picture can see it.
    assert camera.focal_px * rig.platform_width_m / 250.0 == pytest.approx(6.7, abs=0.05)


def test_target_is_two_rectangles_in_the_bars_plane(rig):
    # 0.45 × 0.15 m, 0.30 m apart: from -0.60 to -0.15 and from 0.15 to 0.60; down is positive.
    want = [
        [0.0, -0.60, -0.075],
        [0.0, -0.15, -0.075],
        [0.0, -0.15, 0.075],
        [0.0, -0.60, 0.075],
        [0.0, 0.15, -0.075],
        [0.0, 0.60, -0.075],
        [0.0, 0.60, 0.075],
        [0.0, 0.15, 0.075],
    ]
    assert rig.cue.count == 2
    np.testing.assert_allclose(rig.cue.points_in_bar_m, want, atol=1e-12)


def test_rectangles_fit_on_the_board(rig):
    right_m, down_m = np.abs(rig.cue.points_in_bar_m[:, 1:]).max(axis=0)
    assert right_m <= 0.5 * rig.board_width_m
    assert down_m <= 0.5 * rig.board_height_m


def test_bar_is_2_09_m_ahead_of_the_deck_and_0_75_m_above_it(rig):
    np.testing.assert_allclose(rig.bar_in_ship_m, [2.09, 0.0, -0.75], atol=1e-12)
    np.testing.assert_allclose(rig.ship_from_bar.apply(rig.deck_in_bar_m), np.zeros(3), atol=1e-12)


def test_deck_and_bar_stand_on_the_platform(rig):
    half_deck_m = 0.5 * rig.deck_size_m
    assert rig.deck_ahead_of_stern_m - half_deck_m >= 0.0
    assert rig.bar_ahead_of_stern_m <= rig.platform_length_m
    assert rig.bar_ahead_of_stern_m > rig.deck_ahead_of_stern_m + half_deck_m
    assert rig.deck_size_m <= rig.platform_width_m
    assert rig.bar_height_m + 0.5 * rig.board_height_m <= rig.superstructure_height_m


class TestTargets:
    GOOD = ((-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5))
    CROSSES = "an outline that does not cross itself|different points"

    def test_rectangle_by_hand(self):
        assert Polygon.rectangle((0.5, 0.25), 1.0, 0.5).corners_m == ((0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.0, 0.5))

    def test_a_leaning_trapezoid_is_good(self):
        Polygon(((-0.8, -0.6), (1.0, -0.3), (1.2, 0.5), (-1.0, 0.6)))

    @pytest.mark.parametrize(
        ("corners_m", "fault"),
        [
            (GOOD[::-1], "an outline that does not cross itself, clockwise"),  # counter-clockwise
            ((GOOD[0], GOOD[2], GOOD[1], GOOD[3]), CROSSES),  # crossed
            ((GOOD[0], GOOD[1], (0.0, -0.4), GOOD[3]), CROSSES),  # an arrowhead
            ((GOOD[0], GOOD[1], GOOD[1], GOOD[3]), CROSSES),  # a corner twice
            ((GOOD[0], GOOD[1], (float("nan"), 0.5), GOOD[3]), "finite number"),
            (((0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)), CROSSES),  # a line
            (GOOD[1:] + GOOD[:1], "must start at the top-left corner"),
            (GOOD[2:] + GOOD[:2], "must start at the top-left corner"),
            (GOOD[3:] + GOOD[:3], "must start at the top-left corner"),
            (GOOD[:2], r"three or more \(right, down\) points, got 2"),
        ],
    )
    def test_bad_quadrilaterals_are_refused(self, corners_m, fault):
        with pytest.raises(ValueError, match=fault):
            Polygon(corners_m)

    def test_a_cue_without_polygons_is_refused(self):
        with pytest.raises(ValueError, match=r"at least one \[\[rig.polygon\]\]"):
            Cue(())

    def test_file_round_trip(self, rig, tmp_path):
        lines = [
            f"[[rig.polygon]]\ncorners_m = {[list(corner) for corner in it.corners_m]}\n" for it in rig.cue.polygon
        ]
        path = tmp_path / "cue.toml"
        path.write_text("\n".join(lines))
        assert Cue.from_file(path) == rig.cue

    @pytest.mark.parametrize(
        ("text", "fault"),
        [
            ("", "missing key 'polygon'"),
            ("rig.polygon = []", "at least one"),
            ("rig.polygon = 3", "expected a list, got 3"),
            ("[[rig.polygons]]\ncorners_m = []", "unknown key 'polygons'; did you mean 'polygon'"),
            ("[[rig.quad]]\ncorners_m = []", "'quad' is called 'polygon' now"),
            ("[[quad]]\ncorners_m = []", r"'quad' stands in section \[rig\] now.*\[\[rig.polygon\]\]"),
            ("[[rig.polygon]]\ncorners_m = [[0, 0], [1, 0], [1, 1], [0]]", r"corners_m\[3\]: expected 2 values, got 1"),
            ("[[rig.polygon]]\ncorners_m = [[0, 0], [1, 0], [1, 1]]", "a single triangle tells no pose"),
            ("[[rig.polygon]]\ncorners_m = [[0, 0], [0, 1], [1, 1], [1, 0]]", r"polygon\[0\]: corners_m must be"),
            (
                "[[rig.polygon]]\ncorners_m = [[0, 0], [17.7, 0], [17.7, 6], [0, 6]]",
                "17.7 m wide; were they inches, 0.45 m",
            ),
            ("rig.hue = 'green'\n[[rig.polygon]]\ncorners_m = [[0, 0], [1, 0], [1, 1], [0, 1]]", "hue"),
        ],
    )
    def test_bad_cue_files_are_refused_with_file_and_place(self, tmp_path, text, fault):
        path = tmp_path / "cue.toml"
        path.write_text(text)
        with pytest.raises(ConfigError, match=rf"cue\.toml.*{fault}"):
            Cue.from_file(path)


def test_a_cue_of_a_file_is_taken_for_hand_cut_unless_it_says(tmp_path):
    polygon = "[[rig.polygon]]\ncorners_m = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]]\n"
    (tmp_path / "tape.toml").write_text(polygon)
    (tmp_path / "exact.toml").write_text("rig.manufacturing_tolerance = 0.001\n" + polygon)
    (tmp_path / "loose.toml").write_text("rig.manufacturing_tolerance = 0.5\n" + polygon)
    assert Cue.from_file(tmp_path / "tape.toml").manufacturing_tolerance == 0.01
    assert Cue.from_file(tmp_path / "exact.toml").manufacturing_tolerance == 0.001
    with pytest.raises(ConfigError, match="manufacturing_tolerance"):
        Cue.from_file(tmp_path / "loose.toml")


@pytest.mark.parametrize(
    ("ahead_m", "right_m", "share"),
    [
        (0.0, 0.0, 0.5),  # the box is 2 m × 1 m, the view 2 m × 2 m
        (1.0, 0.0, 0.25),  # half of it beyond the bow
        (0.0, 1.0, 0.25),  # half a metre of it within
        (2.5, 0.0, 0.0),
        (2.5, 2.5, 0.0),  # beyond both sides: two negative overlaps are no share
    ],
)
def test_the_share_of_a_view_that_shows_a_box(ahead_m, right_m, share):
    assert view_share(ahead_m, right_m, 1.0, (-1.0, 1.0, -0.5, 0.5)) == pytest.approx(share, abs=1e-12)


def test_the_size_of_a_cue_is_said_so_that_inches_are_noticed():
    assert Cue((Polygon.rectangle((0.0, 0.0), 1.2, 0.15),)).size_words == "1.2 × 0.15 m"
    wide = Cue((Polygon.rectangle((0.0, 0.0), 6.0, 4.0),)).size_words
    assert wide == "6 × 4 m; corners_m are metres: were they inches, it is 0.15 m wide"
