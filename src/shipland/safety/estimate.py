"""The safety's own estimate: plain, from observation and telemetry alone, the same in every mode and over every pilot.

Near, the newest pose, or sight of the deck, carried on from its exposure by the velocity against the bar. Far, range
from the area of the box and direction from its centre, carried on by the vehicle's own velocity. Heights over take-off
from the barometer, over the deck from the pose, and by the barometer afterwards.

The velocity against the bar is the slope of the poses of the last second, brought up to date by what the vehicle's own
velocity changed since. The two differ by the ship's way and by what the vehicle's velocity errs (`velocity_bias_mps`);
a difference that leaps is a sensor that lies or a ship that manoeuvres.
"""

from __future__ import annotations

import bisect
import math
import operator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipland.camera import Camera
from shipland.frames import GRAVITY_MPS2, Array, all_finite, rotated, rotation_from_euler, turned, wrap_angle
from shipland.guidance.view import View
from shipland.messages import BarPose, Box, DeckSight, Observation, Telemetry
from shipland.rig import Rig

Vector = tuple[float, float]

_DECK_SHARE = 0.02
"""Share of a new difference in the deck's height over the take-off point: about two seconds at 30 Hz."""
_LONGEST_STEP_S = 1.0
_KEPT_S = 4.0
"""Of the way travelled: the oldest picture that is flown on, and the window of its slope before that."""
_WINDOW_S, _SHORTEST_WINDOW_S = 1.0, 0.4
"""In which the poses' slope is taken; a shorter one says nothing at 15 m."""
_REFERENCE_TIME_S = 8.0
"""Of the slow velocity reference: about two periods of the waves at the rig's scale."""
_TILT_TIME_S = 2.0
"""Of the mean tilt: gusts pass, the wind stays."""
_WIND_TIME_S, _SLOW_MPS = 10.0, 2.0
"""Of the wind: several gusts long. Faster than this the drag of the aircraft's own way counts."""
_LARGEST_TIME_S = 1.0
"""Of the largest tilt: telemetry of 5 Hz sees a swing of 0.4 s now and then only."""
_LEAP_M, _LEAP_SHARE, _LEAP_MPS = 1.0, 0.05, 1.0
"""A pose may lie so far from where those before lead to, more by a share of its range and by the time between."""
_PATIENCE_S, _REMEMBERED_S = 4.0, 2.0
"""Poses that contradict those before are believed after so long; after so long without any, the next one is."""
_CONTRADICTED_S = 2.0
"""Contradictions of bar and gimbal are remembered for so long."""
_LEAST_BOX_PX = 1e-3
"""A smaller box tells no range that a float holds."""
_STEEPEST_RAD = 1.2
"""A steeper tilt is none that is flown."""


@dataclass(frozen=True)
class Instant:
    """Where the vehicle's own velocity had brought it, in axes that lie still.

    Attributes:
        t_s: of the telemetry.
        travelled_m: (north, east) since the flight's begin.
    """

    t_s: float
    travelled_m: Vector


@dataclass(frozen=True)
class Sight:
    """A pose, as far as the safety needs it.

    Attributes:
        t_s: exposure.
        place_in_bar_m: (3,) the aircraft's centre of mass.
        bar_heading_rad: of the bar, as in `SafetyEstimate`.
    """

    t_s: float
    place_in_bar_m: tuple[float, float, float]
    bar_heading_rad: float


