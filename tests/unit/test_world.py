"""The world: the deck's kinematics, what MuJoCo makes of them, starts, gimbal, telemetry, and determinism."""

import math

import mujoco
import numpy as np
import pytest

from shipland.config import merge
from shipland.frames import MUJOCO_FROM_NED, Array, euler_from_rotation, quaternion_from_rotation, rotation_from_euler
from shipland.messages import Intent, PilotCommand
from shipland.rig import Rig
from shipland.sim.aircraft.record import Record, at
from shipland.sim.contact import Bodies, against_deck, deck_values
from shipland.sim.ship.ship import Ship, ShipState
from shipland.sim.touchdown import OnDeck
from shipland.sim.world import STEP_S
from worlds import QUIET, CircleCourse, Deck, WanderingCourse, aircraft_parameters, natops, six_sinusoids, world

TIMES = (0.0, 1.3, 7.9)
H = 1e-3
"""Step of central differences [s]; their error is about h² times a third derivative: 1e-6 of the motion."""


@pytest.fixture(params=[False, True], ids=["rig", "full ship"])
def ship(request: pytest.FixtureRequest, rig: Rig) -> Ship:
    return Ship(rig, WanderingCourse(), six_sinusoids(), full_ship=request.param)


def _deck(state: ShipState) -> Deck:
    return Deck.of(deck_values(state))


@pytest.mark.parametrize("t_s", TIMES)
def test_deck_velocity_and_acceleration_are_the_derivatives_of_its_pose(ship: Ship, t_s: float) -> None:
    deck = _deck(ship.at(t_s))
    before, now, after = (ship.at(t).ned_from_deck for t in (t_s - H, t_s, t_s + H))
    np.testing.assert_allclose(deck.origin_m, now.translation_m, atol=1e-12)
    np.testing.assert_allclose(deck.ned_from_deck, now.rotation, atol=1e-12)
    slope = (after.translation_m - before.translation_m) / (2 * H)
    bend = (after.translation_m - 2 * now.translation_m + before.translation_m) / H**2
    np.testing.assert_allclose(deck.velocity_mps, slope, atol=1e-5)
    np.testing.assert_allclose(deck.acceleration_mps2, bend, atol=1e-5)
    turning = (after.rotation - before.rotation) / (2 * H) @ now.rotation.T
    np.testing.assert_allclose(deck.turn_rad_s, [turning[2, 1], turning[0, 2], turning[1, 0]], atol=1e-6)
    roll, pitch, yaw = (np.array([_deck(ship.at(t)).angles_rad[i] for t in (t_s - H, t_s, t_s + H)]) for i in range(3))
    for index, angle in enumerate((roll, pitch, yaw)):
        assert deck.rates_rad_s[index] == pytest.approx((angle[2] - angle[0]) / (2 * H), abs=1e-6)
        assert deck.accelerations_rad_s2[index] == pytest.approx((angle[2] - 2 * angle[1] + angle[0]) / H**2, abs=1e-5)


@pytest.mark.parametrize("t_s", TIMES)
def test_mujoco_has_the_ship_where_it_is_and_accelerates_the_deck_as_told(ship: Ship, rig: Rig, t_s: float) -> None:
    record = Record(aircraft_parameters(), 0.004)
    staged = Bodies(rig, aircraft_parameters().airframe.shape, STEP_S, record)
    model, data = staged.model, staged.data
    data.qpos[2] = 50.0  # the aircraft out of the way
    state = ship.at(t_s)
    deck = _deck(state)
    record.values[at("deck")], record.values[at("ship")] = deck_values(state), state.course.values
    staged.set_deck()
    staged.set_hull(state.full_ship)
    mujoco.mj_forward(model.mj, data)
    bodies = (("deck", state.ned_from_deck), ("ship", state.ned_from_hull), ("bar", state.ned_from_bar))
    for name, pose in bodies:
        body = data.body(name)
        np.testing.assert_allclose(body.xpos, MUJOCO_FROM_NED @ pose.translation_m, atol=1e-9)
        flipped = MUJOCO_FROM_NED @ pose.rotation @ MUJOCO_FROM_NED
        np.testing.assert_allclose(body.xmat.reshape(3, 3), flipped, atol=1e-9)
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(model.mj, data, mujoco.mjtObj.mjOBJ_XBODY, model.mj.body("deck").id, velocity, 0)
    half_step_earlier = _deck(ship.at(t_s - 0.5 * STEP_S))  # MuJoCo's integrator is semi-implicit
    np.testing.assert_allclose(velocity[:3], MUJOCO_FROM_NED @ half_step_earlier.turn_rad_s, atol=1e-4)
    np.testing.assert_allclose(velocity[3:], MUJOCO_FROM_NED @ half_step_earlier.velocity_mps, atol=1e-6)
    wanted = (*deck.acceleration_mps2, *deck.accelerations_rad_s2)
    got = data.qacc[6:12] * [1, -1, -1, -1, -1, 1]
    np.testing.assert_allclose(got, [*wanted[:3], wanted[5], wanted[4], wanted[3]], atol=1e-5)


