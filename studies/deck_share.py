"""How much of the bar's wave motion the deck's centre has, on a ship that carries its bar level over a deck that rolls.

The bar stands above the deck, so a roll moves it farther. Along the ship's axes: the standard deviations of the point
that the bar defines and of the deck's centre, the share of the first that is best followed, and what is left.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shipland.scenario.autonomy import drawn_ship
from shipland.scenario.scenario import load_scenario
from studies.harness import Case, Column, Row, Study

SCENARIOS = ("ship-natops", "ship-sea5", "ship-sea6")
AXES = ("forward", "starboard", "down")
TIMES_S = np.arange(0.0, 60.0, 0.1)


def cases() -> Sequence[Case]:
    """Ships that carry their bar."""
    return [{"scenario": name} for name in SCENARIOS]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` motions of a minute; a row an axis."""
    scenario, shown, centres = load_scenario(str(case["scenario"])), [], []
    for seed in range(runs):
        ship = drawn_ship(scenario, seed)
        for at in map(ship.at, TIMES_S.tolist()):
            to_ship = at.ned_from_ship.inverse()
            shown.append((to_ship @ at.ned_from_bar).apply(scenario.rig.deck_in_bar_m))
            centres.append((to_ship @ at.ned_from_deck).translation_m)
    rows = []
    for axis, bar, deck in zip(AXES, np.array(shown).T, np.array(centres).T, strict=True):
        share = float(bar @ deck / (bar @ bar))
        sizes_m = [float(np.std(some)) for some in (bar, deck, deck - bar, deck - share * bar)]
        names = ("bar_m", "deck_m", "apart_m", "left_m")
        rows.append({"axis": axis, **dict(zip(names, sizes_m, strict=True)), "share": share})
    return rows


STUDY = Study(
    question="How much of the bar's wave motion does the deck's centre have?",
    columns={
        "scenario": Column("scenario"),
        "axis": Column("along"),
        "bar_m": Column("bar's point [cm]", ".1f", 100.0),
        "deck_m": Column("deck's centre [cm]", ".1f", 100.0),
        "apart_m": Column("apart [cm]", ".1f", 100.0),
        "share": Column("best share", ".2f"),
        "left_m": Column("left [cm]", ".1f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=16,
    measured=("frames.py", "rig.py", "scenario/autonomy.py", "sim/ship"),
    minutes=1,
)
