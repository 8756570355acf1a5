"""The safety's own estimate: plain, from observation and telemetry alone, the same in every mode and over every pilot.

Near, the newest pose, or sight of the deck, carried on from its exposure by the velocity against the bar. Far, range
from the area of the box and direction from its centre, carried on by the vehicle's own velocity. Heights over take-off
from the barometer, over the deck from the pose, and by the barometer afterwards.

The velocity against the bar is the slope of the poses of the last second, brought up to date by what the vehicle's own
velocity changed since. The two differ by the ship's way and by what the vehicle's velocity errs
(`velocity_bias_in_bar_mps`); a difference that leaps is a sensor that lies or a ship that manoeuvres.

What evolves is a record of floats and the rows of what is remembered; a compiled function a source of news changes it.
What is not known is NaN there, and None in the `SafetyEstimate` that is read from it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from shipland.camera import Camera
from shipland.compiled import compiled
from shipland.frames import GRAVITY_MPS2, Array, all_finite, turned, wrap_angle
from shipland.guidance.view import View
from shipland.messages import Box, Observation, Telemetry
from shipland.rig import Rig
from shipland.safety.cue_checks import WayScale

Vector = tuple[float, float]
Place = tuple[float, float, float]
Record: TypeAlias = Any
"""One record of `_TYPE`."""
Records: TypeAlias = Any
"""(1,) array of them, as Python hands it to compiled code."""

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
_REMEMBERED_S = 2.0
"""Poses that contradict those before are believed after so long."""
_CONTRADICTED_S = 2.0
"""Contradictions of bar and gimbal are remembered for so long."""
_LEAST_BOX_PX = 1e-3
"""A smaller box tells no range that a float holds."""
POSED_S, _POSED_WITHIN_DECKS = 15.0, 10.0
"""So long after a pose the distance to the bar is known, on a ship under way too; within so many sizes of the deck no
box makes it larger then."""
_STEEPEST_RAD = 1.2
"""A steeper tilt is none that is flown."""
_ROWS = 4096
"""Of the way travelled, at most."""


class SafetyEstimate(NamedTuple):
    """The safety's own estimate.

    Attributes:
        t_s: of the last telemetry; None before the first.
        seen_s: exposure of the newest pose or box.
        pose_s: exposure of the newest pose or sight of the deck.
        bar_box_s: exposure of the newest box of the bar that told its range.
        place_in_bar_m: the aircraft's centre of mass at `t_s`, carried on from that pose.
        yaw_rad: heading against the bar by the newest pose.
        velocity_in_bar_mps: against the bar at `t_s`; None before poses have shown it.
        velocity_bias_in_bar_mps: the vehicle's own velocity less that against the bar, in axes that turn with the bar:
            a ship that turns goes on ahead. None where one of the two is not known.
        slow_velocity_bias_in_bar_mps: the same of the last `_REFERENCE_TIME_S`.
        bar_from_aircraft_m: horizontal way to the bar, in axes that lie still: north and east by the compass.
        heading_rad: compass, the last one known; 0 where there never was one.
        bar_heading_rad: of the bar, clockwise from the axes that lie still; None before the first pose.
        turn_rad_s: rate of `bar_heading_rad`: a ship that turns.
        velocity_mps: north and east, the vehicle's own; None where it does not say.
        tilt_mps2: north and east, the horizontal acceleration of the tilt; None where it was never told.
        mean_tilt_mps2, mean_velocity_mps: the same and `velocity_mps`, smoothed over `_TILT_TIME_S`.
        held_mps2: north and east, what holds against the wind: the mean tilt, less the mean acceleration.
        height_m, height_s: over the take-off point, and when that was measured.
        deck_height_m: of the neutral deck over the take-off point.
        deck_leap_m: newest pose's deck height less `deck_height_m`.
        sink_mps: downward speed by the vehicle itself, not negative.
        wind_mps2: `held_mps2` of the last `_WIND_TIME_S` in which the aircraft was slow against the bar.
        wind_s: how long that has been, up to `_WIND_TIME_S`.
        largest_tilt_rad: largest tilt against the vertical of about the last second.
        leap_m: by which the newest pose contradicts the way from those before; 0 for one that does not.
        deck_down_m: of the neutral deck below the bar.
        waved_off_s: when a picture was last flown on in which the ship's status light is red, however late it came.
        scale: distances by poses over those of the vehicle's own way; 1 where that is not judged.
        scale_sigma: its standard deviation; infinite where it is not judged.
        contradicted_s: exposures of the last `_CONTRADICTED_S` whose bar contradicts the gimbal.
    """

    t_s: float | None = None
    seen_s: float = -math.inf
    pose_s: float = -math.inf
    bar_box_s: float = -math.inf
    place_in_bar_m: Place | None = None
    yaw_rad: float = 0.0
    velocity_in_bar_mps: Place | None = None
    velocity_bias_in_bar_mps: Vector | None = None
    slow_velocity_bias_in_bar_mps: Vector | None = None
    bar_from_aircraft_m: Vector | None = None
    heading_rad: float = 0.0
    bar_heading_rad: float | None = None
    turn_rad_s: float = 0.0
    velocity_mps: Vector | None = None
    tilt_mps2: Vector | None = None
    mean_tilt_mps2: Vector | None = None
    mean_velocity_mps: Vector | None = None
    held_mps2: Vector | None = None
    height_m: float | None = None
    height_s: float = -math.inf
    deck_height_m: float | None = None
    deck_leap_m: float = 0.0
    sink_mps: float = 0.0
    wind_mps2: Vector | None = None
    wind_s: float = 0.0
    largest_tilt_rad: float = 0.0
    leap_m: float = 0.0
    deck_down_m: float = 0.0
    waved_off_s: float = -math.inf
    scale: float = 1.0
    scale_sigma: float = math.inf
    contradicted_s: tuple[float, ...] = ()

    def place_at(self, t_s: float, stale_s: float) -> Place | None:
        """In `bar` by a pose no older than `stale_s`."""
        return self.place_in_bar_m if t_s - self.pose_s <= stale_s else None

    def velocity_at(self, t_s: float, stale_s: float) -> Place | None:
        """Against the bar, by poses no older than `stale_s`."""
        return self.velocity_in_bar_mps if t_s - self.pose_s <= stale_s else None

    def height_at(self, t_s: float, stale_s: float) -> float | None:
        """Over the take-off point, by a barometer no older than `stale_s`."""
        return self.height_m if t_s - self.height_s <= stale_s else None

    def over_deck_at(self, t_s: float, stale_s: float) -> float | None:
        """Over the neutral deck: by a recent pose, else by the barometer once a pose has shown the deck's height."""
        place_m, height_m = self.place_at(t_s, stale_s), self.height_at(t_s, stale_s)
        if place_m is not None:
            return self.deck_down_m - place_m[2]
        if height_m is not None and self.deck_height_m is not None:
            return height_m - self.deck_height_m
        return None

    def bar_distance_m(self) -> float:
        """Horizontal distance to the bar; NaN where unknown."""
        return math.nan if self.bar_from_aircraft_m is None else math.hypot(*self.bar_from_aircraft_m)

    def bar_in_level(self) -> Vector:
        """The unit vector to the bar, forward and right; zero where unknown."""
        ahead_m, right_m = self.in_level(self.bar_from_aircraft_m or (0.0, 0.0))
        distance_m = max(self.bar_distance_m(), 1e-9)
        return ahead_m / distance_m, right_m / distance_m

    def velocity_bias_leap_mps(self) -> float:
        """By how much the velocity reference has left what it may be; 0 where it is not known.

        It may be its slow mean, and anything less: optical flow over a deck under way tells the velocity against it.
        """
        bias_mps, slow_mps = self.velocity_bias_in_bar_mps, self.slow_velocity_bias_in_bar_mps
        if bias_mps is None or slow_mps is None:
            return 0.0
        (ahead, right), (slow_ahead, slow_right) = bias_mps, slow_mps
        share = (ahead * slow_ahead + right * slow_right) / max(slow_ahead**2 + slow_right**2, 1e-9)
        share = min(max(share, 0.0), 1.0)
        return math.hypot(ahead - share * slow_ahead, right - share * slow_right)

    def in_level(self, in_still: Vector) -> Vector:
        """A vector of the axes that lie still, forward and right of the aircraft."""
        return turned(*in_still, -self.heading_rad)

    def bar_in_level_rad(self) -> float:
        """Direction of the bar's axis (forward, into the superstructure), clockwise from the nose."""
        return -self.yaw_rad if self.bar_heading_rad is None else wrap_angle(self.bar_heading_rad - self.heading_rad)


