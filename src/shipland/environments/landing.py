"""`shipland/Landing-v0`: one landing, a cycle a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from shipland import factories
from shipland.environments.actions import STICKS, ActionPilot, ResidualPilot, StickPilot
from shipland.environments.observations import Arrays, Observer, observation_space
from shipland.environments.stepped import SteppedFlight
from shipland.errors import ConfigError
from shipland.factories import Factory
from shipland.flight import Cycle, FlightResult
from shipland.guidance.pilot import PilotSetup
from shipland.messages import PilotCommand
from shipland.scenario.fly import Flown
from shipland.scenario.scenario import Scenario, load_scenario

Seen = Arrays | npt.NDArray[np.float32]

IN_SQUARE, LANDED, FAILED = 10.0, 2.0, -10.0
"""Reward at the end: stands in the square, stands on the deck beside it, anything else but the time limit."""
PER_METRE, PER_SECOND = 1.0, -0.05
"""Reward for coming nearer to the deck's centre, and for time."""

_SEEDS = 2**31


class LandingEnv(gymnasium.Env[Seen, npt.NDArray[np.float32]]):
    """A landing in the simulator, flown by the loop that flies the drone; the safety stands behind every action.

    **A step** is a cycle of the loop: the action is flown on what the observation before it shows, then time passes
    until the next command is due (a picture, its delays and the processing time; about 33 ms near, 0.5 s after a
    learned detector). A policy thus decides on the very data, and at the very instant, that a pilot gets.

    **Actions**: (4,) in -1 … 1: pitch (forward positive), roll (right), heave (up), yaw (clockwise). `sticks`: of the
    full stick; camera and intent as in `StickPilot`. `residual`: times `bound`, added to the pilot's sticks as in
    `ResidualPilot`; zeros fly the pilot alone.

    **Observations**: see `Observer`; delayed, with ages, never the truth. `dict`, or `flat`: its entries one after
    the other by name, which `gymnasium.spaces.unflatten(env.unwrapped.entries, observation)` takes apart again.

    **Reward**: the metres that the aircraft's centre of mass came nearer to the deck's centre during the step, by the
    truth, less 0.05 for each second; at the end +10 for a landing in the square, +2 for one beside it, -10 for
    everything else (crashed, fell, too hard, slipped …) and nothing at the time limit.

    **Termination**: the flight is over by the project's own verdict. **Truncation**: the scenario's time limit.

    **Info**: `seed` of the flight, `t_s`, `aircraft_in_deck_m` (3,) by the truth of now, `reason` of the last command
    with the safety's interventions in words. At the end moreover `landed` (at rest on its feet, within every limit),
    `in_square` (first contact in the landing square), `is_success` (both), `error_m` (of the first contact from the
    square's centre), `descent_mps`, `tilt_rad` and `slip_m`, NaN without contact, and `reason` says how it ended.

    **Seeds**: `reset(seed=7)` flies the flight that `shipland fly --seed 7` flies; a `reset` without one draws the
    flight's seed from the generator that the last one seeded.

    Args:
        scenario: a packaged name, the path of a TOML file, a merged table or a scenario.
        overrides: sections or dotted keys laid over it, as `load_scenario` takes them.
        vision: `geometric`, `rendered` (drawn pictures through the whole vision), or your own.
        action: `sticks` or `residual`.
        pilot: of the residual, as `factories.resolve` takes it.
        bound: of the residual, as a share of the full stick: one for all or four.
        observation: `dict` or `flat`.

    Raises:
        ShiplandError: one of them is wrong; it says which.
    """

    metadata: dict[str, Any] = {"render_modes": [], "render_fps": 30}  # noqa: RUF012 - as the base class has it

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any] = "near",
        *,
        overrides: Mapping[str, Any] | None = None,
        vision: str | Factory = "geometric",
        action: str = "sticks",
        pilot: str | Factory = "horizon",
        bound: float | Sequence[float] = 0.2,
        observation: str = "dict",
        render_mode: str | None = None,
    ) -> None:
        _one_of("action", action, ("sticks", "residual"))
        _one_of("observation", observation, ("dict", "flat"))
        if render_mode is not None:
            raise ConfigError(f"render_mode={render_mode!r}: there is none; `shipland fly` makes videos")
        source = scenario.table() if isinstance(scenario, Scenario) else scenario
        self.scenario = load_scenario(source, **(overrides or {}))
        self._vision = factories.resolve("visions", vision)
        self._inner = factories.resolve("pilots", pilot) if action == "residual" else None
        self._bound = _bound_of(bound)
        self.render_mode = None
        self.entries = observation_space()
        self.action_space = spaces.Box(-1.0, 1.0, (STICKS,), np.float32)
        self._flat = observation == "flat"
        self.observation_space = spaces.flatten_space(self.entries) if self._flat else self.entries  # type: ignore[assignment]
        self._flight: SteppedFlight | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin a flight; `options` are not used.

        Raises:
            ConfigError: the scenario ends before its first picture.
        """
        super().reset(seed=seed, options=options)
        self.close()
        self._seed = seed if seed is not None else int(self.np_random.integers(_SEEDS))
        self._flight = flight = SteppedFlight(self.scenario, self._build_pilot, self._vision, self._seed)
        cycle = flight.advance()
        if cycle is None:
            raise ConfigError(f"the flight of seed {self._seed} is over before its first picture")
        self._cycle, self._first_s, self._cycles = cycle, cycle.frame.t_s, 0
        self._observer = Observer(self._camera)
        self._distance_m = self._look(flight)
        self._seen = self._take(cycle, None)
        return self._seen, self._info("")

    def step(self, action: npt.NDArray[np.float32]) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Fly one cycle; see the class.

        Raises:
            gymnasium.error.ResetNeeded: no flight is on.
        """
        flight = self._flight
        if flight is None:
            raise gymnasium.error.ResetNeeded("no flight is on; call reset() first")
        self._pilot.action = np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
        decision, before_s, before_m = flight.decide(self._cycle), self._cycle.telemetry.t_s, self._distance_m
        self._cycles += 1
        cycle, limit_s = flight.advance(), self.scenario.time_limit_s
        now_s = flight.truth().t_s if cycle is None else cycle.telemetry.t_s
        self._distance_m = self._look(flight)
        reward = PER_METRE * (before_m - self._distance_m) + PER_SECOND * (now_s - before_s)
        if cycle is not None:
            self._cycle, self._seen = cycle, self._take(cycle, decision.command)
        truncated = cycle is not None and now_s - self._first_s >= limit_s
        info = self._info(decision.reason)
        if cycle is None or truncated:
            result = FlightResult(cycles=self._cycles, t_s=now_s)
            if truncated:
                result.reason = f"time limit of {limit_s:g} s"
            end = Flown(result, flight.verdict())
            info |= _end_info(end)
            if not truncated:
                reward += _end_reward(end)
            self.close()
        return self._seen, reward, cycle is None, truncated, info

    def close(self) -> None:
        """End the flight that is on, if there is one."""
        if self._flight is not None:
            self._flight.close()
            self._flight = None

    def _build_pilot(self, setup: PilotSetup) -> ActionPilot:
        self._camera = setup.camera
        self._pilot: ActionPilot
        if self._inner is None:
            self._pilot = StickPilot(setup, self.scenario.safety.stale_s)
        else:
            self._pilot = ResidualPilot(self._inner(setup), self._bound)
        return self._pilot

    def _look(self, flight: SteppedFlight) -> float:
        """Take the truth of now; the distance to the deck's centre [m]."""
        self._now = flight.truth()
        return float(np.linalg.norm(self._now.aircraft_in_deck_m))

    def _take(self, cycle: Cycle, sent: PilotCommand | None) -> Seen:
        entries = self._observer.take(cycle.observation, cycle.telemetry, sent)
        if not self._flat:
            return entries
        flat: npt.NDArray[np.float32] = np.concatenate(list(entries.values()))
        return flat

    def _info(self, reason: str) -> dict[str, Any]:
        place_m = self._now.aircraft_in_deck_m
        return {"seed": self._seed, "t_s": self._now.t_s, "aircraft_in_deck_m": place_m, "reason": reason}


