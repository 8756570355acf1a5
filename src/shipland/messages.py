"""The frozen dataclasses that cross a stage. Arrays are checked at construction. Frames: see `frames`."""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from shipland.frames import Array, Pose, shape_of, wrap_angle


def _check_shape(owner: str, name: str, value: npt.NDArray[np.generic], shape: tuple[int | None, ...]) -> None:
    got = shape_of(value)
    if got == shape:
        return
    if len(got) != len(shape) or any(want is not None and want != have for want, have in zip(shape, got, strict=True)):
        wanted = str(tuple("n" if want is None else want for want in shape)).replace("'", "")
        raise ValueError(f"{owner}.{name} wants shape {wanted}, got {got}")


@dataclass(frozen=True)
class GimbalAttitude:
    """Attitude of the camera mount against the aircraft's `level` frame.

    Attributes:
        roll_rad: right side down positive.
        pitch_rad: upward positive.
        yaw_rad: clockwise from above positive.
    """

    roll_rad: float
    pitch_rad: float
    yaw_rad: float = 0.0


@dataclass(frozen=True)
class Frame:
    """One picture.

    Attributes:
        t_s: exposure time [s].
        image: (H, W, 3) uint8 BGR; None from a vehicle whose camera is geometric.
        gimbal: attitude of the camera at exposure, in `level`.
        height_m: about how high the vehicle said it was over the water or its take-off point; None where it did not.
        stamp_s: the exposure by the vehicle's own clock, where that has leapt [s]; None: `t_s`.
        gimbal_age_s: from the exposure to the nearest reading of the camera's attitude [s]; infinite without any.
    """

    t_s: float
    image: np.ndarray[tuple[Any, ...], np.dtype[np.uint8]] | None
    gimbal: GimbalAttitude
    height_m: float | None = None
    stamp_s: float | None = None
    gimbal_age_s: float = 0.0

    def __post_init__(self) -> None:
        if self.image is not None:
            _check_shape("Frame", "image", self.image, (None, None, 3))
            if self.image.dtype != np.uint8:
                raise ValueError(f"Frame.image wants uint8, got {self.image.dtype}")


@dataclass(frozen=True)
class Telemetry:
    """What the vehicle says of itself; what it cannot give is None.

    Attributes:
        t_s: time of receipt [s]: "now" for the loop.
        roll_rad, pitch_rad: attitude of `body` against `level`.
        heading_rad: magnetometer's heading, clockwise from north.
        height_m: height above the take-off point (barometer).
        velocity_in_level_mps: (3,) forward-right-down; over ground, or from optical flow over the surface in view.
        battery_percent, link_percent: 0 … 100.
        flying: motors run and the vehicle is not landed.
        attitude_t_s, heading_t_s, height_t_s, velocity_t_s: when these values were true, on the vehicle's clock [s];
            None means `t_s`.
        alerts: what the vehicle itself says is wrong with it, in words; empty while it is well.
    """

    t_s: float
    roll_rad: float | None = None
    pitch_rad: float | None = None
    heading_rad: float | None = None
    height_m: float | None = None
    velocity_in_level_mps: Array | None = None
    battery_percent: float | None = None
    link_percent: float | None = None
    flying: bool = False
    attitude_t_s: float | None = None
    heading_t_s: float | None = None
    height_t_s: float | None = None
    velocity_t_s: float | None = None
    alerts: str = ""

    def __post_init__(self) -> None:
        if self.velocity_in_level_mps is not None:
            _check_shape("Telemetry", "velocity_in_level_mps", self.velocity_in_level_mps, (3,))

    @property
    def newest_s(self) -> float:
        """When the newest of its values was true; `t_s` where none says so [s]."""
        times_s = (self.attitude_t_s, self.heading_t_s, self.height_t_s, self.velocity_t_s)
        return max((time_s for time_s in times_s if time_s is not None), default=self.t_s)


@dataclass(frozen=True)
class Box:
    """A detector's axis-aligned box.

    Attributes:
        centre_px: column, row.
        size_px: width, height.
        confidence: 0 … 1.
    """

    centre_px: tuple[float, float]
    size_px: tuple[float, float]
    confidence: float

    @property
    def area_px2(self) -> float:
        """Width × height [px²]."""
        return self.size_px[0] * self.size_px[1]


