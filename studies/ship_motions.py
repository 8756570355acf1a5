"""How large the ship's motions are: significant single amplitudes at full scale, and on the rig, limits included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from shipland.report.motion import DEGREES, HEADINGS, TIME_RULES, UNITS, statistics
from shipland.scenario.scenario import load_scenario
from shipland.sim.ship.deck_motion import DOF_NAMES
from shipland.sim.ship.sea import significant_amplitude
from studies.harness import Case, Column, Row, Study

REFERENCE = {
    "60° off the stern": (1.38, 2.01, 2.79, 11.5, 2.27, 1.40),
    "60° off the bow": (0.67, 1.73, 2.79, 8.8, 2.43, 1.06),
}
"""Of the same ship by another program, with another hull, in sea state 6 [m, °]."""
REFERENCE_STATE = 6
RECORD_S = 1800.0


def cases() -> Sequence[Case]:
    """Sea states, and where the waves come from."""
    return [{"sea_state": state, "waves": name} for state, name in product((3, 4, 5, 6), HEADINGS.values())]


def measure(case: Case, _runs: int) -> list[Row]:
    """A row a degree of freedom, the rig's of a record of half an hour."""
    state, waves = int(case["sea_state"]), str(case["waves"])
    from_deg = next(deg for deg, name in HEADINGS.items() if name == waves)
    sea = {"sea_state": state, "waves_from_deg": from_deg}
    scenario = load_scenario("near", ship={"motion": "sea", "sea": sea})
    ship = scenario.ship
    amplitudes = significant_amplitude(ship.sea) * DEGREES
    of_rig = []
    for rule in TIME_RULES:
        timed = replace(ship, scale=replace(ship.scale, time=rule))
        found = statistics(replace(scenario, ship=timed), 1, RECORD_S)
        of_rig.append([f"{each.significant:.3g} / {each.period_s:.1f} s" for each in found])
    rows: list[Row] = []
    for index, (name, unit) in enumerate(zip(DOF_NAMES, UNITS, strict=True)):
        reference = REFERENCE[waves][index] if state == REFERENCE_STATE else None
        ratio = None if reference is None else float(amplitudes[index]) / reference
        rig = {rule: cells[index] for rule, cells in zip(TIME_RULES, of_rig, strict=True)}
        full = float(np.round(amplitudes[index], 4))
        rows.append({"motion": f"{name} [{unit}]", "full": full, "reference": reference, "ratio": ratio, **rig})
    return rows


STUDY = Study(
    question="How large are the ship's motions?",
    columns={
        "sea_state": Column("sea state", "d"),
        "waves": Column("waves from"),
        "motion": Column("motion"),
        "full": Column("full scale", ".2f"),
        "reference": Column("reference", ".2f"),
        "ratio": Column("ratio", ".2f"),
        "froude": Column("rig, Froude: amplitude / period"),
        "length_only": Column("rig, lengths only"),
    },
    cases=cases,
    measure=measure,
    runs=1,
    minutes=1,
)
