"""Another airframe and inner loop: the packaged 25 kg `octo25`, flown by tilts, that answers a little stick softly.

shipland fly --vision geometric --set aircraft.kind=own_aircraft:octocopter        # in this folder

To fly `octo25` as it is, a scenario says `parts = ["octo25"]`.
"""

from dataclasses import replace

from shipland.config import build, packaged_toml
from shipland.sim.aircraft.aircraft import Quadrotor
from shipland.sim.aircraft.loops import AttitudeLoop
from shipland.sim.aircraft.parameters import AircraftParameters

OCTO25 = build(AircraftParameters, packaged_toml("parts/octo25")["aircraft"], "octo25")


class SoftLoop(AttitudeLoop):
    """The packaged attitude loop with quadratic sticks."""

    def update(self, sensed, sticks):
        """See `InnerLoop`."""
        soft = sticks._replace(pitch=sticks.pitch * abs(sticks.pitch), roll=sticks.roll * abs(sticks.roll))
        return super().update(sensed, soft)


class Octocopter(Quadrotor):
    """`octo25`'s airframe and gains under the soft loop; what full sticks mean stays the scenario's."""

    def __init__(self, parameters, step_s):
        loop = replace(OCTO25.loop, kind=f"{__name__}:SoftLoop")
        super().__init__(replace(parameters, airframe=OCTO25.airframe, loop=loop), step_s)


octocopter = Octocopter
