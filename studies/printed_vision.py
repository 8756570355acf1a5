"""Pose error of the near chain as printed, of our reading of it, and of ours.

As printed the heading and the place come from the corners and from a camera that is stabilised in roll and pitch, which
is what the gimbal's attitude says; without it the corners stand alone.

The camera stands at each range, square on and 20° off the bar's axis on either side, and looks at the bar to within
8°. Every chain sees the same pictures, each afresh.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shipland.config import read_toml
from studies.harness import ROOT, Case, Column, Row, Study
from studies.spoiling import noise
from studies.views import COLUMNS, Setting, Trial, figures, finish_over_range, look, view_at

RANGES_M = (2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 25.0)
ANGLES_DEG = (0.0, 20.0)
NOISE = 1.5
"""Of the sensor, in grey levels."""
SEED = 43
PRINTED = read_toml(ROOT / "examples" / "near_vision_printed.toml")["vision"]
SUB_M, SUB_DEG = 0.01, 1.0
"""The claim: sub-centimetre and sub-degree [Lee2022, §Relative Position and Orientation (Pose) Estimation]."""


def cases() -> Sequence[Case]:
    """Ranges and angles."""
    return [
        {"range_m": range_m, "angle_deg": angle_deg} for range_m, angle_deg in itertools.product(RANGES_M, ANGLES_DEG)
    ]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` pictures; a row for each chain."""
    range_m, angle_deg = float(case["range_m"]), float(case["angle_deg"])
    setting, rng = Setting.packaged(), np.random.default_rng([SEED, int(range_m), int(angle_deg)])
    scene = setting.scene(SEED)
    eyes = {
        "printed": setting.eyes(published=True, **PRINTED),
        "printed, no gimbal": setting.eyes(published=True, **PRINTED, gimbal_noise_rad=0.0),
        "read": setting.eyes(published=True),
        "ours": setting.eyes(),
    }
    trials: dict[str, list[Trial]] = {name: [] for name in eyes}
    for index in range(runs):
        view = view_at(range_m, angle_deg if index % 2 else -angle_deg, setting.gimbal_noise_rad, rng)
        image = noise(scene.render(view.state(setting.rig), setting.camera), rng, NOISE)
        for name, vision in eyes.items():
            trials[name].append(look(view, image, vision, setting))
    scene.close()
    return [{"chain": name, **figures(some), **claimed(some)} for name, some in trials.items()]


def claimed(trials: Sequence[Trial]) -> dict[str, float | None]:
    """Medians, and the share of the poses found that are within a centimetre in every axis, and within a degree."""
    errors = np.array([trial.error for trial in trials if trial.error is not None])
    if not len(errors):
        return dict.fromkeys(("median_m", "median_deg", "sub_cm", "sub_deg"))
    place_m, yaw_deg = np.linalg.norm(errors[:, :3], axis=1), np.degrees(np.abs(errors[:, 3]))
    return {
        "median_m": float(np.median(place_m)),
        "median_deg": float(np.median(yaw_deg)),
        "sub_cm": float(np.mean(np.abs(errors[:, :3]).max(axis=1) < SUB_M)),
        "sub_deg": float(np.mean(yaw_deg < SUB_DEG)),
    }


def picture(rows: Sequence[Row], path: Path) -> None:
    """Position and yaw error against range, beside the claim."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10.0, 3.4), layout="constrained")
    names = list(dict.fromkeys(row["chain"] for row in rows))
    for name, (angle_deg, style) in itertools.product(names, zip(ANGLES_DEG, ("o-", "^:"), strict=True)):
        some = [row for row in rows if row["chain"] == name and row["angle_deg"] == angle_deg and row["found"]]
        ranges_m, colour = [row["range_m"] for row in some], f"C{names.index(name)}"
        label = f"{name}, {angle_deg:.0f}°"
        axes[0].plot(ranges_m, [100.0 * row["position_m"] for row in some], style, color=colour, label=label)
        axes[1].plot(ranges_m, [row["yaw_deg"] for row in some], style, color=colour)
    axes[0].axhline(100.0 * SUB_M, color="grey", linestyle="--", label="claimed")
    axes[1].axhline(SUB_DEG, color="grey", linestyle="--")
    axes[0].set(title="position error, rms", ylabel="cm", yscale="log")
    axes[1].set(title="yaw error, rms", ylabel="degrees", yscale="log")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right center", fontsize="small")
    finish_over_range(figure, axes, path)


STUDY = Study(
    question="Is the near vision as printed accurate to less than a centimetre and a degree?",
    columns={
        "range_m": Column("range [m]", ".0f"),
        "angle_deg": Column("angle [°]", ".0f"),
        "chain": Column("chain"),
        **COLUMNS,
        "median_m": Column("position, median [cm]", ".2f", 100.0),
        "median_deg": Column("yaw, median [°]", ".3f"),
        "sub_cm": Column("within 1 cm in each axis [%]", ".0f", 100.0),
        "sub_deg": Column("within 1° [%]", ".0f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=40,
    minutes=2,
    picture=picture,
    files=("examples/near_vision_printed.toml",),
)
