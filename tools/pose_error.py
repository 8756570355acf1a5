"""Pose error of the near vision against range, on rendered pictures: a table and a plot.

    python tools/pose_error.py                      # out/pose_error/table.md and plot.png
    python tools/pose_error.py --corners forstner   # the published corners
    python tools/pose_error.py --no-gimbal          # corners alone: what the gimbal knows is left out

The camera stands at each range, up to 20° off the bar's axis on either side, and looks at the bar to within 8°.
The Cramér–Rao bound is that of the eight corners with the corner noise measured at that range, equal on both axes.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shipland.camera import Camera, CameraParameters, level_from_camera
from shipland.config import build
from shipland.frames import Array, Pose, rotation_from_euler
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig, default_rig, packaged_table
from shipland.sim.scene import Scene, SceneParameters
from shipland.sim.state import SceneState
from shipland.vision.matching import model_plane
from shipland.vision.pipeline import NearVision, VisionParameters
from shipland.vision.pose import Corners, LevelPrior, bound, covariance_in_bar

RANGES_M = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 18.0)
OFF_AXIS_DEG = 20.0


@dataclass(frozen=True)
class View:
    """One place of the camera: its pose in `bar`, and its gimbal as the frame states it."""

    bar_from_camera: Pose
    gimbal: GimbalAttitude


@dataclass(frozen=True)
class Trial:
    """One picture: what was found, against the truth."""

    view: View
    reason: str
    error_m: Array | None = None
    yaw_error_rad: float = 0.0
    covariance: Array | None = None
    corner_error_px: Array | None = None


def random_view(range_m: float, gimbal_noise_rad: float, rng: np.random.Generator) -> View:
    """A camera at a range, off the bar's axis, that looks at the bar, not quite."""
    azimuth_rad = np.radians(rng.uniform(-OFF_AXIS_DEG, OFF_AXIS_DEG))
    # From 0.75 m below the bar, as over the deck, to 5° above it.
    down_m = rng.uniform(-np.sin(np.radians(5.0)) * range_m, min(0.75, 0.3 * range_m))
    level_m = np.sqrt(range_m**2 - down_m**2)
    position_in_bar_m = np.array([-level_m * np.cos(azimuth_rad), -level_m * np.sin(azimuth_rad), down_m])
    yaw_rad = azimuth_rad + np.radians(rng.uniform(-8.0, 8.0))
    pitch_rad = np.arctan2(down_m, level_m) + np.radians(rng.uniform(-4.0, 4.0))
    roll_rad = rng.normal(0.0, gimbal_noise_rad)
    rotation = rotation_from_euler(0.0, 0.0, yaw_rad) @ level_from_camera(GimbalAttitude(roll_rad, pitch_rad))
    stated = GimbalAttitude(0.0, pitch_rad + rng.normal(0.0, gimbal_noise_rad))
    return View(Pose(rotation, position_in_bar_m), stated)


def scene_state(rig: Rig, bar_from_camera: Pose, t_s: float = 0.0) -> SceneState:
    """The ship at rest with its neutral deck, seen by a camera."""
    ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -rig.deck_height_m]))
    ned_from_bar = ned_from_ship @ rig.ship_from_bar
    ned_from_camera = ned_from_bar @ bar_from_camera
    still = np.zeros(3)
    return SceneState(t_s, ned_from_camera, ned_from_ship, ned_from_ship, ned_from_bar, ned_from_camera, still, still)


def look(view: View, image: Array, vision: NearVision, camera: Camera, points_in_bar_m: Array) -> Trial:
    """One picture through the near vision."""
    vision.reset()
    observation = vision.see(Frame(0.0, image, view.gimbal))
    pose = observation.bar_pose
    if pose is None:
        return Trial(view, observation.reason)
    true_px = camera.project(view.bar_from_camera.inverse().apply(points_in_bar_m))
    forward = view.bar_from_camera.rotation[:, 2]
    yaw_rad = float(np.arctan2(forward[1], forward[0]))
    return Trial(
        view,
        "",
        pose.position_in_bar_m - view.bar_from_camera.translation_m,
        pose.yaw_rad - yaw_rad,
        pose.covariance,
        pose.corners_px - true_px,
    )


def cramer_rao(view: View, camera: Camera, plane_m: Array, noise_px: float, gimbal_noise_rad: float) -> Array:
    """(4,4) least covariance of (position in `bar`, yaw) for corners with equal noise on both axes."""
    corners = Corners(np.zeros_like(plane_m), np.broadcast_to(np.eye(8) / noise_px, (len(plane_m), 8, 8)), plane_m)
    prior = None
    if gimbal_noise_rad > 0.0:
        prior = LevelPrior(level_from_camera(replace(view.gimbal, yaw_rad=0.0))[2], gimbal_noise_rad)
    camera_from_plane = view.bar_from_camera.inverse() @ Pose(PLANE_AXES, np.zeros(3))
    return covariance_in_bar(bound(camera_from_plane, corners, camera, prior))


