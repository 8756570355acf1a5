"""Operating envelopes: wind over deck becomes wind, flights go where the border is, the same after a stop."""

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from studies import harness
from test_campaign import GOOD, NOWHERE, make_up_flights, seeded

from shipland.envelopes import bases_of, fly_envelopes
from shipland.errors import ConfigError
from shipland.evaluation.campaign import read_cells
from shipland.evaluation.envelope import (
    KNOT_MPS,
    EnvelopeGrid,
    border_kn,
    cell_at,
    deck_statistics,
    figures,
    next_counts,
    rating_of,
    true_wind,
    under_way,
)
from shipland.evaluation.suite import Overrides, SuiteEntry
from shipland.evaluation.tally import Tally
from shipland.report.envelope import NO_RELEASE, Panel, draw_envelopes, write_envelopes
from shipland.scenario.scenario import load_scenario
from shipland.stopping import check_stop

GRID = EnvelopeGrid((10.0, 20.0, 30.0), (0.0, 90.0), runs=4, most=16)
BAD = replace(GOOD, landed=False, in_square=False, cause="hard", reason="touched down too hard", sink_mps=3.0)


@cache
def deck():
    return deck_statistics(load_scenario("rig-natops"))


def base(name="rig-natops", **sections):
    (cell,) = bases_of(SuiteEntry((load_scenario(name, **sections),)), Overrides(("horizon",)))
    return cell


@pytest.fixture
def flown(monkeypatch):
    """Flights are made up: all land in less wind than 24 kn from ahead and 13 kn from elsewhere, none beyond."""
    seen = []

    def land(flight):
        check_stop()
        seen.append((flight.cell, flight.seed))
        wind = flight.scenario.wind
        good = wind.mean_mps / KNOT_MPS < (24.0 if wind.from_deg == 0.0 else 13.0)
        return seeded(GOOD if good else NOWHERE, flight.seed)

    make_up_flights(monkeypatch, land)
    monkeypatch.setattr("shipland.envelopes.deck_statistics", lambda _: deck())
    return seen


@pytest.mark.parametrize("off_bow_deg", [0.0, 45.0, 135.0, 180.0, 300.0])
def test_the_true_wind_less_the_ships_way_is_the_wind_over_deck(off_bow_deg):
    speed_mps, from_deg = true_wind(20.0, off_bow_deg, 5.0)
    from_rad, over_rad = math.radians(from_deg), math.radians(off_bow_deg)
    met = np.array([speed_mps * math.cos(from_rad) + 5.0, speed_mps * math.sin(from_rad)])
    np.testing.assert_allclose(met, 20.0 * KNOT_MPS * np.array([math.cos(over_rad), math.sin(over_rad)]), atol=1e-12)


def test_a_cell_meets_that_wind_and_nothing_drawn():
    cell = cell_at(base("frigate-sea5", ship={"course": {"course_deg": 40.0}}), 20.0, 90.0)
    assert cell.scenario.wind.mean_mps == pytest.approx(math.hypot(5.14, 20.0 * KNOT_MPS), abs=0.006)
    abaft_deg = 90.0 + math.degrees(math.atan(5.14 / (20.0 * KNOT_MPS)))
    assert cell.scenario.wind.from_deg == pytest.approx(40.0 + abaft_deg, abs=0.06)
    assert cell.scenario.wind.from_half_range_deg == 0.0
    assert cell.settings == (("wind.mean_mps", "11.50"), ("wind.from_deg", "156.5"))


def test_a_ship_goes_as_fast_as_it_is_told_and_its_motions_with_it():
    fast = under_way(base("frigate-sea5"), 15.0).scenario.ship
    assert (fast.course.speed_mps, fast.sea.speed_kn) == (7.72, 15.0)
    assert under_way(base(), 2.0).scenario.ship.course.kind == "straight"


def test_what_the_grid_sets_cannot_be_set_and_a_turning_ship_has_no_wind_over_deck():
    with pytest.raises(ConfigError, match=r"wind\.mean_mps"):
        bases_of(SuiteEntry(("near",)), Overrides(("paper",), ("wind.mean_mps=3",)))
    with pytest.raises(ConfigError, match=r"ship\.sea\.sea_state is set 2 times"):
        bases_of(SuiteEntry(("near",)), Overrides(("paper",), ("ship.sea.sea_state=4", "ship.sea.sea_state=5")))
    with pytest.raises(ConfigError, match="steady course"):
        base(ship={"course": {"kind": "s"}})


