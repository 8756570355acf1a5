"""Tracking a horizontal velocity and holding a place: the laws that both packaged loops share."""

from __future__ import annotations

import math

from shipland.sim.aircraft.autopilot import LoopSetup, Sensed, State

Pair = tuple[float, float]
"""North and east."""


class VelocityTracker:
    """Feed-forward, proportional and integral law from a velocity reference to a horizontal push.

    push = dv/dt + drag(v) + k_v (v + k_p Δp - v_sensed) + k_i ∫ (…), with the nominal drag of still air; the integral
    is the push that the wind asks for. It stands still while the push is at its limit.
    """

    def __init__(self, setup: LoopSetup) -> None:
        self._loop, self._airframe = setup.parameters.loop, setup.parameters.airframe
        self._step_s = setup.step_s
        self.wind_push_mps2: Pair = (setup.push_in_ned_mps2[0], setup.push_in_ned_mps2[1])
        """The integral."""

    def push(self, sensed: Sensed, velocity: Pair, rate: Pair, off_m: Pair, most_mps2: float) -> Pair:
        """Acceleration (north, east) [m/s²] that thrust must give.

        Args:
            sensed: what is known.
            velocity: reference [m/s].
            rate: its derivative [m/s²].
            off_m: reference place minus sensed place; (0, 0) holds no place.
            most_mps2: largest push.
        """
        loop = self._loop
        drag_per_s = self._airframe.rotor_drag_per_s + self._airframe.body_drag_per_m * math.hypot(*velocity)
        error_n = velocity[0] + loop.position_per_s * off_m[0] - sensed.north_mps
        error_e = velocity[1] + loop.position_per_s * off_m[1] - sensed.east_mps
        wind_n, wind_e = self.wind_push_mps2
        push_n = rate[0] + drag_per_s * velocity[0] + loop.velocity_per_s * error_n + wind_n
        push_e = rate[1] + drag_per_s * velocity[1] + loop.velocity_per_s * error_e + wind_e
        push = math.hypot(push_n, push_e)
        if push > most_mps2:
            scale = most_mps2 / push
            return push_n * scale, push_e * scale
        gain = loop.velocity_integral_per_s2 * self._step_s
        self.wind_push_mps2 = (wind_n + gain * error_n, wind_e + gain * error_e)
        return push_n, push_e


class PlaceHold:
    """Released sticks: brake from the present velocity and hold the place where the brake ends."""

    def __init__(self, setup: LoopSetup) -> None:
        self._loop, self._step_s = setup.parameters.loop, setup.step_s
        self.tracker = VelocityTracker(setup)
        self._holding = False
        self._place = self._velocity = self._rate = (0.0, 0.0)

    @property
    def state(self) -> State:
        """What it remembers between updates, its tracker's first."""
        return *self.tracker.wind_push_mps2, float(self._holding), *self._place, *self._velocity, *self._rate

    @state.setter
    def state(self, values: State) -> None:
        wind_n, wind_e, holding, *rest = values
        self.tracker.wind_push_mps2, self._holding = (wind_n, wind_e), holding > 0.0
        self._place, self._velocity, self._rate = (rest[0], rest[1]), (rest[2], rest[3]), (rest[4], rest[5])

    def release(self) -> None:
        """The sticks are deflected: the next `push` begins a new brake."""
        self._holding = False

    def push(self, sensed: Sensed, most_mps2: float) -> Pair:
        """Acceleration (north, east) [m/s²] that thrust must give; at most `most_mps2`."""
        loop, dt = self._loop, self._step_s
        if not self._holding:
            self._holding = True
            self._place = (sensed.north_m, sensed.east_m)
            self._velocity = (sensed.north_mps, sensed.east_mps)
            self._rate = (0.0, 0.0)
        (ref_n, ref_e), (rate_n, rate_e) = self._velocity, self._rate
        brake_per_s = min(1.0 / loop.brake_time_s, loop.brake_mps2 / max(math.hypot(ref_n, ref_e), 1e-9))
        settle = min(1.0, dt / loop.tilt_time_s)
        rate_n -= settle * (brake_per_s * ref_n + rate_n)
        rate_e -= settle * (brake_per_s * ref_e + rate_e)
        ref_n += rate_n * dt
        ref_e += rate_e * dt
        self._velocity, self._rate = (ref_n, ref_e), (rate_n, rate_e)
        place_n, place_e = self._place[0] + ref_n * dt, self._place[1] + ref_e * dt
        self._place = (place_n, place_e)
        off_m = (place_n - sensed.north_m, place_e - sensed.east_m)
        return self.tracker.push(sensed, self._velocity, self._rate, off_m, most_mps2)


def released(pitch: float, roll: float, hold_below_percent: float) -> bool:
    """Whether both pitch and roll sticks are below the smallest stick."""
    return 100.0 * max(abs(pitch), abs(roll)) < hold_below_percent
