"""What the batched last phase is made of: the parts of a scenario that it models, and what is randomised."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.config import require
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.response import Response
from shipland.rig import Rig
from shipland.sim.air.wind import WindParameters
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.ship.ship import ShipParameters

FARTHEST_M = 12.0
"""Greatest distance from the landing point that a flight of the last phase begins at."""


@dataclass(frozen=True)
class PhaseSetup:
    """The scenario as the last phase has it.

    Attributes:
        horizon: parameters of the pilot `horizon`, which the model flies batched.
        response: what that pilot takes the sticks for; of the kind `attitude`.
        hover_height_m: over the neutral deck, before a landing begins.
        settle_s: so long the landing condition holds before one begins.
        slew_per_s: bound of the safety on each stick's rate, in shares of the full stick.
        rig, aircraft, ship, wind: of the simulator.
        cycle_s: from picture to picture.
        picture_age_s: of a picture when the command that it leads to is ready.
        velocity_hz: readings of the vehicle's velocity a second; 0 without.
    """

    horizon: HorizonParameters
    response: Response
    hover_height_m: float
    settle_s: float
    slew_per_s: float
    rig: Rig
    aircraft: AircraftParameters
    ship: ShipParameters
    wind: WindParameters
    cycle_s: float
    picture_age_s: float
    velocity_hz: float

    def __post_init__(self) -> None:
        kind = self.aircraft.loop.kind
        require(
            kind == "attitude" and self.response.kind == "attitude",
            f"the batched last phase models sticks of the kind 'attitude', not {kind!r}",
        )
        require(
            self.velocity_hz == 0.0 or self.velocity_every >= 2,
            f"the batched last phase models a velocity at up to 15 Hz, not {self.velocity_hz:g}",
        )

    @property
    def velocity_every(self) -> int:
        """Pictures from one reading of the velocity to the next."""
        return max(round(1.0 / (self.velocity_hz * self.cycle_s)), 1) if self.velocity_hz > 0.0 else 6


@dataclass(frozen=True)
class Randomisation:
    """What differs from flight to flight, each drawn evenly.

    Attributes:
        airframe: drag, inflow loss, and the rates of rotors and attitude loop vary by this share either way.
        latency_s: pictures are older than they say by up to this, or younger: what the pilot's correction in flight,
        which the model does not have, leaves.
        wind_mps: lowest and highest mean wind, from anywhere.
        start_m: nearest and farthest start from the landing point, at the hover's height, astern or aside.
        wake: whether the superstructure's wake blows.
    """

    airframe: float = 0.3
    latency_s: float = 0.02
    wind_mps: tuple[float, float] = (0.0, 9.0)
    start_m: tuple[float, float] = (0.0, 1.5)
    wake: bool = True

    def __post_init__(self) -> None:
        require(0.0 <= self.airframe < 0.6, f"airframe must be a share below 0.6, got {self.airframe}")
        require(0.0 <= self.latency_s <= 0.1, f"latency_s must be at most 0.1 s, got {self.latency_s}")
        for name, (low, high), most in (("wind_mps", self.wind_mps, 15.0), ("start_m", self.start_m, FARTHEST_M)):
            require(0.0 <= low <= high <= most, f"{name} must rise within 0 … {most:g}, got {low:g} … {high:g}")


EXACT = Randomisation(0.0, 0.0)
"""The scenario's own aircraft, and pictures as old as they say."""
