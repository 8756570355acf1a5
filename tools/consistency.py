"""Whether the near vision's covariance is true: its errors squared, over rendered views, against χ² of four degrees.

    python tools/consistency.py                # 5,000 views, some seven minutes of one core

Light, cloud, exposure and the lamp's brightness differ from scene to scene; ranges 2–15 m (log-uniform), up to 40° off
the bar's axis, up to 8° off its middle, sensor noise 1.5, gimbal known to within its noise. Writes table.md, plot.png.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np
from near_views import Setting, Trial, light, look, markdown, view_at
from rich.progress import track
from scipy.stats import chi2

from shipland.frames import Array

FREEDOM = 4
RANGES_M = (2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0)
VIEWS_A_SCENE = 100
COLUMNS = ("forward", "right", "down", "yaw")
HEADER = (
    "range [m]",
    "views",
    "error² / 4",
    "95 % of such means lie in",
    "beyond χ²'s 95 % point [%]",
    "beyond its 99 % point [%]",
    *(f"{name}: rms error / stated" for name in COLUMNS),
)


def trials(views: int, seed: int, setting: Setting) -> list[tuple[float, Trial]]:
    """Range and trial of each view."""
    eyes, found = setting.eyes(), []
    scenes = -(-views // VIEWS_A_SCENE)
    for number in track(range(scenes), description="scenes"):
        rng = np.random.default_rng([seed, number])
        scene = setting.scene(number, **light(rng))
        for _ in range(min(VIEWS_A_SCENE, views - number * VIEWS_A_SCENE)):
            range_m = float(np.exp(rng.uniform(np.log(RANGES_M[0]), np.log(RANGES_M[-1]))))
            view = view_at(range_m, rng.uniform(-38.0, 38.0), setting.gimbal_noise_rad, rng)
            image = scene.render(view.state(setting.rig), setting.camera, rng=rng)
            found.append((range_m, look(view, image, eyes, setting)))
        scene.close()
    return found


def row(name: str, some: list[Trial]) -> list[str]:
    """Figures of some trials, all with a pose."""
    squared = np.array([trial.nees for trial in some])
    count = len(some)
    low, high = chi2.ppf([0.025, 0.975], FREEDOM * count) / (FREEDOM * count)
    beyond = [100.0 * float(np.mean(squared > chi2.ppf(share, FREEDOM))) for share in (0.95, 0.99)]
    ratios = [trial.error / np.sqrt(np.diag(trial.covariance)) for trial in some]
    rms = np.sqrt(np.mean(np.square(ratios), axis=0))
    return [
        name,
        str(count),
        f"{squared.mean() / FREEDOM:.2f}",
        f"{low:.2f} … {high:.2f}",
        *(f"{value:.1f}" for value in beyond),
        *(f"{value:.2f}" for value in rms),
    ]


def plot(squared: Array, path: Path) -> None:
    """The distribution of the error squared beside χ²'s."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(5.5, 3.2), layout="constrained")
    edges = np.linspace(0.0, 20.0, 61)
    axis.hist(squared, edges, density=True, alpha=0.5, label=f"{len(squared)} views")
    axis.plot(edges, chi2.pdf(edges, FREEDOM), label="χ² of 4 degrees")
    axis.set(xlabel="error squared, by the stated covariance", ylabel="density", xlim=(0.0, 20.0))
    axis.legend()
    axis.grid(alpha=0.3)
    figure.savefig(path, dpi=90)


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--out", type=Path, default=Path("out/consistency"))
    arguments = parser.parse_args()
    found = trials(arguments.views, arguments.seed, Setting.packaged())
    seen = [(range_m, trial) for range_m, trial in found if not trial.reason]
    rows = []
    for low, high in pairwise(RANGES_M):
        some = [trial for range_m, trial in seen if low <= range_m < high]
        if some:
            rows.append(row(f"{low:.0f} … {high:.0f}", some))
    rows.append(row("all", [trial for _, trial in seen]))
    text = markdown(HEADER, rows) + f"\n{len(found) - len(seen)} of {len(found)} views gave no pose.\n"
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "table.md").write_text(text, encoding="utf-8")
    plot(np.array([trial.nees for _, trial in seen]), arguments.out / "plot.png")
    print(text)


if __name__ == "__main__":
    main()
