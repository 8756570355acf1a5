"""Fly one landing from Python: `shipland.fly`."""

from __future__ import annotations

import logging
import operator
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipland import factories
from shipland.compiled import say_that_it_compiles
from shipland.errors import ConfigError
from shipland.factories import Factory
from shipland.flight import fly as fly_loop
from shipland.flight import no_override
from shipland.frames import Array
from shipland.guidance.response import Response
from shipland.messages import FlightRecord, Override
from shipland.scenario.autonomy import aircraft_scale, build_autonomy, build_scene, build_vehicle
from shipland.scenario.faults import with_faults
from shipland.scenario.fly import Flown, flight_info
from shipland.scenario.scenario import Scenario, load_scenario
from shipland.scenario.visions import needs_pictures, without_pictures
from shipland.soundness import log_failure
from shipland.stopping import check_stop, stop_requests
from shipland.vehicles.simulated import SimulatedVehicle
from shipland.vehicles.vehicle import GroundTruthSource, Informed, Real, Vehicle

if TYPE_CHECKING:  # one flight that leaves nothing imports neither records nor reports
    from shipland.record.columns import FlightColumns
    from shipland.record.info import FlightInfo
    from shipland.report.outputs import Recorder
    from shipland.sim.scene.scene import Scene

__all__ = ["Flight", "fly", "load_scenario", "without_pictures"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, repr=False)
class Flight(Flown):
    """A flight that was flown.

    Attributes:
        result: how the loop ended.
        verdict: the touchdown; None where there was none.
        scenario: what was flown.
        records: a row a cycle, without the pictures.
        problems: outputs that failed, a line each.
        folder: where the log, the video, the plots and the figures lie; None without `out`.
    """

    scenario: Scenario
    records: tuple[FlightRecord, ...]
    problems: tuple[str, ...]
    folder: Path | None

    def __repr__(self) -> str:
        where = "" if self.folder is None else f", in {self.folder}"
        return f"<Flight of {self.scenario.name}: {self.reason}; {len(self.records)} cycles{where}>"

    def _repr_html_(self) -> str:
        from shipland.report.notebook import flight_html

        film = None if self.folder is None else self.folder / "flight.mp4"
        return flight_html(self.scenario, self.reason, self.verdict, self.records, film)

    @property
    def error_m(self) -> float:
        """Distance of the touchdown point from the deck's centre; NaN without a touchdown."""
        return float("nan") if self.verdict is None else self.verdict.error_m

    @cached_property
    def columns(self) -> FlightColumns:
        """The flight as arrays, a row a cycle: what `FlightColumns` documents."""
        from shipland.record.columns import FlightColumns

        return FlightColumns.from_records(self.records, self.scenario.rig)

    def table(self) -> dict[str, Array]:
        """The same as flat columns (n,) by name, as data frames take them; a vector is `name_0`, `name_1` and so on."""
        flat: dict[str, Array] = {}
        for name, values in vars(self.columns).items():
            if values.ndim == 1:
                flat[name] = values
            else:
                flat |= {f"{name}_{index}": column for index, column in enumerate(values.T)}
        return flat