class SafetyEstimate(NamedTuple):
    """The safety's own estimate.

    Attributes:
        t_s: of the last telemetry; None before the first.
        seen_s: exposure of the newest pose or box.
        pose_s: exposure of the newest pose or sight of the deck.
        bar_box_s: exposure of the newest box of the bar that told its range.
        place_in_bar_m: (3,) the aircraft's centre of mass at `t_s`, carried on from that pose.
        yaw_rad: heading against the bar by the newest pose.
        velocity_in_bar_mps: (3,) against the bar at `t_s`; None before poses have shown it.
        velocity_bias_mps: (2,) north and east, the vehicle's own velocity less that against the bar; None where one of
            the two is not known.
        slow_velocity_bias_in_bar_mps: (2,) the same of the last `_REFERENCE_TIME_S`, in axes that turn with the bar: a
            ship that turns goes on ahead.
        bar_from_aircraft_m: (2,) horizontal way to the bar, in axes that lie still: north and east by the compass.
        heading_rad: compass, the last one known; 0 where there never was one.
        bar_heading_rad: of the bar, clockwise from the axes that lie still; None before the first pose.
        turn_rad_s: rate of `bar_heading_rad`: a ship that turns.
        velocity_mps: (2,) north and east, the vehicle's own; None where it does not say.
        tilt_mps2: (2,) north and east, the horizontal acceleration of the tilt; None where it was never told.
        mean_tilt_mps2, mean_velocity_mps: (2,) the same and `velocity_mps`, smoothed over `_TILT_TIME_S`.
        held_mps2: (2,) north and east, what holds against the wind: the mean tilt, less the mean acceleration.
        height_m, height_s: over the take-off point, and when that was measured.
        deck_height_m: of the neutral deck over the take-off point.
        deck_leap_m: newest pose's deck height less `deck_height_m`.
        sink_mps: downward speed by the vehicle itself, not negative.
        wind_mps2: (2,) `held_mps2` of the last `_WIND_TIME_S` in which the aircraft was slow against the bar.
        wind_s: how long that has been, up to `_WIND_TIME_S`.
        largest_tilt_rad: largest tilt against the vertical of about the last second.
        leap_m: by which the newest pose contradicts the way from those before; 0 for one that does not.
        leapt_s: exposure since which poses do so, and are not flown on; None while they do not.
        contradicted_s: exposures of the last `_CONTRADICTED_S` whose bar contradicts the gimbal.
        travelled: way of the last `_KEPT_S`.
        sights: poses of the last `_WINDOW_S`.
    """

    t_s: float | None = None
    seen_s: float = -math.inf
    pose_s: float = -math.inf
    bar_box_s: float = -math.inf
    place_in_bar_m: Array | None = None
    yaw_rad: float = 0.0
    velocity_in_bar_mps: Array | None = None
    velocity_bias_mps: Array | None = None
    slow_velocity_bias_in_bar_mps: Array | None = None
    bar_from_aircraft_m: Array | None = None
    heading_rad: float = 0.0
    bar_heading_rad: float | None = None
    turn_rad_s: float = 0.0
    velocity_mps: Array | None = None
    tilt_mps2: Array | None = None
    mean_tilt_mps2: Array | None = None
    mean_velocity_mps: Array | None = None
    held_mps2: Array | None = None
    height_m: float | None = None
    height_s: float = -math.inf
    deck_height_m: float | None = None
    deck_leap_m: float = 0.0
    deck_down_m: float = 0.0
    sink_mps: float = 0.0
    wind_mps2: Array | None = None
    wind_s: float = 0.0
    largest_tilt_rad: float = 0.0
    leap_m: float = 0.0
    leapt_s: float | None = None
    contradicted_s: tuple[float, ...] = ()
    travelled: tuple[Instant, ...] = ()
    sights: tuple[Sight, ...] = ()

    def place_at(self, t_s: float, stale_s: float) -> Array | None:
        """(3,) in `bar` by a pose no older than `stale_s`."""
        return self.place_in_bar_m if t_s - self.pose_s <= stale_s else None

    def velocity_at(self, t_s: float, stale_s: float) -> Array | None:
        """(3,) against the bar, by poses no older than `stale_s`."""
        return self.velocity_in_bar_mps if t_s - self.pose_s <= stale_s else None

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
        return distance_m, rotated(self.bar_from_aircraft_m, -self.heading_rad) / max(distance_m, 1e-9)

    def velocity_bias_leap_mps(self) -> float:
        """By how much the velocity reference has left what it may be; 0 where it is not known.

        It may be its slow mean, and anything less: optical flow over a deck under way tells the velocity against it.
        """
        now_mps, slow_mps = self.velocity_bias_mps, self.slow_velocity_bias_in_bar_mps
        if now_mps is None or slow_mps is None or self.bar_heading_rad is None:
            return 0.0
        now_mps = rotated(now_mps, -self.bar_heading_rad)
        share = float(now_mps @ slow_mps) / max(float(slow_mps @ slow_mps), 1e-9)
        return math.hypot(*(now_mps - min(max(share, 0.0), 1.0) * slow_mps).tolist())

    def in_level(self, in_still: Array) -> Array:
        """A vector (2,) of the axes that lie still, forward and right of the aircraft."""
        return rotated(in_still, -self.heading_rad)

    def bar_in_level_rad(self) -> float:
        """Direction of the bar's axis (forward, into the superstructure), clockwise from the nose."""
        return -self.yaw_rad if self.bar_heading_rad is None else wrap_angle(self.bar_heading_rad - self.heading_rad)

    def travelled_at(self, t_s: float) -> Vector | None:
        """(north, east) travelled at a time, between the readings; None where that is not remembered."""
        rows = self.travelled
        if not rows or t_s < rows[0].t_s:
            return None
        index = bisect.bisect_left(rows, t_s, lo=1, key=_time_of)
        if index == len(rows):
            return rows[-1].travelled_m
        before, after = rows[index - 1], rows[index]
        share = (t_s - before.t_s) / max(after.t_s - before.t_s, 1e-9)
        (n0, e0), (n1, e1) = before.travelled_m, after.travelled_m
        return n0 + share * (n1 - n0), e0 + share * (e1 - e0)


