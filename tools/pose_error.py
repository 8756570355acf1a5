"""Pose error of the near vision against range and angle on rendered pictures, beside the Cramér–Rao bound and peers.

    python tools/pose_error.py                      # out/pose_error/table.md, peers.md and plot.png
    python tools/pose_error.py --published          # the published chain
    python tools/pose_error.py --no-gimbal          # corners alone: what the gimbal knows is left out
    python tools/pose_error.py --no-peers

The camera stands at each range, 0°, 20° and 40° off the bar's axis on either side, and looks at the bar to within 8°.
The bound is that of the eight corners with the corner noise measured at that range and angle, equal on both axes. The
peers see the same renderings, with their tags in the bar's stead (tools/peers.py), and know nothing of the gimbal.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from near_views import Setting, Trial, View, cramer_rao, finish_over_range, look, markdown, view_at
from peers import Peer, Picture, apriltag, aruco, grain, in_picture
from rich.progress import track

RANGES_M = (2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 18.0)
ANGLES_DEG = (0.0, 20.0, 40.0)
NOISE = 1.5
"""Of the sensor, in grey levels."""

HEADER = (
    "range [m]",
    "angle [°]",
    "accepted [%]",
    "corner rms [px]",
    "forward rms [cm]",
    "right rms [cm]",
    "down rms [cm]",
    "position max [cm]",
    "yaw rms [°]",
    "yaw max [°]",
    "position / bound",
    "yaw / bound",
    "error² / 4",
)


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


def corner_rms_px(trials: list[Trial]) -> float:
    """Of a corner on either axis."""
    return float(np.sqrt(np.mean(np.square([trial.corner_error_px for trial in trials]))))


def row(range_m: float, angle_deg: float, trials: list[Trial], setting: Setting) -> list[str]:
    """Figures of one range and angle, in the order of HEADER."""
    good = [trial for trial in trials if trial.error is not None and trial.corner_error_px is not None]
    start = [f"{range_m:.0f}", f"{angle_deg:.0f}", f"{100.0 * len(good) / len(trials):.0f}"]
    if not good:
        return start + ["–"] * (len(HEADER) - len(start))
    errors = np.array([trial.error for trial in good])
    noise_px = corner_rms_px(good)
    bounds = np.array([cramer_rao(trial.view, setting, noise_px, setting.gimbal_noise_rad) for trial in good])
    rms = np.sqrt(np.mean(errors**2, axis=0))
    least = np.sqrt(np.mean(np.diagonal(bounds, axis1=1, axis2=2), axis=0))
    ratio = float(np.sqrt(np.sum(rms[:3] ** 2) / np.sum(least[:3] ** 2)))
    return [
        *start,
        f"{noise_px:.3f}",
        *(f"{100.0 * value:.2f}" for value in rms[:3]),
        f"{100.0 * np.linalg.norm(errors[:, :3], axis=1).max():.1f}",
        f"{np.degrees(rms[3]):.3f}",
        f"{np.degrees(np.abs(errors[:, 3]).max()):.2f}",
        f"{ratio:.2f}",
        f"{rms[3] / least[3]:.2f}",
        f"{np.mean([trial.nees for trial in good]) / 4.0:.2f}",
    ]


@dataclass(frozen=True)
class Figures:
    """Of one method at one range and angle; NaN where it found nothing."""

    found_percent: float
    corner_px: float
    position_cm: float
    yaw_deg: float

    @staticmethod
    def of(trials: list[Trial]) -> Figures:
        """Root mean squares over the pictures in which it was found whole."""
        good = [trial for trial in trials if trial.error is not None and trial.corner_error_px is not None]
        found_percent = 100.0 * len(good) / len(trials)
        if not good:
            return Figures(found_percent, np.nan, np.nan, np.nan)
        rms = np.sqrt(np.mean(np.square([trial.error for trial in good]), axis=0))
        position_cm = 100.0 * float(np.linalg.norm(rms[:3]))
        return Figures(found_percent, corner_rms_px(good), position_cm, float(np.degrees(rms[3])))

    def cell(self) -> str:
        """Corners, position, yaw; the share found where it is not all."""
        if not self.found_percent:
            return "not found"
        text = f"{self.corner_px:.3f} / {self.position_cm:.3g} / {self.yaw_deg:.2g}"
        return text if self.found_percent == 100.0 else f"{text} ({self.found_percent:.0f} %)"


Cells = dict[tuple[float, float], dict[str, Figures]]
"""Figures of each method, by range and angle."""


def plot(rows: list[list[str]], cells: Cells, path: Path) -> None:
    """Position and yaw error against range, all angles, and their ratio to the bound."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.4), layout="constrained")
    names = list(next(iter(cells.values()), {}))
    ranges = [range_m for range_m, angle_deg in cells if angle_deg == 20.0]
    for name in names:
        some = [cells[range_m, 20.0][name] for range_m in ranges]
        axes[0].plot(ranges, [figures.position_cm for figures in some], "o-", label=name)
        axes[1].plot(ranges, [figures.yaw_deg for figures in some], "o-", label=name)
    axes[0].set(title="position error, rms, 20° off", ylabel="cm", yscale="log")
    axes[1].set(title="yaw error, rms, 20° off", ylabel="degrees", yscale="log")
    if names:
        axes[0].legend(fontsize="x-small")
    for angle_deg in ANGLES_DEG:
        lines = [row for row in rows if row[1] == f"{angle_deg:.0f}" and row[10] != "–"]
        axes[2].plot([float(c[0]) for c in lines], [float(c[10]) for c in lines], "o-", label=f"{angle_deg:.0f}° off")
    axes[2].axhline(1.3, color="grey", linestyle="--", label="goal")
    axes[2].set(title="position error / Cramér–Rao bound", ylim=(0.0, 2.0))
    axes[2].legend(fontsize="x-small")
    finish_over_range(figure, axes, path)


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=40, help="pictures a range and angle")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--published", action="store_true", help="the published chain instead of ours")
    parser.add_argument("--no-gimbal", action="store_true")
    parser.add_argument("--no-peers", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out/pose_error"))
    arguments = parser.parse_args()
    setting = Setting.packaged()
    rng = np.random.default_rng(arguments.seed)
    gimbal_noise_rad = setting.gimbal_noise_rad
    eyes = setting.eyes(published=arguments.published)
    alone = setting.eyes(published=arguments.published, gimbal_noise_rad=0.0)
    if arguments.no_gimbal:
        eyes, setting = alone, replace(setting, gimbal_noise_rad=0.0)
    peers = [] if arguments.no_peers else [aruco(setting.rig), apriltag(setting.rig, 1.0)]
    scene = setting.scene(arguments.seed)
    rows: list[list[str]] = []
    cells: Cells = {}
    places = [(range_m, angle_deg) for range_m in RANGES_M for angle_deg in ANGLES_DEG]
    for range_m, angle_deg in track(places, description="ranges and angles"):
        ours: list[Trial] = []
        others: dict[str, list[Trial]] = {"near vision": ours, "near vision, no gimbal": []}
        for index in range(arguments.trials):
            view = view_at(range_m, angle_deg if index % 2 else -angle_deg, gimbal_noise_rad, rng)
            clean = scene.render(view.state(setting.rig), setting.camera)
            noisy = grain(clean, NOISE, rng)
            ours.append(look(view, noisy, eyes, setting))
            if peers:
                others["near vision, no gimbal"].append(look(view, noisy, alone, setting))
            for peer in peers:
                picture = grain(peer.board.hung(clean, setting.camera, view.bar_from_camera.inverse()), NOISE, rng)
                others.setdefault(peer.name, []).append(ask(peer, view, picture, setting))
        rows.append(row(range_m, angle_deg, ours, setting))
        if peers:
            cells[range_m, angle_deg] = {name: Figures.of(trials) for name, trials in others.items()}
    scene.close()
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "table.md").write_text(markdown(HEADER, rows), encoding="utf-8")
    print(markdown(HEADER, rows))
    if peers:
        header = ["range [m]", "angle [°]", *next(iter(cells.values()))]
        lines = [[f"{r:.0f}", f"{a:.0f}", *(some.cell() for some in by.values())] for (r, a), by in cells.items()]
        (arguments.out / "peers.md").write_text(markdown(header, lines), encoding="utf-8")
        print(markdown(header, lines))
    plot(rows, cells, arguments.out / "plot.png")


if __name__ == "__main__":
    main()
