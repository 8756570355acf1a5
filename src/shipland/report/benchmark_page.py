"""A leaderboard of bundles as one HTML page: entries, all flights in pairs with the first, and a campaign's page."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipland.errors import DataError
from shipland.evaluation.bundle import Bundle, cell_of
from shipland.evaluation.campaign import CellResult, read_about
from shipland.evaluation.landing import Landing
from shipland.evaluation.oracle import OracleRate
from shipland.evaluation.suite import task_digest
from shipland.evaluation.tables import pair_up
from shipland.evaluation.tally import Tally
from shipland.evaluation.verify import read_receipt
from shipland.report.campaign_page import campaign_page
from shipland.report.pages import html_table


def entries_of(bundles: Sequence[Bundle]) -> list[CellResult]:
    """The cells of all bundles, each flown by `title` or, of a bundle with several pilots, `title: pilot`.

    DataError where they flew different suites or, of one name, different scenarios, or two have one title.
    """
    suites = {str(bundle.about["suite"]) for bundle in bundles}
    if len(suites) > 1:
        raise DataError(f"the bundles flew different suites: {', '.join(sorted(suite or 'none' for suite in suites))}")
    if len({bundle.title for bundle in bundles}) < len(bundles):
        raise DataError("two bundles have one title; submit one of them again with another --title")
    found, met = [], dict[str, str]()
    for bundle in bundles:
        several = len({cell.pilot for cell in bundle.cells}) > 1
        for cell in bundle.cells:
            entry = f"{bundle.title}: {cell.pilot}" if several else bundle.title
            group, digest = bundle.groups[cell.name], task_digest([cell_of(cell)])
            if met.setdefault(group, digest) != digest:
                raise DataError(f"{bundle.path}: {group} is another scenario than in the bundles before it")
            found.append(replace(cell, pilot=entry, group=group, name=f"{group}_{entry}", logs={}))
    return found


def benchmark_page(
    bundles: Sequence[Bundle], cells: Sequence[CellResult], oracle_rates: dict[str, OracleRate], folder: Path
) -> str:
    """The page, which will lie in a folder; all are compared with the first bundle's first pilot."""
    command = shlex.join(["shipland", "report", *(bundle.path.name for bundle in bundles)])
    about = read_about(bundles[0].folder) | {"command": command}
    tables = ["<h2>Entries</h2>", _entries(bundles), "<h2>All flights in pairs with the first</h2>", standings(cells)]
    return campaign_page(cells, about, oracle_rates, folder, tables)


def _entries(bundles: Sequence[Bundle]) -> str:
    rows = []
    for bundle in bundles:
        about, receipt = bundle.about, read_receipt(bundle)
        pilots = ", ".join(dict.fromkeys(cell.pilot for cell in bundle.cells))
        again = "not verified" if receipt is None else f"{receipt.again} of {receipt.flights}, all equal"
        checked = "" if receipt is not None and receipt.seeds_checked else ", not checked"
        seeds = f"sealed by {about['salt']}{checked}" if about["salt"] else f"1 … {about['runs']}"
        own = ", ".join(sorted(set(about["own_code"].values()))) or "–"
        code = f"{about['version']} ({about['source']})"
        rows.append([bundle.title, pilots, code, own, again, seeds])
    return html_table(["entry", "pilots", "code", "own code", "flown again", "seeds"], rows, first_number=6)


def standings(cells: Sequence[CellResult]) -> str:
    """A row an entry: its share over all cells, and McNemar's test against the first on the same flights."""
    by_entry: dict[str, dict[tuple[str, int], Landing]] = {}
    for cell in cells:
        by_entry.setdefault(cell.pilot, {}).update({(cell.group, it.seed): it for it in cell.landings})
    first, rows = next(iter(by_entry.values())), []
    for entry, flown in by_entry.items():
        tally, found = Tally.of(flown.values()), pair_up(first, flown, np.random.default_rng(1))
        tested = [f"{found.only_first}", f"{found.only_second}", f"{found.p_value:.2g}"]
        counts = [f"{tally.flights}", tally.share_text(), tally.interval_text()]
        rows.append([entry, *counts, *(["–"] * 3 if flown is first else tested)])
    head = ["entry", "flights", "landed", "95 % interval", "only the first", "only this", "McNemar p"]
    return html_table(head, rows, first_number=7)
