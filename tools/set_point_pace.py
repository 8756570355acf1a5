"""How late set-points leave, with every core busy: 50 Hz beside the near vision and a process that loads each core.

python tools/set_point_pace.py --seconds 30
"""

from __future__ import annotations

import multiprocessing
import threading
import time
from typing import Literal

import numpy as np
import tyro

from shipland.camera import Camera
from shipland.messages import Frame, GimbalAttitude
from shipland.scenario.scenario import load_scenario
from shipland.vehicles.pace import Pace
from shipland.vision.near.pipeline import NearVision


def burn() -> None:
    """Keep a core busy."""
    while True:
        sum(range(10_000))


def see(stop: threading.Event) -> None:
    """Near vision on noise, in the process of the set-points."""
    scenario = load_scenario("near")
    camera = Camera.from_parameters(scenario.camera)
    vision = NearVision(scenario.rig.cue, camera, scenario.vision)
    image = np.random.default_rng(1).integers(0, 255, (camera.height_px, camera.width_px, 3), np.uint8)
    index = 0
    while not stop.is_set():
        vision.see(Frame(index / 30.0, image, GimbalAttitude(0.0, 0.0)))
        index += 1


def main(seconds: float = 30.0, first: Literal["thread", "process"] = "thread") -> None:
    """Measure and print; `first` goes before other processes."""
    burners = [multiprocessing.Process(target=burn, daemon=True) for _ in range(multiprocessing.cpu_count())]
    for burner in burners:
        burner.start()
    stop = threading.Event()
    vision = threading.Thread(target=see, args=(stop,), daemon=True)
    vision.start()
    pace = Pace(lambda _: None, 50.0, "set-points", first)
    pace.start()
    time.sleep(seconds)
    pace.stop()
    stop.set()
    vision.join()
    for burner in burners:
        burner.kill()
    late_ms = 1e3 * np.array(pace.late_s)
    within = float(np.mean(late_ms <= 10.0))
    print(
        f"{len(late_ms)} set-points: {np.median(late_ms):.2f} ms late, 99 % {np.quantile(late_ms, 0.99):.2f} ms, "
        f"most {late_ms.max():.1f} ms; {100 * within:.2f} % within 10 ms"
    )
    raise SystemExit(0 if within >= 0.99 else 1)


if __name__ == "__main__":
    tyro.cli(main)
