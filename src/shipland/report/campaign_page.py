"""A campaign as one HTML page that stands alone: no script, no font, no picture from elsewhere.

It says everything without its script too, which adds what a pointer can ask. Each flight stands there with its outcome,
its files, and the command that flies it again.
"""

from __future__ import annotations

import html
import json
import math
import os
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise, product
from pathlib import Path
from typing import Any
from urllib.parse import quote

from shipland.evaluation.campaign import CellResult
from shipland.evaluation.landing import Conditions, Landing
from shipland.evaluation.leaderboard import (
    leaderboard,
    pairings_table,
    pilot_pairings,
    rests_in_area,
    rivals,
    swept_keys,
)
from shipland.evaluation.oracle import OracleRate
from shipland.evaluation.tables import quantile
from shipland.evaluation.tally import Tally
from shipland.factories import is_own_code
from shipland.report.landing_plots import pad_of
from shipland.report.pages import html_of_table, html_table, page, page_file
from shipland.report.svg import Column, Point, Share, colour_of, point_chart, share_chart
from shipland.rig import area_of


class PageFlights:
    """All flights, numbered as the page's charts number them; links go from the folder where the page will lie."""

    def __init__(self, cells: Sequence[CellResult], folder: Path) -> None:
        self._cells, self._folder = cells, folder
        self.area = area_of(cell.rig for cell in cells)
        self.flights = [(cell, landing) for cell in cells for landing in cell.landings]
        self.by_pilot: dict[str, list[Landing]] = {}
        for cell, landing in self.flights:
            self.by_pilot.setdefault(cell.pilot, []).append(landing)
        failures = Counter(landing.cause for _, landing in self.flights if not landing.success)
        self._outcomes = ["", *(cause for cause, _ in failures.most_common())]
        self._count = failures | Counter({"": sum(landing.success for _, landing in self.flights)})

    def outcome(self, landing: Landing) -> int:
        """Number of a flight's outcome: 0 landed in the square, then causes, the most frequent first."""
        return 0 if landing.success else self._outcomes.index(landing.cause)

    def filters(self) -> str:
        """A box an outcome, for the script."""
        boxes = "".join(
            f'<label><input type="checkbox" checked value="{at}">'
            f"{html.escape(cause or f'landed in the {self.area}')} ({self._count[cause]})</label>"
            for at, cause in enumerate(self._outcomes)
            if self._count[cause]
        )
        again = " and the command that flies it again" if any(cell.logs for cell in self._cells) else ""
        return (
            f'<div id="outcomes" class="only-script">{boxes}<br><span class="dim">Point at a landing to see which it '
            f"is; click it for its files{again}.</span></div>"
        )

    def again(self, cell: CellResult, landing: Landing) -> str:
        """Links to what there is of a flight, and the command that flies it again."""
        links = (f'<a href="{html.escape(at, quote=True)}">{name}</a> ' for name, at in self._files(cell, landing))
        files = "".join(links)
        again = _again(cell, landing)
        command = html.escape(f"{again}{landing.seed}") if again else ""
        return f"{files or 'no log '}<code>{command}</code>"

    def data_and_script(self) -> str:
        """What the script reads, and the script."""
        told: list[dict[str, str]] = []
        numbers: dict[tuple[int, str], int] = {}  # a cell that several folders hold is told once for each
        rows: list[list[Any]] = []
        for at, cell in enumerate(self._cells):
            for it in cell.landings:
                again = _again(cell, it)
                number = numbers.setdefault((at, again), len(told))
                if number == len(told):
                    told.append({"name": cell.name, "pilot": cell.pilot, "version": cell.version, "again": again})
                figures = (it.error_m, it.sink_mps, it.tilt_deg, it.time_s)
                known = [round(value, 3) if math.isfinite(value) else None for value in figures]
                reason = "" if it.success else it.reason
                rows.append([number, it.seed, self.outcome(it), *known, reason, self._files(cell, it)])
        data = json.dumps({"cells": told, "outcomes": self._outcomes, "flights": rows}, separators=(",", ":"))
        quiet, script = data.replace("<", "\\u003c"), page_file("page.js")  # what ends a script must not stand in it
        return (
            '<div id="tip"></div><div id="flight"></div>'
            f'<script type="application/json" id="flights">{quiet}</script><script>{script}</script>'
        )

    def _files(self, cell: CellResult, landing: Landing) -> list[tuple[str, str]]:
        """Name and address of the log and the film of a flight, where they lie."""
        paths = {"log": f"{landing.seed}.mcap", "film": f"{landing.seed}/flight.mp4"}
        logs = cell.logs.get(landing.seed)
        there = {name: logs / path for name, path in paths.items() if logs and (logs / path).is_file()}
        addresses = {name: os.fsencode(os.path.relpath(path, self._folder)) for name, path in there.items()}
        return [(name, quote(address, safe="/=,")) for name, address in addresses.items()]


