"""The paper's figures: what is measured in them, against made-up traces and short flights."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from made_up_flight import flight, write_log
from test_campaign import GOOD

from pictures import Look, bar_picture, camera_from_bar, project_plane
from shipland.camera import Camera
from shipland.errors import ConfigError
from shipland.frames import CAMERA_FROM_MOUNT
from shipland.messages import BarPose, Frame, GimbalAttitude, Observation
from shipland.reproduce.detections import detections
from shipland.reproduce.far import (
    HAND_OVER_M,
    STEP_DEG,
    StepCase,
    approach,
    approach_figures,
    fly_approach,
    step_figures,
)
from shipland.reproduce.landings import courses, touchdowns
from shipland.reproduce.near import FALSE_AT_S, FALSE_M, NearTrace, Spoiled, fly_hover, near_figures
from shipland.reproduce.near_chain import chain_steps, plot_near_chain
from shipland.reproduce.paper import run_paper
from shipland.reproduce.plots import plot_far_steps, plot_near, plot_readings
from shipland.reproduce.ranges import FarCase, FarTrace, box_of, fly_far, ship_points_in_ship_m
from shipland.rig import Rig
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.sim.state import board_corners_in_bar_m
from shipland.vision.parameters import VisionParameters

RIG = Rig()
CAMERA = Camera.from_fov(1280, 720, 69.0)
SHORT = FarCase(
    distance_m=100.0, offset_deg=5.0, height_m=5.0, wind_mps=0.0, kind="exponential", variant="saturating",
    noise_px=1.0, approach=True, duration_s=8.0,
)  # fmt: skip


def test_a_step_s_figures_of_a_known_curve():
    # 80 px that swing past by e^(−π/4)·80 = 36.5 px and settle on 2 px
    t_s = np.arange(0.0, 90.0, 0.5)
    error_px = 78.0 * np.exp(-t_s / 8.0) * np.cos(2.0 * np.pi * t_s / 4.0) + 2.0
    figures = step_figures(t_s, error_px)
    assert figures.step_px == pytest.approx(80.0)
    assert figures.overshoot_px == pytest.approx(78.0 * math.exp(-2.0 / 8.0) - 2.0, abs=0.5)
    # outside ±8 px for the last time at the crest of 6 px + 2 px: 78·e^(−t/8) = 6 near t = 20 s
    assert figures.settled_s == pytest.approx(20.5, abs=0.6)
    assert figures.steady_px == pytest.approx(2.0, abs=0.1)
    assert figures.swing_px < 0.2


def test_a_swing_that_stays_or_a_ship_out_of_the_picture_never_settles():
    t_s = np.arange(0.0, 90.0, 0.5)
    swinging = 80.0 * np.cos(2.0 * np.pi * t_s / 12.0)
    figures = step_figures(t_s, swinging)
    assert math.isnan(figures.settled_s)
    assert figures.swing_px == pytest.approx(160.0, abs=2.0)
    lost = np.where(t_s > 70.0, np.nan, 80.0 * np.exp(-t_s))
    assert math.isnan(step_figures(t_s, lost).settled_s)


def trace_of(range_m, right_m, mps=2.0):
    n = len(range_m)
    place_m = np.column_stack([-np.asarray(range_m), right_m, np.zeros(n)])
    t_s = np.concatenate([[0.0], np.cumsum(-np.diff(range_m))]) / mps
    area_px2 = 0.42 * (931.0 / np.asarray(range_m)) ** 2
    nothing = np.zeros((n, 4))
    return FarTrace(t_s, np.zeros((n, 2)), area_px2, np.full(n, True), nothing, place_m, np.zeros(n))


def test_an_approach_s_figures_by_hand():
    range_m = np.arange(100.0, 5.0, -1.0)
    right_m = np.interp(range_m, [10.0, 40.0, 60.0, 100.0], [0.2, 0.2, -3.0, 10.0])
    figures = approach_figures(trace_of(range_m, right_m), 3400.0, 0.0)
    assert figures.overshoot_m == pytest.approx(3.0)
    assert figures.settled_s == pytest.approx(0.5 * (100.0 - 52.5), abs=0.5)  # 2 m off on the way back
    assert figures.run_in_m == pytest.approx(0.2)  # from 42 m on
    assert figures.hand_over_s == pytest.approx((100.0 - HAND_OVER_M) / 2.0)
    assert (figures.off_m, figures.sideways_mps) == pytest.approx((0.2, 0.0), abs=1e-9)
    # the board of 0.42 m² fills 0.8 · 3400 px² at 931 · √(0.42 / 2720) = 11.6 m
    assert figures.setpoint_s == pytest.approx((100.0 - 11.0) / 2.0)
    assert not figures.lost


def test_true_boxes_have_the_rig_s_size():
    # camera 100 m astern of the bar and level with it, looking ahead
    bar = CAMERA_FROM_MOUNT @ (board_corners_in_bar_m(RIG) + np.array([100.0, 0.0, 0.0])).T
    box = box_of(CAMERA, bar.T, np.zeros(4))
    assert box.size_px == pytest.approx((1.40 * CAMERA.focal_px / 100.0, 0.30 * CAMERA.focal_px / 100.0))
    assert box.centre_px == pytest.approx((639.5, 359.5))
    ship = CAMERA_FROM_MOUNT @ (ship_points_in_ship_m(RIG) + np.array([100.0, 0.0, 0.0])).T
    box = box_of(CAMERA, ship.T, np.array([-1.0, 0.0, 1.0, 0.0]))
    stern_m = 100.0 - RIG.deck_ahead_of_stern_m
    assert box.size_px[0] == pytest.approx(1.8 * CAMERA.focal_px / stern_m + 2.0)
    assert box_of(CAMERA, -ship.T, np.zeros(4)) is None  # behind the camera
    aside = CAMERA_FROM_MOUNT @ (ship_points_in_ship_m(RIG) + np.array([20.0, 20.0, 0.0])).T
    assert box_of(CAMERA, aside.T, np.zeros(4)) is None  # 45° off: not in the picture


def test_a_short_approach_turns_to_the_ship_and_repeats_itself():
    first, again = fly_far(SHORT), fly_far(SHORT)
    assert all(np.array_equal(a, b) for a, b in zip(vars(first).values(), vars(again).values(), strict=True))
    assert first.off_px[0, 0] == pytest.approx(CAMERA.focal_px * math.tan(math.radians(5.0)), abs=2.0)
    assert first.off_px[-1, 0] < 0.5 * first.off_px[0, 0]
    assert np.diff(first.t_s) == pytest.approx(0.5, abs=0.04)  # the paper's cycle, to a frame
    # the bar is 102 m off at first, then within its 100 m
    assert not first.on_bar[0]
    assert first.on_bar[-1]
    assert np.count_nonzero(np.diff(first.on_bar)) == 1
    assert abs(first.heading_deg[-1]) < 10.0


def test_the_wind_comes_from_port():
    blown = fly_far(dataclasses.replace(SHORT, wind_mps=5.0, duration_s=3.0, offset_deg=0.0))
    assert blown.place_in_ship_m[-1, 1] > -0.2
    assert 2.0 < blown.t_s[-1] < 3.0


class Fixed:
    """Eyes that always see the same."""

    def see(self, frame):
        pose = BarPose(np.array([-3.0, 0.0, 0.0]), 0.0, np.eye(4), 0.1, np.zeros((8, 2)))
        return Observation(frame.t_s, frame.gimbal, pose)


def test_one_estimate_is_false():
    eyes = Spoiled(Fixed(), 0.0, FALSE_M, np.random.default_rng(1))
    times_s = FALSE_AT_S + np.arange(-3, 4) / 30.0
    seen = [eyes.see(Frame(t_s, None, GimbalAttitude(0.0, 0.0))) for t_s in times_s]
    assert [each.bar_pose.position_in_bar_m[1] for each in seen] == [0.0, 0.0, 0.0, FALSE_M, 0.0, 0.0, 0.0]


def test_a_hover_s_figures_by_hand():
    t_s = np.arange(0.0, 14.0, 0.03)
    clean = NearTrace(t_s, np.zeros_like(t_s), np.zeros_like(t_s), np.zeros_like(t_s), np.zeros_like(t_s))
    law = np.where(t_s < FALSE_AT_S, np.random.default_rng(1).normal(0.0, 2.0, len(t_s)), 0.0)
    law[np.searchsorted(t_s, FALSE_AT_S)] = -80.0
    spoiled = dataclasses.replace(
        clean, law_percent=law, sent_percent=0.1 * law, right_m=np.where(t_s > 7.0, -0.03, 0.0)
    )
    figures = near_figures(spoiled, clean)
    assert figures.noise_percent == pytest.approx(2.0, abs=0.4)  # of 100 draws
    assert (figures.peak_percent, figures.sent_percent) == pytest.approx((80.0, 8.0))
    assert figures.excursion_m == pytest.approx(0.03)


def test_the_baselines_of_near_control_are_what_they_are_called():
    """A false estimate of half a metre: the linear derivative answers in full, the filter takes a part, Eq. 5 all."""
    peaks = {}
    for name, near in (
        ("d", {"derivative": "linear", "filter": "none"}),
        ("kalman", {"derivative": "linear", "filter": "kalman"}),
        ("published", {}),
    ):
        trace = fly_hover(near, 0.0, FALSE_M)
        peaks[name] = near_figures(trace, trace).peak_percent
    assert peaks["d"] == 100.0  # 8.5 · 0.5 / 0.033 = 129 %, clamped
    assert 20.0 < peaks["kalman"] < 60.0  # the filter lets 0.27 of it through
    assert peaks["published"] < 10.0


def test_figures_of_laws_and_geometry_and_their_tables(tmp_path, capsys):
    for name, cell in (
        ("roll-law", "| growing [%] | -100 | -72 |"),
        ("derivative-gain", "| heave | 0.95 | 4.25 | 7.00 |"),
        ("distance-size", "| ship platform | 250 | 6.7 | 2.2 | 3.2 |"),
        ("yolo-grid", "| 8 | 52 × 52 × 18 | 8112 |"),
    ):
        assert run_paper(tmp_path, name, None) == 0
        assert cell in (tmp_path / "table.md").read_text(encoding="utf-8")
        said = capsys.readouterr()
        assert cell in said.out
        assert f"1 of 1: {name} …" in said.err
        lines = said.out.splitlines()
        assert str(tmp_path / f"{name}.png") in lines and str(tmp_path / "table.md") in lines
        assert (tmp_path / f"{name}.png").stat().st_size > 5000
    table = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert table.count("\n## ") == 3  # each command adds its own, and a figure made again stands once
    assert run_paper(tmp_path, "derivative-gain", None) == 0
    assert (tmp_path / "table.md").read_text(encoding="utf-8") == table


def test_the_published_chain_step_by_step(rng, tmp_path):
    where = np.array([-4.0, 0.3, 0.0])
    image = bar_picture(RIG.cue, CAMERA, camera_from_bar(where, 0.0), rng, Look(0.5, 1.0))
    quiet = chain_steps(image, CAMERA, VisionParameters())
    true_px = project_plane(RIG.cue.points_in_bar_m[:, 1:], CAMERA, camera_from_bar(where, 0.0)).reshape(-1, 2)
    inside_px = np.rint(true_px[:4].mean(axis=0)).astype(int)
    spoiled = image.copy()
    spoiled[300:302, 200:202] = image[inside_px[1], inside_px[0]]  # a speck on the grey
    spoiled[inside_px[1], inside_px[0]] = 0  # and a void in a rectangle
    steps = chain_steps(spoiled, CAMERA, VisionParameters())
    assert steps.gated[300, 200] and not steps.gated[inside_px[1], inside_px[0]]
    assert not steps.opened[300, 200]
    assert steps.closed[inside_px[1], inside_px[0]]
    assert np.array_equal(steps.rectangles_px, quiet.rectangles_px)
    off_px = np.linalg.norm(steps.corners_px.reshape(-1, 1, 2) - true_px, axis=2).min(axis=1)
    assert off_px.max() < 1.0
    plot_near_chain(tmp_path / "chain.png", steps)
    assert (tmp_path / "chain.png").stat().st_size > 5000


def test_touchdowns_are_flown_and_drawn_with_the_deck_s_moving_coordinates(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("shipland.reproduce.landings.MOTIONS", {"rig-natops": "NATOPS limits"})
    text = touchdowns(tmp_path / "touchdowns.png", load_scenario("near"), runs=1)
    assert "NATOPS limits: flight 1 of 1\n" in capsys.readouterr().err
    assert text.splitlines()[-1].startswith("| NATOPS limits | 1 | 1 |")
    for name in ("touchdowns-rig-natops.png", "landing-points-rig-natops.png"):
        assert (tmp_path / name).stat().st_size > 5000


def test_the_closed_loop_pictures_can_be_drawn(tmp_path):
    trace = fly_far(SHORT)
    controls = ("P", "PID", "exponential, saturating", "exponential, growing", "exponential, printed")
    plot_far_steps(tmp_path / "steps.png", {StepCase("here").name: dict.fromkeys(controls, trace)})
    case = approach(100.0, STEP_DEG, 5.0)
    plot_readings(tmp_path / "readings.png", {case: {"saturating": trace, "growing": trace}}, 2.09)
    t_s = np.arange(0.0, 14.0, 0.03)
    hover = NearTrace(t_s, np.cos(t_s), np.cos(t_s), np.sin(t_s), np.sin(t_s))
    plot_near(tmp_path / "near.png", dict.fromkeys("abc", hover))
    assert all((tmp_path / f"{name}.png").stat().st_size > 5000 for name in ("steps", "readings", "near"))


def test_a_number_of_landings_below_none_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="--runs must be 0 or more, got -1"):
        run_paper(tmp_path, "touchdowns", None, runs=-1)


@pytest.mark.parametrize("variant", ["saturating", "growing"])
def test_an_approach_ends_over_the_ship(variant, monkeypatch):
    monkeypatch.setattr("shipland.reproduce.far.fly_far", lambda case: case)
    case = fly_approach(approach(250.0, 15.0, 5.0), variant)
    assert (case.distance_m, case.offset_deg, case.wind_mps, case.variant) == (250.0, 15.0, 5.0, variant)
    assert case.approach
    assert case.duration_s == 185.0


def test_without_the_slew_bound_the_peak_is_sent_whole():
    near = {"derivative": "linear", "filter": "kalman"}
    trace = fly_hover(near, 0.0, FALSE_M, slew=False)
    found = near_figures(trace, trace)
    assert found.sent_percent == pytest.approx(found.peak_percent)


def test_courses_are_flown_and_drawn(tmp_path, monkeypatch, capsys):
    """By a made-up flight; that of touchdowns is a true one."""
    flown = []

    def landed(job):
        flown.append((job.scenario.ship.course.kind, job.scenario.ship.course.speed_mps, job.seed))
        if job.log is not None:
            write_log(job.log, itertools.islice(flight(pictures=False), 0, None, 10))
        return GOOD

    monkeypatch.setattr("shipland.reproduce.landings.land_quietly", landed)
    text = courses(tmp_path / "courses.png", load_scenario("near"))
    assert "90° turn, 2.5 m/s\n" in capsys.readouterr().err
    assert flown[-3:] == [("turn90", 2.5, 3), ("turn90", 3.5, 4), ("turn90", 4.5, 5)]
    assert text.splitlines()[-1].startswith("| 90° turn | 5 | 5 |")
    assert (tmp_path / "courses.png").stat().st_size > 5000


@pytest.mark.slow
def test_the_packaged_detectors_find_both_targets_in_drawn_pictures(tmp_path, monkeypatch):
    """Of each by itself: test_detector."""
    monkeypatch.setattr("shipland.reproduce.detections.DISTANCES_M", (60.0, 2000.0))
    lines = detections(tmp_path / "detections.png", load_scenario(scenario_table("near"))).splitlines()
    for near, far, width_px in ((lines[2], lines[3], 29.0), (lines[4], lines[5], 21.7)):
        _, target, distance_m, wide_px, sure, _ = (cell.strip() for cell in near.split("|"))
        assert (target, distance_m) in {("ship", "60"), ("bar", "60")}
        assert float(wide_px) == pytest.approx(width_px, abs=0.5)  # size · 931 px / 60 m; a near stern is larger
        assert float(sure) > 0.8
        assert far.endswith("| not found |")
    assert (tmp_path / "detections.png").stat().st_size > 5000
