"""What a notebook shows of a flight and of a campaign: HTML that stands alone, with a small picture in it."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

import cv2
import numpy as np

from shipland.evaluation.campaign import CellResult
from shipland.evaluation.tables import causes_in_words, median
from shipland.evaluation.tally import Tally
from shipland.extras import installed
from shipland.figures import png_of
from shipland.messages import FlightRecord, TouchdownVerdict
from shipland.report.landing_plots import plot_cells
from shipland.report.pages import html_table, picture
from shipland.report.views import FlightViews
from shipland.rig import area_of
from shipland.scenario.scenario import Scenario

_DPI = 55


def flight_html(
    scenario: Scenario,
    reason: str,
    verdict: TouchdownVerdict | None,
    records: Sequence[FlightRecord],
    film: Path | None = None,
) -> str:
    """Verdict, figures of the touchdown, the whole flight from two sides where its truth is known, film if there."""
    figures = {"cycles": f"{len(records)}"}
    if verdict is not None and verdict.touched:
        figures |= {
            "time": f"{verdict.t_s:.1f} s",
            "off the deck's centre": f"{verdict.error_m:.3f} m",
            "sink": f"{verdict.sink_mps:.2f} m/s",
            "slide": f"{verdict.slide_mps:.2f} m/s",
            "tilt": f"{np.degrees(verdict.tilt_rad):.1f}°",
            "slip": f"{100.0 * verdict.slip_m:.1f} cm",
        }
    views = FlightViews(scenario.rig, scenario.aircraft.airframe.motor_diagonal_m)
    truths = [record.truth for record in records if record.truth is not None]
    for truth in truths:
        views.note(truth)
    shown = ""
    if truths:
        png = cv2.imencode(".png", views.picture(reason, whole=True)[:, :, ::-1])[1].tobytes()
        shown = picture(png, "png", "the flight from the side and from above")
    if film is not None and film.is_file():
        here, film = Path.cwd(), film.absolute()  # a notebook's server shows what lies beside the notebook, or below
        address = html.escape(quote(str(film.relative_to(here) if film.is_relative_to(here) else film)))
        name = html.escape(film.name)
        shown += f'<p><video controls width="640" src="{address}"></video><br><a href="{address}">{name}</a></p>'
    table = html_table(list(figures), [list(figures.values())], len(figures))
    return f"<b>{html.escape(scenario.name)}: {html.escape(reason)}</b>{table}{shown}"


def campaign_html(words: str, cells: Sequence[CellResult]) -> str:
    """What came of it in a line, a row a cell, and `plot_cells`."""
    area = area_of(cell.rig for cell in cells)
    rows = []
    for cell in cells:
        tally, error = Tally.of(cell.landings), median([100.0 * landing.error_m for landing in cell.landings], 1)
        landed = f"{tally.landed} of {tally.flights}"
        rows.append((cell.name, landed, tally.interval_text(), error, causes_in_words(cell.landings)))
    head = ("cell", f"landed in the {area}", "95 % interval", "error median [cm]", "causes")
    shown = ""
    if installed("plots"):
        shown = picture(png_of(plot_cells(cells), _DPI), "png", "where they touched, and the share that landed")
    return f"<b>{html.escape(words)}</b>{html_table(head, rows, len(head))}{shown}"