_VECTORS = {
    **dict.fromkeys(("place_in_bar_m", "velocity_in_bar_mps"), 3),
    **dict.fromkeys(("velocity_bias_in_bar_mps", "slow_velocity_bias_in_bar_mps", "bar_from_aircraft_m"), 2),
    **dict.fromkeys(("velocity_mps", "tilt_mps2", "mean_tilt_mps2", "mean_velocity_mps", "held_mps2", "wind_mps2"), 2),
}
_FIELDS = {name: value for name, value in SafetyEstimate._field_defaults.items() if name != "contradicted_s"}
_OWN = ("ways", "sights")
"""Of the record alone: how many rows are remembered of the way travelled, and of the poses."""
_TYPE = np.dtype(
    (np.record, [(it, float, (_VECTORS[it],)) if it in _VECTORS else (it, float) for it in (*_FIELDS, *_OWN)])
)


class SafetyEstimator:
    """Keeps the estimate of one flight.

    Args:
        rig: dimensions, for the deck's place and ranges from boxes.
        camera: intrinsics.
        camera_in_body_m: (3,) the camera's optical centre.
    """

    def __init__(self, rig: Rig, camera: Camera, camera_in_body_m: Array) -> None:
        self._view = View.of(camera)
        self._deck_in_bar_m: Array = np.array(rig.deck_in_bar_m, dtype=float)
        board_width_m, board_height_m = rig.board_size_m
        self._bar_side_m = math.sqrt(board_width_m * board_height_m)
        self._ship_side_m = math.sqrt(rig.platform_width_m * rig.superstructure_height_m)
        self._camera_in_body_m: Array = np.array(camera_in_body_m, dtype=float)
        self._records: Records = np.zeros(1, _TYPE)
        self._values: Array = self._records.view(float)
        for name, value in _FIELDS.items():
            self._records[name] = math.nan if value is None else value
        self._records["deck_down_m"] = self._deck_in_bar_m[2]
        self._ways, self._sights = np.zeros((_ROWS, 3)), np.zeros((_ROWS, 5))
        """Rows of time, north, east by the vehicle's own velocity; and of exposure, place in the bar, its heading."""
        self._contradicted_s: tuple[float, ...] = ()
        self._way_scale = WayScale(rig.deck_size_m)
        self._posed_within_m = _POSED_WITHIN_DECKS * rig.deck_size_m

    def updated(self, observation: Observation, telemetry: Telemetry) -> SafetyEstimate:
        """The estimate after a cycle; what is None or not finite changes nothing."""
        records, t_s = self._records, observation.t_s
        self._contradicted_s = _with_contradiction(self._contradicted_s, observation)
        told_mps, height_s = telemetry.velocity_in_level_mps, telemetry.height_t_s
        times_s = telemetry.t_s, telemetry.t_s if height_s is None else height_s
        values = (telemetry.heading_rad, telemetry.height_m, telemetry.roll_rad, telemetry.pitch_rad)
        velocity_mps = _UNTOLD if told_mps is None else told_mps.tolist()
        told = (*[math.nan if it is None else it for it in values], *velocity_mps)
        _take_telemetry(records, self._ways, self._sights, times_s, told)
        if observation.waves_off:
            records["waved_off_s"] = telemetry.t_s
        pose, deck, bar, ship = observation.nose_pose, observation.deck, observation.bar_box, observation.ship_box
        seen = () if pose is None else (*pose.position_in_bar_m.tolist(), pose.yaw_rad)
        if not math.isfinite(told[0] + sum(velocity_mps)):
            self._way_scale.interrupt()
        if pose is not None and all(map(math.isfinite, seen)):
            _take_pose(records, self._ways, self._sights, t_s, seen, self._camera_in_body_m)
            if records["leap_m"][0] == 0.0:
                place_m, bar_heading_rad, way_m = _newest(records, self._ways, self._sights)
                self._way_scale.take(t_s, -place_m, bar_heading_rad, way_m, float(pose.covariance[0, 0]))
        elif deck is not None and all_finite(deck.centre_in_level_m) and not np.isnan(records["place_in_bar_m"][0, 0]):
            _take_deck(
                records, t_s, tuple(deck.centre_in_level_m.tolist()), self._camera_in_body_m, self._deck_in_bar_m
            )
        elif bar is not None and _usable(bar):
            records["bar_box_s"] = t_s
            self._take_box(bar, self._bar_side_m, observation)
        elif ship is not None and _usable(ship):
            self._take_box(ship, self._ship_side_m, observation)
        records["scale"], records["scale_sigma"] = self._way_scale.scale, self._way_scale.sigma
        return self._read()

    def _take_box(self, box: Box, side_m: float, observation: Observation) -> None:
        range_m, heading_rad = self._view.range_m(box.area_px2, side_m), float(self._records["heading_rad"][0])
        direction_rad = heading_rad + self._view.bearing_rad(box.centre_px[0], observation.gimbal.yaw_rad)
        self._records["seen_s"] = observation.t_s
        known_m = math.hypot(*self._records["bar_from_aircraft_m"][0].tolist())
        posed = observation.t_s - float(self._records["pose_s"][0]) < POSED_S
        if posed and known_m < min(range_m, self._posed_within_m):
            return  # something else, which only looks like it: near by its poses, the bar is near
        self._records["bar_from_aircraft_m"] = range_m * math.cos(direction_rad), range_m * math.sin(direction_rad)

    def _read(self) -> SafetyEstimate:
        """The record as it is now."""
        values = self._values.tolist()
        known: list[Any] = [
            None if (value := values[first]) != value else value if width == 1 else tuple(values[first : first + width])
            for first, width in _PLACES
        ]
        return SafetyEstimate._make((*known, self._contradicted_s))


