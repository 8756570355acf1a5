"""The one-state Kalman filter [Lee2022, §Pose Estimation], as read in erratum 1, and as printed."""

from __future__ import annotations

import math


class ScalarKalman:
    """Random walk observed with noise: P⁻ = P + Q, K = P⁻/(P⁻ + R), x = x⁻ + K (z − x⁻), P = (1 − K) P⁻.

    The paper's Q = 0.005 and R = 0.05 give a steady gain of 0.27. Units are the caller's: Q and R are the
    square of the value's, Q per published step of 0.03 s.
    """

    def __init__(self, process_noise: float, measurement_noise: float) -> None:
        if not (process_noise >= 0.0 and measurement_noise > 0.0):
            raise ValueError(
                f"ScalarKalman wants process noise >= 0 and measurement noise > 0, "
                f"got {process_noise} and {measurement_noise}"
            )
        self._process_noise = process_noise
        self._measurement_noise = measurement_noise
        self._variance = math.inf
        self._value: float | None = None

    @property
    def value(self) -> float | None:
        """The estimate; None before the first measurement."""
        return self._value

    @property
    def variance(self) -> float:
        """Variance of the estimate; infinite before the first measurement."""
        return self._variance

    def update(self, measurement: float, steps: float = 1.0) -> float:
        """Take one measurement; the new estimate.

        The first measurement is taken as it is. A measurement that is not finite changes nothing but lets the
        variance grow; before the first finite one it is handed back.

        Args:
            measurement: z.
            steps: time since the last one in published steps (0.03 s); the walk's variance grows in proportion.
        """
        predicted = self._variance + self._process_noise * max(steps, 0.0)
        if not math.isfinite(measurement):
            self._variance = predicted
            return measurement if self._value is None else self._value
        if self._value is None:
            self._value, self._variance = measurement, self._measurement_noise
            return measurement
        gain = predicted / (predicted + self._measurement_noise)
        self._value += gain * (measurement - self._value)
        self._variance = (1.0 - gain) * predicted
        return self._value

    def reset(self) -> None:
        """Forget everything."""
        self._value, self._variance = None, math.inf


def printed_kalman_step(
    estimate: float, measurement: float, process_noise: float, measurement_noise: float
) -> tuple[float, float]:
    """The equations as printed [Lee2022, §Pose Estimation]; not a Kalman filter (erratum 1).

    PrE = PE + QN; KG = PrE / (PrE + RN); CE = PE + KG · CM. The measurement is added instead of the innovation,
    so the estimate grows without bound.

    Args:
        estimate: PE, the previous estimate.
        measurement: CM.
        process_noise: RN, 0.005 in the paper, which calls it the process noise.
        measurement_noise: QN, 0.05.

    Returns:
        CE, the new estimate, and KG, the gain.
    """
    predicted = estimate + measurement_noise
    gain = predicted / (predicted + process_noise)
    return estimate + gain * measurement, gain
