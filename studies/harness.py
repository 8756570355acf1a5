"""Runs a study: cases in worker processes, rows kept as soon as they are measured, and where they come from."""

from __future__ import annotations

import ast
import hashlib
import importlib
import json
import math
import os
import platform
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any

from rich.progress import Progress

from shipland.errors import DataError
from shipland.files import write_atomically
from shipland.statistics import Interval, share_interval
from shipland.version import code_version
from shipland.workers import die_with_parent

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "shipland"
CODE = (PACKAGE, ROOT / "studies", ROOT / "tests")
PLUMBING = {
    *(f"studies/{name}.py" for name in ("__init__", "__main__", "harness", "tables")),
    *(f"src/shipland/{name}.py" for name in ("errors", "factories", "files", "former", "progress", "stopping")),
    *(f"src/shipland/{name}.py" for name in ("record/__init__", "record/info", "version", "workers")),
    *(f"src/shipland/evaluation/{name}.py" for name in ("__init__", "campaign", "folder", "job", "leaderboard")),
    *(f"src/shipland/evaluation/{name}.py" for name in ("suite", "tables", "tally")),
}
"""Files that run a study and keep its flights, and decide no figure."""
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
        minutes: about how long all of it takes on two cores.
        picture: draws all rows into a file: docs/pictures/NAME.png.
        files: files and folders that the rows depend on, besides what was imported to measure them, configuration and
            weights: of processes of their own, or read.
        alone: one case after the other, for measurements of time.
        needs: environment variables that must name what it reads or runs; without one the study is left out.
    """

    question: str
    columns: Mapping[str, Column]
    cases: Callable[[], Sequence[Case]]
    measure: Callable[[Case, int], Row | Sequence[Row]]
    runs: int
    minutes: float
    picture: Callable[[Sequence[Row], Path], None] | None = None
    files: tuple[str, ...] = ()
    alone: bool = False
    needs: tuple[str, ...] = ()


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


def code_digest(source: bytes) -> bytes:
    """SHA-256 of what Python parses: comments, docstrings and the layout of lines do not count."""
    return hashlib.sha256(repr(_parsed(ast.parse(source))).encode()).digest()


def file_digest(path: Path) -> bytes:
    """SHA-256 of a file; of Python's code."""
    return _file_digest(path, path.stat().st_mtime_ns)


@cache
def _file_digest(path: Path, _mtime_ns: int) -> bytes:
    data = path.read_bytes()
    return code_digest(data) if path.suffix == ".py" else hashlib.sha256(data).digest()


def digest(paths: Iterable[Path], digest_of: Callable[[Path], bytes] = file_digest) -> str:
    """SHA-256 over files, and over the files of folders, with their places in the repository."""
    found = hashlib.sha256()
    for path in paths:
        for file in _files_of(path):
            found.update(f"{file.relative_to(ROOT)}\0".encode() + digest_of(file))
    return found.hexdigest()[:16]


def _files_of(path: Path) -> list[Path]:
    files = sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else [path]
    return [file for file in files if file.suffix != ".pyc"]


def imported() -> set[str]:
    """Files of the checkout that this process has imported, without those that no figure depends on.

    Raises:
        DataError: shipland is not imported from the checkout, whose results these would be.
    """
    paths = {Path(file) for module in list(sys.modules.values()) if (file := getattr(module, "__file__", None))}
    files = {str(path.relative_to(ROOT)) for path in paths if any(path.is_relative_to(part) for part in CODE)}
    if PACKAGE / "__init__.py" not in paths:
        raise DataError(f"shipland is not imported from {PACKAGE}: install the checkout with make setup")
    return files - PLUMBING


def source_of(
    name: str, study: Study, modules: Iterable[str], digest_of: Callable[[Path], bytes] = file_digest
) -> dict[str, str]:
    """Digests of what rows depend on.

    Args:
        name: of the study.
        study: what it reads.
        modules: files that were imported to measure the rows.
        digest_of: see `file_digest`.
    """
    campaign = CAMPAIGNS / f"{name}.toml"
    own = [campaign if campaign.exists() else ROOT / "studies" / f"{name}.py", *(ROOT / part for part in study.files)]
    modules = sorted(modules)
    return {
        "modules": " ".join(modules),
        "code": digest([*own, *(ROOT / module for module in modules)], digest_of),
        "configuration": digest([PACKAGE / "configs"], digest_of),
        "weights": digest([PACKAGE / "weights"], digest_of),
    }


