"""What 9 m/s of wind means, by how it is read: the mean at the hover that is flown for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scipy.optimize import brentq

from shipland.scenario.scenario import load_scenario
from shipland.sim.wind import WindReadings
from studies.harness import Case, Column, Row, Study

SAID_MPS = 9.0
SCENARIOS = {"land": "rig-natops", "sea": "ship-sea6"}
READINGS = {"the mean at the hover": "mean_mps", "the mean at 10 m": "mean_10m_mps", "the gusts": "gust_mps"}


def cases() -> Sequence[Case]:
    """Surfaces and readings."""
    return [{"surface": surface, "reading": reading} for surface in SCENARIOS for reading in READINGS]


def measure(case: Case, _runs: int) -> Row:
    """The wind whose reading is 9 m/s, in all three."""
    scenario = load_scenario(SCENARIOS[str(case["surface"])])
    height_m = scenario.rig.deck_height_m + scenario.guidance.approach.hover_height_m

    def read(mean_mps: float) -> WindReadings:
        return replace(scenario.wind, mean_mps=mean_mps).readings_at(height_m)

    read_as = READINGS[str(case["reading"])]
    return vars(read(brentq(lambda mean_mps: getattr(read(mean_mps), read_as) - SAID_MPS, 1.0, 2.0 * SAID_MPS)))


STUDY = Study(
    question="What can 9 m/s of wind mean?",
    columns={
        "surface": Column("over"),
        "reading": Column("9 m/s is"),
        "mean_mps": Column("mean at the hover [m/s]", ".1f"),
        "mean_10m_mps": Column("mean at 10 m [m/s]", ".1f"),
        "gust_mps": Column("gusts to [m/s]", ".1f"),
    },
    cases=cases,
    measure=measure,
    runs=1,
    minutes=0.1,
)
