"""The contract of `Vehicle`, held by everything that can be flown here."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from shipland.camera import Camera, CameraParameters
from shipland.frames import wrap_angle
from shipland.guidance.modes import INTENTS
from shipland.messages import Frame, Intent, PilotCommand, Telemetry
from shipland.rig import Rig
from shipland.sim.ship.course import StraightCourse
from shipland.sim.ship.ship import Ship
from shipland.sim.wind import SteadyWind
from shipland.vehicles import link_vehicle, pace
from shipland.vehicles.delays import DelayParameters
from shipland.vehicles.replay import Recorded, ReplayVehicle
from shipland.vehicles.simulated import SimulatedVehicle
from shipland.vehicles.vehicle import Vehicle
from waiting import until
from worlds import natops, world

Arrived = Callable[[], list[float]]
"""The sticks that the far side goes by now: forward, right, up, in whatever unit."""
Made = Callable[[int], tuple[Vehicle, Arrived]]


def simulated(seed: int) -> SimulatedVehicle:
    rig = Rig()
    flown = world(
        distance_m=3.0,
        height_m=1.2,
        wind_mps=SteadyWind((4.0, 2.0, 0.0)),
        ship=Ship(rig, StraightCourse(0.3, 1.0), natops()),
        start={"distance_half_range_m": 1.0, "bearing_half_range_deg": 20.0},
        seed=seed,
    )
    camera = Camera.from_parameters(CameraParameters())
    delays = DelayParameters()
    return SimulatedVehicle(flown, camera, delays, None, np.random.default_rng(seed))


def replayed(seed: int) -> Vehicle:
    """A hover of the simulated vehicle, again."""
    vehicle = simulated(seed)
    vehicle.open()
    pairs = cycles(vehicle, 160, 0.0, 0.0, 0.0, 0.0, intent=Intent.HOLD)
    return ReplayVehicle([Recorded(frame, telemetry.t_s, telemetry) for frame, telemetry in pairs], vehicle.camera)


_benches = ExitStack()


def over_mavlink(kind: str) -> Made:
    """Before a stand-in autopilot, in real time."""

    def make(_seed: int) -> tuple[Vehicle, Arrived]:
        pytest.importorskip("pymavlink")
        if kind.endswith("by-mavsdk"):
            pytest.importorskip("mavsdk", reason="an independent MAVLink end: pip install mavsdk")
        from mavlink_bench import bench

        vehicle, autopilot, _ = _benches.enter_context(bench(kind))
        return vehicle, lambda: targeted(autopilot.report())

    return make


def targeted(report: dict[str, Any]) -> list[float]:
    if report["target"] == "tilt":
        roll, pitch, _, climb = report["values"]
        return [-pitch, roll, climb]
    return report["values"][:3] if report["target"] == "speed" else [np.nan] * 3


def over_olympe(_seed: int) -> tuple[Vehicle, Arrived]:
    """An ANAFI before Parrot's own device end, in real time; one at a time."""
    from anafi_bench import bench

    _benches.close()
    vehicle, aircraft = _benches.enter_context(bench())

    def arrived() -> list[float]:
        _, roll, pitch, _, up = (aircraft.report()["pcmd"] or [[np.nan] * 5])[-1][:5]
        return [pitch, roll, up]

    return vehicle, arrived


def over_ros2(options: str = "") -> Made:
    """Before a stand-in drone on ROS 2 topics, in real time."""

    def make(_seed: int) -> tuple[Vehicle, Arrived]:
        pytest.importorskip("cyclonedds", reason="the extra ros2")
        from ros2_bench import bench

        vehicle, drone = _benches.enter_context(bench(options))
        return vehicle, drone.arrived

    return make


def simulated_by_its_sticks(seed: int) -> tuple[Vehicle, Arrived]:
    vehicle = simulated(seed)
    return vehicle, lambda: [getattr(vehicle.world._sticks, name) for name in ("pitch", "roll", "heave")]


VEHICLES: dict[str, Made] = {
    "simulated": simulated_by_its_sticks,
    "replay": lambda seed: (replayed(seed), list),
    "ardupilot": over_mavlink("ardupilot"),
    "px4": over_mavlink("px4"),
    "ardupilot-by-mavsdk": over_mavlink("ardupilot-by-mavsdk"),
    "px4-by-mavsdk": over_mavlink("px4-by-mavsdk"),
    "anafi": over_olympe,
    "ros2": over_ros2(),
    "ros2-attitude": over_ros2("&kind=attitude"),
}
"""Everything that can be flown."""


