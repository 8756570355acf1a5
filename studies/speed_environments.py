"""Steps a second of the environments on one core, by processor time, and what a reset costs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from shipland.environments import LANDING, LAST_PHASE
from studies.harness import Case, Column, Row, Study

KINDS: dict[str, tuple[str, float, dict[str, Any]]] = {
    "`Landing-v0`, sticks, random, dict": (LANDING, 1.0, {}),
    "`Landing-v0`, sticks, random, flat": (LANDING, 1.0, {"observation": "flat"}),
    "`Landing-v0`, residual on horizon, zero": (LANDING, 1.0, {"action": "residual"}),
    "`Landing-v0`, residual, zero, rendered": (LANDING, 0.02, {"action": "residual", "vision": "rendered"}),
    "`LastPhase-v0`, residual, zero": (LAST_PHASE, 1.0, {"scenario": "near"}),
}
"""Name: environment, share of the steps that it makes, how it is made."""


def cases() -> Sequence[Case]:
    """Environments."""
    return [{"environment": name} for name in KINDS]


def measure(case: Case, runs: int) -> Row:
    """`runs` steps; real time counts resets too."""
    name = str(case["environment"])
    environment, share, made = KINDS[name]
    env, rng, steps = gymnasium.make(environment, **made), np.random.default_rng(1), max(int(share * runs), 1)
    zero = np.zeros(env.action_space.shape or (), np.float32)
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
        action = rng.uniform(-1.0, 1.0, zero.shape).astype(np.float32) if "random" in name else zero
        started_s = time.process_time()
        _, _, terminated, truncated, info = env.step(action)
        step_s += time.process_time() - started_s
        over = terminated or truncated
    flown_s += info["t_s"]
    env.close()
    rates = {"steps_hz": steps / step_s, "real_time": flown_s / (step_s + reset_s), "reset_s": reset_s / resets}
    return {"steps": steps, **rates}


STUDY = Study(
    question="What does a step of an environment cost?",
    columns={
        "environment": Column("environment (`near`)"),
        "steps": Column("steps", "d"),
        "steps_hz": Column("steps a second", ".0f"),
        "real_time": Column("× real time", ".1f"),
        "reset_s": Column("reset [ms]", ".0f", 1e3),
    },
    cases=cases,
    measure=measure,
    runs=1000,
    minutes=1,
    alone=True,
)
