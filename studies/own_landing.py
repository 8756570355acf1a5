"""Who lands a real ArduCopter or PX4 on a deck: its own precision landing, or our pilot?

Our pilot approaches in both. `tools/land_outside.py` flies one landing after another; each is kept in
out/studies/own_landing by what flew it, so that a stopped row resumes. SHIPLAND_ARDUCOPTER and SHIPLAND_PX4 name the
binaries, SHIPLAND_ARDUCOPTER_DEFAULTS ArduPilot's own files of parameters, with spaces between.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shipland.errors import DataError
from shipland.record.info import config_digest
from studies.harness import PACKAGE, PARTS, ROOT, Case, Column, Row, Study, digest, share

SCENARIO = "ship-sea5"
BINARIES = {"ArduCopter": "SHIPLAND_ARDUCOPTER", "PX4": "SHIPLAND_PX4"}
TAKE_OFF = {"ArduCopter": ("--boot-s", "1"), "PX4": ("--boot-s", "5", "--autopilot", "px4", "--instance", "1")}
WHO = {"itself": ("--own-landing",), "our pilot": ()}
CELLS = ((5, 0.0, 0.3), (5, 2.0, 0.3), (6, 2.0, 0.3))
"""Sea state, speed of the ship [m/s], latency of the pictures [s]: twenty minutes an autopilot, in real time."""
HELD = (
    *("--set", "wind.mean_mps=0", "--set", "ship.course.kind=straight", "--set", "ship.course.start_s=0"),
    *("--set", "start.distance_m=5", "--set", "start.distance_half_range_m=1"),
    *("--speed", "0.8", "--limit-s", "75"),
)
MOST_BEHIND_S = 0.05
"""A flight whose world fell behind the clock by more does not count."""
FLOWN = (
    *("camera.py", "cue.py", "estimation", "flight.py", "frames.py", "geometric.py", "guidance", "rig.py", "safety"),
    *("scenario", "sim", "sitl", "vehicles", "vision"),
)
"""Of the package: another process flies."""
TOOLS = ("tools/land_outside.py", "tools/slow_clock", "examples/arducopter.toml", "examples/arducopter.parm")
TOOLS += ("examples/precision-landing.parm", "examples/px4.toml", "examples/px4.parm")


def cases() -> Sequence[Case]:
    """Who lands innermost."""
    named = ("autopilot", "sea", "deck_mps", "lag_s", "who")
    rows = itertools.product(BINARIES, CELLS, WHO)
    return [dict(zip(named, (autopilot, *cell, who), strict=True)) for autopilot, cell, who in rows]


def landing(case: Case, seed: int) -> dict[str, Any]:
    """One flight, as the tool tells it; flown unless one that counts is kept."""
    sets = ("ship.sea.sea_state={sea}", "ship.course.speed_mps={deck_mps}", "delays.video_s={lag_s}")
    autopilot, binary = str(case["autopilot"]), BINARIES[str(case["autopilot"])]
    options = [*HELD, *TAKE_OFF[autopilot], *WHO[str(case["who"])]]
    options += [word for key in sets for word in ("--set", key.format(**case))]
    options += ["--defaults", *os.environ.get(f"{binary}_DEFAULTS", "").split()]
    source = digest([*(PACKAGE / part for part in (*FLOWN, "configs")), *(ROOT / part for part in TOOLS)])
    by = {"options": options, "binary": os.environ[binary], "source": source}
    out = PARTS / "own_landing" / config_digest(by) / str(seed)
    kept = out / f"{SCENARIO}.json"
    if not kept.exists() or not counts(_row(kept)):
        command = [sys.executable, str(ROOT / "tools" / "land_outside.py"), "--scenario", SCENARIO, *options]
        subprocess.run([*command, "--seeds", "1", "--first", str(seed), "--out", str(out)], check=True)
    return _row(kept)


def _row(path: Path) -> dict[str, Any]:
    (row,) = json.loads(path.read_text(encoding="utf-8"))
    return dict(row)


def counts(row: dict[str, Any]) -> bool:
    """Whether it flew, in a world that kept up with the clock."""
    return bool(row.get("world_fell_behind_s", math.inf) <= MOST_BEHIND_S)


def _cause(row: dict[str, Any]) -> str:
    """Why it did not land, without figures; nothing where it did."""
    reason = str(row["reason"])
    if reason.startswith(("it flies", "no verdict", "the flight controller has gone")):  # ended by us
        return "in the air at the end"
    return "" if reason.startswith("landed") else reason.split(":")[0]


def measure(case: Case, runs: int) -> Row:
    """Flights with the seeds 1 … runs.

    Raises:
        DataError: none counts.
    """
    flown = [landing(case, seed) for seed in range(1, runs + 1)]
    counted = list(filter(counts, flown))
    if not counted:
        raise DataError(f"no flight counts; the last: {flown[-1]['reason']}; {flown[-1]['fly']}")
    good = sum(row["success"] for row in counted)
    off_m = [row["off_m"] for row in counted if "off_m" in row]
    rest_s = [float(row["rest"].split()[3]) for row in counted if row["rest"]]
    return {
        "flights": len(counted),
        "late": runs - len(counted),
        "success": share(good, len(counted)),
        "off_m": float(np.median(off_m)) if off_m else None,
        "most_m": max(off_m, default=None),
        "rest_s": float(np.median(rest_s)) if rest_s else None,
        "others": "; ".join(f"{count} {cause}" for cause, count in Counter(map(_cause, counted)).items() if cause),
    }


STUDY = Study(
    question="Who lands a real ArduCopter or PX4 on a deck: its own precision landing, or our pilot?",
    columns={
        "autopilot": Column("autopilot"),
        "sea": Column("sea state", "d"),
        "deck_mps": Column("deck [m/s]", "g"),
        "lag_s": Column("pictures' latency [s]", "g"),
        "who": Column("who lands"),
        "flights": Column("flights", "d"),
        "late": Column("not counted", "d"),
        "success": Column("in the square [%] (95 % interval)", ".0f", 100.0),
        "off_m": Column("off the centre, median [cm]", ".0f", 100.0),
        "most_m": Column("at most [cm]", ".0f", 100.0),
        "rest_s": Column("from the touch to motors at rest, median [s]", ".1f"),
        "others": Column("did not land"),
    },
    cases=cases,
    measure=measure,
    runs=6,
    minutes=90,
    files=(*TOOLS, *(f"src/shipland/{part}" for part in FLOWN)),
    alone=True,
    needs=tuple(BINARIES.values()),
)
