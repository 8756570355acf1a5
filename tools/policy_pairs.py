"""Learned policies beside `horizon` on the same flights: rms of the touchdowns, and who lands in the square.

    shipland campaign --scenario rig-natops,ship-sea6 --pilot horizon,residual,learned \
        --set aircraft.loop.kind=attitude --set wind.mean_mps=5,9 --runs 200 --workers 2 --out out/policies
    python tools/policy_pairs.py out/policies [out/td3 …]

A touchdown counts by its components from the deck's centre, each at most 0.5 m; a flight without a
contact on the deck counts as 0.5 m either way, so that no pilot gains by giving up. The ratio's interval is a paired
bootstrap over flights. Several folders are merged; settings of the pilot (`guidance.…`) only name a row.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shipland.evaluation.campaign import CellResult, read_cells
from shipland.evaluation.landing import Landing
from shipland.evaluation.statistics import compare

MOST_M = 0.5
"""A component counts for no more, and so does each of a flight that did not touch the deck."""


def squares_m2(landings: list[Landing]) -> npt.NDArray[np.float64]:
    """(n,) squared distance from the deck's centre, components bounded."""
    offsets_m = np.array([(it.forward_m, it.starboard_m) if it.touched else (np.nan, np.nan) for it in landings])
    bounded_m = np.nan_to_num(np.minimum(np.abs(offsets_m), MOST_M), nan=MOST_M)
    return np.sum(np.square(bounded_m), axis=1)


def line(name: str, ours: CellResult, policy: CellResult, label: str) -> str:
    """One line of the table: a policy's cell beside that of `horizon`."""
    mine, theirs = ({it.seed: it for it in cell.landings} for cell in (ours, policy))
    seeds = sorted(mine.keys() & theirs.keys())
    first, second = [mine[seed] for seed in seeds], [theirs[seed] for seed in seeds]
    a, b = squares_m2(first), squares_m2(second)
    rng = np.random.default_rng(1)
    drawn = rng.integers(0, len(seeds), (5000, len(seeds)))
    low, high = np.quantile(np.sqrt(b[drawn].mean(1) / a[drawn].mean(1)), [0.025, 0.975])
    ok_a, ok_b = (np.array([it.success for it in some]) for some in (first, second))
    error_a, error_b = (np.array([it.error_m for it in some], dtype=float) for some in (first, second))
    pairing = compare(ok_a, ok_b, error_a, error_b, rng)
    parts = [
        name,
        label,
        str(len(seeds)),
        f"{100.0 * np.sqrt(a.mean()):.1f}",
        f"{100.0 * np.sqrt(b.mean()):.1f}",
        f"{np.sqrt(b.mean() / a.mean()):.2f} ({low:.2f}–{high:.2f})",
        f"{ok_a.sum()} → {ok_b.sum()}",
        f"{pairing.only_second}, {pairing.only_first}",
        f"{pairing.p_value:.2g}",
    ]
    return f"| {' | '.join(parts)} |"


def table_of(cells: list[CellResult]) -> Iterator[str]:
    """Markdown: every cell of a policy that `horizon` flew too."""
    heads = (
        "cell",
        "pilot",
        "flights",
        "`horizon`, rms [cm]",
        "policy, rms [cm]",
        "ratio",
        "in the square",
        "won, lost",
    )
    yield f"| {' | '.join(heads)} | McNemar p |"
    yield "|---|---|---:|---:|---:|---|---:|---:|---:|"
    met = [tuple(it for it in cell.settings if not it[0].startswith("guidance.")) for cell in cells]
    ours = {(cell.scenario, key): cell for cell, key in zip(cells, met, strict=True) if cell.pilot == "horizon"}
    for cell, key in zip(cells, met, strict=True):
        beside = ours.get((cell.scenario, key))
        if cell.pilot != "horizon" and beside is not None:
            words = [str(value) for name, value in cell.settings if name.startswith("guidance.")]
            conditions = ", ".join([cell.scenario, *(f"{name.split('.')[-1]} {value}" for name, value in key)])
            yield line(conditions, beside, cell, " ".join([cell.pilot, *words]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+", help="of `shipland campaign`")
    print("\n".join(table_of(read_cells(parser.parse_args().folders))))


if __name__ == "__main__":
    main()