def _end_info(end: Flown) -> dict[str, Any]:
    verdict, nan = end.verdict, float("nan")
    touched = verdict is not None and verdict.touched
    return {
        "landed": verdict is not None and verdict.landed,
        "in_square": verdict is not None and verdict.in_square,
        "is_success": end.success,
        "reason": end.reason,
        "error_m": float(np.hypot(*verdict.touchdown_in_deck_m)) if verdict is not None and touched else nan,
        "descent_mps": float(verdict.relative_velocity_in_deck_mps[2]) if verdict is not None and touched else nan,
        "tilt_rad": verdict.tilt_rad if verdict is not None and touched else nan,
        "slip_m": verdict.slip_m if verdict is not None and touched else nan,
    }


def _end_reward(end: Flown) -> float:
    if end.success:
        return IN_SQUARE
    return LANDED if end.verdict is not None and end.verdict.landed else FAILED


def _one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ConfigError(f"{name}={value!r}: expected one of {', '.join(known)}")


def _bound_of(bound: float | Sequence[float]) -> npt.NDArray[np.float64]:
    shares = np.asarray(bound, dtype=float)
    if shares.shape not in ((), (STICKS,)) or not np.all((shares >= 0.0) & (shares <= 1.0)):
        raise ConfigError(f"bound={bound!r}: expected a share of the full stick, 0 … 1, or four of them")
    return np.array(np.broadcast_to(shares, STICKS))
