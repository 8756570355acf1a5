"""`[guidance.horizon]`: sizes of what is unknown, weights, references, descent."""

from __future__ import annotations

import math
from dataclasses import replace

from shipland.config import key, parameters, require, scaled
from shipland.estimation.banks import GainParameters, LatencyParameters
from shipland.estimation.delayed import DelayedParameters
from shipland.estimation.heading import HeadingNoise
from shipland.estimation.relative_state import Disturbances
from shipland.estimation.waves import WaveParameters
from shipland.frames import GRAVITY_MPS2
from shipland.guidance.response import Response


@parameters
class MeasurementNoise:
    """`[guidance.horizon.measured]`: least errors of what is measured."""

    place_m: float = scaled(0.002, "of a pose's place")
    place_share: float = key(0.001, "growth of a pose's error with range")
    picture_s: float = key(0.005, "jitter of a picture's time; counts by the speed")
    area_share: float = key(0.3, "of a box's area")
    centre_px: float = key(2.0, "of a box's centre")
    repeated: float = key(10.0, "boxes err alike in many frames; their variance counts so many times")
    ship_as_stern: bool = key(False, "a ship's box counts as no wider than a stern of its height: long hulls are wide")
    box_m: float = scaled(0.3, "least error of a box's place across the line of sight, and of its height")
    first_mps: float = scaled(1.5, "standard deviation of the speed against the bar when it is first seen")
    first_way_mps: float = key(2.0, "of the ship's speed, where it is first seen as a box", "chosen: ships to 4.5 m/s")
    first_climb_mps: float = scaled(0.5, "standard deviation of the climb when the bar is first seen")
    lost_refusals: int = key(10, "so many positions rejected in a row restart the estimate")
    lost_s: float = key(
        5.0, "in a landing with poses, only so long after one was accepted", "chosen: as long as leaps are refused"
    )
    velocity_mps: float = scaled(0.1, "of the vehicle's velocity, horizontally")
    velocity_down_mps: float = scaled(0.04, "of the vehicle's velocity, downward")
    velocity_tracked_mps: float = scaled(
        0.04, "horizontally, of one that the autopilot itself tracks: its errors are flown"
    )
    use_velocity: bool = key(True, "whether it is used at all")


@parameters
class Weights:
    """`[guidance.horizon.weights]`: costs against a squared metre."""

    speed: float = scaled(0.01, "of a squared metre per second against the bar [s²]", power=1.0, ge=0)
    acceleration: float = scaled(0.0015, "of the aircraft's own, squared [s⁴]", power=2.0, ge=0)
    input_rate: float = scaled(
        3e-6, "of the rate of the input asked for, squared [s⁶ for tilts, s⁴ for speeds]", power=3.0, gt=0
    )
    final_place: float = key(1.0, "on place at contact, where the time to it is known", ge=0)
    final_speed: float = key(0.1, "on speed at contact", ge=0)
    horizon_s: float = scaled(2.0, "longest time to contact that gains are kept for", ge=0)


@parameters
class Margins:
    """`[guidance.horizon.margins]`: lengths that scale with the ship's size and the aircraft's stopping distance."""

    gentle_m: float = scaled(1.5, "farther than this from the landing point the gentle gains fly")
    on_axis_m: float = scaled(0.5, "this near to the bar's axis the aircraft is lined up")
    above_path_m: float = scaled(1.0, "this much above the glide path counts as on it")
    overhead_m: float = scaled(2.0, "within this distance of the landing point the height wanted is that of the hover")
    low_m: float = scaled(0.5, "lower over the deck than this, heights do not tell the bar's heave")
    committed_m: float = scaled(0.35, "lower over the deck than this a landing is no longer broken off")
    clear_ahead_m: float = scaled(1.0, "a go-around has ended this near to its end, horizontally")
    clear_below_m: float = scaled(0.5, "and this little below it")


