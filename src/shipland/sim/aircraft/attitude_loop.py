"""Stick = tilt angle against the horizon, as an ANAFI flies a PCMD with its flag set.

A deflected stick asks for a roll and a pitch angle and for nothing else: a gust pushes the aircraft, and it drifts with
the wind. Released sticks (PCMD's flag 0) brake and hold the place. Source: Parrot staff, developer forum, thread 12864,
"Understanding anafi inner loop control and PCMD commands". Plain float arithmetic.
"""

from __future__ import annotations

import math

from shipland.frames import GRAVITY_MPS2
from shipland.sim.aircraft.autopilot import Demand, LoopSetup, Sensed, State, Sticks
from shipland.sim.aircraft.loop_laws import Pair, PlaceHold, Stabiliser, released


class AttitudeLoop:
    """The ANAFI's inner loop.

    Args:
        setup: the aircraft and where it starts.
    """

    def __init__(self, setup: LoopSetup) -> None:
        settings, loop = setup.parameters.settings, setup.parameters.loop
        self._max_tilt_rad = math.radians(settings.max_tilt_deg)
        self._max_slope = math.tan(math.radians(loop.tilt_limit_deg))
        self._hold_below_percent = loop.hold_below_percent
        self._stabiliser = Stabiliser(setup)
        self._hold = PlaceHold(setup)
        self._trim = WindTrim(setup) if loop.wind_trim_s > 0.0 else None

    @property
    def state(self) -> State:
        """What it remembers between updates."""
        return *self._stabiliser.state, *self._hold.state, *(self._trim.state if self._trim else (0.0,) * 4)

    @state.setter
    def state(self, values: State) -> None:
        self._stabiliser.state, self._hold.state = values[:6], values[6:15]
        if self._trim:
            self._trim.state = values[15:]

    def update(self, sensed: Sensed, sticks: Sticks) -> Demand:
        """See `InnerLoop`."""
        lift = self._stabiliser.lift_mps2(sensed, sticks.heave)
        trim_mps2 = self._trim.update(sensed) if self._trim is not None else (0.0, 0.0)
        if released(sticks.pitch, sticks.roll, self._hold_below_percent):
            push = self._hold.push(sensed, lift * self._max_slope)
            roll_ref, pitch_ref = tilt_of(push, lift, sensed.heading_rad)
        else:
            self._hold.release()
            roll_ref, pitch_ref = sticks.roll * self._max_tilt_rad, -sticks.pitch * self._max_tilt_rad
            if self._trim is not None:
                roll_ref, pitch_ref = self._trimmed(trim_mps2, sticks, lift, sensed.heading_rad)
        return self._stabiliser.demand(sensed, lift, roll_ref, pitch_ref, sticks.yaw)

    def _trimmed(self, trim_mps2: Pair, sticks: Sticks, lift: float, heading_rad: float) -> tuple[float, float]:
        """Roll and pitch that add the stick's push to the wind's."""
        c, s = math.cos(heading_rad), math.sin(heading_rad)
        forward = lift * math.tan(sticks.pitch * self._max_tilt_rad)
        right = lift * math.tan(sticks.roll * self._max_tilt_rad)
        push_n, push_e = c * forward - s * right + trim_mps2[0], s * forward + c * right + trim_mps2[1]
        scale = min(1.0, lift * self._max_slope / max(math.hypot(push_n, push_e), 1e-9))
        return tilt_of((push_n * scale, push_e * scale), lift, heading_rad)


class WindTrim:
    """Slow estimate of the push that the wind asks for, from the aircraft's own tilt and velocity.

    With f = (thrust's horizontal push) - (still air's drag at the sensed velocity), f - dv/dt is the wind's share; a
    first-order low-pass of it needs no derivative: LP[f] - (v - LP[v]) / T.
    """

    def __init__(self, setup: LoopSetup) -> None:
        self._airframe = setup.parameters.airframe
        self._time_s = setup.parameters.loop.wind_trim_s
        self._share = -math.expm1(-setup.step_s / self._time_s)
        self._push_n, self._push_e = setup.push_in_ned_mps2[0], setup.push_in_ned_mps2[1]
        self._velocity_n, self._velocity_e = setup.sensed.north_mps, setup.sensed.east_mps

    @property
    def state(self) -> State:
        """What it remembers between updates."""
        return self._push_n, self._push_e, self._velocity_n, self._velocity_e

    @state.setter
    def state(self, values: State) -> None:
        self._push_n, self._push_e, self._velocity_n, self._velocity_e = values

    def update(self, sensed: Sensed) -> Pair:
        """The estimate (north, east) [m/s²] after one more step."""
        c, s = math.cos(sensed.heading_rad), math.sin(sensed.heading_rad)
        forward = -GRAVITY_MPS2 * math.tan(sensed.pitch_rad)
        right = GRAVITY_MPS2 * math.tan(sensed.roll_rad) / max(math.cos(sensed.pitch_rad), 0.5)
        v_n, v_e = sensed.north_mps, sensed.east_mps
        drag_per_s = self._airframe.rotor_drag_per_s + self._airframe.body_drag_per_m * math.hypot(v_n, v_e)
        self._push_n += self._share * (c * forward - s * right - drag_per_s * v_n - self._push_n)
        self._push_e += self._share * (s * forward + c * right - drag_per_s * v_e - self._push_e)
        self._velocity_n += self._share * (v_n - self._velocity_n)
        self._velocity_e += self._share * (v_e - self._velocity_e)
        return (
            self._push_n - (v_n - self._velocity_n) / self._time_s,
            self._push_e - (v_e - self._velocity_e) / self._time_s,
        )


def tilt_of(push_mps2: Pair, lift_mps2: float, heading_rad: float) -> tuple[float, float]:
    """Roll and pitch [rad] that give a push (north, east) beside a lift."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    forward = c * push_mps2[0] + s * push_mps2[1]
    right = c * push_mps2[1] - s * push_mps2[0]
    pitch = -math.atan2(forward, lift_mps2)
    return math.atan2(right * math.cos(pitch), lift_mps2), pitch
