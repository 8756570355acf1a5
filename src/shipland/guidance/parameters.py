"""The sections of `[guidance]`."""

from __future__ import annotations

from typing import Literal

from shipland.config import key, parameters, require, scaled
from shipland.guidance.far import FarBaselines, FarKind, FarParameters
from shipland.guidance.horizon.learned import LearnedParameters
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.laws import FarGains, FarVariant
from shipland.guidance.modes import ModeParameters
from shipland.guidance.near import NearParameters
from shipland.guidance.rivals.parameters import (
    DeckFollowingParameters,
    ImageServoingParameters,
    SpectralMpcParameters,
    VelocityMatchingParameters,
)
from shipland.guidance.search import SearchParameters
from shipland.guidance.simc import NearBaselines

LandingRule = Literal["steady", "printed"]


@parameters
class ApproachParameters:
    """`[guidance.approach]`: reference points, and the condition of landing."""

    landing_rule: LandingRule = key(
        "steady",
        "when `paper`, `p` and `pid` land. `printed`: as soon as a picture puts the aircraft inside "
        "`rig.landing_square_m`, at any height, speed and heading, and nothing but the safety breaks it off",
        "steady: ours | printed: [Lee2022, §Tracking Capability and Landing Accuracy]",
    )

    hover_height_m: float = scaled(
        1.2, "over the neutral deck, before landing", "chosen: heave limit, a corner at full pitch", ge=0.1, le=50
    )
    square_margin: float = key(
        0.6, "of half of `rig.landing_square_m` to begin", "chosen: 7 cm of drift in the descent", gt=0, le=1
    )
    largest_box: float = key(
        4.0, "larger boxes are ignored, in setpoint areas", "chosen: 5 m to the bar and 12 m to the ship"
    )
    max_bearing_deg: float = key(
        20.0, "the bar stays this near the picture's middle", "chosen: of the 34.5 deg either side"
    )
    bearing_margin_deg: float = key(3.0, "and the cue this far from its sides")
    max_height_error_m: float = scaled(0.25, "of the landing condition", ge=0.01, le=10)
    max_speed_mps: float = scaled(0.15, "of the landing condition", ge=0.01, le=5)
    max_yaw_error_deg: float = key(6.0, "of the landing condition", ge=0.5, le=45)
    max_data_age_s: float = key(0.6, "of the landing condition", ge=0.05, le=3)
    descent_percent: float = key(50.0, "heave stick while landing", gt=0, le=100)
    gate_m: float = key(
        0.12, "above commit height the descent waits while the predicted horizontal error is larger", ge=0.01, le=5
    )
    gate_s: float = key(0.5, "how far ahead that error is predicted")
    commit_height_m: float = scaled(
        0.7, "below this height over the neutral deck the landing is no longer broken off", gt=0
    )
    abort_offset_m: float = scaled(0.35, "horizontal error that breaks off a landing", ge=0.05, le=20)
    go_around_radius_m: float = scaled(
        15.0, "nearer than this to the bar, loss of vision means go-around", ge=1, le=1000
    )
    go_around_back_m: float = scaled(4.0, "astern of the deck's centre, where a go-around ends")
    go_around_height_m: float = scaled(2.5, "over the deck's centre, where a go-around ends", ge=0.5, le=100)
    go_around_percent: float = key(60.0, "heave stick of a go-around", ge=10, le=100)
    back_off_percent: float = key(15.0, "pitch stick of a go-around")
    go_around_turn: float = key(
        0.75, "yaw stick for a degree off the last bearing [%/deg]", "chosen: 45 deg turn at 13 deg/s"
    )
    go_around_s: float = scaled(3.0, "shortest go-around", ge=0.5, le=60)
    gimbal_time_constant_s: float = key(0.3, "smoothing of the camera pitch that keeps the target in the picture")

    def __post_init__(self) -> None:
        require(self.hover_height_m > self.commit_height_m > 0.0, "hover_height_m > commit_height_m > 0 must hold")

    @property
    def at_once(self) -> bool:
        """Whether a landing waits for nothing but its square and is not broken off: the printed rule."""
        return self.landing_rule == "printed"


@parameters
class GuidanceParameters:
    """`[guidance]`."""

    near: NearParameters = NearParameters()
    horizon: HorizonParameters = HorizonParameters()
    learned: LearnedParameters = LearnedParameters()
    ship: FarParameters = key(
        FarParameters(
            FarGains(0.008, 0.0, 5000.0, 0.0), FarGains(1.2, 0.0158, 640.0, 1.0), FarGains(3.0, 0.0108, 360.0, 1.0)
        ),
        source="[Lee2022, Table 1]; px², px",
    )
    bar: FarParameters = key(
        FarParameters(
            FarGains(0.004, 0.0, 3400.0, 0.0), FarGains(1.0, 0.0158, 640.0, 1.0), FarGains(5.0, 0.0108, 360.0, 1.0)
        ),
        source="[Lee2022, Table 1]; px², px",
    )
    length_scale: float = key(1.0, "of the ship against the rig: defaults of pilot and safety follow", gt=0, le=100)
    far_control: FarKind = key(
        "exponential", "", "exponential: [Lee2022, Eq. 3] | p | pid: the linear laws it is compared with"
    )
    far_variant: FarVariant = key(
        "saturating", "", "the better of the two symmetric readings of erratum 3: docs/results/paper.md"
    )
    far_baselines: FarBaselines = FarBaselines()
    near_baselines: NearBaselines = NearBaselines()
    velocity_matching: VelocityMatchingParameters = VelocityMatchingParameters()
    image_servoing: ImageServoingParameters = ImageServoingParameters()
    spectral_mpc: SpectralMpcParameters = SpectralMpcParameters()
    deck_following: DeckFollowingParameters = DeckFollowingParameters()
    modes: ModeParameters = ModeParameters()
    approach: ApproachParameters = ApproachParameters()
    search: SearchParameters = SearchParameters()
