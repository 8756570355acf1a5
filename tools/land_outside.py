"""Land a flight controller that we did not write in our world: physics, autopilot and `shipland fly`, seed after seed.

With `SHIPLAND_ARDUCOPTER` naming an ArduCopter binary it flies that; with `--autopilot px4` and `SHIPLAND_PX4` naming
the binary of a PX4 built for its simulator (`…/build/px4_sitl_default/bin/px4`) that; `--autopilot stand-in` flies the
small one of the conformance tests. Everything runs on loopback, in real time unless `--speed` says otherwise; how late
telemetry and pictures were stands beside each landing.

    SHIPLAND_ARDUCOPTER=~/arducopter python tools/land_outside.py --scenario rig-natops --seeds 20 \
        --defaults copter.parm --out out/outside
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from shipland.calibration_file import write_calibration
from shipland.camera import Camera
from shipland.errors import DataError
from shipland.record.reader import FlightLog, read_log
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.statistics import share_interval

ROOT = Path(__file__).parents[1]
SHIPLAND = (sys.executable, "-c", "from shipland.cli import main; main()")


HANDED_OVER = "in command: the autopilot"
"""In the reason of the cycle in which the autopilot's own landing begins."""
HOME = "60.0,4.0,0,0"
"""Latitude, longitude, height, heading: at sea level, where a ship is."""


@dataclass(frozen=True)
class Arguments:
    """What is flown, and by what.

    Attributes:
        scenario, pilot, vision: as `shipland fly` takes them.
        seeds: how many.
        first: of them.
        autopilot: whose binary is flown.
        defaults: files of parameters.
        vehicle_config: examples/arducopter.toml or px4.toml unless given.
        set: section.key=value; may be given several times.
        own_landing: once the pilot would land, the autopilot does: its LAND mode with precision landing, on the
            LANDING_TARGET that it is told, with examples/precision-landing.parm and the pictures' latency as PLND_LAG.
        climb_m, takeoff_m: as the vehicle's.
        boot_s: for the autopilot to find itself.
        limit_s: of a flight.
        instance: of the ports, for another set beside this one.
        speed: of real time.
        most_behind_s: a flight whose world fell behind the clock by more is shown and not counted.
        video: whether one is drawn.
        out: folder.
    """

    scenario: str = "rig-natops"
    seeds: int = 20
    first: int = 1
    pilot: str = "horizon"
    vision: str = "geometric"
    autopilot: Literal["arducopter", "px4", "stand-in"] = "arducopter"
    defaults: tuple[Path, ...] = ()
    vehicle_config: Path | None = None
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    own_landing: bool = False
    climb_m: float = 0.9
    takeoff_m: float = 0.9
    boot_s: float = 30.0
    limit_s: float = 180.0
    instance: int = 0
    speed: float = 1.0
    most_behind_s: float = math.inf
    video: bool = False
    out: Path = Path("out/outside")


class Ports:
    """Of one set of processes; ArduPilot adds ten times its instance to each of its own."""

    def __init__(self, instance: int) -> None:
        self.physics, self.frames = 9002 + 10 * instance, 9003 + 10 * instance
        self.arducopter, self.stand_in = 5760 + 10 * instance, 14550 + 10 * instance
        self.px4_physics, self.px4 = 4560 + instance, 14540 + instance


def px4_environment() -> dict[str, str]:
    """PX4's airframe and parameters, which its start script takes from there."""
    rows = [line.split() for line in (ROOT / "examples" / "px4.parm").read_text().splitlines() if line[:1] not in "#"]
    return os.environ | {"PX4_SIM_MODEL": "none_iris"} | {f"PX4_PARAM_{name}": value for name, value in rows}


def px4(arguments: Arguments, folder: Path) -> list[str]:
    """PX4's command; its parameters begin anew."""
    binary = os.environ.get("SHIPLAND_PX4")
    if not binary:
        raise SystemExit("SHIPLAND_PX4 must name the binary of a PX4 built for its simulator")
    place = Path(binary).resolve()
    for old in ("parameters.bson", "parameters_backup.bson", "dataman"):
        (folder / old).unlink(missing_ok=True)
    command = [str(place), "-d", "-i", str(arguments.instance), "-s", "etc/init.d-posix/rcS"]
    return [*command, "-w", str(folder.resolve()), str(place.parents[1] / "etc")]


def our_environment(speed: float) -> dict[str, str]:
    """Of our own processes; slower than real time they take the slow clock."""
    if speed >= 1.0:
        return dict(os.environ)
    path = os.pathsep.join([str(ROOT / "tools" / "slow_clock"), *filter(None, [os.environ.get("PYTHONPATH")])])
    return os.environ | {"PYTHONPATH": path, "SHIPLAND_CLOCK_SPEED": str(speed)}