_time_of = operator.attrgetter("t_s")


class SafetyEstimator:
    """Updates the estimate; holds dimensions and intrinsics only."""

    def __init__(self, rig: Rig, camera: Camera, camera_in_body_m: Array) -> None:
        self._view = View.of(camera)
        self._deck_in_bar_m, self._deck_down_m = rig.deck_in_bar_m, float(rig.deck_in_bar_m[2])
        board_width_m, board_height_m = rig.board_size_m
        self._bar_side_m = math.sqrt(board_width_m * board_height_m)
        self._ship_side_m = math.sqrt(rig.platform_width_m * rig.superstructure_height_m)
        self._camera_in_body_m = np.asarray(camera_in_body_m, dtype=float)

    def updated(self, estimate: SafetyEstimate, observation: Observation, telemetry: Telemetry) -> SafetyEstimate:
        """After one cycle; what is None or not finite changes nothing."""
        estimate = self._with_telemetry(estimate, telemetry)
        estimate = _with_contradiction(estimate, observation)
        pose, bar, ship = observation.bar_pose, observation.bar_box, observation.ship_box
        if pose is not None and all_finite(pose.position_in_bar_m) and math.isfinite(pose.yaw_rad):
            return self._with_pose(estimate, pose, observation.t_s)
        deck = observation.deck
        if deck is not None and all_finite(deck.centre_in_level_m) and estimate.place_in_bar_m is not None:
            return self._with_deck(estimate, deck, observation.t_s)
        if bar is not None and _usable(bar):
            estimate = estimate._replace(bar_box_s=observation.t_s)
            return self._with_box(estimate, bar, self._bar_side_m, observation.t_s)
        if ship is not None and _usable(ship):
            return self._with_box(estimate, ship, self._ship_side_m, observation.t_s)
        return estimate

    def _with_telemetry(self, estimate: SafetyEstimate, telemetry: Telemetry) -> SafetyEstimate:
        now_s, heading_rad = telemetry.t_s, telemetry.heading_rad
        if heading_rad is None or not math.isfinite(heading_rad):
            heading_rad = estimate.heading_rad
        height_m, height_s = estimate.height_m, estimate.height_s
        if telemetry.height_m is not None and math.isfinite(telemetry.height_m):
            height_m = telemetry.height_m
            height_s = now_s if telemetry.height_t_s is None else telemetry.height_t_s
        step_s = 0.0 if estimate.t_s is None else min(max(now_s - estimate.t_s, 0.0), _LONGEST_STEP_S)
        velocity_mps, sink_mps, way_m = None, 0.0, estimate.bar_from_aircraft_m
        north_m, east_m = estimate.travelled[-1].travelled_m if estimate.travelled else (0.0, 0.0)
        told_mps = telemetry.velocity_in_level_mps
        if told_mps is not None and all_finite(told_mps):
            velocity_mps = rotated(told_mps[:2], heading_rad)
            sink_mps = max(0.0, float(told_mps[2]))
            north_m, east_m = north_m + step_s * float(velocity_mps[0]), east_m + step_s * float(velocity_mps[1])
            if way_m is not None:
                way_m = way_m - step_s * velocity_mps
        rows = estimate.travelled
        first = next((index for index, row in enumerate(rows) if now_s - row.t_s <= _KEPT_S), len(rows))
        travelled = (*rows[first:], Instant(now_s, (north_m, east_m)))
        tilt_mps2 = _tilt_mps2(estimate.tilt_mps2, telemetry, heading_rad)
        mean_tilt_mps2 = _smoothed(estimate.mean_tilt_mps2, tilt_mps2, step_s)
        mean_velocity_mps = _smoothed(estimate.mean_velocity_mps, velocity_mps, step_s)
        estimate = estimate._replace(
            t_s=now_s,
            heading_rad=heading_rad,
            velocity_mps=velocity_mps,
            tilt_mps2=tilt_mps2,
            mean_tilt_mps2=mean_tilt_mps2,
            mean_velocity_mps=mean_velocity_mps,
            held_mps2=_held_mps2(mean_tilt_mps2, velocity_mps, mean_velocity_mps),
            height_m=height_m,
            height_s=height_s,
            bar_from_aircraft_m=way_m,
            deck_down_m=self._deck_down_m,
            sink_mps=sink_mps,
            largest_tilt_rad=max(tilt_of(tilt_mps2), estimate.largest_tilt_rad * math.exp(-step_s / _LARGEST_TIME_S)),
            travelled=travelled,
        )
        return _carried(_with_wind(_with_velocity(estimate), step_s))

    def _with_pose(self, estimate: SafetyEstimate, pose: BarPose, exposure_s: float) -> SafetyEstimate:
        bar_from_level = rotation_from_euler(0.0, 0.0, pose.yaw_rad)
        place_m = pose.position_in_bar_m - bar_from_level @ self._camera_in_body_m
        deck_height_m, leap_m, height_m = estimate.deck_height_m, 0.0, estimate.height_m
        if height_m is not None:
            seen_m = height_m - (self._deck_down_m - float(place_m[2]))
            deck_height_m = seen_m if deck_height_m is None else deck_height_m
            leap_m = seen_m - deck_height_m
            deck_height_m += _DECK_SHARE * leap_m
        estimate = estimate._replace(
            yaw_rad=pose.yaw_rad,
            bar_heading_rad=wrap_angle(estimate.heading_rad - pose.yaw_rad),
            bar_from_aircraft_m=rotated(-place_m[:2], estimate.heading_rad - pose.yaw_rad),
            deck_height_m=deck_height_m,
            deck_leap_m=leap_m,
        )
        return _sighted(estimate, place_m, exposure_s)

    def _with_deck(self, estimate: SafetyEstimate, deck: DeckSight, exposure_s: float) -> SafetyEstimate:
        """Over the deck where it is now, not where it would lie at rest: that is what must not be struck."""
        bar_from_level = rotation_from_euler(0.0, 0.0, estimate.yaw_rad)
        place_m = self._deck_in_bar_m - bar_from_level @ (self._camera_in_body_m + deck.centre_in_level_m)
        return estimate._replace(seen_s=exposure_s, pose_s=exposure_s, place_in_bar_m=place_m)

    def _with_box(self, estimate: SafetyEstimate, box: Box, side_m: float, exposure_s: float) -> SafetyEstimate:
        range_m = self._view.range_m(box.area_px2, side_m)
        direction_rad = estimate.heading_rad + self._view.bearing_rad(box.centre_px[0])
        way_m = range_m * np.array([math.cos(direction_rad), math.sin(direction_rad)])
        return estimate._replace(seen_s=exposure_s, bar_from_aircraft_m=way_m)


