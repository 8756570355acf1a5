"""Why near vision gives no pose: the names, and the words that `Observation.reason` carries."""

from __future__ import annotations

import enum
import math

from shipland.messages import Frame, Observation


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
