"""What spoiled pictures do to the near vision: the cue in view, each picture spoiled in every way of tools/spoiling.py.

    python tools/spoiled_cue.py                # 40 views a range, some three minutes of one core

Ranges are log-uniform in each bin, up to 30° off the bar's axis; light differs from scene to scene. What the light, the
lens and the shutter do comes before the sensor's noise (1.5), codecs after. The rolling shutter leaves the row of the
bar's middle where it is. Another exposure is laid over a picture whose pixels are averages already, which shifts every
edge a little, as a camera's tone curve does. Every picture is searched afresh. A pose is wrong when its error lies
beyond five standard deviations by its own covariance. Writes table.md and, of each cell, the wrong pose farthest beyond
them (picture, and the cue enlarged with the true corners white and the measured ones red).
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from near_views import Setting, Trial, View, light, look, markdown, view_at
from rich.progress import track
from spoiling import SPOILERS, Picture, exposed, hue_turned, noise, panned, rolling_shutter, through_h264

RANGES_M = (2.0, 4.0, 8.0, 12.0, 15.0)
OFF_AXIS_DEG = 28.0
"""And 2° that `view_at` adds."""

NOISE = 1.5
MEGABIT_S = (4.0, 2.0, 1.0)
EXPOSURES_EV = (-2.0, 1.5)
HUES = (-10, 10)
WRONG_SIGMA = 5.0
VIEWS_A_SCENE = 20
MARGIN_PX = 12
ENLARGED_PX = 1000

HEADER = (
    "spoiled by",
    "range [m]",
    "views",
    "accepted [%]",
    "position rms [cm]",
    "position max [cm]",
    "yaw rms [°]",
    "error² / 4",
    "its median",
    "wrong",
    "most refusals",
)


def spoiled(clean: Picture, cue_row: float, rng: np.random.Generator) -> dict[str, Picture]:
    """A rendered picture in every way, by name; `cue_row` is where the cue's middle lies."""
    ways: dict[str, Callable[[Picture], Picture]] = {
        "nothing": lambda picture: picture,
        **{name: lambda picture, name=name: SPOILERS[name](picture, rng)
           for name in ("spray", "glare", "fog", "motion blur")},  # type: ignore[misc]
        "rolling shutter": lambda picture: rolling_shutter(picture, rng, still_row=cue_row),
        **{f"{ev:+g} EV": lambda picture, ev=ev: exposed(picture, ev) for ev in EXPOSURES_EV},  # type: ignore[misc]
        **{f"hue {turn:+d}": lambda picture, turn=turn: hue_turned(picture, turn) for turn in HUES},  # type: ignore[misc]
    }  # fmt: skip
    pictures = {name: noise(way(clean), rng, NOISE) for name, way in ways.items()}
    pictures["JPEG"] = SPOILERS["JPEG"](noise(clean, rng, NOISE), rng)
    film = [noise(picture, rng, NOISE) for picture in panned(clean, rng)]
    for rate in MEGABIT_S:
        pictures[f"H.264, {rate:.0f} Mbit/s"] = through_h264(film, rate)[-1]
    return pictures


def is_wrong(trial: Trial) -> bool:
    """Whether a pose lies beyond what its covariance says."""
    return not trial.reason and trial.nees > WRONG_SIGMA**2


def row(spoiler: str, low_m: float, high_m: float, trials: list[Trial]) -> list[str]:
    """Figures of one cell, in the order of HEADER."""
    good = [trial for trial in trials if trial.error is not None]
    refused = Counter(trial.reason for trial in trials if trial.reason).most_common(1)
    words = f"{refused[0][0]} ({refused[0][1]})" if refused else ""
    start = [spoiler, f"{low_m:.0f}–{high_m:.0f}", str(len(trials)), f"{100.0 * len(good) / len(trials):.0f}"]
    if not good:
        return [*start, *["–"] * 6, words]
    errors = np.array([trial.error for trial in good])
    off_cm = 100.0 * np.linalg.norm(errors[:, :3], axis=1)
    squared = np.array([trial.nees for trial in good]) / 4.0
    return [
        *start,
        f"{np.sqrt(np.mean(off_cm**2)):.2f}",
        f"{off_cm.max():.1f}",
        f"{np.degrees(np.sqrt(np.mean(errors[:, 3] ** 2))):.3f}",
        f"{squared.mean():.2f}",
        f"{np.median(squared):.2f}",
        str(sum(is_wrong(trial) for trial in good)),
        words,
    ]


