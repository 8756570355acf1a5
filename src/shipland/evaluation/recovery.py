"""How soon the pilot knows its place again after something failed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shipland.messages import FlightRecord
from shipland.scenario.faults import Fault

REGAINED_S = 2.0
"""In which the pilot's place should be true again."""
_GAP_S = 0.5
_TRUE_M = 0.5
"""An estimate this near to the truth of its time is true."""
_NEAR_S = 0.1


def recoveries(records: Sequence[FlightRecord], faults: Sequence[Fault]) -> list[float]:
    """Of each fault: from the first clear sight of the bar after it on, until the pilot's place is true [s].

    Left out are faults that another follows within the two seconds, or the flight's end, and those after which the bar
    does not stay in the picture: there the pilot has nothing to see it by. Infinite where it never is true.
    """
    times_s = np.array([record.telemetry.t_s for record in records])
    truths = [record.truth for record in records if record.truth is not None]
    truth_s, truth_m = np.array([it.t_s for it in truths]), [it.aircraft_in_bar_m for it in truths]
    found: list[float] = []
    for fault in faults:
        window_s = fault.end_s + REGAINED_S + 1.0
        if any(it.start_s < window_s and it.end_s > fault.end_s for it in faults if it is not fault):
            continue
        after = np.flatnonzero(times_s >= fault.end_s).tolist()
        seen_s = [float(times_s[i]) for i in after if records[i].observation.bar_pose is not None]
        if not seen_s or times_s[-1] < seen_s[0] + REGAINED_S:
            continue
        until_s = seen_s[0] + REGAINED_S
        if np.max(np.diff([*(t_s for t_s in seen_s if t_s <= until_s), until_s])) > _GAP_S:
            continue

        def is_true(record: FlightRecord) -> bool:
            estimate = record.decision.estimate
            if estimate is None or not len(truth_s):
                return False
            nearest = int(np.argmin(np.abs(truth_s - estimate.t_s)))
            off_m = float(np.linalg.norm(truth_m[nearest] - estimate.aircraft_in_bar_m))
            return abs(float(truth_s[nearest]) - estimate.t_s) <= _NEAR_S and off_m < _TRUE_M

        true_s = next((float(times_s[i]) for i in after if times_s[i] >= seen_s[0] and is_true(records[i])), math.inf)
        found.append(true_s - seen_s[0])
    return found