_WIDTHS = [_VECTORS.get(name, 1) for name in _FIELDS]
_PLACES = [(sum(_WIDTHS[:index]), width) for index, width in enumerate(_WIDTHS)]
"""Where the fields of the record that are read lie among its floats, and how many each has."""
_UNTOLD = (math.nan,) * 3


def _with_contradiction(kept_s: tuple[float, ...], observation: Observation) -> tuple[float, ...]:
    if observation.gimbal_off_rad > 0.0:
        kept_s = (*kept_s, observation.t_s)
    since_s = observation.t_s - _CONTRADICTED_S
    return tuple(t_s for t_s in kept_s if since_s < t_s <= observation.t_s) if kept_s else kept_s


def tilt_of(tilt_mps2: Vector | None) -> float:
    """Tilt against the vertical [rad], by its horizontal acceleration [m/s²]: atan(a/g); 0 for None."""
    return 0.0 if tilt_mps2 is None else math.atan(math.hypot(*tilt_mps2) / GRAVITY_MPS2)


_turned, _wrap = compiled(turned), compiled(wrap_angle)


@compiled
def _take_telemetry(
    records: Records,
    ways: Array,
    sights: Array,
    times_s: Vector,
    told: tuple[float, float, float, float, float, float, float],
) -> None:
    """Of a cycle's telemetry; NaN for what it does not tell.

    Args:
        records: the estimate's.
        ways: rows of the way travelled.
        sights: rows of the poses.
        times_s: of receipt, and of the height.
        told: heading, height, roll, pitch, velocity forward, right and down.
    """
    s, (now_s, height_s) = records[0], times_s
    heading_rad, height_m, roll_rad, pitch_rad, ahead_mps, right_mps, down_mps = told
    if math.isfinite(heading_rad):
        s.heading_rad = heading_rad
    if math.isfinite(height_m):
        s.height_m, s.height_s = height_m, height_s
    step_s = 0.0 if math.isnan(s.t_s) else min(max(now_s - s.t_s, 0.0), _LONGEST_STEP_S)
    s.t_s, s.sink_mps = now_s, 0.0
    s.velocity_mps[:] = math.nan
    last = int(s.ways) - 1
    north_m, east_m = (ways[last, 1], ways[last, 2]) if last >= 0 else (0.0, 0.0)
    if math.isfinite(ahead_mps) and math.isfinite(right_mps) and math.isfinite(down_mps):
        north_mps, east_mps = _turned(ahead_mps, right_mps, s.heading_rad)
        s.velocity_mps[0], s.velocity_mps[1], s.sink_mps = north_mps, east_mps, max(0.0, down_mps)
        north_m, east_m = north_m + step_s * north_mps, east_m + step_s * east_mps
        s.bar_from_aircraft_m[0] -= step_s * north_mps
        s.bar_from_aircraft_m[1] -= step_s * east_mps
    first = 0
    while first <= last and (now_s - ways[first, 0] > _KEPT_S or last - first + 2 > _ROWS):
        first += 1
    for row in range(last + 1 - first):
        for column in range(3):
            ways[row, column] = ways[first + row, column]
    newest = ways[last + 1 - first]
    newest[0], newest[1], newest[2] = now_s, north_m, east_m
    s.ways = last + 2 - first
    if max(abs(roll_rad), abs(pitch_rad)) < _STEEPEST_RAD and not math.isnan(roll_rad + pitch_rad):
        north, east = _turned(-math.tan(pitch_rad), math.tan(roll_rad), s.heading_rad)
        s.tilt_mps2[0], s.tilt_mps2[1] = GRAVITY_MPS2 * north, GRAVITY_MPS2 * east
        _smooth(s.mean_tilt_mps2, s.tilt_mps2, step_s)
    _smooth(s.mean_velocity_mps, s.velocity_mps, step_s)
    for i in range(2):  # the mean tilt less the mean acceleration, which is what a smoothed velocity lags by
        lag_mps = s.velocity_mps[i] - s.mean_velocity_mps[i]
        s.held_mps2[i] = s.mean_tilt_mps2[i] - (0.0 if math.isnan(lag_mps) else lag_mps / _TILT_TIME_S)
    tilt_mps2 = 0.0 if math.isnan(s.tilt_mps2[0]) else math.hypot(s.tilt_mps2[0], s.tilt_mps2[1])
    faded_rad = s.largest_tilt_rad * math.exp(-step_s / _LARGEST_TIME_S)
    s.largest_tilt_rad = max(math.atan(tilt_mps2 / GRAVITY_MPS2), faded_rad)
    _update_velocity(s)
    _update_wind(s, step_s)
    _carry(s, ways, sights)