def fly(
    scenario: Scenario | str | Path,
    *,
    pilot: str | Factory = "horizon",
    vision: str | Factory = "geometric",
    seed: int = 1,
    out: str | Path | None = None,
    video: bool = True,
    on_cycle: Callable[[FlightRecord], None] = lambda _: None,
    command: str = "",
    vehicle: Vehicle | None = None,
    override: Callable[[], Override | None] = no_override,
    response: Response | None = None,
) -> Flight:
    """Fly one landing, in the simulator unless a vehicle is given; Ctrl-C and its like end it at the next cycle.

    Args:
        scenario: a scenario, a packaged one's name, or the path of a TOML file.
        pilot: a name (`paper`, an entry point's, `module:factory`) or a function from `PilotSetup` to a pilot.
        vision: likewise, from `VisionSetup`; `rendered` looks at drawn pictures, `geometric` needs none.
        seed: 0 or more; the same seed gives the same flight.
        out: folder for the log, the video, the plots and the figures; None leaves nothing.
        video: whether the video is among them.
        on_cycle: sees every row as it is flown.
        command: command line to write down.
        vehicle: what is flown instead of the simulated one (`scenario.real_vehicle`); connected, if real.
        override: asked each cycle whether a person holds or climbs by hand; None leaves the pilot to fly.
        response: what full sticks mean, where `shipland identify` has measured it.

    Raises:
        ShiplandError: a wrong scenario, name, seed, output folder or machine.
    """
    scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    for name, given in (("on_cycle", on_cycle), ("override", override)):
        if not callable(given):
            raise ConfigError(f"{name} must be a function, got {given!r}")
    factories.resolve("pilots", pilot)
    pictures, seed = needs_pictures(factories.resolve("visions", vision)), checked_seed(seed)
    say_that_it_compiles()
    records: list[FlightRecord] = []
    with ExitStack() as stack:
        stack.enter_context(stop_requests())
        scene = None
        if vehicle is None and (pictures or (out is not None and video)):
            scene = build_scene(scenario, seed)
            stack.callback(scene.close)
        flown = vehicle or build_vehicle(scenario, seed, scene if pictures else None)
        autonomy = build_autonomy(scenario, flown, pilot, vision, seed, response)
        if isinstance(flown, SimulatedVehicle):
            flown, autonomy = with_faults(scenario, flown, autonomy, seed)
        autonomy = replace(autonomy, override=override)
        recorder = None
        if out is not None:
            info = flight_info(scenario, pilot, vision, seed, command)
            recorder = stack.enter_context(_recorder(Path(out), info, scenario, flown, scene, video))

        informed = flown if isinstance(flown, Informed) else None
        if informed is not None:
            informed.inform_of(scenario.rig, np.array(scenario.camera.position_in_body_m))

        of_informing = set[type[BaseException]]()

        def remember(record: FlightRecord) -> None:
            if informed is not None:
                try:
                    informed.inform(record)
                except Exception as error:  # others are told nothing of this cycle; the flight goes on
                    told = f"nobody was told of the cycle at {record.telemetry.t_s:.3f} s"
                    log_failure(_log, told, error, of_informing)
            if recorder is not None:
                recorder.append(record)
            records.append(replace(record, frame=replace(record.frame, image=None)))
            on_cycle(record)
            check_stop()

        result = fly_loop(flown, autonomy, scenario.time_limit_s, time.perf_counter, remember)
        verdict = flown.verdict() if isinstance(flown, GroundTruthSource) else None
        if recorder is not None:
            recorder.finish(verdict, result.reason, {stage.value: cost for stage, cost in result.cost_s.items()})
    problems = () if recorder is None else tuple(recorder.problems)
    return Flight(result, verdict, scenario, tuple(records), problems, None if out is None else Path(out))


def checked_seed(seed: Any) -> int:  # noqa: ANN401 - whatever a caller gives
    """The seed as `whole_number`."""
    return whole_number("a seed", seed)


def whole_number(name: str, given: Any, least: int = 0) -> int:  # noqa: ANN401 - whatever a caller gives
    """A whole number of Python's or NumPy's; ConfigError, by its name, when it is none, or too small."""
    try:
        number = operator.index(given)
    except TypeError:
        raise ConfigError(f"{name} must be a whole number, got {given!r}") from None
    if number < least:
        raise ConfigError(f"{name} must be {least} or more, got {number}")
    return number


def _recorder(
    folder: Path, info: FlightInfo, scenario: Scenario, vehicle: Vehicle, scene: Scene | None, video: bool
) -> Recorder:
    """What writes the flight to its folder; the video has the outside view where there is a scene."""
    from shipland.report.chase import chase_view
    from shipland.report.outputs import Recorder

    chase = None
    if scene is not None and video:
        chase = chase_view(scene, vehicle.camera, aircraft_scale(scenario), scenario.ship.full_ship)
    real = isinstance(vehicle, Real)
    return Recorder(folder, info, scenario.rig, vehicle.camera, chase, video, real)
