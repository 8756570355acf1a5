"""What a rolling shutter and H.264 do to the near vision's poses, and whether their covariance stays true.

    python tools/film_errors.py                # 240 films, some eight minutes of one core

Films of eight pictures at 30 Hz by a camera that moves, turns and shakes (`near_films.Motion`); light differs from
scene to scene. Ranges are log-uniform in each bin, up to 40° off the bar's axis, sensor noise 1.5. The last picture of
each film is judged: once followed through the last four, and, behind a rolling shutter, once alone, and once by a
camera that is not told its row time. A pose is wrong when its error lies beyond five standard deviations by its own
covariance. Writes table.md and trials.jsonl.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from near_films import Motion, Picture, rendered, row_by_row
from near_views import Setting, Trial, View, error_of, light, markdown, view_at
from rich.progress import track
from scipy.stats import chi2
from spoiling import FRAME_RATE_HZ, from_h264, noise, to_h264

from shipland.camera import Camera
from shipland.messages import Frame
from shipland.vision.near.pipeline import NearVision

RANGES_M = (2.0, 4.0, 8.0, 15.0)
FILM, FOLLOWED = 8, 4
"""Pictures that are coded, and those of them that are looked at."""
NOISE = 1.5
READ_OUTS_MS = (0.0, 10.0, 20.0, 30.0)
MEGABIT_S = (1.0, 2.0, 4.0, 8.0)
OFF_AXIS_DEG = 38.0
WRONG_SIGMA = 5.0
FILMS_A_SCENE = 15
FREEDOM = 4
HEADER = (
    "film",
    "range [m]",
    "films",
    "found [%]",
    "position rms [cm]",
    "yaw rms [°]",
    "error² / 4",
    "95 % of such means lie in",
    "its median (0.84)",
    "wrong",
)


@dataclass(frozen=True)
class Film:
    """One film without noise.

    Attributes:
        at_rest: the camera's place at the time of the last picture.
        motion: how it moves.
        times_s: (n,) of the pictures, the last at 0.
        pictures: n, all rows exposed at once.
    """

    at_rest: View
    motion: Motion
    times_s: np.ndarray
    pictures: list[Picture]


def ways(film: Film, setting: Setting, rng: np.random.Generator) -> Iterator[tuple[str, list[Picture], Camera]]:
    """The film's last pictures as each camera has them: name, pictures, and the camera as the vision knows it."""
    for read_out_ms in READ_OUTS_MS:
        read_out_s = 1e-3 * read_out_ms
        rolled = [
            row_by_row(picture, film.at_rest, film.motion, float(t_s), read_out_s, setting) if read_out_s else picture
            for picture, t_s in zip(film.pictures[-FOLLOWED:], film.times_s[-FOLLOWED:], strict=True)
        ]
        noisy = [noise(picture, rng, NOISE) for picture in rolled]
        name = f"read out in {read_out_ms:.0f} ms" if read_out_s else "plain"
        yield name, noisy, replace(setting.camera, row_time_s=read_out_s / setting.camera.height_px)
        if read_out_s:
            yield (
                f"{name}, one picture alone",
                noisy[-1:],
                replace(setting.camera, row_time_s=read_out_s / setting.camera.height_px),
            )
            yield f"{name}, row time not known", noisy, setting.camera
    noisy = [noise(picture, rng, NOISE) for picture in film.pictures]
    for rate in MEGABIT_S:
        yield f"H.264, {rate:.0f} Mbit/s", from_h264(to_h264(noisy, rate))[-FOLLOWED:], setting.camera


def judged(film: Film, pictures: Sequence[Picture], camera: Camera, setting: Setting) -> Trial:
    """The last of some pictures, followed through those before it."""
    vision = NearVision(setting.rig.cue, camera, setting.vision)
    for t_s, picture in zip(film.times_s[-len(pictures) :], pictures, strict=True):
        view = film.motion.view(film.at_rest, float(t_s))
        observation = vision.see(Frame(1.0 + float(t_s), picture, view.gimbal))
    pose = observation.bar_pose
    return Trial(view, observation.reason) if pose is None else Trial(view, "", error_of(pose, view), pose.covariance)


def films(count: int, seed: int, setting: Setting) -> Iterator[tuple[float, Film, np.random.Generator]]:
    """Range, film and what to draw noise from; each bin of ranges in turn."""
    bins = list(pairwise(RANGES_M))
    times_s = np.arange(1 - FILM, 1) / FRAME_RATE_HZ
    for number in range(-(-count // FILMS_A_SCENE)):
        rng = np.random.default_rng([seed, number])
        scene = setting.scene(number, **light(rng))
        for index in range(min(FILMS_A_SCENE, count - number * FILMS_A_SCENE)):
            low_m, high_m = bins[index % len(bins)]
            range_m = float(np.exp(rng.uniform(np.log(low_m), np.log(high_m))))
            off_deg = float(rng.uniform(-OFF_AXIS_DEG, OFF_AXIS_DEG))
            at_rest, motion = view_at(range_m, off_deg, setting.gimbal_noise_rad, rng), Motion.drawn(rng)
            yield range_m, Film(at_rest, motion, times_s, rendered(scene, at_rest, motion, times_s, setting)), rng
        scene.close()


def row(name: str, low_m: float, high_m: float, trials: Sequence[Trial]) -> list[str]:
    """Figures of one cell, in the order of HEADER."""
    errors = np.array([trial.error for trial in trials if trial.error is not None]).reshape(-1, 4)
    squared = np.array([trial.nees for trial in trials if trial.error is not None]) / FREEDOM
    start = [name, f"{low_m:.0f}–{high_m:.0f}", str(len(trials)), f"{100.0 * len(errors) / len(trials):.0f}"]
    if not len(errors):
        return [*start, *["–"] * 6]
    low, high = chi2.ppf([0.025, 0.975], FREEDOM * len(errors)) / (FREEDOM * len(errors))
    return [
        *start,
        f"{100.0 * np.sqrt(np.mean(np.sum(errors[:, :3] ** 2, axis=1))):.2f}",
        f"{np.degrees(np.sqrt(np.mean(errors[:, 3] ** 2))):.2f}",
        f"{squared.mean():.2f}",
        f"{low:.2f} … {high:.2f}",
        f"{np.median(squared):.2f}",
        str(int(np.sum(squared > WRONG_SIGMA**2 / FREEDOM))),
    ]


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--films", type=int, default=240)
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--out", type=Path, default=Path("out/film_errors"))
    arguments = parser.parse_args()
    out: Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    setting = Setting.packaged()
    found: dict[str, list[tuple[float, Trial]]] = {}
    with (out / "trials.jsonl").open("w", encoding="utf-8") as kept:
        for range_m, film, rng in track(films(arguments.films, arguments.seed, setting), total=arguments.films):
            for name, pictures, camera in ways(film, setting, rng):
                trial = judged(film, pictures, camera, setting)
                found.setdefault(name, []).append((range_m, trial))
                line = {"film": name, "range_m": range_m, "reason": trial.reason}
                if trial.error is not None:
                    line |= {"error": trial.error.tolist(), "nees": trial.nees}
                kept.write(json.dumps(line) + "\n")
    rows = []
    for name, some in found.items():
        for low_m, high_m in [*pairwise(RANGES_M), (RANGES_M[0], RANGES_M[-1])]:
            cell = [trial for range_m, trial in some if low_m <= range_m < high_m]
            if cell:
                rows.append(row(name, low_m, high_m, cell))
    text = markdown(HEADER, rows)
    (out / "table.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
