"""Tables of pages from results/NAME.json.

A table stands in the page below a link to its results, whose title says which cases and columns it shows:

    [results/oracle_rates.json](../../results/oracle_rates.json "table group=sweep; setting, oracle_rate")

    | setting | … |

After `table` come the cases wanted (`column=value`) and, after the semicolon, the columns; all without them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from studies.harness import RESULTS, ROOT, Column, cases_where, load, read, row_of, source_of

BLOCK = re.compile(
    r"(?P<head>^\[[^\]\n]+\]\((?:\.\./)*results/(?P<name>\w+)\.json "
    r'"table(?P<where>(?: \w+=[\w-]+)*)(?:; (?P<columns>[\w, ]+))?"\)\n\n)(?P<table>(?:^\|.*\n)*)',
    re.MULTILINE,
)
BADGE = " ⚠ earlier code"


class TableError(ValueError):
    """A page asks for what the results do not hold, or differs from them."""


def cell(value: Any, column: Column) -> str:  # noqa: ANN401 - a value of JSON
    """A value as a page shows it; with its interval in brackets where it has one."""
    if value is None:
        return "–"
    if isinstance(value, dict):
        shown, low, high = (format(column.factor * value[key], column.form) for key in ("value", "low", "high"))
        return f"{shown} ({low}–{high})"
    return format(column.factor * value, column.form) if column.form else str(value)


def table(name: str, where: dict[str, str], columns: list[str] | None = None, badges: bool = False) -> str:
    """Markdown of the cases of a study that agree with `where`.

    Args:
        name: of the study.
        where: column and value of the cases wanted.
        columns: their names, in order; all without.
        badges: mark rows that other code, configuration or weights gave than those of this tree.

    Raises:
        TableError: the study was not measured, a case has no row, or a column does not exist.
    """
    study, found = load(name), read(RESULTS / f"{name}.json")
    if found is None:
        raise TableError(f"results/{name}.json is missing: python -m studies {name}")
    shown = columns or list(study.columns)
    if unknown := set(shown) - study.columns.keys():
        raise TableError(f"{name} has no column {', '.join(sorted(unknown))}; there are: {', '.join(study.columns)}")
    cases = cases_where(study, where)
    if not cases:
        raise TableError(f"no case of {name} has {where}")
    badge = BADGE if badges and found["source"] != source_of(name, study) else ""
    heads = [study.columns[key].title for key in shown]
    aligned = ["---:" if study.columns[key].form else "---" for key in shown]
    lines = ["| " + " | ".join(heads) + " |", "|" + "|".join(aligned) + "|"]
    for case in cases:
        row = row_of(found["rows"], case)
        if row is None:
            raise TableError(f"results/{name}.json has no row of {dict(case)}: python -m studies {name}")
        cells = [cell(row[key], study.columns[key]) for key in shown]
        lines.append("| " + " | ".join([cells[0] + badge, *cells[1:]]) + " |")
    return "\n".join(lines) + "\n"


def _asked(match: re.Match[str], badges: bool) -> str:
    where = dict(pair.split("=", 1) for pair in match["where"].split())
    columns = [each.strip() for each in match["columns"].split(",")] if match["columns"] else None
    return table(match["name"], where, columns, badges)


def checked(text: str, page: str) -> str:
    """A page with badges on rows of other code.

    Raises:
        TableError: a table of the page differs from the results, or a row is missing.
    """

    def one(match: re.Match[str]) -> str:
        if match["table"] != _asked(match, badges=False):
            raise TableError(f"{page}: the table of {match['name']} differs from its results: python -m studies")
        return match["head"] + _asked(match, badges=True)

    return BLOCK.sub(one, text)


def pages() -> Iterator[Path]:
    """README and docs."""
    yield ROOT / "README.md"
    yield from sorted((ROOT / "docs").rglob("*.md"))


def update_pages() -> list[str]:
    """Write the tables of measured studies into the pages; the pages that changed."""
    changed = []

    def one(match: re.Match[str]) -> str:
        return match["head"] + _asked(match, badges=False)

    for page in pages():
        old = page.read_text(encoding="utf-8")
        new = BLOCK.sub(one, old)
        if new != old:
            page.write_text(new, encoding="utf-8")
            changed.append(str(page.relative_to(ROOT)))
    return changed
