"""What full sticks mean on a vehicle, how fast it answers and how late, from a log of its flight.

Each axis is taken for a first-order lag behind a dead time: the stick that was sent, held until the next one, makes a
tilt, a speed or a rate. Gain and bias follow by least squares for every pair of lag and dead time; the pair with the
smallest residual is taken. An axis whose stick was hardly moved tells nothing and is left out.

Of a vehicle that flies speeds the tilts tell more than the speeds do: they tilt by a gain times the error of the speed
and by another times its sum, against a steady wind. Lag and dead time are then the tilt's own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.optimize import minimize

from shipland.errors import DataError
from shipland.frames import GRAVITY_MPS2, Array
from shipland.messages import FlightRecord, Intent, Telemetry

LEAST_STICK_PERCENT = 3.0
"""Standard deviation of a stick below which its axis is left out."""
LEAST_EXPLAINED = 0.3
"""Share of the variance that the sticks must explain, or the axis is left out."""
REVERSED_EXPLAINED, REVERSED_WAYS = 0.6, 0.1
"""The same of an axis that answers the other way round, and the share of time that its stick was moved to either side:
released sticks hold against wind, which a stick to one side alone looks the reverse of."""
_STEP_S = 0.01
_LEAST_ROWS = 50
_Axis = TypeVar("_Axis", bound="FirstOrder")


@dataclass(frozen=True)
class FirstOrder:
    """A fitted axis.

    Attributes:
        full: steady value at full stick.
        lag_s: time constant.
        delay_s: from the command's being ready to the first reaction.
        explained: share of the variance that it explains.
    """

    full: float
    lag_s: float
    delay_s: float
    explained: float


@dataclass(frozen=True)
class SpeedLoop(FirstOrder):
    """How a vehicle that flies speeds tilts for them: `full` is a speed [m/s], the rest is of the tilt.

    Attributes:
        servo_per_s: from the speed's error to acceleration.
    """

    servo_per_s: float


@dataclass(frozen=True)
class Identified:
    """A vehicle's response; None for an axis that the flight tells nothing of.

    Attributes:
        kind: `attitude` or `velocity`: which of the two the sticks explain better.
        level: pitch and roll together: tilt [rad] or speed [m/s].
        loop: of the kind velocity; None where the tilts do not tell it.
        climb: [m/s].
        turn: [rad/s].
        drag_per_s: deceleration for a metre per second; None for the kind velocity.
    """

    kind: str
    level: FirstOrder | None
    loop: SpeedLoop | None
    climb: FirstOrder | None
    turn: FirstOrder | None
    drag_per_s: float | None

    def toml(self, uplink_s: float) -> str:
        """The table `[response.…]` that a pilot takes; what is not known is left to the defaults.

        Args:
            uplink_s: part of the delay that is the link's.
        """
        lines = [f"[response.{self.kind}]"]
        level = self.loop or self.level
        if level is not None:
            name = "max_tilt_rad" if self.kind == "attitude" else "max_speed_mps"
            lines += [f"{name} = {level.full:.4f}"]
            if isinstance(level, SpeedLoop):
                lines += [f"servo_per_s = {level.servo_per_s:.4f}", f"lag_s = {level.lag_s:.4f}"]
            elif self.kind == "velocity":
                lines += [f"servo_per_s = {1.0 / level.lag_s:.4f}"]
            else:
                lines += [f"lag_s = {level.lag_s:.4f}"]
            lines += [f"uplink_s = {uplink_s:.4f}", f"dead_time_s = {max(0.0, level.delay_s - uplink_s):.4f}"]
        if self.drag_per_s is not None:
            lines += [f"drag_per_s = {self.drag_per_s:.4f}"]
        if (climb := self.climb) is not None:
            lines += [f"max_climb_mps = {climb.full:.4f}", f"climb_lag_s = {climb.lag_s:.4f}"]
            lines += [f"climb_dead_time_s = {max(0.0, climb.delay_s - uplink_s):.4f}"]
        if (turn := self.turn) is not None:
            # what a turn waits longer than a tilt counts as lag
            late_s = turn.lag_s + (0.0 if level is None else max(0.0, turn.delay_s - level.delay_s))
            lines += [f"max_turn_rad_s = {turn.full:.4f}", f"turn_lag_s = {late_s:.4f}"]
        return "\n".join(lines) + "\n"

    def table(self) -> str:
        """For people, as Markdown."""
        rows = ["| axis | at full stick | lag [s] | delay [s] | explained |", "|---|---:|---:|---:|---:|"]
        unit = "rad of tilt" if self.kind == "attitude" else "m/s"
        for name, axis, what in (
            ("level", self.level, unit),
            ("climb", self.climb, "m/s"),
            ("turn", self.turn, "rad/s"),
        ):
            if axis is None:
                rows.append(f"| {name} | not moved enough, or not answered | | | |")
            else:
                share = f"{100.0 * axis.explained:.0f} %"
                rows.append(f"| {name} | {axis.full:.3f} {what} | {axis.lag_s:.3f} | {axis.delay_s:.3f} | {share} |")
        if self.loop is not None:
            loop = self.loop
            what, share = f"{loop.full:.3f} m/s at {loop.servo_per_s:.2f} /s", f"{100.0 * loop.explained:.0f} %"
            rows.insert(3, f"| tilt for it | {what} | {loop.lag_s:.3f} | {loop.delay_s:.3f} | {share} |")
        return "\n".join(rows)


def identify(records: Sequence[FlightRecord]) -> Identified:
    """The response of the vehicle that flew these rows.

    Of a landing the sticks count, for what comes after it, and no answer: it ends on a surface, where there is none.

    Raises:
        DataError: too few rows in flight, sticks that were never moved, or an axis that answers the other way round.
    """
    rows = [row for row in records if row.telemetry.flying]
    commands = [row.decision.command for row in rows]
    answers = np.array([command.intent is not Intent.LAND for command in commands])
    if (count := np.count_nonzero(answers)) < _LEAST_ROWS:
        raise DataError(f"the log holds {count} cycles in flight; at least {_LEAST_ROWS} are needed")
    sent_s = np.array([command.t_s for command in commands])
    pitch, roll, heave, yaw = (
        0.01 * np.array([getattr(command, f"{name}_percent") for command in commands])
        for name in ("pitch", "roll", "heave", "yaw")
    )
    told = [row.telemetry for row in rows]
    velocities = [each.velocity_in_level_mps for each in told]
    unknown = np.full(3, np.nan)
    velocity_s, velocity = _series(told, "velocity_t_s", [unknown if each is None else each for each in velocities])
    tilt_s, tilt = _series(told, "attitude_t_s", [(each.roll_rad, each.pitch_rad) for each in told])
    heading_s, heading_rad = _series(told, "heading_t_s", [each.heading_rad for each in told])
    heading_rad = np.unwrap(heading_rad)  # not its rate: that would drown in the readings' noise
    (velocity_s, velocity), (tilt_s, tilt), (heading_s, heading_rad) = (
        (t_s[answered], values[answered])
        for t_s, values in ((velocity_s, velocity), (tilt_s, tilt), (heading_s, heading_rad))
        for answered in [_held(sent_s, answers, t_s)]
    )
    fits = {
        "pitch": (_fit(sent_s, pitch, tilt_s, -tilt[:, 1]), _fit(sent_s, pitch, velocity_s, velocity[:, 0])),
        "roll": (_fit(sent_s, roll, tilt_s, tilt[:, 0]), _fit(sent_s, roll, velocity_s, velocity[:, 1])),
        "heave": (_fit(sent_s, heave, velocity_s, -velocity[:, 2]),),
        "yaw": (_fit(sent_s, yaw, heading_s, heading_rad, summed=True),),
    }
    known = {name: [fit for fit in found if fit is not None] for name, found in fits.items()}
    if wrong := [name for name, found in known.items() if found and all(fit.full < 0.0 for fit in found)]:
        raise DataError(
            f"{', '.join(wrong)}: the vehicle answers the other way round, or tells its motion so. Forward, right, up "
            "and clockwise are positive: mend the axes of what stands between before it flies"
        )
    level_tilt, level_speed = (_best(pair) for pair in zip(fits["pitch"], fits["roll"], strict=True))
    (climb,), (turn,) = fits["heave"], fits["yaw"]
    if level_tilt is None and level_speed is None and climb is None and turn is None:
        raise DataError("no stick was moved enough, or nothing answered; fly a log in which every stick moves")
    by_speed = level_speed is not None and (level_tilt is None or level_speed.explained > level_tilt.explained)
    if by_speed and level_speed is not None:
        axes = (pitch, -tilt[:, 1], velocity[:, 0]), (roll, tilt[:, 0], velocity[:, 1])
        full_mps = level_speed.full
        loops = [_speed_loop(sent_s, stick, tilt_s, along, velocity_s, speed, full_mps) for stick, along, speed in axes]
        return Identified("velocity", level_speed, _best(loops), climb, turn, None)
    drag_per_s = _drag(tilt_s, tilt, velocity_s, velocity, heading_s, heading_rad)
    return Identified("attitude", level_tilt, None, climb, turn, drag_per_s)


def _speed_loop(
    sent_s: Array, stick: Array, tilt_s: Array, tilt_rad: Array, velocity_s: Array, speed_mps: Array, full_mps: float
) -> SpeedLoop | None:
    """The loop that explains tilts (n,) at times (n,) by the stick (m,) and the speeds (k,) along the same axis.

    `full_mps` is about what full stick means.
    """
    if min(len(tilt_s), len(velocity_s)) < _LEAST_ROWS or 100.0 * float(np.std(stick)) < LEAST_STICK_PERCENT:
        return None
    begin_s = max(sent_s[0], tilt_s[0], velocity_s[0])
    grid_s = np.arange(begin_s, min(sent_s[-1], tilt_s[-1], velocity_s[-1]), _STEP_S)
    held = _held(sent_s, stick, grid_s)
    push = GRAVITY_MPS2 * np.tan(np.interp(grid_s, tilt_s, tilt_rad))
    speed = np.interp(grid_s, velocity_s, speed_mps)
    inside = grid_s > begin_s + 1.0
    if not inside.any() or np.var(push[inside]) <= 0.0:
        return None

    def solved(full: float, lag_s: float, delay_s: float) -> tuple[float, float]:
        """Gain, and the share of variance left; the error's sum makes up for a steady wind."""
        error = full * np.interp(grid_s - delay_s, grid_s, held) - speed
        basis = np.column_stack([_lagged(error, lag_s), np.cumsum(error) * _STEP_S, np.ones_like(error)])[inside]
        return _gain(basis, push[inside])

    def left_over(x: Array) -> float:
        return solved(abs(float(x[0])), *_bounded(x[1:]))[1]

    starts = [np.array([full_mps, lag_s, delay_s]) for lag_s in (0.05, 0.2) for delay_s in (0.05, 0.2)]
    found = minimize(left_over, min(starts, key=left_over), method="Nelder-Mead", options={"maxiter": 300}).x
    full, lag_s, delay_s = abs(float(found[0])), *_bounded(found[1:])
    servo_per_s, left = solved(full, lag_s, delay_s)
    if servo_per_s <= 0.0 or 1.0 - left < LEAST_EXPLAINED:
        return None
    return SpeedLoop(full, lag_s, delay_s, 1.0 - left, servo_per_s)


