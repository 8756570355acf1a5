"""Runs a study: cases in worker processes, rows kept as soon as they are measured, and where they come from."""

from __future__ import annotations

import ast
import hashlib
import importlib
import json
import platform
import signal
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any

from rich.progress import Progress

from shipland.files import write_atomically
from shipland.statistics import Interval, share_interval
from shipland.version import code_version
from shipland.workers import die_with_parent

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
RESULTS = ROOT / "results"
"""Whole results, committed."""
CAMPAIGNS = ROOT / "studies" / "campaigns"
"""Studies of landings, as data: see `landings`."""
PARTS = ROOT / "out" / "studies"
"""Results on their way, and trials with another number of runs."""

Case = Mapping[str, str | float]
"""What distinguishes a measurement: the first columns of its rows."""
Row = Mapping[str, Any]
"""Column: a number, a text, None where there is none, or what `estimate` gives."""


@dataclass(frozen=True)
class Column:
    """How a page shows a value.

    Attributes:
        title: the table's head, with the unit in brackets.
        form: a format specification; empty for texts.
        factor: from the row's unit to the shown one.
    """

    title: str
    form: str = ""
    factor: float = 1.0


@dataclass(frozen=True)
class Study:
    """A question and how it is answered.

    Attributes:
        question: one sentence.
        columns: of the table, case and row alike, by their names.
        cases: all cases, in the table's order.
        measure: a case and a number of runs to its row, or to several that one measurement gives.
        runs: repetitions a case.
        measured: files and folders of src/shipland whose code the rows depend on.
        minutes: about how long all of it takes on two cores.
        picture: draws all rows into a file: docs/pictures/NAME.png.
        helpers: files of studies/ and tests/ that the rows depend on, besides the study's own.
        alone: one case after the other, for measurements of time.
        binary: environment variable that must name one; without it the study is left out.
    """

    question: str
    columns: Mapping[str, Column]
    cases: Callable[[], Sequence[Case]]
    measure: Callable[[Case, int], Row | Sequence[Row]]
    runs: int
    measured: tuple[str, ...]
    minutes: float
    picture: Callable[[Sequence[Row], Path], None] | None = None
    helpers: tuple[str, ...] = ()
    alone: bool = False
    binary: str = ""


def estimate(value: float, interval: Interval) -> dict[str, float]:
    """A value of a row with its 95 % interval."""
    return {"value": value, "low": interval.low, "high": interval.high}


def share(count: int, of: int) -> dict[str, float]:
    """A share of independent flights with its exact 95 % interval."""
    return estimate(count / of, share_interval(count, of))


def load(name: str) -> Study:
    """The study of studies/campaigns/NAME.toml or studies/NAME.py."""
    if (CAMPAIGNS / f"{name}.toml").exists():
        from studies.landings import landings_study

        return landings_study(CAMPAIGNS / f"{name}.toml")
    found = importlib.import_module(f"studies.{name}").STUDY
    assert isinstance(found, Study)
    return found


def _is_text(node: object) -> bool:
    """A docstring, of an attribute too."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _parsed(node: object) -> object:
    """A syntax tree as lists, without docstrings and without empty fields, in which versions of Python differ."""
    if isinstance(node, list):
        return [_parsed(each) for each in node if not _is_text(each)]
    if isinstance(node, ast.AST):
        fields = [(name, _parsed(value)) for name, value in ast.iter_fields(node)]
        return [type(node).__name__, *(field for field in fields if field[1] not in (None, []))]
    return node


@cache
def code_digest(source: bytes) -> bytes:
    """SHA-256 of what Python parses: comments, docstrings and the layout of lines do not count."""
    return hashlib.sha256(repr(_parsed(ast.parse(source))).encode()).digest()


def digest(paths: Sequence[Path]) -> str:
    """SHA-256 over files, and over the files of folders, with their places in the repository; Python by its code.

    Raises:
        FileNotFoundError: a path does not exist.
    """
    found = hashlib.sha256()
    for path in paths:
        if not path.exists():
            raise FileNotFoundError(f"{path} does not exist, though a study names it as what it measures")
        files = [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file())
        for file in files:
            if file.suffix != ".pyc":
                data = file.read_bytes()
                of_file = code_digest(data) if file.suffix == ".py" else hashlib.sha256(data).digest()
                found.update(f"{file.relative_to(ROOT)}\0".encode() + of_file)
    return found.hexdigest()[:16]


def source_of(name: str, study: Study) -> dict[str, str]:
    """Digests of what a row depends on: code measured with the study itself, configuration, weights."""
    package = ROOT / "src" / "shipland"
    campaign = CAMPAIGNS / f"{name}.toml"
    own = [campaign if campaign.exists() else ROOT / "studies" / f"{name}.py", *(ROOT / part for part in study.helpers)]
    return {
        "code": digest([*own, *(package / part for part in study.measured)]),
        "configuration": digest([package / "configs"]),
        "weights": digest([package / "weights"]),
    }


def read(path: Path) -> dict[str, Any] | None:
    """A file of results; None where there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def _measure(name: str, case: Case, runs: int) -> list[dict[str, Any]]:
    found = load(name).measure(case, runs)
    return [{**case, **row} for row in ([found] if isinstance(found, Mapping) else found)]


