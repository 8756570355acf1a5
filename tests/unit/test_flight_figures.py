"""Pictures of recorded flights: the tracks in them, what is missing, and that they are remade bit by bit."""

import dataclasses

import numpy as np
import pytest
from made_up_flight import INFO, VERDICT, flight, log_of, write_log
from matplotlib.figure import Figure

from shipland.errors import DataError
from shipland.reproduce.flight_figures import (
    Tracks,
    draw_above,
    figures_of_flights,
    first_contacts,
    plot_commands,
    read_flights,
)


@pytest.fixture(scope="module")
def records():
    return tuple(flight(pictures=False))


def test_tracks_lie_in_the_axes_of_the_ship_at_the_start(records):
    track = Tracks(log_of(records))
    assert track.ship_m[0] == pytest.approx([0.0, 0.0, 0.0])
    # the made-up ship runs at 2 m/s on its course: ahead, whatever the course
    duration_s = track.t_s[-1] - track.t_s[0]
    assert track.ship_m[-1] == pytest.approx([2.0 * duration_s, 0.0, 0.0], abs=1e-6)
    assert track.under_way
    assert track.aircraft_m[0, 0] < -5.0  # from astern
    assert track.aircraft_m[0, 2] > 1.0  # up is positive
    assert track.distance_m[-1] < 0.1  # on the deck


def test_touchdowns_of_landed_missed_and_lost_flights(records):
    missed = dataclasses.replace(VERDICT, in_square=False)
    dots = first_contacts([log_of(records), log_of(records, missed), log_of(records, None)])
    assert [it.landed for it in dots] == [True, False, False]
    assert dots[0][:3] == (VERDICT.t_s, *VERDICT.touchdown_in_deck_m)
    assert np.isnan(dots[2][:3]).all()


def test_the_way_of_a_pilot_without_modes_is_drawn(records):
    bare = [dataclasses.replace(it, decision=dataclasses.replace(it.decision, mode=None)) for it in records[::10]]
    log = log_of(bare)
    axes, track = Figure().add_subplot(), Tracks(log)
    draw_above(axes, log, track)
    assert any(np.array_equal(line.get_xydata(), track.aircraft_m[:, :2]) for line in axes.lines)


def test_pictures_are_remade_bit_by_bit(records, unarranged, tmp_path):
    for name in ("one.png", "again.png"):
        plot_commands(tmp_path / name, log_of(records[::4], None))
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "again.png").read_bytes()


def test_a_folder_of_logs_gives_three_pictures(records, tmp_path):
    write_log(tmp_path / "flights" / "2.mcap", records[::10])
    write_log(tmp_path / "flights" / "10.mcap", records[::20], None, info=dataclasses.replace(INFO, seed=10))
    write_log(tmp_path / "flights" / "again" / "2.mcap", records[::10])  # the same flight
    logs = read_flights(tmp_path)
    assert [len(log.records) for log in logs] == [len(records[::10]), len(records[::20])]  # 2 before 10
    paths = figures_of_flights(tmp_path, tmp_path / "out")
    assert [path.name for path in paths] == ["trajectories.png", "commands.png", "landings.png"]
    assert all(path.stat().st_size > 5000 for path in paths)


def test_flights_of_several_pilots_are_named_by_all_of_them(records, tmp_path, monkeypatch):
    titles = []
    for name in ("trajectories", "commands", "touchdowns"):
        monkeypatch.setattr(f"shipland.reproduce.flight_figures.plot_{name}", lambda *args: titles.append(args[2:3]))
    for pilot in ("paper", "horizon"):
        info = dataclasses.replace(INFO, pilot=pilot)
        write_log(tmp_path / f"{pilot}.mcap", records[::40], info=info)
    figures_of_flights(tmp_path, tmp_path / "out")
    assert titles[0] == ("made-up, pilot paper, horizon, 2 flights",)


def test_a_folder_without_flights_is_said_in_words(tmp_path):
    with pytest.raises(DataError, match="holds no log of a simulated flight"):
        read_flights(tmp_path)