@parameters
class PathParameters:
    """`[guidance.horizon.path]`: references and heights."""

    near_mps: float = scaled(1.2, "speed of the approach to the hover")
    near_brake_mps2: float = scaled(0.4, "deceleration of the approach to the hover")
    far_mps: float = scaled(6.0, "speed of the approach on boxes")
    far_brake_mps2: float = scaled(0.5, "deceleration of the approach on boxes")
    near_m: float = scaled(12.0, "nearer than this to the bar the pace is that of the approach")
    acceleration_mps2: float = key(0.8, "of every reference")
    closing_per_s: float = scaled(0.7, "of every reference")
    tracking_error_max_m: float = scaled(0.6, "of every reference")
    tracking_error_max_mps: float = scaled(1.0, "of every reference")
    stand_off_m: float = scaled(12.0, "of the point flown to while the bar's heading is not known")
    round_after_s: float = key(20.0, "after this wait near the stand-off point the aircraft flies around the bar")
    round_lead_deg: float = key(30.0, "how far ahead around the bar it flies")
    line_up: float = key(1.0, "metres astern of the hover point for a metre to its side")
    far_above_m: float = scaled(2.0, "height over the bar's centre far away")
    glide_path_deg: float = key(15.0, "steepest way down to the hover")
    climb_per_s: float = scaled(2.0, "gain of the height loop")
    climb_mps: float = scaled(0.8, "fastest climb of the height loop")
    turn_per_s: float = scaled(0.8, "of the heading loop")


@parameters
class DescentParameters:
    """`[guidance.horizon.descent]`."""

    sink_mps: float = scaled(0.5, "speed of the descent to `wait_height_m`", ge=0.01, le=5)
    wait_height_m: float = scaled(
        0.22, "over the deck as the bar shows it, of the aircraft's centre; 0 descends without waiting", ge=0
    )
    wait_band_m: float = scaled(0.1, "within this height above it the sink has ended", ge=0)
    slow_per_s: float = key(1.5, "the sink slows towards it at this rate and does not overshoot", ge=0)
    rise_offset_m: float = scaled(0.25, "it rises again while the offset is larger", ge=0)
    final_descent_mps: float = scaled(1.0, "speed of the final descent", ge=0.01, le=5)
    sink_max_mps: float = key(1.5, "a harder contact is no landing", gt=0)
    sink_std_mps: float = key(0.3, "standard deviation of what deck and gusts add to the sink at contact", gt=0)
    odds_min: float = key(
        0.2, "with lower odds a landing does not begin, and is broken off where they stay below", ge=0, le=1
    )
    wait_cost: float = key(
        0.003, "landings that it costs to wait for another moment; large: any moment will do", ge=0, le=1
    )
    touch_m: float = scaled(0.02, "this much left to contact counts as a touch", ge=0)
    contact_height_m: float = key(0.08, "of the centre as the lowest foot touches", "chosen: tilted by 20°", ge=0)


@parameters
class LevellingParameters:
    """`[guidance.horizon.levelling]`."""

    tilt_deg: float = key(
        10.0, "a tilt that may stay at contact", "the deck's roll comes on top, and 25° are allowed", ge=0, lt=90
    )
    lags: float = key(1.5, "the command is level this many of the vehicle's lags before contact", ge=0)
    tilt_max_deg: float = key(25.0, "a larger tilt against the deck is no landing", gt=0, lt=90)
    tilt_std_deg: float = key(5.0, "standard deviation of what deck and gusts add to the tilt", gt=0, lt=90)

    @property
    def tilt_mps2(self) -> float:
        """The acceleration of a tilt that may stay."""
        return GRAVITY_MPS2 * math.tan(math.radians(self.tilt_deg))

    def before_contact_s(self, response: Response) -> float:
        """So long before contact the command has to be level."""
        return self.lags * (response.lag_s + response.smoothing_s)


