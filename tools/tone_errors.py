"""What a camera's tone curve does to the pose: drawn pictures of the bar, each through several curves.

    python tools/tone_errors.py                # 42 pictures a curve, half a minute of one core

Pictures are drawn in light, without the renderer (tests/pictures.py); ranges from 2 to 15 m, up to 40° off the bar's
axis, three amounts of blur; every picture is searched afresh, by a gimbal that errs by a thousandth of a radian. Writes
table.md.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from pathlib import Path

import numpy as np
from near_views import Setting, markdown
from rich.progress import track

from shipland.messages import Frame, GimbalAttitude

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from pictures import TONES, Look, bar_picture, camera_from_bar

RANGES_M = (2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0)
AZIMUTHS_DEG = (-40.0, 20.0)
BLURS_PX = (0.3, 0.5, 0.9)
NOISE = 1.5
"""Grey levels."""
GIMBAL_RAD = 1e-3
LOOKS_ASIDE_RAD = 0.05

HEADER = ("tone curve", "found [%]", "distance rms [%]", "worst [%]", "yaw rms [°]", "worst [°]", "error² / 4")


def row(tone: str, setting: Setting, seed: int) -> list[str]:
    """Figures of one curve, in the order of HEADER."""
    camera, target = setting.camera, setting.rig.target
    errors: list[tuple[float, float, float]] = []
    places = list(itertools.product(RANGES_M, AZIMUTHS_DEG, BLURS_PX))
    for number, (range_m, azimuth_deg, blur_px) in enumerate(places):
        rng = np.random.default_rng([seed, number])
        azimuth_rad = np.radians(azimuth_deg)
        place_m = range_m * np.array([-np.cos(azimuth_rad), -np.sin(azimuth_rad), 0.02])
        yaw_rad = azimuth_rad + LOOKS_ASIDE_RAD
        look = Look(blur_px, NOISE, tone=TONES[tone])
        picture = bar_picture(target, camera, camera_from_bar(place_m, yaw_rad), rng, look)
        roll_rad, pitch_rad = rng.normal(0.0, GIMBAL_RAD, 2)
        pose = setting.eyes().see(Frame(0.0, picture, GimbalAttitude(roll_rad, pitch_rad))).bar_pose
        if pose is not None:
            error = np.array([*(pose.position_in_bar_m - place_m), pose.yaw_rad - yaw_rad])
            squared = float(error @ np.linalg.solve(pose.covariance, error)) / 4.0
            told = float(np.linalg.norm(pose.position_in_bar_m) / np.linalg.norm(place_m)) - 1.0
            errors.append((100.0 * told, float(np.degrees(error[3])), squared))
    if not errors:
        return [tone, "0", *["–"] * (len(HEADER) - 2)]
    distance, yaw, squared_errors = np.abs(np.array(errors)).T
    return [
        tone,
        f"{100.0 * len(errors) / len(places):.0f}",
        f"{np.sqrt(np.mean(distance**2)):.2f}",
        f"{distance.max():.2f}",
        f"{np.sqrt(np.mean(yaw**2)):.2f}",
        f"{yaw.max():.1f}",
        f"{squared_errors.mean():.2f}",
    ]


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--out", type=Path, default=Path("out/tone_errors"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    setting = Setting.packaged()
    text = markdown(HEADER, [row(tone, setting, arguments.seed) for tone in track(TONES, "tone curves")])
    (arguments.out / "table.md").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
