"""The aircraft: forces against hand-computed values, trim, and the inner loop's responses against its settings."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipland.config import merge
from shipland.frames import GRAVITY_MPS2, euler_from_rotation, rows_from_euler
from shipland.messages import Intent, PilotCommand
from shipland.rig import Rig
from shipland.sim.aircraft.aircraft import Quadrotor
from shipland.sim.aircraft.record import Record, at
from shipland.sim.aircraft.step import air_force_in_ned_n, ground_effect_gain, trim_hover
from shipland.sim.contact import Bodies, deck_values
from shipland.sim.ship.course import StillCourse
from shipland.sim.ship.deck_motion import Still
from shipland.sim.ship.ship import Ship
from shipland.sim.world import STEP_S, World
from worlds import QUIET, aircraft_parameters, world

AIRFRAME = aircraft_parameters().airframe
CONSTANTS = Record(aircraft_parameters(), 0.004).constants
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


def test_drag_in_level_flight_is_the_nominal_model() -> None:
    level = rows_from_euler(0.0, 0.0, 0.0)
    hover_n = AIRFRAME.mass_kg * GRAVITY_MPS2
    north, east, down = air_force_in_ned_n(CONSTANTS[0], level, 8.0, 0.0, 0.0, hover_n)
    # 0.32 kg · (0.2 · 8 + 0.019 · 64) m/s², the packaged coefficients
    assert north == pytest.approx(-0.32 * 2.816, abs=1e-9)
    assert (east, down) == (0.0, 0.0)


@given(speed, speed, speed, angle, angle)
def test_the_air_never_pushes_the_aircraft_on(u: float, v: float, w: float, roll: float, pitch: float) -> None:
    force = air_force_in_ned_n(CONSTANTS[0], rows_from_euler(roll, pitch, 0.7), u, v, w, 3.0)
    assert np.dot(force, (u, v, w)) <= 1e-9


def test_stopped_rotors_leave_the_fuselage_only() -> None:
    rows = rows_from_euler(0.3, -0.2, 1.0)
    force = air_force_in_ned_n(CONSTANTS[0], rows, 3.0, 4.0, 0.0, 0.0)
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
    quadrotor = Quadrotor(aircraft_parameters(), 0.004)
    body = Bodies(rig, quadrotor.shape, STEP_S, quadrotor.record)
    quadrotor.record.values[at("deck")] = deck_values(Ship(rig, StillCourse(), Still()).at(0.0))
    hover_n = AIRFRAME.mass_kg * GRAVITY_MPS2
    height_m = 0.1
    down_m = -rig.deck_height_m - height_m + AIRFRAME.motor_above_m  # rotors 0.1 m over the deck
    body.put((0.0, -0.5 * rig.deck_size_m, down_m), 0.0, 0.0, 0.0)
    motion, still = body.motion(), (0.0, 0.0, 0.0)
    wrenches = []
    for over in (None, body.over_deck):  # with rotors that run down alike
        quadrotor.trim(still, 0.0)
        wrenches.append(quadrotor.step(motion, None, None, still, over))
    body.step(1)
    lift, moment = -wrenches[0].force_in_ned_n[2], wrenches[1].moment_in_body_nm
    extra_n = 0.5 * lift * (ground_effect_gain(height_m, AIRFRAME.rotor_radius_m) - 1.0)
    assert lift == pytest.approx(hover_n, rel=0.05)
    np.testing.assert_allclose(wrenches[1].force_in_ned_n, [0.0, 0.0, -lift - extra_n], atol=1e-12)
    np.testing.assert_allclose(moment, [-extra_n * AIRFRAME.motor_right_m, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(body.data.qfrc_applied[:6], [0.0, 0.0, lift + extra_n, *moment], atol=1e-12)


@given(st.floats(-14.0, 14.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))
def test_trim_balances_every_wind(north: float, east: float, heading: float) -> None:
    roll_rad, pitch_rad, thrust_n, _ = trim_hover(CONSTANTS, (north, east, 0.0), heading)
    rows = rows_from_euler(roll_rad, pitch_rad, heading)
    force = np.array(air_force_in_ned_n(CONSTANTS[0], rows, -north, -east, 0.0, thrust_n))
    total = force - thrust_n * np.array(rows)[[2, 5, 8]] + [0.0, 0.0, AIRFRAME.mass_kg * GRAVITY_MPS2]
    np.testing.assert_allclose(total / AIRFRAME.mass_kg, 0.0, atol=1e-3)  # [m/s²]


def test_data_sheet_top_speed_is_where_the_highest_tilt_setting_ends() -> None:
    _, pitch_rad, thrust_n, _ = trim_hover(CONSTANTS, (-15.0, 0.0, 0.0), 0.0)
    assert math.degrees(pitch_rad) == pytest.approx(-40.0, abs=1.5)
    assert thrust_n < 0.9 * 4.0 * AIRFRAME.top_thrust_n


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
    assert attitude_deg(flown)[1] == pytest.approx(-SETTINGS.max_tilt_deg, abs=0.1)


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


VELOCITY = merge(QUIET, {"loop": {"kind": "velocity", "velocity_reference": "ground"}})


def test_attitude_kind_drifts_with_the_wind_under_a_little_stick() -> None:
    """Three percent of 15° are 0.4 m/s in still air; in 5 m/s of wind the aircraft goes along with it, and more."""
    flown = world(wind_mps=(0.0, 5.0, 0.0), aircraft=QUIET)
    fly(flown, 25.0, 3.0, 0.0, 0.0, 0.0)
    still = AIRFRAME.level_speed_mps(math.radians(0.03 * SETTINGS.max_tilt_deg))
    np.testing.assert_allclose(flown.truth().velocity_in_ned_mps[:2], [still, 5.0], atol=0.15)
    assert attitude_deg(flown)[1] == pytest.approx(-0.03 * SETTINGS.max_tilt_deg, abs=0.05)
    assert attitude_deg(flown)[0] == pytest.approx(0.0, abs=0.05)


def test_a_stick_of_the_attitude_kind_is_an_angle_from_the_first_moments_on() -> None:
    for wind_mps in (0.0, 6.0):
        flown = world(wind_mps=(-wind_mps, 0.0, 0.0), aircraft=QUIET)
        fly(flown, 1.0, 60.0, -40.0, 0.0, 0.0)
        roll, pitch, _ = attitude_deg(flown)
        assert pitch == pytest.approx(-0.6 * SETTINGS.max_tilt_deg, abs=0.3)
        assert roll == pytest.approx(-0.4 * SETTINGS.max_tilt_deg, abs=0.3)


def test_wind_trim_keeps_its_place_over_ground_under_a_little_stick() -> None:
    """With a trim of 2 s the same 3 % are a push beside the wind's: the drift is gone, what the stick asks stays."""
    trimmed = merge(QUIET, {"loop": {"wind_trim_s": 2.0}})
    flown = world(wind_mps=(0.0, 5.0, 0.0), aircraft=trimmed)
    fly(flown, 25.0, 3.0, 0.0, 0.0, 0.0)
    north, east, _ = flown.truth().velocity_in_ned_mps
    assert abs(east) < 0.3
    assert 0.1 < north < 0.6