@compiled
def _smooth(mean: Array, now: Array, step_s: float) -> None:
    """Move a mean (2,) towards what is so now; where one of the two is not known, to it."""
    share = 1.0 if math.isnan(mean[0]) else min(step_s / _TILT_TIME_S, 1.0)
    for i in range(2):
        mean[i] = now[i] if share == 1.0 or math.isnan(now[0]) else mean[i] + share * (now[i] - mean[i])


@compiled
def _update_wind(s: Record, step_s: float) -> None:
    """The wind, from what holds against it; fast against the bar, it holds against the aircraft's own way as well."""
    speed_mps = math.hypot(s.velocity_in_bar_mps[0], s.velocity_in_bar_mps[1])
    if math.isnan(s.held_mps2[0]) or not speed_mps <= _SLOW_MPS or step_s <= 0.0:
        return
    s.wind_s = min(s.wind_s + step_s, _WIND_TIME_S)
    for i in range(2):
        if math.isnan(s.wind_mps2[i]):
            s.wind_mps2[i] = s.held_mps2[i]
        else:
            s.wind_mps2[i] += step_s / s.wind_s * (s.held_mps2[i] - s.wind_mps2[i])


@compiled
def _take_pose(
    records: Records,
    ways: Array,
    sights: Array,
    exposure_s: float,
    seen: tuple[float, float, float, float],
    camera_in_body_m: Array,
) -> None:
    """A pose, of the camera's place and yaw: its slope over the last second, and the place carried on to now.

    A pose that lies where no way leads from those before is not flown on; those that go on saying so for
    `_REMEMBERED_S` are, as a track of its own.
    """
    s, (ahead_m, right_m, down_m, yaw_rad) = records[0], seen
    lever_m = _turned(camera_in_body_m[0], camera_in_body_m[1], yaw_rad)
    ahead_m, right_m, down_m = ahead_m - lever_m[0], right_m - lever_m[1], down_m - camera_in_body_m[2]
    s.leap_m = _leap_m(s, ways, sights, exposure_s, (ahead_m, right_m, down_m))
    if s.leap_m > 0.0:
        return
    s.deck_leap_m = 0.0
    if not math.isnan(s.height_m):
        seen_m = s.height_m - (s.deck_down_m - down_m)
        if math.isnan(s.deck_height_m):
            s.deck_height_m = seen_m
        s.deck_leap_m = seen_m - s.deck_height_m
        s.deck_height_m += _DECK_SHARE * s.deck_leap_m
    s.yaw_rad, s.bar_heading_rad = yaw_rad, _wrap(s.heading_rad - yaw_rad)
    north_m, east_m = _turned(-ahead_m, -right_m, s.heading_rad - yaw_rad)
    s.bar_from_aircraft_m[0], s.bar_from_aircraft_m[1] = north_m, east_m
    count = 0
    for row in range(int(s.sights)):
        if 0.0 < exposure_s - sights[row, 0] <= _WINDOW_S and count < _ROWS - 1:
            for column in range(5):
                sights[count, column] = sights[row, column]
            count += 1
    newest = sights[count]
    newest[0], newest[1], newest[2], newest[3], newest[4] = exposure_s, ahead_m, right_m, down_m, s.bar_heading_rad
    s.sights, s.seen_s, s.pose_s = count + 1, exposure_s, exposure_s
    _update_reference(s, ways, sights)
    _update_velocity(s)
    _carry(s, ways, sights)


