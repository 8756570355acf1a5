"""From how far the near vision finds the cue: the share of pictures with a pose against range, by visibility.

Rendered pictures, up to 20° off the bar's axis, each searched afresh, in steps of 1 m until fewer than half give a
pose. The farthest pose that the configuration accepts (max_distance_m in [vision]) is lifted, so that vision itself is
the limit; what is left with it stands beside.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from studies.harness import Case, Column, Row, Study
from studies.spoiling import noise
from studies.views import Setting, finish_over_range, look, view_at

VISIBILITIES_M = {"clear day": 40000.0, "haze, 2 km": 2000.0, "haze, 500 m": 500.0}
FIRST_M, LAST_M = 10, 60
OFF_AXIS_DEG = 18.0
"""And 2° that `view_at` adds."""
NOISE = 1.5
"""Grey levels."""
WANTED, ENOUGH = 0.99, 0.5
LIFTED_M = 1000.0
SEED = 31


def cases() -> Sequence[Case]:
    """Visibilities."""
    return [{"visibility": name} for name in VISIBILITIES_M]


def measure(case: Case, runs: int) -> Row:
    """`runs` pictures a range; the row keeps the figures of each range."""
    number = list(VISIBILITIES_M).index(str(case["visibility"]))
    setting, rng = Setting.packaged(), np.random.default_rng([SEED, number])
    scene = setting.scene(0, visibility_m=VISIBILITIES_M[str(case["visibility"])])
    lifted, limited = setting.eyes(max_distance_m=LIFTED_M), setting.eyes()
    ranges: list[dict[str, Any]] = []
    for range_m in range(FIRST_M, LAST_M + 1):
        trials, within = [], 0
        for _ in range(runs):
            off_deg = float(rng.uniform(-OFF_AXIS_DEG, OFF_AXIS_DEG))
            view = view_at(float(range_m), off_deg, setting.gimbal_noise_rad, rng)
            image = noise(scene.render(view.state(setting.rig), setting.camera), rng, NOISE)
            trials.append(look(view, image, lifted, setting))
            within += not look(view, image, limited, setting).reason
        good = [trial for trial in trials if trial.error is not None]
        rms = np.sqrt(np.mean(np.square([trial.error for trial in good]), axis=0)) if good else None
        ranges.append(
            {
                "range_m": range_m,
                "share": len(good) / runs,
                "share_within": within / runs,
                "position_m": None if rms is None else float(np.linalg.norm(rms[:3])),
                "yaw_deg": None if rms is None else float(np.degrees(rms[3])),
                "nees": float(np.mean([trial.nees for trial in good])) / 4.0 if good else None,
                "refusals": dict(Counter(trial.reason for trial in trials if trial.reason)),
            }
        )
        if ranges[-1]["share"] < ENOUGH:
            break
    scene.close()
    position_m = {each["range_m"]: each["position_m"] for each in ranges}
    reached = {f"{key}_reach_m": reach_m(ranges, key) for key in ("share", "share_within")}
    return {**reached, "at_18_m": position_m.get(18), "at_20_m": position_m.get(20), "ranges": ranges}


def reach_m(ranges: Sequence[dict[str, Any]], key: str) -> int | None:
    """The largest range up to which every share is as wanted; None when the first one's is not."""
    reached = None
    for each in ranges:
        if each[key] < WANTED:
            break
        reached = each["range_m"]
    return reached


def picture(rows: Sequence[Row], path: Path) -> None:
    """Share of pictures with a pose and position error against range."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8.0, 3.0), layout="constrained")
    for row in rows:
        ranges_m = [each["range_m"] for each in row["ranges"]]
        axes[0].plot(ranges_m, [100.0 * each["share"] for each in row["ranges"]], ".-", label=row["visibility"])
        axes[1].plot(ranges_m, [each["position_m"] or np.nan for each in row["ranges"]], ".-")
    axes[0].axvline(Setting.packaged().vision.max_distance_m, color="grey", linestyle="--", label="max_distance_m")
    axes[0].set(ylabel="pictures with a pose [%]", ylim=(0.0, 103.0))
    axes[1].set(ylabel="position error, rms [m]", ylim=(0.0, None))
    axes[0].legend(fontsize="x-small")
    finish_over_range(figure, axes, path)


STUDY = Study(
    question="From how far does the near vision find the cue?",
    columns={
        "visibility": Column("visibility"),
        "share_reach_m": Column("reach of the vision [m]", ".0f"),
        "share_within_reach_m": Column("with `max_distance_m` [m]", ".0f"),
        "at_18_m": Column("position rms at 18 m [cm]", ".0f", 100.0),
        "at_20_m": Column("at 20 m [cm]", ".0f", 100.0),
    },
    cases=cases,
    measure=measure,
    runs=40,
    minutes=4,
    picture=picture,
)
