"""Far control: a box in, sticks out. The published exponential law, and the linear laws that it is compared with."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import Protocol

from shipland.camera import Camera
from shipland.guidance.laws import NearMemory, PidMemory, exponential_law, near_law, pid_law
from shipland.guidance.parameters import (
    DerivativeVariant,
    FarBaselines,
    FarGains,
    FarKind,
    FarParameters,
    FarVariant,
    NearGains,
    NearParameters,
)
from shipland.guidance.response import SticksPercent, clamp
from shipland.messages import Box, GimbalAttitude

PUBLISHED_CAMERA = Camera.from_fov(1280, 720, 69.0)
"""The camera that Table 1's pixels belong to: 720p stream [Lee2022], 69° (Parrot ANAFI data sheet), f = 931 px."""


class FarTarget(enum.Enum):
    """The object in a box."""

    SHIP = "ship"
    BAR = "bar"


def _scaled(table: FarParameters, camera: Camera) -> FarParameters:
    """The same law in angles with the pixels of another camera than the published.

    With k the ratio of focal lengths, lengths in the picture grow by k and areas by k²: setpoints grow with them,
    gains and the exponent's rate shrink, columns and rows count from the principal point.
    """
    pitch, zoom = table.pitch, camera.focal_px / PUBLISHED_CAMERA.focal_px
    column_px, row_px = (tuple(float(view.matrix[axis, 2]) for view in (PUBLISHED_CAMERA, camera)) for axis in (0, 1))
    return FarParameters(
        pitch=FarGains(pitch.m / zoom**2, pitch.a / zoom**2, pitch.setpoint * zoom**2, pitch.d),
        roll=_scaled_centre(table.roll, zoom, *column_px),
        heave=_scaled_centre(table.heave, zoom, *row_px),
    )


def _scaled_centre(gains: FarGains, zoom: float, published_px: float, middle_px: float) -> FarGains:
    setpoint_px = middle_px + zoom * (gains.setpoint - published_px)
    return FarGains(gains.m / zoom, gains.a / zoom, setpoint_px, gains.d)


@dataclass(frozen=True)
class FarTables:
    """Table 1 of both targets in the pixels of the camera in use."""

    ship: FarParameters
    bar: FarParameters

    @staticmethod
    def for_camera(ship: FarParameters, bar: FarParameters, camera: Camera) -> FarTables:
        """From the figures of the published camera."""
        return FarTables(_scaled(ship, camera), _scaled(bar, camera))

    def of(self, target: FarTarget) -> FarParameters:
        """The constants for a target."""
        return self.ship if target is FarTarget.SHIP else self.bar


def _scaled_baselines(baselines: FarBaselines, camera: Camera) -> FarBaselines:
    """The same laws in angles with the pixels of another camera."""
    zoom = camera.focal_px / PUBLISHED_CAMERA.focal_px
    roll, heave = (replace(gains, k_p=gains.k_p / zoom) for gains in (baselines.roll, baselines.heave))
    return FarBaselines(baselines.match_px * zoom, roll, heave)


@dataclass(frozen=True)
class FarSight:
    """Input of far control in one cycle.

    Attributes:
        box: of the target.
        target: what the box is of.
        t_s: exposure time of the box's picture [s]; one no newer than the last adds nothing to sums.
        gimbal: of the camera at exposure.
        heading_error_deg: desired heading minus the magnetometer's newest; None where there is no magnetometer: then
            the nose is turned to the box.
    """

    box: Box
    target: FarTarget
    t_s: float
    gimbal: GimbalAttitude
    heading_error_deg: float | None


class FarControl(Protocol):
    """Flies modes 3 and 4; a pilot has one."""

    def sticks(self, sight: FarSight) -> SticksPercent:
        """The sticks for one box."""

    def reset(self) -> None:
        """The target changed or was lost: forget what does not outlast it."""


class FarYaw:
    """The near yaw law [Lee2022, Eq. 4, Table 2] on the magnetometer [Lee2022, §Long-range Tracking Controller].

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
            error_deg = math.remainder(heading_error_deg, 360.0) if math.isfinite(heading_error_deg) else math.nan
        terms, self._memory = near_law(error_deg, t_s, self._memory, self._gains, self._derivative)
        return terms.stick_percent

    def reset(self) -> None:
        """Forget the last error; the integral stays."""
        self._memory = replace(self._memory, error=None)


class PublishedFar:
    """The exponential law [Lee2022, Eq. 3] in one of its readings (errata 2 and 3)."""

    def __init__(self, variant: FarVariant, tables: FarTables, yaw: FarYaw) -> None:
        self._variant, self._tables, self._yaw = variant, tables, yaw

    def sticks(self, sight: FarSight) -> SticksPercent:
        """Eq. 3 on the box's area, column and row; it remembers nothing."""
        gains = self._tables.of(sight.target)
        too_small_px2, right_px, below_px = _errors(sight, gains, self._yaw.focal_px)
        return SticksPercent(
            exponential_law(too_small_px2, gains.pitch, self._variant),
            exponential_law(right_px, gains.roll, self._variant),
            -exponential_law(below_px, gains.heave, self._variant),
            self._yaw.stick_percent(right_px, sight.t_s, sight.heading_error_deg),
        )

    def reset(self) -> None:
        """Forget the last heading error."""
        self._yaw.reset()


