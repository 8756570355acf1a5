"""What `tools/hazards.py` says of flights into hazards: what they touched, and whether a climb had avoided it."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from shipland.evaluation.campaign import CampaignPlan, land_quietly, open_campaign, processes, read_cells
from shipland.evaluation.job import FlightJob
from shipland.evaluation.suite import Overrides, SuiteEntry, cells_of
from shipland.scenario.scenario import load_scenario

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))

from fault_causes import Failed
from hazards import climbs_clear, outcome_of, table_of


@pytest.mark.parametrize(
    ("landed", "in_square", "reason", "cause", "kind", "words"),
    [
        (True, True, "landed in the square", "", "in the square", ""),
        (True, False, "landed outside the square", "control error", "outside", ""),
        (False, True, "tilted 31° on the deck", "tilt", "beyond a limit", "tilt"),
        (False, False, "fell into the sea", "fell into the sea", "struck", "fell into the sea"),
        (
            False,
            False,
            "no touchdown: time limit of 9 s",
            "landings broken off",
            "never touched",
            "landings broken off",
        ),
    ],
)
def test_a_flight_comes_to_one_of_five_ends(landed, in_square, reason, cause, kind, words):
    outcome = outcome_of(SimpleNamespace(landed=landed, in_square=in_square, reason=reason, cause=cause))
    assert (outcome.kind, outcome.words) == (kind, words)


def test_the_latest_climb_that_avoids_a_bad_contact_is_found():
    start = {"distance_m": 0.5, "distance_half_range_m": 0.0, "height_m": 1.0, "height_half_range_m": 0.0}
    every_landing_too_hard = {"max_descent_mps": 0.01}
    scenario = load_scenario("rig-natops", verdict=every_landing_too_hard, start=start, ship={"motion": "still"})
    failed = Failed("", scenario, "horizon", "geometric", land_quietly(FlightJob(scenario, "horizon", "geometric", 1)))
    assert outcome_of(failed.landing).kind == "beyond a limit"
    assert climbs_clear(failed) in (0.5, 1.0, 2.0)  # a climb from before the end of the descent


def test_a_row_a_cell_counts_flights_and_gives_the_last_word_of_those_that_never_touched(tmp_path):
    entry = SuiteEntry(("rig-natops",), ("time_limit_s=2",))
    plan = CampaignPlan(cells_of([entry], Overrides(("horizon",))), range(1, 3), tmp_path, "made-up 1")
    with open_campaign(plan) as bench:
        assert len(list(bench.fly(processes(1)))) == 2
    (row,) = table_of(read_cells([tmp_path]), None)[2:]
    parts = [part.strip() for part in row.strip("| ").split("|")]
    assert parts[:8] == ["rig-natops", "time_limit_s=2", "2", "0", "0", "0", "0", "0–84 %"]
    assert parts[8] == "2 (2 never steady over the deck)"
    assert parts[9]
