"""Pictures of a flight and of many: they show what the data hold, whatever is missing, and are reproducible."""

import dataclasses

import cv2
import numpy as np
import pytest
from made_up_flight import RIG, VERDICT, flight, log_of, record_at, truth_at

from shipland.errors import DataError
from shipland.figures import new_figure
from shipland.messages import Mode
from shipland.report.landing_plots import DeckTrace, Touchdown, plot_instants, plot_touchdowns
from shipland.report.palette import BLUE, GREEN, MODE_COLOURS, VERMILION, mode_name, unit
from shipland.report.plots import DPI, draw_footprint, draw_pad, draw_up, finish_time_axes, plot_flight, smooth
from shipland.report.views import SIDE_PX, TEXT_PX, FlightViews

LOW_DPI = 60


@pytest.fixture(scope="module")
def whole():
    return log_of(flight(pictures=False))


def picture(path):
    return cv2.imread(str(path))


def test_a_flight_s_picture_has_its_size_and_the_modes_colours(whole, tmp_path):
    path = tmp_path / "deep" / "plots.png"
    plot_flight(path, whole, LOW_DPI)
    image = picture(path)
    assert image.shape == (round(11.6 * 60), round(10.4 * 60), 3)
    colours = np.unique(image.reshape(-1, 3), axis=0).astype(int)
    for mode in (Mode.SEARCH, Mode.TRACK_SHIP, Mode.TRACK_BAR, Mode.APPROACH, Mode.LAND, Mode.DONE):
        # bands are laid over white at 0.2
        shade = [round(255 * (1 - 0.2) + 0.2 * value) for value in MODE_COLOURS[mode]][::-1]
        assert np.abs(colours - shade).max(axis=1).min() <= 1, mode


@pytest.mark.parametrize(
    ("records", "verdict"),
    [
        (list(flight(from_s=30.0, pictures=False, witnessed=False)), VERDICT),
        (list(flight(from_s=0.0, to_s=1.0, pictures=False, witnessed=False)), None),
        ([record_at(20.0, np.random.default_rng(1), pictures=False)], None),
        (list(flight(from_s=33.0, to_s=34.0, pictures=False)), dataclasses.replace(VERDICT, landed=False)),
    ],
    ids=["no truth", "nothing seen", "one row", "ended before contact"],
)
def test_what_is_missing_is_left_out(records, verdict, unarranged, tmp_path):
    plot_flight(tmp_path / "plots.png", log_of(records, verdict), LOW_DPI)  # warnings are errors here
    assert picture(tmp_path / "plots.png").std() > 5.0


def test_the_legend_keeps_clear_of_the_probability_of_a_landing(whole):
    columns = whole.columns()
    share = np.where(columns.mode_number == Mode.LAND.value, 0.97, np.nan)
    figure = new_figure(5.2, 2.0)
    axes = figure.add_subplot()
    draw_up(axes, dataclasses.replace(columns, landing_probability=share))
    finish_time_axes(axes, columns, VERDICT, last=True)
    figure.draw_without_rendering()
    box = axes.get_legend().get_window_extent()
    for line in (line for each in figure.axes for line in each.lines if len(line.get_xdata()) > 2):
        places_px = line.get_transform().transform(line.get_xydata())
        assert not any(box.contains(*place) for place in places_px[np.isfinite(places_px).all(axis=1)])


def test_an_empty_log_and_a_bad_place_are_said_in_words(whole, tmp_path):
    with pytest.raises(DataError, match="no rows"):
        plot_flight(tmp_path / "plots.png", log_of([], None), LOW_DPI)
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        plot_flight(tmp_path / "file" / "plots.png", whole, LOW_DPI)


def test_every_mode_has_its_own_colour_and_name():
    assert set(MODE_COLOURS) == set(Mode)
    assert len(set(MODE_COLOURS.values())) == len(set(map(mode_name, Mode))) == len(Mode)
    for number in range(1, 6):  # the paper's five carry its numbers
        assert mode_name(Mode(number)).startswith(f"{number} ")
    assert unit((255, 0, 51)) == (1.0, 0.0, 0.2)


def test_the_pad_is_drawn_to_scale_forward_up():
    axes = new_figure(4.0, 4.0).add_subplot()
    draw_pad(axes, RIG)
    deck, square = (patch.get_bbox() for patch in axes.patches[:2])
    assert (deck.width, deck.height) == pytest.approx((RIG.deck_size_m, RIG.deck_size_m))
    assert (square.x0, square.y1) == pytest.approx((-0.5 * RIG.landing_square_m, 0.5 * RIG.landing_square_m))
    assert axes.get_ylim()[1] > axes.get_ylim()[0]
    draw_pad(axes, dataclasses.replace(RIG, landing_area="circle"))
    assert axes.patches[3].get_radius() == pytest.approx(0.5 * RIG.landing_square_m)


