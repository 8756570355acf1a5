"""The odds of a landing: the probability that a final descent that begins now ends in the landing area.

The estimate's error at contact is that of now, moved through the vehicle's own dynamics: a control that sees pictures
late cannot answer what it does not know yet. What it does know, it has flown out by then.

Waiting is a search for a better moment (optimal stopping, with offers that are drawn anew and cannot be recalled). It
is worth while as long as another draw, of a normal distribution with the mean and variance of the odds of late, gains
more on average than it costs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipland.frames import GRAVITY_MPS2, Array, rotated
from shipland.guidance.horizon.parameters import LevellingParameters
from shipland.guidance.response import Response
from shipland.rig import Rig

_REMEMBERED_S = 10.0
"""Time constant of their mean and variance."""
_JUDGED_S = 0.63 * _REMEMBERED_S
"""Their weight after that time: the best of late says then what can be hoped for."""


@dataclass(frozen=True)
class Odds:
    """Of a landing.

    Attributes:
        now: for a final descent that begins now.
        mean, square: of it and of its square, of late.
        weight_s: of these.
        best: of late; it fades towards the mean.
    """

    now: float
    mean: float = 0.0
    square: float = 0.0
    weight_s: float = 0.0
    best: float = 1.0

    def after(self, before: Odds | None, step_s: float) -> Odds:
        """With mean and square, from those of the cycle before."""
        if before is None:
            return Odds(self.now, self.now, self.now**2, step_s, self.now)
        kept_s = before.weight_s * math.exp(-step_s / _REMEMBERED_S)
        weight_s = kept_s + step_s
        share = step_s / weight_s if weight_s > 0.0 else 1.0
        mean = before.mean + share * (self.now - before.mean)
        best = max(self.now, before.best + (mean - before.best) * step_s / _REMEMBERED_S)
        return Odds(self.now, mean, before.square + share * (self.now**2 - before.square), weight_s, best)

    @property
    def gain(self) -> float:
        """By which another draw is better than now, on average; no worse than now, as it need not be taken.

        Odds end at 1 and a normal distribution does not: another draw is no better than the best of late.
        """
        deviation = math.sqrt(max(self.square - self.mean**2, 1e-12))
        z = (self.now - self.mean) / deviation
        density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
        better = deviation * (density - z * 0.5 * math.erfc(z / math.sqrt(2.0)))
        return min(better, self.best - self.now)

    def stay_below(self, least: float) -> bool:
        """Whether even the best of late is lower, after long enough."""
        return self.weight_s >= _JUDGED_S and self.best < least

    def worth_taking(self, cost: float) -> bool:
        """Whether another draw gains less than it costs, in landings."""
        return self.gain <= cost


def odds_below(most: float, mean: float, deviation: float) -> float:
    """Probability that a normally distributed value is below `most`."""
    return 0.5 * math.erfc((mean - most) / (math.sqrt(2.0) * deviation))


def odds_in_area(rig: Rig, offset_m: Array, covariance_m2: Array, bar_rad: float) -> float:
    """Of a contact in the landing area, which is taken for a square of its size.

    Args:
        rig: with the landing area.
        offset_m: (2,) predicted, from its centre, in the axes of the flight.
        covariance_m2: (2,2) of it.
        bar_rad: heading of the bar, along which the area lies.
    """
    area_m = rig.landing_square_m if rig.landing_area == "square" else 0.5 * math.sqrt(math.pi) * rig.landing_square_m
    cosine, sine = math.cos(bar_rad), math.sin(bar_rad)
    (north, both), (_, east) = covariance_m2.tolist()
    crossed = 2.0 * cosine * sine * both
    variances = cosine**2 * north + crossed + sine**2 * east, sine**2 * north - crossed + cosine**2 * east
    odds = 1.0
    for off_m, variance in zip(rotated(offset_m, -bar_rad).tolist(), variances, strict=True):
        scale_m = math.sqrt(2.0 * max(variance, 1e-9))
        odds *= 0.5 * (math.erf((0.5 * area_m - off_m) / scale_m) + math.erf((0.5 * area_m + off_m) / scale_m))
    return odds


def odds_of_tilt(tilt_mps2: float, left_s: float, response: Response, parameters: LevellingParameters) -> float:
    """Probability of a contact within the limit of the tilt.

    Args:
        tilt_mps2: acceleration by the tilt against the deck now, which is reduced with the vehicle's lag.
        left_s: to contact, from the command's effect.
        response: of the vehicle.
        parameters: of the levelling.
    """
    tilt_deg = math.degrees(math.atan2(tilt_mps2, GRAVITY_MPS2))
    kept = math.exp(-left_s / (response.lag_s + response.smoothing_s))
    contact_deg = min(tilt_deg, parameters.tilt_deg) + max(tilt_deg - parameters.tilt_deg, 0.0) * kept
    return odds_below(parameters.tilt_max_deg, contact_deg, parameters.tilt_std_deg)
