"""What the vehicle's own senses say of the cue: the barometer of its height, the way flown of its size.

Height: in a wet deck, or in water, a cue that is alike both ways up is its own reflection, to the last pixel that of
a cue which hangs lower. No picture tells the two apart; the height of the aircraft does. A pose says how far the
camera is above or below the cue, the barometer how far above the take-off point: together they say where the cue
hangs, whatever the aircraft does. Poses that follow one another without a leap are not asked: it is the barometer
then that leaps.

Size: a cue that is not as large as stated, or a focal length that is not the camera's, makes the bar nearer or
farther by a share, which no picture shows. Own way and poses together do: of a ship without way, the distance to the
bar's plane changes by what the vehicle travels. Least squares of d = a + c·t − s·w: the distance d, the own way w
towards the bar, and c for the ship's drift and the velocity's error; s is wanted. What is old is forgotten. A way
that varies by less than waves move the bar is not judged: a hover follows the bar, its distance stays, and s would
come out too small. A ship with way on is not judged, from the moment that the drift is known: optical flow tells the
velocity against the water astern of the deck, and against the deck above it, so that a drift which was 0.5 m/s ends
there and a scale of 0.8 would explain it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import replace
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from shipland.compiled import compiled
from shipland.config import key, parameters
from shipland.frames import Array
from shipland.messages import Observation, Telemetry
from shipland.rig import Rig


@parameters
class CueHeightParameters:
    """`[safety.cue_height]`."""

    gap_s: float = key(1.0, "a pose is a first one after none for longer", "as vision.track_s", ge=0.05, le=30)
    patience_s: float = key(
        30.0, "poses that hang too low for so long are believed: rather has the barometer leapt", ge=0, le=120
    )
    share: float = key(
        0.01, "of a pose's height in the remembered one", "chosen: 3 s, about a period of the swell", gt=0, le=1
    )
    over_takeoff_m: float | None = key(
        None, "height of the cue over the take-off point; without it the flight's first pose is believed"
    )


class CueHeight(NamedTuple):
    """State between cycles.

    Attributes:
        parameters: the bounds.
        least_drop_m: how far below the cue its nearest mirror image hangs; 0 for a cue that has an up.
        height_m: height of the cue over the take-off point; None while nothing has told it.
        pose_s: exposure of the last pose that was believed.
        down_m: of the camera below the cue by that pose.
        refused_at_s: exposure of the last one since that was refused; None for none.
        refused_s: for how long poses have been refused since; where none came, `gap_s` at most counts.
        heights: newest readings of the barometer, (time [s], height over the take-off point [m]).
    """

    parameters: CueHeightParameters
    least_drop_m: float
    height_m: float | None = None
    pose_s: float = -math.inf
    down_m: float = 0.0
    refused_at_s: float | None = None
    refused_s: float = 0.0
    heights: tuple[tuple[float, float], ...] = ()

    @staticmethod
    def of(parameters: CueHeightParameters, rig: Rig) -> CueHeight:
        """At the start of a flight to this ship. The nearest mirror is the deck."""
        drop_m = 2.0 * (rig.bar_height_m - rig.deck_height_m) if rig.cue.mirrors_itself else 0.0
        return CueHeight(parameters, max(drop_m, 0.0), parameters.over_takeoff_m)

    def with_height(self, telemetry: Telemetry) -> CueHeight:
        """After a reading of the barometer."""
        if telemetry.height_m is None:
            return self
        t_s = telemetry.t_s if telemetry.height_t_s is None else telemetry.height_t_s
        if self.heights and t_s <= self.heights[-1][0]:
            return self
        return self._replace(heights=(*self.heights[1 - _READINGS :], (t_s, telemetry.height_m)))

    def unwatched(self) -> CueHeight:
        """Without a pilot, who rejects a height that leaps: the next pose is a first one again."""
        return self._replace(pose_s=-math.inf)

    def checked(self, observation: Observation) -> tuple[CueHeight, Observation]:
        """The observation without a pose, a first one or one that leaps, whose cue hangs as low as a mirror image."""
        pose, t_s = observation.bar_pose, observation.t_s
        if pose is None or self.least_drop_m == 0.0:
            return self, observation
        height_m, down_m = self._height_at(t_s), float(pose.position_in_bar_m[2])
        if height_m is None:
            return self._replace(pose_s=t_s, down_m=down_m, refused_at_s=None, refused_s=0.0), observation
        cue_m = height_m + down_m
        leaps = abs(down_m - self.down_m) > 0.5 * self.least_drop_m
        follows = 0.0 <= t_s - self.pose_s <= self.parameters.gap_s and not leaps
        if not follows and self.height_m is not None:
            since_s = 0.0 if self.refused_at_s is None else max(t_s - self.refused_at_s, 0.0)
            refused_s = self.refused_s + min(since_s, self.parameters.gap_s)
            unsure_m = min(_SIGMAS * math.sqrt(max(float(pose.covariance[2, 2]), 0.0)), 0.25 * self.least_drop_m)
            low_m = self.height_m - cue_m
            if low_m > 0.5 * self.least_drop_m + unsure_m and refused_s <= self.parameters.patience_s:
                reason = f"pose refused: the cue hangs {low_m:.1f} m too low, as its mirror image does"
                refusing = self._replace(refused_at_s=t_s, refused_s=refused_s)
                return refusing, replace(observation, bar_pose=None, reason=reason)
        height_m = cue_m if self.height_m is None else self.height_m + self.parameters.share * (cue_m - self.height_m)
        return CueHeight(self.parameters, self.least_drop_m, height_m, t_s, down_m, heights=self.heights), observation

    def _height_at(self, t_s: float) -> float | None:
        """Over the take-off point at an exposure, between readings; None where none is near."""
        heights = self.heights
        if not heights or not heights[0][0] - _NEAR_S <= t_s <= heights[-1][0] + _NEAR_S:
            return None
        after = bisect_right(heights, t_s, key=itemgetter(0))
        if after in (0, len(heights)):
            return heights[0 if after == 0 else -1][1]
        (before_s, before_m), (after_s, after_m) = heights[after - 1 : after + 1]
        return before_m + (after_m - before_m) / (after_s - before_s) * (t_s - before_s)


_READINGS = 90
"""Three seconds of them at 30 Hz: as late as a picture may come."""
_NEAR_S = 0.5
"""A reading this far from the exposure still tells the height there, to half a metre."""
_SIGMAS = 4.0


_MEMORY_S = 40.0
"""Old poses are forgotten with this time constant: the drift changes."""
_LONGEST_STEP_S = 0.5
"""A pose counts for the time since the one before, at most this."""
_LARGEST = 1e12
"""What is larger, or no number, is none of a flight's."""
_WAVES_SHARE = 0.2
"""Of the deck's side, by which the bar moves, beside what poses err by their covariance."""
_PERIOD_S = 3.0
"""Errors that are nearer in time are one: half a period of the waves at the rig's scale."""
_LEAST_SHARE = 0.05
"""Of the variance above, where the fit leaves less."""
_LEAST_S = 9.0
"""Of poses, before the scale is judged: a shorter way may be a wave's."""
_STILL_MPS = 0.25
"""A ship that drifts faster is not judged."""
_LEAST_SCALE = 0.2
"""For the drift; nothing is so wrong."""
_DRIFT_S = 5.0
"""Of poses without an interruption, before the drift is known."""
_UNDER_WAY_MPS, _SURE = 1.0, 0.12
"""One that drifts faster than this, by a fit that knows the scale so well, is not judged any more."""
_RIGHT = 0.19
"""Logarithm of the scale; where it is nearer to one for sure, a ship that is not still is known to be under way."""


