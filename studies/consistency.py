"""Whether the near vision's covariance is true: its errors squared, over rendered views, against χ² of four degrees.

Light, cloud, exposure and the lamp's brightness differ from scene to scene; ranges are log-uniform in each bin, up to
40° off the bar's axis, up to 8° off its middle, sensor noise 1.5, gimbal known to within its noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from studies.harness import Case, Column, Row, Study
from studies.views import COLUMNS, FREEDOM, Setting, Trial, bins, figures, lit_scenes, look, view_at

RANGES = bins((2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0))
VIEWS_A_SCENE = 20
SEED = 11
AXES = ("forward", "right", "down", "yaw")


def cases() -> Sequence[Case]:
    """Ranges."""
    return [{"range_m": name} for name in RANGES]


def measure(case: Case, runs: int) -> Row:
    """`runs` views; the row keeps the errors squared."""
    name, setting, trials = str(case["range_m"]), Setting.packaged(), list[Trial]()
    eyes, (low_m, high_m) = setting.eyes(), RANGES[name]
    for scene, rng in lit_scenes(setting, SEED + list(RANGES).index(name), runs, VIEWS_A_SCENE):
        range_m = float(np.exp(rng.uniform(np.log(low_m), np.log(high_m))))
        view = view_at(range_m, rng.uniform(-38.0, 38.0), setting.gimbal_noise_rad, rng)
        image = scene.render(view.state(setting.rig), setting.camera, rng=rng)
        trials.append(look(view, image, eyes, setting))
    seen = [trial for trial in trials if trial.error is not None and trial.covariance is not None]
    squared = np.array([trial.nees for trial in seen])
    least, most = chi2.ppf([0.025, 0.975], FREEDOM * len(seen)) / (FREEDOM * len(seen))
    ratios = np.array([trial.error / np.sqrt(np.diag(trial.covariance)) for trial in seen])  # type: ignore[operator]
    return {
        **figures(trials),
        "means": f"{least:.2f}–{most:.2f}",
        **{f"beyond_{share:.0%}"[:-1]: float(np.mean(squared > chi2.ppf(share, FREEDOM))) for share in (0.95, 0.99)},
        **dict(zip(AXES, np.sqrt(np.mean(ratios**2, axis=0)).tolist(), strict=True)),
        "squared": np.round(squared, 2).tolist(),
    }


def picture(rows: Sequence[Row], path: Path) -> None:
    """The distribution of the error squared beside χ²'s."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    squared = np.concatenate([row["squared"] for row in rows])
    figure, axis = plt.subplots(figsize=(5.5, 3.2), layout="constrained")
    edges = np.linspace(0.0, 20.0, 61)
    axis.hist(squared, edges, density=True, alpha=0.5, label=f"{len(squared)} views")
    axis.plot(edges, chi2.pdf(edges, FREEDOM), label="χ² of 4 degrees")
    axis.set(xlabel="error squared, by the stated covariance", ylabel="density", xlim=(0.0, 20.0))
    axis.legend()
    axis.grid(alpha=0.3)
    figure.savefig(path, dpi=90)


STUDY = Study(
    question="Is the near vision's covariance true?",
    columns={
        "range_m": Column("range [m]"),
        **{key: COLUMNS[key] for key in ("views", "found", "nees")},
        "means": Column("95 % of such means lie in"),
        "beyond_95": Column("beyond χ²'s 95 % point [%]", ".1f", 100.0),
        "beyond_99": Column("beyond its 99 % point [%]", ".1f", 100.0),
        **{axis: Column(axis, ".2f") for axis in AXES},
    },
    cases=cases,
    measure=measure,
    runs=800,
    minutes=5,
    picture=picture,
)
