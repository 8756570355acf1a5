"""What both environments are: a simulated flight, the loop of `flight.cycles`, whose pilot waits for an action."""

from __future__ import annotations

import inspect
import math
import time
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import gymnasium
import numpy as np
import numpy.typing as npt

from shipland import factories
from shipland.camera import Camera
from shipland.compiled import say_that_it_compiles
from shipland.config import unknown_key
from shipland.environments.actions import ActionPilot
from shipland.errors import ConfigError
from shipland.factories import Factory
from shipland.flight import Cycle, FlightResult, check_or_hold, cycles, decide_or_degrade
from shipland.guidance.pilot import PilotSetup
from shipland.messages import Decision, Frame, Observation, PilotCommand, Telemetry
from shipland.report.views import FlightViews
from shipland.safety.assurance import Safety
from shipland.scenario.autonomy import build_autonomy, build_scene, build_vehicle
from shipland.scenario.faults import with_faults
from shipland.scenario.fly import Flown
from shipland.scenario.scenario import Scenario, load_scenario
from shipland.scenario.visions import needs_pictures
from shipland.vehicles.vehicle import Vehicle


class SteppedFlight:
    """The flight that `shipland fly` flies, stopped before each decision.

    `advance` reads and sees until a command is due, without time passing afterwards; `decide` then asks the pilot, lets
    the safety check its command and sends it. So whoever sets the pilot's action in between sees what the pilot sees,
    at the same instant. The world of `simulated` tells the truth of now. ShiplandError for a wrong name, or without
    off-screen OpenGL where pictures are drawn.
    """

    def __init__(self, scenario: Scenario, pilot: Factory, vision: str | Factory, seed: int) -> None:
        with ExitStack() as stack:
            scene = None
            if needs_pictures(factories.resolve("visions", vision)):
                scene = build_scene(scenario, seed)
                stack.callback(scene.close)
            self.simulated = build_vehicle(scenario, seed, scene)
            autonomy = build_autonomy(scenario, self.simulated, pilot, vision, seed)
            self._vehicle, self._autonomy = with_faults(scenario, self.simulated, autonomy, seed)
            undecided = _Undecided(self._autonomy.safety)
            self._unsent = _Unsent(self._vehicle)
            flight = cycles(self._unsent, replace(self._autonomy, pilot=undecided, safety=undecided), time.perf_counter)
            self._cycles = stack.enter_context(closing(flight))
            self._stack = stack.pop_all()
        self.sent: PilotCommand | None = None
        """The command sent last."""

    def advance(self) -> Cycle | None:
        """The next cycle up to its decision, which is a placeholder; None once the flight is over."""
        return next(self._cycles, None)

    def decide(self, cycle: Cycle) -> Decision:
        """The pilot's decision on the cycle that `advance` gave last, its command checked by the safety and sent."""
        decision = decide_or_degrade(self._autonomy, cycle.observation, cycle.telemetry, self.sent)
        decision = check_or_hold(self._autonomy, decision, cycle.observation, cycle.telemetry)
        decision = replace(decision, reason=decision.reason + cycle.decision.reason)  # what the loop says of its cycle
        self.sent = decision.command
        ahead_s = self._unsent.due_s - cycle.telemetry.t_s  # what the vehicle's clock has leapt
        self._vehicle.send(replace(self.sent, t_s=self.sent.t_s + ahead_s))
        return decision

    def close(self) -> None:
        """End the flight; again does nothing."""
        self._stack.close()


class _Unsent:
    """A vehicle whose commands are sent by another: `send` tells only when one is due, by the vehicle's clock."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle, self.due_s = vehicle, 0.0

    @property
    def camera(self) -> Camera:
        return self._vehicle.camera

    def open(self) -> None:
        self._vehicle.open()

    def read(self) -> tuple[Frame | None, Telemetry] | None:
        return self._vehicle.read()

    def telemetry_at(self, t_s: float) -> Telemetry:
        return self._vehicle.telemetry_at(t_s)

    def send(self, command: PilotCommand) -> None:
        self.due_s = command.t_s

    def close(self) -> None:
        self._vehicle.close()


class _Undecided(Safety):
    """Pilot and safety in whose place the caller decides and checks; the flight's own safety admits what is seen."""

    def __init__(self, safety: Safety) -> None:  # without a state of its own
        self._safety = safety

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:  # noqa: ARG002
        return Decision(PilotCommand.hold(telemetry.t_s, 0.0), None, "")

    def admitted(self, observation: Observation, telemetry: Telemetry) -> Observation:
        return self._safety.admitted(observation, telemetry)

    def check(self, decision: Decision, *_: object) -> Decision:
        return decision