def _with_contradiction(estimate: SafetyEstimate, observation: Observation) -> SafetyEstimate:
    kept = estimate.contradicted_s
    if observation.gimbal_off_rad > 0.0:
        kept = (*kept, observation.t_s)
    if not kept:
        return estimate
    since_s = observation.t_s - _CONTRADICTED_S
    return estimate._replace(contradicted_s=tuple(t_s for t_s in kept if since_s < t_s <= observation.t_s))


def _tilt_mps2(before: Array | None, telemetry: Telemetry, heading_rad: float) -> Array | None:
    """(2,) north and east, the acceleration of the tilt: g·tan; `before` where none was told."""
    roll_rad, pitch_rad = telemetry.roll_rad, telemetry.pitch_rad
    if roll_rad is None or pitch_rad is None or not max(abs(roll_rad), abs(pitch_rad)) < _STEEPEST_RAD:
        return before
    return GRAVITY_MPS2 * rotated(np.array([-math.tan(pitch_rad), math.tan(roll_rad)]), heading_rad)


def _smoothed(before: Array | None, now: Array | None, step_s: float) -> Array | None:
    if before is None or now is None:
        return now
    return before + min(step_s / _TILT_TIME_S, 1.0) * (now - before)


def _held_mps2(tilt_mps2: Array | None, velocity_mps: Array | None, mean_mps: Array | None) -> Array | None:
    """(2,) the mean tilt less the mean acceleration, which is what a smoothed velocity lags by."""
    if tilt_mps2 is None or mean_mps is None or velocity_mps is None:
        return tilt_mps2
    return np.asarray(tilt_mps2 - (velocity_mps - mean_mps) / _TILT_TIME_S)