@compiled
def _take_deck(
    records: Records, exposure_s: float, centre_in_level_m: Place, camera_in_body_m: Array, deck_in_bar_m: Array
) -> None:
    """Over the deck where it is now, not where it would lie at rest: that is what must not be struck."""
    s, (ahead_m, right_m, down_m) = records[0], centre_in_level_m
    ahead_m, right_m = _turned(camera_in_body_m[0] + ahead_m, camera_in_body_m[1] + right_m, s.yaw_rad)
    s.seen_s = s.pose_s = exposure_s
    s.place_in_bar_m[0], s.place_in_bar_m[1] = deck_in_bar_m[0] - ahead_m, deck_in_bar_m[1] - right_m
    s.place_in_bar_m[2] = deck_in_bar_m[2] - (camera_in_body_m[2] + down_m)


@compiled
def _leap_m(s: Record, ways: Array, sights: Array, exposure_s: float, place_m: Place) -> float:
    """How far a pose lies from where those before lead to; 0 within what poses, ways and waves may err."""
    if s.sights == 0.0:
        return 0.0
    since_s = exposure_s - sights[int(s.sights) - 1, 0]
    if not 0.0 <= since_s <= _REMEMBERED_S:
        return 0.0
    x, y, z = _place_m(s, ways, sights, exposure_s)
    leap_m = math.sqrt((place_m[0] - x) ** 2 + (place_m[1] - y) ** 2 + (place_m[2] - z) ** 2)
    distance_m = math.sqrt(place_m[0] ** 2 + place_m[1] ** 2 + place_m[2] ** 2)
    return leap_m if leap_m > _LEAP_M + _LEAP_SHARE * distance_m + _LEAP_MPS * since_s else 0.0


