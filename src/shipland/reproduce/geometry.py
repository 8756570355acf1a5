"""Figures of the far vision that need no trained detector: sizes in the picture, YOLOv3's grids and scales.

[Lee2022, §Machine Learning Based Approach]
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shipland.camera import Camera
from shipland.evaluation.tables import markdown
from shipland.figures import drawn
from shipland.report.palette import BLUE, GREEN, GREY, ORANGE, VERMILION, unit
from shipland.rig import Rig
from shipland.scenario.scenario import Scenario

SHIP_RANGE_M, BAR_RANGE_M = 250.0, 100.0
"""What the paper observed."""
STERN_M = 15.0
"""The paper's typical small ship."""
INPUTS_PX = (416, 608)
"""YOLOv3's usual inputs; the paper gives none."""
STRIDES = (32, 16, 8)
"""Pixels of a grid cell at YOLOv3's three scales."""
VALUES = 3 * (4 + 1 + 1)
"""A cell's: three anchors, each four offsets, one confidence, one class (erratum 17)."""
_PART_CELLS = 12
"""Of a grid whose cells are larger than the target, so many are shown."""


def width_px(size_m: float, distance_m: float, focal_px: float) -> float:
    """Width of a target in the picture.

    >>> round(width_px(1.8, 250.0, 931.2), 1)
    6.7
    """
    return size_m * focal_px / distance_m


def distance_size(path: Path, scenario: Scenario) -> str:
    """Draw width against distance of the targets; the figures as a table."""
    camera, rig = Camera.from_parameters(scenario.camera), scenario.rig
    plot_distance_size(path, camera, rig)
    rows = []
    for name, size_m, distances_m in (
        ("ship platform", rig.platform_width_m, (25.0, 100.0, SHIP_RANGE_M)),
        ("horizon bar", rig.board_size_m[0], (10.0, 25.0, BAR_RANGE_M)),
        ("stern of 15 m", STERN_M, (250.0, SHIP_RANGE_M * STERN_M / 1.8, SHIP_RANGE_M * (STERN_M / 1.8) ** 2)),
    ):
        for distance_m in distances_m:
            wide = width_px(size_m, distance_m, camera.focal_px)
            shrunk = (f"{wide * side_px / camera.width_px:.1f}" for side_px in INPUTS_PX)
            rows.append((name, f"{distance_m:.0f}", f"{wide:.1f}", *shrunk))
    return markdown(("target", "distance [m]", "width [px]", *(f"shrunk to {it} px" for it in INPUTS_PX)), rows)


def plot_distance_size(path: Path, camera: Camera, rig: Rig) -> None:
    """Width in pixels against distance, and the two readings of a full-size ship's range (erratum 5)."""
    least_px = width_px(rig.platform_width_m, SHIP_RANGE_M, camera.focal_px)
    with drawn(path, (9.5, 4.6)) as figure:
        axes = figure.add_subplot()
        distances_m = np.geomspace(5.0, 60000.0, 200)
        for name, size_m, colour, reach_m in (
            ("ship platform, 1.8 m", rig.platform_width_m, BLUE, SHIP_RANGE_M),
            (f"horizon bar, {rig.board_size_m[0]:.1f} m", rig.board_size_m[0], GREEN, BAR_RANGE_M),
            ("a ship's stern, 15 m", STERN_M, ORANGE, SHIP_RANGE_M * STERN_M / rig.platform_width_m),
        ):
            axes.plot(distances_m, size_m * camera.focal_px / distances_m, color=unit(colour), label=name)
            axes.plot(reach_m, width_px(size_m, reach_m, camera.focal_px), "o", color=unit(colour))
        wide = SHIP_RANGE_M * (STERN_M / rig.platform_width_m) ** 2
        axes.plot(wide, width_px(STERN_M, wide, camera.focal_px), "X", color=unit(VERMILION), markersize=9)
        axes.axhline(least_px, color=unit(GREY), linestyle="--")
        axes.axhline(1.0, color=unit(GREY), linestyle=":")
        for text, at, shift in (
            ("250 m, as observed", (SHIP_RANGE_M, least_px), (-96, -18)),
            ("100 m, as observed", (BAR_RANGE_M, width_px(rig.board_size_m[0], BAR_RANGE_M, camera.focal_px)), (8, 8)),
            (f"2.1 km: the same {least_px:.1f} px", (SHIP_RANGE_M * STERN_M / 1.8, least_px), (6, 8)),
            ("17.3 km, as printed:\nunder a pixel", (wide, width_px(STERN_M, wide, camera.focal_px)), (-8, 14)),
        ):
            axes.annotate(text, at, xytext=shift, textcoords="offset points", fontsize=9)
        axes.set(xscale="log", yscale="log", xlim=(5.0, 60000.0), ylim=(0.3, 1280.0), xlabel="distance [m]")
        axes.set_title(f"width in the picture [px], {camera.width_px} px through f = {camera.focal_px:.0f} px")
        axes.legend(loc="upper right")


