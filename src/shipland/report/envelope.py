"""An operating envelope on paper: the polar diagram, a short table, and all of it as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from shipland.evaluation.envelope import KNOT_MPS, NATOPS_PITCH_DEG, NATOPS_ROLL_DEG, RATINGS, Envelope
from shipland.evaluation.tables import markdown
from shipland.figures import save_figure, styled
from shipland.files import json_bytes, write_atomically
from shipland.report.palette import VERMILION, unit
from shipland.scenario.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NO_RELEASE = (
    "From simulation. No release document: no navy's authority stands behind it, and no aircraft may be cleared by it."
)
_REFUSED = 0.1
"""Share of flights that never touched the deck from which a cell is hatched."""
_SHARES = (0.0, 0.25, 0.5, 0.75, 0.9, 0.95, 1.0)
"""Edges of the colours."""


def limits_of(scenario: Scenario) -> list[dict[str, Any]]:
    """What the flights are held against, each with its value and source; None where no public number was found."""
    limits, chosen = scenario.verdict, "`[verdict]` of the scenario; no public standard sets one for such a drone"
    drop = f"{chosen}. A fall from 8 inches, the least drop of a gear's test (14 CFR 29.725(a)), ends at 2.0 m/s"
    natops = (
        "NATOPS manual, Helicopter operating procedures for air-capable ships (NAVAIR, 2003), for an FFG-7, as quoted "
        "by [Lee2022]; counted at contact, in no landing rate"
    )
    return [
        {"what": "sink at contact [m/s]", "limit": limits.max_descent_mps, "source": drop},
        {"what": "drift over the deck at contact [m/s]", "limit": limits.max_drift_mps, "source": chosen},
        {"what": "tilt against the deck [°]", "limit": limits.max_tilt_deg, "source": chosen},
        {"what": "slip before rest [m]", "limit": limits.max_slip_m, "source": chosen},
        {"what": "roll of the deck [°]", "limit": NATOPS_ROLL_DEG, "source": natops},
        {"what": "pitch of the deck [°]", "limit": NATOPS_PITCH_DEG, "source": natops},
        {"what": "STANAG 4154 (ANEP-4154), the ship's motions", "limit": None,
         "source": "its text is not public, and no public statement that we found quotes a number with its place; the "
         "deck's motions are given as its significant amplitudes, to be held against one's own copy"},
    ]  # fmt: skip


def write_envelopes(out: Path, envelopes: Sequence[Envelope], command: str, picture: bool) -> str:
    """Write envelope.json, envelope.md and, with `picture`, envelope.png; the text of envelope.md, or a DataError."""
    table = {"note": NO_RELEASE, "command": command, "ratings": RATINGS, "envelopes": list(map(_table, envelopes))}
    write_atomically(out / "envelope.json", json_bytes(table))
    pages = [f"**{NO_RELEASE}**"]
    if picture:
        panels = [Panel(title_of(it), it.rows, it.borders) for it in envelopes]
        save_figure(draw_envelopes(panels, envelopes[0].rate), out / "envelope.png", 160)
        pages.append("![Polar diagrams](envelope.png)")
    pages += ["\n".join(_page(it)) for it in envelopes]
    text = "\n\n".join(pages) + "\n"
    write_atomically(out / "envelope.md", text.encode())
    return text


def _table(envelope: Envelope) -> dict[str, Any]:
    return {
        "name": envelope.name,
        "scenario": envelope.scenario.name,
        "pilot": envelope.pilot,
        "aircraft_kg": envelope.scenario.aircraft.airframe.mass_kg,
        "ship_kn": envelope.ship_mps / KNOT_MPS,
        "wind_height_m": _height_m(envelope.scenario),
        "deck_significant": dict(envelope.deck),
        "rate": envelope.rate,
        "limits": limits_of(envelope.scenario),
        "borders": [
            {"off_bow_deg": direction, "wind_kn": round(wind_kn, 1), "bound": bound}
            for direction, (wind_kn, bound) in sorted(envelope.borders.items())
        ],
        "cells": envelope.rows,
    }


def _height_m(scenario: Scenario) -> float | None:
    return scenario.wind.reference_height_m if scenario.wind.profile == "log" else None


def title_of(envelope: Envelope) -> str:
    """Ship, aircraft and pilot in a line."""
    scenario, speed_kn = envelope.scenario, envelope.ship_mps / KNOT_MPS
    waves = ""
    if scenario.ship.motion == "sea":
        waves = f", sea state {scenario.ship.sea.sea_state} from {scenario.ship.sea.waves_from_deg:g}°"
    mass = scenario.aircraft.airframe.mass_kg
    going = f"ship at {speed_kn:.0f} kn" if speed_kn else "ship lies still"
    return f"{scenario.name}: {mass:g} kg, pilot {envelope.pilot}, {going}{waves}"


def _page(envelope: Envelope) -> Iterator[str]:
    deck, rows, height_m = envelope.deck, envelope.rows, _height_m(envelope.scenario)
    yield f"## {title_of(envelope)}\n"
    height = "the same at every height" if height_m is None else f"at {height_m:g} m over the surface"
    yield (
        f"{len(rows)} cells, {sum(row['flights'] for row in rows)} flights. Wind over deck: {height}, direction that "
        f"it comes from, clockwise off the bow. The border: where the share of flights that land falls below "
        f"{100 * envelope.rate:g} %. The deck, significant single amplitudes: roll {deck['roll_deg']:.1f}°, pitch "
        f"{deck['pitch_deg']:.1f}°, vertical speed {deck['vertical_mps']:.2f} m/s.\n"
    )
    borders = [
        [f"{direction:03.0f}", f"{bound} {wind_kn:.1f}".lstrip(), f"{bound} {wind_kn * KNOT_MPS:.1f}".lstrip()]
        for direction, (wind_kn, bound) in sorted(envelope.borders.items())
    ]
    yield markdown(("wind from [°]", "border [kn]", "[m/s]"), borders, left=()) + "\n"
    yield _cells_table(rows)
    limits = [(it["what"], _number(it["limit"], "g"), it["source"]) for it in limits_of(envelope.scenario)]
    yield "\n" + markdown(("limit", "value", "source"), limits, ("limit", "source"))
    yield "\n" + markdown(("rating", "meaning"), RATINGS.items(), ("meaning",))


def _cells_table(rows: Sequence[Mapping[str, Any]]) -> str:
    head = ("from [°]", "over deck [kn]", "flights", "landed in the area [%] (95 %)", "rating", "outside", "bad",
            "refused", "waved off", "sink, 90 % [m/s]", "drift, 90 % [m/s]", "tilt, 90 % [°]", "deck beyond NATOPS'",
            "causes")  # fmt: skip
    cells = []
    for row in rows:
        low, share, high = (100 * row["success"][name] for name in ("low", "value", "high"))
        counts = [row[name] for name in ("rating", "outside", "bad", "refused", "wave_offs")]
        forms = {"sink_mps_90": ".2f", "slide_mps_90": ".2f", "tilt_deg_90": ".0f"}
        worst = [_number(row[name], form) for name, form in forms.items()]
        place = [f"{row['off_bow_deg']:03.0f}", f"{row['wind_kn']:g}", row["flights"]]
        shares = f"{share:.0f} ({low:.0f}–{high:.0f})"
        cells.append([*place, shares, *counts, *worst, row["beyond_natops"], row["causes"]])
    return markdown(head, cells, left=("causes",))


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


class Panel(NamedTuple):
    """One polar diagram: its borders as of `Envelope`.

    Its rows are cells, with at least `off_bow_deg`, `wind_kn`, `success`, `rating`, `refused`, `flights`.
    """

    title: str
    rows: Sequence[Mapping[str, Any]]
    borders: Mapping[float, tuple[float, str]]


def draw_envelopes(panels: Sequence[Panel], rate: float) -> Figure:
    """Polar diagrams: bow up, wind over deck where it comes from, knots on the radius with m/s beside them."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    across, down = min(2, len(panels)), math.ceil(len(panels) / min(2, len(panels)))
    with styled((7.6 * across, 8.2 * down + 1.4), grid=False) as figure:
        scale = ScalarMappable(BoundaryNorm(_SHARES, 256), "cividis")
        places = [figure.add_subplot(down, across, at, projection="polar") for at in range(1, len(panels) + 1)]
        for axes, panel in zip(places, panels, strict=True):
            _draw_polar(axes, panel, scale)
        entries = [
            Line2D([], [], color=unit(VERMILION), lw=2.2, label=f"{100 * rate:g} % land; dotted: at the grid's edge"),
            Patch(fc="none", ec="black", hatch="////", label="one in ten or more never touched the deck"),
            Line2D([], [], color="none", marker="$3$", mfc="black", mec="none", label="rating, 1–3 acceptable"),
        ]
        bar = figure.colorbar(scale, ax=places, orientation="horizontal", shrink=0.6 / across, pad=0.03, aspect=40)
        bar.set_ticks(_SHARES, labels=[f"{100 * share:.0f}" for share in _SHARES])
        bar.set_label("flights that landed [%]")
        words = f"Wind over deck, where it comes from, bow up. {NO_RELEASE.partition(':')[0]}."
        figure.legend(handles=entries, loc="outside lower center", ncols=3, fontsize=8.0, title=words)
    return figure