def _marks(name: str) -> list[pytest.MarkDecorator]:
    """Another's end takes seconds to start."""
    slow = name == "anafi" or name.endswith("by-mavsdk")
    return [pytest.mark.slow, pytest.mark.flaky(reruns=2, reruns_delay=2)] if slow else []


@pytest.fixture
def both(request: pytest.FixtureRequest) -> Iterator[Made]:
    """Makes a vehicle and what tells which of its sticks have arrived."""
    yield VEHICLES[request.param]
    _benches.close()


@pytest.fixture(params=[pytest.param(name, marks=_marks(name)) for name in VEHICLES])
def make(request: pytest.FixtureRequest) -> Iterator[Callable[[int], Vehicle]]:
    yield lambda seed: VEHICLES[request.param](seed)[0]
    _benches.close()


def cycles(
    vehicle: Vehicle, count: int, *sticks: float, intent: Intent = Intent.FLY
) -> list[tuple[Frame | None, Telemetry]]:
    """Up to `count` cycles with the same sticks, 30 ms of processing each."""
    pairs = []
    for _ in range(count):
        pair = vehicle.read()
        if pair is None:
            break
        pairs.append(pair)
        vehicle.send(PilotCommand(pair[1].t_s + 0.03, *sticks, 0.0, intent))
    return pairs


def flown_until(
    vehicle: Vehicle, reached: Callable[[Telemetry], bool], *sticks: float, intent: Intent = Intent.FLY
) -> Telemetry:
    """With these sticks until it comes to that: half a second at least, ten or so at most; its last telemetry."""
    told = [telemetry for _, telemetry in cycles(vehicle, 15, *sticks, intent=intent)]
    for _ in range(300):
        if reached(told[-1]):
            break
        told = [telemetry for _, telemetry in cycles(vehicle, 1, *sticks, intent=intent)]
    return told[-1]


def test_times_run_on_and_frames_and_telemetry_are_sound(make: Callable[[int], Vehicle]) -> None:
    vehicle = make(1)
    vehicle.open()
    pairs = cycles(vehicle, 60, 10.0, -10.0, 5.0, 10.0)
    vehicle.close()
    assert len(pairs) == 60
    now = np.array([telemetry.t_s for _, telemetry in pairs])
    seen = [(frame.t_s, telemetry.t_s) for frame, telemetry in pairs if frame is not None]
    exposed, received = np.array(seen).T
    assert len(seen) > 30  # a link on a busy machine leaves some out
    assert np.diff(exposed).min() > 0.0
    assert np.diff(now).min() > 0.0
    assert (received - exposed).min() >= 0.0
    shape = (vehicle.camera.height_px, vehicle.camera.width_px, 3)
    for frame, telemetry in pairs:
        assert frame is None or frame.image is None or frame.image.shape == shape
        assert telemetry.flying
        assert telemetry.roll_rad is None or abs(telemetry.roll_rad) < 1.0
        assert telemetry.pitch_rad is None or abs(telemetry.pitch_rad) < 1.0
        assert telemetry.heading_rad is None or -np.pi <= telemetry.heading_rad <= np.pi
        for percent in (telemetry.battery_percent, telemetry.link_percent):
            assert percent is None or 0.0 <= percent <= 100.0


def test_hold_keeps_hovering(make: Callable[[int], Vehicle]) -> None:
    vehicle = make(4)
    vehicle.open()
    pairs = cycles(vehicle, 30, 0.0, 0.0, 0.0, 0.0, intent=Intent.HOLD)
    pairs = cycles(vehicle, 120, 0.0, 0.0, 0.0, 0.0, intent=Intent.HOLD)
    vehicle.close()
    assert len(pairs) == 120
    assert all(telemetry.flying for _, telemetry in pairs)
    speeds = [np.linalg.norm(t.velocity_in_level_mps) for _, t in pairs if t.velocity_in_level_mps is not None]
    assert max(speeds, default=0.0) < 0.4  # [m/s]
    heights = [t.height_m for _, t in pairs if t.height_m is not None]
    assert np.ptp(heights) < 0.6 if heights else True  # barometer noise 0.05 m


