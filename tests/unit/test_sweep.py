"""Sweeps: every combination once; side by side and in pairs."""

from dataclasses import replace

import pytest
from test_campaign import GOOD, seeded

from shipland.config import setting
from shipland.errors import ConfigError
from shipland.evaluation.sweep import Cell, cells, comparison, sweep_table, text_of
from shipland.report.outputs import load_outputs
from shipland.report.sweep_plots import plot_sweep
from shipland.scenario.scenario import load_scenario, scenario_table

CHANGES = ("wind.mean_mps=0,3.5", "ship.motion=sea", "vision.hue=[35, 85]")


def test_every_combination_once():
    found = cells(CHANGES, ["paper", "horizon"])
    assert [cell.name for cell in found] == [
        "paper-wind.mean_mps=0", "paper-wind.mean_mps=3.5",
        "horizon-wind.mean_mps=0", "horizon-wind.mean_mps=3.5",
    ]  # fmt: skip
    scenario = load_scenario(scenario_table("near", None, found[1].changes))
    assert (scenario.wind.mean_mps, scenario.ship.motion, scenario.vision.hue) == (3.5, "sea", (35, 85))


def test_one_campaign_is_a_sweep_of_one():
    (cell,) = cells((), ["paper"])
    assert cell == Cell("paper", (), ())


def test_a_foreign_pilots_name_makes_a_folder():
    (cell,) = cells((), ["my.module:factory"])
    assert cell.name == "my.module_factory"


def test_a_pilot_twice_is_refused():
    with pytest.raises(ConfigError, match="different names"):
        cells((), ["paper", "paper"])


def test_side_by_side(tmp_path):
    missed = replace(seeded(GOOD, 2), in_square=False, forward_m=0.4)
    done = [(cell, [GOOD, missed] if "3.5" in cell.name else [GOOD]) for cell in cells(CHANGES, ["paper", "mine"])]
    rows = sweep_table(done, "square").splitlines()
    assert rows[0].startswith("| pilot | wind.mean_mps | in the square |")
    assert rows[3].startswith("| paper | 3.5 | 1 of 2 |")
    assert len(rows) == 6
    plot_sweep(tmp_path / "sweep.png", done, "made up", "square", load_outputs().plots)
    assert (tmp_path / "sweep.png").stat().st_size > 10_000


def test_pairs_are_the_seeds_that_both_flew():
    first = [seeded(GOOD, seed) for seed in range(1, 9)]
    second = [replace(seeded(GOOD, seed), in_square=False, forward_m=0.4) for seed in range(3, 12)]
    text = comparison(first, second, ("one", "two"))
    assert "6 seeds flown by both" in text
    assert "only one landed: 6; only two: 0" in text
    assert "p = 0.0312" in text  # 2 / 2⁶
    with pytest.raises(ConfigError, match="no seed in common"):
        comparison(first[:1], second, ("one", "two"))


@pytest.mark.parametrize("value", ["sea", "x, y", "5", "true", 5, 2.5, True, [1, 2], ["a", "b"]])
def test_the_text_of_a_value_reads_back(value):
    assert setting(f"a.key={text_of(value)}") == ("a.key", [value])
