"""The sections of `[guidance]` that belong to rivals."""

from __future__ import annotations

from shipland.config import key, parameters


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