@compiled
def _update_reference(s: Record, ways: Array, sights: Array) -> None:
    """The least-squares slope of the poses; the vehicle's own mean velocity over them less that, and its slow mean."""
    count, own = int(s.sights), not math.isnan(s.velocity_mps[0])
    first = 0
    while own and first < count and sights[first, 0] < ways[0, 0]:
        first += 1  # of before its first reading nobody knows the way
    rows = sights[first:count]
    s.velocity_bias_in_bar_mps[:] = math.nan
    if len(rows) < 3 or rows[-1, 0] - rows[0, 0] < _SHORTEST_WINDOW_S:
        s.velocity_in_bar_mps[:] = math.nan
        return
    mean_s, ahead_m, right_m = 0.0, 0.0, 0.0
    for row in rows:
        mean_s, ahead_m, right_m = mean_s + row[0], ahead_m + row[1], right_m + row[2]
    mean_s, ahead_m, right_m = mean_s / len(rows), ahead_m / len(rows), right_m / len(rows)
    squares, slope = 0.0, np.zeros(3)
    for row in rows:
        squares += (row[0] - mean_s) ** 2
        for axis in range(3):
            slope[axis] += (row[0] - mean_s) * row[1 + axis]
    for axis in range(3):
        slope[axis] /= squares
        s.velocity_in_bar_mps[axis] = slope[axis]
    if not own or math.isnan(_travelled(s, ways, rows[0, 0])[0]) or math.isnan(_travelled(s, ways, rows[-1, 0])[0]):
        return
    lasted_s = rows[-1, 0] - rows[0, 0]
    begun, ended = _travelled(s, ways, rows[0, 0]), _travelled(s, ways, rows[-1, 0])
    s.turn_rad_s = _wrap(rows[-1, 4] - rows[0, 4]) / lasted_s
    heading_rad = rows[-1, 4] - s.turn_rad_s * (rows[-1, 0] - mean_s)
    own_mps = _turned((ended[0] - begun[0]) / lasted_s, (ended[1] - begun[1]) / lasted_s, -heading_rad)
    swept_mps = _swept(ahead_m, right_m, s.turn_rad_s)
    share = min((rows[-1, 0] - rows[-2, 0]) / _REFERENCE_TIME_S, 1.0)
    bias, slow = s.velocity_bias_in_bar_mps, s.slow_velocity_bias_in_bar_mps
    for i in range(2):
        bias[i] = own_mps[i] - slope[i] - swept_mps[i]
        slow[i] = bias[i] if math.isnan(slow[i]) else slow[i] + share * (bias[i] - slow[i])


