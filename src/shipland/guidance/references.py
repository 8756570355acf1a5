"""References of near flight: points and headings in `bar`. They are no part of a filter's state."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.frames import Array
from shipland.guidance.laws import clamp
from shipland.guidance.parameters import ApproachParameters
from shipland.guidance.view import View
from shipland.messages import Mode
from shipland.rig import Rig


@dataclass(frozen=True)
class References:
    """Reference points of the aircraft's centre of mass.

    Attributes:
        hover_in_bar_m: (3,) over the deck's neutral point: approach and landing.
        retry_in_bar_m: (3,) astern of it and higher: the end of a go-around.
        deck_down_m: the deck's neutral surface below the bar's centre.
        half_cue_m: half the cue's width.
        landing_half_m: landing begins only with both horizontal errors within this.
    """

    hover_in_bar_m: Array
    retry_in_bar_m: Array
    deck_down_m: float
    half_cue_m: float
    landing_half_m: float

    @staticmethod
    def of(rig: Rig, approach: ApproachParameters) -> References:
        """From the rig's dimensions."""
        margin = 1.0 if approach.at_once else approach.square_margin
        return References(
            hover_in_bar_m=rig.deck_in_bar_m - np.array([0.0, 0.0, approach.hover_height_m]),
            retry_in_bar_m=rig.deck_in_bar_m - np.array([approach.go_around_back_m, 0.0, approach.go_around_height_m]),
            deck_down_m=float(rig.deck_in_bar_m[2]),
            half_cue_m=float(np.max(np.abs(rig.cue.points_in_bar_m[:, 1]))),
            landing_half_m=0.5 * rig.landing_square_m * margin,
        )

    def point_in_bar_m(self, mode: Mode) -> Array:
        """(3,) the reference point of a mode."""
        return self.retry_in_bar_m if mode is Mode.GO_AROUND else self.hover_in_bar_m

    def height_m(self, aircraft_in_bar_m: Array) -> float:
        """Height of a point over the deck's neutral surface."""
        return self.deck_down_m - float(aircraft_in_bar_m[2])

    def is_clear(self, aircraft_in_bar_m: Array) -> bool:
        """Whether a point is far enough astern and high enough for another approach."""
        return bool(
            aircraft_in_bar_m[0] < self.retry_in_bar_m[0] + 1.0 and aircraft_in_bar_m[2] < self.retry_in_bar_m[2] + 0.5
        )

    def heading_rad(self, aircraft_in_bar_m: Array, view: View, approach: ApproachParameters) -> float:
        """Heading against the bar: along its axis, but no further off the bar than keeps the whole cue in view."""
        forward_m, right_m = -float(aircraft_in_bar_m[0]), -float(aircraft_in_bar_m[1])
        to_bar_rad = math.atan2(right_m, forward_m)
        cue_rad = math.atan2(self.half_cue_m, max(math.hypot(forward_m, right_m), 0.1))
        room_rad = view.half_view_rad - cue_rad - math.radians(approach.bearing_margin_deg)
        widest_rad = clamp(room_rad, math.radians(approach.max_bearing_deg))
        return to_bar_rad - clamp(to_bar_rad, max(widest_rad, 0.0))
