"""The height of the cue by barometer: the pose of a mirror image hangs too low, and is refused where it is the first.

In a wet deck, or in water, a cue that is alike both ways up is its own reflection, to the last pixel that of a cue
which hangs lower. No picture tells the two apart; the height of the aircraft does. A pose says how far the camera is
above or below the cue, the barometer how far above the take-off point: together they say where the cue hangs, whatever
the aircraft does. Poses that follow one another are the vision's to guard (`track_climb_mps`).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import replace
from operator import itemgetter
from typing import NamedTuple

from shipland.config import key, parameters
from shipland.messages import Observation, Telemetry
from shipland.rig import Rig


@parameters
class CueHeightParameters:
    """`[safety.cue_height]`."""

    gap_s: float = key(1.0, "a pose is a first one after none for longer", "as vision.track_s", ge=0.05, le=30)
    patience_s: float = key(
        5.0, "first poses that hang too low for so long are believed: rather has the barometer leapt", ge=0, le=120
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
        refused_since_s: exposure since which first poses have been refused; None for none.
        heights: newest readings of the barometer, (time [s], height over the take-off point [m]).
    """

    parameters: CueHeightParameters
    least_drop_m: float
    height_m: float | None = None
    pose_s: float = -math.inf
    refused_since_s: float | None = None
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
        """The observation without a first pose that hangs as low as a mirror image."""
        pose, t_s = observation.bar_pose, observation.t_s
        if pose is None or self.least_drop_m == 0.0:
            return self, observation
        height_m = self._height_at(t_s)
        if height_m is None:
            return self._replace(pose_s=t_s, refused_since_s=None), observation
        cue_m = height_m + float(pose.position_in_bar_m[2])
        first = not 0.0 <= t_s - self.pose_s <= self.parameters.gap_s
        if first and self.height_m is not None:
            refused_since_s = t_s if self.refused_since_s is None else self.refused_since_s
            unsure_m = min(_SIGMAS * math.sqrt(max(float(pose.covariance[2, 2]), 0.0)), 0.25 * self.least_drop_m)
            low_m = self.height_m - cue_m
            if low_m > 0.5 * self.least_drop_m + unsure_m and t_s - refused_since_s <= self.parameters.patience_s:
                reason = f"pose refused: the cue hangs {low_m:.1f} m too low, as its mirror image does"
                return self._replace(refused_since_s=refused_since_s), replace(
                    observation, bar_pose=None, reason=reason
                )
        height_m = cue_m if self.height_m is None else self.height_m + self.parameters.share * (cue_m - self.height_m)
        return CueHeight(self.parameters, self.least_drop_m, height_m, t_s, None, self.heights), observation

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
