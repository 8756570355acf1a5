"""Studies of landings, as data: studies/campaigns/NAME.toml says what is flown, a row is a scenario and a pilot.

question = "Who lands, by scenario and stick?"
pilots = ["horizon", "paper"]
runs = 200                  # flights a row, seeds 1 … runs
minutes = 30
suite = "near"              # a packaged suite's cells, those alone that
vision = "geometric"        # sees, where it is given, and
[[cells]]                   # more of them, as in a suite
scenarios = ["rig-natops"]
set = ["wind.mean_mps=0,5"] # several values with commas between: a row each
label = "no telemetry"      # in place of the settings' own words
file = "examples/wake.toml" # laid over the scenario, and over it
config.start.distance_m = 10.0
[columns]                   # settings that have a column of their own: key and title
wind = ["wind.mean_mps", "wind [m/s]"]
[beside]                    # flown on the same seeds for a paired comparison
pilot = "horizon"
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from shipland.config import merge, read_toml
from shipland.evaluation.folder import campaign_key, folder_in, read_campaign
from shipland.evaluation.job import FlightJob, land_quietly
from shipland.evaluation.landing import Landing, as_text, row_of
from shipland.evaluation.leaderboard import rests_in_area
from shipland.evaluation.oracle import oracle_rate
from shipland.evaluation.suite import combinations, load_suite
from shipland.frames import Array
from shipland.record.info import config_digest
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table
from shipland.statistics import Interval, compare
from studies.harness import PARTS, ROOT, Case, Column, Row, Study, digest, estimate, share

WORDS = {"attitude": "tilt", "velocity": "speed"}
"""What a stick means, by the kind of the inner loop."""
ORACLE_MOTIONS = 40
MOST_M = 0.5
"""Most that a component of a touchdown counts in a comparison, and each of a flight that did not touch the deck."""
RESAMPLES = 5000
_EVERY = 10
"""Of the landings that earlier code flew, one in so many is flown again."""
COLUMNS = {
    "scenario": Column("scenario"),
    "settings": Column("set"),
    "pilot": Column("pilot"),
    "flights": Column("flights", ",d"),
    "success": Column("in the square [%] (95 % interval)", ".1f", 100.0),
    "square": Column("in the square [%]", ".0f", 100.0),
    "landed": Column("on its feet [%]", ".0f", 100.0),
    "rest": Column("at rest in the square [%]", ".0f", 100.0),
    "outside": Column("on its feet outside [%]", ".0f", 100.0),
    "bad": Column("bad contact [%] (95 % interval)", ".0f", 100.0),
    "never": Column("never touched [%]", ".0f", 100.0),
    "oracle_rate": Column("oracle rate [%]", ".1f", 100.0),
    "oracle_then": Column("oracle, then [%]", ".0f", 100.0),
    "error_m": Column("error median [cm]", ".1f", 100.0),
    "error_90_m": Column("error 90 % [cm]", ".1f", 100.0),
    "control_m": Column("control error median [cm]", ".1f", 100.0),
    "sink_mps": Column("sink [m/s]", ".2f"),
    "slide_mps": Column("slide [m/s]", ".2f"),
    "tilt_deg": Column("tilt [°]", ".0f"),
    "time_s": Column("time median [s]", ".0f"),
    "causes": Column("causes of the others"),
}
COMPARED = {
    "rms_beside_m": Column("beside, rms [cm]", ".1f", 100.0),
    "rms_m": Column("rms [cm]", ".1f", 100.0),
    "ratio": Column("ratio (95 % interval)", ".2f"),
    "landed_beside": Column("beside, on its feet [%]", ".0f", 100.0),
    "square_beside": Column("beside, in the square [%]", ".0f", 100.0),
    "won": Column("won", "d"),
    "lost": Column("lost", "d"),
    "p_value": Column("McNemar's p", ".2g"),
}


@dataclass(frozen=True)
class Cell:
    """One row's flights: a scenario with settings, texts `key=value`, and tables laid over it, seen by a vision."""

    case: Case
    scenario: str
    settings: tuple[str, ...]
    vision: str
    config: dict[str, Any] = field(default_factory=dict)

    def loaded(self, more: Sequence[str] = ()) -> Scenario:
        """What is flown, with more settings laid over it."""
        return load_scenario(merge(scenario_table(self.scenario, None, (*self.settings, *more)), self.config))