def _fit(sent_s: Array, stick: Array, t_s: Array, values: Array, summed: bool = False) -> FirstOrder | None:
    """The lag that explains values (n,) at times (n,) by a stick (m,) in −1 … 1; `summed`: their rate follows it.

    Of an axis that answers the other way round, surely, `full` is negative.
    """
    if len(t_s) < _LEAST_ROWS or 100.0 * float(np.std(stick)) < LEAST_STICK_PERCENT:
        return None
    grid_s = np.arange(sent_s[0], sent_s[-1] + _STEP_S, _STEP_S)
    held = _held(sent_s, stick, grid_s)
    inside = (t_s > sent_s[0] + 1.0) & (t_s < sent_s[-1])
    t_s, values = t_s[inside], values[inside]
    if not len(values) or np.var(values) <= 0.0:
        return None

    def solved(lag_s: float, delay_s: float) -> tuple[float, float]:
        """Gain, and the share of variance left."""
        followed = _lagged(held, lag_s)
        answer = np.interp(t_s - delay_s, grid_s, np.cumsum(followed) * _STEP_S if summed else followed)
        basis = np.column_stack([answer, np.ones_like(answer)])
        return _gain(basis, values)

    starts = [(lag_s, delay_s) for lag_s in (0.1, 0.4, 1.5) for delay_s in (0.05, 0.3)]
    begin = np.array(min(starts, key=lambda pair: solved(*pair)[1]))

    def left_over(x: Array) -> float:
        return solved(*_bounded(x))[1]

    lag_s, delay_s = _bounded(minimize(left_over, begin, method="Nelder-Mead", options={"maxiter": 150}).x)
    full, left = solved(lag_s, delay_s)
    moved = 100.0 * _held(sent_s, stick, t_s)
    both_ways = min(np.mean(moved > LEAST_STICK_PERCENT), np.mean(moved < -LEAST_STICK_PERCENT))
    if full <= 0.0 and both_ways < REVERSED_WAYS:
        return None
    if 1.0 - left < (LEAST_EXPLAINED if full > 0.0 else REVERSED_EXPLAINED):
        return None
    return FirstOrder(full, lag_s, delay_s, 1.0 - left)


