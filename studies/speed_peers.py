"""How fast flights go, beside other quadrotor simulators on the same machine; and landings a minute of a campaign.

Theirs is a hover in still air under their own controller; ours is the whole flight: turbulence, contacts, telemetry,
delays, geometric camera, vision, pilot, safety and record. By processor time of one process, campaigns by the clock.
The others live in environments of their own (`make peers`); without these their rows are empty.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from shipland.scenario.scenario import load_scenario
from shipland.sim.world import STEP_S
from studies.harness import ROOT, Case, Column, Row, Study
from studies.speed_landings import COMPILES, flown

PEERS = Path(os.environ.get("SHIPLAND_PEERS", ROOT))
"""Where `make peers` was called."""
SCENARIO = "rig-natops"
SEEDS = range(1, 6)
OURS = {"shipland, whole near landings, `horizon`": "horizon", "shipland, the same, `paper`": "paper"}
THEIRS = {
    "RotorPy 3.0.0, a hover, SE(3) controller": ("rotorpy", ".venv-peers", 100),
    "PyFlyt 0.29.0, a hover": ("pyflyt", ".venv-peers", 240),
    "Crazyflow 0.4.0, a hover": ("crazyflow", ".venv-crazyflow", 500),
    "Crazyflow 0.4.0, a thousand hovers at once": ("crazyflow-1000", ".venv-crazyflow", 500),
}
"""Name, environment and physics [Hz]."""
CAMPAIGNS = {"`shipland campaign`, 1 worker": 1, "`shipland campaign`, 2 workers": 2}
FEW, MANY = 4, 44
"""Landings a worker whose difference in time is counted: what the start takes falls out."""


def cases() -> Sequence[Case]:
    """Ours, theirs, campaigns."""
    groups = {"one core": (*OURS, *THEIRS), "campaigns": CAMPAIGNS}
    return [{"group": group, "what": what} for group, names in groups.items() for what in names]


def measure(case: Case, runs: int) -> Row:
    """Median of `runs` rounds."""
    what = str(case["what"])
    if what in CAMPAIGNS:
        return {"landings_a_minute": statistics.median(landings_a_minute(CAMPAIGNS[what]) for _ in range(runs))}
    if what in OURS:
        rates, physics_hz = [our_rate(OURS[what]) for _ in range(runs)], round(1.0 / STEP_S)
    elif (python := PEERS / THEIRS[what][1] / "bin" / "python").exists():
        name, _, physics_hz = THEIRS[what]
        rates = [peer_rate(python, name) for _ in range(runs)]
    else:
        return {}
    steps_hz, real_time = (statistics.median(column) for column in zip(*rates, strict=True))
    return {"physics_hz": physics_hz, "steps_hz": steps_hz, "real_time": real_time}


def our_rate(pilot: str) -> tuple[float, float]:
    """Whole near landings: steps, and simulated seconds, in a second of one core."""
    scenario = load_scenario(SCENARIO)
    flown(scenario, pilot, COMPILES)
    flights = [flown(scenario, pilot, seed) for seed in SEEDS]
    spent_s, simulated_s = sum(flight[0] for flight in flights), sum(flight[1] for flight in flights)
    return simulated_s / STEP_S / spent_s, simulated_s / spent_s


def peer_rate(python: Path, name: str) -> tuple[float, float]:
    """The same of a peer, in its own environment."""
    command = [str(python), "-W", "ignore", str(ROOT / "studies" / "peer_hover.py"), name]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    steps_hz, real_time = json.loads(done.stdout.strip().splitlines()[-1])
    return steps_hz, real_time


def landings_a_minute(workers: int) -> float:
    """By the clock."""

    def clocked_s(landings: int) -> float:
        with tempfile.TemporaryDirectory() as folder:
            flags = ["--runs", str(landings), "--workers", str(workers), "--oracle-motions", "0", "--out", folder]
            command = [sys.executable, "-W", "ignore", "-m", "shipland", "campaign", "--scenario", SCENARIO]
            started_s = time.perf_counter()
            subprocess.run([*command, "--pilot", "horizon", *flags], check=True, capture_output=True)
            return time.perf_counter() - started_s

    return 60.0 * workers * (MANY - FEW) / (clocked_s(workers * MANY) - clocked_s(workers * FEW))


STUDY = Study(
    question="How fast do flights go, beside other simulators?",
    columns={
        "what": Column("one quadrotor"),
        "physics_hz": Column("physics [Hz]", ".0f"),
        "steps_hz": Column("steps a second", ",.0f"),
        "real_time": Column("simulated seconds a second", ".0f"),
        "landings_a_minute": Column("landings a minute", ".0f"),
    },
    cases=cases,
    measure=measure,
    runs=3,
    minutes=6,
    alone=True,
    files=("studies/peer_hover.py", "src/shipland/evaluation"),
)
