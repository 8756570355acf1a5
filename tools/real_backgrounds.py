"""How far the bar is found in real photographs: drawn into them, as sharp as a lens leaves it, at known places.

    python tools/real_backgrounds.py PHOTOGRAPHS...     # files or folders; three pictures of each range from every one

A photograph counts as a window out of the camera's picture, at the camera's own scale. The lit bar on its board is
drawn in light (tests/pictures.py), at ranges from 2 to 20 m and up to 30° off its axis, blurred by 0.3 to 1.0 px, its
lamp dim, bright or clipped, its board black or grey; then come grain and JPEG, colour at half resolution as cameras
write it. Everything else is the photograph. Beside it the same bar on a plain background: what is lost there the bar's
own picture loses, the rest is the photograph's doing. Writes table.md and pictures.png.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from studies.views import Setting, markdown
from rich.progress import track

from shipland.camera import Camera
from shipland.messages import Frame, GimbalAttitude
from shipland.vision.near.pipeline import NearVision

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from pictures import Look, add_target, camera_from_bar, finish, light_of, plain_canvas

Picture = npt.NDArray[np.uint8]
RANGES_M = (2.0, 5.0, 8.0, 11.0, 13.0, 16.0, 20.0)
BLURS_PX = (0.3, 0.6, 1.0)
OFF_AXIS_DEG = 30.0
GIMBAL_RAD = 1e-3
GRAIN = 2.0
"""Grey levels."""
WRONG_SIGMA = 5.0
GREENS = ((60.0, 190.0, 70.0), (90.0, 250.0, 110.0), (40.0, 255.0, 60.0))
"""BGR, as pictures show the lamp: dim, bright, and clipped."""
BOARDS = ((30.0, 30.0, 30.0), (128.0, 128.0, 128.0))
"""Black and grey."""
LUMA = np.array([0.114, 0.587, 0.299])
CONTRASTS = (0.0, 30.0, 80.0, 256.0)
"""Edges of the table's groups: by how much more luma the lamp has than its board [grey levels]."""
SUFFIXES = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True)
class Trial:
    """One picture: background, luma of the lamp over its board [levels], range [m], why no pose, and its error."""

    background: str
    contrast: float
    range_m: float
    reason: str
    off_m: float = float("nan")
    squared: float = float("nan")


def photographs(paths: Sequence[Path]) -> list[Path]:
    """Every picture in files and folders, by name."""
    found = [item for path in paths for item in (sorted(path.rglob("*")) if path.is_dir() else [path])]
    return [path for path in found if path.suffix.lower() in SUFFIXES]


def window(camera: Camera, width_px: int, height_px: int) -> Camera:
    """The middle of the camera's picture."""
    matrix = camera.matrix.copy()
    matrix[0, 2] -= 0.5 * (camera.width_px - width_px)
    matrix[1, 2] -= 0.5 * (camera.height_px - height_px)
    return Camera(width_px, height_px, matrix)


def trial(
    setting: Setting,
    camera: Camera,
    photograph: Picture | None,
    blur_px: float,
    range_m: float,
    quality: int,
    seed: Sequence[int],
) -> tuple[Trial, Picture]:
    """Draw the bar somewhere in sight, whole, and look for it afresh; None is a plain background, 0 no JPEG."""
    rng = np.random.default_rng(seed)
    azimuth_rad = np.radians(rng.uniform(-OFF_AXIS_DEG, OFF_AXIS_DEG))
    place_m = range_m * np.array([-np.cos(azimuth_rad), -np.sin(azimuth_rad), rng.uniform(-0.15, 0.15)])
    aside_rad = rng.uniform(-0.05, 0.05)
    pose = camera_from_bar(place_m, azimuth_rad + aside_rad)
    look = Look(blur_px, 0.0)
    canvas = plain_canvas(camera) if photograph is None else light_of(photograph)
    green, board = GREENS[int(rng.integers(len(GREENS)))], BOARDS[int(rng.integers(len(BOARDS)))]
    contrast = abs(float(LUMA @ (np.array(green) - np.array(board))))
    add_target(canvas, setting.rig.cue, camera, pose, look, green, board=board)
    picture = finish(canvas, rng, look).astype(float) + rng.normal(0.0, GRAIN, canvas.shape)
    image = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    if quality > 0:
        coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        image = np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), np.uint8)
    gimbal = GimbalAttitude(*rng.normal(0.0, GIMBAL_RAD, 2))
    seen = NearVision(setting.rig.cue, camera, setting.vision).see(Frame(0.0, image, gimbal))
    name = "plain" if photograph is None else "photograph"
    if seen.bar_pose is None:
        return Trial(name, contrast, range_m, seen.reason or "no pose"), image
    found = seen.bar_pose
    error = np.array([*(found.position_in_bar_m - place_m), found.yaw_rad - azimuth_rad - aside_rad])
    squared = float(error @ np.linalg.solve(found.covariance, error))
    return Trial(name, contrast, range_m, "", float(np.linalg.norm(error[:3])), squared), image