class WayScale:
    """The fit of one flight.

    Args:
        deck_size_m: side of the deck.

    Attributes:
        scale: distances by poses over the vehicle's own; 1 where it is not judged.
        sigma: its standard deviation; infinite where it is not judged.
    """

    def __init__(self, deck_size_m: float) -> None:
        self._waves_m2 = (_WAVES_SHARE * deck_size_m) ** 2
        self.scale, self.sigma = 1.0, math.inf
        self._sums: Array = np.zeros(_SUMS)
        self._before: Array = np.zeros(4)
        """What `_centred` made of earlier stretches of the way."""
        self._under_way, self._seen_s = False, 0.0
        self._begun: tuple[float, float, float] | None = None
        """Exposure of the first pose, and how far north and east the aircraft was by its own way."""
        self._last_s = 0.0

    def interrupt(self) -> None:
        """The vehicle does not tell its velocity: how far it goes meanwhile is not known."""
        if self._begun is not None:
            self._before += np.array(_centred(self._sums)[:4])
            self.scale, self.sigma, self._begun = 1.0, math.inf, None
            self._sums[:] = 0.0

    def take(
        self,
        exposure_s: float,
        distance_m: float,
        bar_heading_rad: float,
        way_m: tuple[float, float],
        variance_m2: float,
    ) -> None:
        """A pose.

        Args:
            exposure_s: an earlier one than that before tells nothing.
            distance_m: to the bar's plane.
            bar_heading_rad: of the bar, clockwise from the axes of `way_m`.
            way_m: the aircraft's own, until then, north and east.
            variance_m2: of the distance.
        """
        if not all(abs(told) < _LARGEST for told in (exposure_s, distance_m, bar_heading_rad, *way_m, variance_m2)):
            return
        if self._begun is None:
            self._begun, self._last_s = (exposure_s, *way_m), exposure_s
        first_s, north_m, east_m = self._begun
        step_s, lasted_s = exposure_s - self._last_s, exposure_s - first_s
        if step_s <= 0.0:
            return
        self._last_s, taken_s = exposure_s, min(step_s, _LONGEST_STEP_S)
        self._seen_s += taken_s
        north_m, east_m = way_m[0] - north_m, way_m[1] - east_m
        way = north_m * math.cos(bar_heading_rad) + east_m * math.sin(bar_heading_rad)
        weight = taken_s / (self._waves_m2 + max(variance_m2, 0.0))
        kept = math.exp(-step_s / _MEMORY_S)
        scale, sigma, drift_mps, way_m2 = _fitted(self._sums, self._before, kept, weight, lasted_s, distance_m, way)
        known = lasted_s >= _DRIFT_S
        right = abs(math.log(max(scale, _LEAST_SCALE))) + sigma < _RIGHT
        self._under_way |= known and drift_mps > (_STILL_MPS if right else _UNDER_WAY_MPS) and sigma < _SURE
        told = self._seen_s >= _LEAST_S and way_m2 > self._waves_m2
        judged = known and told and drift_mps < _STILL_MPS and not self._under_way
        self.scale, self.sigma = (scale, sigma) if judged else (1.0, math.inf)