def _again(cell: CellResult, landing: Landing) -> str:
    """What flies a landing of a cell again, before its seed; empty where it lies in no folder. Own code is named."""
    logs = cell.logs.get(landing.seed)
    if logs is None:
        return ""
    named = {"--pilot": cell.pilot, "--vision": cell.vision}
    own = (word for option, name in named.items() if is_own_code(name) for word in (option, name))
    return f"{shlex.join(['shipland', 'again', logs.parent.as_posix(), *own])} --video --seed "


_MOST_LISTED = 300
"""Failures listed on the page; all are in flights.csv."""


def campaign_page(
    cells: Sequence[CellResult],
    about: dict[str, Any],
    oracle_rates: dict[str, OracleRate],
    folder: Path,
    first: Sequence[str] = (),
) -> str:
    """The page, with `command` and `machine` of cells.json; links go from the folder where it will lie.

    `first` stands above all tables.
    """
    cells = [cell for cell in cells if cell.landings]
    flown, machine = PageFlights(cells, folder), about["machine"]
    pilots, area = list(flown.by_pilot), flown.area
    suites = ", ".join(dict.fromkeys(cell.suite for cell in cells if cell.suite)) or "a grid of the command line"
    groups = len({cell.group for cell in cells})
    keys = "".join(
        f'<span class="key"><i style="background:{colour_of(index)}"></i>{html.escape(pilot)}</span>'
        for index, pilot in enumerate(pilots)
    )
    parts = [
        f"<h1>Landings: {html.escape(suites)}</h1>",
        f'<p class="dim">{len(flown.flights)} flights, {groups} cell{"s" * (groups > 1)}, {len(pilots)} pilot'
        f"{'s' * (len(pilots) > 1)}. "
        f"<code>{html.escape(about['command'])}</code><br>{html.escape(machine['processor'])}, "
        f"{machine['cores']} cores, {html.escape(machine['platform'])}</p><p>{keys}</p>",
        *first,
        "<h2>Pilots</h2>",
        _pilots(flown),
        f"<h2>Share in the {area}, cell by cell</h2>",
        '<p class="dim">Dot and bar: share and its 95 % interval. Dotted: what an oracle would reach.</p>',
        f'<div class="charts">{"".join(_cell_charts(cells, pilots, oracle_rates))}</div>',
        "<h2>Against what was drawn</h2>",
        f'<div class="charts">{"".join(_against(flown.by_pilot)) or "<p>One value of everything.</p>"}</div>',
        "<h2>Touchdowns</h2>",
        f'<p class="dim">Lines: {area} and deck. Dots landed in the {area}, crosses did not.</p>',
        flown.filters(),
        f'<div class="charts">{"".join(_touchdowns(flown, pilots))}</div>',
        "<h2>Failures</h2>",
        _causes(flown.by_pilot),
        _failures(flown),
        "<h2>Leaderboard</h2>",
        html_of_table(leaderboard(cells, oracle_rates)),
        "<h2>Everybody's rules, on the same flights</h2>",
        html_of_table(rivals(cells)),
    ]
    if len(pilots) > 1:
        parts += ["<h2>Pilots in pairs</h2>", html_of_table(pairings_table(pilot_pairings(cells)))]
    parts.append(flown.data_and_script())
    return page(f"Landings: {suites}", parts)


def _share(landings: Sequence[Landing], series: int, words: str) -> Share:
    tally = Tally.of(landings)
    share = f"{100 * tally.share:.1f} % ({tally.interval_text()})"
    return Share(series, tally.share, *tally.interval, f"{words}: {tally.landed} of {tally.flights}, {share}")


_FIGURES = (
    ("error_m", 100, 0.5, 1), ("error_m", 100, 0.9, 1), ("sink_mps", 1, 0.5, 2), ("slide_mps", 1, 0.5, 2),
    ("tilt_deg", 1, 0.5, 1), ("slip_m", 100, 0.5, 1), ("time_s", 1, 0.5, 0),
)  # fmt: skip
"""Of touchdowns: which figure, factor on it, quantile, digits."""


