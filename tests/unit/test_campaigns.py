"""`shipland.campaign`: what it gives back, with and without a folder, and from a script without a guard."""

import base64
import re
import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from test_campaign import GOOD, NOWHERE, make_up_flights, seeded

import shipland
from shipland.errors import ConfigError, DataError
from shipland.evaluation import job
from shipland.evaluation.landing import NAN, column_of
from shipland.factories import name_of
from shipland.guidance.pilot import horizon, paper
from shipland.scenario.scenario import load_scenario
from shipland.statistics import share_interval


@pytest.fixture
def made_up(monkeypatch):
    """Flights are made up, the paper's pilot misses every second seed; a folder gets no pictures. The jobs are kept."""
    flown = []

    def land(flight):
        flown.append(flight)
        missed = name_of(flight.pilot).endswith("paper") and flight.seed % 2 == 0
        return seeded(NOWHERE if missed else GOOD, flight.seed)

    make_up_flights(monkeypatch, land)
    monkeypatch.setattr("shipland.report.landing_plots.installed", lambda _: False)
    return flown


def grid(**more):
    options = {"pilot": ["paper", "horizon"], "settings": "wind.mean_mps=0,5", "runs": 4, "workers": 1}
    return shipland.campaign("near", **options | {"progress": False, "oracle_motions": 0} | more)


def test_rows_and_columns_name_cells_settings_and_landings(made_up):
    found = grid(first_seed=3)
    assert repr(found) == "<Campaign of 4 cells: 12 of 16 landed in the square (47.6–92.7 %)>"
    table = found.table()
    assert len(found.rows) == len(table["seed"]) == 16
    assert table["seed"][:4].tolist() == [3, 4, 5, 6]
    assert dict(zip(table["wind.mean_mps"], table["pilot"], strict=True)) == {0: "horizon", 5: "horizon"}
    assert table["success"][table["pilot"] == "horizon"].all()
    assert found.summary.count("\n") == 3
    assert {len(cell.landings) for cell in found.cells} == {4}


def test_to_look_changes_nothing_in_a_folder(made_up, tmp_path):
    grid(out=tmp_path / "out", command="flown")
    before = (tmp_path / "out/cells.json").read_bytes()
    found = grid(out=tmp_path / "out", command="looked", workers=0, settings="wind.mean_mps=9")
    assert (found.left, found.landings, (tmp_path / "out/cells.json").read_bytes()) == (8, (), before)


def test_a_column_has_its_type_with_and_without_values():
    assert column_of("seed", [1, 2]).dtype == int
    assert column_of("error_m", [0.5, NAN]).dtype == float
    assert column_of("sea_state", [6, ""]).tolist() == pytest.approx([6.0, NAN], nan_ok=True)
    assert column_of("sea_state", ["", ""]).dtype == float
    assert column_of("in_square", [True, False]).dtype == bool
    assert column_of("oracle_in_square", [True, ""]).tolist() == [True, None]
    assert column_of("cause", ["", "too fast"]).tolist() == ["", "too fast"]
    assert column_of("wind.mean_mps", ["0", "2.5"]).tolist() == [0.0, 2.5]
    assert column_of("aircraft.loop.kind", ["attitude", ""]).tolist() == ["attitude", ""]
    assert column_of("suite", ["", ""]).tolist() == ["", ""]


def test_a_seed_of_many_digits_stays_itself():
    assert column_of("seed", [1764475580123456789, 2**64 + 1]).tolist() == [1764475580123456789, 2**64 + 1]


def test_flights_that_end_while_the_others_are_stopped_are_not_missing(made_up, monkeypatch):
    def two_at_once(_):
        def executor(flights, keep, _):
            pairs = [(flight, job.land_once(flight)) for flight in flights]
            try:
                keep(*pairs[0])
                yield pairs[0]
            finally:
                keep(*pairs[1])

        return executor

    monkeypatch.setattr("shipland.campaigns.processes", two_at_once)
    found = grid(pilot="paper", settings=(), runs=2, time_limit_s=1e-9)
    assert (len(found.landings), found.left) == (2, 0)


def test_logs_that_come_too_late_are_told(made_up, tmp_path, here):
    words = ["campaign", "--scenario", "near", "--runs", "3", "--workers", "1", "--oracle-motions", "0"]
    assert "without --logs" not in here(*words, "--out", tmp_path).stderr
    done = here(*words, "--out", tmp_path, "--logs")
    assert "3 flights were flown before without --logs, and keep no log; another --out flies them again" in done.stderr


def test_a_folder_holds_the_same_rows_and_is_not_flown_again(made_up, tmp_path):
    in_memory, flown = grid(), len(made_up)
    on_disk = grid(out=tmp_path)
    assert str(on_disk.rows) == str(in_memory.rows)  # NaN is not equal to itself; its text is
    assert len(made_up) == 2 * flown
    assert grid(out=tmp_path, runs=5).left == 0
    assert len(made_up) == 2 * flown + 4
    assert {"cells.json", "flights.csv", "tables.md"} <= {path.name for path in tmp_path.iterdir()}
    assert (tmp_path / "tables.md").read_text() == grid(out=tmp_path, runs=5).tables() + "\n"
    asked = grid(out=tmp_path, runs=7, workers=0)
    assert (asked.left, len(asked.landings)) == (8, 20)
    assert repr(asked).endswith(f"; 8 not flown, in {tmp_path}>")


