"""How fast flights go, beside other quadrotor simulators on the same machine in the same minutes.

Rounds alternate between ours and theirs, so that a busy machine slows all alike; medians of the rounds, by processor
time of one process. RotorPy and PyFlyt live in an environment of their own: `make peers` makes it, without it their
rows are left out. Last, by the clock, landings a minute of `shipland campaign` with one worker and with two.

OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/peers.py [rounds] [landings]
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

PYTHON = Path(os.environ.get("SHIPLAND_PEERS", Path(__file__).parents[1] / ".venv-peers/bin/python"))
SCENARIO = "rig-natops"
SEEDS = range(1, 6)
HOVER_S = 20.0

Rate = tuple[float, float]
"""Steps, and simulated seconds, in a second of one core."""


def shipland_rate(pilot: str) -> Rate:
    """Whole near landings: physics, wind, contacts, geometric camera, vision, pilot and safety."""
    from landings import flown

    from shipland.scenario.scenario import load_scenario
    from shipland.sim.world import STEP_S

    scenario = load_scenario(SCENARIO)
    flown(scenario, pilot, 99)
    flights = [flown(scenario, pilot, seed) for seed in SEEDS]
    spent_s, simulated_s = sum(flight[0] for flight in flights), sum(flight[1] for flight in flights)
    return simulated_s / STEP_S / spent_s, simulated_s / spent_s


def rotorpy_rate() -> Rate:
    """RotorPy's Environment: a Crazyflie and its SE(3) controller in a hover, as its examples make it."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.environments import Environment
    from rotorpy.trajectories.hover_traj import HoverTraj
    from rotorpy.vehicles.crazyflie_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    def hover(seconds: float) -> None:
        world = Environment(Multirotor(quad_params), SE3Control(quad_params), HoverTraj(), sim_rate=100)
        world.run(t_final=seconds, terminate=None, plot=False, animate_bool=False, verbose=False)

    hover(1.0)
    started_s = time.process_time()
    hover(HOVER_S)
    spent_s = time.process_time() - started_s
    return 100.0 * HOVER_S / spent_s, HOVER_S / spent_s


def pyflyt_rate() -> Rate:
    """PyFlyt's Aviary: its QuadX in a hover under its own position controller, physics at its 240 Hz."""
    import numpy as np
    from PyFlyt.core import Aviary

    env = Aviary(np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3)), drone_type="quadx", seed=1)
    env.set_mode(7)
    env.set_setpoint(0, np.array([0.0, 0.0, 0.0, 1.0]))
    for _ in range(20):
        env.step()
    begun_s, started_s = env.elapsed_time, time.process_time()
    while env.elapsed_time - begun_s < HOVER_S:
        env.step()
    spent_s, simulated_s = time.process_time() - started_s, env.elapsed_time - begun_s
    env.disconnect()
    return env.physics_hz * simulated_s / spent_s, simulated_s / spent_s


PEERS: dict[str, Callable[[], Rate]] = {"rotorpy": rotorpy_rate, "pyflyt": pyflyt_rate}
ROWS = {
    "shipland, whole near landings, pilot `horizon`": ("horizon", 500),
    "shipland, the same, pilot `paper`": ("paper", 500),
    "RotorPy 3.0.0, a hover, SE(3) controller": ("rotorpy", 100),
    "PyFlyt 0.29.0, a hover, position controller": ("pyflyt", 240),
}


def measured(name: str) -> Rate:
    """One round of one row, in a process of its own."""
    python = str(PYTHON) if name in PEERS else sys.executable
    done = subprocess.run([python, "-W", "ignore", __file__, name], check=True, capture_output=True, text=True)
    steps, seconds = json.loads(done.stdout.strip().splitlines()[-1])
    return steps, seconds


def landings_a_minute(workers: int, landings: int) -> float:
    """By the clock, what a few landings and the start take taken off."""

    def clocked(runs: int) -> float:
        with tempfile.TemporaryDirectory() as folder:
            flags = ["--runs", str(runs), "--workers", str(workers), "--oracle-motions", "0", "--out", folder]
            command = [sys.executable, "-W", "ignore", "-m", "shipland", "campaign", "--scenario", SCENARIO]
            started_s = time.perf_counter()
            subprocess.run([*command, "--pilot", "horizon", *flags], check=True, capture_output=True)
            return time.perf_counter() - started_s

    few = 4 * workers
    return 60.0 * landings / (clocked(few + landings) - clocked(few))


def main(rounds: int = 3, landings: int = 40) -> None:
    """Print the tables."""
    rows = {label: row for label, row in ROWS.items() if row[0] not in PEERS or PYTHON.exists()}
    rates: dict[str, list[Rate]] = {label: [] for label in rows}
    for _ in range(rounds):
        for label, (name, _) in rows.items():
            rates[label].append(measured(name))
    print("| one quadrotor, one core | physics [Hz] | steps a second | simulated seconds a second |")
    print("|---|---:|---:|---:|")
    for label, (_, physics_hz) in rows.items():
        steps, seconds = (statistics.median(column) for column in zip(*rates[label], strict=True))
        print(f"| {label} | {physics_hz} | {steps:,.0f} | {seconds:.0f} |", flush=True)
    if len(rows) < len(ROWS):
        print("\nRotorPy and PyFlyt are not here: `make peers` installs them.")
    print(f"\n| `campaign`, {SCENARIO}, pilot `horizon` | landings a minute |\n|---|---:|")
    for workers in (1, 2):
        print(f"| workers: {workers} | {landings_a_minute(workers, landings):.0f} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] and not sys.argv[1].isdigit():
        peer = sys.argv[1]
        print(json.dumps(PEERS[peer]() if peer in PEERS else shipland_rate(peer)))
    else:
        main(*map(int, sys.argv[1:3]))
