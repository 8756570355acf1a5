"""Flies a sample of a bundle's rows again with this installation and compares every number as it is stored."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import comb
from pathlib import Path

import numpy as np

from shipland.errors import DataError
from shipland.evaluation.bundle import Bundle, cell_of, texts_of
from shipland.evaluation.campaign import processes
from shipland.evaluation.folder import campaign_key, source_digest
from shipland.evaluation.job import FlightJob
from shipland.files import json_bytes, json_of, read_text, write_atomically
from shipland.progress import followed
from shipland.stopping import stop_requests
from shipland.version import code_version


@dataclass(frozen=True)
class Verified:
    """How many of a bundle's flights were flown again, all equal, the zip's SHA-256, and this code's version.

    `seeds_checked` as of `Bundle`.
    """

    flights: int
    again: int
    bundle: str
    version: str
    seeds_checked: bool = False

    def missed(self, share: float) -> float:
        """How likely the sample held none of the altered rows, were this share of all rows altered."""
        altered = max(1, round(share * self.flights))
        return comb(self.flights - altered, self.again) / comb(self.flights, self.again)


def check_code(bundle: Bundle) -> None:
    """Nothing where the bundle was flown with this code; DataError says what to install."""
    about = bundle.about
    if about["source"] != source_digest():
        raise DataError(
            f"flown with the code {about['source']} ({about['version']}), here is {source_digest()} "
            f"({code_version()}): install that version to fly it again"
        )


@contextmanager
def own_code(bundle: Bundle) -> Iterator[None]:
    """Modules of the bundle's `code/` come before all others; they run when a flight asks for them."""
    place = str(bundle.folder / "code")
    sys.path.insert(0, place)
    try:
        yield
    finally:
        sys.path.remove(place)
        for name in bundle.about["own_code"]:
            sys.modules.pop(name.partition(":")[0], None)


def fly_again(bundle: Bundle, sample: int, rng: np.random.Generator, workers: int) -> Verified:
    """Fly a sample of the rows again, 0 for all of them; own code must be within reach (`own_code`).

    DataError where a row differs, a flight was lost, or own code or weights are not those that flew.
    """
    flights = bundle.flights
    count = min(sample, len(flights)) if sample else len(flights)
    chosen = [flights[index] for index in sorted(rng.choice(len(flights), count, replace=False).tolist())]
    submitted = {cell.name: cell for cell, _ in chosen}
    cells = {name: cell_of(cell) for name, cell in submitted.items()}
    for name, cell in cells.items():
        found, there = campaign_key(cell.scenario, cell.pilot, cell.vision), submitted[name].key
        for word in ("configuration", "weights", "own_code"):
            if found[word] != there[word]:
                raise DataError(f"{name}: its {word} here is {found[word]}, in the bundle {there[word]}")
    rows = {(cell.name, landing.seed): texts_of(landing) for cell, landing in chosen}
    jobs = [
        FlightJob(cells[name].scenario, cells[name].pilot, cells[name].vision, seed, cell=name) for name, seed in rows
    ]
    lost: list[str] = []

    def lose(flight: FlightJob, reason: str) -> None:
        lost.append(f"{flight.cell}, seed {flight.seed}: flown again it was lost: {reason}")

    with stop_requests():
        flown = processes(min(workers, len(jobs)))(jobs, lambda *_: None, lose)
        for flight, landing in followed(flown, "flown again, all equal so far", len(jobs)):
            stored = rows[flight.cell, flight.seed]
            for name, again in texts_of(landing).items():
                if stored[name] != again:
                    raise DataError(
                        f"{flight.cell}, seed {flight.seed}: {name} is {stored[name]} in the bundle, {again} flown "
                        f"again{_other_libraries(bundle)}"
                    )
    if lost:
        raise DataError(lost[0])
    return Verified(len(flights), count, bundle.digest, code_version(), bundle.seeds_checked)


def _other_libraries(bundle: Bundle) -> str:
    """Which libraries differ, as that alone may change a flight's last digits."""
    key = bundle.cells[0].key
    here = campaign_key(cell_of(bundle.cells[0]).scenario, "paper", "geometric")
    differ = [f"{name} {there}, here {here['libraries'][name]}" for name, there in key["libraries"].items()
              if here["libraries"].get(name) != there]  # fmt: skip
    if key["python"] != here["python"]:
        differ.append(f"Python {key['python']}, here {here['python']}")
    return f" (it was flown with {'; '.join(differ)}, which may be the cause)" if differ else ""


def receipt_of(path: Path) -> Path:
    """Beside a bundle: what `write_receipt` leaves."""
    return path.with_suffix(".verified.json")


def write_receipt(path: Path, verified: Verified) -> None:
    """Note beside a bundle that it was verified."""
    write_atomically(receipt_of(path), json_bytes(vars(verified)))


def read_receipt(bundle: Bundle) -> Verified | None:
    """The note beside a bundle, where it is about this very file."""
    try:
        found = Verified(**json_of(read_text(receipt_of(bundle.path))))
    except (DataError, TypeError, ValueError):
        return None
    return found if found.bundle == bundle.digest else None
