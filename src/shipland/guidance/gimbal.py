"""Where the camera looks: at what is flown on, so that it stays in the picture."""

from __future__ import annotations

import math

from shipland.guidance.view import View
from shipland.messages import Box, Mode, Observation


def box_elevation_rad(box: Box, observation: Observation, view: View) -> float:
    """Of a box's centre above the horizon, by the camera's pitch at exposure."""
    return observation.gimbal.pitch_rad - view.depression_rad(box.centre_px[1])


def flown_box_elevation_rad(mode: Mode, observation: Observation, view: View) -> float | None:
    """Above the horizon, of the box that a far mode flies on; None in another mode or without the box."""
    box = {Mode.TRACK_BAR: observation.bar_box, Mode.TRACK_SHIP: observation.ship_box}.get(mode)
    return None if box is None else box_elevation_rad(box, observation, view)


def smoothed_rad(pitch_rad: float, wanted_rad: float | None, step_s: float, time_constant_s: float) -> float:
    """The camera pitch after `step_s`: a first-order lag towards the desired pitch; unchanged where that is None."""
    if wanted_rad is None:
        return pitch_rad
    share = 1.0 - math.exp(-step_s / time_constant_s) if step_s > 0.0 else 1.0
    return pitch_rad + share * (wanted_rad - pitch_rad)
