"""How much wind over deck, from where, does a landing bear? Two operating envelopes, direction by direction.

The rig at NATOPS limits, and octo25 on the frigate under way in sea state 5. Flights go where the border of 90 % is, as
`shipland envelope` has it. Every flight is kept in out/studies/envelope, so that a stopped study resumes within a
direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shipland.envelopes import bases_of, fly_envelopes
from shipland.evaluation.envelope import EnvelopeGrid
from shipland.evaluation.folder import source_digest
from shipland.evaluation.suite import Overrides, SuiteEntry
from studies.harness import PARTS, Case, Column, Row, Study

WINDS_KN: dict[str, tuple[float, ...]] = {
    "rig-natops": (3.0, 6.0, 9.0, 12.0, 15.0, 18.0, 21.0, 24.0, 27.0),
    "frigate-sea5": (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0),
}
DIRECTIONS_DEG = tuple(range(0, 360, 30))
RATE, MOST, FINEST_KN = 0.9, 3, 2.5
"""Wanted share; of a cell on the border so many times the flights of the others; finest step of speed."""


def cases() -> Sequence[Case]:
    """Directions of each ship."""
    return [{"scenario": name, "off_bow_deg": float(each)} for name in WINDS_KN for each in DIRECTIONS_DEG]


def measure(case: Case, runs: int) -> Sequence[Row]:
    """The cells of a direction, by speed."""
    name, direction = str(case["scenario"]), float(case["off_bow_deg"])
    grid = EnvelopeGrid(WINDS_KN[name], (direction,), RATE, runs, MOST * runs, FINEST_KN)
    bases = bases_of(SuiteEntry((name,)), Overrides(("horizon",)))
    out = PARTS / "envelope" / source_digest() / f"{name}-{direction:03.0f}"
    (found,) = fly_envelopes(bases, grid, workers=1, out=out, progress=False).envelopes
    border_kn, bound = found.borders[direction]
    border = {"border_kn": border_kn, "bound": bound}
    words = {"border": f"{bound} {border_kn:.1f}".strip()}
    return [dict(row) | border | words for row in found.rows]


def picture(rows: Sequence[Row], path: Path) -> None:
    """Both polar diagrams."""
    from shipland.figures import save_figure
    from shipland.report.envelope import Panel, draw_envelopes

    panels = []
    for name in WINDS_KN:
        mine: list[dict[str, Any]] = [dict(row) for row in rows if row["scenario"] == name]
        borders = {row["off_bow_deg"]: (row["border_kn"], row["bound"]) for row in mine}
        panels.append(Panel(f"{name}, pilot horizon", mine, borders))
    save_figure(draw_envelopes(panels, RATE), path, 110)


STUDY = Study(
    question="How much wind over deck, from where, does a landing bear?",
    columns={
        "scenario": Column("scenario"),
        "off_bow_deg": Column("wind from [°]", "03.0f"),
        "wind_kn": Column("over deck [kn]", "g"),
        "flights": Column("flights", "d"),
        "success": Column("landed [%] (95 % interval)", ".0f", 100.0),
        "rating": Column("rating", "d"),
        "outside": Column("outside", "d"),
        "bad": Column("bad contact", "d"),
        "refused": Column("never touched", "d"),
        "wave_offs": Column("waved off", "d"),
        "sink_mps_90": Column("sink, 90 % [m/s]", ".2f"),
        "slide_mps_90": Column("drift, 90 % [m/s]", ".2f"),
        "tilt_deg_90": Column("tilt, 90 % [°]", ".0f"),
        "beyond_natops": Column("deck beyond NATOPS'", "d"),
        "border": Column("border [kn]"),
        "causes": Column("causes of the others"),
    },
    cases=cases,
    measure=measure,
    runs=6,
    minutes=60,
    picture=picture,
)
