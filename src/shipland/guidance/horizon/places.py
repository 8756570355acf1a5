"""What pictures show: a position in the axes of the flight, whether its height can be, and the bar's heave."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipland.camera import Camera
from shipland.estimation.delayed import Inputs
from shipland.estimation.heading import Headings
from shipland.estimation.waves import WaveBank, WaveEstimate, WaveMotion, WaveParameters
from shipland.frames import Array, rotated
from shipland.guidance.horizon.parameters import MeasurementNoise
from shipland.guidance.view import View
from shipland.messages import BarPose, Box, GimbalAttitude
from shipland.rig import Rig


@dataclass(frozen=True)
class SeenPlace:
    """Where a picture shows the aircraft.

    Attributes:
        across_m: (2,) from the bar, in the axes of the flight.
        covariance: (2,2) of it.
        down_m: below the bar's centre.
        down_variance: of it.
        by_nose: turned into the axes of the flight by the nose's heading; else by the bar's, or by neither.
    """

    across_m: Array
    covariance: Array
    down_m: float
    down_variance: float
    by_nose: bool = False


class Places:
    """Makes places of poses and boxes, for one camera, cue and ship."""

    def __init__(self, measured: MeasurementNoise, rig: Rig, camera: Camera, camera_in_body_m: Array) -> None:
        self._measured = measured
        self._view = View.of(camera)
        self._camera_in_body_m = np.asarray(camera_in_body_m, dtype=float)
        board_width_m, board_height_m = rig.board_size_m
        self._stern_ratio = rig.platform_width_m / rig.superstructure_height_m
        self._ship_m = math.sqrt(rig.platform_width_m * rig.superstructure_height_m)
        self._ship_below_m = 0.5 * rig.superstructure_height_m - (rig.superstructure_height_m - rig.bar_height_m)
        self._bar_m = math.sqrt(board_width_m * board_height_m)

    def of_pose(self, pose: BarPose, headings: Headings, nose_up_rad: float, speed_mps: float) -> SeenPlace:
        """The place of a pose.

        Args:
            pose: of the camera.
            headings: at the picture.
            nose_up_rad: by the newest attitude.
            speed_mps: of the aircraft against the bar; an error of the picture's time counts by it.
        """
        measured = self._measured
        lever = rotated(self._camera_in_body_m[:2], pose.yaw_rad)
        place_in_bar_m = pose.position_in_bar_m[:2] - lever
        ahead_m, _, below_m = self._camera_in_body_m.tolist()
        camera_below_m = below_m * math.cos(nose_up_rad) - ahead_m * math.sin(nose_up_rad)
        down_m = float(pose.position_in_bar_m[2]) - camera_below_m
        range_m = math.hypot(*place_in_bar_m.tolist())
        floor = (measured.place_m + measured.place_share * range_m) ** 2 + (measured.picture_s * speed_mps) ** 2
        angle_rad, by_nose = headings.bar_rad, 0.0
        # Two ways to turn the place into the axes of the flight: by the bar's heading, or by the nose's and this
        # picture's yaw, whose errors cancel in the bearing of the bar. A slow error of either heading turns place and
        # landing point alike, and is no error of the offset between them.
        x, y = place_in_bar_m.tolist()
        by_yaw = pose.covariance[3].tolist()
        if range_m**2 * (by_yaw[3] + _NOSE_RAD**2) < 2.0 * (x * by_yaw[1] - y * by_yaw[0]):
            angle_rad, by_nose = headings.nose_rad - pose.yaw_rad, 1.0
        cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
        north_m, east_m = cosine * x - sine * y, sine * x + cosine * y
        # Of the place to forward, starboard, down and yaw in the pose.
        jacobian = np.array([[cosine, -sine, 0.0, by_nose * east_m], [sine, cosine, 0.0, -by_nose * north_m]])
        covariance = jacobian @ pose.covariance @ jacobian.T + floor * _EYE
        covariance += (_NOSE_RAD**2) * np.outer(jacobian[:, 3], jacobian[:, 3])
        down_variance = float(pose.covariance[2, 2]) + floor + (ahead_m * _TILT_RAD) ** 2
        return SeenPlace(np.array([north_m, east_m]), covariance, down_m, down_variance, by_nose > 0.0)

    def of_box(self, box: Box, is_bar: bool, gimbal: GimbalAttitude, headings: Headings) -> SeenPlace | None:
        """The place of a box: range from its area, bearing and elevation from its centre; None where it has none.

        Args:
            box: of the ship, or of the bar.
            is_bar: which of them.
            gimbal: of the camera.
            headings: at the picture.
        """
        if not all(map(math.isfinite, (*box.centre_px, *box.size_px))):
            return None
        measured, size_m = self._measured, self._bar_m if is_bar else self._ship_m
        area_px2 = box.area_px2
        if measured.ship_as_stern and not is_bar:
            area_px2 = min(area_px2, self._stern_ratio * box.size_px[1] ** 2)
        range_m = self._view.range_m(max(area_px2, 1.0), size_m)
        right = (box.centre_px[0] - self._view.middle_px[0]) / self._view.focal_px
        elevation_rad = gimbal.pitch_rad - self._view.depression_rad(box.centre_px[1])
        if not (math.isfinite(elevation_rad) and abs(elevation_rad) < _STEEPEST_BOX_RAD):
            return None
        to_target_m = range_m * np.array([1.0, right])
        camera_rad = headings.nose_rad + gimbal.yaw_rad
        along, across = rotated(np.array([1.0, right]), camera_rad), rotated(np.array([-right, 1.0]), camera_rad)
        along_m = 0.5 * measured.area_share * range_m
        across_m = range_m * measured.centre_px / self._view.focal_px + measured.box_m
        across_variance = across_m**2 + range_m**2 * float(headings.covariance[0, 0])
        covariance = measured.repeated * (
            along_m**2 * np.outer(along, along) + across_variance * np.outer(across, across)
        )
        down_m = range_m * math.tan(elevation_rad) + (0.0 if is_bar else self._ship_below_m)
        down_variance = measured.repeated * (across_m**2 + (along_m * math.tan(elevation_rad)) ** 2)
        return SeenPlace(-rotated(to_target_m, camera_rad), covariance, down_m, down_variance)


class HeightGate:
    """Refuses a height that no climb leads to, as of a bar mirrored in a wet deck."""

    def __init__(self, climb_lag_s: float) -> None:
        self._lag_s = climb_lag_s
        self._seen: tuple[float, float, float] | None = None

    def refuses(self, t_s: float, down_m: float, variance: float, climbs: Inputs) -> bool:
        """Whether a height of a picture leaps; one that lasts is accepted after a while.

        Args:
            t_s: of the picture.
            down_m: below the bar.
            variance: of it.
            climbs: downward, as they took effect.
        """
        seen, lag_s = self._seen, self._lag_s
        if seen is not None and seen[0] < t_s < seen[0] + _LEAP_S:
            passed_s = t_s - seen[0]
            moved_m = climbs.mean(seen[0] - lag_s, t_s - lag_s) * passed_s
            most_m = _LEAP_M + _LEAP_MPS * passed_s + _LEAP_SIGMAS * math.sqrt(variance + seen[2])
            if abs(down_m - seen[1] - moved_m) > most_m:
                return True
        self._seen = (t_s, down_m, variance)
        return False


_EYE = np.eye(2)
_NOSE_RAD = 0.003
"""Standard deviation of the nose's heading from picture to picture."""
_TILT_RAD = 0.12
"""Error of the tilt at a picture: read at 5 Hz, and so correlated over pictures that each counts for little."""
_STEEPEST_BOX_RAD = 1.4
"""A box seen more steeply gives no horizontal range."""
_LEAP_M, _LEAP_MPS, _LEAP_SIGMAS = 0.5, 0.2, 4.0
"""Largest change of the height from picture to picture beside the commanded climb."""
_LEAP_S = 5.0
"""After this long a new height is accepted."""