def test_a_point_carried_by_the_deck_has_no_velocity_against_it(ship: Ship) -> None:
    def place(t_s: float) -> Array:
        return ship.at(t_s).ned_from_deck.apply(np.array([0.3, -0.2, -0.05]))

    t_s = 2.7
    velocity = (place(t_s + H) - place(t_s - H)) / (2 * H)
    turned = ship.at(t_s).ned_from_deck.rotation @ rotation_from_euler(0.1, 0.0, 2.0)
    motion = np.array([*place(t_s), *quaternion_from_rotation(turned), *velocity, 0.0, 0.0, 0.0])
    on_deck = OnDeck(*against_deck(deck_values(ship.at(t_s)), motion))
    np.testing.assert_allclose(on_deck.position_m, [0.3, -0.2, -0.05], atol=1e-9)
    np.testing.assert_allclose(on_deck.velocity_mps, 0.0, atol=1e-5)
    assert on_deck.tilt_rad == pytest.approx(0.1, abs=1e-6)


def test_start_is_where_the_configuration_says(rig: Rig) -> None:
    ship = Ship(rig, CircleCourse(4.0, 0.2), natops())
    flown = world(ship=ship, distance_m=20.0, bearing_deg=30.0, height_m=3.0, start={"heading_error_deg": 5.0})
    truth = flown.truth()
    in_ship = truth.ned_from_ship.inverse().apply(truth.ned_from_body.translation_m)
    np.testing.assert_allclose(in_ship, [-20.0 * math.cos(math.pi / 6), 10.0, -3.0], atol=1e-9)
    heading = euler_from_rotation(truth.ned_from_body.rotation)[2]
    assert math.degrees(heading) == pytest.approx(-30.0 + 5.0, abs=1e-6)  # at the deck's centre, but for the error
    np.testing.assert_array_equal(truth.velocity_in_ned_mps, 0.0)
    assert flown.snapshot().reported_gimbal.pitch_rad == 0.0
    assert flown.t_s == 0.0


def test_starts_spread_uniformly_within_their_bounds() -> None:
    spread = {"distance_half_range_m": 2.0, "bearing_half_range_deg": 10.0, "height_half_range_m": 0.5}
    truths = [world(distance_m=12.0, height_m=1.5, start=spread, seed=seed).truth() for seed in range(40)]
    places = np.array([t.ned_from_ship.inverse().apply(t.ned_from_body.translation_m) for t in truths])
    distance = np.hypot(places[:, 0], places[:, 1])
    bearing = np.degrees(np.arctan2(places[:, 1], -places[:, 0]))
    for values, middle, half in ((distance, 12.0, 2.0), (bearing, 0.0, 10.0), (-places[:, 2], 1.5, 0.5)):
        assert np.abs(values - middle).max() <= half + 1e-9
        assert np.abs(values - middle).max() > 0.7 * half  # 40 draws: missed once in 10⁶
        assert abs(values.mean() - middle) < 0.4 * half


def _fly(cuts_s: list[float], chatty: bool) -> tuple[Array, Array]:
    ship = Ship(world()._ship.rig, WanderingCourse(), six_sinusoids())
    flown = world(
        ship=ship, distance_m=4.0, height_m=1.0, wind_mps=(3.0, -2.0, 0.0), start={"bearing_half_range_deg": 20.0}
    )
    commanded = 0
    for t_s in sorted({*cuts_s, *np.arange(0.0, 4.0, 0.5)}):
        flown.advance(t_s)
        if chatty:
            flown.readings()
            flown.truth()
            flown.scene_state()
        if t_s == 0.5 * commanded:
            intent = Intent.LAND if commanded > 2 else Intent.FLY
            flown.command(PilotCommand(t_s, 60.0 - 10 * commanded, 5.0, -30.0, 10.0, -0.1, intent))
            commanded += 1
    flown.advance(4.0)
    truth = flown.truth()
    return np.r_[truth.ned_from_body.matrix().ravel(), truth.velocity_in_ned_mps], truth.ned_from_camera.matrix()


