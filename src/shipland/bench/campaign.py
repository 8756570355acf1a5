"""Many landings of one scenario: a row each, resumable, on several cores, as table and picture."""

from __future__ import annotations

import csv
import dataclasses
import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shipland.bench.fly import fly_quietly
from shipland.bench.scenarios import CameraKind, PilotKind, load_scenario, scenario_table
from shipland.errors import ConfigError, DataError
from shipland.record.info import config_digest


@dataclass(frozen=True)
class Landing:
    """One landing of a campaign.

    Attributes:
        seed: of the flight.
        landed, in_square: the verdict.
        forward_m, starboard_m: touchdown point in `deck`.
        sink_mps: vertical speed against the deck just before contact, down positive.
        slide_mps: horizontal speed against the deck just before contact.
        tilt_deg: largest tilt against the deck after contact.
        slip_m: way over the deck until rest.
        force_n: largest contact force.
        time_s: first contact, from the start of the flight; the end of the flight where there was none.
        reason: the verdict in words.
    """

    seed: int
    landed: bool
    in_square: bool
    forward_m: float
    starboard_m: float
    sink_mps: float
    slide_mps: float
    tilt_deg: float
    slip_m: float
    force_n: float
    time_s: float
    reason: str

    @property
    def error_m(self) -> float:
        """Distance of the touchdown point from the deck's centre."""
        return float(np.hypot(self.forward_m, self.starboard_m))


@dataclass(frozen=True)
class CampaignRequest:
    """What `shipland campaign` was asked for."""

    scenario: str
    pilot: PilotKind
    camera: CameraKind
    first_seed: int
    count: int
    out: Path
    config: Path | None
    workers: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ConfigError(f"--count must be at least 1, got {self.count}")
        if self.workers < 1:
            raise ConfigError(f"--workers must be at least 1, got {self.workers}")


def land_once(table: dict[str, Any], pilot: PilotKind, camera: CameraKind, seed: int) -> Landing:
    """Fly one seed without leaving anything behind."""
    flown = fly_quietly(load_scenario(table), pilot, camera, seed)
    verdict = flown.verdict
    if verdict is None:
        nan = float("nan")
        return Landing(seed, False, False, nan, nan, nan, nan, nan, nan, nan, flown.result.t_s, flown.reason)
    velocity = verdict.relative_velocity_in_deck_mps
    return Landing(
        seed=seed,
        landed=verdict.landed,
        in_square=verdict.in_square,
        forward_m=float(verdict.touchdown_in_deck_m[0]),
        starboard_m=float(verdict.touchdown_in_deck_m[1]),
        sink_mps=float(velocity[2]),
        slide_mps=float(np.hypot(velocity[0], velocity[1])),
        tilt_deg=float(np.degrees(verdict.tilt_rad)),
        slip_m=verdict.slip_m,
        force_n=verdict.peak_contact_force_n,
        time_s=verdict.t_s,
        reason=verdict.reason,
    )


def run_campaign(request: CampaignRequest) -> Iterator[Landing]:
    """Yield the landings, first those found in `landings.csv`, then the others as they are flown and written.

    Raises:
        ConfigError: the scenario or the configuration is wrong.
        DataError: the folder holds a campaign of another configuration, or a broken table.
    """
    table = scenario_table(request.scenario, request.config)
    load_scenario(table)
    request.out.mkdir(parents=True, exist_ok=True)
    key = f"{config_digest(table)} {request.pilot} {request.camera}"
    path = request.out / "landings.csv"
    done = _read_done(path, key) if path.exists() else {}
    seeds = range(request.first_seed, request.first_seed + request.count)
    yield from (done[seed] for seed in seeds if seed in done)
    missing = [seed for seed in seeds if seed not in done]
    if not path.exists():
        path.write_text(f"# {key}\n{','.join(_COLUMNS)}\n", encoding="utf-8")
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, _COLUMNS)
        for landing in _fly_all(table, request, missing):
            writer.writerow(dataclasses.asdict(landing))
            file.flush()
            yield landing


def _fly_all(table: dict[str, Any], request: CampaignRequest, seeds: list[int]) -> Iterator[Landing]:
    if request.workers == 1 or len(seeds) < 2:
        for seed in seeds:
            yield land_once(table, request.pilot, request.camera, seed)
        return
    # spawn: an OpenGL context does not survive a fork
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(request.workers, context, initializer=_ignore_interrupt) as pool:
        futures = [pool.submit(land_once, table, request.pilot, request.camera, seed) for seed in seeds]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _ignore_interrupt() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


_COLUMNS = [field.name for field in dataclasses.fields(Landing)]


def _read_done(path: Path, key: str) -> dict[int, Landing]:
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    if head != f"# {key}":
        raise DataError(f"{path} holds landings of another configuration ({head[2:]}); give another --out")
    done = {}
    for number, row in enumerate(csv.DictReader(rows), start=3):
        try:
            values: dict[str, Any] = {name: _parse(name, row[name]) for name in _COLUMNS}
            done[int(row["seed"])] = Landing(**values)
        except (KeyError, TypeError, ValueError):
            raise DataError(f"{path}, line {number}: not a landing: {row}; remove the line to fly it again") from None
    return done


def _parse(name: str, text: str) -> bool | int | float | str:
    if name in ("landed", "in_square"):
        return {"True": True, "False": False}[text]
    if name == "seed":
        return int(text)
    return text if name == "reason" else float(text)


def table_of(landings: list[Landing]) -> str:
    """Markdown table, a row a seed, with a last line that sums up."""
    lines = [
        "| seed | error [m] | forward [m] | starboard [m] | sink [m/s] | slide [m/s] | slip [m] | tilt [°] | time [s] "
        "| verdict |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for landing in sorted(landings, key=lambda landing: landing.seed):
        numbers = (
            landing.error_m,
            landing.forward_m,
            landing.starboard_m,
            landing.sink_mps,
            landing.slide_mps,
            landing.slip_m,
        )
        cells = " | ".join(f"{number:.3f}" for number in numbers)
        lines.append(f"| {landing.seed} | {cells} | {landing.tilt_deg:.1f} | {landing.time_s:.1f} | {landing.reason} |")
    return "\n".join([*lines, "", summary_of(landings)])


def summary_of(landings: list[Landing]) -> str:
    """How many landed in the square, with the 95 % Clopper–Pearson interval, and the medians."""
    from scipy.stats import beta

    n, k = len(landings), sum(landing.in_square and landing.landed for landing in landings)
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    touched = [landing for landing in landings if np.isfinite(landing.forward_m)]
    line = f"{k} of {n} landed in the square (95 % interval {100 * low:.1f}–{100 * high:.1f} %)"
    if not touched:
        return line + "."
    errors = [landing.error_m for landing in touched]
    sinks = [landing.sink_mps for landing in touched]
    times = [landing.time_s for landing in touched]
    return (
        f"{line}; touchdown error median {np.median(errors):.3f} m, largest {max(errors):.3f} m; sink speed median "
        f"{np.median(sinks):.2f} m/s, largest {max(sinks):.2f} m/s; time to land median {np.median(times):.1f} s."
    )
