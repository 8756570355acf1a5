"""Sweeps: every combination once; side by side and in pairs."""

from dataclasses import replace

import pytest
from test_campaign import GOOD, seeded

from shipland.commands.options import names_of
from shipland.config import setting
from shipland.errors import ConfigError
from shipland.evaluation.suite import Overrides, SuiteEntry, cells_of, combinations, text_of
from shipland.evaluation.tables import comparison
from shipland.scenario.scenario import load_scenario, scenario_table

CHANGES = ("wind.mean_mps=0,3.5", "ship.motion=sea", "vision.hue=[35, 85]")


def test_every_combination_once():
    found = combinations(CHANGES)
    assert [chosen[0] for chosen in found] == [("wind.mean_mps", "0"), ("wind.mean_mps", "3.5")]
    scenario = load_scenario(scenario_table("near", None, [f"{key}={value}" for key, value in found[1]]))
    assert (scenario.wind.mean_mps, scenario.ship.motion, scenario.vision.hue) == (3.5, "sea", (35, 85))


def test_without_changes_there_is_one():
    assert combinations(()) == [()]


def test_equal_values_are_one_and_a_missing_one_is_said():
    assert combinations(["wind.mean_mps=1,1.0,2,1"]) == [(("wind.mean_mps", "1"),), (("wind.mean_mps", "2"),)]
    assert combinations(['name="","a"']) == [(("name", '""'),), (("name", "a"),)]
    for text in ("wind.mean_mps=1,,2", "wind.mean_mps=,1"):
        with pytest.raises(ConfigError, match="a value is missing between the commas"):
            combinations([text])


def test_a_foreign_pilots_name_makes_a_folder():
    (cell,) = cells_of([SuiteEntry(("near",))], Overrides(("statistics:mean",)))
    assert cell.name == "near_statistics.mean"


def test_a_name_twice_is_refused():
    for text in ("paper,paper", "paper,", ""):
        with pytest.raises(ConfigError, match="different names"):
            names_of("pilot", text)


def test_pairs_are_the_seeds_that_both_flew():
    first = [seeded(GOOD, seed) for seed in range(1, 9)]
    second = [replace(seeded(GOOD, seed), in_square=False, forward_m=0.4) for seed in range(3, 12)]
    text = comparison(first, second, ("one", "two"))
    assert "6 seeds flown by both" in text
    assert "landed there by one alone: 6, by two alone: 0" in text
    assert "p = 0.0312" in text  # 2 / 2⁶
    with pytest.raises(ConfigError, match="no seed in common"):
        comparison(first[:1], second, ("one", "two"))


@pytest.mark.parametrize("value", ["sea", "x, y", "5", "true", 5, 2.5, True, [1, 2], ["a", "b"]])
def test_the_text_of_a_value_reads_back(value):
    assert setting(f"a.key={text_of(value)}") == ("a.key", [value])