def _with_wind(estimate: SafetyEstimate, step_s: float) -> SafetyEstimate:
    """The wind, from what holds against it; fast against the bar, it holds against the aircraft's own way as well."""
    held_mps2, velocity_mps, wind_mps2 = estimate.held_mps2, estimate.velocity_in_bar_mps, estimate.wind_mps2
    if held_mps2 is None or velocity_mps is None or step_s <= 0.0:
        return estimate
    if math.hypot(float(velocity_mps[0]), float(velocity_mps[1])) > _SLOW_MPS:
        return estimate
    wind_s = min(estimate.wind_s + step_s, _WIND_TIME_S)
    wind_mps2 = held_mps2 if wind_mps2 is None else wind_mps2 + step_s / wind_s * (held_mps2 - wind_mps2)
    return estimate._replace(wind_mps2=wind_mps2, wind_s=wind_s)


def tilt_of(tilt_mps2: Array | None) -> float:
    """Tilt against the vertical [rad], by its horizontal acceleration (2,) [m/s²]: atan(a/g); 0 for None."""
    return 0.0 if tilt_mps2 is None else math.atan(math.hypot(*tilt_mps2.tolist()) / GRAVITY_MPS2)


def _sighted(estimate: SafetyEstimate, place_m: Array, exposure_s: float) -> SafetyEstimate:
    """After a pose: its slope over the last second, and the place carried on to now.

    A pose that lies where no way leads from those before is not flown on; those that go on saying so for `_PATIENCE_S`
    are, as a track of its own.
    """
    x_m, y_m, z_m = place_m.tolist()
    leap_m, sights = _leap_m(estimate, place_m, exposure_s), estimate.sights
    if leap_m > 0.0:
        leapt_s = exposure_s if estimate.leapt_s is None else estimate.leapt_s
        if exposure_s - leapt_s < _PATIENCE_S:
            return estimate._replace(leap_m=leap_m, leapt_s=leapt_s)
        sights = ()
    kept = (row for row in sights if 0.0 < exposure_s - row.t_s <= _WINDOW_S)
    sights = (*kept, Sight(exposure_s, (x_m, y_m, z_m), estimate.bar_heading_rad or 0.0))
    estimate = estimate._replace(seen_s=exposure_s, pose_s=exposure_s, sights=sights, leap_m=0.0, leapt_s=None)
    return _carried(_with_velocity(_with_reference(estimate)))


def _leap_m(estimate: SafetyEstimate, place_m: Array, exposure_s: float) -> float:
    """How far a pose lies from where those before lead to; 0 within what poses, ways and waves may err."""
    expected_m = _place_m(estimate, exposure_s)
    if expected_m is None or not 0.0 < exposure_s - estimate.sights[-1].t_s <= _REMEMBERED_S:
        return 0.0
    leap_m = math.hypot(*(place_m - expected_m).tolist())
    distance_m = math.hypot(*place_m.tolist())
    since_s = exposure_s - estimate.sights[-1].t_s
    return leap_m if leap_m > _LEAP_M + _LEAP_SHARE * distance_m + _LEAP_MPS * since_s else 0.0


def _slope_mps(sights: tuple[Sight, ...]) -> tuple[Array, Array] | None:
    """(3,) least-squares slope of the places, and their mean; None where they are too few or too close together."""
    if len(sights) < 3 or sights[-1].t_s - sights[0].t_s < _SHORTEST_WINDOW_S:
        return None
    times = np.array([row.t_s for row in sights])
    times -= np.add.reduce(times) / len(times)
    places = np.array([row.place_in_bar_m for row in sights])
    return times @ places / float(times @ times), np.add.reduce(places) / len(places)


