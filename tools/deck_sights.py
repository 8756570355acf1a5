"""How well the look down sees the deck: drawn pictures from random places, against the truth.

    python tools/deck_sights.py --pictures 300 --out out/deck_sights

Heights, places, the deck's tilt and shift, and light at random; the gimbal says where it looks to 0.05°. Prints a table
by height, and leaves it with `looks.png`, some of the pictures.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from near_views import Setting, light, markdown
from rich.progress import track
from shipland.guidance.horizon.look_down import DOWN_RAD

from shipland.camera import level_from_camera
from shipland.frames import Pose, rotation_from_euler
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.sim.state import SceneState
from shipland.vision.near.deck import DeckVision

BINS_M = (0.5, 0.65, 0.8, 1.0, 1.2, 1.6)
BLOCK = 6
"""Pictures under one light."""


def look(rig: Rig, gimbal_noise_rad: float, height_m: float, rng: np.random.Generator) -> tuple[SceneState, np.ndarray]:
    """A place over the deck, and the deck's centre from the camera: forward, right, down, level."""
    ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -rig.deck_height_m]))
    tilt = rotation_from_euler(*np.radians(rng.normal(0.0, (4.0, 1.5, 1.5))))
    ned_from_deck = ned_from_ship @ Pose(tilt, rng.normal(0.0, (0.05, 0.13, 0.06)))
    heading = rotation_from_euler(0.0, 0.0, np.radians(rng.normal(0.0, 2.0)))
    body_m = ned_from_ship.translation_m + np.array([*rng.normal(0.0, 0.06, 2), -height_m])
    eye_m = body_m + heading @ np.array([0.09, 0.0, 0.0])
    roll_rad, pitch_rad = rng.normal(0.0, gimbal_noise_rad, 2)
    mount = level_from_camera(GimbalAttitude(roll_rad, DOWN_RAD + pitch_rad))
    poses = (Pose(heading @ mount, eye_m), ned_from_ship, ned_from_deck, ned_from_ship @ rig.ship_from_bar)
    state = SceneState(float(height_m), *poses, Pose(heading, body_m), np.zeros(3), np.zeros(3))
    return state, heading.T @ (ned_from_deck.translation_m - eye_m)


def main() -> None:
    """Draw, look and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("out/deck_sights"))
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    setting, gimbal = Setting.packaged(), GimbalAttitude(0.0, DOWN_RAD)
    found: list[tuple[float, np.ndarray | None]] = []
    tiles: list[np.ndarray] = []
    scene = None
    for number in track(range(asked.pictures), "looks down"):
        rng = np.random.default_rng([asked.seed, number])
        if number % BLOCK == 0:
            if scene is not None:
                scene.close()
            scene = setting.scene(number, **light(rng))
        assert scene is not None
        height_m = float(rng.uniform(BINS_M[0], BINS_M[-1]))
        state, centre_m = look(setting.rig, setting.gimbal_noise_rad, height_m, rng)
        image = scene.render(state, setting.camera, rng=rng)
        sight = DeckVision(setting.rig, setting.camera, setting.vision.deck).see(Frame(0.0, image, gimbal)).deck
        found.append((float(centre_m[2]), None if sight is None else sight.centre_in_level_m - centre_m))
        if len(tiles) < 12 and number % 5 == 0:
            tiles.append(cv2.resize(image, (320, 180)))
    rows = []
    for low, high in pairwise(BINS_M):
        some = [error for height_m, error in found if low <= height_m < high]
        errors = np.array([error for error in some if error is not None]).reshape(-1, 3)
        rms_mm = 1e3 * np.sqrt((errors**2).mean(axis=0)) if len(errors) else np.full(3, np.nan)
        worst_mm = 1e3 * float(np.abs(errors).max()) if len(errors) else np.nan
        figures = [f"{value:.1f}" for value in (*rms_mm, worst_mm)]
        rows.append([f"{low:g}–{high:g}", f"{len(errors)} of {len(some)}", *figures])
    names = ("camera over the deck [m]", "found", "forward, rms [mm]", "right [mm]", "down [mm]", "worst [mm]")
    table = markdown(names, rows)
    (asked.out / "table.md").write_text(table, encoding="utf-8")
    print(table)
    if len(tiles) == 12:
        cv2.imwrite(str(asked.out / "looks.png"), np.vstack([np.hstack(tiles[i : i + 4]) for i in (0, 4, 8)]))


if __name__ == "__main__":
    main()
