"""From how far the near vision finds the cue: the share of pictures with a pose against range, by visibility.

    python tools/reach.py                # 100 views a range, some seven minutes of one core

Rendered pictures, sensor noise 1.5, up to 20° off the bar's axis, each searched afresh, in steps of 1 m until fewer
than half give a pose. The farthest pose that the configuration accepts (max_distance_m in [vision]) is lifted, so that
vision itself is the limit; what is left with it stands beside. The reach is the largest range up to which at least
99 % of pictures at every range give a pose. Writes table.md and plot.png.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from near_views import Setting, Trial, finish_over_range, look, markdown, view_at
from rich.progress import track
from spoiling import noise

from shipland.frames import Array

VISIBILITIES_M = {"clear day": 40000.0, "haze, 2 km": 2000.0, "haze, 500 m": 500.0}
FIRST_M, LAST_M = 10, 60
OFF_AXIS_DEG = 18.0
"""And 2° that `view_at` adds."""

NOISE = 1.5
WANTED = 0.99
ENOUGH = 0.5
LIFTED_M = 1000.0

HEADER = (
    "visibility",
    "range [m]",
    "views",
    "accepted [%]",
    "in [vision]'s reach [%]",
    "position rms [m]",
    "yaw rms [°]",
    "error² / 4",
    "most refusals",
)


@dataclass(frozen=True)
class Distance:
    """What became of the pictures from one range: of the vision without its limit and with it."""

    range_m: int
    trials: list[Trial]
    accepted_within: int

    @property
    def share(self) -> float:
        """Of pictures that give a pose."""
        return sum(not trial.reason for trial in self.trials) / len(self.trials)

    def row(self, visibility: str) -> list[str]:
        """In the order of HEADER."""
        count = len(self.trials)
        good = [trial for trial in self.trials if trial.error is not None]
        refused = Counter(trial.reason for trial in self.trials if trial.reason).most_common(1)
        shares = [f"{100.0 * share:.0f}" for share in (self.share, self.accepted_within / count)]
        start = [visibility, str(self.range_m), str(count), *shares]
        words = f"{refused[0][0]} ({refused[0][1]})" if refused else ""
        if not good:
            return [*start, "–", "–", "–", words]
        rms = np.sqrt(np.mean(np.square([trial.error for trial in good]), axis=0))
        return [
            *start,
            f"{np.linalg.norm(rms[:3]):.3f}",
            f"{np.degrees(rms[3]):.2f}",
            f"{np.mean([trial.nees for trial in good]) / 4.0:.2f}",
            words,
        ]


def distances(visibility_m: float, views: int, rng: np.random.Generator, setting: Setting) -> list[Distance]:
    """From the first range on, until too few pictures give a pose."""
    scene = setting.scene(0, visibility_m=visibility_m)
    lifted, limited = setting.eyes(max_distance_m=LIFTED_M), setting.eyes()
    found: list[Distance] = []
    for range_m in track(range(FIRST_M, LAST_M + 1), description=f"visibility {visibility_m:.0f} m"):
        trials, within = [], 0
        for _ in range(views):
            off_deg = float(rng.uniform(-OFF_AXIS_DEG, OFF_AXIS_DEG))
            view = view_at(float(range_m), off_deg, setting.gimbal_noise_rad, rng)
            picture = noise(scene.render(view.state(setting.rig), setting.camera), rng, NOISE)
            trials.append(look(view, picture, lifted, setting))
            within += not look(view, picture, limited, setting).reason
        found.append(Distance(range_m, trials, within))
        if found[-1].share < ENOUGH:
            break
    scene.close()
    return found


def reach_m(found: list[Distance], shares: list[float]) -> int | None:
    """The largest range up to which every share is as wanted; None when the first one's is not."""
    reached = None
    for distance, share in zip(found, shares, strict=True):
        if share < WANTED:
            break
        reached = distance.range_m
    return reached


def plot(cases: dict[str, list[Distance]], limit_m: float, path: Path) -> None:
    """Accepted share and position error against range."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.0), layout="constrained")
    for name, found in cases.items():
        ranges = [distance.range_m for distance in found]
        axes[0].plot(ranges, [100.0 * distance.share for distance in found], ".-", label=name)
        errors: list[Array] = [np.array([t.error[:3] for t in d.trials if t.error is not None]) for d in found]
        rms = [float(np.sqrt(np.mean(np.sum(e**2, axis=1)))) if len(e) else np.nan for e in errors]
        axes[1].plot(ranges, rms, ".-", label=name)
    axes[0].axvline(limit_m, color="grey", linestyle="--", label="max_distance_m")
    axes[0].set(ylabel="pictures with a pose [%]", ylim=(0.0, 103.0))
    axes[1].set(ylabel="position error, rms [m]", ylim=(0.0, None))
    axes[0].legend(fontsize="x-small")
    finish_over_range(figure, axes, path)


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=100, help="a range")
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--out", type=Path, default=Path("out/reach"))
    arguments = parser.parse_args()
    setting = Setting.packaged()
    cases = {
        name: distances(visibility_m, arguments.views, np.random.default_rng([arguments.seed, number]), setting)
        for number, (name, visibility_m) in enumerate(VISIBILITIES_M.items())
    }
    limit_m = setting.vision.max_distance_m
    lines = []
    for name, found in cases.items():
        vision_m = reach_m(found, [distance.share for distance in found])
        whole_m = reach_m(found, [distance.accepted_within / len(distance.trials) for distance in found])
        lines.append([name, f"{vision_m or '–'}", f"{whole_m or '–'}"])
    text = markdown(["visibility", "reach of the vision [m]", f"with max_distance_m = {limit_m:g} [m]"], lines)
    text += "\n" + markdown(HEADER, [distance.row(name) for name, found in cases.items() for distance in found])
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "table.md").write_text(text, encoding="utf-8")
    plot(cases, limit_m, arguments.out / "plot.png")
    print(text)


if __name__ == "__main__":
    main()
