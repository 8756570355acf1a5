"""The published near chain on one picture, step by step: gate, opening, closing, watershed, rectangles, corners.

[Lee2022, §Image Filtering] and [Lee2022, §Contour and Corner Detection] show these steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import numpy.typing as npt

from shipland.camera import Camera, level_from_camera
from shipland.figures import drawn
from shipland.frames import Array, Pose, rotation_from_euler
from shipland.messages import GimbalAttitude
from shipland.rig import Rig
from shipland.scenario.scenario import Scenario
from shipland.sim.scene.scene import Scene
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import SceneState
from shipland.vision.near.published import bounding_quads, find_regions, gate, measure_corners, watershed_region
from shipland.vision.near.segment import Image, Region, Window, opened_and_closed
from shipland.vision.parameters import VisionParameters

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RANGE_M, OFF_AXIS_DEG = 4.0, 20.0
"""Where the picture is taken from."""
NOISE = 20.0
"""Of the sensor, in grey levels, and dim light, so that the gate leaves specks and voids as the paper's did."""
EXPOSURE_EV = -1.6


@dataclass(frozen=True)
class ChainSteps:
    """What each step makes of one picture.

    Attributes:
        picture: (H,W,3) BGR.
        gated, opened, closed: (H,W) 0 or 255.
        regions: of the closed mask.
        flooded: the same with the watershed's boundary.
        reach_px: of each region, how far the watershed's two seeds stand off it.
        rectangles_px: (n,4,2) upright bounding rectangles.
        corners_px: (n,4,2) at sub-pixel, or None.
    """

    picture: Image
    gated: Image
    opened: Image
    closed: Image
    regions: list[Region]
    flooded: list[Region]
    reach_px: list[int]
    rectangles_px: Array
    corners_px: Array | None


def chain_steps(picture: Image, camera: Camera, parameters: VisionParameters) -> ChainSteps:
    """The published steps, one after the other, on the two largest regions."""
    gated = gate(picture, parameters)
    kernel = np.ones((parameters.kernel_px, parameters.kernel_px), np.uint8)
    opened = np.asarray(cv2.morphologyEx(gated, cv2.MORPH_OPEN, kernel), np.uint8)
    closed = opened_and_closed(gated, parameters.kernel_px)
    regions = find_regions(picture, Window.whole(picture), parameters)[:2]
    found = (watershed_region(picture, region, parameters.watershed_margin) for region in regions)
    flooded = [region for region in found if region is not None]
    sides_px = [max(cv2.boundingRect(region.contour_px)[2:]) for region in regions]
    reach_px = [max(1, round(parameters.watershed_margin * side_px)) for side_px in sides_px]
    rectangles_px = np.array(bounding_quads(picture, regions, parameters)).reshape(-1, 4, 2)
    measured = measure_corners(picture, rectangles_px, camera, parameters) if len(rectangles_px) else None
    corners_px = None if measured is None else measured.corners_px
    return ChainSteps(picture, gated, opened, closed, regions, flooded, reach_px, rectangles_px, corners_px)


def still_state(rig: Rig, bar_from_camera: Pose) -> SceneState:
    """A camera that stands before a ship that lies still."""
    ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -rig.deck_height_m]))
    ned_from_bar, still = ned_from_ship @ rig.ship_from_bar, np.zeros(3)
    ned_from_camera = ned_from_bar @ bar_from_camera
    return SceneState(0.0, ned_from_camera, ned_from_ship, ned_from_ship, ned_from_bar, ned_from_camera, still, still)


def dim_picture(rig: Rig, camera: Camera) -> Image:
    """The bar in dim light by a noisy sensor; SystemLibraryError where nothing can be rendered."""
    off_rad = np.radians(OFF_AXIS_DEG)
    rotation = rotation_from_euler(0.0, 0.0, off_rad) @ level_from_camera(GimbalAttitude(0.0, 0.0))
    place_in_bar_m = np.array([-RANGE_M * np.cos(off_rad), -RANGE_M * np.sin(off_rad), 0.05])
    state = still_state(rig, Pose(rotation, place_in_bar_m))
    rng = np.random.default_rng(3)
    scene = Scene(rig, SceneParameters(exposure_ev=EXPOSURE_EV), rng)
    clean = scene.render(state, camera)
    scene.close()
    return np.clip(clean + rng.normal(0.0, NOISE, clean.shape), 0.0, 255.0).astype(np.uint8)


