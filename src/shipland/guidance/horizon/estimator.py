"""The estimator: from observations, telemetry and sent commands to one estimate of position, motion and headings.

A picture's age enters as its time: `Estimator.take` gives every measurement to the filters at the time at which it was
true, and `Estimator.estimate` predicts to the time asked for.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shipland.camera import Camera
from shipland.compiled import compiled
from shipland.estimation.banks import GainBank, LatencyBank
from shipland.estimation.delayed import DelayedFilter
from shipland.estimation.heading import HeadingFilters, Headings
from shipland.estimation.relative_state import (
    GUST,
    POSITION,
    VELOCITY,
    VELOCITY_BIAS,
    WIND,
    GaussianState,
    Model,
    less_wave,
    position_covariance,
)
from shipland.estimation.waves import Output
from shipland.frames import Array, all_finite, rotated, wrap_angle
from shipland.guidance.horizon.assumptions import Assumptions, motion_of, ship_in_view
from shipland.guidance.horizon.estimated import Actuation, Estimated
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.horizon.places import HeaveTracker, HeightGate, Places, SeenPlace
from shipland.guidance.horizon.stick_history import StickHistory
from shipland.guidance.response import Response
from shipland.messages import BarPose, Estimate, Observation, PilotCommand, Telemetry
from shipland.rig import Rig

_POSE_GAP_S = 0.5
"""After a gap this long in the poses, one that leaps is soon believed."""
_STAMP_S = 0.012
"""Standard deviation of what the pictures' times are off by after their correction."""
_FROM_ASIDE = 2.0
"""A bar that looks so many times as far away as the ship is foreshortened: it is seen from 55° off astern or more."""
_MeanAndCovariance = tuple[Array, Array]
_VELOCITY_EVERY_S = 0.06
"""Least time between velocity readings: their noise is coloured, so that closer ones add little."""


