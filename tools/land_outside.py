"""Land a flight controller that we did not write in our world: physics, autopilot and `shipland fly`, seed after seed.

With `SHIPLAND_ARDUCOPTER` naming an ArduCopter binary it flies that; `--autopilot stand-in` flies the small one of the
conformance tests. Everything runs in real time on loopback.

    SHIPLAND_ARDUCOPTER=~/arducopter python tools/land_outside.py --scenario rig-natops --seeds 20 \
        --defaults copter.parm --out out/outside
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

from shipland.camera import Camera
from shipland.missions.scenarios import load_scenario

ROOT = Path(__file__).parents[1]
PHYSICS_PORT, FRAMES_PORT, STAND_IN_PORT = 9002, 9003, 14550
SHIPLAND = (sys.executable, "-c", "from shipland.cli import main; main()")


def autopilot(arguments: argparse.Namespace, folder: Path) -> tuple[list[str], str]:
    """Its command, and the address under which it is flown."""
    if arguments.autopilot == "stand-in":
        script = ROOT / "tests" / "conformance" / "standin_physics.py"
        return [sys.executable, str(script), str(STAND_IN_PORT), str(PHYSICS_PORT)], f"udp:127.0.0.1:{STAND_IN_PORT}"
    binary = os.environ.get("SHIPLAND_ARDUCOPTER")
    if not binary:
        raise SystemExit("SHIPLAND_ARDUCOPTER must name an ArduCopter binary built for its simulator")
    defaults = ",".join(str(path.resolve()) for path in (*arguments.defaults, ROOT / "examples" / "arducopter.parm"))
    (folder / "eeprom.bin").unlink(missing_ok=True)
    command = [str(Path(binary).resolve()), "--model", "JSON:127.0.0.1", "--speedup", "1", "--defaults", defaults]
    return [*command, "--wipe"], "tcp:127.0.0.1:5760"


def land(arguments: argparse.Namespace, seed: int) -> dict[str, object]:
    """One flight; what became of it."""
    folder = arguments.out / f"{arguments.scenario}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    scenario = load_scenario(arguments.scenario)
    calibration = folder / "camera.yaml"
    Camera.from_parameters(scenario.camera).to_opencv_yaml(calibration)
    changes = [word for change in arguments.set for word in ("--set", change)]
    common = ["--scenario", arguments.scenario, "--seed", str(seed), *changes]
    pictures = ["--pictures"] if arguments.vision == "rendered" else []
    command, place = autopilot(arguments, folder)
    address = f"mavlink://{place}?camera=frames:127.0.0.1:{FRAMES_PORT}&takeoff={arguments.takeoff_m}"
    fly = ["fly", *common, "--vehicle", address, "--calibration", str(calibration), "--vision", arguments.vision]
    fly += ["--pilot", arguments.pilot, "--out", str(folder), "--video" if arguments.video else "--no-video"]
    with (folder / "physics.txt").open("w") as physics_log, (folder / "autopilot.txt").open("w") as autopilot_log:
        physics = subprocess.Popen(
            [*SHIPLAND, "serve-physics", *common, "--climb-m", str(arguments.climb_m), *pictures],
            stdout=physics_log, stderr=subprocess.STDOUT,
        )  # fmt: skip
        time.sleep(4.0)
        flown = subprocess.Popen(
            command, cwd=folder, stdin=subprocess.PIPE, stdout=autopilot_log, stderr=subprocess.STDOUT
        )
        try:
            time.sleep(arguments.boot_s)
            with (folder / "fly.txt").open("w") as fly_log:
                subprocess.run(
                    [*SHIPLAND, *fly], stdout=fly_log, stderr=subprocess.STDOUT, timeout=arguments.limit_s, check=False
                )
            physics.wait(10.0)
        except subprocess.TimeoutExpired:
            pass
        finally:
            for process in (flown, physics):
                process.kill()
                process.wait()
    said = (folder / "physics.txt").read_text().strip().splitlines()
    reason = said[-1] if said else "no physics"
    return {"seed": seed, "in_square": reason.startswith("landed in the square"), "reason": reason}


def main() -> None:
    """Fly the seeds and print the table."""
    parser = argparse.ArgumentParser(description="Land a flight controller that we did not write in our world.")
    parser.add_argument("--scenario", default="rig-natops")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--pilot", default="horizon")
    parser.add_argument("--vision", default="geometric")
    parser.add_argument("--autopilot", choices=("arducopter", "stand-in"), default="arducopter")
    parser.add_argument("--defaults", type=Path, nargs="*", default=[])
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--climb-m", type=float, default=0.9)
    parser.add_argument("--takeoff-m", type=float, default=0.9)
    parser.add_argument("--boot-s", type=float, default=30.0, help="for the autopilot to find itself")
    parser.add_argument("--limit-s", type=float, default=180.0)
    parser.add_argument("--video", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out/outside"))
    arguments = parser.parse_args()
    results = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        results.append(land(arguments, seed))
        print(f"{seed:4d}  {results[-1]['reason']}", flush=True)
    good = sum(bool(result["in_square"]) for result in results)
    print(f"{good} of {len(results)} in the square ({arguments.scenario}, {arguments.pilot}, {arguments.vision})")
    (arguments.out / f"{arguments.scenario}.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