def yolo_grid(path: Path, scenario: Scenario) -> str:
    """Draw the grids of three scales over a tile with the platform at three distances; the tensors as a table."""
    plot_yolo_grid(path, Camera.from_parameters(scenario.camera), scenario.rig)
    side_px = INPUTS_PX[0]
    rows = [
        f"| {stride} | {side_px // stride} × {side_px // stride} × {VALUES} | {3 * (side_px // stride) ** 2} |"
        for stride in STRIDES
    ]
    return "\n".join(["| cell [px] | N × N × [3·(4+1+1)] | boxes |", "|---:|---:|---:|", *rows])


def plot_yolo_grid(path: Path, camera: Camera, rig: Rig) -> None:
    """Three panels, coarse to fine: the grid, the cell that answers for the box, and the box."""
    from matplotlib.patches import Rectangle

    side_px, focal_px = INPUTS_PX[0], camera.focal_px
    with drawn(path, (11.0, 4.2), grid=False) as figure:
        panels = figure.subplots(1, 3)
        for axes, stride, distance_m in zip(panels, STRIDES, (10.0, 50.0, SHIP_RANGE_M), strict=True):
            wide = width_px(rig.platform_width_m, distance_m, focal_px)
            high = width_px(rig.superstructure_height_m, distance_m, focal_px)
            middle = np.array([7.4, 5.6]) * STRIDES[0]
            lines = np.arange(0, side_px + 1, stride) - 0.5
            axes.hlines(lines, -0.5, side_px - 0.5, color="#c8c8c8", linewidth=0.5)
            axes.vlines(lines, -0.5, side_px - 0.5, color="#c8c8c8", linewidth=0.5)
            corner = stride * np.floor(middle / stride) - 0.5
            axes.add_patch(Rectangle((corner[0], corner[1]), stride, stride, facecolor=unit(ORANGE), alpha=0.6))
            left_top = middle - 0.5 * np.array([wide, high])
            axes.add_patch(Rectangle(tuple(left_top), wide, high, fill=False, edgecolor=unit(BLUE), linewidth=1.6))
            axes.plot(*middle, ".", color=unit(BLUE), markersize=3)
            count = side_px // stride
            axes.set_title(f"{count} × {count} × {VALUES}: platform at {distance_m:.0f} m, {wide:.0f} px")
            axes.set(xlim=(-0.5, side_px - 0.5), ylim=(side_px - 0.5, -0.5), aspect="equal", xticks=[], yticks=[])
            axes.spines[:].set_visible(False)
            if wide < stride:
                part = 0.5 * _PART_CELLS * stride
                axes.set(xlim=(middle[0] - part, middle[0] + part), ylim=(middle[1] + part, middle[1] - part))
                axes.set_xlabel(f"{_PART_CELLS} × {_PART_CELLS} of its cells")
