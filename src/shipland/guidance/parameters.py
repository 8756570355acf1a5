"""The sections of `[guidance]`."""

from __future__ import annotations

from typing import Literal

from shipland.config import key, parameters, require, scaled
from shipland.guidance.horizon.parameters import HorizonParameters

FarKind = Literal["exponential", "p", "pid"]
LandingRule = Literal["steady", "printed"]
FarVariant = Literal["printed", "growing", "saturating"]
DerivativeVariant = Literal["probabilistic", "printed", "linear"]
FilterKind = Literal["kalman", "none"]


@parameters
class FarGains:
    """Constants of one axis of Eq. 3 [Lee2022, Table 1]; `setpoint` in px² (pitch) or px (roll, heave)."""

    m: float = key(..., ge=0)
    a: float = key(..., ge=0)
    setpoint: float = key(...)
    d: float = key(...)

    def __post_init__(self) -> None:
        require(self.d in (0.0, 1.0), "d must be 0 (linear) or 1 (exponential)")


@parameters
class NearGains:
    """Constants of one axis of Eq. 4–5 [Lee2022, Table 2]; errors in m (or degrees for yaw), output in percent."""

    k_p: float = key(..., "percent per unit")
    k_i: float = key(..., "percent per unit·s")
    b: float = key(..., "largest derivative gain, percent per unit/s")
    mu: float = key(..., "mean of the error's step in 0.03 s")
    sigma: float = key(..., "width of the error's step in 0.03 s", gt=0)
    integral_band: float = key(
        ..., "the sum runs only while |error| is below this; huge: the printed sum, 0: no integral", ge=0
    )
    error_limit: float = key(..., "the proportional term sees no larger error; huge: the printed law", gt=0)


@parameters
class PidGains:
    """A linear PID in its standard form: `k_p·(e + ∫e dt / t_i_s + t_d_s·de/dt)`; k_p in percent per unit."""

    k_p: float = key(..., ge=0)
    t_i_s: float = key(..., gt=0, allow_inf_nan=True)
    t_d_s: float = key(..., ge=0)


@parameters
class FarParameters:
    """`[guidance.ship]`, `[guidance.bar]`: Table 1 for one target, in pixels of the published camera."""

    pitch: FarGains
    roll: FarGains
    heave: FarGains


@parameters
class NearParameters:
    """`[guidance.near]`: Table 2 and the filter before it.

    Source of the gains: [Lee2022, Table 2]; percent, m, degrees, s.
    """

    pitch: NearGains = key(
        NearGains(k_p=7.5, k_i=0.05, b=4.5, mu=0.02, sigma=0.04, integral_band=1.0, error_limit=1.5),
        "in m and percent",
        "bands and limits are chosen",
    )
    roll: NearGains = key(
        NearGains(k_p=7.5, k_i=0.01, b=8.5, mu=0.0, sigma=0.04, integral_band=1.0, error_limit=1.5),
        "in m and percent",
        "bands and limits are chosen",
    )
    heave: NearGains = key(
        NearGains(k_p=15.0, k_i=0.01, b=7.0, mu=0.0, sigma=0.02, integral_band=1.0, error_limit=10.0),
        "in m and percent",
        "bands and limits are chosen",
    )
    yaw: NearGains = key(
        NearGains(k_p=5.5, k_i=0.05, b=1.75, mu=0.0, sigma=5.0, integral_band=10.0, error_limit=180.0),
        "in degrees and percent",
        "bands and limits are chosen",
    )
    derivative: DerivativeVariant = key(
        "probabilistic", "variant of K_D", "probabilistic: Eq. 5, erratum 8 | printed | linear: a baseline of [Lee2022]"
    )
    filter: FilterKind = key("kalman", "one-state filters of the errors", "kalman | none: a baseline of [Lee2022]")
    process_noise: float = key(
        0.005, "of the one-state Kalman filters, per 0.03 s", "[Lee2022, §Pose Estimation], erratum 1"
    )
    measurement_noise: float = key(0.05, "likewise", "[Lee2022, §Pose Estimation], erratum 1")


