"""What a pose must pass to be believed, and why near vision gives none: names, and the words of `Observation.reason`.

These gates ask for a pose and numbers only; those that look at what the picture shows are in `validate`.
"""

from __future__ import annotations

import enum
import math

from shipland.frames import Array, Pose
from shipland.messages import BarPose, Frame, Observation
from shipland.vision.near.covariance import position_and_yaw
from shipland.vision.parameters import VisionParameters

_REPROJECTION_NOISE = 4.0
"""Standard deviations of a corner that the reprojection error may have in addition."""

_MOST_NOISE_PX = 0.1
"""Most that these amount to: smeared or frayed sides state a noise that would excuse any shape."""

_JUMP_M, _JUMP_SIGMAS = 0.5, 4.0
"""Change of height, and its standard deviations, that two poses may differ by in no time."""


class Refusal(enum.Enum):
    """Every way to end without a pose; the value is the sentence for people."""

    NO_PICTURE = "the frame carries no picture"
    BAD_PICTURE = "the picture is not three-channel 8-bit or is empty"
    WRONG_SIZE = "the picture's size is not the camera's"
    NOTHING_GREEN = "nothing in the picture passes the colour gate"
    NO_QUADRILATERAL = "no coloured region is a quadrilateral"
    CUT_BY_FRAME = "the cue is cut by the picture's edge"
    NO_MATCH = "the quadrilaterals found do not form the cue"
    AMBIGUOUS = "which part of the cue is in sight cannot be told"
    CORNERS_UNSURE = "the corners cannot be measured at sub-pixel"
    SIDES_UNEQUAL = "opposite sides differ by more than 10 % in length or 5 % in slope and the corners' errors"
    SCREENED = "opposite sides differ by more than 10 % in length or 5 % in slope"
    REPROJECTION = "the corners do not fit the cue's dimensions (manufacturing_tolerance)"
    BLOOM = "all sides err outward or inward by more than a lamp's bloom (edge_bias_px)"
    OUT_OF_REACH = "the pose lies outside the range or obliquity that is accepted"
    JUMP = "the pose is higher or lower than the last one by more than an aircraft climbs"
    GIMBAL_OFF = "gimbal and horizon disagree"
    NO_DECK = "the deck's markings are not in view"
    NO_SOLUTION = "no pose solves the corners"


def gimbal_off(frame: Frame, off_rad: float) -> Observation:
    """`GIMBAL_OFF`, with the angle.

    >>> from shipland.messages import GimbalAttitude
    >>> gimbal_off(Frame(0.0, None, GimbalAttitude(0.0, 0.0)), 0.157).reason
    'gimbal and horizon disagree by 9°'
    """
    reason = f"{Refusal.GIMBAL_OFF.value} by {math.degrees(off_rad):.0f}°"
    return Observation(frame.t_s, frame.gimbal, reason=reason, gimbal_off_rad=off_rad)


def largest_reprojection_px(
    corners_px: Array, noise_px: float, manufacturing_tolerance: float, parameters: VisionParameters
) -> float:
    """Root-mean-square distance up to which corners fit the cue.

    Args:
        corners_px: (k,4,2) measured.
        noise_px: their largest standard deviation.
        manufacturing_tolerance: what the cue's dimensions are made to (`Target.manufacturing_tolerance`).
        parameters: of the near chain.
    """
    columns_px, rows_px = corners_px.reshape(-1, 2).T.tolist()
    diagonal_px = math.hypot(max(columns_px) - min(columns_px), max(rows_px) - min(rows_px))
    most_px = parameters.reprojection_px + manufacturing_tolerance * diagonal_px
    return most_px + min(_REPROJECTION_NOISE * noise_px, _MOST_NOISE_PX)


def within_reach(camera_from_plane: Pose, parameters: VisionParameters) -> bool:
    """Whether a pose lies within the range and obliquity that are accepted."""
    across_m, down_m, ahead_m = camera_from_plane.translation_m.tolist()
    a, b, c = camera_from_plane.rotation[:, 2].tolist()
    distance_m, facing_m = math.hypot(across_m, down_m, ahead_m), a * across_m + b * down_m + c * ahead_m
    least_facing = math.cos(math.radians(parameters.max_obliquity_deg))
    return distance_m <= parameters.max_distance_m and facing_m >= least_facing * distance_m


def jumps(pose: BarPose, last: Pose, passed_s: float, parameters: VisionParameters) -> bool:
    """Whether the camera would have risen or sunk since the last pose faster than an aircraft does.

    The image of a cue that is its own reflection, in a wet deck or in water, is that of a cue which hangs lower.

    Args:
        pose: found now.
        last: the last pose, camera_from_plane.
        passed_s: time between them.
        parameters: how fast that is.
    """
    if parameters.track_climb_mps <= 0.0:
        return False
    last_in_bar_m, _ = position_and_yaw(last)
    risen_m = abs(float(pose.position_in_bar_m[2] - last_in_bar_m[2]))
    unsure_m = _JUMP_SIGMAS * math.sqrt(max(float(pose.covariance[2, 2]), 0.0))
    return risen_m > _JUMP_M + unsure_m + parameters.track_climb_mps * passed_s
