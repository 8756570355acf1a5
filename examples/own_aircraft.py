"""Another airframe and another inner loop: a 25 kg octocopter that answers a little stick softly.

Flown by name, from this folder: `shipland fly near --set aircraft.kind=own_aircraft:octocopter`.
"""

from dataclasses import replace

from shipland.frames import rows_from_quaternion
from shipland.sim.aircraft.aircraft import Wrench
from shipland.sim.aircraft.attitude_loop import AttitudeLoop
from shipland.sim.aircraft.autopilot import LoopSetup
from shipland.sim.aircraft.parameters import Shape

ARMS = [(0.6, 0.25), (0.6, -0.25), (0.25, 0.6), (0.25, -0.6), (-0.25, 0.6), (-0.25, -0.6), (-0.6, 0.25), (-0.6, -0.25)]
FEET = tuple((x, y, 0.3) for x in (0.25, -0.25) for y in (0.25, -0.25))
SHAPE = Shape(25.0, (1.6, 1.6, 2.9), (0.5, 0.4, 0.2), FEET, 0.02, 0.8, 0.008, tuple((*a, -0.1) for a in ARMS), 0.2)


class SoftLoop(AttitudeLoop):
    """The packaged attitude loop with quadratic sticks."""

    def update(self, sensed, sticks):
        """See `InnerLoop`."""
        soft = sticks._replace(pitch=sticks.pitch * abs(sticks.pitch), roll=sticks.roll * abs(sticks.roll))
        return super().update(sensed, soft)


class Octocopter:
    """Eight rotors seen from outside: the thrust and moments asked for, within limits; linear drag."""

    shape = SHAPE

    def __init__(self, parameters, step_s):
        airframe = replace(parameters.airframe, mass_kg=25.0, inertia_kgm2=SHAPE.inertia_kgm2, rotor_drag_per_s=0.1)
        self._parameters, self._step_s = replace(parameters, airframe=airframe), step_s

    def trim(self, wind_in_ned_mps, heading_rad):
        """See `Aircraft`: it starts level and finds the wind itself."""
        return 0.0, 0.0

    def begin(self, sensed):
        """See `Aircraft`."""
        self._loop = SoftLoop(LoopSetup(self._parameters, self._step_s, sensed, (0.0, 0.0, 0.0)))

    def step(self, motion, sensed, sticks, wind_in_ned_mps, deck):
        """See `Aircraft`."""
        drag = [-25.0 * 0.1 * (v - w) for v, w in zip(motion.velocity_mps, wind_in_ned_mps, strict=True)]
        if sticks is None:
            return Wrench(tuple(drag), (0.0, 0.0, 0.0))
        thrust, *moments = self._loop.update(sensed, sticks)
        thrust, (_, _, x, _, _, y, _, _, z) = min(max(thrust, 0.0), 500.0), rows_from_quaternion(*motion.quaternion)
        force = (drag[0] - thrust * x, drag[1] - thrust * y, drag[2] - thrust * z)
        return Wrench(force, tuple(min(max(moment, -60.0), 60.0) for moment in moments))


octocopter = Octocopter