def row(range_m: float, trials: list[Trial], camera: Camera, plane_m: Array, gimbal_noise_rad: float) -> list[float]:
    """Figures of one range, in the order of HEADER."""
    good = [trial for trial in trials if trial.error_m is not None]
    if not good:
        return [range_m, 0.0] + [float("nan")] * (len(HEADER) - 2)
    errors = np.array([np.append(t.error_m, t.yaw_error_rad) for t in good])
    corners = np.array([t.corner_error_px for t in good])
    noise_px = float(np.sqrt(np.mean(corners**2)))
    bounds = np.array([cramer_rao(t.view, camera, plane_m, noise_px, gimbal_noise_rad) for t in good])
    nees = np.mean([e @ np.linalg.solve(t.covariance, e) for e, t in zip(errors, good, strict=True)]) / 4.0
    rms = np.sqrt(np.mean(errors**2, axis=0))
    largest = np.max(np.abs(errors), axis=0)
    least = np.sqrt(np.mean(np.diagonal(bounds, axis1=1, axis2=2), axis=0))
    ratio = float(np.sqrt(np.sum(rms[:3] ** 2) / np.sum(least[:3] ** 2)))
    return [
        range_m,
        100.0 * len(good) / len(trials),
        *(100.0 * rms[:3]),
        *(100.0 * largest[:3]),
        float(np.degrees(rms[3])),
        float(np.degrees(largest[3])),
        noise_px,
        ratio,
        float(rms[3] / least[3]),
        float(nees),
    ]


HEADER = (
    "range [m]",
    "accepted [%]",
    "forward rms [cm]",
    "right rms",
    "down rms",
    "forward max [cm]",
    "right max",
    "down max",
    "yaw rms [°]",
    "yaw max [°]",
    "corner rms [px]",
    "position / bound",
    "yaw / bound",
    "NEES / 4",
)
PLANE_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""`bar` from the cue's plane (right, down, forward)."""


def table(rows: list[list[float]]) -> str:
    """Markdown."""
    lines = ["| " + " | ".join(HEADER) + " |", "|" + "---|" * len(HEADER)]
    for values in rows:
        cells = [f"{values[0]:.0f}", f"{values[1]:.1f}"] + [f"{v:.2f}" for v in values[2:8]]
        cells += [f"{v:.3f}" for v in values[8:11]] + [f"{v:.2f}" for v in values[11:]]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def plot(rows: list[list[float]], path: Path) -> None:
    """Position, yaw and corner error against range."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    values = np.array(rows)
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.2), layout="constrained")
    for index, name in ((2, "forward"), (3, "right"), (4, "down")):
        axes[0].plot(values[:, 0], values[:, index], "o-", label=name)
    axes[0].set(title="position error, rms", ylabel="cm", yscale="log")
    axes[0].legend()
    axes[1].plot(values[:, 0], values[:, 8], "o-")
    axes[1].set(title="yaw error, rms", ylabel="degrees", yscale="log")
    axes[2].plot(values[:, 0], values[:, 11], "o-", label="position")
    axes[2].plot(values[:, 0], values[:, 12], "o-", label="yaw")
    axes[2].axhline(1.3, color="grey", linestyle="--", label="goal")
    axes[2].set(title="error / Cramér–Rao bound", ylim=(0.0, 2.0))
    axes[2].legend()
    for axis in axes:
        axis.set_xlabel("range [m]")
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=90)


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=60, help="pictures a range")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--corners", choices=("edges", "forstner"), default=None)
    parser.add_argument("--no-gimbal", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out/pose_error"))
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    rig = default_rig()
    camera_parameters = build(CameraParameters, packaged_table("camera"), "camera")
    camera = Camera.from_parameters(camera_parameters)
    parameters = build(VisionParameters, packaged_table("vision"), "vision")
    if arguments.corners:
        parameters = replace(parameters, corners=arguments.corners)
    if arguments.no_gimbal:
        parameters = replace(parameters, gimbal_noise_rad=0.0)
    scene = Scene(rig, build(SceneParameters, packaged_table("scene"), "scene"), arguments.seed)
    vision = NearVision(rig.target, camera, parameters)
    plane_m = model_plane(rig.target)
    gimbal_noise_rad = camera_parameters.gimbal_noise_rad
    rows = []
    for range_m in RANGES_M:
        trials = []
        for _ in range(arguments.trials):
            view = random_view(range_m, gimbal_noise_rad, rng)
            image = scene.render(scene_state(rig, view.bar_from_camera), camera, rng=rng)
            trials.append(look(view, image, vision, camera, rig.target.points_in_bar_m))
        rows.append(row(range_m, trials, camera, plane_m, 0.0 if arguments.no_gimbal else gimbal_noise_rad))
        refused = sorted({trial.reason for trial in trials if trial.reason})
        print(" ".join(f"{v:.3g}" for v in rows[-1]), *refused, sep="  ", flush=True)
    scene.close()
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "table.md").write_text(table(rows), encoding="utf-8")
    plot(rows, arguments.out / "plot.png")
    print(table(rows))


if __name__ == "__main__":
    main()