class Estimator:
    """Keeps the filters: `sent` and `take` once a cycle, then `estimate`.

    Args:
        parameters: of the pilot.
        response: of the vehicle.
        rig: the bar, and the deck below it.
        camera: intrinsics.
        camera_in_body_m: (3,) the camera's optical centre.
    """

    def __init__(
        self, parameters: HorizonParameters, response: Response, rig: Rig, camera: Camera, camera_in_body_m: Array
    ) -> None:
        self._parameters, self._response = parameters, response
        delayed, measured, deck_down_m = parameters.delayed, parameters.measured, float(rig.deck_in_bar_m[2])
        self._places = Places(measured, rig, camera, camera_in_body_m)
        self._heights = HeightGate(response.climb_lag_s)
        self._deck_in_bar_m = rig.deck_in_bar_m
        stern_m = -float(rig.bar_in_ship_m[0]) - rig.deck_ahead_of_stern_m
        self._hull_m = (stern_m, stern_m + rig.platform_length_m, 0.5 * rig.platform_width_m)
        motion = motion_of(response)
        self._sticks = StickHistory(response, motion)
        wave, velocity_std_mps = parameters.wave, measured.velocity_mps
        if self._sticks.servo is not None:
            velocity_std_mps = measured.velocity_tracked_mps
        self._wave_parameters = wave
        low_m = deck_down_m - parameters.margins.low_m
        self._heave = HeaveTracker(wave, response.climb_lag_s, delayed.velocity_mps, low_m)
        self._assumed = Assumptions(motion, self._heave.wave, parameters.horizontal.gust_mps2)
        self._headings = HeadingFilters(parameters.heading, parameters.heading_turning, parameters.turn_from_rad_s)
        self._across = DelayedFilter(self._across_model(), delayed, velocity_std_mps)
        self._down = DelayedFilter(self._assumed.down_model(parameters, response), delayed, measured.velocity_down_mps)
        self._latency, self._gain = LatencyBank(parameters.latency), GainBank(parameters.gain)
        self._gain_models = self._models_by_gain()
        self._landing = False
        self._velocity_s = self._showed_s = self._posed_s = self._bar_s = -math.inf
        self._by_nose = False
        """The newest pose was turned into the axes of the flight by the nose's heading."""
        self._line_of_sight: tuple[float, float] | None = None
        """Time and heading of the newest box; None where a pose came after it."""
        self.seen_s = -math.inf
        """Exposure of the newest picture that gave a position."""
        self.rejected = ""
        """Why the newest picture's pose was rejected; empty where it was taken, or there was none."""

    def sent(self, command: PilotCommand) -> None:
        """The command of the cycle before, as it left the safety."""
        self._sticks.sent(command, self._headings, self._assumed.motion.gain)

    def effect_s(self, now_s: float) -> float:
        """When a command that is ready now takes effect."""
        return self._sticks.effect_s(now_s)

    def taken_s(self, stamp_s: float) -> float:
        """When a picture was taken, by its time stamp and what those are found to be off by."""
        return stamp_s + self._latency.correction_s

    def trim_in_level_mps2(self, now_s: float) -> Array | None:
        """(2,) forward and right, by the mean tilt of late; None where the vehicle's servo is modelled."""
        if self._sticks.servo is not None:
            return None
        return rotated(self._sticks.trim_mps2, -self._headings.nose_at(now_s))

    def forget_place(self) -> None:
        """Forget the position, after a time in which the vehicle's motion is unknown: the next picture starts anew."""
        self._across.estimate = self._down.estimate = None
        self._heights = HeightGate(self._response.climb_lag_s)
        self._forget_banks()

    def take(self, observation: Observation, telemetry: Telemetry, landing: bool = False) -> None:
        """Update the filters by a cycle's observation and telemetry.

        Args:
            observation: of the newest frame.
            telemetry: of the decision's time.
            landing: low over the deck, or on the way up from it: there a leap of the position is not soon believed.
        """
        self._landing, self.rejected = landing, ""
        t_s, pose = self.taken_s(observation.t_s), observation.nose_pose
        if pose is not None and not _finite(pose):
            pose = None
        if telemetry.heading_rad is not None:
            self._headings.compass(_or_receipt(telemetry.heading_t_s, telemetry), telemetry.heading_rad)
        self._sticks.attitude(telemetry, self._headings)
        headings = self._headings.take(t_s, pose)
        self._assume(self._assumed.with_axis(headings))
        self._take_velocity(telemetry)
        self._take_picture(t_s, observation, pose, headings)
        held_mps2 = self._held_mps2()
        if held_mps2 is not None:
            self._assume(self._assumed.with_gusts(held_mps2, self._parameters))
        self._assume(self._assumed.with_ship(self._unseen_ship_mps(t_s, headings)))
        if self._assumed.motion.servo_per_s > 0.0:
            self._assume(self._assumed.with_view(self._over_ship(), self._parameters.delayed.flow_settle_s))
        self._across.follow(telemetry.t_s, self._sticks.across, self._headings.turn_rad_s)
        self._down.follow(telemetry.t_s, self._sticks.climbs)

    def _take_velocity(self, telemetry: Telemetry) -> None:
        """The vehicle's own velocity, at the time at which it was true."""
        velocity, t_s = telemetry.velocity_in_level_mps, _or_receipt(telemetry.velocity_t_s, telemetry)
        if velocity is None or not self._parameters.measured.use_velocity or not all_finite(velocity):
            return
        if t_s < self._velocity_s + _VELOCITY_EVERY_S:
            return
        self._velocity_s = t_s
        across_mps, over_ship = rotated(velocity[:2], self._headings.nose_at(t_s)), self._over_ship()
        for filters in (self._across, self._latency, self._gain):
            filters.update_velocity(t_s, across_mps, over_ship)
        self._down.update_velocity(t_s, velocity[2:])
        self._heave.update_velocity(t_s, float(velocity[2]), self.seen_s)

    def _take_picture(self, t_s: float, observation: Observation, pose: BarPose | None, headings: Headings) -> None:
        """The best position in a picture of the time `t_s`: by the bar's pose, else by a box."""
        nose_up_rad, is_bar = self._sticks.nose_up_rad, observation.bar_box is not None
        box = observation.bar_box or observation.ship_box
        if pose is not None:
            estimate = self._across.estimate
            speed_mps = 0.0 if estimate is None else float(np.linalg.norm(estimate.of(VELOCITY)))
            self._take_pose(t_s, self._places.of_pose(pose, headings, nose_up_rad, speed_mps))
        elif box is not None:
            place = self._places.of_box(box, is_bar, observation.gimbal, headings)
            if place is not None:
                self._take_box(t_s, place, is_bar)

    def _take_pose(self, t_s: float, place: SeenPlace) -> None:
        self._line_of_sight, self._by_nose = None, place.by_nose
        if t_s - self._showed_s > _POSE_GAP_S:
            self._posed_s = -math.inf
        self._showed_s = t_s
        if self._heights.refuses(t_s, place.down_m, place.down_variance, self._sticks.climbs):
            self.rejected = "a pose at a height that no climb leads to"
            return
        wind_mps2 = self._assumed.wind_mps2(self._parameters)
        self._heave.update_pose(t_s, place.down_m, place.down_variance, self._sticks.climbs, wind_mps2)
        if self._heave.wave != self._assumed.wave:
            self._adopt_wave()
        self._update_banks(t_s, place)
        self._update(t_s, place)
        if self._across.refused:
            self.rejected = "a pose where the aircraft cannot be"
        else:
            self._posed_s = t_s

    def _take_box(self, t_s: float, place: SeenPlace, is_bar: bool) -> None:
        lost_s = self._parameters.measured.lost_s
        if t_s - self.seen_s > lost_s:  # the ship has moved on meanwhile
            self.forget_place()
        elif is_bar and t_s - max(self._bar_s, self._posed_s) > lost_s and self._tells_range(place):
            # The ship's boxes had another error of the range. A leap of the range is no motion of the ship.
            inputs = self._sticks.across, self._headings.turn_rad_s
            self._across.restart_position(t_s, place.across_m, place.covariance, *inputs)
        if is_bar:
            self._bar_s = t_s
        north, east = (-place.across_m).tolist()
        self._line_of_sight = t_s, math.atan2(east, north)
        self._update(t_s, place, self._parameters.measured.first_way_mps)

    def _tells_range(self, place: SeenPlace) -> bool:
        """Whether a place of the bar's first box is not one of a bar seen from aside, which looks farther away.

        Near the ship a bar seen from astern shows its corners.
        """
        across = self._across.estimate
        known_m = 0.0 if across is None else math.hypot(*across.of(POSITION).tolist())
        nearest_m = 2.0 * self._parameters.path.stand_off_m
        return nearest_m < math.hypot(*place.across_m.tolist()) < _FROM_ASIDE * known_m

    def _update(self, t_s: float, place: SeenPlace, ship_std_mps: float = 0.0) -> None:
        """Update by a position; a first one starts the filters, with this standard deviation of the ship's speed."""
        measured = self._parameters.measured
        patience_s = measured.lost_s if self._landing else 0.0
        lost = self._across.refused >= measured.lost_refusals and t_s - self._posed_s >= patience_s
        if self._across.estimate is None or lost:
            self._across.start(t_s, place.across_m, place.covariance, measured.first_mps, ship_std_mps)
            self._down.start(t_s, *_vertical(place), measured.first_climb_mps)
            self._forget_banks()
            self.seen_s = t_s
            return
        if self._down.refused >= measured.lost_refusals:
            self._down.start(t_s, *_vertical(place), measured.first_climb_mps)
        else:
            self._down.update_pose(t_s, *_vertical(place), self._sticks.climbs)
        turn_rad_s = self._headings.turn_rad_s
        if self._across.update_pose(t_s, place.across_m, place.covariance, self._sticks.across, turn_rad_s):
            self.seen_s = t_s

    def _update_banks(self, t_s: float, place: SeenPlace) -> None:
        """Adapt the correction of time stamps and, where sticks mean a tilt, their gain; not to a ship that turns."""
        if self._headings.turning:
            self._forget_banks()
            return
        seen, inputs = (place.across_m, place.covariance), (self._sticks.across, self._headings.turn_rad_s)
        self._latency.update_pose(t_s - self._latency.correction_s, *seen, *inputs, self._across)
        if self._assumed.motion.servo_per_s > 0.0:
            return  # a servo brings about the speed that is asked for
        better = self._gain.update_pose(t_s, *seen, *inputs, self._across, self._gain_models)
        if better is not None:
            self._across = better
            self._assumed = replace(self._assumed, motion=replace(self._assumed.motion, gain=self._gain.gain))
            self._latency.forget_place()

    def _forget_banks(self) -> None:
        self._latency.forget_place()
        self._gain.forget_place()

    def _across_model(self) -> Model:
        return self._assumed.across_model(self._parameters, self._assumed.motion.gain)

    def _models_by_gain(self) -> list[Model]:
        return [self._assumed.across_model(self._parameters, gain) for gain in self._parameters.gain.candidates]

    def _assume(self, assumed: Assumptions) -> None:
        """Go on with other assumptions on vehicle, gusts or the ship's axis."""
        if assumed is not self._assumed:
            self._assumed = assumed
            self._across.model, self._gain_models = self._across_model(), self._models_by_gain()
            self._down.model = self._assumed.down_model(self._parameters, self._response)

    def _unseen_ship_mps(self, t_s: float, headings: Headings) -> float:
        """Speed of the ship while its heading is not seen; 0 where it is."""
        across = self._across.estimate
        if across is None or t_s - headings.posed_s < self._parameters.measured.lost_s:
            return 0.0
        return math.hypot(*across.of(VELOCITY_BIAS).tolist())

    def _held_mps2(self) -> Array | None:
        """(2,) acceleration against the wind; None before the first position."""
        across = self._across.estimate
        if self._response.kind == "velocity":
            return self._sticks.trim_mps2
        return None if across is None else across.of(WIND) + across.of(GUST)

    def _adopt_wave(self) -> None:
        """Go on with another wave motion in all filters."""
        self._assumed = replace(self._assumed, wave=self._heave.wave)
        model, self._gain_models = self._across_model(), self._models_by_gain()
        self._across.adopt(model)
        self._latency.adopt(model)
        self._gain.adopt(self._gain_models)
        self._down.adopt(self._assumed.down_model(self._parameters, self._response))

    def _over_ship(self) -> float:
        """Share of ship in the view of the vehicle's optical flow; 0 where its velocity is over ground."""
        across, down, headings = self._across.estimate, self._down.estimate, self._headings.now
        if self._response.velocity_reference == "ground" or across is None or down is None or headings is None:
            return 0.0
        over_deck_m = float(self._deck_in_bar_m[2]) - float(down.of(POSITION)[0])
        return ship_in_view(rotated(across.of(POSITION), -headings.bar_rad), over_deck_m, self._hull_m)

    def estimate(self, t_s: float) -> Estimated | None:
        """The estimate at a time that is not before the newest picture; None before the first position."""
        headings, sticks, wave = self._headings.now, self._sticks, self._assumed.wave
        if headings is None:
            return None
        predicted = self._predicted(t_s)
        if predicted is None:
            return None
        across, down = predicted
        (down_m,), (down_mps,) = (it.tolist() for it in less_wave(down.mean, wave.bar))
        place_m, speed_mps = less_wave(across.mean, wave.bar)
        (north_m, east_m), (north_mps, east_mps) = place_m.tolist(), speed_mps.tolist()
        tracked_near = self._wave_parameters.followed_at(math.hypot(north_m, east_m))
        followed_m, followed_mps = less_wave(across.mean, wave.tracked, tracked_near)
        to_bar_rad_s = (north_m * east_mps - east_m * north_mps) / max(north_m**2 + east_m**2, 1.0)
        to_bar_rad = math.atan2(-east_m, -north_m)
        if self._line_of_sight is not None:
            boxed_s, to_box_rad = self._line_of_sight
            to_bar_rad = to_box_rad + to_bar_rad_s * (t_s - boxed_s)
        return Estimated(
            t_s=t_s,
            across=across,
            down=down,
            model=self._across.model,
            wave=wave,
            heave=self._down.model.wave,
            tracked_near=tracked_near,
            place_m=place_m,
            speed_mps=speed_mps,
            followed_m=followed_m,
            followed_mps=followed_mps,
            down_m=down_m,
            down_mps=down_mps,
            nose_rad=self._headings.nose_at(t_s),
            bar_rad=self._bar_rad(headings, t_s),
            turn_rad_s=self._headings.turn_rad_s,
            bar_known=headings.bar_known and self._assumed.ship_mps == 0.0,
            to_bar_rad=to_bar_rad,
            to_bar_rad_s=to_bar_rad_s,
            deck_in_bar_m=self._deck_in_bar_m,
            actuation=Actuation(
                motion=self._assumed.motion,
                input_before=sticks.input_before(),
                tracked=None if sticks.servo is None else sticks.servo.state,
                trim_mps2=sticks.trim_mps2,
                velocity_s=self._velocity_s,
            ),
        )

    def at_picture(self, t_s: float) -> Estimate | None:
        """The estimate at a picture, in `bar`, for the log and others; None while it or the bar's heading is not known.

        Near, poses are rotated by the bar's heading and the estimate is rotated back by it, so that its error cancels
        in the position; from afar, where they are rotated by the nose's, the error of the yaw remains. What pictures
        have in common, as an error of their time, is in no innovation, and is added. Position and yaw come from
        separate filters; their cross-covariance is taken as zero.
        """
        headings = self._headings.now
        if headings is None or not headings.bar_known or self._assumed.ship_mps != 0.0:
            return None
        predicted = self._predicted(t_s)
        if predicted is None:
            return None
        bar_rad = self._bar_rad(headings, t_s)
        (nose, both, _), (_, bar, _), _ = headings.covariance.tolist()
        yaw_variance = nose + bar - 2.0 * both
        across, down = predicted
        place_m, speed_mps, covariance = np.empty(3), np.empty(3), np.zeros((4, 4))
        states, errors = (across[1:], down[1:]), (yaw_variance, self._by_nose)
        _in_bar(states, self._assumed.wave.bar, bar_rad, errors, place_m, speed_mps, covariance)
        return Estimate(t_s, place_m, wrap_angle(self._headings.nose_at(t_s) - bar_rad), speed_mps, covariance)

    def _predicted(self, t_s: float) -> tuple[GaussianState, GaussianState] | None:
        """Horizontal and vertical state at a time; None before the first position."""
        sticks = self._sticks
        sticks.advance(t_s)
        across = self._across.predict(t_s, sticks.across, self._headings.turn_rad_s)
        down = self._down.predict(t_s, sticks.climbs)
        return None if across is None or down is None or not all_finite(across.mean) else (across, down)

    def _bar_rad(self, headings: Headings, t_s: float) -> float:
        return wrap_angle(headings.bar_rad + self._headings.turn_rad_s * (t_s - headings.t_s))