@dataclass(frozen=True)
class BarPose:
    """The camera against the cue, from its corners.

    Attributes:
        position_in_bar_m: (3,) the camera's optical centre in `bar` [m]; astern of the bar is negative forward.
        yaw_rad: heading of the camera's vertical plane against `bar`'s forward axis, clockwise from above.
        covariance: (4,4) of (position_in_bar_m, yaw_rad), [m, m, m, rad].
        reprojection_px: root-mean-square distance of observed and reprojected corners.
        corners_px: (4n, 2) observed corners (column, row), quadrilateral by quadrilateral, in the target's order.
    """

    position_in_bar_m: Array
    yaw_rad: float
    covariance: Array
    reprojection_px: float
    corners_px: Array

    def __post_init__(self) -> None:
        _check_shape("BarPose", "position_in_bar_m", self.position_in_bar_m, (3,))
        _check_shape("BarPose", "covariance", self.covariance, (4, 4))
        if shape_of(self.corners_px)[1:] != (2,):
            _check_shape("BarPose", "corners_px", self.corners_px, (None, 2))


@dataclass(frozen=True)
class DeckSight:
    """The deck below, by its markings: the camera looks down to choose the moment of the landing.

    Attributes:
        centre_in_level_m: (3,) the deck's centre from the camera: forward, right, down, level, as the nose looks [m].
        deviation_m: (3,) standard deviation of it along each axis [m].
        normal_in_level: (3,) unit vector of the deck's down axis; None from a vision that gives no attitude.
    """

    centre_in_level_m: Array
    deviation_m: Array
    normal_in_level: Array | None = None

    def __post_init__(self) -> None:
        _check_shape("DeckSight", "centre_in_level_m", self.centre_in_level_m, (3,))
        _check_shape("DeckSight", "deviation_m", self.deviation_m, (3,))
        if self.normal_in_level is not None:
            _check_shape("DeckSight", "normal_in_level", self.normal_in_level, (3,))


@dataclass(frozen=True)
class Observation:
    """The best the vision has of one frame, and why the better was refused.

    Attributes:
        t_s: exposure time of the frame [s].
        gimbal: the camera's attitude at exposure, in `level`.
        bar_pose: from corners (modes 1, 2).
        bar_box: from the bar detector (mode 3).
        ship_box: from the ship detector (mode 4).
        reason: why there is no pose, in words; empty when there is one.
        learned: a learned detector ran on the frame, whatever it found; cycles are timed by it.
        deck: the deck, of a picture that looks down on it; nothing else is looked for there.
        gimbal_off_rad: angle of the bar's vertical to the gimbal's, where they contradict each other and the pose was
            refused; else 0.
        waves_off: the ship's status light was seen red.
    """

    t_s: float
    gimbal: GimbalAttitude
    bar_pose: BarPose | None = None
    bar_box: Box | None = None
    ship_box: Box | None = None
    reason: str = ""
    learned: bool = False
    deck: DeckSight | None = None
    gimbal_off_rad: float = 0.0
    waves_off: bool = False

    @property
    def nose_pose(self) -> BarPose | None:
        """The pose with the heading of the nose: the camera's may be another."""
        pose, aside_rad = self.bar_pose, self.gimbal.yaw_rad
        return pose if pose is None or aside_rad == 0.0 else replace(pose, yaw_rad=wrap_angle(pose.yaw_rad - aside_rad))


Message = TypeVar("Message", bound=Telemetry | BarPose | DeckSight | Observation)


def copied(message: Message) -> Message:
    """The same in arrays of its own."""
    own: dict[str, Any] = {
        name: part.copy("K") if isinstance(part, np.ndarray) else copied(part)
        for name, part in vars(message).items()
        if isinstance(part, np.ndarray | BarPose | DeckSight)
    }
    return replace(message, **own) if own else message