def test_the_same_seed_gives_the_same_flight_however_it_is_cut_and_watched(rng: np.random.Generator) -> None:
    body, camera = _fly([], chatty=False)
    for cuts in ([], rng.uniform(0.0, 4.0, 300).tolist()):
        again_body, again_camera = _fly(cuts, chatty=True)
        np.testing.assert_array_equal(again_body, body)
        np.testing.assert_array_equal(again_camera, camera)


def test_another_seed_gives_another_flight() -> None:
    first, second = world(seed=1), world(seed=2)
    for flown in (first, second):
        flown.advance(1.0)
    assert not np.array_equal(first.truth().velocity_in_ned_mps, second.truth().velocity_in_ned_mps)


def test_time_runs_on_its_grid_and_never_back() -> None:
    flown = world()
    flown.advance(1.0 / 30.0)
    assert flown.t_s == pytest.approx(0.032)
    assert flown.truth().t_s == flown.t_s == flown.scene_state().t_s
    flown.advance(0.01)
    assert flown.t_s == pytest.approx(0.032)


def test_gimbal_slews_at_its_rate_within_its_range_and_holds_the_horizon() -> None:
    flown = world(camera={"gimbal_noise_rad": 0.0, "gimbal_bias_rad": 0.0}, wind_mps=(9.0, 0.0, 0.0))
    flown.command(PilotCommand(0.0, 0.0, 0.0, 0.0, 0.0, -3.0))
    flown.advance(0.25)
    assert flown.snapshot().reported_gimbal.pitch_rad == pytest.approx(-3.14 * 0.25, abs=3.14 * 0.004 + 1e-9)
    flown.command(PilotCommand(0.25, 50.0, 50.0, 0.0, 0.0, -3.0))
    flown.advance(1.2)
    assert flown.snapshot().reported_gimbal.pitch_rad == pytest.approx(-1.5708)
    roll, _, _ = euler_from_rotation(flown.truth().ned_from_body.rotation)
    assert abs(roll) > 0.02  # the aircraft tilts, the camera does not: its right axis stays level
    assert flown.truth().ned_from_camera.rotation[2, 0] == pytest.approx(0.0, abs=1e-12)


def test_gimbal_residual_has_its_size_and_is_not_reported() -> None:
    flown = world(camera={"gimbal_noise_rad": 0.01, "gimbal_bias_rad": 0.0})
    rolls = []
    for t_s in np.arange(0.2, 60.0, 0.2):
        flown.advance(float(t_s))
        rolls.append(np.arcsin(-flown.truth().ned_from_camera.rotation[2, 0]))
        assert flown.snapshot().reported_gimbal.roll_rad == 0.0
    assert np.std(rolls) == pytest.approx(0.01, rel=0.25)  # 300 draws with 0.1 s of memory: 4 % of scatter, 6 sigma


def test_scene_state_moves_as_its_poses_say() -> None:
    flown = world(aircraft=QUIET, camera={"gimbal_noise_rad": 0.0, "gimbal_bias_rad": 0.0})
    states = []
    for index in range(4):
        flown.command(PilotCommand(0.0, 60.0, -30.0, 20.0, 80.0, -1.5))
        flown.advance(0.3 + 0.004 * index)
        states.append(flown.scene_state())
    before, now, after = states[1:]
    span = after.t_s - before.t_s
    slope = (after.ned_from_camera.translation_m - before.ned_from_camera.translation_m) / span
    np.testing.assert_allclose(now.camera_velocity_in_ned_mps, slope, atol=0.02)
    step = now.ned_from_camera.rotation.T @ (after.ned_from_camera.rotation - before.ned_from_camera.rotation) / span
    np.testing.assert_allclose(now.camera_rate_in_camera_rad_s, [step[2, 1], step[0, 2], step[1, 0]], atol=0.02)
    assert np.abs(now.camera_rate_in_camera_rad_s).max() > 1.0