def autopilot(arguments: Arguments, folder: Path, ports: Ports) -> tuple[list[str], str]:
    """Its command, and the address under which it is flown."""
    if arguments.autopilot == "px4":
        return px4(arguments, folder), f"udp:127.0.0.1:{ports.px4}"
    if arguments.autopilot == "stand-in":
        script = ROOT / "tests" / "conformance" / "standin_physics.py"
        command = [sys.executable, str(script), str(ports.stand_in), str(ports.physics)]
        return command, f"udp:127.0.0.1:{ports.stand_in}"
    binary = os.environ.get("SHIPLAND_ARDUCOPTER")
    if not binary:
        raise SystemExit("SHIPLAND_ARDUCOPTER must name an ArduCopter binary built for its simulator")
    files = [*arguments.defaults, ROOT / "examples" / "arducopter.parm"]
    files += own_landing_parameters(arguments, folder) if arguments.own_landing else []
    defaults = ",".join(str(path.resolve()) for path in files)
    (folder / "eeprom.bin").unlink(missing_ok=True)
    command = [str(Path(binary).resolve()), "--model", "JSON:127.0.0.1", "--defaults", defaults]
    command += ["--speedup", f"{arguments.speed:g}"]
    command += ["--home", HOME]
    # without `tcp:0` it waits for somebody on its port before it boots
    command += ["--wipe", "-I", str(arguments.instance), "--serial0", "tcp:0"]
    return command, f"tcp:127.0.0.1:{ports.arducopter}"


def own_landing_parameters(arguments: Arguments, folder: Path) -> list[Path]:
    """What ArduCopter's precision landing needs; the pictures' latency counts as far as ArduCopter takes it."""
    lag = folder / "lag.parm"
    delays = load_scenario(scenario_table(arguments.scenario, None, arguments.set)).delays
    lag.write_text(f"PLND_LAG {delays.video_s:g}\n")
    return [ROOT / "examples" / "precision-landing.parm", lag]


def lateness(log: FlightLog) -> dict[str, float]:
    """How old attitude and picture were at a decision, the longest time without a picture, the world's lag [s]."""
    attitude_s = [row.telemetry.t_s - row.telemetry.attitude_t_s for row in log.records if row.telemetry.attitude_t_s]
    exposed_s = np.unique([row.frame.t_s for row in log.records])
    picture_s = [row.telemetry.t_s - row.frame.t_s for row in log.records]
    behind_s = [row.frame.t_s - row.truth.t_s for row in log.records if row.truth is not None]
    if len(exposed_s) < 2 or not attitude_s or not behind_s:
        return {}
    return {
        "attitude_age_median_s": round(float(np.median(attitude_s)), 4),
        "attitude_age_99_s": round(float(np.quantile(attitude_s, 0.99)), 4),
        "attitude_age_most_s": round(float(np.max(attitude_s)), 4),
        "picture_age_median_s": round(float(np.median(picture_s)), 4),
        "picture_age_99_s": round(float(np.quantile(picture_s, 0.99)), 4),
        "picture_gap_most_s": round(float(np.diff(exposed_s).max()), 4),
        "world_fell_behind_s": round(behind_s[-1] - min(behind_s), 4),
    }


def ending(log: FlightLog) -> str:
    """Where the aircraft was at the end of a flight without a verdict."""
    truths = [row.truth for row in log.records if row.truth is not None]
    if not truths:
        return "no flight"
    forward_m, starboard_m, down_m = truths[-1].aircraft_in_deck_m.tolist()
    off_m = math.hypot(forward_m, starboard_m)
    return f"no verdict: {-down_m:.2f} m over the deck at the end, {off_m:.2f} m from its centre"


def outcome(folder: Path, seed: int) -> dict[str, object]:
    """What became of a flight, from what its processes left."""
    said = (folder / "physics.txt").read_text().strip().splitlines() or ["no physics"]
    row: dict[str, object] = {"seed": seed, "success": said[-1].startswith("landed in the square")}
    row |= {"reason": said[-1], "pace": next((line for line in said if "of flight took" in line), "")}
    row["rest"] = next((line for line in said if line.startswith("motors at rest")), "")
    fly = (folder / "fly.txt").read_text().strip().splitlines() if (folder / "fly.txt").exists() else []
    row["fly"] = fly[-1] if fly else ""
    try:
        log = read_log(folder / "flight.mcap")
    except DataError:
        return row
    handed = [row.truth.t_s for row in log.records if row.truth is not None and HANDED_OVER in row.decision.reason]
    if log.verdict is None and said[-1] in (row["pace"], row["rest"]):
        row["reason"] = ending(log)
    elif log.verdict is not None:  # the physics may have ended before its last word
        row |= {"success": log.verdict.success, "reason": log.verdict.reason}
    if log.verdict is not None and log.verdict.touched:
        row |= {"own_landing_s": round(log.verdict.t_s - handed[0], 1)} if handed else {}
        row["off_m"] = round(float(np.hypot(*log.verdict.touchdown_in_deck_m)), 3)
        row["sink_mps"] = round(float(log.verdict.relative_velocity_in_deck_mps[2]), 3)
        row["at_s"] = round(log.verdict.t_s, 1)
    return row | lateness(log)


