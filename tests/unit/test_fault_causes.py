"""What `tools/fault_causes.py` says of a faulted flight: which fault it failed by, and whether a climb had helped."""

import pytest
from fault_causes import Failed, failed_in, row_of

from shipland.evaluation.job import FlightJob, land_quietly
from shipland.scenario.faults import faults_of
from shipland.scenario.scenario import load_scenario

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def failed():
    """A flight whose process stands still just before contact."""
    scenario = load_scenario("rig-natops", fault_draw={"kinds": ["process_stall"]})
    return Failed(
        "a cell", scenario, "horizon", "geometric", land_quietly(FlightJob(scenario, "horizon", "geometric", 138))
    )


def test_the_fault_without_which_it_lands_is_named_and_no_decision_could_have_helped(failed):
    assert failed.is_hit
    cell, seed, _, _, hit, lands_without, safe = (part.strip() for part in row_of(failed).strip("| ").split("|"))
    assert (cell, seed, hit, lands_without) == ("a cell", "138", "yes", "process_stall")
    assert safe.startswith("none: ")


def test_a_climb_in_time_touches_nothing(failed):
    faults = faults_of(failed.scenario, failed.landing.seed)
    assert failed.flown_again(faults, climbs_from_s=13.0).reason.startswith("no touchdown")


def test_a_folder_without_a_bench_has_no_failed_flights(tmp_path):
    assert failed_in(tmp_path) == []
