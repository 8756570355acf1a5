"""`shipland fly`: one flight, simulated or real, with everything it leaves behind."""

from __future__ import annotations

import math
import threading
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shipland.commands.options import ScenarioOptions, check_between, command_line, require_record
from shipland.errors import ConfigError
from shipland.extras import installed

if TYPE_CHECKING:
    from shipland.api import Flight
    from shipland.commands.terminal import Terminal
    from shipland.messages import FlightRecord, Mode
    from shipland.record.live import LiveView
    from shipland.scenario.scenario import Scenario
    from shipland.vehicles.vehicle import Vehicle


@dataclass(frozen=True)
class Fly(ScenarioOptions):
    """Fly one landing, in the simulator or on a vehicle, and judge the touchdown where the truth is known.

    Leaves flight.mcap (opens in Foxglove, with foxglove-layout.json), flight.mp4, plots.png, summary.json and
    timing.json in the output folder. --live shows the flight in Foxglove as it happens.
    Exit code: 0 landed in the square, 1 not, 2 bad input or an output that could not be written.

    A vehicle outside is checked first: every line of the checklist is printed, and one that is not in order ends the
    command. In flight, in a terminal: h holds, c climbs, r gives the vehicle back to the pilot.

    Example: shipland fly --scenario near --seed 7 --out out/seven

    Example: shipland fly --vehicle "mavlink://udp:127.0.0.1:14550?camera=rtsp://192.168.1.5/live"
        --calibration camera.yaml --pilot horizon
    """

    pilot: str = "horizon"
    """Who flies: `horizon` is ours, `paper` the published system, `p` and `pid` its modes with plain linear laws,
    `residual` and `learned` are `horizon` with a policy; your own as `module:factory`."""
    vision: str = "rendered"
    """`rendered`: vision on drawn pictures; `published`: the same with the published near chain; `geometric`: true
    corners with vision's errors, at a fraction of the cost; your own as `module:factory`."""
    seed: int = 1
    """Seed of everything random; the same seed gives the same flight."""
    out: Path = Path("out/flight")
    """Output folder; made when missing. An earlier flight's files in it are written over."""
    video: bool = True
    """Write no flight.mp4, whose view from outside costs a second picture a frame."""
    vehicle: str | None = None
    """Flown in place of the simulated aircraft: `mavlink://…`, `anafi://…`, `ros2://…`, `replay://…`."""
    calibration: Path | None = None
    """OpenCV's or ROS's calibration file of the vehicle's camera."""
    vehicle_config: Path | None = None
    """TOML file laid over the settings of vehicles, such as what `shipland identify` writes."""
    wind_mps: float | None = None
    """Wind that a vehicle is to expect, gusts included; 5 when not given. The simulator's: --set wind.mean_mps=5."""
    live: bool = False
    """Show the flight in Foxglove as it happens, on this machine alone; a simulated one waits a minute for a viewer and
    then keeps the clock's pace."""
    live_port: int = 8765
    """Port of --live, on loopback."""
    check: bool = False
    """Only connect to the vehicle and print its checklist; 0 where every line is in order."""

    def run(self) -> int:
        """Fly, record and report on the terminal; 0 when landed in the square, 1 when not."""
        from shipland.commands.terminal import Terminal

        with Terminal() as terminal:
            return self._fly(terminal)

    def _fly(self, terminal: Terminal) -> int:
        from shipland.api import fly
        from shipland.evaluation.folder import claimed
        from shipland.flight import no_override
        from shipland.scenario.autonomy import response_of
        from shipland.scenario.real_vehicle import Keys, identified

        self._refuse_wrong_options()
        scenario, response = self.load(), None
        if self.vehicle is None and self.vehicle_config is not None:
            response = identified(self.vehicle_config, response_of(scenario))
        with ExitStack() as stack:
            stack.enter_context(claimed(self.out))
            vehicle = None if self.vehicle is None else self._outside(self.vehicle, scenario, terminal)
            if vehicle is not None:
                stack.callback(vehicle.close)  # also where no flight begins; again does nothing
            if self.check:
                return 0
            live = self._live(scenario, vehicle, terminal, stack) if self.live else None
            progress = stack.enter_context(ProgressLine(terminal, vehicle))
            override = no_override if vehicle is None else stack.enter_context(Keys().listening()).override
            started_s: float | None = None

            def on_cycle(record: FlightRecord) -> None:
                nonlocal started_s
                progress.show(record)
                if live is None:
                    return
                live.append(record)
                if vehicle is None:  # the simulator must not run ahead of the clock
                    started_s = time.monotonic() - record.telemetry.t_s if started_s is None else started_s
                    time.sleep(max(0.0, started_s + record.telemetry.t_s - time.monotonic()))

            flight = fly(
                scenario,
                pilot=self.pilot,
                vision=self.vision,
                seed=self.seed,
                out=self.out,
                video=self.video,
                on_cycle=on_cycle,
                command=command_line(),
                vehicle=vehicle,
                override=override,
                response=response,
            )
            if live is not None:
                live.finish(flight.verdict, flight.result.reason)
                if live.left_out:
                    terminal.say(f"live: {live.left_out} cycles were left out: a viewer is slower than the flight")
        _report(terminal, self, flight)
        require_record(flight)
        return 0 if flight.success else 1

    def _refuse_wrong_options(self) -> None:
        """ConfigError for an option of vehicles in a simulated flight, and for a value that is none."""
        from shipland.api import checked_seed
        from shipland.factories import resolve

        checked_seed(self.seed)
        check_between(0, 65535, live_port=self.live_port)
        resolve("visions", self.vision)
        if self.wind_mps is not None and not (math.isfinite(self.wind_mps) and self.wind_mps >= 0.0):
            raise ConfigError(f"--wind-mps must be 0 or more, got {self.wind_mps:g}")
        if self.vehicle is not None:
            return
        if self.wind_mps is not None:
            raise ConfigError(
                "--wind-mps is what a --vehicle is to expect; the simulator's wind: --set wind.mean_mps=5"
            )
        if self.check or self.calibration is not None:
            raise ConfigError("--check and --calibration are of a vehicle: give --vehicle too")

    def _live(self, scenario: Scenario, vehicle: Vehicle | None, terminal: Terminal, stack: ExitStack) -> LiveView:
        """The live view, which the stack closes; for a simulated flight once somebody looks, or a minute has gone."""
        from shipland.camera import Camera
        from shipland.record.layout import LAYOUT_NAME, write_layout
        from shipland.record.live import LiveView
        from shipland.scenario.fly import flight_info

        camera = Camera.from_parameters(scenario.camera) if vehicle is None else vehicle.camera
        info = flight_info(scenario, self.pilot, self.vision, self.seed, command_line())
        live = stack.enter_context(LiveView(info, scenario.rig, camera, self.live_port))
        write_layout(self.out / LAYOUT_NAME)
        terminal.say(f"live on {live.address}: open it in Foxglove; layout: {self.out / LAYOUT_NAME}")
        if vehicle is None:
            terminal.status("waiting for a viewer, a minute at most")
            until_s = time.monotonic() + _VIEWER_S
            while time.monotonic() < until_s and not live.wait(0.2):
                pass
        return live

    def _outside(self, address: str, scenario: Scenario, terminal: Terminal) -> Vehicle:
        """The vehicle, connected where it is a real one, and fit to fly; VehicleError when it is not."""
        from shipland.scenario.fly import fly_quietly
        from shipland.scenario.real_vehicle import checklist, make_vehicle, rehearse_vision, require_passed
        from shipland.stopping import check_stop, stop_requests
        from shipland.vehicles.address import vehicle_table, without_password
        from shipland.vehicles.checks import Check
        from shipland.vehicles.vehicle import Real

        wind_mps = 5.0 if self.wind_mps is None else self.wind_mps
        # an earlier flight's messages are its record
        log = self.out / ("check.tlog" if self.check else "link.tlog")
        vehicle = make_vehicle(address, scenario, self.calibration, self.vehicle_config, log)
        if not isinstance(vehicle, Real):
            if self.check or self.wind_mps is not None:
                raise ConfigError(f"{address} is no vehicle outside: there is nothing to check, and no wind moves it")
            return vehicle
        terminal.say("rehearsing in the simulator")
        # what runs for the first time compiles and imports for seconds, in which a vehicle in the air gets no command
        with stop_requests():
            rehearsed = fly_quietly(scenario, self.pilot, "geometric", self.seed, on_cycle=lambda _: check_stop())
            rehearse_vision(scenario, self.vision, vehicle)
            check_stop()
        terminal.say(f"connecting to {without_password(address)}")
        vehicle.connect()
        try:
            time.sleep(_LISTENING_S)
            table = vehicle_table(self.vehicle_config)
            checks = checklist(vehicle, scenario, self.calibration, wind_mps, table)
            checks.insert(0, Check("rehearsal", True, rehearsed.reason))
            terminal.say(*(check.line() for check in checks))
            require_passed(checks)
        except BaseException:
            vehicle.close()
            raise
        return vehicle


