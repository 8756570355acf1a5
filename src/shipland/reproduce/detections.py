"""The packaged detectors on drawn pictures from five distances, as the paper shows its own.

[Lee2022, §Machine Learning Based Approach]
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.evaluation.tables import markdown
from shipland.figures import drawn
from shipland.frames import Pose, rotation_from_euler
from shipland.messages import Box, GimbalAttitude
from shipland.report.palette import VERMILION, unit
from shipland.reproduce.near_chain import still_state
from shipland.rig import Rig
from shipland.scenario.scenario import Scenario
from shipland.sim.scene.scene import Scene
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import NearestBox, SceneState, target_box
from shipland.vision.far.detector import Detector
from shipland.vision.parameters import DetectorParameters
from shipland.vision.pictures import Picture

DISTANCES_M = (30.0, 60.0, 100.0, 150.0, 250.0)
RISE = 0.08
"""Height over the bar, as a share of the distance."""
LEAST_SHOWN_PX = 56.0
"""Least side of the part of the picture that is shown; else so many times the target's width:"""
SURROUNDINGS = 3.0


@dataclass(frozen=True)
class Seen:
    """A target in a picture (H,W,3) BGR: its true edges where it is to be seen, and the box that was found there."""

    picture: Picture
    true_px: NearestBox | None
    box: Box | None


def state_from(rig: Rig, distance_m: float) -> SceneState:
    """A level camera so far astern of the bar, looking ahead and down at it, and a ship that lies still."""
    rise_m = RISE * distance_m
    looks = rotation_from_euler(0.0, -np.arctan2(rise_m, distance_m), 0.0) @ level_from_camera(GimbalAttitude(0.0, 0.0))
    return still_state(rig, Pose(looks, np.array([-distance_m, 0.0, -rise_m])))


def detections(path: Path, scenario: Scenario) -> str:
    """Draw a row of pictures for ship and bar; a table. SystemLibraryError where nothing can be rendered."""
    camera, rig, parameters = Camera.from_parameters(scenario.camera), scenario.rig, DetectorParameters()
    rng = np.random.default_rng(1)
    scene = Scene(rig, SceneParameters(), rng)
    states = [state_from(rig, distance_m) for distance_m in DISTANCES_M]
    pictures = [scene.render(state, camera, rng=rng) for state in states]
    scene.close()
    seen: dict[str, list[Seen]] = {}
    for kind, weights in (("ship", parameters.ship_weights), ("bar", parameters.bar_weights)):
        detector = Detector.load(weights, parameters)
        seen[kind] = []
        for state, picture in zip(states, pictures, strict=True):
            true_px = target_box(kind, state, camera, rig, 0.0, 0.0)
            found = detector.detect(picture, parameters.acquire_confidence)
            at = [box for box in found if true_px is not None and _over(box, true_px)]
            seen[kind].append(Seen(picture, true_px, max(at, key=lambda box: box.confidence, default=None)))
    plot_detections(path, seen)
    rows = []
    for kind, all_of in seen.items():
        for distance_m, each in zip(DISTANCES_M, all_of, strict=True):
            wide = "–" if each.true_px is None else f"{each.true_px[2] - each.true_px[0]:.1f}"
            sure = "not found" if each.box is None else f"{each.box.confidence:.2f}"
            rows.append((kind, f"{distance_m:.0f}", wide, sure))
    return markdown(("target", "distance [m]", "width [px]", "confidence"), rows)


def plot_detections(path: Path, seen: dict[str, list[Seen]]) -> None:
    """A row for each target, near to far, its surroundings at the camera's own pixels."""
    from matplotlib.patches import Rectangle

    with drawn(path, (12.0, 5.4), grid=False) as figure:
        rows = figure.subplots(len(seen), len(DISTANCES_M), squeeze=False)
        for axes_of, (kind, all_of) in zip(rows, seen.items(), strict=True):
            for axes, distance_m, each in zip(axes_of, DISTANCES_M, all_of, strict=True):
                axes.imshow(each.picture[:, :, ::-1], interpolation="nearest")
                axes.set(xticks=[], yticks=[])
                axes.spines[:].set_visible(False)
                if each.true_px is None:
                    continue
                left, top, right, bottom = (edge - 0.5 for edge in each.true_px)
                half = 0.5 * max(LEAST_SHOWN_PX, SURROUNDINGS * (right - left))
                middle = (0.5 * (left + right), 0.5 * (top + bottom))
                axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] + half, middle[1] - half))
                words = "not found"
                if each.box is not None:
                    (column, row), (wide, high) = each.box.centre_px, each.box.size_px
                    corner = (column - 0.5 * wide, row - 0.5 * high)
                    axes.add_patch(Rectangle(corner, wide, high, fill=False, edgecolor=unit(VERMILION), linewidth=1.6))
                    words = f"{each.box.confidence:.2f}"
                axes.set_title(f"{kind}, {distance_m:.0f} m, {right - left:.0f} px: {words}", fontsize=9)


def _over(box: Box, true_px: NearestBox) -> bool:
    """The box's centre lies within the target, or a pixel beside it."""
    left, top, right, bottom = true_px
    column, row = box.centre_px
    return left - 1.0 <= column <= right + 1.0 and top - 1.0 <= row <= bottom + 1.0