def _draw_polar(axes: Any, panel: Panel, scale: Any) -> None:  # noqa: ANN401
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    directions = sorted({row["off_bow_deg"] for row in panel.rows})
    for direction, (left, right) in zip(directions, _sectors(directions), strict=True):
        ray = sorted((row for row in panel.rows if row["off_bow_deg"] == direction), key=lambda row: row["wind_kn"])
        for row, (inner, outer) in zip(ray, _rings([row["wind_kn"] for row in ray]), strict=True):
            share, angle = row["success"]["value"], math.radians(direction)
            colour = scale.to_rgba(min(share, 0.999))
            axes.bar(
                angle, outer - inner, math.radians(right - left), inner, color=colour, lw=0.6, edgecolor="white",
                hatch="////" if row["refused"] >= _REFUSED * row["flights"] else None,
            )  # fmt: skip
            axes.text(
                angle, 0.5 * (inner + outer), str(row["rating"]), ha="center", va="center", fontsize=8.0,
                color="black" if share > 0.6 else "white", bbox={"fc": colour, "ec": "none", "pad": 0.6},
            )  # fmt: skip
    _draw_border(axes, directions, panel.borders)
    most_kn = max(outer for _, outer in _rings(sorted({row["wind_kn"] for row in panel.rows})))
    rings = np.arange(5.0, most_kn - 1.0, 5.0 if most_kn <= 30.0 else 10.0)
    axes.set_ylim(0.0, most_kn)
    axes.set_yticks(rings, [])
    for ring in rings:
        axes.text(
            math.radians(15.0), ring, f"{ring:g} kn\n{ring * KNOT_MPS:.1f} m/s", fontsize=6.0, ha="center", va="center",
            bbox={"fc": "white", "ec": "none", "pad": 0.8, "alpha": 0.85},
        )  # fmt: skip
    axes.set_thetagrids(range(0, 360, 30), [f"{angle:03d}°" for angle in range(0, 360, 30)])
    axes.grid(True, color="#909090", linewidth=0.4)
    axes.set_axisbelow(False)
    _draw_ship(axes, most_kn)
    axes.set_title(panel.title, loc="center", pad=16.0)


