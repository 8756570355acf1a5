"""Pictures of recorded flights: the tracks in them, what is missing, and that they are remade bit by bit."""

import dataclasses

import numpy as np
import pytest
from made_up_flight import VERDICT, flight, log_of, write_log

from shipland.errors import DataError
from shipland.report.plots import PlotParameters
from shipland.reproduce.flight_figures import (
    figures_of_flights,
    plot_commands,
    plot_trajectories,
    read_flights,
    touchdowns_of,
    tracks_of,
)

PARAMETERS = PlotParameters(dpi=50)
RECORDS = tuple(flight(pictures=False))


def test_tracks_lie_in_the_axes_of_the_ship_at_the_start():
    track = tracks_of(log_of(RECORDS))
    assert track.ship_m[0] == pytest.approx([0.0, 0.0, 0.0])
    # the made-up ship runs at 2 m/s on its course: ahead, whatever the course
    duration_s = track.t_s[-1] - track.t_s[0]
    assert track.ship_m[-1] == pytest.approx([2.0 * duration_s, 0.0, 0.0], abs=1e-6)
    assert track.under_way
    assert track.aircraft_m[0, 0] < -5.0  # from astern
    assert track.aircraft_m[0, 2] > 1.0  # up is positive
    assert track.distance_m[-1] < 0.1  # on the deck


def test_touchdowns_of_landed_missed_and_lost_flights():
    missed = dataclasses.replace(VERDICT, in_square=False)
    dots = touchdowns_of([log_of(RECORDS), log_of(RECORDS, missed), log_of(RECORDS, None)])
    assert dots.landed.tolist() == [True, False, False]
    assert dots.place_in_deck_m[0] == pytest.approx(VERDICT.touchdown_in_deck_m)
    assert np.isnan(dots.place_in_deck_m[2]).all()


def test_pictures_are_remade_bit_by_bit(unarranged, tmp_path):
    log = log_of(RECORDS, None)
    for name, draw in (
        ("all.png", lambda path: plot_trajectories(path, [log_of(RECORDS), log], "two", PARAMETERS)),
        ("one.png", lambda path: plot_commands(path, log, PARAMETERS)),
    ):
        draw(tmp_path / name)
        first = (tmp_path / name).read_bytes()
        draw(tmp_path / name)
        assert (tmp_path / name).read_bytes() == first
        assert len(first) > 5000


def test_a_folder_of_logs_gives_three_pictures(tmp_path):
    write_log(tmp_path / "flights" / "2.mcap", RECORDS[::10])
    write_log(tmp_path / "flights" / "10.mcap", RECORDS[::20], None)
    logs = read_flights(tmp_path)
    assert [len(log.records) for log in logs] == [len(RECORDS[::10]), len(RECORDS[::20])]  # 2 before 10
    paths = figures_of_flights(tmp_path, tmp_path / "out")
    assert [path.name for path in paths] == ["trajectories.png", "commands.png", "landings.png"]
    assert all(path.stat().st_size > 5000 for path in paths)


def test_a_folder_without_flights_is_said_in_words(tmp_path):
    with pytest.raises(DataError, match="holds no log of a simulated flight"):
        read_flights(tmp_path)