@parameters
class HorizonParameters:
    """`[guidance.horizon]`.

    All chosen: docs/explanation/pilots-cycle.md says how.
    """

    land_offset_m: float = scaled(0.2, "largest offset to begin a landing, held for `guidance.modes.settle_s`", gt=0)
    abort_offset_m: float = scaled(0.6, "a landing is broken off with more", ge=0.05, le=20)
    position_std_max_m: float = key(1.0, "without pictures the estimate is flown on up to this", ge=0.05, le=20)
    gust_share: float = key(0.2, "acceleration by gusts as a share of the mean wind's over land")
    gust_share_at_sea: float = key(0.12, "likewise over the sea")
    gust_levels_mps2: tuple[float, ...] = key(
        (0.1, 0.14, 0.2, 0.28, 0.4, 0.57, 0.8, 1.13, 1.6), "ascending, in equal ratios"
    )
    horizontal: Disturbances = key(Disturbances(), "what is not known along a horizontal axis where sticks mean a tilt")
    horizontal_servo: Disturbances = key(
        Disturbances(gust_mps2=0.2, gust_time_s=2.0, wind_mps2=0.2, wind_time_s=60.0, speed_noise=0.015),
        "likewise of one that tracks a velocity: its autopilot trims the mean wind away",
    )
    vertical: Disturbances = key(
        Disturbances(
            gust_mps2=0.1,
            gust_time_s=0.4,
            wind_mps2=0.05,
            wind_time_s=20.0,
            velocity_bias_mps=0.1,
            velocity_bias_time_s=60.0,
            speed_noise=0.002,
        ),
        "what is not known downward",
    )
    heading: HeadingNoise = key(HeadingNoise(), "of a ship that keeps its course")
    heading_turning: HeadingNoise = key(
        HeadingNoise(bar_rad_per_sqrt_s=0.01, turn_rad_s2=0.1, compass_rad=0.03), "of a ship that turns"
    )
    turn_from_rad_s: float = scaled(0.1, "yaw rate of the ship from which `heading_turning` holds")
    course_time_s: float = scaled(10.0, "in which the velocity of a ship changes whose heading is not seen")
    measured: MeasurementNoise = MeasurementNoise()
    delayed: DelayedParameters = DelayedParameters()
    latency: LatencyParameters = LatencyParameters()
    gain: GainParameters = GainParameters()
    wave: WaveParameters = WaveParameters()
    weights: Weights = key(Weights(), "with the vehicle's velocity, where sticks mean a tilt")
    weights_servo: Weights = key(
        Weights(acceleration=0.006, input_rate=1e-5),
        "likewise of one that tracks a velocity: lighter ones are undamped by a delay of one picture",
        "measured: docs/results/guidance.md",
    )
    weights_blind: Weights = key(
        Weights(speed=0.025, acceleration=0.004, input_rate=0.0001), "without the vehicle's velocity"
    )
    margins: Margins = Margins()
    path: PathParameters = PathParameters()
    descent: DescentParameters = DescentParameters()
    levelling: LevellingParameters = LevellingParameters()

    def __post_init__(self) -> None:
        require(self.abort_offset_m > self.land_offset_m, "abort_offset_m must be above land_offset_m")
        require(len(self.gust_levels_mps2) >= 2, "gust_levels_mps2 needs two levels or more")

    def horizontal_at(self, gust_mps2: float) -> Disturbances:
        """Horizontal disturbances at a level of gusts, where sticks mean a tilt."""
        share = gust_mps2 / self.horizontal.gust_mps2
        noise = self.horizontal.speed_noise * share**2
        return replace(self.horizontal, gust_mps2=gust_mps2, speed_noise=noise)

    def horizontal_servo_at(self, gust_mps2: float) -> Disturbances:
        """Horizontal disturbances at a level of gusts, of a servo; its own fluctuations remain in still air."""
        servo = self.horizontal_servo
        gust_mps2 = max(servo.gust_mps2, 1.2 * gust_mps2)
        return replace(servo, gust_mps2=gust_mps2, speed_noise=max(servo.speed_noise, 0.03 * gust_mps2**2))

    def vertical_at(self, gust_mps2: float) -> Disturbances:
        """Vertical disturbances at a level of horizontal gusts."""
        gust_mps2 = max(self.vertical.gust_mps2, 0.9 * gust_mps2)
        noise = min(max(0.03 * gust_mps2**2, self.vertical.speed_noise), 0.02)
        return replace(self.vertical, gust_mps2=gust_mps2, speed_noise=noise)