_SUMS = 10
"""Weighted, of 1, t, t², w, t·w, w², d, t·d, w·d, d²."""


@compiled
def _centred(sums: Array) -> tuple[float, float, float, float, float, float, float]:
    """Of way and distance what neither a place nor a drift explains: w², w·d, d², weight; and t², t·w, t·d."""
    n, s_t, s_tt, s_w, s_tw, s_ww, s_d, s_td, s_wd, s_dd = sums
    if not n > 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    tt, tw, td = s_tt - s_t * s_t / n, s_tw - s_t * s_w / n, s_td - s_t * s_d / n
    if not tt > 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ww = s_ww - s_w * s_w / n - tw * tw / tt
    wd = s_wd - s_w * s_d / n - tw * td / tt
    dd = s_dd - s_d * s_d / n - td * td / tt
    return ww, wd, dd, n, tt, tw, td


@compiled
def _fitted(
    sums: Array, before: Array, kept: float, weight: float, t: float, d: float, w: float
) -> tuple[float, float, float, float]:
    """Scale, its standard deviation, the drift, and the way's variance beside place and drift, with one pose more."""
    for i, value in enumerate((1.0, t, t * t, w, t * w, w * w, d, t * d, w * d, d * d)):
        sums[i] = kept * sums[i] + weight * value
    for i in range(4):
        before[i] *= kept
    ww, wd, dd, n, tt, tw, td = _centred(sums)
    ww, wd, dd, n = ww + before[0], wd + before[1], dd + before[2], n + before[3]
    if not (ww > 0.0 and tt > 0.0):
        return 1.0, math.inf, math.inf, 0.0
    scale = -wd / ww
    variance = max((dd - wd * wd / ww) / n, _LEAST_SHARE)
    drift_mps = abs(td + scale * tw) / tt / max(abs(scale), _LEAST_SCALE)
    return scale, math.sqrt(_PERIOD_S * variance / ww), drift_mps, ww / n
