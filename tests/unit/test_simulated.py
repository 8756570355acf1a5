"""The simulated vehicle: which frame arrives when, when a command takes effect, and how a flight ends."""

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.config import build
from shipland.errors import ConfigError, VehicleError
from shipland.messages import GimbalAttitude, Intent, Observation, PilotCommand
from shipland.sim.state import SceneState
from shipland.sim.world import World
from shipland.vehicles.delays import DelayParameters
from shipland.vehicles.simulated import SimulatedVehicle
from worlds import QUIET, world

GRID_S = 0.002
FRAME_S = 1.0 / 30.0


def delays(**change: object) -> DelayParameters:
    return build(DelayParameters, change, "delays")


def vehicle(camera: Camera, flown: World | None = None, **change: object) -> SimulatedVehicle:
    made = SimulatedVehicle(flown or world(aircraft=QUIET), camera, delays(**change), None, None)
    made.open()
    return made


def hold(t_s: float) -> PilotCommand:
    return PilotCommand.hold(t_s, 0.0)


def test_first_frame_is_exposed_at_the_start_and_arrives_after_the_video_latency(camera: Camera) -> None:
    frame, telemetry = vehicle(camera, video_s=0.28).read()
    assert frame.t_s == 0.0
    assert telemetry.t_s == pytest.approx(0.28)
    assert frame.image is None


def test_a_quick_pipeline_gets_every_frame_as_it_arrives(camera: Camera) -> None:
    flown = vehicle(camera, video_s=0.28)
    for index in range(40):
        frame, telemetry = flown.read()
        assert frame.t_s == pytest.approx(index * FRAME_S, abs=GRID_S)
        assert frame.t_s >= index * FRAME_S - 1e-9  # never before its time
        assert telemetry.t_s == pytest.approx(frame.t_s + 0.28)
        flown.send(hold(telemetry.t_s + 0.01))


def test_a_slow_pipeline_gets_the_newest_frame_that_has_arrived(camera: Camera) -> None:
    """[Lee2022]'s 0.5 s of a learned detector: each frame given is at most one period older than the latency."""
    flown = vehicle(camera, video_s=0.28)
    free_s, last_s = 0.0, -1.0
    for index in range(12):
        frame, telemetry = flown.read()
        if index:
            assert telemetry.t_s == pytest.approx(free_s)
            assert 0.28 - 1e-9 <= telemetry.t_s - frame.t_s < 0.28 + FRAME_S + GRID_S
        assert frame.t_s > last_s
        last_s, free_s = frame.t_s, telemetry.t_s + 0.5
        flown.send(hold(free_s))


def test_a_frame_is_given_once_even_without_delays(camera: Camera) -> None:
    flown = vehicle(camera, video_s=0.0, uplink_s=0.0)
    times = []
    for _ in range(10):
        frame, telemetry = flown.read()
        assert telemetry.t_s == pytest.approx(frame.t_s)
        times.append(frame.t_s)
        flown.send(hold(telemetry.t_s))
    assert len(set(times)) == 10


def test_reading_without_sending_waits_for_the_next_frame(camera: Camera) -> None:
    flown = vehicle(camera)
    pairs = [flown.read() for _ in range(5)]
    np.testing.assert_allclose(np.diff([frame.t_s for frame, _ in pairs]), FRAME_S, atol=GRID_S)


def test_a_command_takes_effect_after_the_uplink_and_not_before(camera: Camera) -> None:
    flown = vehicle(camera, video_s=0.0, uplink_s=0.2)
    _, telemetry = flown.read()
    flown.send(PilotCommand(telemetry.t_s, 0.0, 0.0, 0.0, 0.0, -1.0))
    pitches = {}
    while telemetry.t_s < 0.5:
        frame, telemetry = flown.read()
        pitches[frame.t_s] = frame.gimbal.pitch_rad
    moved = [t_s for t_s, pitch in pitches.items() if pitch < 0.0]
    assert 0.2 < min(moved) <= 0.2 + FRAME_S + 2 * GRID_S
    t_s = min(moved) + 0.1
    nearest = min(pitches, key=lambda other: abs(other - t_s))
    assert pitches[nearest] == pytest.approx(-3.14 * (nearest - 0.2), abs=3.14 * 2 * GRID_S)