@compiled
def _in_bar(
    states: tuple[_MeanAndCovariance, _MeanAndCovariance],
    bar: Output,
    bar_rad: float,
    errors: tuple[float, bool],
    place_m: Array,
    speed_mps: Array,
    covariance: Array,
) -> None:
    """Write (3,) place, (3,) speed and, over zeros, their (4,4) covariance, in `bar`.

    Of horizontal and vertical state, with the variance of the yaw; by the nose's heading the place errs by it too.
    """
    (across, down), (yaw_variance, by_nose) = states, errors
    c, s = math.cos(bar_rad), math.sin(bar_rad)
    (north_m, east_m), (north_mps, east_mps) = less_wave(across[0], bar)
    below_m, below_mps = less_wave(down[0], bar)
    place_m[0], place_m[1], place_m[2] = c * north_m + s * east_m, c * east_m - s * north_m, below_m[0]
    speed_mps[0], speed_mps[1], speed_mps[2] = c * north_mps + s * east_mps, c * east_mps - s * north_mps, below_mps[0]
    p = position_covariance(across[1], bar[0])
    twice = c * s * (p[0, 1] + p[1, 0])
    covariance[0, 0] = c * c * p[0, 0] + s * s * p[1, 1] + twice
    covariance[1, 1] = s * s * p[0, 0] + c * c * p[1, 1] - twice
    covariance[0, 1] = covariance[1, 0] = c * s * (p[1, 1] - p[0, 0]) + 0.5 * (c * c - s * s) * (p[0, 1] + p[1, 0])
    covariance[2, 2], covariance[3, 3] = position_covariance(down[1], bar[0])[0, 0], yaw_variance
    for i in range(2):
        for j in range(2):
            covariance[i, j] += _STAMP_S**2 * (speed_mps[i] * speed_mps[j])
            if by_nose:
                turned = yaw_variance * (place_m[1 - i] * place_m[1 - j])
                covariance[i, j] += turned if i == j else -turned


def _finite(pose: BarPose) -> bool:
    return all_finite(pose.position_in_bar_m) and math.isfinite(pose.yaw_rad) and all_finite(pose.covariance)


def _vertical(place: SeenPlace) -> tuple[Array, Array]:
    """(1,) and (1,1) the height below the bar and its variance."""
    return np.array([place.down_m]), np.array([[place.down_variance]])


def _or_receipt(t_s: float | None, telemetry: Telemetry) -> float:
    """The time of a part of the telemetry; that of its receipt where the vehicle does not say."""
    return telemetry.t_s if t_s is None else t_s
