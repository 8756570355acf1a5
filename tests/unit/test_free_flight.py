"""Compiled free flight is the readable one: the same track to the last digits that rounding leaves."""

import numpy as np
import pytest

from shipland.messages import Intent, PilotCommand
from shipland.sim import world as world_module
from shipland.sim.aircraft.attitude_loop import AttitudeLoop
from shipland.sim.aircraft.sensors import Normals
from worlds import come_down, world

STICKS = [(0.0, 0.0, 0.0, 0.0), (40.0, -15.0, 10.0, 30.0), (-30.0, 20.0, -20.0, -60.0), (0.0, 0.0, -10.0, 5.0)]


def track(seconds=8.0, cuts=(0.1,), **places):
    """Place, attitude and telemetry every 0.1 s of a flight with changing sticks; the world at its end."""
    flown, rows = world(water=True, wind_mps=(3.0, -4.0, 0.3), **places), []
    while flown.t_s < seconds:
        sticks = STICKS[int(flown.t_s) % len(STICKS)]
        if int(flown.t_s) % 6 < 4:  # then the link is lost
            flown.command(PilotCommand(flown.t_s, *sticks, 0.4 * np.sin(flown.t_s)))
        start_s = flown.t_s
        for cut in cuts:
            flown.advance(start_s + cut)
        truth, readings = flown.truth(), flown.readings()
        level = readings.velocity_in_level_mps or (0.0, 0.0, 0.0)
        rows.append(
            [
                *(*truth.ned_from_body.translation_m, *truth.ned_from_body.rotation.ravel()),
                *(*truth.velocity_in_ned_mps, *truth.ned_from_camera.rotation.ravel()),
                *(readings.t_s, readings.heading_rad, readings.height_m, *level),
            ]
        )
    return np.array(rows), flown


def readable(monkeypatch, **places):
    """The same flight without compilation."""
    with monkeypatch.context() as patch:
        patch.setattr(world_module, "free_flight", lambda *_: None)
        return track(**places)


@pytest.mark.parametrize(
    "loop",
    [
        {"kind": "attitude"},
        {"kind": "attitude", "wind_trim_s": 2.0},
        {"kind": "velocity"},
        {"kind": "velocity", "velocity_reference": "ground"},
    ],
)
def test_far_from_the_deck_it_is_the_readable_flight(loop, monkeypatch):
    changes = {"aircraft": {"loop": loop}}
    (fast, flown), (slow, _) = track(**changes), readable(monkeypatch, **changes)
    assert flown._free is not None
    np.testing.assert_allclose(fast, slow, atol=1e-6)


def test_over_a_moving_deck_it_differs_by_micrometres(monkeypatch, rig):
    """The deck's motion is carried on between its looks at it, which the ground effect hardly feels."""
    changes = {"distance_m": 0.4, "height_m": 0.9, "ship": moving_ship(rig), "seconds": 1.0}
    (fast, flown), (slow, _) = track(**changes), readable(monkeypatch, **changes)
    assert flown._reach_m < world_module.NEAR_DECK_M
    np.testing.assert_allclose(fast, slow, atol=1e-4)


def test_it_does_not_depend_on_how_it_is_cut():
    whole, _ = track()
    cut, _ = track(cuts=(0.002, 0.006, 0.013, 0.02, 0.041, 0.1))
    np.testing.assert_array_equal(whole, cut)


def test_low_over_the_sea_the_readable_world_takes_over():
    low = world(height_m=0.3, water=True)
    come_down(low, percent=-60.0, intent=Intent.FLY, most_s=20.0)
    assert low.verdict() is not None
    assert low.verdict().reason == "fell into the sea"


def test_a_loop_from_outside_flies_as_it_is_written():
    class Own(AttitudeLoop):
        """Another law, perhaps."""

    flown = world()
    flown._flier.loop.__class__ = Own
    arguments = (flown._aircraft, flown._flier, flown._senses, flown._gimbal, flown._camera, 1.22, 2.0, 0.002)
    assert world_module.free_flight(*arguments) is None


def moving_ship(rig):
    """A deck that heaves, rolls and pitches."""
    from shipland.sim.ship.ship import Ship, Sinusoids, StillCourse

    motion = Sinusoids([0.0, 0.0, 0.05, 0.06, 0.03, 0.0], [5.0, 5.0, 5.0, 6.0, 7.0, 5.0], [0.3] * 6)
    return Ship(rig, StillCourse(0.3), motion)


def test_normal_numbers_come_in_the_same_order_however_many_are_taken():
    one_by_one, many = (Normals(np.random.default_rng(2)) for _ in range(2))
    for count in (0, 3, 1000, 0, 50, 1):  # across the end of a block
        assert many.draws(count) == [one_by_one.draw() for _ in range(count)]