def test_velocity_kind_holds_ground_speed_whatever_the_wind() -> None:
    for wind_mps in ((0.0, 0.0, 0.0), (0.0, 5.0, 0.0), (-7.0, 0.0, 0.0)):
        flown = world(wind_mps=wind_mps, aircraft=VELOCITY)
        fly(flown, 10.0, 10.0, -4.0, 0.0, 0.0)
        wanted = 0.01 * SETTINGS.max_speed_mps * np.array([10.0, -4.0])
        np.testing.assert_allclose(flown.truth().velocity_in_ned_mps[:2], wanted, atol=0.02)


def test_velocity_kind_accelerates_no_faster_than_its_limit_and_stops_where_it_is_let_go() -> None:
    flown = world(aircraft=VELOCITY)
    speeds = []
    for _ in range(30):
        fly(flown, 0.1, 100.0, 0.0, 0.0, 0.0)
        speeds.append(flown.truth().velocity_in_ned_mps[0])
    assert 0.8 * 3.0 < np.diff(speeds).max() / 0.1 < 1.2 * 3.0
    fly(flown, 6.0, 0.0, 0.0, 0.0, 0.0)
    here = flown.truth().ned_from_body.translation_m
    fly(flown, 5.0, 0.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(flown.truth().ned_from_body.translation_m, here, atol=0.03)


def test_over_a_drifting_surface_the_velocity_kind_goes_with_it() -> None:
    """Water drifts with 3 % of 5 m/s: zero velocity against it is 0.15 m/s over ground."""
    over_surface = merge(VELOCITY, {"loop": {"velocity_reference": "surface"}})
    flown = world(wind_mps=(0.0, 5.0, 0.0), aircraft=over_surface, water=True)
    fly(flown, 15.0, 0.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(flown.truth().velocity_in_ned_mps[:2], [0.0, 0.15], atol=0.02)
    assert np.abs(flown.readings().velocity_in_level_mps).max() < 0.02  # the vehicle does not know


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

    def velocity_at(self, t_s, position_in_ned_m, ship):
        return (-9.0 if t_s >= 1.0 else 0.0, 0.0, 0.0)


@pytest.mark.parametrize("kind", ["attitude", "velocity"])
def test_a_gust_pushes_it_off_and_it_comes_back(kind: str) -> None:
    flown = world(wind_mps=Gust(), aircraft=merge(QUIET, {"loop": {"kind": kind}}))
    start_m = flown.truth().ned_from_body.translation_m
    strayed = []
    for t_s in np.arange(1.0, 21.0, 0.1):
        flown.advance(float(t_s))
        strayed.append(float(start_m[0] - flown.truth().ned_from_body.translation_m[0]))
        roll, pitch, _ = attitude_deg(flown)
        assert math.hypot(roll, pitch) < aircraft_parameters().loop.tilt_limit_deg + 3.0
    assert 0.3 < max(strayed) < 2.0
    np.testing.assert_allclose(flown.truth().ned_from_body.translation_m, start_m, atol=0.05)


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
    flown, fine = world(aircraft=QUIET), world(aircraft=merge(QUIET, {"settings": {"stick_step_percent": 0.0}}))
    before = flown.truth().ned_from_body.translation_m
    fly(flown, 5.0, 0.45, -0.45, 0.0, 0.0)
    np.testing.assert_allclose(flown.truth().ned_from_body.translation_m, before, atol=1e-3)
    fly(fine, 5.0, 1.45, 0.0, 0.0, 0.0)
    fly(flown, 5.0, 1.45, 0.0, 0.0, 0.0)
    assert attitude_deg(fine)[1] == pytest.approx(-0.0145 * SETTINGS.max_tilt_deg, abs=0.01)
    assert attitude_deg(flown)[1] == pytest.approx(-0.01 * SETTINGS.max_tilt_deg, abs=0.01)


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
