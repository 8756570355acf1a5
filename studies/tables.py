"""Tables of pages from results/NAME.json.

A table stands in the page below a link to its results, whose title says which rows and columns it shows:

    [results/winds.json](../../results/winds.json "table pilot=horizon stick=tilt,speed; scenario, square by wind")

    | scenario | … |

After `table` come the rows wanted (`column=value`, several values with commas between, quotes around one with spaces)
and, after the semicolon, the columns; all without them. `cell by column` makes a column of each value.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.harness import RESULTS, ROOT, Column, is_current, load, read, rows_of

_PAIR = r"\w+=(?:'[^']*'|[^\s;'\"]+)"
BLOCK = re.compile(
    r"(?P<head>^\[[^\]\n]+\]\((?:\.\./)*results/(?P<name>\w+)\.json "
    rf'"table(?P<where>(?: {_PAIR})*)(?:; (?P<columns>[\w, ]+))?"\)\n\n)(?P<table>(?:^\|.*\n)*)',
    re.MULTILINE,
)
EARLIER = "⚠ *Measured by earlier code:* `make results ONLY={}` *flies it anew.*\n\n"
TYPED = "⚠ *Typed by hand: this tree holds no results of* `make results ONLY={}` *yet.*\n\n"


class TableError(ValueError):
    """A page asks for what the results do not hold, or differs from them."""


def cell(value: Any, column: Column) -> str:  # noqa: ANN401 - a value of JSON
    """A value as a page shows it; with its interval in brackets where it has one."""
    if value is None:
        return "–"
    if isinstance(value, dict):
        shown, low, high = (cell(value[key], column) for key in ("value", "low", "high"))
        return f"{shown} ({low}–{high})"
    if isinstance(value, str) or not column.form:
        return str(value)
    return format(value if column.factor == 1.0 else column.factor * value, column.form)


def table(name: str, where: Mapping[str, Sequence[str]], columns: str = "") -> str:
    """Markdown of the rows of a study that agree with `where`.

    Args:
        name: of the study.
        where: column and values of the rows wanted.
        columns: their names, in order, with commas between; all without. The last may be `cell by column`.

    Raises:
        TableError: the study was not measured, a case has no row, or a column does not exist.
    """
    study, found = load(name), read(RESULTS / f"{name}.json")
    if found is None:
        raise TableError(f"results/{name}.json is missing: python -m studies {name}")
    shown = [each.strip() for each in columns.split(",")] if columns else list(study.columns)
    shown[-1], _, across = shown[-1].partition(" by ")
    if unknown := {*shown, across or shown[-1]} - study.columns.keys():
        raise TableError(f"{name} has no column {', '.join(sorted(unknown))}; there are: {', '.join(study.columns)}")

    def wanted(some: Mapping[str, Any]) -> bool:
        return all(str(some[key]) in values for key, values in where.items() if key in some)

    rows = []
    for case in filter(wanted, study.cases()):
        measured = rows_of(found["rows"], case)
        if not measured:
            raise TableError(f"results/{name}.json has no row of {dict(case)}: python -m studies {name}")
        rows += list(filter(wanted, measured))
    if not rows or any(key not in row for key in where for row in rows[:1]):
        raise TableError(f"no row of {name} has {dict(where)}")
    return _markdown(study.columns, rows, shown, across)


def _markdown(columns: Mapping[str, Column], rows: Sequence[Mapping[str, Any]], shown: list[str], across: str) -> str:
    """Lines; with `across` a line for each combination of the other columns, a column for each of its values."""
    heads = [columns[key].title for key in shown]
    lines = [[cell(row.get(key), columns[key]) for key in shown] for row in rows]
    aligned = ["---:" if columns[key].form else "---" for key in shown]
    if across:
        places = [cell(row.get(across), columns[across]) for row in rows]
        values = sorted(dict.fromkeys(places), key=_as_number)
        cells = {(*line[:-1], place): line[-1] for line, place in zip(lines, places, strict=True)}
        firsts = dict.fromkeys(tuple(line[:-1]) for line in lines)
        lines = [[*first, *(cells.get((*first, value), "–") for value in values)] for first in firsts]
        heads[-1:] = [f"{columns[across].title} {values[0]}", *values[1:]]
        aligned[-1:] = aligned[-1:] * len(values)
    texts = [" | ".join(each) for each in (heads, *lines)]
    return "\n".join([f"| {texts[0]} |", "|" + "|".join(aligned) + "|", *(f"| {text} |" for text in texts[1:])]) + "\n"


def _as_number(text: str) -> float:
    """Numbers ascend; other texts stay in their order."""
    try:
        return float(text)
    except ValueError:
        return 0.0


def _asked(match: re.Match[str]) -> str | None:
    """The table that a link wants; None without results of a study that exists."""
    load(match["name"])
    if not (RESULTS / f"{match['name']}.json").exists():
        return None
    pairs = [pair.split("=", 1) for pair in re.findall(_PAIR, match["where"])]
    where = {key: [value[1:-1]] if value.startswith("'") else value.split(",") for key, value in pairs}
    return table(match["name"], where, match["columns"] or "")


def checked(text: str, page: str) -> str:
    """A page with notes above tables without results, and above those that another code or configuration measured.

    Raises:
        TableError: a table of the page differs from the results, or a row is missing.
    """

    def one(match: re.Match[str]) -> str:
        name, right = match["name"], _asked(match)
        if right is None:
            return match["head"] + TYPED.format(name) + match["table"]
        if match["table"] != right:
            raise TableError(f"{page}: the table of {name} differs from its results: python -m studies")
        found = read(RESULTS / f"{name}.json") or {}
        note = "" if is_current(name, load(name), found) else EARLIER.format(name)
        return match["head"] + note + right

    return BLOCK.sub(one, text)


def pages() -> Iterator[Path]:
    """README and docs."""
    yield ROOT / "README.md"
    yield from sorted((ROOT / "docs").rglob("*.md"))


def update_pages() -> list[str]:
    """Write the tables of measured studies into the pages; the pages that changed."""
    changed = []

    def one(match: re.Match[str]) -> str:
        right = _asked(match)
        after = "" if match["table"] else "\n"  # a new table ends before what follows
        return match[0] if right is None else match["head"] + right + after

    for page in pages():
        old = page.read_text(encoding="utf-8")
        new = BLOCK.sub(one, old)
        if new != old:
            page.write_text(new, encoding="utf-8")
            changed.append(str(page.relative_to(ROOT)))
    return changed
