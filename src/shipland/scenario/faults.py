"""What can be made to fail in a simulated flight, and when (`[[fault]]`, `[fault_draw]`)."""

from __future__ import annotations

import enum
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shipland.config import key, parameters, require
from shipland.scenario.seeds import generators_of

if TYPE_CHECKING:
    from shipland.flight import Autonomy
    from shipland.scenario.faulty import FaultyVehicle
    from shipland.scenario.scenario import Scenario
    from shipland.vehicles.simulated import SimulatedVehicle


class FaultKind(enum.Enum):
    """One thing that fails; `size` of a fault means what is said here."""

    DROPPED_FRAMES = "dropped_frames"
    """Pictures are lost; size: share of them."""
    FROZEN_FRAMES = "frozen_frames"
    """The stream repeats its last picture with new time stamps."""
    WRONG_SIZE_FRAMES = "wrong_size_frames"
    """Pictures come at half their width and height."""
    CORRUPT_FRAMES = "corrupt_frames"
    """Blocks of the picture are noise; size: share of them."""
    OCCLUSION = "occlusion"
    """Something stands before the middle of the picture: spray, rain on the lens, a crane."""
    GLARE = "glare"
    """The sun in the lens; size: share of pictures in which nothing is left to see."""
    LATENCY_JUMP = "latency_jump"
    """Pictures come later; size: by how much [s]."""
    OLD_PICTURES = "old_pictures"
    """Pictures show what was longer ago than their time stamps say; size: by how much [s]."""
    FROZEN_GIMBAL = "frozen_gimbal"
    """The reading of the camera's attitude stands still, with new time stamps, while the camera moves."""
    STALE_GIMBAL = "stale_gimbal"
    """The reading of the camera's attitude stands still, and says how old it is."""
    NAN_TELEMETRY = "nan_telemetry"
    """Every value of the telemetry is NaN."""
    STALE_TELEMETRY = "stale_telemetry"
    """Telemetry stands still, its values' times with it."""
    COMPASS_BIAS = "compass_bias"
    """The compass is off; size: by how much [deg]."""
    FLOW_BIAS = "flow_bias"
    """The velocity is off, in the fault's direction or a level one that is drawn; size: by how much [m/s]."""
    FROZEN_BAROMETER = "frozen_barometer"
    """The height stands still, with new time stamps."""
    STALE_BAROMETER = "stale_barometer"
    """The height stands still, its time with it."""
    SPOILED_VALUES = "spoiled_values"
    """Any field of frames, observations and telemetry is NaN, infinite, out of range, missing or old; size: share."""
    FALSE_POSE = "false_pose"
    """A decoy's pose instead of the bar's; size: how far it is off, sideways [m]."""
    MISSTATED_CUE = "misstated_cue"
    """The cue is stated larger than it is, and so is every distance to it; size: by what share of its own size."""
    REFLECTION = "reflection"
    """The pose of the bar's mirror image; size: height of the bar over the mirror [m]."""
    FALSE_BOX = "false_box"
    """A detector's confident box of something else, for bar and ship."""
    VISION_RAISES = "vision_raises"
    """The vision raises an exception on every picture."""
    LINK_LOSS = "link_loss"
    """No picture, no telemetry and no command comes through."""
    PROCESS_STALL = "process_stall"
    """The process stands still before a decision, once, for the fault's duration."""
    LOW_BATTERY = "low_battery"
    """The battery says `size` percent."""
    WEAK_MOTOR = "weak_motor"
    """A motor, drawn, gives less thrust; size: the share that is missing."""
    REVERSED_PITCH = "reversed_pitch"
    """The vehicle answers the pitch stick the other way round, as a driver with a wrong sign makes it."""
    REVERSED_ROLL = "reversed_roll"
    """Likewise the roll stick."""
    REVERSED_HEAVE = "reversed_heave"
    """Likewise the heave stick."""
    REVERSED_YAW = "reversed_yaw"
    """Likewise the yaw stick."""
    PILOT_RAISES = "pilot_raises"
    """The pilot raises an exception in every cycle."""
    PILOT_STALLS = "pilot_stalls"
    """The pilot takes the fault's duration for one decision, on data of before."""


SIZES = {
    FaultKind.DROPPED_FRAMES: 0.8,
    FaultKind.CORRUPT_FRAMES: 0.5,
    FaultKind.GLARE: 0.7,
    FaultKind.LATENCY_JUMP: 0.4,
    FaultKind.OLD_PICTURES: 0.5,
    FaultKind.COMPASS_BIAS: 20.0,
    FaultKind.FLOW_BIAS: 0.5,
    FaultKind.SPOILED_VALUES: 0.5,
    FaultKind.FALSE_POSE: 1.5,
    FaultKind.MISSTATED_CUE: 0.1,
    FaultKind.REFLECTION: 1.0,
    FaultKind.LOW_BATTERY: 10.0,
    FaultKind.WEAK_MOTOR: 0.15,
}
"""Sizes of faults that give none; chosen."""
_SHARES = {FaultKind.DROPPED_FRAMES, FaultKind.CORRUPT_FRAMES, FaultKind.GLARE, FaultKind.SPOILED_VALUES}


