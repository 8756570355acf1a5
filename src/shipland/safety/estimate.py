"""The safety's own estimate of the aircraft's place: plain, from observation and telemetry alone, in every mode.

Near, the newest pose, or sight of the deck, not filtered. Far, range from the area of the box and direction from its
centre, carried on by the vehicle's own velocity while nothing is seen. Heights over take-off from the barometer, over
the deck from the pose, and by the barometer afterwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, all_finite, rotation_from_euler, turned
from shipland.guidance.view import View
from shipland.messages import BarPose, Box, DeckSight, Observation, Telemetry
from shipland.rig import Rig

_DECK_SHARE = 0.02
"""Share of a new difference in the deck's height over the take-off point: about two seconds at 30 Hz."""
_LONGEST_STEP_S = 1.0


@dataclass(frozen=True)
class SafetyEstimate:
    """The safety's own estimate.

    Attributes:
        t_s: of the last telemetry; None before the first.
        seen_s: exposure of the newest pose or box.
        pose_s: exposure of the newest pose.
        place_in_bar_m: (3,) the aircraft's centre of mass by that pose.
        yaw_rad: heading against the bar by that pose.
        bar_from_aircraft_m: (2,) horizontal way to the bar, in axes that lie still: north and east by the compass.
        heading_rad: compass, the last one known; 0 where there never was one.
        height_m, height_s: over the take-off point, and its time.
        deck_height_m: of the neutral deck over the take-off point.
        sink_mps: downward speed, not negative.
    """

    t_s: float | None = None
    seen_s: float = -math.inf
    pose_s: float = -math.inf
    place_in_bar_m: Array | None = None
    yaw_rad: float = 0.0
    bar_from_aircraft_m: Array | None = None
    heading_rad: float = 0.0
    height_m: float | None = None
    height_s: float = -math.inf
    deck_height_m: float | None = None
    deck_down_m: float = 0.0
    sink_mps: float = 0.0

    def place_at(self, t_s: float, stale_s: float) -> Array | None:
        """(3,) in `bar` by a pose no older than `stale_s`."""
        return self.place_in_bar_m if t_s - self.pose_s <= stale_s else None

    def height_at(self, t_s: float, stale_s: float) -> float | None:
        """Over the take-off point, by a barometer no older than `stale_s`."""
        return self.height_m if t_s - self.height_s <= stale_s else None

    def over_deck_at(self, t_s: float, stale_s: float) -> float | None:
        """Over the neutral deck: by a recent pose, else by the barometer once a pose has shown the deck's height."""
        place_m, height_m = self.place_at(t_s, stale_s), self.height_at(t_s, stale_s)
        if place_m is not None:
            return self.deck_down_m - float(place_m[2])
        if height_m is not None and self.deck_height_m is not None:
            return height_m - self.deck_height_m
        return None

    def bar_in_level(self) -> tuple[float, Array]:
        """Distance to the bar and the unit vector (2,) to it, forward and right; NaN distance where unknown."""
        if self.bar_from_aircraft_m is None:
            return math.nan, np.zeros(2)
        distance_m = math.hypot(*self.bar_from_aircraft_m.tolist())
        return distance_m, turned(self.bar_from_aircraft_m, -self.heading_rad) / max(distance_m, 1e-9)


