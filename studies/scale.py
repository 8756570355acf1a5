"""What changes from the model to the ship: sizes, motions and response of the rig's ship and of a frigate."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shipland.camera import Camera
from shipland.scenario.autonomy import response_of
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table
from shipland.sim.ship.ship import build_ship
from studies.harness import Case, Column, Row, Study

SCENARIOS = {
    "ship-sea6, velocity loop": ("ship-sea6", ("aircraft.loop.kind=velocity",)),
    "frigate-sea6": ("frigate-sea6", ()),
}
LENGTH_S, STEP_S = 240.0, 0.1
SEED = 1


def moved(scenario: Scenario, motions: int) -> dict[str, tuple[float, float, float]]:
    """Standard deviation, that of the rate, and mean period of the deck's motions and of the bar's (m, rad, s)."""
    names = ("sway", "heave", "roll", "bar sway", "bar heave")
    squared = np.zeros((2, len(names)))
    for rng in np.random.default_rng(SEED).spawn(motions):
        ship = build_ship(scenario.ship, scenario.rig, rng)
        times_s = np.arange(0.0, LENGTH_S, STEP_S)
        states = [ship.at(float(t_s)) for t_s in times_s]
        deck = np.array([state.deck.displacement[[1, 2, 3]] for state in states])
        bar = np.array([state.ned_from_ship.inverse().apply(state.ned_from_bar.translation_m) for state in states])
        rows = np.column_stack([deck, bar[:, 1:] - bar[:, 1:].mean(axis=0)])
        squared += np.mean(rows**2, axis=0), np.mean(np.gradient(rows, STEP_S, axis=0) ** 2, axis=0)
    size, rate = np.sqrt(squared / motions)
    periods = 2.0 * np.pi * size / np.maximum(rate, 1e-9)
    return {name: (size[i], rate[i], periods[i]) for i, name in enumerate(names)}


def facts(scenario: Scenario, motions: int) -> list[tuple[str, str]]:
    """Name and value of each row."""
    rig, geometric, delays = scenario.rig, scenario.geometric, scenario.delays
    motion, response = moved(scenario, motions), response_of(scenario)
    width_m, roll_s = rig.deck_size_m, motion["roll"][2]
    camera = Camera.from_parameters(scenario.camera)
    bar_m, ship_m = geometric.bar.range_m[-1], geometric.ship.range_m[-1]
    ship_px = camera.focal_px * (rig.platform_width_m * rig.superstructure_height_m) ** 0.5 / ship_m
    sway_m, heave_m = motion["sway"][0], motion["heave"][0]
    half_m, names = 0.5 * rig.landing_square_m, ("sway", "heave", "roll")
    course, wind, angle_rad = scenario.ship.course, scenario.wind, math.radians(scenario.wind.from_deg)
    way_mps = 0.0 if course.kind == "still" else course.speed_mps
    over_deck_mps = math.hypot(way_mps + wind.mean_mps * math.cos(angle_rad), wind.mean_mps * math.sin(angle_rad))
    return [
        ("deck's width", f"{width_m:g} m"),
        ("sway, heave of the deck, standard deviation", f"{sway_m:.2f}, {heave_m:.2f} m"),
        ("… in deck widths", f"{sway_m / width_m:.2f}, {heave_m / width_m:.2f}"),
        ("speed of the bar's sway and heave", f"{motion['bar sway'][1]:.2f}, {motion['bar heave'][1]:.2f} m/s"),
        ("mean period of sway, heave, roll", f"{', '.join(f'{motion[it][2]:.1f}' for it in names)} s"),
        ("wind, and over the deck at its mean direction", f"{wind.mean_mps:g}, {over_deck_mps:.1f} m/s"),
        ("velocity loop, 1 / (gain × roll period)", f"{1.0 / (response.servo_per_s * roll_s):.2f}"),
        ("age of a picture, in roll periods", f"{delays.video_s / roll_s:.3f}"),
        ("cycle of the learned detector, in roll periods", f"{delays.learned_s / roll_s:.2f}"),
        ("corners measured to", f"{geometric.max_range_m:g} m, {geometric.max_range_m / width_m:.0f} deck widths"),
        ("bar boxed to", f"{bar_m:g} m, {bar_m / width_m:.0f} deck widths"),
        ("ship boxed to, its stern then", f"{ship_m:g} m, {ship_px:.0f} px"),
        ("landing area's half width", f"{half_m:g} m, {100.0 * half_m / width_m:.0f} % of the deck"),
    ]


def cases() -> Sequence[Case]:
    """The model and the ship."""
    return [{"scenario": name} for name in SCENARIOS]


def measure(case: Case, runs: int) -> list[Row]:
    """Over `runs` motions; a row a fact."""
    name, settings = SCENARIOS[str(case["scenario"])]
    scenario = load_scenario(scenario_table(name, None, settings))
    return [{"what": what, "value": value} for what, value in facts(scenario, runs)]


STUDY = Study(
    question="What changes from the model to the ship?",
    columns={"what": Column("what"), "value": Column("value"), "scenario": Column("")},
    cases=cases,
    measure=measure,
    runs=60,
    minutes=1,
)
