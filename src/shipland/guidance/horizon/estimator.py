"""From observations, telemetry and sent commands to one estimate of place, motion and headings."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from shipland.camera import Camera
from shipland.estimation.delayed import DelayedFilter, Inputs
from shipland.estimation.gain import GainBank
from shipland.estimation.latency import LatencyBank
from shipland.estimation.relative_state import (
    GUST,
    POSITION,
    VELOCITY,
    WIND,
    AxisModel,
    Disturbances,
    Model,
    Spread,
    less_wave,
)
from shipland.estimation.wave_bank import WaveBank, WaveEstimate
from shipland.estimation.wave_motion import WaveMotion
from shipland.frames import GRAVITY_MPS2, Array, all_finite, rotated, wrap_angle
from shipland.guidance.horizon.estimated import Actuation, Estimated
from shipland.guidance.horizon.heading_filters import HeadingFilters
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.horizon.places import HeightGate, Places, SeenPlace
from shipland.guidance.horizon.servo import ShapedSpeed
from shipland.guidance.response import Response
from shipland.messages import BarPose, Observation, PilotCommand, Telemetry
from shipland.rig import Rig


@lru_cache(maxsize=64)
def _model(axes: int, motion: AxisModel, noise: Disturbances, wave: WaveMotion, spread: Spread | None = None) -> Model:
    return Model(axes, motion, noise, wave, spread)


def motion_of(response: Response) -> AxisModel:
    """The horizontal motion of a vehicle, nothing in view."""
    return AxisModel(
        response.lag_s,
        response.drag_per_s,
        response.servo_per_s,
        integral_per_s2=response.integral_per_s2,
        approach_per_s=response.approach_per_s,
        smoothing_s=response.smoothing_s,
    )


class Estimator:
    """Keeps the filters; every input of the flight passes through here once."""

    def __init__(
        self, parameters: HorizonParameters, response: Response, rig: Rig, camera: Camera, camera_in_body_m: Array
    ) -> None:
        self._parameters, self._response = parameters, response
        self._places = Places(parameters.measured, rig, camera, camera_in_body_m)
        self._heights = HeightGate(response.climb_lag_s)
        self._low_m = float(rig.deck_in_bar_m[2]) - parameters.margins.low_m
        self._motion = motion_of(response)
        self._servo = ShapedSpeed(self._motion) if self._motion.inputs > 1 else None
        self._climb = AxisModel(0.05, 0.0, 1.0 / response.climb_lag_s)
        wave = parameters.wave
        self._wave = wave if self._servo is None else replace(wave, followed=wave.followed_servo)
        self._bank = WaveBank(self._wave)
        self._waves: WaveEstimate | None = None
        self._along_rad: float | None = None
        self._wave_motion = self._wave.believed[self._wave.first]
        self._gust_mps2 = parameters.gust_levels_mps2[-2]
        delayed, measured = parameters.delayed, parameters.measured
        least_mps = measured.velocity_mps if self._servo is None else measured.velocity_tracked_mps
        self._across = DelayedFilter(self._across_model(), delayed, least_mps)
        self._down = DelayedFilter(self._down_model(), delayed, measured.velocity_down_mps)
        self._latency = LatencyBank(parameters.latency)
        self._gain = GainBank(parameters.gain)
        self._gain_models = self._models_by_gain()
        stern_m = -float(rig.bar_in_ship_m[0]) - rig.deck_ahead_of_stern_m
        self._hull_m = (stern_m, stern_m + rig.platform_length_m, 0.5 * rig.platform_width_m)
        self._deck_in_bar_m = rig.deck_in_bar_m
        self._pushes, self._climbs = Inputs(2 * self._motion.inputs), Inputs(1)
        self._headings = HeadingFilters(parameters.heading, parameters.heading_turning, parameters.turn_from_rad_s)
        self._velocity_s = -math.inf
        self._seen_s = self._showed_s = self._posed_s = -math.inf
        self._line_rad: float | None = None
        """Heading of the newest sight, where that was a box."""
        self._deck_s = -math.inf
        """When the newest picture of the deck was taken."""
        self.rejected = ""
        """Why the newest picture's pose was rejected; empty where it was taken, or there was none."""
        self._landing = False
        self._sinking: tuple[float, float] | None = None
        self._tilted_mps2: Array = np.zeros(2)
        self._nose_up_rad = 0.0
        self._tilted_s = -math.inf
        self._trim_mps2: Array = np.zeros(2)
        """(2,) by the mean tilt; of a vehicle that holds by itself, against the mean wind."""

    def _across_model(self) -> Model:
        return self._model_of_gain(self._motion.gain)

    def _model_of_gain(self, gain: float) -> Model:
        return _model(2, replace(self._motion, gain=gain), self.disturbances, self._wave_motion, self._spread())

    def _change_models(self) -> None:
        """Those across, after a change of what is believed of motion, disturbances or the ship's axis."""
        self._across.model = self._across_model()
        self._gain_models = self._models_by_gain()

    def _models_by_gain(self) -> list[Model]:
        return [self._model_of_gain(gain) for gain in self._parameters.gain.candidates]

    def _spread(self) -> Spread | None:
        """A ship's sway is larger than its surge, and goes with its heave."""
        if not self._wave_motion.bar_moves or self._along_rad is None:
            return None
        return replace(self._wave.spread, along_rad=self._along_rad)

    def _judge_axis(self) -> None:
        """The directions of surge and sway turn with the ship."""
        headings = self._headings.now
        if headings is None or not headings.bar_known:
            return
        if self._along_rad is None or abs(wrap_angle(headings.bar_rad - self._along_rad)) > _AXIS_STEP_RAD:
            self._along_rad = _AXIS_STEP_RAD * round(headings.bar_rad / _AXIS_STEP_RAD)
            self._change_models()

    @property
    def disturbances(self) -> Disturbances:
        """Horizontally, as they are taken for now."""
        if self._motion.servo_per_s > 0.0:
            return self._parameters.horizontal_servo
        return self._parameters.horizontal_at(self._gust_mps2)

    def _judge_wind(self) -> None:
        """Turbulence grows with the mean wind, and that shows in the tilt that holds the place."""
        across, levels = self._across.estimate, self._parameters.gust_levels_mps2
        if across is None or self._response.kind != "attitude":
            return
        wind_mps2 = math.hypot(*(across.of(WIND) + across.of(GUST)).tolist())
        share = self._parameters.gust_share_at_sea if self._wave_motion.bar_moves else self._parameters.gust_share
        wanted = min(levels, key=lambda level: abs(math.log(level / max(share * wind_mps2, 1e-3))))
        between = abs(math.log(share * max(wind_mps2, 1e-3) / self._gust_mps2))
        if wanted != self._gust_mps2 and between > 0.6 * math.log(levels[1] / levels[0]):
            self._gust_mps2 = wanted
            self._change_models()

    def _judge_trim(self, now_s: float) -> None:
        share = 1.0 - math.exp(-max(now_s - self._tilted_s, 0.0) / _TRIM_S)
        tilt_mps2 = rotated(self._tilted_mps2, self._headings.nose_at(now_s))
        self._trim_mps2, self._tilted_s = self._trim_mps2 + share * (tilt_mps2 - self._trim_mps2), now_s

    def _judge_view(self) -> None:
        """A servo on optical flow follows the motion of the ship below it."""
        if self._motion.servo_per_s <= 0.0:
            return
        share = self._over_ship()
        if abs(share - self._motion.over_ship) > _VIEW_STEP:
            share = _VIEW_STEP * round(share / _VIEW_STEP)
            settle_s = self._parameters.delayed.flow_settle_s
            self._motion = replace(self._motion, over_ship=share, settle_s=settle_s)
            self._change_models()

    def _down_model(self) -> Model:
        return _model(1, self._climb, self._parameters.vertical, self._wave_motion)

    @property
    def seen_s(self) -> float:
        """When the newest picture that told a place was exposed."""
        return self._seen_s

    def effect_s(self, now_s: float) -> float:
        """When a command that is ready now takes effect."""
        return now_s + self._response.uplink_s + self._response.dead_time_s

    def sent(self, command: PilotCommand) -> None:
        """What really left."""
        effect_s = self.effect_s(command.t_s)
        turn = 0.01 * command.yaw_percent * self._response.max_turn_rad_s
        climb = 0.01 * command.heave_percent * self._response.max_climb_mps
        sticks = command.pitch_percent, command.roll_percent
        push = np.array([self._response.input_of(stick) for stick in sticks])
        if self._servo is None and max(map(abs, sticks)) < self._response.hold_below_percent:
            push = self._tilted_mps2 / self._motion.gain  # the vehicle holds its place by itself, against the wind
        self._headings.sent(effect_s + self._response.turn_lag_s, turn)
        self._climbs.add(effect_s, np.array([-climb]))
        nose_rad = self._headings.nose_at(effect_s)
        if self._servo is None:
            self._pushes.add(effect_s, rotated(push, nose_rad))
        else:
            self._servo.ask(effect_s, rotated(push, nose_rad), self._pushes)

    def taken_s(self, stamp_s: float) -> float:
        """When a picture was taken, as far as that is known."""
        return stamp_s + self._latency.correction_s

    def trim_in_level_mps2(self, now_s: float) -> Array | None:
        """(2,) forward and right, by the mean tilt of late; None where the vehicle's servo is modelled."""
        return rotated(self._trim_mps2, -self._headings.nose_at(now_s)) if self._servo is None else None

    def take(self, observation: Observation, telemetry: Telemetry, landing: bool = False) -> None:
        """One cycle's observation and telemetry.

        Args:
            observation: of the newest frame.
            telemetry: of the decision's time.
            landing: low over the deck, or on the way up from it: there a leap of the position is not soon believed.
        """
        self._landing = landing
        if observation.bar_pose is not None and not _finite(observation.bar_pose):
            observation = replace(observation, bar_pose=None)
        observation = replace(observation, t_s=self.taken_s(observation.t_s))
        heading_rad = telemetry.heading_rad
        if heading_rad is not None:
            self._headings.compass(_time(telemetry, "heading_t_s"), heading_rad)
        roll_rad, pitch_rad = telemetry.roll_rad, telemetry.pitch_rad
        if roll_rad is not None and pitch_rad is not None and max(abs(roll_rad), abs(pitch_rad)) < _STEEPEST_RAD:
            self._tilted_mps2 = GRAVITY_MPS2 * np.array([-math.tan(pitch_rad), math.tan(roll_rad)])
            self._nose_up_rad = pitch_rad
            self._judge_trim(telemetry.t_s)
        t_s, pose = observation.t_s, observation.bar_pose
        headings = self._headings.take(t_s, pose)
        self._judge_axis()
        self._take_velocity(telemetry)
        turn_rad_s, self.rejected = self._headings.turn_rad_s, ""
        box = observation.bar_box or observation.ship_box
        if pose is not None:
            self._line_rad = None
            speed_mps = (
                0.0 if self._across.estimate is None else float(np.linalg.norm(self._across.estimate.of(VELOCITY)))
            )
            self._take_pose(t_s, self._places.of_pose(pose, headings, self._nose_up_rad, speed_mps), turn_rad_s)
        elif observation.deck is not None and headings.bar_known:
            self._take_deck(t_s, self._places.of_deck(observation.deck, headings, self._nose_up_rad), turn_rad_s)
        elif box is not None:
            pitch_rad, is_bar = observation.gimbal.pitch_rad, observation.bar_box is not None
            place = self._places.of_box(box, is_bar, pitch_rad, headings)
            if place is not None:
                self._take_box(t_s, place, turn_rad_s)
        self._judge_wind()
        self._judge_view()
        self._across.follow(telemetry.t_s, self._pushes, turn_rad_s)
        self._down.follow(telemetry.t_s, self._climbs)

    def _take_velocity(self, telemetry: Telemetry) -> None:
        velocity, measured = telemetry.velocity_in_level_mps, self._parameters.measured
        t_s = _time(telemetry, "velocity_t_s")
        if velocity is None or not measured.use_velocity or not all_finite(velocity):
            return
        if t_s < self._velocity_s + _VELOCITY_EVERY_S:
            return
        self._velocity_s = t_s
        across_mps, over_ship = rotated(velocity[:2], self._headings.nose_at(t_s)), self._over_ship()
        self._across.update_velocity(t_s, across_mps, over_ship)
        self._latency.update_velocity(t_s, across_mps, over_ship)
        self._gain.update_velocity(t_s, across_mps, over_ship)
        self._down.update_velocity(t_s, velocity[2:])
        if self._sinking is None or self._seen_s > self._sinking[0]:
            self._sinking = (t_s, float(velocity[2]))

    def _over_ship(self) -> float:
        """Share of ship in a downward view, roughly: the platform against a square below the aircraft."""
        across, down, headings = self._across.estimate, self._down.estimate, self._headings.now
        if not self._parameters.measured.flow or across is None or down is None or headings is None:
            return 0.0
        ahead_m, right_m = rotated(across.of(POSITION), -headings.bar_rad).tolist()
        half_m = max(float(self._deck_in_bar_m[2]) - float(down.of(POSITION)[0]), 0.05) * _FLOW_SLOPE
        stern_m, bow_m, side_m = self._hull_m
        along_m = min(ahead_m + half_m, bow_m) - max(ahead_m - half_m, stern_m)
        aside_m = min(right_m + half_m, side_m) - max(right_m - half_m, -side_m)
        return float(max(along_m, 0.0) * max(aside_m, 0.0) / (2.0 * half_m) ** 2)

    def forget_place(self) -> None:
        """After a time in which nobody followed the vehicle: the next picture begins the estimate anew."""
        self._across.estimate = self._down.estimate = None
        self._heights = HeightGate(self._response.climb_lag_s)
        self._latency.forget_place()
        self._gain.forget_place()

    def _take_pose(self, t_s: float, place: SeenPlace, turn_rad_s: float) -> None:
        if t_s - self._showed_s > _GAP_S:
            self._posed_s = -math.inf
        self._showed_s = t_s
        if self._heights.refuses(t_s, place.down_m, place.down_variance, self._climbs):
            self.rejected = "a pose at a height that no climb leads to"
            return
        self._take_wave(t_s, place.down_m, place.down_variance)
        stamp_s = t_s - self._latency.correction_s
        self._latency.update_pose(stamp_s, place.across_m, place.covariance, self._pushes, turn_rad_s, self._across)
        self._judge_gain(t_s, place, turn_rad_s)
        self._enter(t_s, place, turn_rad_s)
        if self._across.refused:
            self.rejected = "a pose where the aircraft cannot be"
        else:
            self._posed_s = t_s

    def _take_box(self, t_s: float, place: SeenPlace, turn_rad_s: float) -> None:
        measured = self._parameters.measured
        if t_s - self._seen_s > measured.lost_s:  # the ship went on meanwhile
            self.forget_place()
        north, east = (-place.across_m).tolist()
        self._line_rad = math.atan2(east, north)
        self._enter(t_s, place, turn_rad_s, measured.first_way_mps)

    def _take_deck(self, t_s: float, place: SeenPlace, turn_rad_s: float) -> None:
        down_m, spread = np.array([place.down_m]), np.array([[place.down_variance]])
        self._down.update_deck(t_s, down_m, spread, self._climbs)
        if self._across.update_deck(t_s, place.across_m, place.covariance, self._pushes, turn_rad_s):
            self._seen_s = self._deck_s = t_s

    def _judge_gain(self, t_s: float, place: SeenPlace, turn_rad_s: float) -> None:
        """What the sticks do; only where they mean a tilt: a servo brings about the speed that is asked for."""
        if self._motion.servo_per_s > 0.0:
            return
        across_m, covariance, models = place.across_m, place.covariance, self._gain_models
        better = self._gain.update_pose(t_s, across_m, covariance, self._pushes, turn_rad_s, self._across, models)
        if better is not None:
            self._motion, self._across = replace(self._motion, gain=self._gain.gain), better
            self._latency.forget_place()

    def _take_wave(self, t_s: float, down_m: float, variance: float) -> None:
        """Judge the bar's heave; another hypothesis changes the models of both filters."""
        before = self._waves
        if down_m > self._low_m:  # ground effect and contact are no heave
            return
        if before is None:
            self._waves = self._bank.start(t_s, down_m)
            return
        lag_s = self._response.climb_lag_s
        if self._sinking is not None and self._sinking[0] <= t_s:
            asked_mps = float(self._climbs.mean(self._sinking[0] - lag_s, self._sinking[0] - lag_s)[0])
            before = self._bank.update_velocity(
                before, self._sinking[1] - asked_mps, self._parameters.delayed.velocity_mps
            )
            self._sinking = None
        moved_m = float(self._climbs.mean(before.t_s - lag_s, t_s - lag_s)[0]) * max(t_s - before.t_s, 0.0)
        self._waves = after = self._bank.update_pose(before, t_s, moved_m, down_m, variance)
        if after.chosen != before.chosen:
            self._wave_motion = self._wave.believed[after.chosen]
            model = self._across_model()
            self._across.adopt(model)
            self._latency.adopt(model)
            self._gain_models = self._models_by_gain()
            self._gain.adopt(self._gain_models)
            self._down.adopt(self._down_model())

    def _enter(self, t_s: float, place: SeenPlace, turn_rad_s: float, way_mps: float = 0.0) -> None:
        """Take a place; a first one comes with this standard deviation of the ship's way."""
        across_m, covariance = place.across_m, place.covariance
        down_m, spread = np.array([place.down_m]), np.array([[place.down_variance]])
        measured = self._parameters.measured
        patience_s = measured.lost_s if self._landing else 0.0
        lost = self._across.refused >= measured.lost_refusals and t_s - self._posed_s >= patience_s
        if self._across.estimate is None or lost:
            self._across.start(t_s, across_m, covariance, measured.first_mps, way_mps)
            self._down.start(t_s, down_m, spread, measured.first_climb_mps)
            self._latency.forget_place()
            self._gain.forget_place()
            self._seen_s = t_s
            return
        if self._down.refused >= measured.lost_refusals:
            self._down.start(t_s, down_m, spread, measured.first_climb_mps)
        else:
            self._down.update_pose(t_s, down_m, spread, self._climbs)
        if self._across.update_pose(t_s, across_m, covariance, self._pushes, turn_rad_s):
            self._seen_s = t_s

    def estimate(self, t_s: float) -> Estimated | None:
        """The estimate at a time that is not before the newest picture."""
        headings = self._headings.now
        if headings is None:
            return None
        turn_rad_s = self._headings.turn_rad_s
        if self._servo is not None:
            self._servo.advance(t_s, self._pushes)
        across = self._across.predict(t_s, self._pushes, turn_rad_s)
        down = self._down.predict(t_s, self._climbs)
        if across is None or down is None or not all_finite(across.mean):
            return None
        passed_s = t_s - headings.t_s
        nose_rad = self._headings.nose_at(t_s)
        bar_rad = headings.bar_rad + turn_rad_s * passed_s
        (nose, both, _), (_, bar, _), _ = headings.covariance.tolist()
        wave = self._wave_motion
        below, sinking = less_wave(down.mean, wave.observed_share)
        place_m, speed_mps = less_wave(across.mean, wave.observed_share)
        north, east = (-place_m).tolist()
        near = self._wave.followed_at(math.hypot(*place_m.tolist()))
        return Estimated(
            t_s,
            across,
            down,
            wave,
            near,
            place_m,
            speed_mps,
            *less_wave(across.mean, near * wave.tracked_share),
            float(below[0]),
            float(sinking[0]),
            nose_rad,
            wrap_angle(bar_rad),
            turn_rad_s,
            headings.bar_known,
            nose + bar - 2.0 * both,
            math.atan2(east, north) if self._line_rad is None else self._line_rad,
            self._deck_in_bar_m,
            self._deck_s,
            Actuation(
                self._motion,
                self._pushes.latest() if self._servo is None else self._servo.asked_mps,
                None if self._servo is None else self._servo.state,
                self._trim_mps2,
                self._velocity_s,
            ),
        )


_FLOW_SLOPE = math.tan(math.radians(30.0))
"""Half the view of an optical-flow camera, as a slope."""
_AXIS_STEP_RAD = 0.2
"""Directions of the ship's axis that models are kept for."""
_VIEW_STEP = 0.25
"""Shares of ship in view that models are kept for."""
_STEEPEST_RAD = 1.0
"""A tilt beyond this is none that a vehicle holds its place with."""
_GAP_S = 0.5
"""Where no pose was for longer than this, a leap since the last one is nothing to be doubted for long."""
_TRIM_S = 2.5
"""The mean tilt is of so long: what the servo's integral and its gusts both show in."""
_VELOCITY_EVERY_S = 0.06
"""Its noise is coloured: readings that follow closer tell little more."""


def _finite(pose: BarPose) -> bool:
    return all_finite(pose.position_in_bar_m) and math.isfinite(pose.yaw_rad) and all_finite(pose.covariance)


def _time(telemetry: Telemetry, name: str) -> float:
    """The time of a part of the telemetry; its receipt's where the vehicle does not say."""
    value = getattr(telemetry, name, None)
    return telemetry.t_s if value is None else float(value)