def _held(sent_s: Array, stick: Array, times_s: Array) -> Array:
    """The stick (m,) that is in force at times (n,): each sent one is held until the next."""
    return stick[np.clip(np.searchsorted(sent_s, times_s, side="right") - 1, 0, len(stick) - 1)]


def _gain(basis: Array, wanted: Array) -> tuple[float, float]:
    """Least squares: what the first column of a basis (n,k) is multiplied by, and the share of variance left."""
    found = np.linalg.lstsq(basis, wanted, rcond=None)[0]
    return float(found[0]), float(np.mean((basis @ found - wanted) ** 2)) / float(np.var(wanted))


def _bounded(x: Array) -> tuple[float, float]:
    """Lag and delay of a search's point: positive, and no later than two seconds."""
    return abs(float(x[0])) + 1e-3, min(abs(float(x[1])), 2.0)


def _lagged(values: Array, lag_s: float) -> Array:
    """A first-order lag of evenly spaced values (n,)."""
    from scipy.signal import lfilter

    keep = math.exp(-_STEP_S / lag_s)
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0])


def _best(found: Sequence[_Axis | None]) -> _Axis | None:
    """The mean of two axes that should be alike, weighted by what they explain."""
    known = [axis for axis in found if axis is not None and axis.full > 0.0]
    if not known:
        return None
    weights = np.array([axis.explained for axis in known])
    mean = [float(np.average([getattr(axis, name) for axis in known], weights=weights)) for name in vars(known[0])]
    return type(known[0])(*mean)


