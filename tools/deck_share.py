"""How much of the bar's swing the deck's centre has, on a ship that carries its bar level over a deck that rolls.

    python tools/deck_share.py

The bar stands above the deck, so a roll moves it farther. Prints, along the ship's axes, the standard deviations of the
point that the bar defines and of the deck's centre, the share of the first that is best followed, and what is left.
"""

from __future__ import annotations

import numpy as np
import tyro
from rich.progress import track

from shipland.scenario.autonomy import drawn_ship
from shipland.scenario.scenario import load_scenario

AXES = ("forward", "starboard", "down")


def main(
    scenarios: tuple[str, ...] = ("ship-natops", "ship-sea5", "ship-sea6"), motions: int = 16, length_s: float = 60.0
) -> None:
    """Print the table.

    Args:
        scenarios: whose ship moves.
        motions: drawn of each.
        length_s: of each, ten instants a second.
    """
    print("| scenario | along | bar's point [cm] | deck's centre [cm] | apart [cm] | best share | left [cm] |")
    print("|---|---|---:|---:|---:|---:|---:|")
    for name in scenarios:
        scenario, shown, centres = load_scenario(name), [], []
        for seed in track(range(motions), name, transient=True):
            ship = drawn_ship(scenario, seed)
            for t_s in np.arange(0.0, length_s, 0.1):
                at = ship.at(float(t_s))
                to_ship = at.ned_from_ship.inverse()
                shown.append((to_ship @ at.ned_from_bar).apply(scenario.rig.deck_in_bar_m))
                centres.append((to_ship @ at.ned_from_deck).translation_m)
        for axis, bar, deck in zip(AXES, 100.0 * np.array(shown).T, 100.0 * np.array(centres).T, strict=True):
            share = float(bar @ deck / (bar @ bar))
            sizes = [float(np.std(it)) for it in (bar, deck, deck - bar, deck - share * bar)]
            print(
                f"| {name} | {axis} | {sizes[0]:.1f} | {sizes[1]:.1f} | {sizes[2]:.1f} | {share:.2f} | {sizes[3]:.1f} |"
            )


if __name__ == "__main__":
    tyro.cli(main)
