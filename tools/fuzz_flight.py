"""Hostile flights: what comes from vehicle and vision, what a user's pilot gives back, and signals.

The loop, the pilots and the safety are the ones that fly; only vehicle, vision and, for `results`, the pilot are not.
"""

from __future__ import annotations

import functools
import math
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shipland.camera import Camera
from shipland.flight import cycles
from shipland.messages import (
    BarPose,
    Box,
    DeckSight,
    Frame,
    GimbalAttitude,
    Intent,
    Observation,
    PilotCommand,
    Telemetry,
)
from shipland.record.reader import read_log
from shipland.scenario.autonomy import build_autonomy
from shipland.scenario.scenario import Scenario, load_scenario

CYCLES = 200
PILOTS = ("paper", "p", "pid", "horizon", "residual", "learned")
SCENARIOS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("near", {}),
    ("rig-natops", {"aircraft.loop.kind": "velocity"}),
    ("ship-sea5", {}),
)
HOSTILE = (math.nan, math.inf, -math.inf, 1e300, -1e300, 1e-320, 0.0, -0.0, 1e6, -1e6)
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LONGEST_S = 60.0


@functools.cache
def scenario(index: int) -> Scenario:
    """One of `SCENARIOS`."""
    name, overrides = SCENARIOS[index]
    return load_scenario(name, **overrides)


class Numbers:
    """Numbers about a usual one, `share` of them hostile."""

    def __init__(self, rng: np.random.Generator, share: float) -> None:
        self.rng, self.share = rng, share

    def one(self, usual: float, spread: float = 0.0) -> float:
        """About `usual`, or anything."""
        if self.rng.random() < self.share:
            return float(self.rng.choice(HOSTILE))
        return usual + spread * float(self.rng.standard_normal())

    def some(self, usual: Any, spread: float) -> np.ndarray:  # noqa: ANN401 - of any shape
        """An array about `usual`; the whole is hostile as often as one number."""
        usual = np.asarray(usual, float) + spread * self.rng.standard_normal(np.shape(usual))
        if self.rng.random() < self.share:
            usual.flat[self.rng.integers(usual.size)] = self.rng.choice(HOSTILE)
        return usual

    def maybe(self, value: Any, missing: float = 0.1) -> Any:  # noqa: ANN401 - of any kind
        """The value, or None."""
        return None if self.rng.random() < missing else value