@compiled
def _swept(ahead_m: float, right_m: float, turn_rad_s: float) -> Vector:
    """The velocity of a place that turns with the bar: ω × p."""
    return -turn_rad_s * right_m, turn_rad_s * ahead_m


@compiled
def _update_velocity(s: Record) -> None:
    """The velocity against the bar, brought up to date by the vehicle's own."""
    unknown = s.velocity_in_bar_mps[0] + s.velocity_bias_in_bar_mps[0] + s.bar_heading_rad + s.velocity_mps[0]
    if math.isnan(unknown):
        return
    heading_rad = s.bar_heading_rad + s.turn_rad_s * min(max(s.t_s - s.pose_s, 0.0), _KEPT_S)
    own_mps = _turned(s.velocity_mps[0], s.velocity_mps[1], -heading_rad)
    swept_mps = (0.0, 0.0)
    if not math.isnan(s.place_in_bar_m[0]):
        swept_mps = _swept(s.place_in_bar_m[0], s.place_in_bar_m[1], s.turn_rad_s)
    for i in range(2):
        s.velocity_in_bar_mps[i] = own_mps[i] - s.velocity_bias_in_bar_mps[i] - swept_mps[i]


@compiled
def _carry(s: Record, ways: Array, sights: Array) -> None:
    """Carry the place on from the newest pose to the newest telemetry."""
    newest_s = sights[int(s.sights) - 1, 0]
    if math.isnan(s.t_s) or s.sights == 0.0 or s.pose_s > newest_s or s.t_s > newest_s + _KEPT_S:
        return  # none yet, or the deck itself was seen since, or too long ago
    x, y, z = _place_m(s, ways, sights, max(s.t_s, newest_s))
    s.place_in_bar_m[0], s.place_in_bar_m[1], s.place_in_bar_m[2] = x, y, z


