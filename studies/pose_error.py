"""Pose error of the near vision against range and angle on rendered pictures, beside the Cramér–Rao bound and peers.

The camera stands at each range, 0°, 20° and 40° off the bar's axis on either side, and looks at the bar to within 8°.
The bound is that of the eight corners with the corner noise measured at that range and angle, equal on both axes. The
peers see the same renderings, with their tags in the bar's stead (studies/tags.py), and know nothing of the gimbal.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from studies.harness import Case, Column, Row, Study
from studies.tags import Peer, Picture, apriltag, aruco, grain, in_picture
from studies.views import (
    COLUMNS,
    Setting,
    Trial,
    View,
    corner_rms_px,
    cramer_rao,
    figures,
    finish_over_range,
    look,
    view_at,
)

RANGES_M = (2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 18.0)
ANGLES_DEG = (0.0, 20.0, 40.0)
NOISE = 1.5
"""Of the sensor, in grey levels."""
OURS, ALONE, PUBLISHED = "near vision", "near vision, no gimbal", "as published"
SEED = 1


def ask(peer: Peer, view: View, picture: Picture, setting: Setting) -> Trial:
    """One picture through a peer, by both of its tags."""
    found = peer.detect(picture)
    camera_from_bar = peer.pose(found, setting.camera)
    if camera_from_bar is None or len(found) < len(peer.board.tags_m):
        return Trial(view, "not found")
    truth = view.bar_from_camera.inverse()
    corner_error_px = np.concatenate(
        [quad - in_picture(peer.board.tags_m[number], setting.camera, truth) for number, quad in found.items()]
    )
    seen = View(camera_from_bar.inverse(), view.gimbal)
    error = seen.bar_from_camera.translation_m - view.bar_from_camera.translation_m
    return Trial(view, "", np.append(error, seen.yaw_rad - view.yaw_rad), None, corner_error_px)


def cases() -> Sequence[Case]:
    """Ranges and angles."""
    return [
        {"range_m": range_m, "angle_deg": angle_deg} for range_m, angle_deg in itertools.product(RANGES_M, ANGLES_DEG)
    ]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` pictures; a row for each who looks at them."""
    range_m, angle_deg = float(case["range_m"]), float(case["angle_deg"])
    setting, rng = Setting.packaged(), np.random.default_rng([SEED, int(range_m), int(angle_deg)])
    scene, peers = setting.scene(SEED), [aruco(setting.rig), apriltag(setting.rig, 1.0)]
    eyes = {OURS: setting.eyes(), ALONE: setting.eyes(gimbal_noise_rad=0.0), PUBLISHED: setting.eyes(published=True)}
    trials: dict[str, list[Trial]] = {name: [] for name in (*eyes, *(peer.name for peer in peers))}
    for index in range(runs):
        view = view_at(range_m, angle_deg if index % 2 else -angle_deg, setting.gimbal_noise_rad, rng)
        clean = scene.render(view.state(setting.rig), setting.camera)
        noisy = grain(clean, NOISE, rng)
        for name, vision in eyes.items():
            trials[name].append(look(view, noisy, vision, setting))
        for peer in peers:
            picture = grain(peer.board.hung(clean, setting.camera, view.bar_from_camera.inverse()), NOISE, rng)
            trials[peer.name].append(ask(peer, view, picture, setting))
    scene.close()
    return [{"viewer": name, **row_of(some, setting, bound=name == OURS)} for name, some in trials.items()]


def row_of(trials: Sequence[Trial], setting: Setting, *, bound: bool) -> dict[str, Any]:
    """Figures of one who looks, beside the bound where wanted."""
    row = figures(trials)
    good = [trial for trial in trials if trial.error is not None]
    if not good:
        return row | {"together": "not found"}
    share = "" if len(good) == len(trials) else f" ({100.0 * row['found']:.0f} %)"
    corner = "–" if row["corner_px"] is None else f"{row['corner_px']:.3f}"
    row["together"] = f"{corner} / {100.0 * row['position_m']:.3g} / {row['yaw_deg']:.2g}{share}"
    if bound:
        noise_px = corner_rms_px(good)
        bounds = [cramer_rao(trial.view, setting, noise_px, setting.gimbal_noise_rad) for trial in good]
        least = np.sqrt(np.mean(np.diagonal(bounds, axis1=1, axis2=2), axis=0))
        row["position_ratio"] = float(row["position_m"] / np.linalg.norm(least[:3]))
        row["yaw_ratio"] = float(np.radians(row["yaw_deg"]) / least[3])
    return row


def picture(rows: Sequence[Row], path: Path) -> None:
    """Position and yaw error against range at 20°, and the ratio to the bound at all angles."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.4), layout="constrained")
    for name in dict.fromkeys(row["viewer"] for row in rows):
        some = [row for row in rows if row["viewer"] == name and row["angle_deg"] == ANGLES_DEG[1] and row["found"]]
        ranges_m = [row["range_m"] for row in some]
        axes[0].plot(ranges_m, [100.0 * row["position_m"] for row in some], "o-", label=name)
        axes[1].plot(ranges_m, [row["yaw_deg"] for row in some], "o-", label=name)
    axes[0].set(title="position error, rms, 20° off", ylabel="cm", yscale="log")
    axes[1].set(title="yaw error, rms, 20° off", ylabel="degrees", yscale="log")
    axes[0].legend(fontsize="x-small")
    for angle_deg in ANGLES_DEG:
        some = [row for row in rows if row["angle_deg"] == angle_deg and "position_ratio" in row]
        axes[2].plot(
            [row["range_m"] for row in some],
            [row["position_ratio"] for row in some],
            "o-",
            label=f"{angle_deg:.0f}° off",
        )
    axes[2].axhline(1.3, color="grey", linestyle="--", label="goal")
    axes[2].set(title="position error / Cramér–Rao bound", ylim=(0.0, 2.0))
    axes[2].legend(fontsize="x-small")
    finish_over_range(figure, axes, path)


STUDY = Study(
    question="How does the pose error grow with the range, beside the bound and beside tags?",
    columns={
        "range_m": Column("range [m]", ".0f"),
        "angle_deg": Column("angle [°]", ".0f"),
        "viewer": Column("by"),
        **COLUMNS,
        "position_ratio": Column("position / bound", ".2f"),
        "yaw_ratio": Column("yaw / bound", ".2f"),
        "together": Column("corners [px] / position [cm] / yaw [°]"),
    },
    cases=cases,
    measure=measure,
    runs=40,
    minutes=8,
    picture=picture,
)
