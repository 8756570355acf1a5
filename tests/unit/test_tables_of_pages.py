"""Every table with figures in README, results and explanations is drawn from results/, or counted here as typed."""

import re
from pathlib import Path

import pytest
from studies import ORDER, harness, tables

ROOT = Path(__file__).parents[2]

TYPED = {
    "docs/explanation/aircraft.md": 3,  # data sheets
    "docs/explanation/far-vision.md": 1,  # sizes of networks
    "docs/explanation/scale.md": 1,  # settings
    "docs/explanation/scene.md": 1,  # settings
    "docs/results/far-vision.md": 5,  # trainings, photographs and a path tracer that are not in the repository
    "docs/results/full-scale.md": 1,  # settings
    "docs/results/guidance.md": 1,  # gains worked out
    "docs/results/near-vision.md": 2,  # photographs and a path tracer that are not in the repository
    "docs/results/real-autopilots.md": 4,  # autopilots that are not in the repository
}
"""Tables with figures that no study measures. Lower a number when a table is drawn from results; raise none."""
UNMEASURED = frozenset(
    """
    night
    faults
    far_rendered frigate_rendered
    """.split()  # noqa: SIM905
)
"""Studies whose results are not committed yet; remove a name when they are, add none."""
FIGURE = r"[^|\n]*\b\d[\d.,]*\s*(?:%|cm|m|s|ms|m/s|px|°|km)?\s*(?:\([^|]*\))?\s*\|"
FIGURES = re.compile(rf"^\|.*\|{FIGURE}", re.MULTILINE)
TABLE = re.compile(r"^\|[^\n]*\n\|[-:| ]+\|\n(?P<rows>(?:^\|.*\n?)*)", re.MULTILINE)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "results").glob("*.md"))]
PAGES += sorted((ROOT / "docs" / "explanation").glob("*.md"))


def typed(text):
    """Heads of the tables with figures that no link to results stands above."""
    rest = tables.BLOCK.sub("", text)
    return [found[0].splitlines()[0] for found in TABLE.finditer(rest) if FIGURES.search(found["rows"])]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_typed_tables_only_grow_fewer(page):
    name = str(page.relative_to(ROOT))
    found = typed(page.read_text(encoding="utf-8"))
    assert len(found) == TYPED.get(name, 0), f"{name}: {found}"


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_a_table_ends_with_an_empty_line(page):
    """What follows without one is a row to Markdown."""
    text = page.read_text(encoding="utf-8") + "\n"
    assert [
        found["name"] for found in tables.BLOCK.finditer(text) if found["table"] and text[found.end()] != "\n"
    ] == []


def test_studies_without_results_only_grow_fewer():
    assert {name for name in ORDER if not (harness.RESULTS / f"{name}.json").exists()} <= UNMEASURED


def test_every_study_has_a_place_and_every_result_a_study():
    campaigns = {path.stem for path in harness.CAMPAIGNS.glob("*.toml")}
    modules = {path.stem for path in (ROOT / "studies").glob("*.py") if "\nSTUDY = Study(" in path.read_text()}
    assert set(ORDER) == campaigns | modules
    assert {path.stem for path in (ROOT / "results").glob("*.json")} <= set(ORDER)


def test_every_study_is_shown_on_a_page():
    text = "".join(page.read_text(encoding="utf-8") for page in tables.pages())
    assert {name for name in ORDER if f"results/{name}.json" not in text} == set()


def test_a_typed_table_is_told_from_a_drawn_one():
    drawn = '[r](../../results/winds.json "table")\n\n| wind | [%] |\n|---|---:|\n| 3 m/s | 5 |\n'
    assert typed(drawn) == []
    assert typed(drawn.split("\n\n")[1]) == ["| wind | [%] |"]
    assert typed("| what | how |\n|---|---|\n| a filter | of 15 states, see [2] |\n") == []