def test_commands_take_effect_in_the_order_sent(camera: Camera) -> None:
    flown = vehicle(camera, video_s=0.0, uplink_s=0.1)
    flown.read()
    for index, pitch in enumerate((-0.5, 0.3, -0.2)):
        flown.send(PilotCommand(0.01 * index, 0.0, 0.0, 0.0, 0.0, pitch))
    while (pair := flown.read())[0].t_s < 0.6:
        pass
    assert pair[0].gimbal.pitch_rad == pytest.approx(-0.2)


@pytest.mark.parametrize(("late_s", "flown"), [(0.9, True), (1.1, False), (float("nan"), True)])
def test_a_command_of_a_pilot_that_stood_still_is_a_hold(camera: Camera, late_s: float, flown: bool) -> None:
    made = vehicle(camera, video_s=0.28)
    now_s = made.telemetry_at(5.0).t_s
    made.send(PilotCommand(now_s - late_s, 0.0, 0.0, 60.0, 0.0, 0.0))
    before, after = (made.telemetry_at(t_s).height_m for t_s in (5.0, 6.5))
    assert (after - before > 0.2) == flown


def test_truth_and_scene_are_those_of_the_exposure(camera: Camera) -> None:
    flown = vehicle(camera)
    flown.send(PilotCommand(0.0, 80.0, 0.0, 0.0, 0.0, 0.0))
    for _ in range(10):
        frame, telemetry = flown.read()
    truth, scene = flown.truth_at(frame.t_s), flown.scene_at(frame.t_s)
    assert truth is not None
    assert scene is not None
    assert truth.t_s == scene.t_s == frame.t_s
    now = flown.world.truth()
    assert now.t_s == pytest.approx(telemetry.t_s, abs=GRID_S)
    assert now.ned_from_body.translation_m[0] > truth.ned_from_body.translation_m[0]
    assert flown.truth_at(frame.t_s + 1.0) is None


class Easel:
    """A scene that remembers what it was asked to draw."""

    def __init__(self) -> None:
        self.drawn: list[float] = []

    def render(self, state: SceneState, camera: Camera, *, draw_aircraft: bool = False, rng=None) -> np.ndarray:
        self.drawn.append(state.t_s)
        return np.zeros((camera.height_px, camera.width_px, 3), np.uint8)


def test_only_given_frames_are_drawn(camera: Camera) -> None:
    easel = Easel()
    flown = SimulatedVehicle(world(), camera, delays(video_clock_s=0.0), easel, np.random.default_rng(0))  # type: ignore[arg-type]
    flown.open()
    given = []
    for _ in range(5):
        frame, telemetry = flown.read()
        assert frame.image is not None
        given.append(frame.t_s)
        flown.send(hold(telemetry.t_s + 0.5))
    assert easel.drawn == given


def test_flight_ends_with_the_verdict(camera: Camera) -> None:
    flown = vehicle(camera, world(distance_m=0.0, height_m=0.5, aircraft=QUIET), video_s=0.05)
    count = 0
    while (pair := flown.read()) is not None:
        assert flown.verdict() is None
        now_s = pair[1].t_s
        flown.send(PilotCommand(now_s + 0.01, 0.0, 0.0, -50.0, 0.0, 0.0, Intent.LAND))
        count += 1
        assert count < 300
    verdict = flown.verdict()
    assert verdict is not None
    assert verdict.landed
    assert not flown.world.motors_run
    assert flown.read() is None
    assert flown.read() is None


def test_commands_from_the_past_and_without_a_time_do_no_harm(camera: Camera) -> None:
    flown = vehicle(camera)
    _, first = flown.read()
    flown.send(hold(first.t_s - 5.0))
    flown.send(hold(float("nan")))
    _, second = flown.read()
    assert second.t_s > first.t_s


def test_a_flown_vehicle_does_not_open_again(camera: Camera) -> None:
    flown = vehicle(camera)
    flown.read()
    flown.close()
    with pytest.raises(VehicleError, match="once"):
        flown.open()


def test_processing_time_is_the_papers_the_clocks_or_none() -> None:
    gimbal = GimbalAttitude(0.0, 0.0)
    blind = Observation(0.0, gimbal)
    boxed = Observation(0.0, gimbal, learned=True)
    assert delays(processing="paper").processing_s(blind, 7.0) == 0.03
    assert delays(processing="paper").processing_s(boxed, 7.0) == 0.5
    assert delays(processing="measured").processing_s(boxed, 0.012) == 0.012
    assert delays(processing="zero").processing_s(boxed, 7.0) == 0.0
    for change in ({"video_s": -0.1}, {"processing": "none"}):
        with pytest.raises(ConfigError):
            delays(**change)
