"""The frigate as the 25 kg drone's camera sees it on its way in: five pictures in one, for the documentation.

python tools/full_scale_pictures.py --out docs/pictures/full-scale.jpg
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import Pose
from shipland.report.chase import look_at
from shipland.scenario.autonomy import drawn_ship
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.sim.scene.scene import Scene
from shipland.sim.ship.ship import ShipState
from shipland.sim.state import SceneState

PLACES = {  # forward, starboard, down of the deck's centre [m]
    "3 km": (-3000.0, 260.0, -60.0),
    "1 km": (-1000.0, 80.0, -25.0),
    "300 m": (-300.0, 20.0, -16.0),
    "60 m": (-60.0, -4.0, -9.0),
    "hover": (0.0, 0.0, -6.0),
    "quarter": (-120.0, -110.0, -30.0),
}
TILE_PX = (576, 324)


def state_at(ship: ShipState, place_in_ship_m: tuple[float, float, float], t_s: float) -> SceneState:
    """The scene from a place, the camera aimed at the bar, or at midships from beside."""
    eye_m = ship.ned_from_ship.apply(np.array(place_in_ship_m))
    beside = abs(place_in_ship_m[1]) > 100.0 and place_in_ship_m[0] > -1000.0
    aim_m = ship.ned_from_ship.apply(np.array([40.0, 0.0, 0.0])) if beside else ship.ned_from_bar.translation_m
    camera, still = look_at(eye_m, aim_m), np.zeros(3)
    return SceneState(
        t_s=t_s,
        ned_from_camera=camera,
        ned_from_ship=ship.ned_from_hull,
        ned_from_deck=ship.ned_from_deck,
        ned_from_bar=ship.ned_from_bar,
        ned_from_body=Pose(np.eye(3), eye_m),
        camera_velocity_in_ned_mps=still,
        camera_rate_in_camera_rad_s=still,
    )


def main() -> None:
    """Draw and lay out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scenario", default="frigate-sea5")
    parser.add_argument("--set", action="append", default=[], help="section.key=value")
    parser.add_argument("--whole", type=Path, help="folder for the pictures in full size")
    arguments = parser.parse_args()
    scenario = load_scenario(scenario_table(arguments.scenario, None, arguments.set))
    camera, ship = Camera.from_parameters(scenario.camera), drawn_ship(scenario, 1)
    scene = Scene(scenario.rig, scenario.scene, np.random.default_rng(1))
    tiles = []
    for name, place_m in PLACES.items():
        picture = scene.render(state_at(ship.at(30.0), place_m, 30.0), camera, rng=np.random.default_rng(2))
        if arguments.whole is not None:
            arguments.whole.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(arguments.whole / f"{name.replace(' ', '')}.png"), picture)
        if name == "3 km":  # a part at the camera's own resolution
            row, column = camera.height_px // 2, camera.width_px // 2
            high, wide = TILE_PX[1] // 2, TILE_PX[0] // 2
            tile = picture[row - high : row + high, column - wide : column + wide].copy()
        else:
            tile = cv2.resize(picture, TILE_PX, interpolation=cv2.INTER_AREA)
        cv2.putText(tile, name, (12, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(tile, name, (12, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (255, 255, 255), 1, cv2.LINE_AA)
        tiles.append(tile)
    scene.close()
    rows = [np.hstack(tiles[index : index + 2]) for index in range(0, len(tiles), 2)]
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(arguments.out), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 75])


if __name__ == "__main__":
    main()
