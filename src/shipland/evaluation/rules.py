"""Rules of success from several publications, computed on the same flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from shipland.evaluation.landing import Landing
from shipland.rig import Rig


def rules(rig: Rig) -> dict[str, Callable[[Landing], bool]]:
    """By name; a comparison with NaN is false, so a flight without contact is no landing by any rule."""
    deck_m, area = rig.deck_size_m, f"{rig.landing_square_m:g} m {rig.landing_area}"

    def within(landing: Landing, side_m: float) -> bool:
        return max(abs(landing.forward_m), abs(landing.starboard_m)) <= 0.5 * side_m

    return {
        f"ours: at rest on its feet in the {area}, within every limit": lambda it: it.success,
        f"first contact in the {area}": lambda it: rig.in_landing_area(it.forward_m, it.starboard_m),
        "first contact within 0.2 m of the centre": lambda it: it.error_m <= 0.2,
        "first contact within 0.5 m of the centre": lambda it: it.error_m <= 0.5,
        "under 1 m horizontally, tilt under 10°, sink under 1.5 m/s": lambda it: (
            it.error_m < 1.0 and it.tilt_deg < 10.0 and it.sink_mps < 1.5
        ),
        "any first contact on the deck": lambda it: within(it, deck_m),
    }


def rules_table(landings: Sequence[Landing], rig: Rig) -> str:
    """Markdown: how many of the landings each rule counts."""
    lines = ["| rule | landings |", "|---|---:|"]
    lines += [f"| {name} | {sum(map(rule, landings))} of {len(landings)} |" for name, rule in rules(rig).items()]
    return "\n".join(lines)