def test_the_border_is_halved_then_counted_then_left():
    far = {10.0: Tally(4, 4), 20.0: Tally(4, 0)}
    assert next_counts(GRID, far) == {15.0: 4}
    near = {17.5: Tally(4, 4), 20.0: Tally(4, 3)}
    assert next_counts(GRID, near) == {17.5: 8, 20.0: 8}
    assert next_counts(GRID, {17.5: Tally(16, 16), 20.0: Tally(16, 12)}) == {}
    assert next_counts(GRID, {17.5: Tally(400, 400), 20.0: Tally(4, 0)}) == {}, "both intervals are clear of 90 %"
    assert next_counts(GRID, {10.0: Tally(4, 4), 20.0: Tally(4, 4)}) == {}


def test_where_the_share_crosses_the_rate():
    assert border_kn(0.9, {10.0: Tally(10, 10), 20.0: Tally(10, 8)}) == (15.0, "")
    assert border_kn(0.9, {10.0: Tally(10, 8), 20.0: Tally(10, 10)}) == (10.0, "less than")
    assert border_kn(0.9, {10.0: Tally(10, 9), 20.0: Tally(10, 10)}) == (20.0, "more than")


@pytest.mark.parametrize(("flights", "landed"), [(100, 55), (200, 110), (40, 36), (10, 9)])
def test_as_many_as_wanted_is_enough(flights, landed):
    rate = landed / flights
    assert Tally(flights, landed).within(rate)
    assert not Tally(flights, landed - 1).within(rate)


def test_ratings_tell_refusals_from_hits():
    limits = load_scenario("rig-natops").verdict
    easy = replace(GOOD, sink_mps=0.5, slide_mps=0.1, tilt_deg=6.0)
    hard = replace(GOOD, tilt_deg=24.0)
    assert rating_of([easy] * 10, limits, 0.9) == 1
    assert rating_of([easy] * 9 + [NOWHERE], limits, 0.9) == 2
    assert rating_of([hard] * 10, limits, 0.9) == 3
    assert rating_of([NOWHERE] * 10, limits, 0.9) == 4
    assert rating_of([easy] * 18 + [BAD] * 2, limits, 0.9) == 5
    row = figures(load_scenario("rig-natops"), [easy] * 2 + [NOWHERE, BAD], 0.9)
    assert (row["landed"], row["bad"], row["refused"], row["outside"], row["beyond_natops"]) == (2, 1, 1, 0, 0)
    assert row["success"]["low"] < row["success"]["value"] < row["success"]["high"]


def test_flights_go_to_the_border_and_resume_flies_the_same(flown, tmp_path):
    options = {"workers": 1, "progress": False}
    found = fly_envelopes([base()], GRID, out=tmp_path / "whole", **options).envelopes[0]
    counts = {(row["off_bow_deg"], row["wind_kn"]): row["flights"] for row in found.rows}
    assert counts[90.0, 10.0] == 4
    assert counts[90.0, 12.5] == 16
    assert counts[90.0, 30.0] == counts[90.0, 20.0] == 4, "none of 4 is clear of 90 % already"
    assert {direction: round(kn, 2) for direction, (kn, _) in found.borders.items()} == {0.0: 22.75, 90.0: 12.75}
    whole = list(flown)
    assert len(whole) == len(set(whole)) == sum(counts.values())
    flown.clear()
    fly_envelopes([base()], GRID, out=tmp_path / "part", time_limit_s=1e-6, **options)
    again = fly_envelopes([base()], GRID, out=tmp_path / "part", **options)
    assert (again.left, again.envelopes[0].rows) == (0, found.rows)
    assert sorted(flown) == sorted(whole)
    assert len(read_cells([tmp_path / "part"])) == len(counts)