_VIEWER_S = 60.0
"""How long a simulated flight waits for somebody to look at it."""
_LISTENING_S = 3.0
"""In which a vehicle's rates are counted."""


def _report(terminal: Terminal, command: Fly, flight: Flight) -> None:
    which = f"seed {command.seed}, " if command.vehicle is None else ""
    first_s = flight.records[0].frame.t_s if flight.records else 0.0
    terminal.say(f"{flight.reason} ({which}{max(0.0, flight.result.t_s - first_s):.1f} s of flight)")
    verdict = flight.verdict
    if verdict is not None and verdict.touched:
        forward_m, starboard_m = verdict.touchdown_in_deck_m
        terminal.say(
            f"touchdown {forward_m:+.3f} m forward, {starboard_m:+.3f} m starboard of the deck's centre at "
            f"{verdict.t_s:.1f} s, {verdict.sink_mps:.2f} m/s down against the deck, slip {verdict.slip_m:.3f} m"
        )
    if terminal.lost:
        terminal.say(f"{terminal.lost} lines were not shown: the terminal stood still")
    names = ", ".join(sorted(path.name for path in command.out.glob("[!.]*") if path.is_file()))
    terminal.say(f"{command.out}: {names or 'nothing could be written'}")
    if not installed("plots"):
        terminal.say("no plots.png: pip install 'shipland[plots]'")
    if command.video and not installed("film"):
        terminal.say("flight.mp4 is MPEG-4, which browsers do not play; H.264: pip install 'shipland[film]'")