@parameters
class FarBaselines:
    """`[guidance.far_baselines]`: the linear laws that the far law is compared with, in roll and heave.

    [Lee2022, §Long-range Tracking Controller] has linear laws without gains.
    """

    match_px: float = key(
        100.0, "P and the exponential law give the same stick at this error", "chosen: near full stick", gt=0
    )
    roll: PidGains = key(
        PidGains(0.75, 6.0, 1.5), "linear PID, percent per px, s", "Ziegler and Nichols at 100 m: docs/results/paper.md"
    )
    heave: PidGains = key(PidGains(7.8, 2.75, 0.69), "likewise", "likewise")


@parameters
class NearBaselines:
    """`[guidance.near_baselines]`: the linear near laws that the other pilots are compared with.

    By SIMC (Skogestad 2003): docs/explanation/published-pilot.md.
    """

    closed_loop: float = key(1.0, "time constant, as a multiple of the dead time", "Skogestad: fast and robust", gt=0)
    rate_filter: float = key(
        0.33, "of the measured rate, likewise", "chosen: the smoothing of the published pilot's", gt=0
    )


@parameters
class ModeParameters:
    """`[guidance.modes]`."""

    dwell_s: float = key(1.0, "shortest stay in a mode", ge=0)
    confirm_s: float = key(0.2, "a better mode begins when its evidence has lasted this long", ge=0)
    lost_s: float = key(0.5, "corners not renewed for this long are gone", ge=0, le=5)
    lost_box_s: float = key(
        1.6, "likewise a detector's box", "three cycles of the paper's learned detector", ge=0, le=10
    )
    memory_s: float = scaled(3.0, "mode 5 flies on the data fed before for this long", ge=0, le=30)
    settle_s: float = key(0.5, "the landing condition must have held this long", ge=0)
    blind_landing_s: float = key(1.5, "a landing below commit height goes on without data this long", ge=0, le=10)
    max_tries: int = key(3, "wave-offs before the pilot gives up and holds clear", ge=0, le=100)

    def lost_after_s(self, source: str) -> float:
        """How long evidence of `corners`, `bar` or `ship` lasts [s]."""
        return self.lost_s if source == "corners" else self.lost_box_s


@parameters
class SearchParameters:
    """`[guidance.search]`."""

    look_s: float = key(
        3.0, "hold still for so long at each camera pitch", "six cycles of the paper's learned detector", ge=0
    )
    camera_pitch_deg: tuple[float, ...] = key(
        (0.0, -25.0), "up positive; each turn is flown with the next of them", "the lens sees 21 deg either side"
    )
    turn_percent: float = key(20.0, "yaw stick", "8 deg/s: a target moves by 66 px a cycle", ge=0)
    turn_s: float = key(45.0, "of a full turn with it", "a full turn", ge=0)
    climb_percent: float = key(60.0, "heave stick after each turn", ge=0)
    climb_s: float = key(5.0, "of the climb after each turn", ge=0)
    turns: int = key(4, "after this number of turns the vehicle holds", ge=0)

    def __post_init__(self) -> None:
        require(len(self.camera_pitch_deg) > 0, "camera_pitch_deg must hold at least one pitch")
        require(self.turn_s + self.climb_s > 0.0, "turn_s + climb_s must be positive")


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
class LearnedParameters:
    """`[guidance.learned]`: which policies the pilots `residual` and `learned` fly."""

    residual: str = key("residual", "packaged name, or path of a policy that `shipland learn` made")
    direct: str = key("direct", "likewise")