def cue_px(view: View, setting: Setting) -> Picture:
    """(n,2) the cue's true corners in the picture."""
    return setting.camera.project(view.bar_from_camera.inverse().apply(setting.rig.cue.points_in_bar_m))


def enlarged(picture: Picture, trial: Trial, setting: Setting) -> Picture:
    """The cue's part of a picture, with the true corners and the measured ones."""
    true_px = cue_px(trial.view, setting)
    size = np.array(picture.shape[1::-1])
    low = np.clip(np.floor(true_px.min(axis=0)) - MARGIN_PX, 0, size).astype(int)
    high = np.clip(np.ceil(true_px.max(axis=0)) + MARGIN_PX, 0, size).astype(int)
    part = picture[low[1] : high[1], low[0] : high[0]]
    scale = max(ENLARGED_PX // part.shape[1], 1)
    shown = cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
    crosses = [(true_px, (255, 255, 255))]
    if trial.corner_error_px is not None:
        crosses.append((true_px + trial.corner_error_px, (0, 0, 255)))
    for corners_px, colour in crosses:
        for corner in (corners_px - low + 0.5) * scale - 0.5:
            if np.isfinite(corner).all():
                at = (round(float(corner[0])), round(float(corner[1])))
                cv2.drawMarker(shown, at, colour, cv2.MARKER_CROSS, 14, 1)
    return np.asarray(shown, np.uint8)


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=40, help="a range")
    parser.add_argument("--seed", type=int, default=21)
    parser.add_argument("--out", type=Path, default=Path("out/spoiled_cue"))
    arguments = parser.parse_args()
    out: Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    setting = Setting.packaged()
    eyes = setting.eyes()
    cells: dict[tuple[str, float, float], list[Trial]] = {}
    worst: dict[tuple[str, float, float], tuple[Trial, Picture]] = {}
    for number in track(range(-(-arguments.views // VIEWS_A_SCENE)), description="scenes"):
        rng = np.random.default_rng([arguments.seed, number])
        scene = setting.scene(number, **light(rng))
        for low_m, high_m in pairwise(RANGES_M):
            for _ in range(min(VIEWS_A_SCENE, arguments.views - number * VIEWS_A_SCENE)):
                range_m = float(np.exp(rng.uniform(np.log(low_m), np.log(high_m))))
                off_deg = float(rng.uniform(-OFF_AXIS_DEG, OFF_AXIS_DEG))
                view = view_at(range_m, off_deg, setting.gimbal_noise_rad, rng)
                clean = scene.render(view.state(setting.rig), setting.camera)
                cue_row = float(cue_px(view, setting)[:, 1].mean())
                for name, picture in spoiled(clean, cue_row, rng).items():
                    trial, cell = look(view, picture, eyes, setting), (name, low_m, high_m)
                    cells.setdefault(cell, []).append(trial)
                    if is_wrong(trial) and (cell not in worst or trial.nees > worst[cell][0].nees):
                        worst[cell] = trial, picture
        scene.close()
    for (name, low_m, _), (trial, picture) in worst.items():
        label = f"wrong-{name.replace(',', '').replace('/', '').replace(' ', '-')}-{low_m:.0f}m"
        cv2.imwrite(str(out / f"{label}.png"), picture)
        cv2.imwrite(str(out / f"{label}-cue.png"), enlarged(picture, trial, setting))
    names = list(dict.fromkeys(name for name, _, _ in cells))
    text = markdown(HEADER, [row(*cell, cells[cell]) for name in names for cell in cells if cell[0] == name])
    (out / "table.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
