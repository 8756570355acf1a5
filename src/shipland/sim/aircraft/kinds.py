"""The aircraft that the configuration names: airframes and inner loops, packaged or brought along."""

from __future__ import annotations

from shipland.factories import resolve
from shipland.sim.aircraft.aircraft import Aircraft
from shipland.sim.aircraft.parameters import AircraftParameters


def build_aircraft(parameters: AircraftParameters, step_s: float) -> Aircraft:
    """The aircraft of `aircraft.kind` at its start; it makes its own inner loop.

    Args:
        parameters: section `[aircraft]`.
        step_s: time between control steps [s].

    Raises:
        ConfigError: there is no such aircraft or inner loop.
    """
    aircraft: Aircraft = resolve("aircraft", parameters.kind)(parameters, step_s)
    return aircraft
