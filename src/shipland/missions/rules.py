"""What counts as a landing, by several published rules, computed on the same flight."""

from __future__ import annotations

from collections.abc import Callable

from shipland.missions.landing import Landing

HALF_DECK_M = 0.61
"""Half the deck's side [Lee2022, §Experimental Setup]."""

RULES: dict[str, Callable[[Landing], bool]] = {
    "ours: at rest on its feet in the 0.35 m square, within every limit": lambda it: it.landed and it.in_square,
    "first contact in the 0.35 m square": lambda it: max(abs(it.forward_m), abs(it.starboard_m)) <= 0.175,
    "first contact within 0.2 m of the centre": lambda it: it.error_m <= 0.2,
    "first contact within 0.5 m of the centre": lambda it: it.error_m <= 0.5,
    "under 1 m horizontally, tilt under 10°, sink under 1.5 m/s": lambda it: (
        it.error_m < 1.0 and it.tilt_deg < 10.0 and it.sink_mps < 1.5
    ),
    "any first contact on the deck": lambda it: max(abs(it.forward_m), abs(it.starboard_m)) <= HALF_DECK_M,
}
"""By name; a comparison with NaN (no touchdown) is false, so no contact is no landing by any rule."""


def rules_table(landings: list[Landing]) -> str:
    """Markdown: how many of the landings each rule counts."""
    lines = ["| rule | landings |", "|---|---:|"]
    lines += [f"| {name} | {sum(map(rule, landings))} of {len(landings)} |" for name, rule in RULES.items()]
    return "\n".join(lines)
