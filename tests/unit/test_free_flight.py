"""One step flies everywhere: free or among MuJoCo's contacts, compiled or not, by its records or by its protocol."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shipland.factories import resolve
from shipland.messages import Intent, PilotCommand
from shipland.sim import world as world_module
from shipland.sim.aircraft import aircraft as aircraft_module
from shipland.sim.aircraft.loops import AttitudeLoop, VelocityLoop, control
from shipland.sim.aircraft.sensors import Normals
from shipland.sim.world import World

sys.path.insert(0, str(Path(__file__).parents[1]))  # where it is run as a process
from worlds import come_down, world

LOOP_OF = {"attitude": AttitudeLoop, "velocity": VelocityLoop}

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


def by_mujoco(monkeypatch, **places):
    """The same flight, its body moved by MuJoCo from end to end."""
    with monkeypatch.context() as patch:
        patch.setattr(World, "_fly_free", lambda *_: False)
        return track(**places)


LOOPS = [
    {"kind": "attitude"},
    {"kind": "attitude", "wind_trim_s": 2.0},
    {"kind": "velocity"},
    {"kind": "velocity", "velocity_reference": "ground"},
]


@pytest.mark.parametrize("loop", LOOPS)
def test_far_from_the_deck_it_is_the_flight_by_mujoco(loop, monkeypatch):
    changes = {"aircraft": {"loop": loop}}
    (free, flown), (slow, _) = track(**changes), by_mujoco(monkeypatch, **changes)
    assert flown._clear
    np.testing.assert_allclose(free, slow, atol=1e-6)


def test_over_a_moving_deck_it_differs_by_micrometres(monkeypatch, rig):
    """The deck's motion is carried on between its looks at it, which the ground effect hardly feels."""
    changes = {"distance_m": 0.4, "height_m": 0.9, "ship": moving_ship(rig), "seconds": 1.0}
    (free, flown), (slow, _) = track(**changes), by_mujoco(monkeypatch, **changes)
    assert flown._reach_m < world_module.NEAR_DECK_M
    np.testing.assert_allclose(free, slow, atol=1e-4)


@pytest.mark.slow
def test_without_the_compiler_it_is_the_same_flight():
    """In two processes: compiled, and as Python reads it; with contacts, for the last loop comes down on the deck."""
    flights = [
        subprocess.run([sys.executable, __file__], capture_output=True, check=True, text=True, env=os.environ | disable)
        for disable in ({}, {"NUMBA_DISABLE_JIT": "1"})
    ]
    compiled, readable = (json.loads(flight.stdout) for flight in flights)
    assert (compiled["compiled"], readable["compiled"]) == (True, False)
    for name in ("free", "landing"):
        np.testing.assert_allclose(compiled[name], readable[name], rtol=0.0, atol=1e-9)


def test_it_does_not_depend_on_how_it_is_cut():
    whole, _ = track()
    cut, _ = track(cuts=(0.002, 0.006, 0.013, 0.02, 0.041, 0.1))
    np.testing.assert_array_equal(whole, cut)


def test_low_over_the_sea_the_readable_world_takes_over():
    low = world(height_m=0.3, water=True)
    come_down(low, percent=-60.0, intent=Intent.FLY, most_s=20.0)
    assert low.verdict() is not None
    assert low.verdict().reason == "fell into the sea"


@pytest.mark.parametrize("kind", ["attitude", "velocity"])
def test_through_the_protocol_of_a_loop_of_ones_own_it_is_the_same_flight(kind, monkeypatch):
    class Own(LOOP_OF[kind]):
        """The packaged law, perhaps with something added."""

    changes = {"aircraft": {"loop": {"kind": kind}}, "distance_m": 0.4, "height_m": 0.9, "seconds": 1.0}
    with monkeypatch.context() as patch:
        patch.setattr(aircraft_module, "resolve", lambda group, name: Own if group == "loops" else resolve(group, name))
        own, flown = track(**changes)
    assert not flown._packaged
    packaged, _ = by_mujoco(monkeypatch, **changes)
    np.testing.assert_allclose(own, packaged, atol=1e-9)


def test_a_weak_rotor_flies_free_too(monkeypatch):
    def weakened(missing):
        flown = world()
        flown.weaken_rotor(1, missing)
        flown.advance(2.0)
        return flown, flown.truth().ned_from_body.translation_m

    (free, weak_m), (_, sound_m) = weakened(0.2), weakened(0.0)
    assert free._clear
    assert np.linalg.norm(weak_m - sound_m) > 0.01
    monkeypatch.setattr(World, "_fly_free", lambda *_: False)
    np.testing.assert_allclose(weakened(0.2)[1], weak_m, atol=1e-6)


def moving_ship(rig):
    """A deck that heaves, rolls and pitches."""
    from shipland.sim.ship.course import StillCourse
    from shipland.sim.ship.deck_motion import Sinusoids
    from shipland.sim.ship.ship import Ship

    motion = Sinusoids([0.0, 0.0, 0.05, 0.06, 0.03, 0.0], [5.0, 5.0, 5.0, 6.0, 7.0, 5.0], [0.3] * 6)
    return Ship(rig, StillCourse(0.3), motion)


def test_normal_numbers_come_in_the_same_order_however_many_are_taken():
    one_by_one, many = (Normals(np.random.default_rng(2)) for _ in range(2))
    for count in (0, 3, 1000, 0, 50, 1):  # across the end of a block
        assert many.draws(count).tolist() == [one_by_one.draws(1)[0] for _ in range(count)]


def short_flights():
    """Two flights and whether they were compiled, for a process of its own: free, and down to a moving deck."""
    from shipland.rig import Rig

    free = track(1.5)[0]
    speed_sticks = {"loop": {"kind": "velocity"}}
    landing = world(distance_m=0.1, height_m=0.5, ship=moving_ship(Rig()), aircraft=speed_sticks)
    come_down(landing, most_s=1.5)
    truth = landing.truth()
    rows = [*truth.ned_from_body.translation_m, *truth.velocity_in_ned_mps, *truth.ned_from_body.rotation.ravel()]
    return {"compiled": hasattr(control, "py_func"), "free": free.tolist(), "landing": rows}


if __name__ == "__main__":
    print(json.dumps(short_flights()))
