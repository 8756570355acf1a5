"""Walks users' tasks from a wheel, each in an empty environment and an empty folder, and prints what each step took.

    python tools/walks.py                     # every walk; minutes, and pip's downloads
    python tools/walks.py base --wheel W.whl  # one of them, with a wheel that is there already

Nothing is compiled or cached before a walk. A step that fails ends it, and the exit code is then 1. A flight that did
not land in the square (exit code 1) is no failure.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
FLIES = re.compile(r"(?:shipland|make) (?:demo|again|fly)\b")
"""Steps whose exit code 1 says where the aircraft landed."""
IN_WIND = "--scenario steady_wind.toml --pilot paper --bound 0.8"
"""What is trained."""
FILM = """
import av, cv2, numpy as np, shipland, shipland.camera
scenario = shipland.load_scenario("own_cue.toml", time_limit_s=8.0)
with av.open("film.mp4", "w") as film:
    stream = film.add_stream("libx264", rate=30)
    stream.width, stream.height, stream.pix_fmt = 1280, 720, "yuv420p"
    frames = []
    shipland.fly(scenario, vision="rendered", seed=2, on_cycle=lambda row: frames.append(row.frame))
    for frame in frames:
        film.mux(stream.encode(av.VideoFrame.from_ndarray(frame.image, format="bgr24")))
    film.mux(stream.encode())
squares = 255 * (np.indices((7, 10)).sum(0) % 2).astype(np.uint8)
board = np.pad(squares.repeat(50, 0).repeat(50, 1), 25, constant_values=255)
square_on = np.array([[1 / 2000, 0, -0.1375], [0, 1 / 2000, -0.1], [0, 0, 1]])  # 50 px are 25 mm, from the centre
camera, random = shipland.camera.Camera.from_parameters(scenario.camera), np.random.default_rng(1)
for number in range(15):
    turned, _ = cv2.Rodrigues(random.uniform(-0.5, 0.5, 3))
    turned[:, 2] = random.uniform((-0.1, -0.05, 0.4), (0.1, 0.05, 0.6))
    photo = cv2.warpPerspective(board, camera.matrix @ turned @ square_on, (1280, 720), borderValue=120)
    cv2.imwrite(f"board{number:02d}.png", photo)
"""
"""What a flight tester brings: a film of the cue, and pictures of a printed chessboard; here the simulator's."""


@dataclass(frozen=True)
class Walk:
    """One user's task.

    Attributes:
        who: in words.
        installs: what pip gets, `{wheel}` for ours.
        steps: command lines of bash, in the order of the documentation.
        by_hand: what the user does besides.
    """

    who: str
    installs: str
    steps: tuple[str, ...]
    by_hand: str = "nothing"


def as_written(page: str) -> tuple[str, ...]:
    """The steps of a page of the documentation: files whose first line names them, Python, and what is typed."""
    steps, text = [], (ROOT / "docs" / page).read_text(encoding="utf-8")
    for kind, block in re.findall(r"```(\w+)\n(.*?)```", text, re.DOTALL):
        named = re.match(r"# (\S+\.\w+)\n", block)
        if named:
            steps.append(f"cat >{named[1]} <<'END'\n{block}END")
        elif kind == "py":
            steps.append(f"python - <<'END'\n{block}END")
        elif kind == "console":
            steps += re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]
    return tuple(step.strip() for step in steps)


