"""Draw the video of a flight whose log keeps the truth but no pictures, such as one with `--vision geometric`.

python tools/film_log.py out/outside/rig-natops-1/flight.mcap out/film.mp4
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from shipland.messages import FlightRecord
from shipland.record.reader import FlightLog, read_log
from shipland.report.chase import chase_view
from shipland.report.outputs import load_outputs
from shipland.report.video import FlightVideo
from shipland.scenario.autonomy import aircraft_scale, build_scene, drawn_ship
from shipland.scenario.scenario import Scenario, load_scenario
from shipland.sim.scene.scene import Scene
from shipland.sim.state import SceneState


def drawn(log: FlightLog, scenario: Scenario, scene: Scene) -> Iterator[FlightRecord]:
    """The rows with the picture that their truth shows; times from the first row on."""
    ship = drawn_ship(scenario, log.header.info.seed)
    first_s, last_s = log.records[0].frame.t_s, -np.inf
    still = np.zeros(3)
    for row in log.records:
        truth = row.truth
        if truth is None or truth.t_s <= last_s:
            continue
        last_s = truth.t_s
        state = SceneState(
            truth.t_s, truth.ned_from_camera, ship.at(truth.t_s).ned_from_hull, truth.ned_from_deck,
            truth.ned_from_bar, truth.ned_from_body, still, still,
        )  # fmt: skip
        image = scene.render(state, log.header.camera)
        t_s, estimate = row.frame.t_s - first_s, row.decision.estimate
        if estimate is not None:
            estimate = replace(estimate, t_s=estimate.t_s - first_s)
        # the truth comes with its world's clock, which a vehicle outside does not know
        yield replace(
            row,
            frame=replace(row.frame, t_s=t_s, image=image),
            truth=replace(truth, t_s=t_s),
            decision=replace(row.decision, estimate=estimate),
        )


def main() -> None:
    """Draw it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", type=Path)
    parser.add_argument("video", type=Path)
    parser.add_argument("--every", type=int, default=1, help="take one row of so many")
    arguments = parser.parse_args()
    log = read_log(arguments.log)
    scenario = load_scenario(json.loads(log.header.info.configuration))
    scene = build_scene(scenario, log.header.info.seed)
    chase = chase_view(scene, log.header.camera, aircraft_scale(scenario), scenario.ship.full_ship)
    film = FlightVideo(arguments.video, log.header.rig, log.header.camera, load_outputs().video, chase)
    taken = replace(log, records=log.records[:: arguments.every])
    for row in drawn(taken, scenario, scene):
        film.append(row)
    film.finish(log.verdict)
    scene.close()


if __name__ == "__main__":
    main()
