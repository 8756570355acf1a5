"""Cost of a cycle of the near flight, split into physics, picture, vision, control and record; real-time factor."""

from __future__ import annotations

import time

from shipland.bench.fly import fly_quietly
from shipland.bench.scenarios import load_scenario, scenario_table
from shipland.flight import Stage


def main() -> None:
    """Fly two seeds and print the table."""
    scenario = load_scenario(scenario_table("near"))
    print(
        "| seed | flight [s] | wall [s] | real-time factor | cycles | physics + picture [ms] | vision [ms] | control [ms] |"
    )
    print("|---:|---:|---:|---:|---:|---:|---:|---:|")
    for seed in (1, 2):
        started_s = time.perf_counter()
        flown = fly_quietly(scenario, "paper", "rendered", seed)
        wall_s = time.perf_counter() - started_s
        result = flown.result
        per_cycle = {stage: 1e3 * cost_s / max(result.cycles, 1) for stage, cost_s in result.cost_s.items()}
        print(
            f"| {seed} | {result.t_s:.1f} | {wall_s:.1f} | {result.t_s / wall_s:.2f} | {result.cycles} | "
            f"{per_cycle[Stage.READ]:.1f} | {per_cycle[Stage.SEE]:.2f} | {per_cycle[Stage.DECIDE]:.2f} |"
        )


if __name__ == "__main__":
    main()
