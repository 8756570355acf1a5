"""Stick = velocity set-point, tracked inside: PX4's OFFBOARD and ArduPilot's guided velocity.

The set-point is over the velocity reference (`aircraft.loop.velocity_reference`): ground, or the surface that the
optical flow sees. The reference approaches it with a limited acceleration, and tilt follows from tracking it. Released
sticks brake and, below `HOLD_MPS`, hold the place.
"""

from __future__ import annotations

import math

from shipland.sim.aircraft.attitude_loop import tilt_of
from shipland.sim.aircraft.autopilot import Demand, LoopSetup, Sensed, State, Sticks
from shipland.sim.aircraft.loop_laws import Stabiliser, VelocityTracker, released

HOLD_MPS = 0.2
"""Reference speed under which released sticks hold the place."""


class VelocityLoop:
    """The inner loop of an autopilot in guided velocity.

    Args:
        setup: the aircraft and where it starts.
    """

    def __init__(self, setup: LoopSetup) -> None:
        self._loop, self._step_s = setup.parameters.loop, setup.step_s
        self._max_speed_mps = setup.parameters.settings.max_speed_mps
        self._max_slope = math.tan(math.radians(self._loop.tilt_limit_deg))
        self._stabiliser = Stabiliser(setup)
        self._tracker = VelocityTracker(setup)
        self._velocity = self._rate = (0.0, 0.0)
        self._place: tuple[float, float] | None = None

    @property
    def state(self) -> State:
        """What it remembers between updates."""
        wind, place = self._tracker.wind_push_mps2, self._place
        held = (1.0, *place) if place is not None else (0.0, 0.0, 0.0)
        return *self._stabiliser.state, *wind, *held, *self._velocity, *self._rate, 0.0, 0.0, 0.0, 0.0

    @state.setter
    def state(self, values: State) -> None:
        self._stabiliser.state, self._tracker.wind_push_mps2 = values[:6], (values[6], values[7])
        self._place = (values[9], values[10]) if values[8] > 0.0 else None
        self._velocity, self._rate = (values[11], values[12]), (values[13], values[14])

    def update(self, sensed: Sensed, sticks: Sticks) -> Demand:
        """See `InnerLoop`."""
        lift = self._stabiliser.lift_mps2(sensed, sticks.heave)
        hold = released(sticks.pitch, sticks.roll, self._loop.hold_below_percent)
        self._follow((0.0, 0.0) if hold else self._wanted(sticks, sensed.heading_rad))
        off_m = self._off_place(sensed, hold)
        push = self._tracker.push(sensed, self._velocity, self._rate, off_m, lift * self._max_slope)
        roll_ref, pitch_ref = tilt_of(push, lift, sensed.heading_rad)
        return self._stabiliser.demand(sensed, lift, roll_ref, pitch_ref, sticks.yaw)

    def _wanted(self, sticks: Sticks, heading_rad: float) -> tuple[float, float]:
        c, s = math.cos(heading_rad), math.sin(heading_rad)
        forward, right = sticks.pitch * self._max_speed_mps, sticks.roll * self._max_speed_mps
        return c * forward - s * right, s * forward + c * right

    def _follow(self, wanted: tuple[float, float]) -> None:
        """Move the reference towards the set-point, its acceleration limited and smoothed."""
        loop, dt = self._loop, self._step_s
        (ref_n, ref_e), (rate_n, rate_e) = self._velocity, self._rate
        rise_n, rise_e = (wanted[0] - ref_n) / loop.velocity_time_s, (wanted[1] - ref_e) / loop.velocity_time_s
        scale = min(1.0, loop.acceleration_mps2 / max(math.hypot(rise_n, rise_e), 1e-9))
        settle = min(1.0, dt / loop.tilt_time_s)
        rate_n += settle * (scale * rise_n - rate_n)
        rate_e += settle * (scale * rise_e - rate_e)
        self._rate = (rate_n, rate_e)
        self._velocity = (ref_n + rate_n * dt, ref_e + rate_e * dt)

    def _off_place(self, sensed: Sensed, hold: bool) -> tuple[float, float]:
        if not hold or (self._place is None and math.hypot(*self._velocity) > HOLD_MPS):
            self._place = None
            return 0.0, 0.0
        north, east = self._place or (sensed.north_m, sensed.east_m)
        self._place = (north + self._velocity[0] * self._step_s, east + self._velocity[1] * self._step_s)
        return self._place[0] - sensed.north_m, self._place[1] - sensed.east_m
