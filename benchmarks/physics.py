"""Cost of the physics in processor time, one core: far, near, on the deck, and through the vehicle."""

from __future__ import annotations

import time

import numpy as np

from shipland.config import merge
from shipland.messages import Intent, PilotCommand
from shipland.scenario.autonomy import build_vehicle
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table
from shipland.sim.world import STEP_S

SECONDS = 10.0


def scenario(distance_m: float, height_m: float) -> Scenario:
    """The packaged near scenario under NATOPS motion, from an exact start."""
    start = {
        "distance_m": distance_m,
        "distance_half_range_m": 0.0,
        "bearing_half_range_deg": 0.0,
        "height_m": height_m,
        "height_half_range_m": 0.0,
    }
    return load_scenario(merge(scenario_table("near"), {"start": start, "ship": {"motion": "natops"}}))


def row(name: str, simulated_s: float, cpu_s: float) -> None:
    """One line of the table."""
    steps = simulated_s / STEP_S
    print(f"| {name} | {steps / cpu_s:,.0f} | {1e6 * cpu_s / steps:.1f} | {simulated_s / cpu_s:.0f} |")


def flown_apart(name: str, distance_m: float, height_m: float) -> None:
    """Hover there and time the world alone."""
    world = build_vehicle(scenario(distance_m, height_m), 1, None).world
    world.advance(0.1)
    started_s = time.process_time()
    world.advance(0.1 + SECONDS)
    row(name, SECONDS, time.process_time() - started_s)


def stood_on_deck() -> None:
    """Land, then time what stands there."""
    world = build_vehicle(scenario(0.0, 0.4), 1, None).world
    while not world.over():
        world.command(PilotCommand(world.t_s, 0.0, 0.0, -50.0, 0.0, 0.0, Intent.LAND))
        world.advance(world.t_s + 0.1)
    started_s, begun_s = time.process_time(), world.t_s
    world.advance(begun_s + SECONDS)
    row("standing on the moving deck", SECONDS, time.process_time() - started_s)


def through_the_vehicle() -> None:
    """Read and send at the frame rate, without pictures."""
    vehicle = build_vehicle(scenario(12.0, 1.5), 1, None)
    vehicle.open()
    reads = 0
    started_s = time.process_time()
    while True:
        pair = vehicle.read()
        if pair is None or pair[1].t_s > SECONDS:
            break
        vehicle.send(PilotCommand(pair[1].t_s + 0.03, 0.0, 0.0, 0.0, 0.0, 0.0))
        vehicle.truth_at(pair[0].t_s)
        reads += 1
    row(f"vehicle: {reads} frames read, truth each", SECONDS, time.process_time() - started_s)


def main() -> None:
    """Print the table."""
    print("| what | physics steps/s | a step [µs] | real-time factor |")
    print("|---|---:|---:|---:|")
    flown_apart("hover 200 m astern", 200.0, 20.0)
    flown_apart("hover 4 m astern", 4.0, 1.5)
    flown_apart("hover over the moving deck", 0.0, 1.2)
    stood_on_deck()
    through_the_vehicle()
    started_s = time.process_time()
    builds = 20
    for seed in range(builds):
        build_vehicle(scenario(12.0, 1.5), seed, None)
    print(f"\nA new world: {1e3 * (time.process_time() - started_s) / builds:.1f} ms")


if __name__ == "__main__":
    np.seterr(all="raise")
    main()
