"""How the simulated aircraft answers sticks and wind: every manoeuvre goes through `World` as a flight does.

Biases of attitude, heading and flow are zero in these flights; noise is not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from shipland.camera import CameraParameters
from shipland.config import build
from shipland.frames import Array, euler_from_rotation
from shipland.messages import PilotCommand
from shipland.rig import Rig
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.ship.ship import Ship, Still, StillCourse
from shipland.sim.touchdown import VerdictParameters
from shipland.sim.wind import ShipPlace, SteadyWind
from shipland.sim.world import StartParameters, World
from studies.harness import Case, Column, Row, Study

SAMPLE_S = 0.02
Stick = Callable[[float], tuple[float, float, float, float]]


@dataclass(frozen=True)
class Flight:
    """Histories (n,) of one manoeuvre; positions relative to the start; the first heading is north, forward."""

    t_s: Array
    position_m: Array
    velocity_mps: Array
    attitude_deg: Array


def fly(stick: Stick, seconds: float, wind_mps: float = 0.0, gust_s: float = 0.0, **loop: Any) -> Flight:  # noqa: ANN401
    """Fly far from the ship in still air or in a wind to the right that sets in at `gust_s`.

    Args:
        stick: (pitch, roll, heave, yaw percent) by time.
        seconds: how long.
        wind_mps: of the wind.
        gust_s: when it sets in.
        **loop: laid over `[aircraft.loop]`.
    """
    rig = Rig()
    spreads = {"distance_half_range_m": 0.0, "bearing_half_range_deg": 0.0, "height_half_range_m": 0.0}
    start = {"distance_m": 500.0, "height_m": 50.0, "heading_error_half_range_deg": 0.0} | spreads
    exact = {"attitude_bias_rad": 0.0, "heading_bias_rad": 0.0, "flow_bias_mps": 0.0}
    world = World(
        rig,
        CameraParameters(),
        build(AircraftParameters, {"loop": loop, "sensors": exact}, "aircraft"),
        VerdictParameters(),
        Ship(rig, StillCourse(), Still()),
        _Gust((0.0, wind_mps, 0.0), gust_s),
        build(StartParameters, start, "start"),
        np.random.default_rng(7),
    )
    begin = world.truth().ned_from_body.translation_m
    rows = []
    for index in range(round(seconds / SAMPLE_S) + 1):
        t_s = index * SAMPLE_S
        world.advance(t_s)
        truth = world.truth()
        angles = np.degrees(euler_from_rotation(truth.ned_from_body.rotation))
        rows.append([t_s, *(truth.ned_from_body.translation_m - begin), *truth.velocity_in_ned_mps, *angles])
        world.command(PilotCommand(t_s, *stick(t_s), 0.0))
    table = np.array(rows)
    return Flight(table[:, 0], table[:, 1:4], table[:, 4:7], table[:, 7:10])


class _Gust(SteadyWind):
    def __init__(self, velocity_in_ned_mps: tuple[float, float, float], start_s: float) -> None:
        super().__init__(velocity_in_ned_mps)
        self._start_s = start_s

    def velocity_at(
        self, t_s: float, position_in_ned_m: tuple[float, float, float], ship: ShipPlace
    ) -> tuple[float, float, float]:
        return super().velocity_at(t_s, position_in_ned_m, ship) if t_s >= self._start_s else (0.0, 0.0, 0.0)


def first_time(t_s: Array, reached: Array) -> float:
    """First time at which `reached` holds, NaN if never."""
    return float(t_s[np.argmax(reached)]) if reached.any() else math.nan


def step(index: int, percent: float, on_s: float, off_s: float) -> Stick:
    """One stick at `percent` between two times."""

    def stick(t_s: float) -> tuple[float, float, float, float]:
        values = [0.0, 0.0, 0.0, 0.0]
        if on_s <= t_s < off_s:
            values[index] = percent
        return values[0], values[1], values[2], values[3]

    return stick


LOOPS: dict[str, dict[str, Any]] = {
    "attitude": {"kind": "attitude"},
    "velocity": {"kind": "velocity"},
    "attitude, wind trim 2 s": {"kind": "attitude", "wind_trim_s": 2.0},
}
ON_S, OFF_S = 1.0, 16.0
"""Of the pitch stick."""
MANOEUVRES: dict[str, tuple[int, float, float]] = {
    "heave +50 %": (2, 50.0, 7.0),
    "heave −50 %": (2, -50.0, 7.0),
    "yaw 50 %": (3, 50.0, 7.0),
    "hover over land": (0, 0.0, 120.0),
}
"""Stick, percent from 1 s to 4 s, and seconds flown."""
MAX_TILTS_DEG = (10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0)


def pitch_step(kind: str, percent: float) -> Flight:
    """Pitch stick for 15 s, then released, in still air."""
    return fly(step(0, percent, ON_S, OFF_S), OFF_S + 8.0, **LOOPS[kind])


def gust(kind: str, percent: float) -> Flight:
    """5 m/s of side wind, all at once, with sticks released or a little pitch stick."""
    return fly(step(0, percent, 0.0, 99.0), 21.0, 5.0, 1.0, **LOOPS[kind])


def manoeuvre(name: str) -> Flight:
    """Heave and yaw sticks, which mean the same to all kinds, and a long hover."""
    index, percent, seconds = MANOEUVRES[name]
    return fly(step(index, percent, 1.0, 4.0), seconds)


def yaw_rate_deg_s(run: Flight) -> Array:
    """(n,)."""
    return np.asarray(np.degrees(np.gradient(np.unwrap(np.radians(run.attitude_deg[:, 2])), run.t_s)))


def cases() -> Sequence[Case]:
    """Steps of the pitch stick, gusts, other manoeuvres, and what full sticks hold against."""
    gusts = [*product(("attitude", "velocity"), (0.0,)), *product(LOOPS, (3.0,))]
    return [
        *({"group": "pitch", "kind": kind, "stick": percent}
          for kind, percent in product(("attitude", "velocity"), (10.0, 50.0, 100.0))),
        *({"group": "gust", "kind": kind, "stick": percent} for kind, percent in gusts),
        *({"group": "manoeuvre", "what": name} for name in MANOEUVRES),
        *({"group": "wind", "tilt": tilt_deg} for tilt_deg in MAX_TILTS_DEG),
    ]  # fmt: skip


def measure(case: Case, _runs: int) -> Row:
    """One manoeuvre."""
    group = case["group"]
    if group == "wind":
        speed_mps = AircraftParameters().airframe.level_speed_mps(math.radians(float(case["tilt"])))
        return {"holds_mps": float(speed_mps)}
    if group == "pitch":
        run = pitch_step(str(case["kind"]), float(case["stick"]))
        t, speed, nose = run.t_s, run.velocity_mps[:, 0], run.attitude_deg[:, 1]
        top = float(speed[(t > OFF_S - 0.5) & (t < OFF_S)].mean())
        return {
            "speed_mps": top,
            "rise_s": first_time(t, speed > 0.63 * top) - ON_S,
            "tilt_deg": -float(nose[t < OFF_S].min()),
            "stop_s": first_time(t, (t > OFF_S) & (speed < 0.1)) - OFF_S,
            "stop_m": float(run.position_m[-1, 0] - run.position_m[np.argmax(t >= OFF_S), 0]),
        }
    if group == "gust":
        run = gust(str(case["kind"]), float(case["stick"]))
        drift_m = run.position_m[:, 1]
        return {
            "drift_m": float(drift_m[-1]),
            "aside_mps": float(run.velocity_mps[-1, 1]),
            "farthest_m": float(np.abs(drift_m).max()),
            "roll_deg": float(run.attitude_deg[-1, 0]),
        }
    name = str(case["what"])
    run = manoeuvre(name)
    if name not in ("yaw 50 %", *(each for each in MANOEUVRES if each.startswith("heave"))):
        return {"measured": f"strays {np.linalg.norm(run.position_m[:, :2], axis=1).max():.2f} m in 120 s"}
    rate, unit = (-run.velocity_mps[:, 2], "m/s") if name.startswith("heave") else (yaw_rate_deg_s(run), "°/s")
    top = float(rate[(run.t_s > 3.0) & (run.t_s < 4.0)].mean())
    return {"measured": f"{top:+.2f} {unit}, 63 % after {first_time(run.t_s, rate / top > 0.63) - 1.0:.2f} s"}


def picture(_rows: Sequence[Row], path: Path) -> None:
    """Speed and attitude after steps; drift in a gust; climb, turn and a hover."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 3, figsize=(11.0, 8.5), layout="constrained")
    for row, kind in enumerate(("attitude", "velocity")):
        for percent in (10.0, 50.0, 100.0):
            run = pitch_step(kind, percent)
            axes[row, 0].plot(run.t_s, run.velocity_mps[:, 0], label=f"{percent:.0f} %")
            axes[row, 1].plot(run.t_s, run.attitude_deg[:, 1])
        axes[row, 0].set(title=f"{kind}: pitch stick from 1 s to 16 s", ylabel="forward speed [m/s]")
        axes[row, 1].set(title=kind, ylabel="pitch attitude [°]")
        axes[row, 0].legend()
    for row, percent in enumerate((0.0, 3.0)):
        for kind in LOOPS:
            run = gust(kind, percent)
            axes[row, 2].plot(run.t_s, run.position_m[:, 1], label=kind)
        axes[row, 2].set(title=f"5 m/s of side wind from 1 s, pitch stick {percent:.0f} %", ylabel="drift [m]")
        axes[row, 2].legend(fontsize="small")
    for name in list(MANOEUVRES)[:2]:
        run = manoeuvre(name)
        axes[2, 0].plot(run.t_s, -run.velocity_mps[:, 2], label=name)
    axes[2, 0].set(title="heave from 1 s to 4 s", xlabel="t [s]", ylabel="climb [m/s]")
    run = manoeuvre("yaw 50 %")
    axes[2, 1].plot(run.t_s, yaw_rate_deg_s(run))
    axes[2, 1].set(title="yaw 50 % from 1 s to 4 s", xlabel="t [s]", ylabel="yaw rate [°/s]")
    run = manoeuvre("hover over land")
    axes[2, 2].plot(run.position_m[:, 1], run.position_m[:, 0])
    axes[2, 2].set(title="hover for 120 s", xlabel="right [m]", ylabel="forward [m]", aspect="equal")
    figure.savefig(path, dpi=70)


STUDY = Study(
    question="How does the simulated aircraft answer sticks and wind?",
    columns={
        "kind": Column("kind"),
        "stick": Column("pitch stick [%]", ".0f"),
        "speed_mps": Column("speed after 15 s [m/s]", ".2f"),
        "rise_s": Column("63 % of it after [s]", ".1f"),
        "tilt_deg": Column("tilt at most [°]", ".1f"),
        "stop_s": Column("released: stops in [s]", ".1f"),
        "stop_m": Column("and [m]", ".1f"),
        "drift_m": Column("drift after 20 s [m]", ".1f"),
        "aside_mps": Column("sideward speed then [m/s]", ".2f"),
        "farthest_m": Column("farthest [m]", ".1f"),
        "roll_deg": Column("roll [°]", ".1f"),
        "what": Column("manoeuvre"),
        "measured": Column("measured"),
        "tilt": Column("MaxTilt [°]", ".0f"),
        "holds_mps": Column("wind in which full stick holds its place [m/s]", ".1f"),
    },
    cases=cases,
    measure=measure,
    runs=1,
    minutes=1,
    picture=picture,
)
