"""Fly the aircraft's step responses and draw them: `python tools/step_responses.py docs/pictures`.

Every manoeuvre goes through `World` as a flight does: sticks in, truth out. The tables printed are the ones that
docs/results/aircraft.md shows.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipland.camera import CameraParameters
from shipland.config import build
from shipland.frames import Array, euler_from_rotation
from shipland.messages import PilotCommand
from shipland.rig import Rig
from shipland.sim.air.wind import ShipPlace, SteadyWind
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.contact.touchdown import VerdictParameters
from shipland.sim.ship.ship import Ship, Still, StillCourse
from shipland.sim.world import StartParameters, World

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLE_S = 0.02
KINDS = ("attitude", "velocity")
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


def pitch_steps(figure: Figure) -> None:
    """Pitch stick for 15 s, then released, in still air."""
    axes = figure.subplots(2, 2, sharex=True)
    print("| kind | pitch stick | speed after 15 s | 63 % of it after | tilt at most | released: stops in | and |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    on_s, off_s = 1.0, 16.0
    for column, kind in enumerate(KINDS):
        for percent in (10.0, 50.0, 100.0):
            run = fly(step(0, percent, on_s, off_s), off_s + 8.0, kind=kind)
            t, speed, nose = run.t_s, run.velocity_mps[:, 0], run.attitude_deg[:, 1]
            top = float(speed[(t > off_s - 0.5) & (t < off_s)].mean())
            rise = first_time(t, speed > 0.63 * top) - on_s
            stop = first_time(t, (t > off_s) & (speed < 0.1)) - off_s
            way = float(run.position_m[-1, 0] - run.position_m[np.argmax(t >= off_s), 0])
            print(
                f"| {kind} | {percent:.0f} % | {top:.2f} m/s | {rise:.1f} s | {-nose[t < off_s].min():.1f}° "
                f"| {stop:.1f} s | {way:.1f} m |"
            )
            axes[0, column].plot(t, speed, label=f"{percent:.0f} %")
            axes[1, column].plot(t, nose)
        axes[0, column].set(title=f"{kind}: pitch stick from 1 s to 16 s", ylabel="forward speed [m/s]")
        axes[1, column].set(xlabel="t [s]", ylabel="pitch attitude [°]")
        axes[0, column].legend()


def gusts(figure: Figure) -> None:
    """5 m/s of side wind, all at once, with sticks released and with a little pitch stick."""
    axes = figure.subplots(2, 2, sharex=True)
    print("\n| kind | sticks | drift after 20 s | sideward speed then | farthest | roll |")
    print("|---|---|---:|---:|---:|---:|")
    trimmed = ("attitude, wind trim 2 s", {"kind": "attitude", "wind_trim_s": 2.0})
    kinds = [*((kind, {"kind": kind}) for kind in KINDS), trimmed]
    for column, percent in enumerate((0.0, 3.0)):
        for name, loop in kinds if percent else kinds[:2]:
            run = fly(step(0, percent, 0.0, 99.0), 21.0, 5.0, 1.0, **loop)
            drift, speed = run.position_m[:, 1], run.velocity_mps[:, 1]
            sticks = f"pitch {percent:.0f} %" if percent else "released"
            print(
                f"| {name} | {sticks} | {drift[-1]:.1f} m | {speed[-1]:.2f} m/s | {np.abs(drift).max():.1f} m "
                f"| {run.attitude_deg[-1, 0]:.1f}° |"
            )
            axes[0, column].plot(run.t_s, speed, label=name)
            axes[1, column].plot(run.t_s, drift, label=name)
        title = f"5 m/s of side wind from 1 s, {f'pitch stick {percent:.0f} %' if percent else 'sticks released'}"
        axes[0, column].set(title=title, ylabel="sideward speed [m/s]")
        axes[1, column].set(xlabel="t [s]", ylabel="drift [m]")
        axes[0, column].legend()


def climb_and_turn(figure: Figure) -> None:
    """Heave and yaw sticks, which mean the same to both kinds, and a long hover."""
    left, middle, right = figure.subplots(1, 3)
    print("\n| manoeuvre | measured |\n|---|---|")
    for percent in (50.0, -50.0):
        run = fly(step(2, percent, 1.0, 4.0), 7.0)
        climb = -run.velocity_mps[:, 2]
        top = float(climb[(run.t_s > 3.0) & (run.t_s < 4.0)].mean())
        rise = first_time(run.t_s, np.abs(climb) > 0.63 * abs(top)) - 1.0
        print(f"| heave {percent:+.0f} % | {top:+.2f} m/s, 63 % after {rise:.1f} s |")
        left.plot(run.t_s, climb, label=f"{percent:+.0f} %")
    left.set(title="heave from 1 s to 4 s", xlabel="t [s]", ylabel="climb [m/s]")
    left.legend()
    run = fly(step(3, 50.0, 1.0, 4.0), 7.0)
    rate = np.degrees(np.gradient(np.unwrap(np.radians(run.attitude_deg[:, 2])), run.t_s))
    top = float(rate[(run.t_s > 3.0) & (run.t_s < 4.0)].mean())
    print(f"| yaw 50 % | {top:.1f} °/s, 63 % after {first_time(run.t_s, rate > 0.63 * top) - 1.0:.2f} s |")
    middle.plot(run.t_s, rate)
    middle.set(title="yaw 50 % from 1 s to 4 s", xlabel="t [s]", ylabel="yaw rate [°/s]")
    run = fly(step(0, 0.0, 0.0, 0.0), 120.0)
    print(f"| hover for 120 s | strays {np.linalg.norm(run.position_m[:, :2], axis=1).max():.2f} m |")
    right.plot(run.position_m[:, 1], run.position_m[:, 0])
    right.set(title="hover for 120 s", xlabel="right [m]", ylabel="forward [m]", aspect="equal")


def main(folder: Path) -> None:
    """Fly, print the tables, write the pictures."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    for draw, name, size in (
        (pitch_steps, "aircraft_steps", (10.0, 5.5)),
        (gusts, "aircraft_gusts", (10.0, 5.5)),
        (climb_and_turn, "aircraft_vertical", (11.0, 3.0)),
    ):
        figure = plt.figure(figsize=size, constrained_layout=True)
        draw(figure)
        figure.savefig(folder / f"{name}.png", dpi=70)
    airframe = AircraftParameters().airframe
    print("\n| MaxTilt | wind in which full stick holds its place |\n|---:|---:|")
    for tilt_deg in (10, 15, 20, 25, 30, 35, 40):
        print(f"| {tilt_deg}° | {airframe.level_speed_mps(math.radians(tilt_deg)):.1f} m/s |")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures"))
