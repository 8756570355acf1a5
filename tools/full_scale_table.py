"""What changes from the model to the ship: one table, from the configuration, from motions drawn and from campaigns.

    python tools/full_scale_table.py [--motions 60] [--campaigns out/tables out/frigate]

Without campaigns the rows of the flights are left out. Of a campaign, horizon's cells of both scenarios are taken: that
of the velocity loop, and the ship's as it is.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from shipland.camera import Camera
from shipland.evaluation.campaign import read_cells
from shipland.evaluation.landing import Landing
from shipland.evaluation.statistics import share_interval
from shipland.scenario.autonomy import response_of
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table
from shipland.sim.ship.ship import build_ship

LENGTH_S, STEP_S = 240.0, 0.1
SEED = 1
Row = tuple[str, ...]


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


def column(scenario: Scenario, motions: int) -> list[Row]:
    """Name and value of each row that needs no flight."""
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


def flown(scenario: Scenario, landings: tuple[Landing, ...]) -> list[Row]:
    """The rows of a campaign."""
    n, good, touched = len(landings), sum(it.success for it in landings), [it for it in landings if it.touched]
    low, high = share_interval(good, n)
    own_m = float(np.median([np.hypot(it.control_forward_m, it.control_starboard_m) for it in touched]))
    share = 100.0 * own_m / scenario.rig.deck_size_m
    return [
        ("landed in the area", f"{good} of {n} ({100.0 * low:.0f}–{100.0 * high:.0f} %)"),
        ("control error, median", f"{own_m:.2f} m, {share:.0f} % of the deck"),
        ("flight, median", f"{np.median([it.time_s for it in landings]):.0f} s from {scenario.start.distance_m:g} m"),
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="ship-sea6")
    parser.add_argument("--ship", default="frigate-sea6")
    parser.add_argument("--motions", type=int, default=60)
    parser.add_argument("--campaigns", type=Path, nargs="*", default=[])
    asked = parser.parse_args()
    cells = [cell for folder in asked.campaigns for cell in read_cells([folder]) if cell.pilot == "horizon"]
    columns = []
    for name, settings in ((asked.model, ("aircraft.loop.kind=velocity",)), (asked.ship, ())):
        scenario = load_scenario(scenario_table(name, None, settings))
        rows = column(scenario, asked.motions)
        for cell in cells:
            if cell.scenario == name and tuple(f"{key}={value}" for key, value in cell.settings) == settings:
                rows += flown(scenario, cell.landings)
        columns.append(rows)
    print(f"| | {asked.model}, velocity loop | {asked.ship} |\n|---|---:|---:|")
    model = dict(columns[0])
    for name, value in columns[1]:
        print(f"| {name} | {model.get(name, '')} | {value} |")


if __name__ == "__main__":
    main()