def _begin_worker() -> None:
    """Ctrl-C reaches the whole group and the parent alone answers it; without the parent a worker ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=die_with_parent, args=(parent_process().sentinel,), daemon=True).start()


def _rows_kept(path: Path, source: Mapping[str, str], runs: int) -> list[dict[str, Any]]:
    """Rows of an earlier run of the same code, configuration, weights and number of runs; none else."""
    kept = read(path)
    return kept["rows"] if kept and kept["source"] == source and kept["runs"] == runs else []


def rows_of(rows: Sequence[dict[str, Any]], case: Case) -> list[dict[str, Any]]:
    """The rows of a case, in order; none where it was not measured."""
    return [row for row in rows if all(row.get(key) == value for key, value in case.items())]


def cases_where(study: Study, where: Mapping[str, str]) -> list[Case]:
    """The cases that have these values in these columns."""
    return [case for case in study.cases() if all(str(case.get(key)) == value for key, value in where.items())]


def run(
    name: str, study: Study, runs: int | None = None, workers: int = 2, where: Mapping[str, str] | None = None
) -> bool:
    """Measure the cases that are missing; whether all were measured. Ctrl-C ends the cases under way and keeps them.

    Results whose cases are complete go to results/NAME.json; with another number of runs, or of some cases only, they
    stay in out/studies/.
    """
    count = study.runs if runs is None else runs
    part = PARTS / f"{name}-{count}.json"
    cases, source = cases_where(study, where or {}), source_of(name, study)
    rows = _rows_kept(part, source, count)
    if not rows and count == study.runs:
        rows = _rows_kept(RESULTS / f"{name}.json", source, count)
    missing = [case for case in cases if not rows_of(rows, case)]
    whole = RESULTS / f"{name}.json" if count == study.runs else part
    if not missing and (where or len(_rows_kept(whole, source, count)) == len(rows)):
        return True
    stopped = False
    with (
        ProcessPoolExecutor(1 if study.alone else workers, get_context("spawn"), _begin_worker) as pool,
        Progress() as progress,
    ):
        bar = progress.add_task(name, total=len(cases), completed=len(cases) - len(missing))
        pending = {pool.submit(_measure, name, case, count) for case in missing}
        while pending:
            try:
                for done in as_completed(pending):
                    pending.discard(done)
                    try:
                        rows += done.result()
                    except CancelledError:
                        continue
                    _write(part, name, study, source, count, rows)
                    progress.advance(bar)
                    break
            except KeyboardInterrupt:
                stopped = True
                pending = {future for future in pending if not future.cancel()}
    if stopped or where:
        return not stopped
    rows = [row for case in cases for row in rows_of(rows, case)]
    _write(whole, name, study, source, count, rows)
    if study.picture:
        study.picture(rows, (PICTURES if count == study.runs else PARTS) / f"{name}.png")
    return True


def confirm(name: str, study: Study, workers: int = 2) -> str:
    """Take results of earlier code over where every tenth case, measured again, comes out to the digit.

    Seeds draw what is flown and seen, so a change of what is computed shows in nearly every figure. Times are never
    taken over.

    Returns:
        What came out, in words.
    """
    path, source, cases = RESULTS / f"{name}.json", source_of(name, study), study.cases()
    found = read(path)
    if found is None or found["source"] == source:
        return f"{name}: " + ("not measured yet" if found is None else "measured with this code")
    if study.alone or found["runs"] != study.runs or not all(rows_of(found["rows"], case) for case in cases):
        return f"{name}: has to be measured anew"
    sample = [*cases[:-1:10], cases[-1]]
    with ProcessPoolExecutor(workers, get_context("spawn"), _begin_worker) as pool:
        measured = [pool.submit(_measure, name, case, study.runs) for case in sample]
        try:
            for case, future in zip(sample, measured, strict=True):
                if json.loads(json.dumps(future.result())) != rows_of(found["rows"], case):
                    return f"{name}: {dict(case)} comes out otherwise"
        finally:
            pool.shutdown(cancel_futures=True)
    same = f"{len(sample)} of {len(cases)} cases measured again by {code_version()}, to the digit"
    _dump(path, found | {"source": source, "confirmed": same})
    return f"{name}: {same}"


def _write(
    path: Path, name: str, study: Study, source: Mapping[str, str], runs: int, rows: Sequence[Mapping[str, Any]]
) -> None:
    trial = "" if runs == study.runs else f" --runs {runs}"
    table = {
        "question": study.question,
        "command": f"python -m studies {name}{trial}",
        "commit": code_version(),
        "source": source,
        "machine": f"{platform.system()} {platform.machine()}",
        "interpreter": f"{platform.python_implementation()} {platform.python_version()}",
        "confidence": 0.95,
        "runs": runs,
        "rows": rows,
    }
    _dump(path, table)


def _dump(path: Path, table: Mapping[str, Any]) -> None:
    write_atomically(path, (json.dumps(table, ensure_ascii=False, indent=1) + "\n").encode())


def listing(names: Sequence[str]) -> str:
    """A line or two on each study: question, size, duration, and whether it was measured."""
    lines = []
    for name in names:
        study = load(name)
        found = read(RESULTS / f"{name}.json")
        state = "not yet measured"
        if found:
            current = "this code" if found["source"] == source_of(name, study) else "earlier code"
            state = f"measured with {current} ({found['commit']})"
        size = f"{len(study.cases())} cases × {study.runs} runs, about {study.minutes:g} min"
        lines.append(f"{name}: {study.question}\n    {size}; {state}")
    return "\n".join(lines)