@parameters
class Fault:
    """One fault (`[[fault]]`)."""

    kind: FaultKind = key(..., "what fails")
    start_s: float = key(..., "when, in the flight's time", ge=0)
    duration_s: float = key(..., "for how long", gt=0)
    size: float | None = key(None, "how much, as `FaultKind` says; None: `SIZES`")
    direction_in_level: tuple[float, float, float] | None = key(
        None, "(3,) of a velocity that is off, forward, right, down, as a unit vector; None: drawn"
    )

    def __post_init__(self) -> None:
        if self.kind in _SHARES:
            require(0.0 < self.amount <= 1.0, f"size of {self.kind.value} is a share, got {self.size}")
        if self.kind is FaultKind.WEAK_MOTOR:
            require(0.0 < self.amount < 1.0, f"size of weak_motor must be in (0, 1), got {self.size}")
        if self.kind is FaultKind.OLD_PICTURES:
            require(self.amount > 0.0, f"size of old_pictures must be positive, got {self.size}")
        if self.kind is FaultKind.MISSTATED_CUE:
            require(self.amount > -1.0, f"size of misstated_cue must be above -1, got {self.size}")
        if self.direction_in_level is not None:
            require(self.kind is FaultKind.FLOW_BIAS, f"{self.kind.value} has no direction_in_level")
            length = math.hypot(*self.direction_in_level)
            require(abs(length - 1.0) < 1e-6, f"direction_in_level must be a unit vector, got length {length:g}")

    @property
    def end_s(self) -> float:
        """When it is over."""
        return self.start_s + self.duration_s

    @property
    def amount(self) -> float:
        """`size`, or what stands in for it."""
        return SIZES.get(self.kind, 1.0) if self.size is None else self.size

    def covers(self, t_s: float) -> bool:
        """Whether a time lies in it."""
        return self.start_s <= t_s < self.end_s


@parameters
class FaultDraw:
    """Faults drawn by the flight's seed (`[fault_draw]`)."""

    kinds: tuple[FaultKind, ...] = key(
        (), "among which is drawn; empty: nothing fails", "among which is drawn; none: nothing fails"
    )
    every_kind: bool = key(False, "drawn among all there are", "true: among all")
    count: int = key(1, "faults a flight", ge=1)
    earliest_s: float = key(2.0, "first start of a fault", ge=0)
    latest_s: float = key(15.0, "last start of a fault", "a near landing takes 15 s")
    shortest_s: float = key(0.5, "shortest fault", gt=0)
    longest_s: float = key(4.0, "longest fault")
    size: float | None = key(None, "of each; None: a half to one and a half of its usual size")
    direction_in_level: tuple[float, float, float] | None = key(None, "of each that has one, as in `Fault`")

    def __post_init__(self) -> None:
        require(0.0 <= self.earliest_s <= self.latest_s, "0 <= earliest_s <= latest_s must hold")
        require(0.0 < self.shortest_s <= self.longest_s, "0 < shortest_s <= longest_s must hold")

    def draw(self, rng: np.random.Generator) -> tuple[Fault, ...]:
        """Faults in order of time."""
        kinds = tuple(FaultKind) if self.every_kind else self.kinds
        if not kinds:
            return ()
        drawn = []
        for _ in range(self.count):
            kind = kinds[int(rng.integers(len(kinds)))]
            start_s = float(rng.uniform(self.earliest_s, self.latest_s))
            duration_s = float(rng.uniform(self.shortest_s, self.longest_s))
            size = SIZES.get(kind, 1.0) * float(rng.uniform(0.5, 1.5))
            size = size if self.size is None else self.size
            direction = self.direction_in_level if kind is FaultKind.FLOW_BIAS else None
            drawn.append(Fault(kind, start_s, duration_s, min(size, 1.0) if kind in _SHARES else size, direction))
        return tuple(sorted(drawn, key=lambda fault: fault.start_s))


def faults_of(scenario: Scenario, seed: int) -> tuple[Fault, ...]:
    """What fails in the flight of `seed`, in order of time: what is scheduled, and what is drawn."""
    drawn = scenario.fault_draw.draw(generators_of(seed).faults.spawn(1)[0])
    return tuple(sorted((*scenario.fault, *drawn), key=lambda fault: fault.start_s))


def with_faults(
    scenario: Scenario, vehicle: SimulatedVehicle, autonomy: Autonomy, seed: int
) -> tuple[SimulatedVehicle | FaultyVehicle, Autonomy]:
    """Vehicle and autonomy of the flight of `seed`, failing as the scenario says; unchanged where nothing fails."""
    faults = faults_of(scenario, seed)
    if not faults:
        return vehicle, autonomy
    from shipland.scenario.faulty import FaultyPilot, FaultyVehicle, FaultyVision  # a sound flight does without

    faulty = FaultyVehicle(vehicle, faults, generators_of(seed).faults.spawn(2)[1])
    return faulty, replace(
        autonomy, vision=FaultyVision(autonomy.vision, faulty), pilot=FaultyPilot(autonomy.pilot, faulty)
    )