@lru_cache
def cells_of(path: Path) -> tuple[Cell, ...]:
    """The rows of a study, pilots innermost."""
    return tuple(_cells(read_toml(path)))


def _cells(table: dict[str, Any]) -> Iterator[Cell]:
    entries = [vars(entry) for entry in load_suite(table["suite"]).cells] if "suite" in table else []
    entries = [entry for entry in entries if table.get("vision", entry["vision"]) == entry["vision"]]
    own = {key: name for name, (key, _) in table.get("columns", {}).items()}
    words = WORDS | table.get("words", {})
    for entry in [*entries, *table.get("cells", [])]:
        vision, label = entry.get("vision", "geometric"), entry.get("label")
        for scenario in entry["scenarios"]:
            for settings in combinations(entry.get("set", ())):
                columns = {own[key]: words.get(value, value) for key, value in settings if key in own}
                rest = [f"{key.split('.')[-1]}={value}".replace('"', "") for key, value in settings if key not in own]
                said = ", ".join(rest) if label is None else label
                for pilot in entry.get("pilots", table["pilots"]):
                    case = {"scenario": scenario, **columns, "settings": words.get(said, said), "pilot": pilot}
                    texts = tuple(f"{key}={value}" for key, value in settings)
                    file = read_toml(ROOT / entry["file"]) if "file" in entry else {}
                    yield Cell(case, scenario, texts, vision, merge(file, entry.get("config", {})))


def fly(scenario: Scenario, pilot: str, vision: str, runs: int) -> list[Landing]:
    """Landings with the seeds 1 … runs, each flown once for all studies and kept in out/studies/flights.

    Those that earlier code flew are taken over where every tenth of them, flown again, comes out to the digit.
    """
    key = campaign_key(scenario, pilot, vision)
    by = key | {"policies": digest([ROOT / "src" / "shipland" / "weights" / "policies"])}
    out = PARTS / "flights" / config_digest(by | dict.fromkeys(("command", "version", "source"), ""))
    folder = folder_in(out / key["source"], key)  # not claimed: whoever flies a seed too appends the same row

    def keep(landing: Landing) -> None:
        if landing.seed not in folder.done:
            folder.done[landing.seed] = landing
            folder.append(landing)

    def flown(seed: int) -> Landing:
        if seed not in folder.done:
            keep(land_quietly(FlightJob(scenario, pilot, vision, seed)))
        return folder.done[seed]

    seeds = range(1, runs + 1)
    earlier = [] if folder.done.keys() >= set(seeds) else _of_earlier_code(out, key["source"])
    if all(_written(flown(landing.seed)) == _written(landing) for landing in earlier[::_EVERY]):
        for landing in earlier:
            keep(landing)
    if folder.done.keys() >= set(seeds):
        land_quietly(FlightJob(scenario, pilot, vision, 1))  # it imports what the rows depend on
    return [flown(seed) for seed in seeds]


def _written(landing: Landing) -> list[str]:
    return [str(value) for value in as_text(row_of(landing)).values()]


def _of_earlier_code(out: Path, source: str) -> list[Landing]:
    """The landings kept last of another digest of the source, by seed; none where there are none."""
    tables = sorted(out.glob("*/landings.csv"), key=lambda path: path.stat().st_mtime_ns)
    others = [table.parent for table in tables if table.parent.name != source]
    return sorted(read_campaign(others[-1]), key=lambda landing: landing.seed) if others else []


def measure(case: Case, runs: int, *, path: Path) -> Row:
    """Fly a row."""
    cell, table = next(cell for cell in cells_of(path) if cell.case == case), read_toml(path)
    scenario, pilot = cell.loaded(), str(case["pilot"])
    landings = fly(scenario, pilot, cell.vision, runs)
    row = figures(scenario, landings, table.get("oracle_motions", ORACLE_MOTIONS))
    if "beside" in table:
        other = cell.loaded(table["beside"].get("set", ()))
        row |= compared(landings, fly(other, table["beside"].get("pilot", pilot), cell.vision, runs))
    return row