def land(arguments: Arguments, seed: int) -> dict[str, object]:
    """One flight; what became of it."""
    folder, ports = arguments.out / f"{arguments.scenario}-{seed}", Ports(arguments.instance)
    folder.mkdir(parents=True, exist_ok=True)
    for old in ("flight.mcap", "fly.txt"):
        (folder / old).unlink(missing_ok=True)
    scenario = load_scenario(arguments.scenario)
    calibration = folder / "camera.yaml"
    write_calibration(Camera.from_parameters(scenario.camera), calibration)
    changes = [word for change in arguments.set for word in ("--set", change)]
    common = ["--scenario", arguments.scenario, "--seed", str(seed), *changes]
    is_px4 = arguments.autopilot == "px4"
    served = ["--interface", "px4" if is_px4 else "json"]
    served += ["--port", str(ports.px4_physics if is_px4 else ports.physics)]
    served += ["--frames-port", str(ports.frames), "--climb-m", str(arguments.climb_m)]
    served += ["--pictures"] if arguments.vision == "rendered" else []
    command, place = autopilot(arguments, folder, ports)
    address = f"mavlink://{place}?camera=frames:127.0.0.1:{ports.frames}&takeoff={arguments.takeoff_m}"
    address += "&own_landing=1" if arguments.own_landing else ""
    fly = ["fly", *common, "--vehicle", address, "--calibration", str(calibration), "--vision", arguments.vision]
    fly += ["--pilot", arguments.pilot, "--out", str(folder), *(() if arguments.video else ("--no-video",))]
    config = arguments.vehicle_config
    if config is None and arguments.autopilot != "stand-in":
        config = ROOT / "examples" / f"{arguments.autopilot}.toml"
    fly += [] if config is None else ["--vehicle-config", str(config)]
    ours, running = our_environment(arguments.speed), list[subprocess.Popen[bytes]]()
    with (folder / "physics.txt").open("w") as physics_log, (folder / "autopilot.txt").open("w") as autopilot_log:
        try:
            physics = subprocess.Popen(
                [*SHIPLAND, "serve-physics", *common, *served], stdout=physics_log, stderr=subprocess.STDOUT, env=ours
            )
            running.append(physics)
            time.sleep(4.0 / arguments.speed)
            flown = subprocess.Popen(
                command, cwd=folder, stdin=subprocess.PIPE, stdout=autopilot_log, stderr=subprocess.STDOUT,
                env=px4_environment() if is_px4 else None,
            )  # fmt: skip
            running.append(flown)
            time.sleep(arguments.boot_s / arguments.speed)
            with (folder / "fly.txt").open("w") as fly_log:
                subprocess.run(
                    [*SHIPLAND, *fly], stdout=fly_log, stderr=subprocess.STDOUT, check=False, env=ours,
                    timeout=arguments.limit_s / arguments.speed,
                )  # fmt: skip
            physics.wait(10.0 / arguments.speed)
        except subprocess.TimeoutExpired:
            pass
        finally:
            for process in reversed(running):
                process.kill()
                process.wait()
    return outcome(folder, seed)


def main(arguments: Arguments) -> None:
    """Fly the seeds and print the table."""
    if arguments.speed < 1.0 and arguments.autopilot == "stand-in":
        sys.exit("--speed below 1 needs an autopilot that takes its clock from the physics")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # subprocess.run then ends its own, `land` the others
    results = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        results.append(land(arguments, seed))
        row = results[-1]
        late = f"behind {row.get('world_fell_behind_s')} s, attitude's age {row.get('attitude_age_99_s')} s"
        late += f"; {row['rest']}" if row["rest"] else ""
        print(f"{seed:4d}  {row['reason']}  [{row['pace']}; {late}]", flush=True)
        (arguments.out / f"{arguments.scenario}.json").write_text(json.dumps(results, indent=1))
    counted = [row for row in results if row.get("world_fell_behind_s", math.inf) <= arguments.most_behind_s]
    good = sum(bool(row["success"]) for row in counted)
    low, high = share_interval(good, len(counted))
    print(
        f"{good} of {len(counted)} in the square, 95 %: {low:.2f} to {high:.2f} "
        f"({arguments.scenario}, {arguments.pilot}, {arguments.vision}); {len(results) - len(counted)} not counted"
    )


if __name__ == "__main__":
    main(tyro.cli(Arguments, description="Land a flight controller that we did not write in our world."))
