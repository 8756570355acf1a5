"""The README's figures are those of the results, or of the page of results that shows the same flights or scenes."""

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = ROOT / "results"
SCENARIOS = ("rig-natops", "rig-sea6", "ship-natops", "ship-sea5", "ship-sea6")


def rows_below(text, link):
    """Cells of the table below a link to results, without head and rule."""
    lines = text.partition(link)[2].split("\n\n")[1].splitlines()
    return [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines[2:]]


def landed():
    """(scenario, stick, pilot) → flights in the square, of results/landings.json, or of the page until it is there."""
    path = RESULTS / "landings.json"
    if path.exists():
        rows = json.loads(path.read_text(encoding="utf-8"))["rows"]
        return {(r["scenario"], r["stick"], r["pilot"]): round(r["square"] * r["flights"]) for r in rows}
    page = (ROOT / "docs" / "results" / "landings.md").read_text(encoding="utf-8")
    return {tuple(row[:3]): int(row[4]) for row in rows_below(page, "results/landings.json")}


def table_of(name):
    link = f"(results/{name}.json "
    assert link in README
    return rows_below(README, link)


def number(cell):
    return float(re.search(r"\d+(?:\.\d+)?", cell)[0])


def test_landings_of_the_table():
    found, rows = landed(), table_of("landings")
    if (RESULTS / "landings.json").exists():
        pytest.skip("drawn from results/landings.json, which test_pages_agree_with_the_results checks")
    assert [number(row[1]) for row in rows] == [found[name, "tilt", "horizon"] for name in SCENARIOS]
    assert [number(row[2]) for row in rows] == [found[name, "tilt", "paper"] for name in SCENARIOS]


def test_sums_of_landings():
    found = landed()
    said = re.search(r"ours lands\s+(\d+) of these 1,000 and the published gains land (\d+)\.", README)
    sums = [sum(found[name, "speed", pilot] for name in SCENARIOS) for pilot in ("horizon", "paper")]
    assert [int(said[1]), int(said[2])] == sums


def test_oracle_rates_lie_within_the_measured_interval():
    rows = json.loads((RESULTS / "oracle_rates.json").read_text(encoding="utf-8"))["rows"]
    measured = {row["setting"]: row["oracle_rate"] for row in rows if row["group"] == "scenarios"}
    for name, row in zip(SCENARIOS, table_of("landings"), strict=True):
        rate = measured[name]
        assert 100 * rate["low"] - 0.05 <= number(row[3]) <= 100 * rate["high"] + 0.05, name


def test_detections_are_those_of_all_scenes():
    page = (ROOT / "docs" / "results" / "far-vision.md").read_text(encoding="utf-8")
    for row in table_of("far_vision"):
        link = f'"table kind={row[0]} group=together'
        every = next(found for found in rows_below(page, link) if found[0] == "all")
        assert row[1:] == [every[1], every[3], every[7], every[8]]


def test_full_scale_landings():
    page = (ROOT / "docs" / "results" / "full-scale.md").read_text(encoding="utf-8")
    for count in re.findall(r"(\d+) of 100", README):
        assert re.search(rf"\b{count} of 100\b|\| {count} ", page), count
