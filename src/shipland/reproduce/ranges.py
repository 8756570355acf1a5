"""A range for far control: the simulated aircraft under one far control alone, with true boxes at the paper's delays.

The pieces are those that fly: world, vehicle with its latencies, the loop, the safety. Only eyes and modes are
replaced: the eyes give the true boxes of ship and bar, the pilot hands them to the far control.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from shipland.camera import Camera, CameraParameters
from shipland.config import build, merge
from shipland.flight import fly
from shipland.frames import Array
from shipland.guidance.far import FarSight, FarTables, FarTarget, far_control
from shipland.guidance.parameters import FarKind, FarVariant
from shipland.guidance.pilot import PilotSetup
from shipland.messages import Box, Decision, FlightRecord, Frame, Mode, Observation, PilotCommand, Telemetry
from shipland.rig import Rig
from shipland.scenario.autonomy import build_autonomy, build_vehicle
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table
from shipland.sim.state import board_corners_in_bar_m
from shipland.vehicles.simulated import SimulatedVehicle

BAR_RANGE_M = 100.0
"""The bar's detector finds it to 100 m [Lee2022, §Machine Learning Based Approach]."""


@dataclass(frozen=True)
class FarCase:
    """One flight under far control.

    Attributes:
        distance_m: over ground from the deck's centre at the start.
        offset_deg: how far right of the picture's middle the ship stands at the start; the nose is on the course.
        height_m: above the neutral deck at the start.
        wind_mps: steady side wind, from port.
        kind, variant: of the far control.
        noise_px: standard deviation of each edge of a box.
        approach: fly pitch and yaw too, and on the bar within its range; else these sticks stay zero, which holds.
        duration_s: of the flight.
        below_deg: below the horizon the box is wanted (Table 1: on it): more lifts the reference point off the sea.
    """

    distance_m: float
    offset_deg: float
    height_m: float
    wind_mps: float
    kind: FarKind
    variant: FarVariant
    noise_px: float
    approach: bool
    duration_s: float
    below_deg: float = 0.0


@dataclass(frozen=True)
class FarTrace:
    """What happened, at (n,) exposure times.

    Attributes:
        off_px: (n, 2) true position of the target's box right of and below its setpoint.
        area_px2: (n,) of the target's true box.
        on_bar: (n,) the bar was flown on.
        sticks_percent: (n, 4) pitch, roll, heave, yaw, after the safety.
        place_in_ship_m: (n, 3) forward, starboard, down.
        heading_deg: (n,) true.
    """

    t_s: Array
    off_px: Array
    area_px2: Array
    on_bar: npt.NDArray[np.bool_]
    sticks_percent: Array
    place_in_ship_m: Array
    heading_deg: Array


class TrueBoxes:
    """Eyes that see the true boxes, with noise on their edges."""

    def __init__(self, vehicle: SimulatedVehicle, rig: Rig, noise_px: float, rng: np.random.Generator) -> None:
        self._vehicle, self._noise_px, self._rng = vehicle, noise_px, rng
        self._ship_in_ship_m, self._bar_in_bar_m = ship_points_in_ship_m(rig), board_corners_in_bar_m(rig)

    def see(self, frame: Frame) -> Observation:
        """Both boxes, the bar's within its detection range."""
        noise_px = self._noise_px * self._rng.normal(size=(2, 4))
        truth = self._vehicle.truth_at(frame.t_s)
        if truth is None:
            return Observation(frame.t_s, frame.gimbal, learned=True)
        camera, camera_from_ned = self._vehicle.camera, truth.ned_from_camera.inverse()
        camera_from_bar = camera_from_ned @ truth.ned_from_bar
        ship = box_of(camera, (camera_from_ned @ truth.ned_from_ship).apply(self._ship_in_ship_m), noise_px[0])
        bar = None
        if float(np.linalg.norm(camera_from_bar.translation_m)) <= BAR_RANGE_M:
            bar = box_of(camera, camera_from_bar.apply(self._bar_in_bar_m), noise_px[1])
        return Observation(frame.t_s, frame.gimbal, bar_box=bar, ship_box=ship, learned=True)


def box_of(camera: Camera, points_in_camera_m: Array, noise_px: Array) -> Box | None:
    """The box around points (n, 3), its edges shifted by `noise_px` (4,); None when it is not all in the picture."""
    pixels = camera.project(points_in_camera_m)
    if not np.isfinite(pixels).all():
        return None
    left, top = pixels.min(axis=0) + noise_px[:2]
    right, bottom = pixels.max(axis=0) + noise_px[2:]
    if left < 0.0 or top < 0.0 or right > camera.width_px - 1 or bottom > camera.height_px - 1:
        return None
    return Box((0.5 * (left + right), 0.5 * (top + bottom)), (max(1.0, right - left), max(1.0, bottom - top)), 1.0)


def ship_points_in_ship_m(rig: Rig) -> Array:
    """(8, 3) hull to the deck's height over its whole length, and the superstructure's front and top at the bar."""
    stern_m, half_m = -rig.deck_ahead_of_stern_m, 0.5 * rig.platform_width_m
    bow_m, house_m = stern_m + rig.platform_length_m, stern_m + rig.bar_ahead_of_stern_m
    ground_m, top_m = rig.deck_height_m, rig.deck_height_m - rig.superstructure_height_m
    ends = [(stern_m, ground_m), (stern_m, 0.0), (house_m, top_m), (bow_m, top_m)]
    return np.array([(forward, side * half_m, down) for forward, down in ends for side in (-1.0, 1.0)])