def _series(told: Sequence[Telemetry], stamp: str, values: Sequence[object]) -> tuple[Array, Array]:
    """Times (n,) and values (n,) or (n,k) of telemetry, None for unknown: where it is new and whole.

    Telemetry comes less often than cycles. `stamp` names the time of these values; it defaults to the whole's.
    """
    stamps_s = [getattr(each, stamp) for each in told]
    times_s = np.array([each.t_s if at_s is None else at_s for each, at_s in zip(told, stamps_s, strict=True)])
    table = np.array(values, dtype=float)
    known = np.isfinite(times_s) & np.isfinite(table).reshape(len(told), -1).all(axis=1)
    times_s, table = times_s[known], table[known]
    new = np.diff(np.maximum.accumulate(times_s), prepend=-np.inf) > 0.0
    return times_s[new], table[new]


def _drag(
    tilt_s: Array, tilt: Array, velocity_s: Array, velocity: Array, heading_s: Array, heading_rad: Array
) -> float | None:
    """Deceleration for a metre per second, from speeds that the tilts do not explain; a steady wind is the bias.

    Along the axes of the first heading: the wind stays there while the aircraft turns.
    """
    if len(velocity_s) < _LEAST_ROWS or min(len(tilt_s), len(heading_s)) < 2:
        return None
    turned_rad = np.interp(velocity_s, heading_s, heading_rad) - heading_rad[0]
    cosine, sine = np.cos(turned_rad), np.sin(turned_rad)
    pushes = [GRAVITY_MPS2 * np.tan(np.interp(velocity_s, tilt_s, angle)) for angle in (-tilt[:, 1], tilt[:, 0])]
    found = []
    for forward, right in ((cosine, -sine), (sine, cosine)):
        speed = forward * velocity[:, 0] + right * velocity[:, 1]
        push = _between(forward * pushes[0] + right * pushes[1])
        basis = np.column_stack([_between(speed), np.ones_like(push)])
        found.append(-float(np.linalg.lstsq(basis, np.diff(speed) / np.diff(velocity_s) - push, rcond=None)[0][0]))
    return max(0.0, float(np.mean(found)))


def _between(values: Array) -> Array:
    """Means (n-1,) of neighbours among values (n,)."""
    return 0.5 * (values[1:] + values[:-1])