def table(trials: Sequence[Trial]) -> str:
    """Share with a pose by contrast and range, photographs beside a plain background."""
    rows = []
    for least, most in pairwise(CONTRASTS):
        for low, high in pairwise(RANGES_M):
            cell = [item for item in trials if least <= item.contrast < most and low <= item.range_m < high]
            there = sum(item.background == "photograph" for item in cell)
            row = [
                f"{least:g}–{most:g}" if most < CONTRASTS[-1] else f"over {least:g}",
                f"{low:g}–{high:g}",
                str(there),
            ]
            words = ""
            for name in ("photograph", "plain"):
                some = [item for item in cell if item.background == name]
                good = [item for item in some if not item.reason]
                row.append(f"{100.0 * len(good) / max(len(some), 1):.0f}")
                if name == "photograph":
                    off_cm = 100.0 * np.sqrt(np.mean([item.off_m**2 for item in good])) if good else float("nan")
                    wrong = sum(item.squared > WRONG_SIGMA**2 for item in good)
                    squared = np.mean([item.squared for item in good]) / 4.0 if good else float("nan")
                    reasons = Counter(item.reason for item in some if item.reason).most_common(2)
                    row += [f"{off_cm:.1f}", f"{squared:.2f}", str(wrong)]
                    words = "; ".join(f"{reason} ({n})" for reason, n in reasons)
            rows.append([*row, words])
    header = ["luma over the board's", "range [m]", "pictures", "found [%]", "position rms [cm]", "error² / 4", "wrong",
              "found, plain [%]", "most refusals"]  # fmt: skip
    return markdown(header, rows)


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photographs", nargs="+", type=Path)
    parser.add_argument("--most", type=int, default=1000, help="photographs")
    parser.add_argument("--quality", type=int, default=85, help="of the JPEG; 0 for none")
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--out", type=Path, default=Path("out/real_backgrounds"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    setting = Setting.packaged()
    files = photographs(arguments.photographs)[: arguments.most]
    if not files:
        parser.error(f"no pictures ({', '.join(SUFFIXES)}) in {', '.join(map(str, arguments.photographs))}")
    trials, shown = [], []
    for number, path in enumerate(track(files, "photographs")):
        photograph = cv2.imread(str(path))
        if photograph is None:
            print(f"{path}: no picture that can be read, left out", file=sys.stderr)
            continue
        camera = window(setting.camera, photograph.shape[1], photograph.shape[0])
        for place, (low, high) in enumerate(pairwise(RANGES_M)):
            for turn, blur_px in enumerate(BLURS_PX):
                seed = [arguments.seed, number, place, turn]
                range_m = float(np.random.default_rng([*seed, 1]).uniform(low, high))
                drawn = (blur_px, range_m, arguments.quality, seed)
                made, image = trial(setting, camera, np.asarray(photograph, np.uint8), *drawn)
                trials += [made, trial(setting, camera, None, *drawn)[0]]
                if len(shown) < 12 and (place, turn) == (number % 6, 1):
                    shown.append(cv2.resize(image, (400, 400)))
    text = table(trials)
    (arguments.out / "table.md").write_text(text + "\n", encoding="utf-8")
    if shown:
        shown += [np.full_like(shown[0], 255)] * (-len(shown) % 4)
        rows = [np.hstack(shown[at : at + 4]) for at in range(0, len(shown), 4)]
        cv2.imwrite(str(arguments.out / "pictures.png"), np.vstack(rows))
    print(text)


if __name__ == "__main__":
    main()