def _with_reference(estimate: SafetyEstimate) -> SafetyEstimate:
    """The vehicle's own mean velocity over the window less the poses' slope, and its slow mean."""
    sights = estimate.sights
    if estimate.velocity_mps is not None:  # of before its first reading nobody knows the way
        sights = tuple(row for row in sights if row.t_s >= estimate.travelled[0].t_s)
    line, heading_rad = _slope_mps(sights), estimate.bar_heading_rad
    if line is None or heading_rad is None:
        return estimate._replace(velocity_in_bar_mps=None, velocity_bias_mps=None)
    slope, middle_m = line
    first_s, last_s = sights[0].t_s, sights[-1].t_s
    begun, ended = estimate.travelled_at(first_s), estimate.travelled_at(last_s)
    if estimate.velocity_mps is None or begun is None or ended is None:
        return estimate._replace(velocity_in_bar_mps=slope, velocity_bias_mps=None)
    turn_rad_s = wrap_angle(sights[-1].bar_heading_rad - sights[0].bar_heading_rad) / (last_s - first_s)
    ahead_m, right_m, _ = middle_m.tolist()
    swept_mps = _swept(ahead_m, right_m, turn_rad_s)
    north_mps, east_mps = turned(float(slope[0]) + swept_mps[0], float(slope[1]) + swept_mps[1], heading_rad)
    own_mps = (ended[0] - begun[0]) / (last_s - first_s), (ended[1] - begun[1]) / (last_s - first_s)
    reference = np.array([own_mps[0] - north_mps, own_mps[1] - east_mps])
    slow, in_bar = estimate.slow_velocity_bias_in_bar_mps, rotated(reference, -heading_rad)
    step_s = last_s - sights[-2].t_s
    slow = in_bar if slow is None else slow + min(step_s / _REFERENCE_TIME_S, 1.0) * (in_bar - slow)
    return estimate._replace(
        velocity_in_bar_mps=slope,
        velocity_bias_mps=reference,
        slow_velocity_bias_in_bar_mps=slow,
        turn_rad_s=turn_rad_s,
    )


def _swept(ahead_m: float, right_m: float, turn_rad_s: float) -> Vector:
    """The velocity of a place that turns with the bar: ω × p."""
    return -turn_rad_s * right_m, turn_rad_s * ahead_m


def _with_velocity(estimate: SafetyEstimate) -> SafetyEstimate:
    """The velocity against the bar, brought up to date by the vehicle's own."""
    before, reference, heading_rad = estimate.velocity_in_bar_mps, estimate.velocity_bias_mps, estimate.bar_heading_rad
    if before is None or reference is None or heading_rad is None or estimate.velocity_mps is None:
        return estimate
    ahead_mps, right_mps = rotated(estimate.velocity_mps - reference, -heading_rad).tolist()
    if estimate.place_in_bar_m is not None:
        ahead_m, right_m, _ = estimate.place_in_bar_m.tolist()
        swept_mps = _swept(ahead_m, right_m, estimate.turn_rad_s)
        ahead_mps, right_mps = ahead_mps - swept_mps[0], right_mps - swept_mps[1]
    return estimate._replace(velocity_in_bar_mps=np.array([ahead_mps, right_mps, float(before[2])]))


def _carried(estimate: SafetyEstimate) -> SafetyEstimate:
    """The place carried on from the newest pose to the newest telemetry."""
    if estimate.t_s is None or not estimate.sights or estimate.pose_s > estimate.sights[-1].t_s:
        return estimate  # none yet, or the deck itself was seen since
    place_m = _place_m(estimate, max(estimate.t_s, estimate.sights[-1].t_s))
    return estimate if place_m is None else estimate._replace(place_in_bar_m=place_m)


def _place_m(estimate: SafetyEstimate, t_s: float) -> Array | None:
    """(3,) in `bar`, from the newest pose carried on to a time; None before the first."""
    if not estimate.sights:
        return None
    last, velocity = estimate.sights[-1], estimate.velocity_in_bar_mps
    ahead_m, right_m, down_m = last.place_in_bar_m
    if velocity is None:
        return np.array(last.place_in_bar_m)
    age_s = min(max(t_s - last.t_s, 0.0), _KEPT_S)
    moved_m = [age_s * speed_mps for speed_mps in velocity.tolist()]
    reference, heading_rad = estimate.velocity_bias_mps, estimate.bar_heading_rad
    begun, ended = estimate.travelled_at(last.t_s), estimate.travelled_at(t_s)
    if reference is not None and heading_rad is not None and begun is not None and ended is not None:
        north_mps, east_mps = reference.tolist()
        north_m, east_m = ended[0] - begun[0] - age_s * north_mps, ended[1] - begun[1] - age_s * east_mps
        swept_mps = _swept(ahead_m, right_m, estimate.turn_rad_s)
        level_m = turned(north_m, east_m, -heading_rad)
        moved_m[:2] = level_m[0] - age_s * swept_mps[0], level_m[1] - age_s * swept_mps[1]
    return np.array([ahead_m + moved_m[0], right_m + moved_m[1], down_m + moved_m[2]])


def _usable(box: Box) -> bool:
    return all(map(math.isfinite, (*box.centre_px, *box.size_px))) and min(box.size_px) > _LEAST_BOX_PX