def test_scenarios_and_pilots_may_be_objects(made_up):
    windy = load_scenario("near", wind={"mean_mps": 4.0}, name="windy")
    found = grid(pilot=[paper, horizon], settings=())
    assert [cell.pilot for cell in found.cells] == [
        "shipland.guidance.pilot:paper",
        "shipland.guidance.pilot:horizon",
    ]
    found = shipland.campaign([windy, "near"], settings=["time_limit_s=3"], runs=1, workers=1, progress=False)
    assert [cell.scenario for cell in found.cells] == ["windy", "near"]
    flown = made_up[-2].scenario
    assert flown == replace(windy, time_limit_s=3.0)
    with pytest.raises(ConfigError, match="two cells are called near_horizon and differ"):
        shipland.campaign(["near", replace(windy, name="near")])
    suite = shipland.load_suite("near")
    found = shipland.campaign(suite, runs=1, only="rig-natops*", workers=1, progress=False)
    assert {(cell.suite, cell.scenario) for cell in found.cells} == {(f"near {suite.version}", "rig-natops")}


def test_several_may_come_in_anything_that_gives_them_one_by_one(made_up):
    texts = ["wind.mean_mps=0,5", "time_limit_s=3"]
    found = grid(pilot=iter(["paper", "horizon"]), settings=iter(texts), only={"*"})
    assert str(found.rows) == str(grid(settings=texts).rows)
    assert [cell.pilot for cell in grid(pilot=np.array(["paper", "pid"]), settings=()).cells] == ["paper", "pid"]


def test_files_are_given_as_text_or_path(made_up, tmp_path):
    (tmp_path / "calm.toml").write_text("[wind]\nmean_mps = 0.5\n")
    (tmp_path / "salt").write_bytes(bytes(range(64, 96)))
    given = {"config": tmp_path / "calm.toml", "salt": tmp_path / "salt", "settings": (), "runs": 1}
    assert str(grid(**given | {name: str(given[name]) for name in ("config", "salt")}).rows) == str(grid(**given).rows)
    assert made_up[0].scenario.wind.mean_mps == 0.5


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"pilot": []}, "nothing to fly"),
        ({"pilot": None}, "None is none of the pilots; expected a name"),
        ({"vision": None}, "None is none of the visions"),
        (
            {"settings": ["wind.mean_mps=0", "wind.mean_mps=5"]},
            "wind.mean_mps is set 2 times; .*, as wind.mean_mps=A,B",
        ),
        ({"workers": -1}, "workers must be 0 or more"),
        ({"time_limit_s": -1.0}, "time_limit_s must be 0"),
        ({"first_seed": -1}, "a seed must be 0 or more"),
        ({"first_seed": 1.0}, "a seed must be a whole number"),
        ({"runs": 0}, "runs must be 1 or more"),
        ({"runs": 2.5}, "runs must be a whole number, got 2.5"),
        ({"workers": "2"}, "workers must be a whole number, got '2'"),
        ({"oracle_motions": 2.5}, "oracle_motions must be a whole number"),
        ({"oracle_motions": 1}, "oracle_motions must be 0, or 2 and more"),
        ({"settings": None}, "settings must be a text or several"),
        ({"only": 3}, "only must be a text or several"),
        ({"logs": True}, "logs are kept in a folder: give out"),
    ],
)
def test_an_argument_of_no_use_is_refused_in_words(made_up, wrong, words):
    with pytest.raises(ConfigError, match=words):
        grid(**wrong)
    with pytest.raises(ConfigError, match="nothing to fly"):
        shipland.campaign([])


def choosing(setup, pilot):
    return pilot(setup)


class Choosing:
    def __init__(self, pilot):
        self.pilot = pilot

    def __call__(self, setup):
        return self.pilot(setup)


def test_a_folder_takes_no_pilots_that_share_a_name(made_up, tmp_path):
    def within(setup):
        return paper(setup)

    for shared in (partial(choosing, pilot=paper), Choosing(paper), within, lambda setup: paper(setup)):
        with pytest.raises(ConfigError, match="is not the only one of that name, and a folder keeps rows by name"):
            grid(pilot=shared, out=tmp_path)
        assert len(grid(pilot=shared).rows) == 8  # without a folder they fly
    with pytest.raises(ConfigError, match="of the visions, is not the only one"):
        grid(vision=shipland.without_pictures(lambda _: None), out=tmp_path)


def test_pilots_and_campaigns_are_compared_seed_by_seed(made_up):
    both = grid()
    compared = both.compare()
    assert set(compared.pairings) == {(f"near_mean_mps={wind}", "paper, horizon") for wind in (0, 5)}
    assert "| near_mean_mps=5 | paper, horizon | 4 | 0 | 2 | 0.5 |" in repr(compared)
    one, two = grid(pilot="paper"), grid(pilot="horizon")
    assert [found.only_second for found in one.compare(two).pairings.values()] == [2, 2]
    assert [found.only_second for found in both.compare(both).pairings.values()] == [0, 0, 0, 0]
    with pytest.raises(ConfigError, match="one pilot flew"):
        one.compare()