class Intent(enum.Enum):
    """What the command is for: a vehicle flies the sticks of each but HOLD, and may map LAND to its own landing."""

    FLY = "fly"
    LAND = "land"
    HOLD = "hold"
    """Keep the place; the sticks count for nothing."""
    SEARCH = "search"
    """Turn and climb without any sight of the ship."""
    GO_AROUND = "go_around"


class Override(enum.Enum):
    """What the person at the keys asks for, over pilot and safety."""

    HOLD = "held by key h"
    CLIMB = "climbing by key c"


class Mode(enum.Enum):
    """The flight modes as they are flown; 1 to 5 have the paper's numbers [Lee2022, §Nonlinear Control System]."""

    SEARCH = 6
    TRACK_SHIP = 4
    TRACK_BAR = 3
    APPROACH = 2
    LAND = 1
    NO_VISION = 5
    GO_AROUND = 7
    DONE = 8


@dataclass(frozen=True)
class PilotCommand:
    """Sticks in percent, -100 … 100; zero holds.

    Attributes:
        t_s: when the command was ready [s].
        pitch_percent: forward positive.
        roll_percent: right positive.
        heave_percent: up positive.
        yaw_percent: clockwise (nose right) positive.
        gimbal_pitch_rad: commanded camera pitch, against the horizon, upward positive.
        intent: what it is for.
        at_contact_height: a fresh sight of the bar or the deck shows the aircraft over the deck, low enough to touch.
            The safety sets it; without it no vehicle presses on the deck or stops its motors by itself.
    """

    t_s: float
    pitch_percent: float
    roll_percent: float
    heave_percent: float
    yaw_percent: float
    gimbal_pitch_rad: float
    intent: Intent = Intent.FLY
    at_contact_height: bool = False

    @property
    def sticks_percent(self) -> tuple[float, float, float, float]:
        """Pitch, roll, heave, yaw."""
        return self.pitch_percent, self.roll_percent, self.heave_percent, self.yaw_percent

    @staticmethod
    def hold(t_s: float, gimbal_pitch_rad: float) -> PilotCommand:
        """Every stick at zero: the vehicle brakes and holds."""
        return PilotCommand(t_s, 0.0, 0.0, 0.0, 0.0, gimbal_pitch_rad, Intent.HOLD)


@dataclass(frozen=True)
class Estimate:
    """Where the pilot believes the aircraft is, and when: compare it with the truth of `t_s`, of no other time.

    Attributes:
        t_s: the time that the values below are valid for [s]; an exposure, or later where the pilot predicts.
        aircraft_in_bar_m: (3,) the aircraft's centre of mass in `bar`.
        yaw_rad: heading of `level` against `bar`, clockwise from above.
        velocity_in_bar_mps: (3,) rate of `aircraft_in_bar_m`, or None.
        covariance: (4,4) of (aircraft_in_bar_m, yaw_rad), [m, m, m, rad], or None.
    """

    t_s: float
    aircraft_in_bar_m: Array
    yaw_rad: float
    velocity_in_bar_mps: Array | None = None
    covariance: Array | None = None

    def __post_init__(self) -> None:
        _check_shape("Estimate", "aircraft_in_bar_m", self.aircraft_in_bar_m, (3,))
        if self.velocity_in_bar_mps is not None:
            _check_shape("Estimate", "velocity_in_bar_mps", self.velocity_in_bar_mps, (3,))
        if self.covariance is not None:
            _check_shape("Estimate", "covariance", self.covariance, (4, 4))


@dataclass(frozen=True)
class Decision:
    """What the pilot decided in one cycle.

    Attributes:
        command: the sticks; in the log, those that left the safety.
        mode: flight mode; None from a pilot that has no modes.
        reason: why, in words.
        estimate: the pilot's estimate with its time, or None.
        landing_probability: that a final descent begun now, or the one that is flown, ends as a landing in the area;
            None while there is no landing, or from a pilot that does not tell it.
    """

    command: PilotCommand
    mode: Mode | None
    reason: str
    estimate: Estimate | None = None
    landing_probability: float | None = None

    @property
    def override(self) -> Override | None:
        """Which key of a person made it; its reason begins with that."""
        return next((override for override in Override if self.reason.startswith(override.value)), None)