class HeaveTracker:
    """The hypotheses of the bar's wave motion, and the one in use.

    Args:
        parameters: of the hypotheses.
        climb_lag_s: of the vehicle's climb rate.
        velocity_std_mps: standard deviation of its vertical velocity.
        low_m: below the bar; lower than this, ground effect and contact disturb the height.
    """

    def __init__(self, parameters: WaveParameters, climb_lag_s: float, velocity_std_mps: float, low_m: float) -> None:
        self._parameters, self._bank = parameters, WaveBank(parameters)
        self._climb_lag_s, self._velocity_std_mps, self._low_m = climb_lag_s, velocity_std_mps, low_m
        self._estimate: WaveEstimate | None = None
        self._velocity: tuple[float, float] | None = None

    @property
    def wave(self) -> WaveMotion:
        """The wave motion in use."""
        chosen = self._parameters.first if self._estimate is None else self._estimate.chosen
        return self._parameters.believed[chosen]

    def update_velocity(self, t_s: float, down_mps: float, picture_s: float) -> None:
        """The vehicle's vertical velocity, true at `t_s`: the first one after each picture, exposed at `picture_s`."""
        if self._velocity is None or picture_s > self._velocity[0]:
            self._velocity = t_s, down_mps

    def update_pose(self, t_s: float, down_m: float, variance_m2: float, climbs: Inputs, wind_mps2: float) -> None:
        """A picture's height below the bar; `climbs` downward, as they took effect; the mean wind's acceleration."""
        before, lag_s = self._estimate, self._climb_lag_s
        if down_m > self._low_m:
            return
        if before is None:
            self._estimate = self._bank.start(t_s, down_m)
            return
        if self._velocity is not None and self._velocity[0] <= t_s:
            velocity_s, down_mps = self._velocity
            asked_mps = climbs.mean(velocity_s - lag_s, velocity_s - lag_s)
            before = self._bank.update_velocity(before, down_mps - asked_mps, self._velocity_std_mps)
            self._velocity = None
        moved_m = climbs.mean(before.t_s - lag_s, t_s - lag_s) * max(t_s - before.t_s, 0.0)
        self._estimate = self._bank.update_pose(before, t_s, moved_m, down_m, variance_m2, wind_mps2)
