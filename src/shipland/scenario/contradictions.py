"""Contradictions between sections: two values that cannot both hold."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from shipland.camera import Camera
from shipland.rig import Rig

if TYPE_CHECKING:
    from shipland.scenario.scenario import Scenario

_TOUCH_M = 1e-9
"""Rounding error of two equal lengths."""


def contradictions(scenario: Scenario) -> Iterator[str]:
    """A line each, with both keys; nothing for a scenario that can be flown."""
    yield from _of_rig(scenario.rig)
    yield from _of_flight(scenario)
    yield from _of_view(scenario)


def _of_rig(rig: Rig) -> Iterator[str]:
    half_deck_m, (board_width_m, board_height_m) = 0.5 * rig.deck_size_m, rig.board_size_m
    deck_front_m = rig.deck_ahead_of_stern_m + half_deck_m
    board_top_m = rig.bar_height_m + 0.5 * board_height_m
    if rig.deck_size_m > rig.platform_width_m + _TOUCH_M:
        yield f"rig.deck_size_m = {rig.deck_size_m:g} is wider than rig.platform_width_m = {rig.platform_width_m:g}"
    if half_deck_m > rig.deck_ahead_of_stern_m + _TOUCH_M:
        yield (
            f"rig.deck_size_m = {rig.deck_size_m:g} stands out astern: "
            f"rig.deck_ahead_of_stern_m = {rig.deck_ahead_of_stern_m:g} is less than half of it"
        )
    if deck_front_m > rig.bar_ahead_of_stern_m + _TOUCH_M:
        yield (
            f"rig.deck_size_m = {rig.deck_size_m:g} reaches {deck_front_m:g} m ahead of the stern, past "
            f"rig.bar_ahead_of_stern_m = {rig.bar_ahead_of_stern_m:g}"
        )
    if rig.bar_ahead_of_stern_m > rig.platform_length_m + _TOUCH_M:
        yield (
            f"rig.bar_ahead_of_stern_m = {rig.bar_ahead_of_stern_m:g} is ahead of the platform: "
            f"rig.platform_length_m = {rig.platform_length_m:g}"
        )
    widest = "rig.polygon" if board_width_m > rig.board_width_m else "rig.board_width_m"
    if board_width_m > rig.platform_width_m + _TOUCH_M:
        yield (
            f"{widest} makes a board of {board_width_m:g} m, wider than the superstructure, "
            f"rig.platform_width_m = {rig.platform_width_m:g}"
        )
    if board_top_m > rig.superstructure_height_m + _TOUCH_M:
        yield (
            f"rig.bar_height_m = {rig.bar_height_m:g} puts the board's upper edge at {board_top_m:g} m, above "
            f"rig.superstructure_height_m = {rig.superstructure_height_m:g}"
        )


def _of_flight(scenario: Scenario) -> Iterator[str]:
    start, safety, approach = scenario.start, scenario.safety, scenario.guidance.approach
    if scenario.guidance.horizon.moment == "deck" and scenario.rig.hull != "platform":
        yield (
            f'guidance.horizon.moment = "deck" watches the markings of a platform, which rig.hull = '
            f'"{scenario.rig.hull}" is not'
        )
    to_bar_m = float(scenario.rig.bar_in_ship_m[0])
    farthest_m = math.hypot(start.distance_m + start.distance_half_range_m + to_bar_m, start.height_m)
    if farthest_m > safety.fence_distance_m:
        yield (
            f"start.distance_m = {start.distance_m:g} ± {start.distance_half_range_m:g} begins {farthest_m:.0f} m from "
            f"the bar, beyond safety.fence_distance_m = {safety.fence_distance_m:g}"
        )
    highest_m = start.height_m + start.height_half_range_m
    if highest_m > safety.fence_height_m:
        yield (
            f"start.height_m = {start.height_m:g} ± {start.height_half_range_m:g} begins above "
            f"safety.fence_height_m = {safety.fence_height_m:g}"
        )
    if approach.hover_height_m <= safety.floor_m:
        yield (
            f"guidance.approach.hover_height_m = {approach.hover_height_m:g} is not above "
            f"safety.floor_m = {safety.floor_m:g}"
        )
    if to_bar_m <= safety.bar_clearance_m:
        yield (
            f"safety.bar_clearance_m = {safety.bar_clearance_m:g} forbids the deck's centre, {to_bar_m:g} m astern of "
            f"the bar (rig.bar_ahead_of_stern_m, rig.deck_ahead_of_stern_m)"
        )


def _of_view(scenario: Scenario) -> Iterator[str]:
    """The cue must fit into the picture from the hover point, the camera turned to it."""
    camera = Camera.from_parameters(scenario.camera)
    hover_in_bar_m = scenario.rig.deck_in_bar_m - np.array([0.0, 0.0, scenario.guidance.approach.hover_height_m])
    eye_in_bar_m = hover_in_bar_m + np.array(scenario.camera.position_in_body_m)
    points_m = scenario.rig.cue.points_in_bar_m - eye_in_bar_m
    ahead_m = float(points_m[:, 0].min())
    cue = "rig.polygon" if scenario.rig.polygon else "rig.rectangle_width_m"
    if ahead_m <= 0.0:
        yield f"camera.position_in_body_m is ahead of the bar from the hover point: {cue} cannot be seen"
        return
    middle_rad = math.atan2(float(eye_in_bar_m[2]), -float(eye_in_bar_m[0]))  # of the bar above the horizon
    if not scenario.camera.gimbal_min_rad <= middle_rad <= scenario.camera.gimbal_max_rad:
        yield (
            f"guidance.approach.hover_height_m = {scenario.guidance.approach.hover_height_m:g} wants the camera at "
            f"{middle_rad:.2f} rad, outside camera.gimbal_min_rad … camera.gimbal_max_rad"
        )
    half_wide_px = camera.focal_px * float(np.abs(points_m[:, 1]).max()) / ahead_m
    elevations_rad = np.arctan2(-points_m[:, 2], points_m[:, 0])
    half_tall_px = camera.focal_px * float(np.tan(np.abs(elevations_rad - middle_rad)).max())
    if half_wide_px > 0.5 * camera.width_px or half_tall_px > 0.5 * camera.height_px:
        yield (
            f"{cue} covers {2.0 * half_wide_px:.0f} × {2.0 * half_tall_px:.0f} px from the hover point, more than the "
            f"picture: camera.horizontal_fov_deg = {scenario.camera.horizontal_fov_deg:g} is too narrow"
        )
