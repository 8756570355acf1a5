"""The goals of each mode: the point flown to, the height, the pace, and the heading of the nose."""

from __future__ import annotations

import math

import numpy as np

from shipland.frames import Array, rotated, wrap_angle
from shipland.guidance.horizon.estimated import Estimated
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.horizon.reference import Pace
from shipland.guidance.laws import clamp
from shipland.guidance.parameters import ApproachParameters
from shipland.guidance.view import View
from shipland.messages import Mode
from shipland.rig import Rig

_AHEAD_RAD = math.radians(80.0)
"""Bearing from astern beyond which the ship stands in the way."""
_CLIMB_SLOPE = 0.15
"""Height above the hover for a metre of distance from `overhead_m` on."""


class Goals:
    """Points, heights and headings; remembers since when the aircraft waits at the stand-off.

    Args:
        parameters: of the pilot.
        approach: heights and distances of the modes.
        rig: the bar, and the deck below it.
        view: of the camera.
    """

    def __init__(self, parameters: HorizonParameters, approach: ApproachParameters, rig: Rig, view: View) -> None:
        self._path, self._margins, self._approach, self._view = parameters.path, parameters.margins, approach, view
        self._half_cue_m = float(np.max(np.abs(rig.cue.points_in_bar_m[:, 1])))
        self._deck_in_bar_m = rig.deck_in_bar_m
        self._waiting_s: float | None = None

    def of(self, mode: Mode, estimate: Estimated) -> tuple[Array, Array]:
        """(2,) the point flown to, from the bar, and (2,) its velocity by the bar's turn, in the axes of the flight."""
        path, approach = self._path, self._approach
        if estimate.bar_known:
            self._waiting_s = None
        else:
            distance_m = math.hypot(*estimate.place_m.tolist())
            too_high_m = (-estimate.down_m - path.far_above_m) / math.tan(math.radians(path.glide_path_deg))
            # From nearer it backs off: a least distance alone would spiral in, or meet an approaching ship.
            stand_off_m = max(path.stand_off_m, too_high_m)
            if estimate.course_rad is not None:  # astern of a ship under way
                goal_in_bar_m = self._past_ship(
                    rotated(estimate.place_m, -estimate.course_rad), np.array([-stand_off_m, 0.0])
                )
                return rotated(goal_in_bar_m, estimate.course_rad), np.zeros(2)
            goal_m = estimate.place_m * (stand_off_m / max(distance_m, 1.0))
            return rotated(goal_m, self._round_rad(estimate.t_s, distance_m)), np.zeros(2)
        ahead_m = float(self._deck_in_bar_m[0])
        if mode is Mode.GO_AROUND:
            ahead_m -= approach.go_around_back_m
        else:
            off_axis_m = abs(float(estimate.aircraft_in_bar_m[1]))
            above_m = max(-estimate.down_m - path.far_above_m - self._margins.above_path_m, 0.0)
            short_m = max(
                path.line_up * max(off_axis_m - self._margins.on_axis_m, 0.0),
                above_m / math.tan(math.radians(path.glide_path_deg)),
            )
            ahead_m -= short_m if mode is not Mode.LAND else 0.0
        goal_in_bar_m = self._past_ship(estimate.aircraft_in_bar_m[:2], np.array([ahead_m, 0.0]))
        goal_m = rotated(goal_in_bar_m, estimate.bar_rad)
        return goal_m, estimate.turn_rad_s * np.array([-goal_m[1], goal_m[0]])

    def pace(self, estimate: Estimated, goal_m: Array) -> Pace:
        """Towards a goal: fast far from it, gentle near."""
        path = self._path
        to_goal_m = math.hypot(*(goal_m - estimate.place_m).tolist())
        share = min(max((to_goal_m - path.near_m) / path.near_m, 0.0), 1.0)
        speed_mps = path.near_mps + share * (path.far_mps - path.near_mps)
        brake_mps2 = path.near_brake_mps2 + share * (path.far_brake_mps2 - path.near_brake_mps2)
        return Pace(
            speed_mps,
            brake_mps2,
            path.acceleration_mps2,
            path.closing_per_s,
            path.tracking_error_max_m,
            path.tracking_error_max_mps,
        )

    def height_m(self, mode: Mode, estimate: Estimated) -> float:
        """Height over the neutral deck, in every mode but the landing."""
        deck_down_m, hover_m = float(self._deck_in_bar_m[2]), self._approach.hover_height_m
        if mode is Mode.GO_AROUND:
            return self._approach.go_around_height_m
        far_m = deck_down_m + self._path.far_above_m
        if not estimate.bar_known:
            return far_m
        distance_m = math.hypot(*estimate.offset_m.tolist())
        higher_m = _CLIMB_SLOPE * max(distance_m - self._margins.overhead_m, 0.0)
        return min(hover_m + higher_m, max(far_m, hover_m))

    def nose_rad(self, estimate: Estimated) -> float:
        """Along the bar's axis while the bar stays in the picture; towards the bar while its heading is not known."""
        if not estimate.bar_known:
            return estimate.to_bar_rad
        cue_rad = math.atan2(self._half_cue_m, max(math.hypot(*estimate.place_m.tolist()), 0.1))
        room_rad = self._view.half_view_rad - cue_rad - math.radians(self._approach.bearing_margin_deg)
        widest_rad = max(clamp(room_rad, math.radians(self._approach.max_bearing_deg)), 0.0)
        off_rad = wrap_angle(estimate.to_bar_rad - estimate.bar_rad)
        return estimate.bar_rad + off_rad - clamp(off_rad, widest_rad)

    def _past_ship(self, aircraft_in_bar_m: Array, goal_in_bar_m: Array) -> Array:
        """The goal (2,), or, from ahead of the ship, a point on the way around it."""
        ahead_m, right_m = aircraft_in_bar_m.tolist()
        off_astern_rad, distance_m = math.atan2(right_m, -ahead_m), math.hypot(ahead_m, right_m)
        if abs(off_astern_rad) < _AHEAD_RAD or distance_m < self._margins.overhead_m + self._half_cue_m:
            return goal_in_bar_m
        radius_m = max(distance_m, 2.0 * self._approach.go_around_back_m)
        wanted_rad = off_astern_rad - math.copysign(math.radians(self._path.round_lead_deg), off_astern_rad)
        return radius_m * np.array([-math.cos(wanted_rad), math.sin(wanted_rad)])

    def _round_rad(self, t_s: float, distance_m: float) -> float:
        """Bearing of the goal around the bar: non-zero after a wait at the stand-off without corners."""
        path = self._path
        if distance_m > 2.0 * path.stand_off_m:
            self._waiting_s = None
        elif self._waiting_s is None:
            self._waiting_s = t_s
        if self._waiting_s is None or t_s - self._waiting_s < path.round_after_s:
            return 0.0
        return math.radians(path.round_lead_deg)