def test_readings_are_the_truth_plus_their_errors() -> None:
    still_water = {"sensors": {"flow_bias_mps": 0.0}}
    flown = world(height_m=20.0, bearing_deg=-60.0, aircraft=still_water)
    sensors = aircraft_parameters().sensors
    rows = []
    for t_s in np.arange(0.1, 20.0, 0.1):
        flown.command(PilotCommand(float(t_s), 0.0, 0.0, 0.0, 0.0, 0.0))
        flown.advance(float(t_s))
        truth, said = flown.truth(), flown.readings()
        assert 0.0 < flown.t_s - said.t_s < 0.0041  # the last control tick
        roll, pitch, heading = euler_from_rotation(truth.ned_from_body.rotation)
        level = rotation_from_euler(0.0, 0.0, heading).T @ truth.velocity_in_ned_mps
        assert said.velocity_in_level_mps is not None
        rows.append(
            [
                said.roll_rad - roll,
                said.pitch_rad - pitch,
                said.heading_rad - heading,
                said.height_m + truth.ned_from_body.translation_m[2],
                *(said.velocity_in_level_mps - level),
            ]
        )
    spread, mean = np.std(rows, axis=0), np.mean(rows, axis=0)
    np.testing.assert_allclose(spread[:2], sensors.attitude_noise_rad, rtol=0.3)
    assert spread[2] == pytest.approx(sensors.heading_noise_rad, rel=0.3)
    for index, bias in ((0, sensors.attitude_bias_rad), (1, sensors.attitude_bias_rad), (2, sensors.heading_bias_rad)):
        assert 1e-4 < abs(mean[index]) < 4.0 * bias  # this seed's
    np.testing.assert_allclose(spread[4:], sensors.velocity_noise_mps, rtol=0.5)  # 40 independent draws
    assert spread[3] < 0.25  # noise 0.05 m and a walk of 0.02 m/√s over 20 s
    assert flown.battery_percent == pytest.approx(100.0 * (1.0 - 20.0 / 1500.0), abs=0.1)
    assert flown.link_percent == pytest.approx(92.0, abs=2.0)  # some 300 m of 4 km


def test_the_autopilot_flies_on_its_own_sensors() -> None:
    """Its barometer drifts and it follows; its heading is off and forward goes off with it."""
    drifting = merge(QUIET, {"sensors": {"height_drift_m_per_sqrt_s": 0.3}})
    flown = world(height_m=40.0, aircraft=drifting)
    start_m = flown.truth().ned_from_body.translation_m[2]
    flown.advance(30.0)
    truth_m = flown.truth().ned_from_body.translation_m[2]
    assert abs(truth_m - start_m) > 0.2
    assert -flown.readings().height_m == pytest.approx(start_m, abs=0.3)
    turned = world(seed=6, aircraft=merge(QUIET, {"sensors": {"heading_bias_rad": 0.3}}))
    heading = turned.readings().heading_rad
    turned.advance(1.0)
    assert abs(heading) > 0.03
    assert euler_from_rotation(turned.truth().ned_from_body.rotation)[2] == pytest.approx(0.0, abs=0.01)


def test_optical_flow_over_water_is_lost_for_its_share_of_the_time_and_over_land_never() -> None:
    for water, share in ((True, 0.1), (False, 0.0)):
        flown, lost = world(height_m=20.0, water=water), []
        for t_s in np.arange(0.1, 120.0, 0.1):
            flown.advance(float(t_s))
            lost.append(flown.readings().velocity_in_level_mps is None)
        assert np.mean(lost) == pytest.approx(share, abs=0.06)  # some 24 losses


def test_optical_flow_over_the_deck_sees_the_decks_velocity(rig: Rig) -> None:
    """Low over a deck that goes at 2 m/s the vehicle believes that it goes backwards; far from it, nothing of it."""
    ship = Ship(rig, CircleCourse(2.0, 0.01), natops())
    low = world(ship=ship, distance_m=0.0, height_m=0.4, aircraft=QUIET)
    velocity = low.readings().velocity_in_level_mps
    assert velocity is not None
    assert velocity[0] == pytest.approx(-2.0, abs=0.1)
    far = world(ship=ship, distance_m=20.0, height_m=3.0, aircraft=QUIET)
    assert far.readings().velocity_in_level_mps == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_ship_state_is_the_ships_own(rig: Rig) -> None:
    ship = Ship(rig, CircleCourse(4.5, 0.3), natops())
    flown = world(ship=ship, distance_m=30.0)
    flown.advance(3.0)
    state: ShipState = ship.at(flown.t_s)
    truth = flown.truth()
    np.testing.assert_array_equal(truth.ned_from_deck.matrix(), state.ned_from_deck.matrix())
    np.testing.assert_array_equal(truth.ned_from_bar.matrix(), state.ned_from_bar.matrix())