def _pilots(flown: PageFlights) -> str:
    head = ["pilot", "flights", f"in the {flown.area}", "95 % interval", "at rest in it", "on its feet",
            "error median [cm]", "error 90 % [cm]", "sink median [m/s]", "slide median [m/s]", "tilt median [°]",
            "slip median [cm]", "time median [s]", "largest stick step [%]"]  # fmt: skip
    rows = []
    for pilot, landings in flown.by_pilot.items():
        tally, upright = Tally.of(landings), sum(it.landed for it in landings)
        rests = sum(rests_in_area(it, cell.rig) for cell, it in flown.flights if cell.pilot == pilot)
        counts = [str(tally.flights), tally.share_text(), tally.interval_text(), str(rests), str(upright)]
        figures = [
            quantile([factor * getattr(it, name) for it in landings if it.touched], share, digits)
            for name, factor, share, digits in _FIGURES
        ]
        rows.append([pilot, *counts, *figures, quantile([it.step_percent for it in landings], 1.0, 0)])
    return html_table(head, rows, first_number=1)


def _cell_charts(
    cells: Sequence[CellResult], pilots: Sequence[str], oracle_rates: dict[str, OracleRate]
) -> Iterator[str]:
    """A chart a scenario, a column a cell."""
    for name in dict.fromkeys(cell.scenario for cell in cells):
        groups: dict[str, list[CellResult]] = {}
        for cell in cells:
            if cell.scenario == name:
                groups.setdefault(cell.group, []).append(cell)
        items = list(groups.items())
        keys = swept_keys([members[0] for members in groups.values()])
        unit = ", ".join(key.split(".")[-1] for key in keys)
        for at in range(0, len(items), 6):
            columns = []
            for group, members in items[at : at + 6]:
                shares = [_share(it.landings, pilots.index(it.pilot), f"{group}, {it.pilot}") for it in members]
                oracle_rate = oracle_rates[group].share if group in oracle_rates else None
                columns.append(Column(_label(members[0], keys), shares, oracle_rate))
            yield share_chart(columns, name, unit, joined=False)


def _label(cell: CellResult, keys: Sequence[str]) -> str:
    """The cell's values of what differs between cells; what it leaves as packaged is not said."""
    values = [dict(cell.settings).get(key, "") for key in keys]
    return " ".join(re.sub(r"[\[\]\"']", "", value) for value in values if value)[:16] or "as packaged"


def _off_bow_deg(conditions: Conditions) -> float | None:
    """Where the waves come from, to either side."""
    from_deg = conditions.waves_from_deg
    return None if from_deg is None else abs((from_deg + 180.0) % 360.0 - 180.0)


_CONDITIONS: tuple[tuple[str, str, Callable[[Landing], float | None], tuple[float, ...]], ...] = (
    ("Wind", "mean wind [m/s]", lambda it: it.conditions.wind_mps, (0, 1, 2, 4, 6, 8, 10, math.inf)),
    ("Wind off the bow", "[°]", lambda it: abs(it.conditions.wind_off_bow_deg), (0, 45, 90, 135, math.inf)),
    ("Sea state", "", lambda it: it.conditions.sea_state, (0, 3.5, 4.5, 5.5, math.inf)),
    ("Waves", "from, off the bow [°]", lambda it: _off_bow_deg(it.conditions), (0, 30, 75, 105, 150, math.inf)),
    ("Ship's speed", "[m/s]", lambda it: it.conditions.ship_mps, (0, 0.25, 1, 3, math.inf)),
    ("Visibility", "[m]", lambda it: it.conditions.visibility_m, (0, 750, 2000, 10000, math.inf)),
    ("Start", "distance [m]", lambda it: it.conditions.start_distance_m, (0, 20, 60, 120, 180, math.inf)),
    ("Video latency", "[s]", lambda it: it.conditions.video_s, (0, 0.1, 0.2, 0.4, math.inf)),
)
"""Title, unit, value of a landing, edges of the bins."""


