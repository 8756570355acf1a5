"""The probability of a landing that the pilot gives as its final descent begins, against the share that landed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipland.scenario.scenario import load_scenario
from studies.harness import Case, Column, Row, Study, share
from studies.landings import fly

BANDS = 3
"""Rows of a case: its landings in order of what was said, in equal parts."""
STICKS = {"tilt": "attitude", "speed": "velocity"}


def cases() -> Sequence[Case]:
    """Scenario, what a stick means, mean wind."""
    return [
        {"scenario": scenario, "stick": stick, "wind": wind}
        for scenario in ("rig-natops", "ship-sea6")
        for stick in STICKS
        for wind in (5.0, 9.0)
    ]


def measure(case: Case, runs: int) -> list[Row]:
    """Fly a case, seeds 1 … runs."""
    loop = {"aircraft.loop.kind": STICKS[str(case["stick"])], "wind.mean_mps": case["wind"]}
    landings = fly(load_scenario(str(case["scenario"]), **loop), "horizon", "geometric", runs)
    told = [(it.landing_probability, it.success) for it in landings if it.landing_probability is not None]
    parts = np.array_split(np.array(sorted(told), dtype=float).reshape(-1, 2), BANDS)
    return [
        {
            "band": index + 1,
            "flights": len(part),
            "said": float(part[:, 0].mean()),
            "landed": share(int(part[:, 1].sum()), len(part)),
        }
        for index, part in enumerate(parts)
        if len(part)
    ]


def picture(rows: Sequence[Row], path: Path) -> None:
    """What landed over what was said."""
    from shipland.figures import drawn
    from shipland.report.palette import BLUE, GREEN, ORANGE, VERMILION, unit

    colours = {("tilt", 5.0): BLUE, ("tilt", 9.0): VERMILION, ("speed", 5.0): GREEN, ("speed", 9.0): ORANGE}
    with drawn(path, (10.0, 4.8), 110) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, scenario in zip(panels, ("rig-natops", "ship-sea6"), strict=True):
            axes.plot([0.0, 100.0], [0.0, 100.0], color="0.6", linewidth=0.8)
            for (stick, wind), colour in colours.items():
                mine = [it for it in rows if (it["scenario"], it["stick"], it["wind"]) == (scenario, stick, wind)]
                said = [100.0 * it["said"] for it in mine]
                landed = np.array([[100.0 * it["landed"][key] for key in ("value", "low", "high")] for it in mine])
                if len(mine):
                    off = [landed[:, 0] - landed[:, 1], landed[:, 2] - landed[:, 0]]
                    label = f"{stick} sticks, {wind:g} m/s"
                    axes.errorbar(said, landed[:, 0], off, color=unit(colour), marker="o", markersize=4, label=label)
            axes.set(
                title=scenario, xlabel="said as the final descent began [%]", xlim=(30.0, 101.0), ylim=(30.0, 101.0)
            )
            axes.legend(loc="lower right")
        panels[0].set_ylabel("landed in the square [%]")


STUDY = Study(
    question="Does the pilot know its odds?",
    columns={
        "scenario": Column("scenario"),
        "stick": Column("sticks mean"),
        "wind": Column("wind [m/s]", "g"),
        "band": Column("third", "d"),
        "flights": Column("flights", ",d"),
        "said": Column("said [%]", ".0f", 100.0),
        "landed": Column("landed in the square [%] (95 % interval)", ".0f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=50,
    minutes=7,
    picture=picture,
)