class LinearFar:
    """The paper's linear P [Lee2022, §Long-range Tracking Controller]; pitch is linear in Table 1 already."""

    def __init__(self, baselines: FarBaselines, variant: FarVariant, tables: FarTables, yaw: FarYaw) -> None:
        self._match_px, self._variant, self._tables, self._yaw = baselines.match_px, variant, tables, yaw

    def sticks(self, sight: FarSight) -> SticksPercent:
        """Each axis proportional to its error."""
        gains = self._tables.of(sight.target)
        too_small_px2, right_px, below_px = _errors(sight, gains, self._yaw.focal_px)
        return SticksPercent(
            exponential_law(too_small_px2, gains.pitch, self._variant),
            clamp(self._k_p(gains.roll) * right_px, 100.0),
            clamp(-self._k_p(gains.heave) * below_px, 100.0),
            self._yaw.stick_percent(right_px, sight.t_s, sight.heading_error_deg),
        )

    def reset(self) -> None:
        """Forget the last heading error."""
        self._yaw.reset()

    def _k_p(self, gains: FarGains) -> float:
        return exponential_law(self._match_px, gains, self._variant) / self._match_px


class PidFar:
    """The paper's linear PID [Lee2022, §Long-range Tracking Controller]; pitch is linear in Table 1 already."""

    def __init__(self, baselines: FarBaselines, variant: FarVariant, tables: FarTables, yaw: FarYaw) -> None:
        self._baselines, self._variant, self._tables, self._yaw = baselines, variant, tables, yaw
        self._roll = self._heave = PidMemory()

    def sticks(self, sight: FarSight) -> SticksPercent:
        """PID on column and row."""
        gains = self._tables.of(sight.target)
        too_small_px2, right_px, below_px = _errors(sight, gains, self._yaw.focal_px)
        roll, self._roll = pid_law(right_px, sight.t_s, self._roll, self._baselines.roll)
        heave, self._heave = pid_law(-below_px, sight.t_s, self._heave, self._baselines.heave)
        return SticksPercent(
            exponential_law(too_small_px2, gains.pitch, self._variant),
            roll,
            heave,
            self._yaw.stick_percent(right_px, sight.t_s, sight.heading_error_deg),
        )

    def reset(self) -> None:
        """Forget the last errors; the integrals stay."""
        self._roll, self._heave = replace(self._roll, error=None), replace(self._heave, error=None)
        self._yaw.reset()


def far_control(
    kind: FarKind, variant: FarVariant, baselines: FarBaselines, near: NearParameters, tables: FarTables, camera: Camera
) -> FarControl:
    """The far control of `guidance.far_control`.

    Args:
        kind: which law.
        variant: how the exponential law is read.
        baselines: constants of the linear laws, of the published camera.
        near: gives the yaw law.
        tables: Table 1 in the pixels of `camera`.
        camera: in use.
    """
    yaw, baselines = FarYaw(near.yaw, near.derivative, camera.focal_px), _scaled_baselines(baselines, camera)
    if kind == "p":
        return LinearFar(baselines, variant, tables, yaw)
    if kind == "pid":
        return PidFar(baselines, variant, tables, yaw)
    return PublishedFar(variant, tables, yaw)


def _errors(sight: FarSight, gains: FarParameters, focal_px: float) -> tuple[float, float, float]:
    """Area missing [px²], and how far the box is right of and below its setpoint [px].

    As in a level camera along the nose: the gimbal follows the target, so that a steep one stays in the picture. Not a
    number where box or gimbal are not finite: the laws then give no stick.
    """
    box, setpoint_px, gimbal = sight.box, gains.heave.setpoint, sight.gimbal
    if not all(map(math.isfinite, (*box.centre_px, *box.size_px, gimbal.pitch_rad, gimbal.yaw_rad))):
        return math.nan, math.nan, math.nan
    below_rad = math.atan2(box.centre_px[1] - setpoint_px, focal_px) - gimbal.pitch_rad
    return (
        gains.pitch.setpoint - box.area_px2,
        box.centre_px[0] - gains.roll.setpoint + focal_px * math.tan(clamp(gimbal.yaw_rad, _STEEPEST_RAD)),
        focal_px * math.tan(clamp(below_rad, _STEEPEST_RAD)),
    )


_STEEPEST_RAD = math.radians(80.0)