def near_chain(path: Path, scenario: Scenario) -> str:
    """Draw the steps as panels; what they found, in words."""
    camera = Camera.from_parameters(scenario.camera)
    steps = chain_steps(dim_picture(scenario.rig, camera), camera, scenario.vision)
    plot_near_chain(path, steps)
    specks = int(np.count_nonzero(steps.gated & ~steps.opened))
    voids = int(np.count_nonzero(steps.closed & ~steps.opened))
    moved = "none" if steps.corners_px is None else f"{np.abs(steps.corners_px - steps.rectangles_px).max():.1f} px"
    return (
        f"{RANGE_M:.0f} m from the bar, {OFF_AXIS_DEG:.0f}° off its axis, dim light, noise of {NOISE:.0f} grey levels. "
        f"Opening removes {specks} px, closing fills {voids} px. "
        f"Largest way from a rectangle's corner to the corner found: {moved}."
    )


def plot_near_chain(path: Path, steps: ChainSteps) -> None:
    """Eight panels of the part of the picture that holds the bar; DataError when the file cannot be written."""
    shown = _shown(steps)
    extent = (shown.left - 0.5, shown.right - 0.5, shown.bottom - 0.5, shown.top - 0.5)
    picture = np.ascontiguousarray(shown.of(steps.picture)[:, :, ::-1])
    with drawn(path, (12.0, 3.0), grid=False) as figure:
        panels = figure.subplots(2, 4).ravel()
        masks = (("gate", steps.gated), ("opening", steps.opened), ("closing", steps.closed))
        for axes, (title, mask) in zip(panels[1:4], masks, strict=True):
            axes.imshow(shown.of(mask), cmap="gray", extent=extent, vmin=0, vmax=255, interpolation="nearest")
            axes.set_title(title)
        for axes, title in zip(
            panels[[0, 4, 5, 6, 7]], ("picture", "watershed", "contours", "bounding rectangles", "corners"), strict=True
        ):
            axes.imshow(picture, extent=extent, interpolation="nearest")
            axes.set_title(title)
        _draw_watershed(panels[4], steps)
        for region in steps.flooded:
            _outline(panels[5], region.contour_px, "#ff3b30", 1.4)
        for rectangle in steps.rectangles_px:
            for axes in panels[6:8]:
                _outline(axes, rectangle, "#ffd60a", 1.4)
        if steps.corners_px is not None:
            panels[7].plot(*steps.corners_px.reshape(-1, 2).T, "+", color="#ff3b30", markersize=11, markeredgewidth=1.8)
        for axes in panels:
            axes.set(xlim=extent[:2], ylim=extent[2:], xticks=[], yticks=[])
            axes.spines[:].set_visible(False)
        if steps.flooded:
            near = _left_end(steps.flooded, extent)
            panels[4].set(xlim=near[:2], ylim=near[2:])
            panels[4].set_title("watershed, one corner")


def _draw_watershed(axes: Axes, steps: ChainSteps) -> None:
    """The eroded regions that flood outward, the background that floods inward, and where they meet."""
    for before, after, reach_px in zip(steps.regions, steps.flooded, steps.reach_px, strict=False):
        filled = np.zeros(steps.closed.shape, np.uint8)
        cv2.drawContours(filled, [before.contour_px.reshape(-1, 1, 2)], -1, 255, cv2.FILLED)
        kernel = np.ones((2 * reach_px + 1, 2 * reach_px + 1), np.uint8)
        for mask, colour in ((cv2.erode(filled, kernel), "#0a84ff"), (cv2.dilate(filled, kernel), "#ffd60a")):
            for contour in cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0]:
                _outline(axes, contour[:, 0], colour, 2.2)
        _outline(axes, after.contour_px, "#ff3b30", 1.2)


def _outline(axes: Axes, points_px: npt.NDArray[Any], colour: str, width: float) -> None:
    closed = np.vstack([points_px, points_px[:1]])
    axes.plot(closed[:, 0], closed[:, 1], color=colour, linewidth=width)


def _left_end(regions: list[Region], extent: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """A part of the picture of its shape, around the left end of the leftmost region: left, right, bottom, top."""
    first = min((region.contour_px for region in regions), key=lambda points_px: int(points_px[:, 0].min()))
    left, (top, bottom) = float(first[:, 0].min()), (float(first[:, 1].min()), float(first[:, 1].max()))
    high = 0.7 * (bottom - top)
    wide = high * (extent[1] - extent[0]) / (extent[2] - extent[3])
    return (left - 0.15 * wide, left + 0.85 * wide, top - 0.25 * high + high, top - 0.25 * high)


def _shown(steps: ChainSteps) -> Window:
    """The bar's surroundings."""
    points_px = np.vstack([region.contour_px for region in steps.regions]) if steps.regions else np.zeros((1, 2))
    height_px, width_px = steps.closed.shape
    margin_px = 0.12 * float(np.ptp(points_px[:, 0])) + 8.0
    return Window.around(points_px.astype(float), margin_px, width_px, height_px)