def test_the_footprint_lies_where_the_aircraft_stands():
    axes = new_figure(4.0, 4.0).add_subplot()
    draw_footprint(axes, np.array([0.1, -0.2]), np.radians(45.0), 0.24)
    hubs = np.array([patch.get_center() for patch in axes.patches[:4]])
    assert hubs.mean(axis=0) == pytest.approx([-0.2, 0.1])  # starboard is right, forward is up
    assert np.linalg.norm(hubs - [-0.2, 0.1], axis=1) == pytest.approx(0.12)
    # headed 45° to starboard, one rotor is straight ahead... and one straight to starboard
    assert sorted(hubs[:, 0])[-1] == pytest.approx(-0.2 + 0.12)


def test_dots_of_many_landings_lie_at_their_places(unarranged, tmp_path):
    never = Touchdown(np.nan, np.nan, np.nan, False)
    touchdowns = [Touchdown(5.0, 0.1, -0.05, True), Touchdown(9.0, 0.3, 0.3, False), never]
    plot_touchdowns(tmp_path / "scatter.png", touchdowns, RIG, "three", LOW_DPI)
    t_s = np.arange(0.0, 20.0, 0.1)
    still = np.zeros_like(t_s)
    motion = (still, still, -0.2 * np.sin(0.5 * t_s), 0.1 * np.sin(t_s), 0.05 * np.cos(t_s), still)
    trace = DeckTrace(t_s, np.column_stack(motion))
    assert [name for name, _ in trace.curves()] == ["roll [°]", "pitch [°]", "heave, up [m]"]
    assert trace.curves()[2][1] == pytest.approx(0.2 * np.sin(0.5 * t_s))
    plot_instants(tmp_path / "instants.png", trace, touchdowns, "three")
    assert picture(tmp_path / "instants.png").std() > 5.0

    def rightmost(name, colour):
        off = np.abs(picture(tmp_path / name).astype(int) - colour[::-1]).max(axis=2)
        return np.nonzero((off < 80).any(axis=0))[0].max()  # dots are laid over white at 0.7 and antialiased

    # the missed square is to starboard of the landing in it
    assert rightmost("scatter.png", VERMILION) > rightmost("scatter.png", BLUE)
    before = (tmp_path / "scatter.png").read_bytes()
    plot_touchdowns(tmp_path / "scatter.png", touchdowns, RIG, "three", LOW_DPI)
    assert (tmp_path / "scatter.png").read_bytes() == before


def test_no_landing_at_all_is_shown_as_such(tmp_path):
    never = Touchdown(np.nan, np.nan, np.nan, False)
    plot_touchdowns(tmp_path / "scatter.png", [never], RIG, "none", LOW_DPI)
    assert picture(tmp_path / "scatter.png").std() > 2.0


def test_a_landing_circle_is_round_from_above():
    for area, least, most in (("square", 1.3, 2.0), ("circle", 1.0, 1.25)):
        rig = dataclasses.replace(RIG, landing_area=area, landing_square_m=0.6)
        views = FlightViews(rig, 0.24)
        views.note(truth_at(20.0))
        top = views.picture()[TEXT_PX + SIDE_PX :]
        green = np.argwhere((np.abs(top.astype(int) - GREEN) < 60).all(axis=2))
        around = green[green[:, 1] < green[:, 1].max() - 50]  # the bar is green too, and ahead
        radius_px = np.linalg.norm(around - around.mean(axis=0), axis=1)
        assert least < radius_px.max() / radius_px.min() < most, area


def test_the_resolution_suits_a_readme():
    assert 1600 <= round(10.4 * DPI) <= 2000  # twice a README's 830 px


def test_the_deck_is_drawn_smooth_between_slow_cycles_and_as_it_is_between_quick_ones():
    slow_s, quick_s = np.arange(0.0, 9.01, 0.5), np.arange(0.0, 1.0, 1.0 / 30.0)
    t_s, heave_m = smooth(slow_s, np.sin(2.0 * slow_s))
    assert np.isin(slow_s, t_s).all()
    assert heave_m[5:-5] == pytest.approx(np.sin(2.0 * t_s)[5:-5], abs=0.03)  # straight lines are off by 0.12
    for times_s, values in ((quick_s, np.sin(quick_s)), (slow_s, np.where(slow_s > 4.0, np.nan, 1.0))):
        assert smooth(times_s, values)[1] is values