@compiled
def _place_m(s: Record, ways: Array, sights: Array, t_s: float) -> Place:
    """In `bar`, from the newest pose carried on to a time."""
    seen_s, ahead_m, right_m, down_m, heading_rad = sights[int(s.sights) - 1]
    if math.isnan(s.velocity_in_bar_mps[0]):
        return ahead_m, right_m, down_m
    age_s = min(max(t_s - seen_s, 0.0), _KEPT_S)
    ahead_mps, right_mps, down_mps = s.velocity_in_bar_mps
    begun, ended, bias_mps = _travelled(s, ways, seen_s), _travelled(s, ways, t_s), s.velocity_bias_in_bar_mps
    if math.isnan(bias_mps[0] + begun[0] + ended[0]):
        return ahead_m + age_s * ahead_mps, right_m + age_s * right_mps, down_m + age_s * down_mps
    turned_rad = s.turn_rad_s * age_s
    north_m, east_m = _turned(ahead_m, right_m, heading_rad)
    ship_mps = _turned(bias_mps[0], bias_mps[1], heading_rad + 0.5 * turned_rad)
    north_m += ended[0] - begun[0] - age_s * ship_mps[0]
    east_m += ended[1] - begun[1] - age_s * ship_mps[1]
    ahead_m, right_m = _turned(north_m, east_m, -heading_rad - turned_rad)
    return ahead_m, right_m, down_m + age_s * down_mps


@compiled
def _travelled(s: Record, ways: Array, t_s: float) -> Vector:
    """(north, east) travelled at a time, between the readings; NaN where that is not remembered."""
    count = int(s.ways)
    if count == 0 or t_s < ways[0, 0]:
        return math.nan, math.nan
    index = max(int(np.searchsorted(ways[:count, 0], t_s)), 1)
    if index >= count:
        return ways[count - 1, 1], ways[count - 1, 2]
    before, after = ways[index - 1], ways[index]
    share = (t_s - before[0]) / max(after[0] - before[0], 1e-9)
    return before[1] + share * (after[1] - before[1]), before[2] + share * (after[2] - before[2])


@compiled
def _newest(records: Records, ways: Array, sights: Array) -> tuple[float, float, Vector]:
    """Of the newest pose: place along the bar's axis, heading of that, and the way travelled until its exposure."""
    s = records[0]
    exposure_s, ahead_m, _, _, heading_rad = sights[int(s.sights) - 1]
    return ahead_m, heading_rad, _travelled(s, ways, exposure_s)


def _usable(box: Box) -> bool:
    return all(map(math.isfinite, (*box.centre_px, *box.size_px))) and min(box.size_px) > _LEAST_BOX_PX
