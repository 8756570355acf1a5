"""The harness of studies: it resumes, refuses rows of other code, and pages agree with what was measured."""

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from studies import ORDER, harness, tables

from shipland.errors import DataError

ROOT = Path(__file__).parents[2]


@pytest.fixture
def study(tmp_path, monkeypatch):
    """Two cases in folders of their own; (study, numbers measured so far)."""
    measured = []

    def measure(case, runs):
        measured.append(case["number"])
        return {"twice": 2 * case["number"], "good": harness.share(runs, runs)}

    columns = {name: harness.Column(name) for name in ("number", "twice")}
    made = harness.Study("Twice?", columns, lambda: [{"number": 1}, {"number": 2}], measure, 3, 0)
    monkeypatch.setattr(harness, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(tables, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(harness, "PARTS", tmp_path / "parts")
    monkeypatch.setattr(harness, "CODE", ())  # digests of all code take seconds, and the source is made up
    monkeypatch.setattr(harness, "load", lambda _: made)
    monkeypatch.setattr(tables, "load", lambda _: made)
    monkeypatch.setattr(harness, "source_of", lambda *_: {"code": "this", "modules": ""})
    return made, measured


def write(path, rows, code="this"):
    path.parent.mkdir(parents=True, exist_ok=True)
    source = {"code": code, "modules": ""}
    path.write_text(json.dumps({"rows": rows, "source": source, "runs": 3, "minutes": 1.0, "commit": "c"}))


ROWS = [{"number": 1, "twice": 2}, {"number": 2, "twice": 4}]


def test_only_rows_of_this_code_are_kept(study, tmp_path):
    path = tmp_path / "parts" / "two-3.json"
    write(path, ROWS[:1])
    assert harness._kept(path, "two", study[0], 3)[0] == ROWS[:1]
    assert harness._kept(path, "two", study[0], 4)[0] == []
    write(path, ROWS[:1], "other")
    assert harness._kept(path, "two", study[0], 3)[0] == []


def test_code_that_was_imported_to_measure_ages_a_result(tmp_path, monkeypatch):
    """And no other."""
    for name in ("src/shipland/configs", "src/shipland/weights", "studies/campaigns"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("flown", "apart", "errors"):
        (tmp_path / "src" / "shipland" / f"{name}.py").write_bytes(PLAIN)
    (tmp_path / "src" / "shipland" / "__init__.py").touch()
    (tmp_path / "studies" / "two.py").touch()
    for name, folder in (("ROOT", ""), ("PACKAGE", "src/shipland"), ("CAMPAIGNS", "studies/campaigns")):
        monkeypatch.setattr(harness, name, tmp_path / folder)
    monkeypatch.setattr(harness, "CODE", (harness.PACKAGE,))
    with pytest.raises(DataError, match="shipland is not imported from"):
        harness.imported()
    for name in ("__init__", "flown", "errors"):
        module = SimpleNamespace(__file__=str(harness.PACKAGE / f"{name}.py"))
        monkeypatch.setitem(sys.modules, f"measured_{name}", module)
    assert harness.imported() == {"src/shipland/__init__.py", "src/shipland/flown.py"}, "errors decide no figure"
    made = harness.Study("Twice?", {}, list, lambda case, runs: {}, 3, 0)
    found = {"source": harness.source_of("two", made, harness.imported())}
    (harness.PACKAGE / "apart.py").write_bytes(PLAIN.replace(b"/ 2", b"/ 3"))
    assert harness.is_current("two", made, found)
    (harness.PACKAGE / "flown.py").write_bytes(PLAIN.replace(b"/ 2", b"/ 3"))
    assert not harness.is_current("two", made, found)
    (harness.PACKAGE / "flown.py").unlink()
    assert not harness.is_current("two", made, found)


PLAIN = b"LIMIT_M = 0.5\ndef half(given):\n    return given / 2\n"


@pytest.mark.parametrize(
    ("edited", "ages"),
    [
        (
            b'"""Of it."""\nLIMIT_M = 0.5  # m\n"""Most."""\ndef half(given):\n    """See."""\n    return given / 2\n',
            False,
        ),
        (b"LIMIT_M = 0.50\n\n\ndef half(\n    given,\n):\n    return (given / 2)\n", False),
        (PLAIN.replace(b"/ 2", b"/ 3"), True),
        (PLAIN.replace(b"0.5", b"None"), True),
        (PLAIN.replace(b"0.5", b'""'), True),
        (PLAIN.replace(b"(given)", b"(given=0)"), True),
        (PLAIN + b"half(1)\n", True),
    ],
)
def test_prose_ages_no_result_and_code_does(edited, ages, tmp_path, monkeypatch):
    monkeypatch.setattr(harness, "ROOT", tmp_path)
    path = tmp_path / "measured" / "half.py"
    path.parent.mkdir()
    path.write_bytes(PLAIN)
    before = harness.digest([path.parent])
    path.write_bytes(edited)
    assert (harness.digest([path.parent]) != before) == ages
    (path.parent / "limits.toml").write_text("# a comment\n")
    with_table = harness.digest([path.parent])
    (path.parent / "limits.toml").write_text("# another\n")
    assert harness.digest([path.parent]) != with_table, "what is not Python counts byte by byte"


def test_a_study_that_was_stopped_resumes_with_the_missing_cases(study, tmp_path, monkeypatch):
    made, measured = study

    def interrupted_once(case, runs):
        row = made.measure(case, runs)
        if measured == [1, 2]:
            raise KeyboardInterrupt
        return row

    stopping = replace(made, measure=interrupted_once)
    monkeypatch.setattr(harness, "load", lambda _: stopping)
    monkeypatch.setattr(harness, "ProcessPoolExecutor", lambda workers, *_: ThreadPoolExecutor(workers))
    assert not harness.run("two", stopping, workers=1)
    assert not (tmp_path / "results" / "two.json").exists()
    part = tmp_path / "parts" / "two-3.json"
    part.write_text(json.dumps(harness.read(part) | {"minutes": 7.0}))
    assert harness.run("two", stopping, workers=1)
    assert measured == [1, 2, 2]
    found = harness.read(tmp_path / "results" / "two.json")
    assert [row["twice"] for row in found["rows"]] == [2, 4]
    assert 7.0 <= found["minutes"] < 8.0, "what was spent before the stop counts"
    assert " × " in found["machine"]
    assert harness.run("two", stopping, workers=1)
    assert measured == [1, 2, 2]


def test_a_missing_row_and_another_figure_are_refused(study, tmp_path):
    path = tmp_path / "results" / "two.json"
    page = 'Before.\n\n[two.json](../../results/two.json "table")\n\n{}\nAfter.\n'
    write(path, ROWS)
    good = page.format(tables.table("two", {}))
    assert tables.checked(good, "page") == good
    with pytest.raises(tables.TableError, match="differs"):
        tables.checked(good.replace("| 4 |", "| 5 |"), "page")
    write(path, ROWS[:1])
    with pytest.raises(tables.TableError, match="no row"):
        tables.checked(good, "page")


def test_above_a_table_of_earlier_code_stands_a_note(study, tmp_path):
    write(tmp_path / "results" / "two.json", ROWS, code="earlier")
    head = '[two.json](../../results/two.json "table")\n\n'
    page = tables.checked(head + tables.table("two", {}), "page")
    assert page == head + tables.EARLIER.format("two") + tables.table("two", {})


def test_results_of_earlier_code_are_taken_over_where_a_part_comes_out_the_same(study, tmp_path, monkeypatch):
    made, measured = study
    many = replace(made, cases=lambda: [{"number": number} for number in range(25)])
    monkeypatch.setattr(harness, "load", lambda _: many)
    monkeypatch.setattr(harness, "ProcessPoolExecutor", lambda workers, *_: ThreadPoolExecutor(1))
    path = tmp_path / "results" / "two.json"
    rows = [{**case, **made.measure(case, 3)} for case in many.cases()]
    measured.clear()
    write(path, rows, code="earlier")
    assert "4 of 25 cases" in harness.confirm("two", many)
    assert measured == [0, 10, 20, 24]
    assert harness.read(path)["source"]["code"] == "this"
    rows[20]["twice"] += 1e-12  # another processor's rounding
    write(path, rows, code="earlier")
    assert "4 of 25 cases" in harness.confirm("two", many)
    rows[20]["twice"] += 1e-9
    write(path, rows, code="earlier")
    assert "{'number': 20} comes out otherwise" in harness.confirm("two", many)
    assert harness.read(path)["source"]["code"] == "earlier"
    assert "anew" in harness.confirm("two", replace(many, alone=True))


def test_the_cases_that_a_change_left_alone_are_taken_over_and_the_others_measured(study, tmp_path, monkeypatch):
    made, measured = study
    many = replace(made, cases=lambda: [{"number": n, "stick": ("tilt", "none", "speed")[n // 3]} for n in range(8)])
    monkeypatch.setattr(harness, "load", lambda _: many)
    monkeypatch.setattr(harness, "ProcessPoolExecutor", lambda workers, *_: ThreadPoolExecutor(1))
    path = tmp_path / "results" / "two.json"
    rows = [{**case, **made.measure(case, 3)} for case in many.cases()]
    for row in rows[6:]:
        row["twice"] += 1
    write(path, rows, code="earlier")
    assert "comes out otherwise" in harness.confirm("two", many, where={"stick": "speed"})
    assert "stick=tilt,none: 2 of 6 cases" in harness.confirm("two", many, where={"stick": "tilt,none"})
    assert harness.read(path)["source"]["code"] == "earlier"
    measured.clear()
    assert harness.run("two", many, workers=1)
    assert sorted(measured) == [6, 7]
    found = harness.read(path)
    assert [row["twice"] for row in found["rows"]] == [0, 2, 4, 6, 8, 10, 12, 14]
    assert "stick=tilt,none: 2 of 6" in found["confirmed"]


@pytest.mark.parametrize("page", list(tables.pages()), ids=lambda path: path.name)
def test_pages_agree_with_the_results(page):
    tables.checked(page.read_text(encoding="utf-8"), page.name)


SECONDS = (
    *("consistency", "deck_sights", "false_accepts", "film_errors", "pose_error", "printed_vision", "reach"),
    *("reliability", "speed_photographs", "speed_render", "spoiled_cue", "wave_off"),
)
"""Studies whose smallest case takes seconds: `make test-slow` runs them."""
MINUTES = (
    *("confirmation", "envelope", "far_vision", "frigate_recall", "margins", "own_landing", "pilot_consistency"),
    *("published_network", "speed_far", "speed_landings", "speed_near", "speed_peers"),
)
"""Studies whose smallest case takes too long for a test."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if name in SECONDS else [])
        for name in ORDER
        if not (harness.CAMPAIGNS / f"{name}.toml").exists()
    ],
)
def test_the_smallest_case_of_a_study_runs(name, tmp_path, monkeypatch):
    monkeypatch.setattr("studies.landings.PARTS", tmp_path)
    monkeypatch.setenv("SHIPLAND_PHOTOGRAPHS", str(harness.PICTURES))
    study = harness.load(name)
    assert harness.source_of(name, study, ())
    if name in MINUTES:
        return
    case = study.cases()[0]
    rows, files = harness.measure(name, case, 2)
    assert f"studies/{name}.py" in files
    keys = {key for row in rows for key in row}
    assert rows == harness.rows_of(rows, case)
    assert json.loads(json.dumps(rows)) == rows
    assert keys & study.columns.keys() >= case.keys() & study.columns.keys()
    for row in rows:
        for key, column in study.columns.items():
            tables.cell(row.get(key), column)


def test_a_table_across_the_values_of_a_column(study, tmp_path):
    made, _ = study
    write(tmp_path / "results" / "two.json", [{**row, "wind": wind} for row in ROWS for wind in ("3", "9")])
    made.columns["wind"] = harness.Column("wind [m/s]")
    across = tables.table("two", {}, "number, twice by wind").splitlines()
    assert across[0] == "| number | wind [m/s] 3 | 9 |"
    assert across[2] == "| 1 | 2 | 2 |"
    assert tables.table("two", {"wind": ["9"], "number": ["2"]}, "number, wind").splitlines()[2:] == ["| 2 | 9 |"]


def test_a_typed_table_stays_and_is_marked(study):
    page = "[two.json](../../results/two.json \"table number='1'; number, twice\")\n\n| number |\n|---|\n| 7 |\n"
    assert "Typed by hand" in tables.checked(page, "page")
    assert tables.checked(page, "page").endswith("| 7 |\n")
