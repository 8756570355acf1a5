"""Steps a second of the environments on one core, by processor time, and what a reset costs.

OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1 python benchmarks/environments.py [steps]
"""

from __future__ import annotations

import sys
import time
from typing import Any

import gymnasium
import numpy as np

import shipland.environments

LANDING, LAST_PHASE = shipland.environments.LANDING, shipland.environments.LAST_PHASE
ROWS: tuple[tuple[str, str, float, dict[str, Any]], ...] = (
    ("sticks, random, dict", LANDING, 1.0, {}),
    ("sticks, random, flat", LANDING, 1.0, {"observation": "flat"}),
    ("residual on horizon, zero", LANDING, 1.0, {"action": "residual"}),
    ("residual on horizon, zero, rendered", LANDING, 0.02, {"action": "residual", "vision": "rendered"}),
    ("last phase, residual, zero", LAST_PHASE, 1.0, {"scenario": "near"}),
)


def measure(name: str, environment: str, steps: int, make: dict[str, Any]) -> str:
    """A row of the table."""
    env, rng = gymnasium.make(environment, **make), np.random.default_rng(1)
    random, zero = "random" in name, np.zeros(env.action_space.shape or (), np.float32)
    env.reset(seed=0)
    env.step(zero)  # what is compiled, is compiled now
    reset_s, step_s, flown_s, resets, over, info = 0.0, 0.0, 0.0, 0, True, {"t_s": 0.0}
    for _ in range(steps):
        if over:
            flown_s += info["t_s"]
            resets += 1
            started_s = time.process_time()
            env.reset(seed=resets)
            reset_s += time.process_time() - started_s
        action = rng.uniform(-1.0, 1.0, zero.shape).astype(np.float32) if random else zero
        started_s = time.process_time()
        _, _, terminated, truncated, info = env.step(action)
        step_s += time.process_time() - started_s
        over = terminated or truncated
    flown_s += info["t_s"]
    env.close()
    cells = f"{steps} | {steps / step_s:.0f} | {flown_s / (step_s + reset_s):.0f} | {1e3 * reset_s / resets:.0f}"
    return f"| {name} | {cells} |"


def main(steps: int = 2000) -> None:
    """Print the table."""
    print("| environment (`near`) | steps | steps a second | × real time | reset [ms] |")
    print("|---|---:|---:|---:|---:|")
    for name, environment, share, make in ROWS:
        print(measure(name, environment, max(int(share * steps), 1), make), flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