class SafetyEstimator:
    """Updates the estimate; holds dimensions and intrinsics only."""

    def __init__(self, rig: Rig, camera: Camera, camera_in_body_m: Array) -> None:
        self._view, self._deck_down_m, self._deck_in_bar_m = (
            View.of(camera),
            float(rig.deck_in_bar_m[2]),
            rig.deck_in_bar_m,
        )
        board_width_m, board_height_m = rig.board_size_m
        self._bar_side_m = math.sqrt(board_width_m * board_height_m)
        self._ship_side_m = math.sqrt(rig.platform_width_m * rig.superstructure_height_m)
        self._camera_in_body_m = np.asarray(camera_in_body_m, dtype=float)

    def updated(self, estimate: SafetyEstimate, observation: Observation, telemetry: Telemetry) -> SafetyEstimate:
        """After one cycle; what is None or not finite changes nothing."""
        estimate = self._with_telemetry(estimate, telemetry)
        pose, bar, ship = observation.bar_pose, observation.bar_box, observation.ship_box
        if pose is not None and all_finite(pose.position_in_bar_m) and math.isfinite(pose.yaw_rad):
            return self._with_pose(estimate, pose, observation.t_s)
        deck = observation.deck
        if deck is not None and all_finite(deck.centre_in_level_m) and estimate.place_in_bar_m is not None:
            return self._with_deck(estimate, deck, observation.t_s)
        if bar is not None and _usable(bar):
            return self._with_box(estimate, bar, self._bar_side_m, observation.t_s)
        if ship is not None and _usable(ship):
            return self._with_box(estimate, ship, self._ship_side_m, observation.t_s)
        return estimate

    def _with_telemetry(self, estimate: SafetyEstimate, telemetry: Telemetry) -> SafetyEstimate:
        heading_rad, velocity_mps = telemetry.heading_rad, telemetry.velocity_in_level_mps
        if heading_rad is None or not math.isfinite(heading_rad):
            heading_rad = estimate.heading_rad
        height_m, height_s = estimate.height_m, estimate.height_s
        if telemetry.height_m is not None and math.isfinite(telemetry.height_m):
            height_m, height_s = telemetry.height_m, telemetry.t_s
        way_m, sink_mps = estimate.bar_from_aircraft_m, 0.0
        step_s = 0.0 if estimate.t_s is None else telemetry.t_s - estimate.t_s
        if velocity_mps is not None and all_finite(velocity_mps):
            sink_mps = max(0.0, float(velocity_mps[2]))
            if way_m is not None:
                way_m = way_m - min(max(step_s, 0.0), _LONGEST_STEP_S) * turned(velocity_mps[:2], heading_rad)
        return replace(
            estimate,
            t_s=telemetry.t_s,
            heading_rad=heading_rad,
            height_m=height_m,
            height_s=height_s,
            bar_from_aircraft_m=way_m,
            deck_down_m=self._deck_down_m,
            sink_mps=sink_mps,
        )

    def _with_pose(self, estimate: SafetyEstimate, pose: BarPose, exposure_s: float) -> SafetyEstimate:
        bar_from_level = rotation_from_euler(0.0, 0.0, pose.yaw_rad)
        place_m = pose.position_in_bar_m - bar_from_level @ self._camera_in_body_m
        deck_height_m, known_m = estimate.deck_height_m, estimate.height_m
        if known_m is not None:
            seen_m = known_m - (self._deck_down_m - float(place_m[2]))
            deck_height_m = seen_m if deck_height_m is None else deck_height_m + _DECK_SHARE * (seen_m - deck_height_m)
        return replace(
            estimate,
            seen_s=exposure_s,
            pose_s=exposure_s,
            place_in_bar_m=place_m,
            yaw_rad=pose.yaw_rad,
            bar_from_aircraft_m=turned(-place_m[:2], estimate.heading_rad - pose.yaw_rad),
            deck_height_m=deck_height_m,
        )

    def _with_deck(self, estimate: SafetyEstimate, deck: DeckSight, exposure_s: float) -> SafetyEstimate:
        """Over the deck where it is now, not where it would lie at rest: that is what must not be struck."""
        bar_from_level = rotation_from_euler(0.0, 0.0, estimate.yaw_rad)
        place_m = self._deck_in_bar_m - bar_from_level @ (self._camera_in_body_m + deck.centre_in_level_m)
        return replace(estimate, seen_s=exposure_s, pose_s=exposure_s, place_in_bar_m=place_m)

    def _with_box(self, estimate: SafetyEstimate, box: Box, side_m: float, exposure_s: float) -> SafetyEstimate:
        range_m = self._view.focal_px * side_m / math.sqrt(box.area_px2)
        direction_rad = estimate.heading_rad + self._view.bearing_rad(box.centre_px[0])
        way_m = range_m * np.array([math.cos(direction_rad), math.sin(direction_rad)])
        return replace(estimate, seen_s=exposure_s, bar_from_aircraft_m=way_m)


def _usable(box: Box) -> bool:
    return all(map(math.isfinite, (*box.centre_px, *box.size_px))) and min(box.size_px) > 0.0