def test_sticks_mean_forward_right_up_and_clockwise(make: Callable[[int], Vehicle]) -> None:
    vehicle = make(5)
    if isinstance(vehicle, ReplayVehicle):
        pytest.skip("a recording does not answer sticks")
    vehicle.open()
    for index, sign in enumerate((1.0, 1.0, -1.0)):  # up is negative
        sticks = [0.0, 0.0, 0.0, 0.0]
        sticks[index] = 50.0

        def moves(told: Telemetry, index: int = index, sign: float = sign) -> bool:
            velocity = told.velocity_in_level_mps
            return velocity is None or float(velocity[index]) * sign > 0.2

        def stands(told: Telemetry) -> bool:
            velocity = told.velocity_in_level_mps
            return velocity is None or float(np.linalg.norm(velocity)) < 0.15

        assert moves(flown_until(vehicle, moves, *sticks))
        assert stands(flown_until(vehicle, stands, 0.0, 0.0, 0.0, 0.0, intent=Intent.HOLD))
    first = cycles(vehicle, 1, 0.0, 0.0, 0.0, 0.0)[0][1].heading_rad

    def turned_rad(told: Telemetry) -> float:
        heading = told.heading_rad
        return 0.2 if heading is None or first is None else float(wrap_angle(heading - first))

    turned = flown_until(vehicle, lambda told: abs(turned_rad(told)) > 0.1, 0.0, 0.0, 0.0, 50.0)
    assert 0.1 < turned_rad(turned) < 2.0
    vehicle.close()


def test_nothing_raises_in_flight_whatever_is_sent(make: Callable[[int], Vehicle]) -> None:
    vehicle = make(6)
    vehicle.open()
    for value in (float("nan"), float("inf"), -float("inf"), -1e12):
        for intent in Intent:
            vehicle.send(PilotCommand(value, value, value, value, value, value, intent))
            assert vehicle.read() is not None
    vehicle.send(PilotCommand(0.0, 1e12, 1e12, 1e12, 1e12, 1e12))
    assert vehicle.read() is not None
    vehicle.close()


def test_a_closed_vehicle_is_at_its_end(make: Callable[[int], Vehicle]) -> None:
    vehicle = make(7)
    vehicle.open()
    assert vehicle.read() is not None
    vehicle.close()
    assert vehicle.read() is None
    vehicle.send(PilotCommand.hold(9.0, 0.0))
    vehicle.close()


@pytest.mark.parametrize("both", ["ardupilot", "px4", "ros2"], indirect=True)
def test_a_machine_that_was_suspended_in_flight_flies_no_further(both: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """An ANAFI is sent nothing more, not even a release: tests/unit/test_anafi.py."""
    vehicle, arrived = both(9)
    vehicle.open()
    assert len(cycles(vehicle, 30, 50.0, 0.0, 0.0, 0.0)) == 30
    for module in (pace, link_vehicle):
        monkeypatch.setattr(module, "boot_s", lambda: time.monotonic() + 30.0)
    assert len(cycles(vehicle, 30, 50.0, 0.0, 0.0, 0.0)) < 10  # a turn of the set-points, and pictures meanwhile
    assert "this machine was suspended for 30 s" in vehicle.end_reason
    assert until(lambda: max(map(abs, arrived()), default=0.0) < 1e-6)


@pytest.mark.parametrize("both", ["simulated", "ardupilot", "px4", "anafi", "ros2", "ros2-attitude"], indirect=True)
def test_every_modes_sticks_leave_and_those_of_a_hold_do_not(both: Made) -> None:
    vehicle, arrived = both(5)
    vehicle.open()
    for turn, (mode, intent) in enumerate(INTENTS.items()):
        sign = -1.0 if turn % 2 else 1.0  # another than the mode's before
        wanted = [0.0, 0.0, 0.0] if intent is Intent.HOLD else [sign, -sign, sign]
        for _ in range(400):
            cycles(vehicle, 1, sign * 20.0, -sign * 20.0, sign * 20.0, 0.0, intent=intent)
            if np.sign(np.round(arrived(), 6)).tolist() == wanted:
                break
        else:
            pytest.fail(f"{mode.name}: the sticks of {intent} arrive as {arrived()}")
    vehicle.close()


# What only a simulator promises.


def test_the_same_seed_gives_the_same_truth_bit_for_bit() -> None:
    def flight(seed: int, descent: int = 200) -> list[bytes]:
        vehicle = simulated(seed)
        vehicle.open()
        states = []
        pairs = cycles(vehicle, 60, 20.0, -5.0, -20.0, 10.0) + cycles(
            vehicle, descent, 0.0, 0.0, -60.0, 0.0, intent=Intent.LAND
        )
        for frame, telemetry in pairs:
            truth = vehicle.truth_at(frame.t_s)
            if truth is not None:
                states.append(truth.ned_from_body.matrix().tobytes() + truth.ned_from_camera.matrix().tobytes())
            states.append(np.array([telemetry.heading_rad, telemetry.height_m]).tobytes())
        verdict = vehicle.verdict()
        return [*states, repr(verdict).encode()]

    first = flight(11)
    assert first == flight(11)
    assert first[0] != flight(12, descent=0)[0]