def is_current(name: str, study: Study, found: Mapping[str, Any]) -> bool:
    """Whether results are of the code, configuration and weights that are here."""
    try:
        return bool(found["source"] == source_of(name, study, found["source"].get("modules", "").split()))
    except FileNotFoundError:  # a module that is gone
        return False


def read(path: Path) -> dict[str, Any] | None:
    """A file of results; None where there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def measure(name: str, case: Case, runs: int) -> tuple[list[dict[str, Any]], set[str]]:
    """The rows of a case, and the files imported to measure them, and whatever this process measured before."""
    found = load(name).measure(case, runs)
    return [{**case, **row} for row in ([found] if isinstance(found, Mapping) else found)], imported()


def _begin_worker() -> None:
    """Ctrl-C reaches the whole group and the parent alone answers it; without the parent a worker ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=die_with_parent, args=(parent_process().sentinel,), daemon=True).start()


def _kept(path: Path, name: str, study: Study, runs: int) -> tuple[list[dict[str, Any]], set[str]]:
    """Rows of a run of the same code, configuration, weights and number of runs, and its modules; none else."""
    kept = read(path)
    if not kept or kept["runs"] != runs or not is_current(name, study, kept):
        return [], set()
    return kept["rows"], set(kept["source"]["modules"].split())


def rows_of(rows: Sequence[dict[str, Any]], case: Case) -> list[dict[str, Any]]:
    """The rows of a case, in order; none where it was not measured."""
    return [row for row in rows if all(row.get(key) == value for key, value in case.items())]


def cases_where(study: Study, where: Mapping[str, str]) -> list[Case]:
    """The cases that have these values, or one of several with commas between, in these columns."""
    wanted = {key: {value, *value.split(",")} for key, value in where.items()}
    return [case for case in study.cases() if all(str(case.get(key)) in values for key, values in wanted.items())]


def run(
    name: str, study: Study, runs: int | None = None, workers: int = 2, where: Mapping[str, str] | None = None
) -> bool:
    """Measure the cases that are missing; whether all were measured. Ctrl-C ends the cases under way and keeps them.

    Results whose cases are complete go to results/NAME.json; with another number of runs, or of some cases only, they
    stay in out/studies/.
    """
    count = study.runs if runs is None else runs
    part = PARTS / f"{name}-{count}.json"
    cases = cases_where(study, where or {})
    rows, modules = _kept(part, name, study, count)
    if not rows and count == study.runs:
        rows, modules = _kept(RESULTS / f"{name}.json", name, study, count)
    missing = [case for case in cases if not rows_of(rows, case)]
    whole = RESULTS / f"{name}.json" if count == study.runs else part
    if not missing and (where or len(_kept(whole, name, study, count)[0]) == len(rows)):
        print(f"{name}: measured with this code already")
        return True
    kept = (read(part) or {}) if rows else {}
    spent_min, confirmed = float(kept.get("minutes", 0.0)), kept.get("confirmed")
    stopped, at_start, begun_s = False, _digests(study), time.monotonic()

    def write(to: Path) -> None:
        minutes = spent_min + (time.monotonic() - begun_s) / 60.0
        _write(to, name, study, source_of(name, study, modules, at_start), count, minutes, rows, confirmed)

    with (
        ProcessPoolExecutor(1 if study.alone else workers, get_context("spawn"), _begin_worker) as pool,
        Progress() as progress,
    ):
        bar = progress.add_task(name, total=len(cases), completed=len(cases) - len(missing))
        pending = {pool.submit(measure, name, case, count) for case in missing}
        while pending:
            try:
                for done in as_completed(pending):
                    pending.discard(done)
                    try:
                        measured, files = done.result()
                    except CancelledError:
                        continue
                    rows, modules = rows + measured, modules | files
                    write(part)
                    progress.advance(bar)
                    break
            except KeyboardInterrupt:
                stopped = True
                pending = {future for future in pending if not future.cancel()}
    if stopped or where:
        return not stopped
    rows = [row for case in cases for row in rows_of(rows, case)]
    write(whole)
    if study.picture:
        study.picture(rows, (PICTURES if count == study.runs else PARTS) / f"{name}.png")
    return True


