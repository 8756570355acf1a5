"""The aircraft: forces against hand-computed values, trim, and the inner loop's responses against its settings."""

import itertools
import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.config import ConfigError, merge
from shipland.frames import euler_from_rotation, rotation_from_euler, rotation_from_quaternion
from shipland.messages import Intent, PilotCommand
from shipland.rig import Rig
from shipland.sim.aircraft.aerodynamics import (
    air_force_in_ned_n,
    euler_from_quaternion,
    ground_effect_gain,
    rows_from_euler,
    rows_from_quaternion,
    trim_hover,
)
from shipland.sim.aircraft.parameters import GRAVITY_MPS2
from shipland.sim.contact.body import Body
from shipland.sim.contact.deck_drive import deck_state, mujoco_quaternion
from shipland.sim.contact.model import build_model
from shipland.sim.ship.ship import Ship, Still, StillCourse
from shipland.sim.world import STEP_S, World
from worlds import QUIET, aircraft_parameters, world

AIRFRAME = aircraft_parameters().airframe
SETTINGS = aircraft_parameters().settings

angle = st.floats(-1.4, 1.4)
speed = st.floats(-15.0, 15.0)


def fly(flown: World, seconds: float, *sticks: float) -> None:
    """Hold sticks (pitch, roll, heave, yaw percent) for some seconds."""
    until = flown.t_s + seconds
    while flown.t_s < until - 1e-9:
        flown.command(PilotCommand(flown.t_s, *sticks, 0.0))
        flown.advance(min(flown.t_s + 0.1, until))


def attitude_deg(flown: World) -> tuple[float, float, float]:
    """Roll, pitch, heading."""
    roll, pitch, yaw = np.degrees(euler_from_rotation(flown.truth().ned_from_body.rotation))
    return float(roll), float(pitch), float(yaw)


@given(angle, angle, st.floats(-3.0, 3.0))
def test_plain_rotations_agree_with_the_frame_table(roll: float, pitch: float, yaw: float) -> None:
    expected = rotation_from_euler(roll, pitch, yaw)
    np.testing.assert_allclose(np.reshape(rows_from_euler(roll, pitch, yaw), (3, 3)), expected, atol=1e-12)
    w, x, y, z = mujoco_quaternion(roll, pitch, yaw)
    in_ned = (w, x, -y, -z)
    np.testing.assert_allclose(rotation_from_quaternion(np.array(in_ned)), expected, atol=1e-12)
    np.testing.assert_allclose(np.reshape(rows_from_quaternion(*in_ned), (3, 3)), expected, atol=1e-12)
    np.testing.assert_allclose(euler_from_quaternion(in_ned), (roll, pitch, yaw), atol=1e-9)


def test_drag_in_level_flight_is_the_nominal_model() -> None:
    level = rows_from_euler(0.0, 0.0, 0.0)
    hover_n = AIRFRAME.mass_kg * GRAVITY_MPS2
    north, east, down = air_force_in_ned_n(AIRFRAME, level, (8.0, 0.0, 0.0), hover_n)
    # 0.32 kg · (0.2 · 8 + 0.019 · 64) m/s², the packaged coefficients
    assert north == pytest.approx(-0.32 * 2.816, abs=1e-9)
    assert (east, down) == (0.0, 0.0)
    assert north == pytest.approx(-AIRFRAME.mass_kg * AIRFRAME.level_drag_mps2(8.0), abs=1e-12)


@given(speed, speed, speed, angle, angle)
def test_the_air_never_pushes_the_aircraft_on(u: float, v: float, w: float, roll: float, pitch: float) -> None:
    force = air_force_in_ned_n(AIRFRAME, rows_from_euler(roll, pitch, 0.7), (u, v, w), 3.0)
    assert np.dot(force, (u, v, w)) <= 1e-9


