"""Hostile inputs by the hour: flights, pictures, configurations, logs, networks, calibrations, datagrams, signals.

    python tools/fuzz.py                                   # an hour, the same time for each target
    python tools/fuzz.py --minutes 5 --only logs pictures
    python tools/fuzz.py --only logs --seed 4711 --count 1 # once more what seed 4711 found

A target is a function of a random generator, in a folder of its own, that raises when something does not hold; the same
seed gives the same input. Each runs in a process of its own: one that crashes or hangs is a finding too. A finding's
folder is kept in out/fuzz/TARGET-SEED, with what was raised and the command that repeats it; of those raised at one
line of code the first.
"""

from __future__ import annotations

import importlib
import logging
import multiprocessing
import os
import re
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import tyro
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

TARGETS = {
    "pilots": "fuzz_flight:pilots",
    "results": "fuzz_flight:results",
    "signals": "fuzz_flight:signals",
    "pictures": "fuzz_files:pictures",
    "configurations": "fuzz_files:configurations",
    "logs": "fuzz_files:logs",
    "networks": "fuzz_files:networks",
    "calibrations": "fuzz_files:calibrations",
    "mavlink": "fuzz_link:mavlink",
}
"""`module:function` by name; the modules lie beside this file."""

HANG_S = 120.0
"""A single input that takes longer hangs."""


def target(path: str) -> Callable[[np.random.Generator], None]:
    """The function of a target, `module:function`."""
    module, _, function = path.partition(":")
    found: Callable[[np.random.Generator], None] = getattr(importlib.import_module(module), function)
    return found


def run(path: str, seed: int, folder: Path, parent: Connection) -> None:
    """Inputs from `seed` on, within `folder`; tells the parent each seed begun, and what it raised."""
    logging.disable()
    os.chdir(folder)
    function = target(path)
    while True:
        parent.send((seed, ""))
        try:
            function(np.random.default_rng(seed))
        except Exception:
            parent.send((seed, traceback.format_exc()))
            parent.recv()  # the folder has been kept
        for item in folder.iterdir():
            shutil.rmtree(item) if item.is_dir() else item.unlink()
        seed += 1


def steps(path: str, seed: int, folder: Path) -> Iterator[tuple[int, str]]:
    """Each seed begun with an empty text, and each finding with its words; without end."""
    context = multiprocessing.get_context("spawn")
    while True:
        ours, theirs = context.Pipe()
        child = context.Process(target=run, args=(path, seed, folder, theirs), daemon=True)
        child.start()
        theirs.close()
        try:
            while ours.poll(HANG_S):
                seed, words = ours.recv()
                yield seed, words
                if words:
                    ours.send(None)
            yield seed, f"hangs: no end in {HANG_S:g} s"
        except EOFError:
            child.join()
            yield seed, f"the process died: exit code {child.exitcode}"
        finally:
            child.kill()
            child.join()
        seed += 1


def where(words: str) -> str:
    """What makes two findings one: the last line of code and the kind of error."""
    lines = re.findall(r'File "[^"]+", line \d+', words)
    last = words.strip().splitlines()[-1]
    return f"{lines[-1] if lines else ''} {last.partition(':')[0]}"


def keep(name: str, seed: int, words: str, folder: Path, out: Path) -> None:
    """Put a finding where it is found."""
    place = out / f"{name}-{seed}"
    shutil.copytree(folder, place, dirs_exist_ok=True)
    repeat = f"python tools/fuzz.py --only {name} --seed {seed} --count 1"
    (place / "finding.txt").write_text(f"{words.rstrip()}\n\nrepeat: {repeat}\n", encoding="utf-8")


def fuzz(name: str, seed: int, seconds: float, count: int | None, out: Path, progress: Progress) -> int:
    """Run one target for so long, or so many inputs; how many findings it made."""
    task = progress.add_task(name, total=count or seconds, words="")
    begun_s, done, found = time.monotonic(), 0, set[str]()
    with tempfile.TemporaryDirectory() as scratch:
        running = steps(TARGETS[name], seed, Path(scratch))
        for at, words in running:
            spent_s = time.monotonic() - begun_s
            if words and where(words) not in found:
                found.add(where(words))
                keep(name, at, words, Path(scratch), out)
                progress.console.print(f"{name}, seed {at}: {words.strip().splitlines()[-1]}", markup=False)
            done = at - seed
            progress.update(task, completed=min(count or seconds, done if count else spent_s))
            progress.update(task, words=f"{done} inputs, {len(found)} findings")
            if not words and (done >= count if count else spent_s >= seconds):
                break
        running.close()
    return len(found)


def main(
    minutes: float = 60.0,
    count: int | None = None,
    only: tuple[str, ...] = tuple(TARGETS),
    seed: int = 1,
    out: Path = Path("out/fuzz"),
) -> None:
    """Fuzz; exit 1 when there are findings.

    Args:
        minutes: of all targets together.
        count: inputs of each target, in place of a time.
        only: targets.
        seed: of the first input.
        out: folder of the findings.
    """
    if unknown := set(only) - TARGETS.keys():
        sys.exit(f"fuzz: no target is called {', '.join(sorted(unknown))}; there are: {', '.join(TARGETS)}")
    seconds, out, found = 60.0 * minutes / len(only), out.absolute(), 0
    columns = (
        TextColumn("{task.description:14s}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[words]}"),
    )
    with Progress(*columns) as progress:
        for name in only:
            found += fuzz(name, seed, seconds, count, out, progress)
    if found:
        sys.exit(f"{found} findings in {out}")


if __name__ == "__main__":
    tyro.cli(main)