def _sectors(directions: Sequence[float]) -> list[tuple[float, float]]:
    """Left and right edge of each direction's sector [deg], halfway to its neighbours; at most 30° wide either side."""
    if len(directions) == 1:
        return [(directions[0] - 15.0, directions[0] + 15.0)]
    gaps = np.diff([*directions, directions[0] + 360.0])
    halves = np.minimum(np.minimum(gaps, np.roll(gaps, 1)) / 2.0, 30.0).tolist()
    return [(at - half, at + half) for at, half in zip(directions, halves, strict=True)]


def _rings(speeds: Sequence[float]) -> list[tuple[float, float]]:
    """Inner and outer edge of each speed's ring, halfway to its neighbours."""
    steps = np.diff(speeds).tolist() or [speeds[0]]
    middles = [0.5 * (slower + faster) for slower, faster in pairwise(speeds)]
    return list(pairwise([max(0.0, speeds[0] - 0.5 * steps[0]), *middles, speeds[-1] + 0.5 * steps[-1]]))


def _draw_border(axes: Any, directions: Sequence[float], borders: Mapping[float, tuple[float, str]]) -> None:  # noqa: ANN401
    """From direction to direction, not across half a circle; dotted where it lies at an edge of what was flown."""
    pairs = pairwise([*directions, directions[0] + 360.0])
    arcs = [
        (first, second, borders[first], borders[second % 360.0]) for first, second in pairs if second - first < 180.0
    ]
    for left, right, *ends in arcs or [(at - 15.0, at + 15.0, borders[at], borders[at]) for at in directions]:
        style = ":" if any(bound for _, bound in ends) else "-"
        axes.plot(np.radians([left, right]), [wind_kn for wind_kn, _ in ends], style, color=unit(VERMILION), lw=2.2)


def _draw_ship(axes: Any, most_kn: float) -> None:  # noqa: ANN401
    """A ship's outline at the centre, bow up."""
    half, long = 0.018 * most_kn, 0.07 * most_kn
    outline = np.array([(0.0, long), (half, 0.4 * long), (half, -long), (-half, -long), (-half, 0.4 * long)])
    axes.fill(np.arctan2(outline[:, 0], outline[:, 1]), np.hypot(*outline.T), fc="white", ec="black", lw=0.8, zorder=5)
