"""Pictures of curves, as training and evaluation leave them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from shipland.files import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@contextmanager
def panels(path: Path, count: int, size_in: tuple[float, float]) -> Iterator[list[Axes]]:
    """So many panels side by side, written to `path` whole once the block has drawn them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size_in, layout="constrained")
    drawn = list(figure.subplots(1, count))
    yield drawn
    for axes in drawn:
        axes.grid(alpha=0.3)
    with replacing(path) as beside:
        figure.savefig(beside, dpi=110, format="png")