def test_stopped_rotors_leave_the_fuselage_only() -> None:
    rows = rows_from_euler(0.3, -0.2, 1.0)
    force = air_force_in_ned_n(AIRFRAME, rows, (3.0, 4.0, 0.0), 0.0)
    expected = -AIRFRAME.mass_kg * AIRFRAME.body_drag_per_m * 5.0
    np.testing.assert_allclose(force, [3.0 * expected, 4.0 * expected, 0.0], atol=1e-12)


def test_ground_effect_is_cheeseman_and_bennetts() -> None:
    assert ground_effect_gain(1.0, 1.0) == pytest.approx(16.0 / 15.0)  # one radius up
    assert ground_effect_gain(100.0, 0.065) == pytest.approx(1.0, abs=1e-6)
    gains = [ground_effect_gain(z, 0.065) for z in np.linspace(0.0, 0.5, 50)]
    assert all(a >= b for a, b in itertools.pairwise(gains))
    assert gains[0] == pytest.approx(4.0 / 3.0)  # held below half a radius


def test_rotors_over_the_decks_edge_lift_their_side(rig: Rig) -> None:
    """Half a body over the port edge: the two right rotors gain thrust, so it rolls left and is lifted."""
    model = build_model(rig, AIRFRAME, STEP_S)
    data = mujoco.MjData(model.mj)
    body = Body(rig, AIRFRAME, model, data)
    deck = deck_state(Ship(rig, StillCourse(), Still()).at(0.0))
    hover_n = AIRFRAME.mass_kg * GRAVITY_MPS2
    height_m = 0.1
    down_m = -rig.deck_height_m - height_m + AIRFRAME.motor_above_m  # rotors 0.1 m over the deck
    body.put((0.0, -0.5 * rig.deck_size_m, down_m), 0.0, 0.0, 0.0, hover_n)
    body.apply_air(body.motion(), (0.0, 0.0, 0.0), deck)
    extra_n = 0.5 * hover_n * (ground_effect_gain(height_m, AIRFRAME.rotor_radius_m) - 1.0)
    wanted = [0.0, 0.0, extra_n, -extra_n * AIRFRAME.motor_right_m, 0.0, 0.0]  # forward-left-up: roll left is negative
    np.testing.assert_allclose(data.qfrc_applied[:6], wanted, atol=1e-12)


@given(st.floats(-14.0, 14.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))
def test_trim_balances_every_wind(north: float, east: float, heading: float) -> None:
    trim = trim_hover(AIRFRAME, (north, east, 0.0), heading)
    rows = rows_from_euler(trim.roll_rad, trim.pitch_rad, heading)
    force = np.array(air_force_in_ned_n(AIRFRAME, rows, (-north, -east, 0.0), trim.thrust_n))
    total = force - trim.thrust_n * np.array(rows)[[2, 5, 8]] + [0.0, 0.0, AIRFRAME.mass_kg * GRAVITY_MPS2]
    np.testing.assert_allclose(total / AIRFRAME.mass_kg, 0.0, atol=1e-3)  # [m/s²]


def test_data_sheet_top_speed_is_where_the_highest_tilt_setting_ends() -> None:
    trim = trim_hover(AIRFRAME, (-15.0, 0.0, 0.0), 0.0)
    assert math.degrees(trim.pitch_rad) == pytest.approx(-40.0, abs=1.5)
    assert trim.thrust_n < 0.9 * 4.0 * AIRFRAME.top_thrust_n


@pytest.mark.parametrize(
    ("sticks", "axis", "sign"),
    [
        ((30.0, 0.0, 0.0, 0.0), 0, 1.0),  # heading north: forward is north
        ((0.0, 30.0, 0.0, 0.0), 1, 1.0),  # right is east
        ((0.0, 0.0, 30.0, 0.0), 2, -1.0),  # up is minus down
    ],
)
def test_each_stick_moves_its_own_axis(sticks: tuple[float, ...], axis: int, sign: float) -> None:
    for flip in (1.0, -1.0):
        flown = world(aircraft=QUIET)
        fly(flown, 2.0, *(flip * stick for stick in sticks))
        velocity = flown.truth().velocity_in_ned_mps
        assert flip * sign * velocity[axis] > 0.25
        np.testing.assert_allclose(np.delete(velocity, axis), 0.0, atol=0.03)
        assert attitude_deg(flown)[2] == pytest.approx(0.0, abs=0.5)


