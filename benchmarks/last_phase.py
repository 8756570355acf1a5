"""Steps a second of `shipland/LastPhase-v0` on one core by the number of flights, beside one flight of the real loop.

OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python benchmarks/last_phase.py [steps]
"""

from __future__ import annotations

import sys
import time

import gymnasium
import numpy as np
import torch

import shipland.environments
from shipland.environments.last_phase import LastPhaseEnv


def loop_rate(steps: int) -> float:
    """Of `shipland/Landing-v0`, a residual of zero on `horizon` in `rig-natops`."""
    env = gymnasium.make(shipland.environments.LANDING, scenario="rig-natops", action="residual")
    zero, spent_s, over = np.zeros(4, np.float32), 0.0, True
    for seed in range(1, steps + 1):
        if over:
            env.reset(seed=seed)
        started_s = time.process_time()
        _, _, terminated, truncated, _ = env.step(zero)
        spent_s += time.process_time() - started_s
        over = terminated or truncated
    env.close()
    return steps / spent_s


def batched_rate(flights: int, steps: int) -> float:
    """Of the batched model."""
    env = LastPhaseEnv(flights, motions=4)
    zero = np.zeros((flights, 2), np.float32)
    env.reset(seed=1)
    env.step(zero)
    started_s = time.process_time()
    for _ in range(steps):
        env.step(zero)
    return flights * steps / (time.process_time() - started_s)


def main(steps: int = 300) -> None:
    """Print the table."""
    torch.set_num_threads(1)
    alone = loop_rate(4 * steps)
    print("| environment | flights | steps a second | ratio |")
    print("|---|---:|---:|---:|")
    print(f"| `shipland/Landing-v0`, residual of zero | 1 | {alone:,.0f} | 1 |")
    for flights in (1, 16, 256, 1024, 4096):
        rate = batched_rate(flights, steps)
        print(
            f"| `shipland/LastPhase-v0`, residual of zero | {flights} | {rate:,.0f} | {rate / alone:.1f} |", flush=True
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
