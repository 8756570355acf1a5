"""Figures in the house's style, without a display: matplotlib is imported where one is drawn."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipland.files import replacing, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#d8d8d8",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.4,
    "hatch.linewidth": 0.5,
    "legend.fontsize": 9.0,
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "xtick.labelsize": 9.0,
    "ytick.labelsize": 9.0,
}


def new_figure(width_in: float, height_in: float) -> Figure:
    """A figure without a display and without pyplot's registry; notebooks show it."""
    from matplotlib.figure import Figure

    class Shown(Figure):
        def _repr_png_(self) -> bytes:
            return png_of(self)

    return Shown(figsize=(width_in, height_in), layout="constrained")


def png_of(figure: Figure, dpi: int = 80) -> bytes:
    """The picture as a PNG file's bytes."""
    data = BytesIO()
    figure.savefig(data, dpi=dpi, metadata={"Software": None})
    return data.getvalue()


def save_figure(figure: Figure, path: Path, dpi: int) -> None:
    """Write a PNG whose bytes depend on the picture only; DataError when it cannot be written."""
    with writing(path, "plot"), replacing(path) as beside:
        figure.savefig(beside, dpi=dpi, format="png", metadata={"Software": None})


@contextmanager
def styled(size_in: tuple[float, float], *, grid: bool = True) -> Iterator[Figure]:
    """A figure in the house's style, to be drawn within the block."""
    import matplotlib as mpl

    with mpl.rc_context(_STYLE | {"axes.grid": grid}):
        yield new_figure(*size_in)


@contextmanager
def drawn(path: Path, size_in: tuple[float, float], dpi: int = 80, *, grid: bool = True) -> Iterator[Figure]:
    """A `styled` figure, written as `save_figure` does once the block has drawn it."""
    with styled(size_in, grid=grid) as figure:
        yield figure
        save_figure(figure, path, dpi)