def figures(scenario: Scenario, landings: Sequence[Landing], oracle_motions: int) -> dict[str, Any]:
    """A row of the table; medians are of the flights that touched the deck."""
    count, touched = len(landings), [it for it in landings if it.touched]
    rate = None
    if oracle_motions:
        rng, airframe = np.random.default_rng(1), scenario.aircraft.airframe
        rate = oracle_rate(scenario.ship, scenario.rig, airframe, oracle_motions, rng).share
    good, landed = sum(it.success for it in landings), sum(it.landed for it in landings)
    causes = Counter(it.cause for it in landings if not it.success)
    errors_m = [it.error_m for it in touched]
    control_m = [float(np.hypot(it.control_forward_m, it.control_starboard_m)) for it in touched]
    return {
        "flights": count,
        "success": share(good, count),
        "square": good / count,
        "landed": landed / count,
        "rest": sum(rests_in_area(it, scenario.rig) for it in landings) / count,
        "outside": (landed - good) / count,
        "bad": share(sum(it.bad for it in landings), count),
        "never": sum(it.refused for it in landings) / count,
        "oracle_rate": rate,
        "oracle_then": sum(bool(it.oracle_in_square) for it in touched) / len(touched) if touched else None,
        "error_m": _quantile(errors_m, 0.5),
        "error_90_m": _quantile(errors_m, 0.9),
        "control_m": _quantile(control_m, 0.5),
        **{name: _quantile([getattr(it, name) for it in touched], 0.5) for name in ("sink_mps", "slide_mps")},
        **{name: _quantile([getattr(it, name) for it in touched], 0.5) for name in ("tilt_deg", "time_s")},
        "causes": ", ".join(f"{number} {cause}" for cause, number in causes.most_common()),
    }


def _quantile(values: Sequence[float], of: float) -> float | None:
    return float(np.quantile(values, of)) if values else None


def squares_m2(landings: Sequence[Landing]) -> Array:
    """(n,) squared distance from the deck's centre, components bounded, so that no pilot gains by giving up."""
    offsets_m = np.array([(it.forward_m, it.starboard_m) for it in landings])
    return np.asarray(np.sum(np.square(np.nan_to_num(np.minimum(np.abs(offsets_m), MOST_M), nan=MOST_M)), axis=1))


def compared(landings: Sequence[Landing], beside: Sequence[Landing]) -> dict[str, Any]:
    """The same seeds flown in two ways: rms of the touchdowns, paired bootstrap of their ratio, who alone lands."""
    rng = np.random.default_rng(1)
    mine, other = squares_m2(landings), squares_m2(beside)
    drawn = rng.integers(0, len(mine), (RESAMPLES, len(mine)))
    low, high = np.quantile(np.sqrt(mine[drawn].mean(1) / other[drawn].mean(1)), [0.025, 0.975])
    ok, other_ok = (np.array([it.success for it in some]) for some in (landings, beside))
    errors_m, other_m = (np.array([it.error_m for it in some], dtype=float) for some in (landings, beside))
    pairing = compare(ok, other_ok, errors_m, other_m, rng)
    return {
        "rms_beside_m": float(np.sqrt(other.mean())),
        "rms_m": float(np.sqrt(mine.mean())),
        "ratio": estimate(float(np.sqrt(mine.mean() / other.mean())), Interval(float(low), float(high))),
        "landed_beside": float(np.mean([it.landed for it in beside])),
        "square_beside": float(other_ok.mean()),
        "won": pairing.only_first,
        "lost": pairing.only_second,
        "p_value": pairing.p_value,
    }


def landings_study(path: Path) -> Study:
    """The study of a TOML file.

    Raises:
        ConfigError: the file is broken, or it names what does not exist.
    """
    table = read_toml(path)
    own = {name: Column(title) for name, (_, title) in table.get("columns", {}).items()}
    return Study(
        question=table["question"],
        columns={"scenario": COLUMNS["scenario"], **own, **COLUMNS, **(COMPARED if "beside" in table else {})},
        cases=partial(_cases, path),
        measure=partial(measure, path=path),
        runs=table["runs"],
        minutes=table["minutes"],
        files=tuple(sorted({entry["file"] for entry in table.get("cells", []) if "file" in entry})),
    )


def _cases(path: Path) -> Sequence[Case]:
    return [cell.case for cell in cells_of(path)]
