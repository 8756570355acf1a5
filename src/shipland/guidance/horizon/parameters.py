"""`[guidance.horizon]`: sizes of what is unknown, weights, references, descent."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from shipland.config import require, require_within
from shipland.estimation.delayed import DelayedParameters
from shipland.estimation.gain import GainParameters
from shipland.estimation.heading import HeadingNoise
from shipland.estimation.latency import LatencyParameters
from shipland.estimation.relative_state import Disturbances
from shipland.estimation.wave_bank import WaveParameters
from shipland.guidance.horizon.gains import Weights
from shipland.guidance.horizon.levelling import LevellingParameters


@dataclass(frozen=True)
class MeasurementNoise:
    """`[guidance.horizon.measured]`: least errors of what is measured.

    Attributes:
        place_m, place_share: of a pose's place, and what grows with range.
        picture_s: jitter of a picture's time; counts by the speed.
        area_share, centre_px: of a box's area and centre.
        repeated: boxes err alike in many frames; their variance counts so many times.
        ship_as_stern: for its range a ship's box counts as no wider than a stern of its height: from the quarter a long
            hull is wide.
        box_m: least error of a box's place across the line of sight, and of its height.
        first_mps, first_climb_mps: standard deviation of the speed against the bar when it is first seen.
        first_way_mps: of the ship's speed, where it is first seen as a box.
        lost_refusals, lost_s: this many positions rejected in a row restart the estimate; in a landing, if poses were
            seen all the while, only this long after one that was accepted.
        velocity_mps, velocity_down_mps: of the vehicle's velocity, horizontally and downward.
        velocity_tracked_mps: horizontally, of one that the autopilot itself tracks: its errors are flown.
        use_velocity: whether it is used at all.
        flow: it comes from optical flow, and is relative to the ship where the ship is below.
    """

    place_m: float
    place_share: float
    picture_s: float
    area_share: float
    centre_px: float
    repeated: float
    ship_as_stern: bool
    box_m: float
    first_mps: float
    first_way_mps: float
    first_climb_mps: float
    lost_refusals: int
    lost_s: float
    velocity_mps: float
    velocity_down_mps: float
    velocity_tracked_mps: float
    use_velocity: bool
    flow: bool


@dataclass(frozen=True)
class Margins:
    """`[guidance.horizon.margins]`: lengths that scale with the ship's size and the aircraft's stopping distance.

    Attributes:
        gentle_m: farther than this from the landing point the gentle gains fly.
        on_axis_m: this near to the bar's axis the aircraft is lined up.
        above_path_m: this much above the glide path counts as on it.
        overhead_m: within this distance of the landing point the height wanted is that of the hover.
        low_m: lower over the deck than this, heights do not tell the bar's heave.
        committed_m: lower over the deck than this a landing is no longer broken off.
        clear_ahead_m, clear_below_m: a go-around has ended this near to its end.
    """

    gentle_m: float
    on_axis_m: float
    above_path_m: float
    overhead_m: float
    low_m: float
    committed_m: float
    clear_ahead_m: float
    clear_below_m: float


@dataclass(frozen=True)
class PathParameters:
    """`[guidance.horizon.path]`: references and heights.

    Attributes:
        near_mps, near_brake_mps2: pace of the approach to the hover.
        far_mps, far_brake_mps2: pace of the approach on boxes.
        near_m: nearer than this to the bar the pace is that of the approach.
        acceleration_mps2, closing_per_s, tracking_error_max_m, tracking_error_max_mps: of every reference.
        stand_off_m: of the point flown to while the bar's heading is not known.
        round_after_s, round_lead_deg: after this wait near it the aircraft flies around the bar, this far ahead.
        line_up: metres astern of the hover point for a metre to its side.
        far_above_m, glide_path_deg: height over the bar's centre far away, and the steepest way to it.
        climb_per_s, climb_mps: of the height loop.
        turn_per_s: of the heading loop.
    """

    near_mps: float
    near_brake_mps2: float
    far_mps: float
    far_brake_mps2: float
    near_m: float
    acceleration_mps2: float
    closing_per_s: float
    tracking_error_max_m: float
    tracking_error_max_mps: float
    stand_off_m: float
    round_after_s: float
    round_lead_deg: float
    line_up: float
    far_above_m: float
    glide_path_deg: float
    climb_per_s: float
    climb_mps: float
    turn_per_s: float


@dataclass(frozen=True)
class DescentParameters:
    """`[guidance.horizon.descent]`.

    Attributes:
        sink_mps: speed of the descent to `wait_height_m`.
        wait_height_m: over the neutral deck, of the aircraft's centre; 0 descends without waiting.
        wait_band_m: within this height above it the sink has ended.
        slow_per_s: the sink slows towards it at this rate, so that the aircraft does not overshoot.
        pause_m: the sink pauses while the offset is larger.
        final_descent_mps: speed of the final descent.
        final_descent_offset_m: predicted offset at contact at which the final descent begins.
        relax_after_s, relax_per_s: after this wait the allowed offset grows by this share a second.
        contact_height_m: of the aircraft's centre when its lowest foot touches the neutral deck.
        deck_watch_height_m: over the neutral deck, during the deck watch.
        deck_watch_offset_m: predicted offset from the deck's centre at contact at which the deck watch ends.
        deck_watch_max_s: longest deck watch; then the landing goes on as with `moment = "any"`.
        reacquire_s: from the last look down to the final descent: the camera looks up and poses correct the position.
        reacquire_max_s: the final descent begins by then, or the deck watch begins again.
        reacquire_offset_m: predicted offset from the deck's centre at contact at which the final descent begins.
    """

    sink_mps: float
    wait_height_m: float
    wait_band_m: float
    slow_per_s: float
    pause_m: float
    final_descent_mps: float
    final_descent_offset_m: float
    relax_after_s: float
    relax_per_s: float
    contact_height_m: float
    deck_watch_height_m: float
    deck_watch_offset_m: float
    deck_watch_max_s: float
    reacquire_s: float
    reacquire_max_s: float
    reacquire_offset_m: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            require(value >= 0.0, f"{name} must not be negative, got {value}")
        require_within(self, sink_mps=(0.01, 5.0), final_descent_mps=(0.01, 5.0))


@dataclass(frozen=True)
class HorizonParameters:
    """`[guidance.horizon]`.

    Attributes:
        moment: the final descent begins at any time, or in a lull of the bar's own motion, or when the deck, which the
            camera watches, will be below the aircraft at contact.
        lull_mps: what counts as a lull.
        look_down_max_s: longest look down at the deck; then the camera looks up at the bar.
        look_up_s: time with poses before it looks down again.
        deck_rise_max_mps: the final descent does not begin where the deck will rise faster than this at contact.
        deck_std_max_m: the deck's centre at contact is known when it is no more uncertain (standard deviation).
        land_offset_m: a landing may begin with at most this offset (held for `guidance.modes.settle_s`).
        abort_offset_m: a landing is broken off with more.
        horizontal, vertical: what is not known along an axis of a vehicle whose sticks mean a tilt, and downward.
        horizontal_servo: likewise of one that tracks a velocity: its autopilot trims the mean wind away.
        gust_share, gust_share_at_sea: acceleration by gusts as a share of that by the mean wind, over land and over
            the sea, where the bar moves; rounded to one of the levels.
        gust_levels_mps2: ascending, in equal ratios.
        heading, heading_turning: of a ship that keeps its course, and of one that turns.
        turn_from_rad_s: yaw rate of the ship from which `heading_turning` holds.
        position_std_max_m: without pictures the estimate is flown on up to this standard deviation of the position.
        contact_std_max_m: a landing does not begin while the offset at contact is uncertain by more (standard
            deviation).
    """

    moment: Literal["any", "lull", "deck"]
    lull_mps: float
    look_down_max_s: float
    look_up_s: float
    deck_rise_max_mps: float
    deck_std_max_m: float
    land_offset_m: float
    abort_offset_m: float
    contact_std_max_m: float
    position_std_max_m: float
    gust_share: float
    gust_share_at_sea: float
    gust_levels_mps2: tuple[float, ...]
    horizontal: Disturbances
    horizontal_servo: Disturbances
    vertical: Disturbances
    heading: HeadingNoise
    heading_turning: HeadingNoise
    turn_from_rad_s: float
    measured: MeasurementNoise
    delayed: DelayedParameters
    latency: LatencyParameters
    gain: GainParameters
    wave: WaveParameters
    weights: Weights
    weights_blind: Weights
    margins: Margins
    path: PathParameters
    descent: DescentParameters
    levelling: LevellingParameters

    def __post_init__(self) -> None:
        require(self.land_offset_m > 0.0, "land_offset_m must be positive")
        limits_m = {
            "abort_offset_m": (0.05, 20.0),
            "contact_std_max_m": (0.01, 5.0),
            "position_std_max_m": (0.05, 20.0),
        }
        require_within(self, **limits_m, deck_std_max_m=(0.005, 5.0))
        require(self.abort_offset_m > self.land_offset_m, "abort_offset_m must be above land_offset_m")

    def horizontal_at(self, gust_mps2: float) -> Disturbances:
        """The horizontal disturbances at one level of gusts; the acceleration without memory goes with them."""
        share = gust_mps2 / self.horizontal.gust_mps2
        noise = self.horizontal.speed_noise * share**2
        return replace(self.horizontal, gust_mps2=gust_mps2, speed_noise=noise)