def test_the_plot_shows_touchdowns_and_shares(made_up):
    found = grid()
    figure = found.plot()
    *pads, shares = figure.axes
    assert [axes.get_title("left").splitlines()[:2] for axes in pads] == [
        ["paper", "4 of 8 landed in the square"],
        ["horizon", "8 of 8 landed in the square"],
    ]
    touched = [np.vstack([np.asarray(drawn.get_offsets()) for drawn in axes.collections]) for axes in pads]
    assert [len(places) for places in touched] == [4, 8]
    assert touched[0][0].tolist() == [GOOD.starboard_m, GOOD.forward_m]
    low, high = share_interval(2, 4)
    assert list(shares.lines[0].get_xdata()) == [100 * low, 100 * high]
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_the_plot_shows_each_landing_area_by_itself(made_up):
    scenarios = [load_scenario("near"), load_scenario("near", **{"name": "wide", "rig.landing_square_m": 0.5})]
    *pads, _ = shipland.campaign(
        scenarios, pilot="horizon", runs=1, workers=1, progress=False, oracle_motions=0
    ).plot().axes  # fmt: skip
    assert [axes.patches[1].get_width() for axes in pads] == [0.35, 0.5]


def test_a_notebook_shows_cells_and_a_picture(made_up):
    shown = grid()._repr_html_()
    assert shown.startswith("<b>Campaign of 4 cells: 12 of 16 landed in the square")
    assert "<td>near_mean_mps=0_paper</td><td>2 of 4</td>" in shown
    assert "2 never steady over the deck" in shown
    picture = base64.b64decode(re.search('src="data:image/png;base64,([^"]+)"', shown).group(1))
    assert picture.startswith(b"\x89PNG")
    assert len(shown) < 200_000


def test_progress_is_told_before_the_first_flight_and_after_each(made_up):
    told = []
    grid(progress=lambda now: told.append((now.to_fly, now.flown, now.success)))
    assert told[0] == (16, 0, 0)
    assert told[-1] == (16, 16, 12)
    assert len(told) == 17


def test_the_usual_progress_names_flights_that_were_lost(made_up, monkeypatch, capsys):
    land = job.land_once

    def fails(flight):
        if flight.seed == 2:
            raise ValueError("[no] such thing")
        return land(flight)

    monkeypatch.setattr(job, "land_once", fails)
    found = grid(pilot="horizon", settings=(), progress=True)
    said = " ".join(capsys.readouterr().err.split())
    assert "1 cell, 4 of 4 flights to fly" in said
    assert "3 of 4 flown" in said
    assert "lost: near_horizon, seed 2: ValueError: [no] such thing" in said
    assert found.left == 1
    with pytest.raises(DataError, match=r"not one flight came to its end; near_horizon, seed 2: ValueError: \[no\]"):
        grid(pilot="horizon", settings=(), first_seed=2, runs=1)


SCRIPT = '''
import os
import shipland
from shipland.guidance.pilot import paper

print("the script runs")

class Own:
    """Flies as the paper's does, in whatever process."""
    def __init__(self, setup):
        self.inner = paper(setup)
    def decide(self, observation, telemetry, sent):
        with open(f"{os.getpid()}.flown", "w"):
            return self.inner.decide(observation, telemetry, sent)

def own(setup):
    return Own(setup)

options = {"settings": "time_limit_s=1", "runs": 4, "workers": 2, "progress": False, "oracle_motions": 0}
found = shipland.campaign("near", pilot=[own, "paper"], out=OUT, **options)
ours, theirs = ([landing.step_percent for landing in cell.landings] for cell in found.cells)
print(ours == theirs, len(set(ours)), found.cells[0].pilot)
'''


CHANGED = """
with open(__file__, "a") as file:
    file.write("# changed")
shipland.campaign("near", pilot=own, out="out", **options)
"""


@pytest.mark.slow
def test_a_script_without_a_guard_flies_its_own_pilot_in_two_processes(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT.replace("OUT", "'out'") + CHANGED)
    command = [sys.executable, "script.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout.splitlines() == ["the script runs", "True 4 __main__:own"], done.stderr
    # Of two processes one may have got no such flight; where nothing was compiled, a third has flown the first.
    assert len(list(tmp_path.glob("*.flown"))) in (1, 2, 3)
    assert re.search("DataError: out/.* holds landings of another own code", done.stderr)


@pytest.mark.slow
def test_a_prompt_flies_its_own_pilot_and_says_why_no_folder_can_hold_it(tmp_path):
    code = SCRIPT.replace("OUT", "None") + "shipland.campaign('near', pilot=own, out='out', **options)\n"
    done = subprocess.run([sys.executable, "-"], input=code, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout.splitlines() == ["the script runs", "True 4 __main__:own"], done.stderr
    assert "own is defined in a notebook or at a prompt" in done.stderr
    assert "give 'own:own', or give no folder" in done.stderr
