"""References of near flight, and what the mode function is told: the landing condition, the distance, the error.

References are points and headings in `bar`. They are no part of a filter's state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shipland.frames import Array
from shipland.guidance.modes import ModeMemory, Situation, may_retry, overruled
from shipland.guidance.near import NearEstimate
from shipland.guidance.parameters import ApproachParameters
from shipland.guidance.response import clamp
from shipland.guidance.view import View
from shipland.messages import Box, Mode, Observation, PilotCommand, Telemetry
from shipland.rig import Rig

if TYPE_CHECKING:
    from shipland.guidance.far import FarTables


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


@dataclass(frozen=True)
class PositionEstimate:
    """The pilot's estimate of its position.

    Attributes:
        estimate: errors to the present reference; None before the first picture and after a change of reference.
        aircraft_in_bar_m: (3,) the newest place, whatever the reference; None before the first picture.
    """

    estimate: NearEstimate | None = None
    aircraft_in_bar_m: Array | None = None

    def age_s(self, now_s: float) -> float:
        """Age of the newest picture in the estimate [s]."""
        return math.inf if self.estimate is None else now_s - self.estimate.t_s


def without_large_boxes(observation: Observation, tables: FarTables, largest: float) -> Observation:
    """The observation without boxes of more than `largest` times the setpoint's area: too near for the far laws."""

    def kept(box: Box | None, setpoint_px2: float) -> Box | None:
        return None if box is not None and box.area_px2 > largest * setpoint_px2 else box

    ship = kept(observation.ship_box, tables.ship.pitch.setpoint)
    bar = kept(observation.bar_box, tables.bar.pitch.setpoint)
    if ship is observation.ship_box and bar is observation.bar_box:
        return observation
    reason = "; ".join(text for text in (observation.reason, "too near for the far laws") if text)
    return replace(observation, ship_box=ship, bar_box=bar, reason=reason)


def situation_of(
    observation: Observation,
    telemetry: Telemetry,
    position: PositionEstimate,
    memory: ModeMemory,
    references: References,
    approach: ApproachParameters,
    sent: PilotCommand | None,
) -> Situation:
    """The situation of one cycle."""
    place_m, climbing_s = position.aircraft_in_bar_m, telemetry.t_s - memory.since_s
    clear = place_m is not None and references.is_clear(place_m)
    return Situation(
        now_s=telemetry.t_s,
        observation=observation,
        landing_condition=landing_condition(position.estimate, telemetry.t_s, references, approach),
        committed=place_m is not None and references.height_m(place_m) < approach.commit_height_m,
        abort_reason=_abort_reason(position.estimate, approach) if memory.mode is Mode.LAND else "",
        near_ship=place_m is not None and float(np.linalg.norm(place_m)) < approach.go_around_radius_m,
        clear=may_retry(climbing_s, clear, approach),
        flying=telemetry.flying,
        overruled=overruled(sent, memory.mode),
        at_once=approach.at_once,
    )


def landing_condition(
    estimate: NearEstimate | None, now_s: float, references: References, approach: ApproachParameters
) -> str:
    """Why a landing must not begin; empty when it may."""
    if estimate is None:
        return "no pose yet"
    if now_s - estimate.t_s > approach.max_data_age_s:
        return f"data {now_s - estimate.t_s:.1f} s old"
    forward_m, right_m, up_m = estimate.error_in_level_m
    if max(abs(forward_m), abs(right_m)) > references.landing_half_m:
        return f"{forward_m:+.2f} m forward, {right_m:+.2f} m right of the hover point"
    if approach.at_once:
        return ""
    if abs(up_m) > approach.max_height_error_m:
        return f"{up_m:+.2f} m to the hover height"
    if float(np.linalg.norm(estimate.rate_in_level_mps)) > approach.max_speed_mps:
        return "not steady"
    if abs(math.degrees(estimate.yaw_rad)) > approach.max_yaw_error_deg:
        return f"heading off by {math.degrees(estimate.yaw_rad):.0f}°"
    return ""


def _abort_reason(estimate: NearEstimate | None, approach: ApproachParameters) -> str:
    if estimate is None or approach.at_once:
        return ""
    off_m = float(np.max(np.abs(estimate.error_in_level_m[:2])))
    return f"{off_m:.2f} m off the landing point while landing" if off_m > approach.abort_offset_m else ""
