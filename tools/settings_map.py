"""Draw where a pilot lands over MaxTilt, wind, the ship's way and what a stick means.

    shipland campaign settings --pilot paper --runs 5 --workers 2 --out out/settings
    python tools/settings_map.py --results out/settings --picture out/settings/map.png

Prints the shares by inner loop and wind; each number in the picture is of the flights of one cell.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import tyro

mpl.use("Agg")
from matplotlib import pyplot as plt

from shipland.evaluation.campaign import read_cells
from shipland.evaluation.landing import row_of

LOOPS = {
    ("attitude", 0.0): "stick = tilt",
    ("attitude", 10.0): "stick = tilt, wind trimmed (10 s)",
    ("velocity", 0.0): "stick = speed",
}
"""What a stick means and the time constant of the wind trim [s]."""


def main(results: Path, picture: Path = Path("out/settings-map.png")) -> None:
    """Draw the flights of `shipland campaign settings`.

    Args:
        results: its folder.
        picture: file to write.
    """
    cells: dict[tuple[Any, ...], list[dict[str, Any]]] = defaultdict(list)
    for cell in read_cells([results]):
        trim_s = float(dict(cell.settings).get("aircraft.loop.wind_trim_s", 0.0))
        for row in map(row_of, cell.landings):
            cells[(row["loop"], trim_s), row["ship_mps"], row["max_tilt_deg"], row["wind_mps"]].append(row)
    ways, tilts, winds = (sorted({key[i] for key in cells}) for i in (1, 2, 3))
    figure, axes = plt.subplots(len(ways), len(LOOPS), figsize=(10.5, 2.6 * len(ways)), squeeze=False)
    for column, (loop, title) in enumerate(LOOPS.items()):
        for line, way in enumerate(ways):
            axis = axes[line, column]
            share = np.full((len(tilts), len(winds)), np.nan)
            for y, tilt in enumerate(tilts):
                for x, wind in enumerate(winds):
                    rows = cells.get((loop, way, tilt, wind), [])
                    if not rows:
                        continue
                    square, deck = (sum(bool(row[key]) for row in rows) for key in ("success", "landed"))
                    share[y, x] = square / len(rows)
                    axis.text(x, y, f"{square} ({deck})", ha="center", va="center", fontsize=7)
            axis.imshow(share, vmin=0.0, vmax=1.2, cmap="YlGn", origin="lower", aspect="auto")
            axis.set_xticks(range(len(winds)), [f"{wind:g}" for wind in winds])
            axis.set_yticks(range(len(tilts)), [f"{tilt:g}" for tilt in tilts])
            if line == 0:
                axis.set_title(title, fontsize=9)
            if column == 0:
                axis.set_ylabel(f"ship {way:g} m/s\nMaxTilt [°]", fontsize=8)
            if line == len(ways) - 1:
                axis.set_xlabel("mean wind [m/s]", fontsize=8)
            axis.tick_params(labelsize=7)
    number = max(map(len, cells.values()))
    figure.suptitle(f"In the square (on its feet), of {number} flights a cell", fontsize=10)
    figure.tight_layout()
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=90)
    print("| stick means | ship [m/s] | " + " | ".join(f"wind {wind:g} m/s" for wind in winds) + " |")
    print("|---|---:|" + "---:|" * len(winds))
    for loop, title in LOOPS.items():
        for way in ways:
            texts = []
            for wind in winds:
                rows = [row for key, some in cells.items() if key[:2] == (loop, way) and key[3] == wind for row in some]
                square, deck = (sum(bool(row[key]) for row in rows) for key in ("success", "landed"))
                texts.append(f"{square} ({deck}) of {len(rows)}")
            print(f"| {title} | {way:g} | " + " | ".join(texts) + " |")


if __name__ == "__main__":
    tyro.cli(main)
