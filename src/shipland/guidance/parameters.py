"""The sections of `[guidance]`."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.config import require, require_within
from shipland.guidance.far import FarBaselines, FarKind, FarParameters
from shipland.guidance.horizon.learned import LearnedParameters
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.laws import FarVariant
from shipland.guidance.modes import ModeParameters
from shipland.guidance.near import NearParameters
from shipland.guidance.search import SearchParameters
from shipland.guidance.simc import NearBaselines


@dataclass(frozen=True)
class ApproachParameters:
    """`[guidance.approach]`: reference points, and the condition of landing.

    Attributes:
        hover_height_m: over the deck's neutral surface, before landing.
        square_margin: landing begins with the horizontal error within this share of half of `rig.landing_square_m`.
        largest_box: boxes of more than this many times the setpoint's area are ignored.
        max_bearing_deg: the nose turns to the bar's axis only as far as the bar stays this near the picture's middle,
        bearing_margin_deg: and the cue this far from its sides.
        max_height_error_m, max_speed_mps, max_yaw_error_deg, max_data_age_s: of the landing condition.
        descent_percent: heave stick while landing.
        gate_m, gate_s: above commit height the descent waits while the horizontal error, predicted for `gate_s` later
            at its present rate, is larger than `gate_m`.
        commit_height_m: below this height over the neutral deck the landing is no longer broken off.
        abort_offset_m: horizontal error that breaks off a landing.
        go_around_radius_m: nearer than this to the bar, loss of vision means go-around.
        go_around_back_m, go_around_height_m: astern of and over the deck's centre, where a go-around ends.
        go_around_percent, back_off_percent: sticks of a go-around.
        go_around_turn: yaw stick for a degree between the nose and where the target was seen last [%/deg].
        go_around_s: shortest go-around.
        gimbal_time_constant_s: smoothing of the camera pitch that keeps the target in the picture.
    """

    hover_height_m: float
    square_margin: float
    largest_box: float
    max_bearing_deg: float
    bearing_margin_deg: float
    max_height_error_m: float
    max_speed_mps: float
    max_yaw_error_deg: float
    max_data_age_s: float
    descent_percent: float
    gate_m: float
    gate_s: float
    commit_height_m: float
    abort_offset_m: float
    go_around_radius_m: float
    go_around_back_m: float
    go_around_height_m: float
    go_around_percent: float
    back_off_percent: float
    go_around_turn: float
    go_around_s: float
    gimbal_time_constant_s: float

    def __post_init__(self) -> None:
        require(self.hover_height_m > self.commit_height_m > 0.0, "hover_height_m > commit_height_m > 0 must hold")
        require_within(
            self,
            hover_height_m=(0.1, 50.0),
            max_height_error_m=(0.01, 10.0),
            max_speed_mps=(0.01, 5.0),
            max_yaw_error_deg=(0.5, 45.0),
            max_data_age_s=(0.05, 3.0),
            gate_m=(0.01, 5.0),
            abort_offset_m=(0.05, 20.0),
            go_around_radius_m=(1.0, 1000.0),
            go_around_height_m=(0.5, 100.0),
            go_around_percent=(10.0, 100.0),
            go_around_s=(0.5, 60.0),
        )
        require(0.0 < self.square_margin <= 1.0, "square_margin must be in (0, 1]")
        require(0.0 < self.descent_percent <= 100.0, "descent_percent must be in (0, 100]")


@dataclass(frozen=True)
class GuidanceParameters:
    """`[guidance]`."""

    near: NearParameters
    horizon: HorizonParameters
    learned: LearnedParameters
    ship: FarParameters
    bar: FarParameters
    far_control: FarKind
    far_variant: FarVariant
    far_baselines: FarBaselines
    near_baselines: NearBaselines
    modes: ModeParameters
    approach: ApproachParameters
    search: SearchParameters