class FarPilot:
    """Far control and nothing else."""

    def __init__(self, setup: PilotSetup, case: FarCase) -> None:
        guidance, self._case = setup.guidance, case
        tables = FarTables.for_camera(guidance.ship, guidance.bar, setup.camera)
        self._far = far_control(case.kind, case.variant, guidance.far_baselines, guidance.near, tables, setup.camera)
        self._mode = Mode.SEARCH
        self._command = PilotCommand.hold(0.0, 0.0)

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:  # noqa: ARG002
        """The sticks for the best box; without one the last sticks go on."""
        case, box, target, mode = self._case, observation.ship_box, FarTarget.SHIP, Mode.TRACK_SHIP
        if case.approach and observation.bar_box is not None:
            box, target, mode = observation.bar_box, FarTarget.BAR, Mode.TRACK_BAR
        if mode is not self._mode:
            self._far.reset()
            self._mode = mode
        if box is not None:
            heading_rad = telemetry.heading_rad
            error_deg = -math.degrees(heading_rad) if heading_rad is not None else None
            sight = FarSight(box, target, observation.t_s, observation.gimbal, error_deg)
            pitch, roll, heave, yaw = self._far.sticks(sight)
            pitch, yaw = (pitch, yaw) if case.approach else (0.0, 0.0)
            self._command = PilotCommand(telemetry.t_s, pitch, roll, heave, yaw, 0.0)
        return Decision(self._command, mode, "far control alone")


def exact_start(distance_m: float, bearing_deg: float, height_m: float) -> dict[str, float]:
    """`[start]` of one place, the nose on the ship's course."""
    place = {"distance_m": distance_m, "bearing_deg": bearing_deg, "height_m": height_m}
    spreads = ("distance_half_range_m", "bearing_half_range_deg", "height_half_range_m", "heading_error_half_range_deg")
    return place | {"heading_error_deg": bearing_deg} | dict.fromkeys(spreads, 0.0)


def fly_far(case: FarCase, overlay: dict[str, Any] | None = None) -> FarTrace:
    """Fly one case; the same case gives the same trace."""
    table: dict[str, Any] = {
        "description": "far control alone",
        "ship": {"motion": "still"},
        "time_limit_s": case.duration_s,
        "start": exact_start(case.distance_m, -case.offset_deg, case.height_m),
        "wind": {
            "mean_mps": case.wind_mps,
            "mean_half_range_mps": 0.0,
            "from_deg": 270.0,
            "from_half_range_deg": 0.0,
            "turbulence": {"enabled": False},
            "airwake": {"enabled": False},
        },
    }
    base = merge(merge(scenario_table("near"), table), overlay or {})
    focal_px = Camera.from_parameters(build(CameraParameters, base["camera"])).focal_px
    row_px = base["guidance"]["ship"]["heave"]["setpoint"] + focal_px * math.tan(math.radians(case.below_deg))
    scenario = load_scenario(merge(base, {"guidance": {"ship": {"heave": {"setpoint": row_px}}}}))
    vehicle = build_vehicle(scenario, 1, None)
    eyes = TrueBoxes(vehicle, scenario.rig, case.noise_px, np.random.default_rng([1, 1]))
    autonomy = build_autonomy(scenario, vehicle, partial(FarPilot, case=case), lambda _: eyes, 1)
    records: list[FlightRecord] = []
    fly(vehicle, autonomy, case.duration_s, lambda: 0.0, records.append)
    return _trace(records, scenario, vehicle.camera)


def _trace(records: list[FlightRecord], scenario: Scenario, camera: Camera) -> FarTrace:
    rig, silent_px = scenario.rig, np.zeros(4)
    ship_m, bar_m = ship_points_in_ship_m(rig), board_corners_in_bar_m(rig)
    rows = []
    for record in records:
        truth, command = record.truth, record.decision.command
        if truth is None:
            continue
        on_bar = record.decision.mode is Mode.TRACK_BAR
        ned_from_target, points_m = (truth.ned_from_bar, bar_m) if on_bar else (truth.ned_from_ship, ship_m)
        box = box_of(camera, (truth.ned_from_camera.inverse() @ ned_from_target).apply(points_m), silent_px)
        gains = scenario.guidance.bar if on_bar else scenario.guidance.ship
        off = (np.nan, np.nan, np.nan)
        if box is not None:
            off = (box.centre_px[0] - gains.roll.setpoint, box.centre_px[1] - gains.heave.setpoint, box.area_px2)
        place_m = (truth.ned_from_ship.inverse() @ truth.ned_from_body).translation_m
        heading_deg = math.degrees(math.atan2(truth.ned_from_body.rotation[1, 0], truth.ned_from_body.rotation[0, 0]))
        rows.append((truth.t_s, *off, on_bar, *command.sticks_percent, *place_m, heading_deg))
    table = np.array(rows, dtype=float).reshape(-1, 13)
    return FarTrace(
        table[:, 0], table[:, 1:3], table[:, 3], table[:, 4] > 0.0, table[:, 5:9], table[:, 9:12], table[:, 12]
    )