def test_what_a_folder_holds_beyond_the_flights_asked_for_does_not_count(flown, tmp_path):
    options = {"out": tmp_path, "workers": 1, "progress": False}
    fly_envelopes([base()], EnvelopeGrid((10.0, 12.5), (90.0,), runs=6, most=6), **options)
    flown.clear()
    (found,) = fly_envelopes(
        [base()], EnvelopeGrid((5.0, 10.0, 12.5, 15.0), (90.0,), runs=2, most=4), **options
    ).envelopes
    assert {row["wind_kn"]: row["flights"] for row in found.rows} == {5.0: 2, 10.0: 2, 12.5: 4, 15.0: 2}
    assert len(flown) == 4


def test_the_command_leaves_a_picture_a_table_and_json(flown, tmp_path, here):
    words = ["rig-natops", "--wind-kn", "10,20", "--every-deg", "180", "--runs", "2", "--most", "4", "--workers", "1"]
    done = here("envelope", *words, "--out", tmp_path)
    assert done.returncode == 0
    table = json.loads((tmp_path / "envelope.json").read_text())
    assert table["note"] == NO_RELEASE
    assert NO_RELEASE in done.stdout
    (envelope,) = table["envelopes"]
    assert {cell["off_bow_deg"] for cell in envelope["cells"]} == {0.0, 180.0}
    assert envelope["borders"][0]["bound"] == "more than"
    assert [it["limit"] for it in envelope["limits"]][-1] is None, "no public number of STANAG 4154"
    assert (tmp_path / "envelope.png").stat().st_size > 20_000
    assert "wind.from_deg" in (tmp_path / "flights.csv").read_text().splitlines()[0]


def test_several_envelopes_share_a_picture(flown, unarranged, tmp_path):
    grid = EnvelopeGrid((10.0,), (0.0, 90.0), runs=1, most=1)
    bases = bases_of(SuiteEntry(("rig-natops",)), Overrides(("p", "horizon")))
    found = fly_envelopes(bases, grid, tmp_path / "flown", workers=1, progress=False)
    assert [it.pilot for it in found.envelopes] == ["p", "horizon"]
    text = write_envelopes(tmp_path, found.envelopes, "command", picture=True)
    assert text.count("## rig-natops") == 2
    assert "| 000 | more than 10.0 | more than 5.1 |" in text


def test_the_study_flies_a_direction_and_draws_both(flown, unarranged, tmp_path, monkeypatch):
    monkeypatch.setattr("studies.envelope.PARTS", tmp_path)
    study = harness.load("envelope")
    row = study.measure(study.cases()[3], 2)
    assert {"wind_kn", "success", "rating", "border", "causes"} <= row[0].keys() & study.columns.keys()
    assert {round(each["border_kn"], 1) for each in row} == {12.2}
    both = [dict(each, scenario=name) for each in row for name in ("rig-natops", "frigate-sea5")]
    study.picture(both, tmp_path / "envelope.png")
    assert (tmp_path / "envelope.png").stat().st_size > 20_000


def test_deck_amplitudes_are_those_of_its_sines():
    assert deck()["roll_deg"] == pytest.approx(8.0 * math.sqrt(2.0), rel=0.01)
    assert deck()["pitch_deg"] == pytest.approx(3.0 * math.sqrt(2.0), rel=0.01)


@pytest.mark.parametrize(
    "wrong", [{"winds_kn": (10.0, 5.0)}, {"rate": 1.0}, {"runs": 9, "most": 8}, {"directions_deg": (0.0, 360.0)}]
)
def test_a_wrong_grid_is_refused(wrong):
    with pytest.raises(ConfigError):
        EnvelopeGrid(**wrong)


def test_fewer_workers_than_none_are_refused(tmp_path):
    with pytest.raises(ConfigError, match="workers must be 0 or more"):
        fly_envelopes([base()], GRID, tmp_path, workers=-1)


@pytest.mark.parametrize(
    ("directions", "arcs"), [([0.0], 1), ([0.0, 90.0], 1), ([0.0, 180.0], 2), ([0.0, 120.0, 240.0], 3)]
)
def test_a_border_is_not_drawn_across_half_a_circle(directions, arcs):
    cell = {"wind_kn": 10.0, "success": {"value": 1.0}, "rating": 1, "refused": 0, "flights": 6}
    panel = Panel("", [{**cell, "off_bow_deg": at} for at in directions], dict.fromkeys(directions, (12.0, "")))
    axes = draw_envelopes([panel], 0.9).axes[0]
    assert len([line for line in axes.lines if line.get_linewidth() == 2.2]) == arcs
