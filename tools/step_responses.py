"""Fly the aircraft's step responses and draw them: `python tools/step_responses.py docs/pictures`.

Every manoeuvre goes through `World` as a flight does: sticks in, truth out. The figures printed are the ones that
docs/aircraft.md quotes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shipland.camera import CameraParameters
from shipland.config import build, merge
from shipland.frames import Array, euler_from_rotation
from shipland.messages import PilotCommand
from shipland.rig import default_rig, packaged_table
from shipland.sim.air.wind import SteadyWind
from shipland.sim.aircraft.parameters import AircraftParameters
from shipland.sim.contact.touchdown import VerdictParameters
from shipland.sim.ship.ship import Ship, Still, StillCourse
from shipland.sim.world import StartParameters, World

SAMPLE_S = 0.02
Stick = Callable[[float], tuple[float, float, float, float]]


@dataclass(frozen=True)
class Flight:
    """Histories (n,) of one manoeuvre; positions relative to the start, in a frame with the first heading forward."""

    t_s: Array
    position_m: Array
    velocity_mps: Array
    attitude_deg: Array


def fly(
    stick: Stick, seconds: float, wind_mps: tuple[float, float, float] = (0.0, 0.0, 0.0), gust_s: float = 0.0
) -> Flight:
    """Fly `stick(t)` (pitch, roll, heave, yaw percent) far from the ship, in `wind_mps` that sets in at `gust_s`."""
    rig = default_rig()
    start = merge(
        packaged_table("start"),
        {
            "distance_m": 500.0,
            "height_m": 50.0,
            "distance_spread_m": 0.0,
            "bearing_spread_deg": 0.0,
            "height_spread_m": 0.0,
            "heading_error_spread_deg": 0.0,
        },
    )
    world = World(
        rig,
        build(CameraParameters, packaged_table("camera"), "camera"),
        build(AircraftParameters, packaged_table("aircraft"), "aircraft"),
        build(VerdictParameters, packaged_table("verdict"), "verdict"),
        Ship(rig, StillCourse(), Still()),
        _Gust(np.array(wind_mps), gust_s),
        build(StartParameters, start, "start"),
        np.random.default_rng(7),
    )
    begin = world.truth().ned_from_body.translation_m
    rows = []
    for index in range(round(seconds / SAMPLE_S) + 1):
        t_s = index * SAMPLE_S
        world.advance(t_s)
        truth = world.truth()
        roll, pitch, yaw = euler_from_rotation(truth.ned_from_body.rotation)
        rows.append(
            [
                t_s,
                *(truth.ned_from_body.translation_m - begin),
                *truth.velocity_in_ned_mps,
                *np.degrees([roll, pitch, yaw]),
            ]
        )
        world.command(PilotCommand(t_s, *stick(t_s), 0.0))
    table = np.array(rows)
    return Flight(table[:, 0], table[:, 1:4], table[:, 4:7], table[:, 7:10])


class _Gust(SteadyWind):
    def __init__(self, velocity_in_ned_mps: Array, start_s: float) -> None:
        super().__init__(velocity_in_ned_mps)
        self._start_s = start_s

    def velocity_at(self, t_s: float, position_in_ned_m: Array, ned_from_ship: object) -> Array:
        full = super().velocity_at(t_s, position_in_ned_m, ned_from_ship)  # type: ignore[arg-type]
        return full if t_s >= self._start_s else 0.0 * full


def first_time(t_s: Array, reached: Array) -> float:
    """First time at which `reached` holds, NaN if never."""
    return float(t_s[np.argmax(reached)]) if reached.any() else float("nan")


def step(index: int, percent: float, on_s: float, off_s: float) -> Stick:
    """One stick at `percent` between two times."""

    def stick(t_s: float) -> tuple[float, float, float, float]:
        values = [0.0, 0.0, 0.0, 0.0]
        if on_s <= t_s < off_s:
            values[index] = percent
        return values[0], values[1], values[2], values[3]

    return stick


def main(folder: Path) -> None:
    """Fly, print the figures, write the pictures."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(3, 3, figsize=(11.0, 7.5), constrained_layout=True)

    for percent, until in ((20.0, 11.0), (100.0, 16.0)):
        run = fly(step(0, percent, 1.0, until), until + 7.0)
        speed, t = run.velocity_mps[:, 0], run.t_s
        top = float(speed[(t > until - 0.5) & (t < until)].mean())
        rise = first_time(t, speed > 0.63 * top) - 1.0
        stop = first_time(t, (t > until) & (speed < 0.1)) - until
        way = float(run.position_m[-1, 0] - run.position_m[np.argmax(t >= until), 0])
        over = float(-speed[t > until].min())
        print(
            f"pitch {percent:3.0f} %: {top:.2f} m/s, 63 % after {rise:.2f} s, "
            f"nose {run.attitude_deg[:, 1].min():.1f}°; released: stops in {stop:.2f} s and {way:.2f} m, "
            f"nose {run.attitude_deg[:, 1].max():.1f}°, back at {over:.2f} m/s"
        )
        column = 0 if percent == 20.0 else 1
        axes[0, column].plot(t, speed)
        axes[1, column].plot(t, run.attitude_deg[:, 1])
        axes[2, column].plot(t, run.position_m[:, 0])
        axes[0, column].set_title(f"pitch {percent:.0f} % from 1 s to {until:.0f} s")
    axes[0, 0].set_ylabel("forward speed [m/s]")
    axes[1, 0].set_ylabel("pitch attitude [°]")
    axes[2, 0].set_ylabel("forward way [m]")

    for wind in (5.0, 9.0, 14.0):
        run = fly(step(0, 0.0, 0.0, 0.0), 21.0, (0.0, wind, 0.0), 1.0)
        drift = run.position_m[:, 1]
        away_s = run.t_s[np.abs(drift) > 0.2].max() - 1.0
        print(
            f"{wind:.0f} m/s of wind: drifts {drift.max():.2f} m, within 0.2 m after {away_s:.1f} s, "
            f"roll {run.attitude_deg[-1, 0]:.1f}°, height {np.abs(run.position_m[:, 2]).max():.2f} m"
        )
        axes[0, 2].plot(run.t_s, run.velocity_mps[:, 1], label=f"{wind:.0f} m/s")
        axes[1, 2].plot(run.t_s, run.attitude_deg[:, 0])
        axes[2, 2].plot(run.t_s, drift)
    axes[0, 2].legend()
    axes[0, 2].set(title="side wind from 1 s, sticks centred", ylabel="sideward speed [m/s]")
    axes[1, 2].set_ylabel("roll attitude [°]")
    axes[2, 2].set_ylabel("drift [m]")
    for axis in axes[2]:
        axis.set_xlabel("t [s]")
    figure.savefig(folder / "aircraft_horizontal.png", dpi=70)

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11.0, 3.0), constrained_layout=True)
    for percent in (50.0, -50.0):
        run = fly(step(2, percent, 1.0, 4.0), 7.0)
        climb = -run.velocity_mps[:, 2]
        top = float(climb[(run.t_s > 3.0) & (run.t_s < 4.0)].mean())
        rise = first_time(run.t_s, np.abs(climb) > 0.63 * abs(top)) - 1.0
        after = climb[run.t_s > 5.5]
        print(f"heave {percent:+.0f} %: {top:+.3f} m/s, 63 % after {rise:.2f} s; released: {after.mean():+.3f} m/s")
        left.plot(run.t_s, climb, label=f"{percent:+.0f} %")
    left.set(title="heave from 1 s to 4 s", xlabel="t [s]", ylabel="climb [m/s]")
    left.legend()
    run = fly(step(3, 50.0, 1.0, 4.0), 7.0)
    rate = np.gradient(np.unwrap(np.radians(run.attitude_deg[:, 2])), run.t_s)
    top = float(np.degrees(rate[(run.t_s > 3.0) & (run.t_s < 4.0)].mean()))
    rise = first_time(run.t_s, np.degrees(rate) > 0.63 * top) - 1.0
    print(f"yaw 50 %: {top:.1f} °/s, 63 % after {rise:.2f} s; turned {run.attitude_deg[-1, 2]:.1f}°")
    middle.plot(run.t_s, np.degrees(rate))
    middle.set(title="yaw 50 % from 1 s to 4 s", xlabel="t [s]", ylabel="yaw rate [°/s]")
    run = fly(step(0, 0.0, 0.0, 0.0), 120.0)
    print(f"hover for 120 s: strays {np.linalg.norm(run.position_m[:, :2], axis=1).max():.2f} m")
    right.plot(run.position_m[:, 1], run.position_m[:, 0])
    right.set(title="hover for 120 s", xlabel="right [m]", ylabel="forward [m]", aspect="equal")
    figure.savefig(folder / "aircraft_vertical.png", dpi=70)

    print("steady speed over stick:")
    for percent in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0):
        run = fly(step(0, percent, 0.0, 99.0), 20.0)
        print(f"  {percent:4.1f} %: {run.velocity_mps[run.t_s > 15.0, 0].mean():.3f} m/s")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures"))