class ProgressLine:
    """The live line: time since the first picture, mode, distance, sticks; a line each change of mode and of command.

    Who is in command is shown from a thread of its own, whatever the flight does meanwhile.
    """

    def __init__(self, terminal: Terminal, vehicle: Vehicle | None = None) -> None:
        self._terminal, self._vehicle = terminal, vehicle
        self._first_s: float | None = None
        self._mode: Mode | None = None
        self._shown_s = -1.0
        self._commander = ""
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="in-command", daemon=True)

    def __enter__(self) -> ProgressLine:
        self._terminal.status("starting")
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(1.0)
        self._terminal.status("")

    def show(self, record: FlightRecord) -> None:
        """Show one cycle; never waits."""
        if self._first_s is None:
            self._first_s = record.frame.t_s
        decision, t_s = record.decision, record.telemetry.t_s - self._first_s
        mode = "-" if decision.mode is None else decision.mode.name
        if decision.mode is not self._mode:
            self._mode = decision.mode
            self._terminal.say(f"{t_s:6.1f} s  {mode:<10} {decision.reason}")
        if t_s - self._shown_s < 0.1:
            return
        self._shown_s = t_s
        estimate = decision.estimate
        distance = "      – m" if estimate is None else f"{math.hypot(*estimate.aircraft_in_bar_m):7.2f} m"
        command = decision.command
        self._terminal.status(
            f"{t_s:6.1f} s  {mode:<10} {distance} to the bar  pitch {command.pitch_percent:+4.0f} "
            f"roll {command.roll_percent:+4.0f} heave {command.heave_percent:+4.0f} yaw {command.yaw_percent:+4.0f} %"
            + (f"  {self._commander}" if self._commander else "")
        )

    def _watch(self) -> None:
        from shipland.vehicles.vehicle import Commanded

        vehicle: object = self._vehicle
        while vehicle is not None and not self._over.wait(_WATCHED_S):
            with suppress(Exception):  # what it says here is for the eye alone
                if isinstance(vehicle, Commanded) and vehicle.in_command != self._commander:
                    self._commander = vehicle.in_command
                    self._terminal.say(f"in command: {self._commander}")


_WATCHED_S = 0.1
"""How often who is in command is looked at."""