Seen = TypeVar("Seen")

IN_SQUARE, LANDED, FAILED = 10.0, 2.0, -10.0
"""Reward at the end: stands in the square, stands on the deck beside it, anything else but the time limit."""
PER_METRE, PER_SECOND = 1.0, -0.05
"""Reward for coming nearer to the deck's centre, and for time."""

_SEEDS, _DRAWS = 2**31, 20


class FlightEnv(gymnasium.Env[Seen, npt.NDArray[np.float32]], Generic[Seen]):
    """A landing in the simulator, flown by the loop that flies the drone; the safety stands behind every action.

    **A step** is a cycle of the loop: the action is flown on what the observation before it shows, then time passes
    until the next command is due (a picture, its delays and the processing time; about 33 ms near, 0.5 s after a
    learned detector), and through the cycles, if any, that no action can change. A policy thus decides on the very
    data, and at the very instant, that a pilot gets.

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

    **Rendering**: with the `render_mode` `rgb_array`, `render` gives the flight as it is now, from two sides.

    Args:
        scenario: a packaged name, the path of a TOML file, a merged table or a scenario.
        overrides: sections or dotted keys laid over it, as `load_scenario` takes them.
        vision: `geometric`, `rendered` (drawn pictures through the whole vision), or your own.
        render_mode: `rgb_array` or None.
        unknown: arguments that are refused; the nearest one is named.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 30}  # noqa: RUF012 - as the base class has it
    usual: Mapping[str, Any] = {}
    """Overrides of every flight, laid under those given."""

    def __init__(
        self,
        scenario: Scenario | str | Path | Mapping[str, Any],
        overrides: Mapping[str, Any] | None,
        vision: str | Factory,
        render_mode: str | None,
        unknown: Mapping[str, Any],
    ) -> None:
        for name in unknown:
            known = [each for each in inspect.signature(type(self)).parameters if each != "unknown"]
            raise ConfigError(unknown_key(name, known, type(self).__name__))
        if render_mode is not None:
            one_of("render_mode", render_mode, self.metadata["render_modes"])
        given = {} if overrides is None else overrides
        if not (isinstance(given, Mapping) and all(isinstance(key, str) for key in given)):
            raise ConfigError(f"overrides={overrides!r}: expected a table, as {{'wind.mean_mps': 5.0}}")
        source = scenario.table() if isinstance(scenario, Scenario) else scenario
        self.scenario = load_scenario(source, **{**self.usual, **given})
        self._vision = factories.resolve("visions", vision)
        say_that_it_compiles()
        self.render_mode = render_mode
        self._views: FlightViews | None = None
        self._flight: SteppedFlight | None = None
        self._cycle: Cycle | None = None
        self._seen: Seen

    @abstractmethod
    def _pilot_of(self, setup: PilotSetup) -> ActionPilot:
        """The pilot of a flight that begins."""

    @abstractmethod
    def _look(self, cycle: Cycle, sent: PilotCommand | None) -> Seen | None:
        """What the agent sees of a cycle; None where no action can change it."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Seen, dict[str, Any]]:
        """Begin a flight; `options` are not used. Of flights that are over before an action is due, the next is drawn.

        Raises:
            ConfigError: the flight of the seed given, or of several drawn, is over before an action is due.
        """
        super().reset(seed=seed, options=options)
        diagonal_m = self.scenario.aircraft.airframe.motor_diagonal_m
        for _ in range(1 if seed is not None else _DRAWS):
            self.close()
            self._seed = seed if seed is not None else int(self.np_random.integers(_SEEDS))
            self._flight = flight = SteppedFlight(self.scenario, self._build_pilot, self._vision, self._seed)
            self._cycles, self._first_s = 0, -math.inf
            self._views = None if self.render_mode is None else FlightViews(self.scenario.rig, diagonal_m)
            self._advance(flight)
            self._reason = ""
            if self._cycle is not None and not self._timed_out:
                return self._seen, self._info("")
        self.close()
        raise ConfigError(f"the flight of seed {self._seed} is over before an action is due")

    def step(self, action: npt.NDArray[np.float32]) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Fly to the next action; see the class.

        Raises:
            gymnasium.error.ResetNeeded: no flight is on.
            gymnasium.error.InvalidAction: another shape than the space's, or not finite; what lies beyond is clipped.
        """
        flight = self._flight
        if flight is None:
            raise gymnasium.error.ResetNeeded("no flight is on; call reset() first")
        assert self._cycle is not None
        asked, shape = np.asarray(action, dtype=float), self.action_space.shape
        if asked.shape != shape or not np.isfinite(asked).all():
            raise gymnasium.error.InvalidAction(f"action {action!r}: expected finite numbers of the shape {shape}")
        self._pilot.action = np.clip(asked, -1.0, 1.0)
        before_s, before_m = self._now_s, self._distance_m
        reason = self._advance(flight, self._cycle)
        over, truncated = self._cycle is None, self._timed_out
        reward = PER_METRE * (before_m - self._distance_m) + PER_SECOND * (self._now_s - before_s)
        info = self._info(reason)
        if over or truncated:
            result = FlightResult(cycles=self._cycles, t_s=self._now_s)
            if truncated:
                result.reason = f"time limit of {self.scenario.time_limit_s:g} s"
            end = Flown(result, flight.simulated.verdict())
            info |= _end_info(end)
            reason = end.reason
            if not truncated:
                reward += _end_reward(end)
            self.close()
        self._reason = reason
        return self._seen, reward, over, truncated, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The flight as it is now, from the side and from above: (480,640,3) RGB; None without a `render_mode`.

        Raises:
            gymnasium.error.ResetNeeded: no flight was begun.
        """
        if self.render_mode is None:
            return None
        if self._views is None:
            raise gymnasium.error.ResetNeeded("there is no flight to draw; call reset() first")
        return self._views.picture(self._reason)

    def close(self) -> None:
        """End the flight that is on, if there is one."""
        if self._flight is not None:
            self._flight.close()
            self._flight = None

    def _build_pilot(self, setup: PilotSetup) -> ActionPilot:
        self._pilot = self._pilot_of(setup)
        return self._pilot

    def _advance(self, flight: SteppedFlight, cycle: Cycle | None = None) -> str:
        """Fly `cycle`, then those that no action can change; the last command's reason."""
        reason, seen = "", None
        self._timed_out = False
        while seen is None:
            if cycle is not None:
                reason = flight.decide(cycle).reason
                self._cycles += 1
            self._cycle = cycle = flight.advance()
            self._truth = flight.simulated.world.truth()
            if self._views is not None:
                self._views.note(self._truth)
            self._distance_m = float(np.linalg.norm(self._truth.aircraft_in_deck_m))
            self._now_s = self._truth.t_s
            if cycle is None:
                return reason
            self._now_s = cycle.telemetry.t_s
            if self._cycles == 0:
                self._first_s = cycle.frame.t_s
            self._timed_out = self._cycles > 0 and self._now_s - self._first_s >= self.scenario.time_limit_s
            seen = self._look(cycle, flight.sent)
            if self._timed_out:
                break
        if seen is not None:
            self._seen = seen
        return reason

    def _info(self, reason: str) -> dict[str, Any]:
        place_m = self._truth.aircraft_in_deck_m
        return {"seed": self._seed, "t_s": self._truth.t_s, "aircraft_in_deck_m": place_m, "reason": reason}


def one_of(name: str, value: str, known: Sequence[str]) -> None:
    """Check an argument; ConfigError when it is none of those known."""
    if value not in known:
        raise ConfigError(f"{name}={value!r}: expected one of {', '.join(known)}")


def _end_info(end: Flown) -> dict[str, Any]:
    verdict = end.verdict
    ends = {"landed": False, "in_square": False, "is_success": end.success, "reason": end.reason}
    if verdict is not None:
        ends |= {"landed": verdict.landed, "in_square": verdict.in_square}
    if verdict is None or not verdict.touched:
        return ends | dict.fromkeys(("error_m", "descent_mps", "tilt_rad", "slip_m"), math.nan)
    contact = {"error_m": verdict.error_m, "descent_mps": verdict.sink_mps}
    return ends | contact | {"tilt_rad": verdict.tilt_rad, "slip_m": verdict.slip_m}


def _end_reward(end: Flown) -> float:
    if end.success:
        return IN_SQUARE
    return LANDED if end.verdict is not None and end.verdict.landed else FAILED