@dataclass(frozen=True)
class GroundTruth:
    """The simulator's truth at one instant: to the record, never to the pilot.

    Attributes:
        t_s: time [s].
        ned_from_body: the aircraft.
        velocity_in_ned_mps: (3,) of the aircraft, over ground.
        ned_from_ship: ship's position and course, without deck motion.
        ned_from_deck: the deck with all motions.
        ned_from_bar: the bar (level).
        ned_from_camera: optical centre, OpenCV axes.
        wind_in_ned_mps: (3,) air velocity at the aircraft.
        waves_off: the ship's status light shines red.
    """

    t_s: float
    ned_from_body: Pose
    velocity_in_ned_mps: Array
    ned_from_ship: Pose
    ned_from_deck: Pose
    ned_from_bar: Pose
    ned_from_camera: Pose
    wind_in_ned_mps: Array
    waves_off: bool = False

    def __post_init__(self) -> None:
        _check_shape("GroundTruth", "velocity_in_ned_mps", self.velocity_in_ned_mps, (3,))
        _check_shape("GroundTruth", "wind_in_ned_mps", self.wind_in_ned_mps, (3,))

    @property
    def aircraft_in_deck_m(self) -> Array:
        """(3,) the aircraft's centre of mass in `deck`."""
        return (self.ned_from_deck.inverse() @ self.ned_from_body).translation_m

    @property
    def aircraft_in_bar_m(self) -> Array:
        """(3,) the aircraft's centre of mass in `bar`."""
        return (self.ned_from_bar.inverse() @ self.ned_from_body).translation_m


@dataclass(frozen=True)
class TouchdownVerdict:
    """How the flight met the deck, judged from contacts.

    Attributes:
        t_s: first contact [s].
        landed: came to rest on its feet on the deck, within every limit.
        in_square: the touchdown point lies in the landing square, or circle.
        touchdown_in_deck_m: (2,) forward, starboard of the aircraft's centre at first contact; NaN where the flight
            ended without contact with the deck, and then the next two as well.
        rest_in_deck_m: (2,) the same at rest (or at the end).
        relative_velocity_in_deck_mps: (3,) against the deck just before contact; down positive.
        tilt_rad: largest tilt of the aircraft's vertical against the deck's normal after contact.
        slip_m: distance that the aircraft slid over the deck between first contact and rest.
        peak_contact_force_n: largest summed normal force on the gear.
        reason: the verdict in words.
    """

    t_s: float
    landed: bool
    in_square: bool
    touchdown_in_deck_m: Array
    rest_in_deck_m: Array
    relative_velocity_in_deck_mps: Array
    tilt_rad: float
    slip_m: float
    peak_contact_force_n: float
    reason: str

    def __post_init__(self) -> None:
        _check_shape("TouchdownVerdict", "touchdown_in_deck_m", self.touchdown_in_deck_m, (2,))
        _check_shape("TouchdownVerdict", "rest_in_deck_m", self.rest_in_deck_m, (2,))
        _check_shape("TouchdownVerdict", "relative_velocity_in_deck_mps", self.relative_velocity_in_deck_mps, (3,))

    @property
    def success(self) -> bool:
        """Landed, and in the square."""
        return self.landed and self.in_square

    @property
    def touched(self) -> bool:
        """There was contact with the deck."""
        return bool(np.isfinite(self.touchdown_in_deck_m).all())

    @property
    def error_m(self) -> float:
        """Distance of the touchdown point from the deck's centre; NaN without contact, as the next two."""
        return float(np.hypot(*self.touchdown_in_deck_m))

    @property
    def sink_mps(self) -> float:
        """Down against the deck just before contact."""
        return float(self.relative_velocity_in_deck_mps[2])

    @property
    def slide_mps(self) -> float:
        """Over the deck just before contact."""
        return float(np.hypot(*self.relative_velocity_in_deck_mps[:2]))


@dataclass(frozen=True)
class FlightRecord:
    """One row of the flight log: one cycle of the loop."""

    frame: Frame
    telemetry: Telemetry
    observation: Observation
    decision: Decision
    truth: GroundTruth | None
