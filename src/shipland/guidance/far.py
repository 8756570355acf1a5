"""What far control is: a box in, sticks out; the published exponential law, and the linear laws it is compared with."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, Protocol

from shipland.config import require
from shipland.guidance.laws import (
    DerivativeVariant,
    FarGains,
    FarVariant,
    NearGains,
    NearMemory,
    PidGains,
    PidMemory,
    clamp,
    exponential_law,
    near_law,
    pid_law,
)
from shipland.guidance.near import NearParameters, Sticks
from shipland.messages import Box

FarKind = Literal["exponential", "p", "pid"]


@dataclass(frozen=True)
class FarParameters:
    """`[guidance.ship]`, `[guidance.bar]`: Table 1 for one target."""

    pitch: FarGains
    roll: FarGains
    heave: FarGains


@dataclass(frozen=True)
class FarBaselines:
    """`[guidance.far_baselines]`: the linear laws that the far law is compared with, in roll and heave.

    Attributes:
        match_px: the linear P gives as much stick as the exponential law at this error.
        roll, heave: the linear PID.
    """

    match_px: float
    roll: PidGains
    heave: PidGains

    def __post_init__(self) -> None:
        require(self.match_px > 0.0, "match_px must be positive")


@dataclass(frozen=True)
class FarSight:
    """What far control is told in a cycle.

    Attributes:
        box: of the target.
        t_s: exposure time of the box's picture [s]; one no newer than the last adds nothing to sums.
        ready_s: when this cycle's command is ready [s].
        gimbal_pitch_rad: of the camera at exposure.
        heading_error_deg: heading wanted minus the magnetometer's at `ready_s`; None where there is no magnetometer:
            then the nose is turned to the box.
    """

    box: Box
    t_s: float
    ready_s: float
    gimbal_pitch_rad: float
    heading_error_deg: float | None


class FarControl(Protocol):
    """Flies modes 3 and 4: one of them a pilot."""

    def sticks(self, sight: FarSight, gains: FarParameters) -> Sticks:
        """The sticks for one box, with the target's constants."""

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """What the pilot gave at last, in any mode."""

    def reset(self) -> None:
        """The target changed or was lost: forget what does not outlast it."""


class FarYaw:
    """The near yaw law [Lee2022, Eq. 2, Table 2] on the magnetometer [Lee2022, §Long-range Tracking Controller].

    Without a magnetometer the error is the box's bearing off the picture's middle.
    """

    def __init__(self, gains: NearGains, derivative: DerivativeVariant, focal_px: float) -> None:
        self._gains, self._derivative, self.focal_px = gains, derivative, focal_px
        self._memory = NearMemory()
        self._by_magnetometer: bool | None = None

    def stick_percent(self, off_middle_px: float, t_s: float, heading_error_deg: float | None) -> float:
        """Clockwise stick for a heading error, or for a box that far right of the middle."""
        by_magnetometer = heading_error_deg is not None
        if by_magnetometer is not self._by_magnetometer:
            self.reset()
            self._by_magnetometer = by_magnetometer
        if heading_error_deg is None:
            error_deg = math.degrees(math.atan2(off_middle_px, self.focal_px))
        else:
            error_deg = math.remainder(heading_error_deg, 360.0)
        terms, self._memory = near_law(error_deg, t_s, self._memory, self._gains, self._derivative)
        return terms.stick_percent

    def reset(self) -> None:
        """Forget the last error; the integral stays."""
        self._memory = replace(self._memory, error=None)


class PublishedFar:
    """The exponential law [Lee2022, Eq. 1] in one of its readings (errata 2 and 3)."""

    def __init__(self, variant: FarVariant, yaw: FarYaw) -> None:
        self._variant, self._yaw = variant, yaw

    def sticks(self, sight: FarSight, gains: FarParameters) -> Sticks:
        """Eq. 1 on the box's area, column and row; it remembers nothing."""
        too_small_px2, right_px, below_px = _errors(sight, gains, self._yaw.focal_px)
        return Sticks(
            exponential_law(too_small_px2, gains.pitch, self._variant),
            exponential_law(right_px, gains.roll, self._variant),
            -exponential_law(below_px, gains.heave, self._variant),
            self._yaw.stick_percent(right_px, sight.t_s, sight.heading_error_deg),
        )

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """The law remembers no sticks."""

    def reset(self) -> None:
        """Forget the last heading error."""
        self._yaw.reset()


