"""Studies of landings: every TOML file can be flown, figures count, and who never touches gains nothing by it."""

from dataclasses import replace

import numpy as np
import pytest
from studies import ORDER, harness, landings
from test_campaign import GOOD, NOWHERE, seeded

from shipland.evaluation.folder import campaign_key
from shipland.scenario.scenario import load_scenario

NAMES = sorted(path.stem for path in harness.CAMPAIGNS.glob("*.toml"))


@pytest.mark.parametrize("name", NAMES)
def test_every_row_is_another_one_and_its_scenario_is_sound(name):
    study = harness.load(name)
    cells = landings.cells_of(harness.CAMPAIGNS / f"{name}.toml")
    assert name in ORDER
    assert len({tuple(case.items()) for case in study.cases()}) == len(cells)
    assert all(cell.case.keys() <= study.columns.keys() for cell in cells)
    cells[0].loaded()
    cells[-1].loaded()


def test_settings_without_a_column_name_the_row_and_words_are_the_fields(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(
        'question = "?"\nruns = 1\nminutes = 0\npilots = ["horizon"]\ncolumns.stick = ["aircraft.loop.kind", "stick"]\n'
        '[[cells]]\nscenarios = ["rig-natops"]\nset = ["aircraft.loop.kind=attitude,velocity", "wind.mean_mps=3"]\n'
    )
    cases = landings.landings_study(path).cases()
    assert [case["stick"] for case in cases] == ["tilt", "speed"]
    assert {case["settings"] for case in cases} == {"mean_mps=3"}


def test_figures_count_what_flights_came_to():
    tilted = replace(GOOD, landed=False, cause="tilt", reason="tilted 31° on the deck")
    beside = replace(GOOD, in_square=False, cause="control error")
    row = landings.figures(load_scenario("rig-natops"), [GOOD, beside, tilted, NOWHERE], 0)
    assert [row[name] for name in ("square", "landed", "outside", "never")] == [0.25, 0.5, 0.25, 0.25]
    assert row["bad"]["value"] == 0.25
    assert row["oracle_rate"] is None
    assert "1 tilt" in row["causes"]


def test_a_pair_tells_who_alone_lands():
    row = landings.compared([GOOD, GOOD], [GOOD, NOWHERE])
    assert (row["won"], row["lost"], row["square_beside"]) == (1, 0, 0.5)
    assert row["ratio"]["value"] == pytest.approx(np.sqrt(0.0025 / 0.25125), abs=0.01)


def test_who_never_touches_gains_nothing_by_it():
    far = replace(GOOD, in_square=False, cause="control error", forward_m=0.8, starboard_m=0.3)
    assert landings.squares_m2([GOOD, far, NOWHERE]) == pytest.approx([0.0025, 0.34, 0.5])


def test_a_row_that_was_stopped_resumes_with_the_missing_flight(tmp_path, monkeypatch):
    """Kept and counted anew it is the same; the flights are made up."""
    monkeypatch.setattr(landings, "PARTS", tmp_path)
    study, flown = harness.load("near_readings"), []
    case = study.cases()[0]

    def land(flight):
        if flown == [1]:
            flown.append(None)
            raise KeyboardInterrupt
        flown.append(flight.seed)
        return seeded(GOOD, flight.seed)

    monkeypatch.setattr(landings, "land_quietly", land)
    with pytest.raises(KeyboardInterrupt):
        study.measure(case, 2)
    row = study.measure(case, 2)
    assert flown == [1, None, 2]
    assert {**case, **row}.keys() <= study.columns.keys()
    assert row["flights"] == 2
    monkeypatch.setattr(landings, "PARTS", tmp_path / "anew")
    assert study.measure(case, 2) == row
    assert flown == [1, None, 2, 1, 2]


@pytest.mark.parametrize(("changed", "flown"), [((), [1, 11, 21]), ((11,), [1, 11, *range(2, 11), *range(12, 31)])])
def test_flights_of_earlier_code_are_taken_over_where_every_tenth_comes_out_the_same(
    tmp_path, monkeypatch, changed, flown
):
    scenario, sources, jobs = load_scenario("rig-natops"), iter("ab"), []

    def land(job):
        jobs.append(job.seed)
        landing = seeded(GOOD if job.seed % 3 else NOWHERE, job.seed)
        return replace(landing, time_s=99.0) if folder == "b" and job.seed in changed else landing

    monkeypatch.setattr(landings, "PARTS", tmp_path)
    monkeypatch.setattr(landings, "land_quietly", land)
    monkeypatch.setattr(landings, "campaign_key", lambda *what: campaign_key(*what) | {"source": folder})
    folder = next(sources)
    before = landings.fly(scenario, "horizon", "geometric", 30)
    folder, jobs = next(sources), []
    after = landings.fly(scenario, "horizon", "geometric", 30)
    assert jobs == (flown if changed else [*flown, 1])  # the last for what it imports
    assert [it.seed for it in after if str(it) != str(before[it.seed - 1])] == list(changed)


def test_a_take_over_that_was_interrupted_goes_on(tmp_path, monkeypatch):
    """What is kept of the sample is compared as it is, and only the rest of the sample is flown."""
    scenario, jobs = load_scenario("rig-natops"), []

    def land(job):
        if job.seed == stopped_at:
            raise KeyboardInterrupt
        jobs.append(job.seed)
        return seeded(GOOD, job.seed)

    monkeypatch.setattr(landings, "PARTS", tmp_path)
    monkeypatch.setattr(landings, "land_quietly", land)
    monkeypatch.setattr(landings, "campaign_key", lambda *what: campaign_key(*what) | {"source": folder})
    folder, stopped_at = "a", None
    before = landings.fly(scenario, "horizon", "geometric", 30)
    folder, stopped_at, jobs = "b", 11, []
    with pytest.raises(KeyboardInterrupt):
        landings.fly(scenario, "horizon", "geometric", 30)
    stopped_at = None
    assert landings.fly(scenario, "horizon", "geometric", 30) == before
    assert jobs == [1, 11, 21, 1]  # the last for what it imports