WALKS = {
    "base": Walk(
        "the wheel without extras",
        "{wheel}",
        (
            "shipland version && shipland scenarios >/dev/null && shipland doctor",
            f"shipland example own_pilot.py && cmp own_pilot.py {ROOT}/examples/own_pilot.py",
            "shipland fly --vision geometric --no-video --out out",
            "test -s out/flight.mcap -a -s out/summary.json -a -s out/timing.json",
        ),
    ),
    "demo": Walk("README's first screen", "{wheel}", ("shipland demo", "test -s out/demo/flight.mp4")),
    "clone": Walk("README's first screen, in a clone", "", (f"git clone -q {ROOT} clone", "cd clone && make demo")),
    "notebook": Walk(
        "a first flight in a notebook",
        "{wheel}[full] nbclient ipykernel",
        ("shipland example first_flight.ipynb", "jupyter execute --timeout=600 first_flight.ipynb"),
        "open it in Jupyter",
    ),
    "researcher": Walk(
        "a researcher who compares pilots in a notebook",
        "{wheel}[full] nbclient ipykernel",
        ("shipland example compare_pilots.ipynb", "jupyter execute --timeout=600 compare_pilots.ipynb"),
        "open it in Jupyter; name the own pilot",
    ),
    "engineer": Walk(
        "an engineer with campaigns",
        "{wheel}[full] pandas pyarrow",
        (
            "shipland example own_pilot.py",
            "shipland campaign --pilot horizon,own_pilot:patient --set wind.mean_mps=0,4 --runs 10 --out out/sweep",
            "shipland compare out/sweep/near_mean_mps=4_horizon out/sweep/near_mean_mps=4_own_pilot.patient",
            "shipland report out/sweep",
            "shipland dataset out/sweep --licence CC-BY-4.0 --out out/data",
            "python -c \"import pandas; print(pandas.read_csv('out/sweep/flights.csv').dtypes.value_counts())\"",
            "shipland again out/sweep/near_mean_mps=4_horizon --seed 3",
        ),
        "write the pilot",
    ),
    "own": Walk(
        "a researcher with a rival, a ship and a deck motion of their own",
        "{wheel}[plots]",
        as_written("how-to/add-your-own.md"),
        "write them; here those of the page",
    ),
    "tester": Walk(
        "a flight tester with a film and an own cue",
        "{wheel}[full]",
        (
            "shipland example own_cue.toml && shipland print-cue own_cue.toml --paper A3 --out cue.pdf",
            "shipland print-cue --board 9x6 --square-m 0.025 --out board.pdf",
            f"python - <<'END'\n{FILM}END",
            "shipland calibrate board*.png --board 9x6 --square-m 0.025 --out camera.yaml",
            "shipland see film.mp4 --cue own_cue.toml --calibration camera.yaml --csv poses.csv --out drawn >/dev/null",
            "shipland replay film.mp4 --scenario own_cue.toml --calibration camera.yaml --pilot horizon",
        ),
        "print, measure and hang the cue; film it, and photograph the board (here the simulator draws both)",
    ),
    "ros2": Walk(
        "a ROS 2 user",
        "{wheel}[ros2]",
        (
            "shipland example ros2-simulated.toml",
            "(shipland serve-physics --interface ros2 --seed 3 --set aircraft.loop.kind=velocity & served=$!; "
            "shipland fly --vehicle 'ros2://drone?take=1&camera=frames:127.0.0.1:9003' --vision geometric --no-video "
            "--vehicle-config ros2-simulated.toml --out out; flown=$?; wait $served; exit $flown)",
            "shipland bag out/flight.mcap --out bag",
        ),
        "tell and take the topics of the own drone",
    ),
    "rl": Walk(
        "a user who trains",
        "{wheel}[learn]",
        (
            "shipland example train_sb3.py",
            "shipland example steady_wind.toml",
            f"python train_sb3.py --algorithm ppo {IN_WIND} --steps 8000 --out out/ppo",
            f"python train_sb3.py --algorithm sac {IN_WIND} --steps 2000 --out out/sac",
        ),
        "wait for as many steps as it takes to learn",
    ),
}


def timed(line: str, folder: Path, environment: dict[str, str]) -> tuple[float, float, int]:
    """How long a line took [s], its processor time [s], and its exit code."""
    begun_s, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    code = subprocess.run(["bash", "-euo", "pipefail", "-c", line], cwd=folder, env=environment, check=False).returncode
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    worked_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.monotonic() - begun_s, worked_s, code


def walk(task: Walk, wheel: Path) -> bool:
    """Whether every step went well; each is printed as it ends. The first two are the environment and pip."""
    installs = " ".join(f"'{name}'" for name in task.installs.format(wheel=wheel).split())
    with tempfile.TemporaryDirectory() as where:
        folder = Path(where) / "empty"
        folder.mkdir()
        environment = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "VIRTUAL_ENV"}}
        environment |= {"HOME": where, "PATH": f"{where}/venv/bin:{environment['PATH']}"}
        environment |= {"XDG_CACHE_HOME": f"{where}/cache", "ROS_LOCALHOST_ONLY": "1", "ROS_DOMAIN_ID": "97"}
        made = (f"{sys.executable} -m venv {where}/venv", f"pip install -q --prefer-binary {installs}")
        spent_s, well = 0.0, True
        for line in (*(made if installs else ()), *task.steps):
            took_s, worked_s, code = timed(line, folder, environment)
            said = line.replace(str(wheel), "shipland").replace(sys.executable, "python").replace(f"{where}/", "")
            said = "(the film and the pictures of the board)" if FILM in line else said
            print(f"{took_s:6.0f} s, processor {worked_s:4.0f} s, exit code {code}: {said}", flush=True)
            spent_s, well = spent_s + took_s, code == 0 or (code == 1 and FLIES.search(line) is not None)
            if not well:
                break
        size_mb = int(subprocess.check_output(["du", "-sm", where]).split()[0])
    print(f"{spent_s:6.0f} s in all, {size_mb} MB on disk; load {os.getloadavg()[1]:.1f}", flush=True)
    return well


def main() -> int:
    """Walk those named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="WALK", help=f"of {', '.join(WALKS)}; all when left out")
    parser.add_argument("--wheel", type=Path, help="built where none is given")
    options = parser.parse_args()
    if unknown := set(options.names) - set(WALKS):
        parser.error(f"no walk {', '.join(sorted(unknown))}: expected {', '.join(WALKS)}")
    failed = False
    with tempfile.TemporaryDirectory() as where:
        wheel = options.wheel
        if wheel is None:
            subprocess.run([sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", where, ROOT], check=True)
            wheel = next(Path(where).glob("shipland-*.whl"))
        for name in options.names or WALKS:
            task = WALKS[name]
            print(f"\n{task.who} (pip install {task.installs.format(wheel='shipland')})", flush=True)
            failed |= not walk(task, wheel.resolve())
            print(f"by hand: {task.by_hand}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