@parameters
class VelocityMatchingParameters:
    """`[guidance.velocity_matching]`."""

    position_per_s: float = key(0.95, "from an error to a speed, horizontally", "PX4's MPC_XY_P", gt=0)
    climb_per_s: float = key(1.0, "likewise vertically", "PX4's MPC_Z_P", gt=0)
    turn_per_s: float = key(1.0, "from a heading error to a yaw rate", "chosen: a second, as the height's", gt=0)
    velocity_per_s: float = key(1.8, "from a speed error to an acceleration", "PX4's MPC_XY_VEL_P_ACC", gt=0)
    integral_per_s2: float = key(0.4, "from its integral", "PX4's MPC_XY_VEL_I_ACC", ge=0)
    most_mps: float = key(1.5, "speed at which an error is closed", "chosen: stops within the deck's length", gt=0)
    target_mps2: float = key(0.5, "acceleration of the target, of a constant velocity", "chosen: a deck's sway", gt=0)
    picture_m: float = key(0.05, "standard deviation of a picture's error", "chosen: at 10 m", gt=0)


@parameters
class ImageServoingParameters:
    """`[guidance.image_servoing]`."""

    gain_per_s: float = key(0.95, "λ: the image error decays by it", "as PX4's MPC_XY_P", gt=0)
    integral_per_s: float = key(0.05, "from the integral of the camera's speed", "chosen: 20 s", ge=0)
    integrate_mps: float = key(0.4, "while that speed is below", "chosen: not during the approach", gt=0)
    most_mps: float = key(1.0, "speed at which an error is closed", "chosen: 1.5 overshoots towards the bar", gt=0)
    velocity_per_s: float = key(1.8, "from a speed error to an acceleration", "PX4's MPC_XY_VEL_P_ACC", gt=0)
    wind_per_s2: float = key(0.4, "from the speed error's integral", "PX4's MPC_XY_VEL_I_ACC", ge=0)


@parameters
class SpectralMpcParameters:
    """`[guidance.spectral_mpc]`."""

    window_s: float = key(20.0, "of the observed motion", "chosen: two periods of roll", ge=5, le=120)
    least_s: float = key(6.0, "of motion before it is decomposed; a straight line until then", "chosen", ge=1)
    waves: int = key(3, "components of the decomposition", "chosen", ge=1, le=10)
    error_weight: float = key(1.0, "of the squared error [1/m²]", "chosen", gt=0)
    speed_weight: float = key(0.5, "of the squared relative speed [s²/m²]", "chosen", ge=0)
    step_weight: float = key(0.3, "of the squared change of the input, a step of 0.1 s", "chosen", gt=0)
    most_mps: float = key(1.5, "constraint on the speed relative to the target", "as velocity_matching's", gt=0)
    disturbance_per_s: float = key(0.6, "bandwidth of the estimate of the wind's acceleration", "chosen", ge=0)
    turn_per_s: float = key(1.0, "from a heading error to a yaw rate", "as velocity_matching's", gt=0)
    calm_mps: float = key(0.3, "above commit height it waits while the deck will meet it faster", "chosen", gt=0)


@parameters
class DeckFollowingParameters:
    """`[guidance.deck_following]`."""

    begin_m: float = key(0.35, "from the hover point, at which the camera turns down", "chosen: within its view", gt=0)
    begin_mps: float = key(0.4, "relative speed, likewise", "chosen: so much drifts out of view in a second", gt=0)
    patience_s: float = key(1.5, "without the tag, after which it turns up again", "chosen", gt=0)
    upward_s: float = key(3.0, "that it then looks for the bar, at least", "chosen", gt=0)
    position_per_s2: float = key(1.8, "k_p, from an error to an acceleration", "chosen: 0.2 Hz, damping 0.8", gt=0)
    velocity_per_s: float = key(2.2, "k_v, from a relative speed to an acceleration", "likewise", gt=0)
    integral_per_s3: float = key(0.9, "from the error's integral to an acceleration", "chosen", ge=0)
    speed_per_s: float = key(0.8, "where a stick is a speed: from an error to a speed", "k_p / k_v", gt=0)
    most_m: float = key(0.5, "of an error that counts", "chosen", gt=0)
    attitude_below_m: float = key(0.2, "over the deck, its attitude is matched", "chosen: 0.3 s before contact", ge=0)
    target_mps2: float = key(1.0, "acceleration of the deck, of a constant velocity", "chosen: sea state 6", gt=0)
    sight_m: float = key(0.005, "standard deviation of a sight", "as `geometric.deck.noise_m`", gt=0)


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