def test_sticks_follow_the_heading() -> None:
    flown = world(bearing_deg=90.0, aircraft=QUIET)  # on the starboard beam, nose to the ship: heading west
    fly(flown, 2.0, 30.0, 0.0, 0.0, 0.0)
    north, east, _ = flown.truth().velocity_in_ned_mps
    assert east < -0.5
    assert abs(north) < 0.03


def test_full_stick_settles_where_drag_balances_the_tilt_setting() -> None:
    flown = world(aircraft=QUIET)
    fly(flown, 20.0, 100.0, 0.0, 0.0, 0.0)
    expected = AIRFRAME.level_speed_mps(math.radians(SETTINGS.max_tilt_deg))
    assert flown.truth().velocity_in_ned_mps[0] == pytest.approx(expected, rel=0.02)
    assert attitude_deg(flown)[1] == pytest.approx(-SETTINGS.max_tilt_deg, abs=0.7)  # drag is nominal in level only


def test_released_sticks_brake_and_hold_the_place() -> None:
    flown = world(aircraft=QUIET)
    fly(flown, 6.0, 30.0, 20.0, 0.0, 0.0)
    assert np.hypot(*flown.truth().velocity_in_ned_mps[:2]) > 1.5
    fly(flown, 2.0, 0.0, 0.0, 0.0, 0.0)
    assert np.hypot(*flown.truth().velocity_in_ned_mps[:2]) < 0.3
    fly(flown, 6.0, 0.0, 0.0, 0.0, 0.0)
    here = flown.truth().ned_from_body.translation_m
    fly(flown, 5.0, 0.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(flown.truth().ned_from_body.translation_m, here, atol=0.02)


def test_response_is_continuous_in_the_stick() -> None:
    """From 2 m/s the stick goes back to a little: what is left of the speed rises gradually with that little."""
    left_mps = []
    for percent in np.linspace(0.0, 1.2, 13):
        flown = world(aircraft=QUIET)
        fly(flown, 8.0, 30.0, 0.0, 0.0, 0.0)
        fly(flown, 1.5, float(percent), 0.0, 0.0, 0.0)
        left_mps.append(float(flown.truth().velocity_in_ned_mps[0]))
    steps = np.diff(left_mps)
    assert steps.min() > 0.0
    assert left_mps[-1] - left_mps[0] > 1.0
    assert steps.max() < 0.5  # a switch from braking to coasting would be all of it in one step


@pytest.mark.parametrize("wind_mps", [5.0, 9.0, 12.0])
def test_holds_its_place_in_a_side_wind(wind_mps: float) -> None:
    flown = world(wind_mps=(0.0, wind_mps, 0.0), aircraft=QUIET)
    before = flown.truth().ned_from_body.translation_m
    flown.advance(0.5)
    np.testing.assert_allclose(flown.truth().ned_from_body.translation_m, before, atol=0.02)  # the start is a trim
    flown.advance(12.0)
    np.testing.assert_allclose(flown.truth().ned_from_body.translation_m, before, atol=0.05)
    assert attitude_deg(flown)[0] < -5.0


class Gust:
    """Still air, then all at once a wind from the north."""

    def velocity_at(self, t_s, position_in_ned_m, ned_from_ship):
        return np.array([-9.0 if t_s >= 1.0 else 0.0, 0.0, 0.0])


def test_a_gust_pushes_it_off_and_it_comes_back() -> None:
    flown = world(wind_mps=Gust(), aircraft=QUIET)
    start_m = flown.truth().ned_from_body.translation_m[0]
    strayed = []
    for t_s in np.arange(1.0, 21.0, 0.1):
        flown.advance(float(t_s))
        strayed.append(float(start_m - flown.truth().ned_from_body.translation_m[0]))
        roll, pitch, _ = attitude_deg(flown)
        assert math.hypot(roll, pitch) < aircraft_parameters().loop.tilt_limit_deg + 3.0
    assert 0.3 < max(strayed) < 2.0
    assert abs(strayed[-1]) < 0.05


@pytest.mark.parametrize("percent", [-100.0, -40.0, 40.0, 100.0])
def test_heave_is_a_climb_rate(percent: float) -> None:
    flown = world(aircraft=QUIET, height_m=40.0)
    fly(flown, 3.0, 0.0, 0.0, percent, 0.0)
    climb = -flown.truth().velocity_in_ned_mps[2]
    assert climb == pytest.approx(0.01 * percent * SETTINGS.max_vertical_speed_mps, abs=0.02)


@pytest.mark.parametrize("percent", [-100.0, 50.0])
def test_yaw_is_a_turn_rate(percent: float) -> None:
    flown = world(aircraft=QUIET)
    fly(flown, 2.0, 0.0, 0.0, 0.0, percent)
    first = attitude_deg(flown)[2]
    fly(flown, 1.0, 0.0, 0.0, 0.0, percent)
    turned = (attitude_deg(flown)[2] - first + 180.0) % 360.0 - 180.0
    assert turned == pytest.approx(0.01 * percent * SETTINGS.max_yaw_rate_deg_s, abs=1.0)


def test_whole_percent_sticks_round_small_ones_away() -> None:
    overlay = merge(QUIET, {"settings": {"stick_step_percent": 1.0}})
    flown = world(aircraft=overlay)
    before = flown.truth().ned_from_body.translation_m
    fly(flown, 5.0, 0.45, -0.45, 0.0, 0.0)
    np.testing.assert_allclose(flown.truth().ned_from_body.translation_m, before, atol=1e-3)


def test_without_commands_it_brakes_and_holds() -> None:
    flown = world(aircraft=QUIET)
    flown.command(PilotCommand(0.0, 40.0, 0.0, 50.0, 50.0, 0.0, Intent.FLY))
    flown.advance(0.9)
    assert -flown.truth().velocity_in_ned_mps[2] > 0.4
    flown.advance(8.0)  # the command timed out at 1 s
    np.testing.assert_allclose(flown.truth().velocity_in_ned_mps, 0.0, atol=0.02)


def test_nonsense_sticks_are_taken_as_zero_and_large_ones_as_full() -> None:
    nonsense, full, larger = world(aircraft=QUIET), world(aircraft=QUIET), world(aircraft=QUIET)
    fly(nonsense, 1.0, math.nan, math.inf, math.nan, -math.inf)
    np.testing.assert_allclose(nonsense.truth().velocity_in_ned_mps, 0.0, atol=0.01)
    fly(full, 1.0, 100.0, 0.0, 0.0, 0.0)
    fly(larger, 1.0, 4e9, 0.0, 0.0, 0.0)
    np.testing.assert_array_equal(full.truth().velocity_in_ned_mps, larger.truth().velocity_in_ned_mps)


@pytest.mark.parametrize(
    ("section", "key", "value"),
    [
        ("airframe", "mass_kg", 0.0),
        ("airframe", "thrust_to_weight", 1.0),
        ("airframe", "inertia_kgm2", [0.001, -0.001, 0.001]),
        ("airframe", "foot_below_m", 0.02),
        ("settings", "max_tilt_deg", 41.0),
        ("settings", "max_vertical_speed_mps", 5.0),
        ("loop", "tilt_limit_deg", 0.0),
        ("sensors", "endurance_s", 0.0),
        ("sensors", "heading_noise_rad", -0.1),
    ],
)
def test_bad_parameters_are_refused(section: str, key: str, value: object) -> None:
    with pytest.raises(ConfigError):
        aircraft_parameters({section: {key: value}})
