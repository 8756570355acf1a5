"""What flights into hazards touched: a row a cell of the suite `hazards`, and whether a bad contact could be avoided.

    shipland campaign hazards --pilot horizon --runs 100 --oracle-motions 0 --out out/hazards
    python tools/hazards.py out/hazards                # the table
    python tools/hazards.py out/hazards --safe-action  # and each bad contact flown again

A *bad contact* is one with anything but the deck, or with the deck beyond a limit. A *safe action* existed when the
same flight, its faults with it, touches nothing once the pilot does no more than climb straight up, held by the
vehicle, from some time before the contact on; that time is the shortest of those tried. Leaves hazards.md in the
folder.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from fault_causes import Failed, failed_in
from rich.console import Console
from rich.progress import track

from shipland.errors import DataError, ShiplandError
from shipland.evaluation.campaign import CellResult, read_cells
from shipland.evaluation.landing import Landing
from shipland.evaluation.statistics import share_interval
from shipland.record.reader import read_log

LIMITS = ("hard", "drift", "tilt", "slip")
"""Causes of flights that touched the deck beyond a limit."""
BEFORE_S = (0.5, 1.0, 2.0, 4.0)
"""How long before a bad contact a climb is tried."""
WATCHED_S = 8.0
"""So long after its begin a climb has left the ship."""
_LAST_WORDS = 60
"""Cycles before the end of a flight that never touched, among which its commonest reason is sought."""


@dataclass(frozen=True)
class Outcome:
    """What a flight came to: one of the kinds below, and what it touched or why it did not, in words."""

    kind: str
    words: str = ""


IN_SQUARE, OUTSIDE, NEVER = "in the square", "outside", "never touched"
BEYOND_LIMIT, STRUCK = "beyond a limit", "struck"
BAD = (BEYOND_LIMIT, STRUCK)


def outcome_of(landing: Landing) -> Outcome:
    """Of a landing of the campaign."""
    if landing.landed:
        return Outcome(IN_SQUARE if landing.in_square else OUTSIDE)
    if landing.reason.startswith("no touchdown"):
        return Outcome(NEVER, landing.cause)
    return Outcome(BEYOND_LIMIT if landing.cause in LIMITS else STRUCK, landing.cause)


def last_words(path: Path) -> str:
    """The commonest reason, numbers left out, of a flight's last cycles by its log."""
    try:
        records = read_log(path).records[-_LAST_WORDS:]
    except DataError:
        return ""
    said = Counter(re.sub(r"-?\d+(\.\d+)?", "…", record.decision.reason) for record in records)
    return said.most_common(1)[0][0] if said else ""


def climbs_clear(failed: Failed) -> float | None:
    """How long before its bad contact a climb avoids it, the shortest of those tried [s]; None where none does."""
    for before_s in BEFORE_S:
        from_s = max(failed.landing.time_s - before_s, 0.0)
        climbed = failed.flown_again(failed.faults, from_s, from_s + WATCHED_S)
        if climbed.reason.startswith("no touchdown"):
            return before_s
    return None


def row_of(cell: CellResult, actions: dict[int, float | None] | None) -> str:
    """A row of the table."""
    outcomes = {landing.seed: outcome_of(landing) for landing in cell.landings}
    count = Counter(outcome.kind for outcome in outcomes.values())
    bad, flown = sum(count[kind] for kind in BAD), len(outcomes)
    low, high = share_interval(bad, flown)
    what = ", ".join(f"{key.split('.')[-1]}={value}" for key, value in cell.settings)
    row = [cell.scenario, what, str(flown), str(count[IN_SQUARE]), str(count[OUTSIDE])]
    for kind in BAD:
        words = Counter(outcome.words for outcome in outcomes.values() if outcome.kind == kind)
        row.append(f"{count[kind]}{_listed(words)}")
    row.append(f"{100.0 * low:.0f}–{100.0 * high:.0f} %")
    never = [seed for seed, outcome in outcomes.items() if outcome.kind == NEVER]
    why = Counter(words for seed in never if (words := last_words(cell.logs / f"{seed}.mcap")))
    row += [str(len(never)) + _listed(Counter(outcomes[seed].words for seed in never))]
    row.append(why.most_common(1)[0][0] if why else "")
    if actions is not None:
        found = [before_s for before_s in actions.values() if before_s is not None]
        row.append(f"{len(found)} of {len(actions)}{f' ({max(found):g} s)' if found else ''}" if actions else "")
    return f"| {' | '.join(text.replace('|', '/') for text in row)} |"


def _listed(words: Counter[str]) -> str:
    return f" ({', '.join(f'{n} {word}' for word, n in words.most_common())})" if words else ""


def table_of(cells: Sequence[CellResult], actions: dict[str, dict[int, float | None]] | None) -> list[str]:
    """Markdown, a line each."""
    head = ["scenario", "laid over it", "flights", IN_SQUARE, OUTSIDE, BEYOND_LIMIT, "struck anything else"]
    head += ["bad contacts, 95 %", NEVER, "their last word"]
    if actions is not None:
        head.append("a climb avoids it (from at most)")
    lines = [f"| {' | '.join(head)} |", "|---|---|" + "---:|" * 3 + "---|" * (len(head) - 5)]
    return lines + [row_of(cell, None if actions is None else actions.get(cell.name, {})) for cell in cells]


def main(folder: tyro.conf.Positional[Path], *, safe_action: bool = False) -> None:
    """Print the table.

    Args:
        folder: of `shipland campaign hazards`.
        safe_action: fly every bad contact again, climbing.
    """
    console, actions = Console(), None
    if safe_action:
        bad = [failed for failed in failed_in(folder) if outcome_of(failed.landing).kind in BAD]
        actions = {failed.cell: dict[int, float | None]() for failed in bad}
        for failed in track(bad, "flying again", console=console, disable=not console.is_terminal):
            actions[failed.cell][failed.landing.seed] = climbs_clear(failed)
    text = "\n".join(table_of(read_cells([folder]), actions))
    (folder / "hazards.md").write_text(text + "\n", encoding="utf-8")
    console.print(text, soft_wrap=True, highlight=False, markup=False)


if __name__ == "__main__":
    try:
        tyro.cli(main, description=__doc__)
    except ShiplandError as error:
        raise SystemExit(f"hazards: {error}") from None