class HostileVehicle:
    """Goes on in time, mostly; whatever is sent must be a command."""

    def __init__(self, camera: Camera, most_percent: float, numbers: Numbers) -> None:
        self.camera, self._most_percent, self._numbers, self._left = camera, most_percent, numbers, CYCLES
        self._t_s = 100.0 * numbers.rng.random()

    def open(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to close."""

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        """A picture's time and telemetry."""
        number, self._left = self._numbers, self._left - 1
        if self._left < 0:
            return None
        self._t_s += number.rng.choice([1 / 30, 1 / 30, 1 / 30, 0.1, 0.0, -0.05, 0.5, 6.0, 90.0, -40.0],
                                       p=[0.3, 0.3, 0.2, 0.1, 0.03, 0.02, 0.02, 0.01, 0.01, 0.01])  # fmt: skip
        gimbal = GimbalAttitude(number.one(0.0, 0.01), number.one(-0.3, 0.1))
        frame = Frame(number.one(self._t_s - 0.28, 0.01), None, gimbal, gimbal_age_s=number.one(0.05))
        return number.maybe(frame, 0.05), self.telemetry_at(number.one(self._t_s))

    def telemetry_at(self, t_s: float) -> Telemetry:
        """About hovering."""
        number = self._numbers
        times_s = (number.maybe(number.one(t_s - 0.1, 0.01)) for _ in range(4))
        values = (number.maybe(number.one(*each)) for each in ((0.0, 0.1), (0.0, 0.1), (1.0, 0.2), (3.0, 1.0)))
        speed_mps = number.maybe(number.some([0.0, 0.0, 0.0], 1.0))
        percent = (number.maybe(number.one(80.0)) for _ in range(2))
        return Telemetry(t_s, *values, speed_mps, *percent, number.rng.random() < 0.98, *times_s)

    def send(self, command: PilotCommand) -> None:
        """It must be one: finite, and within the bounds."""
        numbers = [*sticks_of(command), command.gimbal_pitch_rad, command.t_s]
        assert np.isfinite(np.array(numbers, float)).all(), command
        assert isinstance(command.intent, Intent), command
        assert np.abs(sticks_of(command)).max() <= self._most_percent + 1e-9, command


class HostileVision:
    """Sees an approach, and everything else."""

    def __init__(self, numbers: Numbers) -> None:
        self._numbers, self._place_m = numbers, np.array([-10.0, 0.0, -1.0])

    def see(self, frame: Frame) -> Observation:
        """A pose, boxes, a deck, or an error."""
        number = self._numbers
        if number.rng.random() < 0.3 * number.share:
            raise RuntimeError("hostile")
        self._place_m += number.rng.standard_normal(3) * 0.05 + [0.05, 0.0, 0.005]
        self._place_m = np.clip(self._place_m, [-30.0, -5.0, -6.0], [-0.5, 5.0, 1.0])
        deviation = number.some([1e-4, 1e-4, 1e-4, 1e-5], 1e-5)
        covariance = np.diag(deviation) + number.some(np.zeros((4, 4)), 1e-7)
        corners_px = number.some(np.full((8, 2), 400.0), 50.0)
        pose = BarPose(number.some(self._place_m, 0.02), number.one(0.0, 0.1), covariance, 0.1, corners_px)
        boxes = [
            Box((number.one(640.0, 50.0), number.one(360.0, 50.0)), (number.one(90.0, 9.0), number.one(40.0, 4.0)), 0.9)
            for _ in range(2)
        ]
        deck = DeckSight(number.some([0.3, 0.0, 1.0], 0.1), number.some([0.01] * 3, 0.001))
        return Observation(
            number.one(frame.t_s),
            frame.gimbal if number.rng.random() > number.share else GimbalAttitude(number.one(0.0), number.one(0.0)),
            number.maybe(pose, 0.3),
            number.maybe(boxes[0], 0.5),
            number.maybe(boxes[1], 0.5),
            "",
            number.rng.random() < 0.5,
            number.maybe(deck, 0.8),
        )


def sticks_of(command: PilotCommand) -> list[float]:
    """Pitch, roll, heave, yaw [percent]."""
    return [*command.sticks_percent]


def flown(rng: np.random.Generator, pilot: str | Callable[..., Any], vision: Callable[[Numbers], Any]) -> None:
    """Some cycles of the loop; every command is one, and within the slew of the one before."""
    chosen = scenario(int(rng.integers(len(SCENARIOS))))
    numbers = Numbers(rng, float(rng.choice([0.0, 0.02, 0.1, 0.5])))
    vehicle = HostileVehicle(Camera.from_parameters(chosen.camera), chosen.safety.max_percent, numbers)
    autonomy = build_autonomy(chosen, vehicle, pilot, lambda _: vision(numbers), int(rng.integers(2**31)))
    before: PilotCommand | None = None
    for cycle in cycles(vehicle, autonomy, lambda: 0.0):
        assert isinstance(cycle.decision.reason, str)
        now = cycle.decision.command
        if before is not None:
            step = np.subtract(sticks_of(now), sticks_of(before))
            allowed = chosen.safety.slew_percent_per_s * max(now.t_s - before.t_s, 0.0)
            assert np.abs(step).max() <= allowed + 1e-6, (before, now)
        before = now


def pilots(rng: np.random.Generator) -> None:
    """Every pilot of the package over hostile observations and telemetry; no cycle raises, every command is one."""
    flown(rng, str(rng.choice(PILOTS)), HostileVision)


RESULTS: tuple[Any, ...] = (None, 3, "left", (), [], {}, object(), math.nan, 10**400, True, np.zeros(3))


class Spoiled:
    """A vision or a pilot of a user's, whose results, or a part of them, are of any kind."""

    def __init__(self, whole: Any, method: str, rng: np.random.Generator) -> None:  # noqa: ANN401
        self._rng, whole_method = rng, getattr(whole, method)

        def spoiled(*given: Any) -> Any:  # noqa: ANN401
            return self._spoiled(whole_method(*given), 3)

        setattr(self, method, spoiled)

    def _spoiled(self, value: Any, levels: int) -> Any:  # noqa: ANN401
        """The value; or another; or with a part of it spoiled, past its checks."""
        chance = self._rng.random()
        if chance < 0.9 if levels == 3 else chance < 0.3:
            return value
        if chance > 0.97 or levels == 0 or not hasattr(value, "__dict__") or not vars(value):
            return RESULTS[self._rng.integers(len(RESULTS))]
        copy = object.__new__(type(value))
        copy.__dict__.update(vars(value))
        key = str(self._rng.choice(sorted(vars(value))))
        copy.__dict__[key] = self._spoiled(getattr(value, key), levels - 1)
        return copy


def results(rng: np.random.Generator) -> None:
    """A pilot and a vision of a user's that give back anything: no cycle raises, every command is one."""
    from shipland.guidance.pilot import paper

    def pilot(setup: Any) -> Spoiled:  # noqa: ANN401
        return Spoiled(paper(setup), "decide", rng)

    flown(rng, pilot, lambda numbers: Spoiled(HostileVision(numbers), "see", rng))


def signals(rng: np.random.Generator) -> None:
    """A flight that is asked to stop at any time ends by itself, and what it wrote can be read."""
    words = ["fly", "--scenario", "rig-natops", "--vision", "geometric", "--no-video", "--out", "flight"]
    for each in SIGNALS:  # what runs in the background is started with some of them ignored, and its children too
        signal.signal(each, signal.default_int_handler if each is signal.SIGINT else signal.SIG_DFL)
    how, after_s = SIGNALS[rng.integers(len(SIGNALS))], float(rng.uniform(0.0, 4.0))
    command = [sys.executable, "-m", "shipland.cli", *words, "--seed", str(rng.integers(100))]
    log = Path("flight/flight.mcap")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            begun_s = time.monotonic()
            while process.poll() is None and not log.exists() and time.monotonic() - begun_s < LONGEST_S:
                time.sleep(0.01)  # before it flies Python is starting
            time.sleep(after_s)
            for _ in range(int(rng.integers(1, 4))):
                process.send_signal(how)
                time.sleep(float(rng.choice([0.0, 0.3, 1.2])))
            said, _ = process.communicate(timeout=LONGEST_S)
        finally:
            process.kill()
    ended = process.returncode in (0, 130) or "interrupted" in said  # another signal may end it while it leaves
    assert ended, f"{how.name} after {after_s:.1f} s: exit code {process.returncode}\n{said}"
    assert "Traceback" not in said, said
    if log.exists():
        assert read_log(log).complete, f"{how.name} after {after_s:.1f} s: the log was not closed\n{said}"
