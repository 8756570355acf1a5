"""Flights with spoiled data: no exception, no stick step beyond the slew bound, control regained within two seconds."""

import importlib.util
import sys
from pathlib import Path

import pytest

from shipland.missions.scenarios import load_scenario

_TOOL = Path(__file__).parents[2] / "tools" / "corrupted_flights.py"


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("corrupted_flights", _TOOL)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look themselves up there
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("first", [1, 11, 21, 31])
def test_spoiled_data_neither_stops_a_flight_nor_reaches_the_sticks(tool, first):
    scenario = load_scenario("rig-natops")
    outcomes = [tool.flown(scenario, "paper", seed) for seed in range(first, first + 10)]
    assert max(outcome.highest_percent for outcome in outcomes) <= 100.0
    assert max(outcome.over_slew_percent for outcome in outcomes) <= 1e-6
    regained_s = [t_s for outcome in outcomes for t_s in outcome.regained_s]
    assert len(regained_s) >= 3
    assert max(regained_s) <= 2.0
