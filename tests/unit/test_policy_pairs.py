"""What `tools/policy_pairs.py` says of a learned policy beside `horizon`."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_campaign import GOOD, NOWHERE, seeded

from shipland.evaluation.campaign import CellResult
from shipland.evaluation.suite import Overrides, SuiteEntry, cells_of

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))

from policy_pairs import squares_m2, table_of


def cells(changes, **landings):
    """A cell for each pilot, with the landings that it made."""
    entries = (SuiteEntry(("rig-natops",), ("wind.mean_mps=9", *changes)),)
    for cell in cells_of(entries, Overrides(tuple(landings))):
        flown = tuple(seeded(it, seed) for seed, it in enumerate(landings[cell.pilot], 1))
        yield CellResult(
            cell.name, cell.group, "", cell.pilot, cell.vision, cell.settings, "rig-natops", cell.scenario.rig,
            cell.scenario.ship, cell.scenario.aircraft.airframe, flown, Path(),
        )  # fmt: skip


def test_who_never_touches_gains_nothing_by_it():
    far = replace(GOOD, in_square=False, cause="control error", forward_m=0.8, starboard_m=0.3)
    assert squares_m2([GOOD, far, NOWHERE]) == pytest.approx([0.0025, 0.34, 0.5])


def test_pairs_are_those_of_one_scenario_and_wind_whatever_the_policy_is_called():
    ours, policy = cells((), horizon=[GOOD, NOWHERE], residual=[GOOD, GOOD])
    (other,) = cells(("guidance.learned.residual=direct",), residual=[NOWHERE, GOOD])
    (alone,) = cells(("wind.surface=sea",), residual=[GOOD, GOOD])
    _, _, *lines = table_of([ours, policy, other, alone])
    fields = [[part.strip() for part in line.strip("| ").split("|")] for line in lines]
    assert [row[0] for row in fields] == ["rig-natops, mean_mps 9"] * 2
    assert [row[1] for row in fields] == ["residual", "residual direct"]
    assert [row[6:8] for row in fields] == [["1 → 2", "1, 0"], ["1 → 1", "1, 1"]]
    assert float(fields[0][4]) == pytest.approx(5.0)
    assert float(fields[0][5].split()[0]) == pytest.approx(np.sqrt(0.0025 / 0.25125), abs=0.01)
