"""The tilt reduced to what a contact allows, just before contact.

In wind an aircraft holds its position tilted, and a deck that rolls adds to that. Up to `tilt_deg` remains: level, the
aircraft would drift with the wind.
"""

from __future__ import annotations

import math

from shipland.config import key, parameters
from shipland.frames import GRAVITY_MPS2, Array
from shipland.guidance.horizon.odds import odds_below
from shipland.guidance.response import Response

_KICK_MPS2 = 3.0
"""Largest acceleration of an autopilot that tracks a speed: PX4's MPC_ACC_HOR as delivered."""


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


def odds_of_tilt(tilt_mps2: float, left_s: float, response: Response, parameters: LevellingParameters) -> float:
    """Probability of a contact within the limit of the tilt.

    Args:
        tilt_mps2: acceleration by the tilt now, which is reduced with the vehicle's lag.
        left_s: to contact, from the command's effect.
        response: of the vehicle.
        parameters: of the levelling.
    """
    tilt_deg = math.degrees(math.atan2(tilt_mps2, GRAVITY_MPS2))
    kept = math.exp(-left_s / (response.lag_s + response.smoothing_s))
    contact_deg = min(tilt_deg, parameters.tilt_deg) + max(tilt_deg - parameters.tilt_deg, 0.0) * kept
    return odds_below(parameters.tilt_max_deg, contact_deg, parameters.tilt_std_deg)


def tilt_near_contact(wanted: Array, left_s: float, response: Response, parameters: LevellingParameters) -> Array:
    """(2,) the input of sticks that mean a tilt [m/s²].

    Args:
        wanted: (2,) by the gains.
        left_s: to contact, from the command's effect.
        response: of the vehicle.
        parameters: of the levelling.
    """
    early_s = max(left_s - parameters.before_contact_s(response), 0.0)
    return shortened(wanted, parameters.tilt_mps2 + response.max_input_rate * early_s)


def speed_near_contact(
    wanted: Array, tilt: Array, tracked_mps: Array, response: Response, parameters: LevellingParameters
) -> Array:
    """(2,) the input of sticks that mean a speed [m/s]: the autopilot levels out where it is to change its speed.

    Args:
        wanted: (2,) by the gains.
        tilt: (2,) acceleration by the aircraft's tilt, but for what changes of the tracked speed ask for [m/s²].
        tracked_mps: (2,) the speed that the autopilot tracks.
        response: of the vehicle.
        parameters: of the levelling.
    """
    change = shortened(response.approach_per_s * (wanted - tracked_mps), _KICK_MPS2)
    tilted = tilt + change
    level = shortened(tilted, parameters.tilt_mps2)
    if level is tilted:
        return wanted
    return tracked_mps + shortened(level - tilt, _KICK_MPS2) / response.approach_per_s


def shortened(vector: Array, most: float) -> Array:
    """(2,) the vector, no longer than `most`."""
    size = math.hypot(*vector.tolist())
    return vector if size <= most else vector * (most / size)