class LinearFar:
    """The paper's linear P [Lee2022, §Long-range Tracking Controller]; pitch is linear in Table 1 already."""

    def __init__(self, baselines: FarBaselines, variant: FarVariant, yaw: FarYaw) -> None:
        self._match_px, self._variant, self._yaw = baselines.match_px, variant, yaw

    def sticks(self, sight: FarSight, gains: FarParameters) -> Sticks:
        """Each axis proportional to its error."""
        too_small_px2, right_px, below_px = _errors(sight, gains, self._yaw.focal_px)
        return Sticks(
            exponential_law(too_small_px2, gains.pitch, self._variant),
            clamp(self._k_p(gains.roll) * right_px, 100.0),
            clamp(-self._k_p(gains.heave) * below_px, 100.0),
            self._yaw.stick_percent(right_px, sight.t_s, sight.heading_error_deg),
        )

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """The law remembers no sticks."""

    def reset(self) -> None:
        """Forget the last heading error."""
        self._yaw.reset()

    def _k_p(self, gains: FarGains) -> float:
        return exponential_law(self._match_px, gains, self._variant) / self._match_px


class PidFar:
    """The paper's linear PID [Lee2022, §Long-range Tracking Controller]; pitch is linear in Table 1 already."""

    def __init__(self, baselines: FarBaselines, variant: FarVariant, yaw: FarYaw) -> None:
        self._baselines, self._variant, self._yaw = baselines, variant, yaw
        self._roll = self._heave = PidMemory()

    def sticks(self, sight: FarSight, gains: FarParameters) -> Sticks:
        """PID on column and row."""
        too_small_px2, right_px, below_px = _errors(sight, gains, self._yaw.focal_px)
        roll, self._roll = pid_law(right_px, sight.t_s, self._roll, self._baselines.roll)
        heave, self._heave = pid_law(-below_px, sight.t_s, self._heave, self._baselines.heave)
        return Sticks(
            exponential_law(too_small_px2, gains.pitch, self._variant),
            roll,
            heave,
            self._yaw.stick_percent(right_px, sight.t_s, sight.heading_error_deg),
        )

    def sent(self, ready_s: float, sticks: Sticks) -> None:
        """The law remembers no sticks."""

    def reset(self) -> None:
        """Forget the last errors; the integrals stay."""
        self._roll, self._heave = replace(self._roll, error=None), replace(self._heave, error=None)
        self._yaw.reset()


def far_control(
    kind: FarKind, variant: FarVariant, baselines: FarBaselines, near: NearParameters, focal_px: float
) -> FarControl:
    """The far control of `guidance.far_control`; `near` gives the yaw law, `focal_px` its bearing without a compass."""
    yaw = FarYaw(near.yaw, near.derivative, focal_px)
    if kind == "p":
        return LinearFar(baselines, variant, yaw)
    if kind == "pid":
        return PidFar(baselines, variant, yaw)
    return PublishedFar(variant, yaw)


def _errors(sight: FarSight, gains: FarParameters, focal_px: float) -> tuple[float, float, float]:
    """Area missing [px²], and how far the box is right of and below its setpoint [px].

    The row is that in a level camera: the gimbal follows the target, so that a steep one stays in the picture.
    """
    box, setpoint_px = sight.box, gains.heave.setpoint
    below_rad = math.atan2(box.centre_px[1] - setpoint_px, focal_px) - sight.gimbal_pitch_rad
    return (
        gains.pitch.setpoint - box.area_px2,
        box.centre_px[0] - gains.roll.setpoint,
        focal_px * math.tan(clamp(below_rad, _STEEPEST_RAD)),
    )


_STEEPEST_RAD = math.radians(80.0)