def _against(by_pilot: Mapping[str, Sequence[Landing]]) -> Iterator[str]:
    for title, unit, value_of, edges in _CONDITIONS:
        columns = []
        for low, high in pairwise(edges):
            shares, met = [], []
            for series, (pilot, landings) in enumerate(by_pilot.items()):
                values = [(it, value_of(it)) for it in landings]
                inside = [(it, value) for it, value in values if value is not None and low <= value < high]
                met += [value for _, value in inside]
                if inside:
                    shares.append(_share([it for it, _ in inside], series, f"{pilot}, {title.lower()}"))
            if shares:
                columns.append(Column(_bin(min(met), max(met)), shares))
        if len(columns) > 1:
            yield share_chart(columns, title, unit, joined=True)


def _bin(low: float, high: float) -> str:
    texts = [f"{value:.0f}" if abs(value) >= 10 else f"{value:.2g}" for value in (low, high)]
    return texts[0] if texts[0] == texts[1] else f"{texts[0]}–{texts[1]}"


def _touchdowns(flown: PageFlights, pilots: Sequence[str]) -> Iterator[str]:
    touched = [(at, cell, it) for at, (cell, it) in enumerate(flown.flights) if it.touched]

    def points(place: Callable[[Landing], tuple[float, float]]) -> list[Point]:
        return [Point(at, pilots.index(cell.pilot), it.success, *place(it)) for at, cell, it in touched]

    pads = dict.fromkeys(pad_of(cell.rig) for cell, _ in flown.flights)
    contacts = points(lambda it: (it.starboard_m, it.forward_m))
    for (area, size_m, deck_m), pilot in product(pads, pilots):
        there = {at for at, cell, _ in touched if pad_of(cell.rig) == (area, size_m, deck_m) and cell.pilot == pilot}
        title = f"{pilot}: first contact" + f", {size_m:g} m {area}" * (len(pads) > 1)
        half_m, outlines = math.ceil(6.5 * deck_m) / 10.0, ((area, size_m), ("square", deck_m))
        mine = [it for it in contacts if it.flight in there]
        yield point_chart(mine, title, ("starboard [m]", "forward [m]"), (half_m, half_m), outlines)
    attitudes = points(lambda it: (it.deck_roll_deg, it.deck_pitch_deg))
    yield point_chart(
        attitudes, "The deck's attitude at contact", ("roll [°]", "pitch [°]"), _reach(attitudes, 15.0, 8.0)
    )
    sinks = points(lambda it: (-it.deck_sink_mps, it.sink_mps))
    names = ("deck's heave rate, up [m/s]", "sink [m/s]")
    yield point_chart(sinks, "Sink against the deck at contact", names, _reach(sinks, 1.0, 2.0), low=0.0)


def _reach(points: Sequence[Point], across: float, up: float) -> tuple[float, float]:
    """How far a chart's axes reach either side: so far, or to the farthest point."""
    across = max([across, *(abs(it.across) for it in points if math.isfinite(it.across))])
    up = max([up, *(abs(it.up) for it in points if math.isfinite(it.up))])
    return math.ceil(10.0 * across) / 10.0, math.ceil(10.0 * up) / 10.0


def _causes(by_pilot: Mapping[str, Sequence[Landing]]) -> str:
    counts = {pilot: Counter(it.cause for it in landings if it.cause) for pilot, landings in by_pilot.items()}
    causes = sum(counts.values(), Counter[str]())
    if not causes:
        return "<p>None.</p>"
    rows = [[cause, *(str(count[cause]) for count in counts.values())] for cause, _ in causes.most_common()]
    return html_table(["cause", *by_pilot], rows, first_number=1)


def _failures(flown: PageFlights) -> str:
    failed = [(cell, it) for cell, it in flown.flights if not it.success]
    if not failed:
        return ""
    rows = []
    for cell, it in failed[:_MOST_LISTED]:
        texts = [cell.name, str(it.seed), it.cause, it.reason, it.conditions.faults]
        words = "".join(f"<td>{html.escape(text)}</td>" for text in texts)
        rows.append(f'<tr data-outcome="{flown.outcome(it)}">{words}<td>{flown.again(cell, it)}</td></tr>')
    names = ("cell", "seed", "cause", "in words", "what was made to fail", "again")
    head = "".join(f"<th>{name}</th>" for name in names)
    more = f"<p>{len(failed) - _MOST_LISTED} more in flights.csv.</p>" if len(failed) > _MOST_LISTED else ""
    return (
        f"<details><summary>{len(failed)} flights that did not land in the {flown.area}</summary>"
        f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>{more}'
        "</details>"
    )