def _digests(study: Study) -> Callable[[Path], bytes]:
    """Digests of files as they are now, whatever is edited while a study runs."""
    folders = *CODE, *(ROOT / part for part in study.files)
    return {file: file_digest(file) for folder in folders for file in _files_of(folder)}.__getitem__


def confirm(name: str, study: Study, workers: int = 2, where: Mapping[str, str] | None = None) -> str:
    """Take results of earlier code over where every tenth case, measured again, comes out to the digit.

    Seeds draw what is flown and seen, so a change of what is computed shows in nearly every figure. What another
    processor rounds otherwise, beyond eleven digits, is no change. Times are never taken over.

    Args:
        name: of the study.
        study: with its cases.
        workers: processes.
        where: takes over the cases that have these values alone; `run` measures the others.

    Returns:
        What came out, in words.
    """
    path, cases = RESULTS / f"{name}.json", cases_where(study, where or {})
    found = read(path)
    if found is None or is_current(name, study, found):
        return f"{name}: " + ("not measured yet" if found is None else "measured with this code")
    if study.alone or found["runs"] != study.runs or not all(rows_of(found["rows"], case) for case in cases):
        return f"{name}: has to be measured anew"
    sample, modules = [*cases[:-1:10], cases[-1]], set[str]()
    with ProcessPoolExecutor(workers, get_context("spawn"), _begin_worker) as pool:
        pending = [pool.submit(measure, name, case, study.runs) for case in sample]
        try:
            for case, future in zip(sample, pending, strict=True):
                rows, files = future.result()
                modules |= files
                if not _alike(json.loads(json.dumps(rows)), rows_of(found["rows"], case)):
                    return f"{name}: {dict(case)} comes out otherwise"
        finally:
            pool.shutdown(cancel_futures=True)
    same = f"{len(sample)} of {len(cases)} cases measured again by {code_version()}, to the digit"
    known = {file for file in found["source"].get("modules", "").split() if (ROOT / file).exists()}
    taken = found | {"source": source_of(name, study, modules | known), "confirmed": same}
    if where:
        same = taken["confirmed"] = f"{' '.join(map('='.join, where.items()))}: {same}"
        rows = [row for case in cases for row in rows_of(found["rows"], case)]
        taken |= {"rows": rows, "minutes": found["minutes"] * len(cases) / len(study.cases())}
    _dump(PARTS / f"{name}-{study.runs}.json" if where else path, taken)
    return f"{name}: {same}"


def _alike(one: Any, other: Any) -> bool:  # noqa: ANN401 - of JSON
    """Whether two values are the same to eleven digits, part by part."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=1e-11, abs_tol=1e-14)
    return bool(one == other)


def _write(
    path: Path,
    name: str,
    study: Study,
    source: Mapping[str, str],
    runs: int,
    minutes: float,
    rows: Sequence[Mapping[str, Any]],
    confirmed: str | None,
) -> None:
    trial = "" if runs == study.runs else f" --runs {runs}"
    table = {
        "question": study.question,
        "command": f"python -m studies {name}{trial}",
        "commit": code_version(),
        "source": source,
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} × {_processor()}",
        "minutes": round(minutes, 1),
        "drawn_by": _renderer() if "src/shipland/sim/scene/gl.py" in source["modules"].split() else None,
        "interpreter": f"{platform.python_implementation()} {platform.python_version()}",
        "confidence": 0.95,
        "runs": runs,
        "rows": rows,
    }
    _dump(path, table | ({"confirmed": confirmed} if confirmed else {}))


def _processor() -> str:
    """Its name, where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or "a processor"


@cache
def _renderer() -> str:
    """What draws here, a GPU or Mesa's llvmpipe: pictures differ by it in their last digits."""
    from shipland.sim.scene.gl import open_context

    context = open_context()
    try:
        return str(context.info["GL_RENDERER"])
    finally:
        context.release()


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
            current = "this code" if is_current(name, study, found) else "earlier code"
            state = f"measured with {current} ({found['commit']})"
        size = f"{len(study.cases())} cases × {study.runs} runs, about {study.minutes:g} min"
        lines.append(f"{name}: {study.question}\n    {size}; {state}")
    return "\n".join(lines)
