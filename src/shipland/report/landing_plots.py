"""Pictures of many landings: where they touched the deck, and at which instants of its motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shipland.frames import Array
from shipland.report.palette import BLUE, GREEN, VERMILION, unit
from shipland.report.plots import PLOT_STYLE, PlotParameters, draw_pad, new_figure, save_figure
from shipland.rig import Rig


@dataclass(frozen=True)
class Touchdowns:
    """Landings of a campaign.

    Attributes:
        t_s: (n,) first contact, on the time axis of the deck's motion.
        place_in_deck_m: (n, 2) forward, starboard; NaN where there was no contact.
        landed: (n,) came to rest on its feet on the deck, in the landing area.
    """

    t_s: Array
    place_in_deck_m: Array
    landed: npt.NDArray[np.bool_]

    def __post_init__(self) -> None:
        n = len(self.t_s)
        if np.shape(self.place_in_deck_m) != (n, 2) or np.shape(self.landed) != (n,):
            raise ValueError(
                f"Touchdowns wants shapes ({n}, 2) and ({n},) for {n} times, got {np.shape(self.place_in_deck_m)} "
                f"and {np.shape(self.landed)}"
            )


@dataclass(frozen=True)
class DeckTrace:
    """The deck's motion that the landings met.

    Attributes:
        t_s: (m,) increasing.
        roll_rad, pitch_rad: (m,).
        heave_m: (m,) up.
    """

    t_s: Array
    roll_rad: Array
    pitch_rad: Array
    heave_m: Array


def plot_touchdowns(path: Path, touchdowns: Touchdowns, rig: Rig, title: str, parameters: PlotParameters) -> None:
    """Dots on deck and landing area, with median and largest distance; DataError when it cannot be written."""
    import matplotlib as mpl

    place_m, landed = touchdowns.place_in_deck_m, touchdowns.landed
    touched = np.isfinite(place_m).all(axis=1)
    with mpl.rc_context(PLOT_STYLE):
        figure = new_figure(6.2, 6.6)
        axes = figure.add_subplot()
        draw_pad(axes, rig)
        for chosen, colour, marker, name in (
            (touched & landed, BLUE, "o", f"landed in the {rig.landing_area}"),
            (touched & ~landed, VERMILION, "X", "not"),
        ):
            if chosen.any():
                axes.scatter(
                    place_m[chosen, 1], place_m[chosen, 0], s=34, marker=marker, color=unit(colour), alpha=0.7,
                    edgecolor="white", linewidth=0.6, label=f"{int(chosen.sum())} {name}", zorder=3,
                )  # fmt: skip
        lines = [f"{int(landed.sum())} of {len(landed)} landed in the {rig.landing_area}"]
        if touched.any():
            error_m = np.linalg.norm(place_m[touched], axis=1)
            lines.append(
                f"median {100 * np.median(error_m):.1f} cm, largest {100 * error_m.max():.1f} cm from the centre"
            )
            axes.legend(loc="lower left", bbox_to_anchor=(0.1, 0.1))
        if not touched.all():
            lines.append(f"{int((~touched).sum())} without contact")
        figure.suptitle(title, fontsize=13, fontweight="bold")
        axes.set_title("\n".join(lines), fontweight="normal")
        save_figure(figure, path, parameters.dpi)


def plot_instants(path: Path, trace: DeckTrace, touchdowns: Touchdowns, title: str, parameters: PlotParameters) -> None:
    """Roll, pitch and heave over time with a dot at each touchdown; DataError when the file cannot be written.

    [Lee2022, §Results] shows its landings at random instants of the deck's motion in this way.
    """
    import matplotlib as mpl

    with mpl.rc_context(PLOT_STYLE):
        figure = new_figure(10.4, 6.4)
        figure.suptitle(title, fontsize=13, fontweight="bold")
        curves = (
            ("roll [°]", np.degrees(trace.roll_rad)),
            ("pitch [°]", np.degrees(trace.pitch_rad)),
            ("heave, up [m]", trace.heave_m),
        )
        grid = figure.add_gridspec(3, 2, width_ratios=[6, 1])
        for row, (name, values) in enumerate(curves):
            axes = figure.add_subplot(grid[row, 0])
            side = figure.add_subplot(grid[row, 1], sharey=axes)
            axes.set_title(name)
            axes.plot(trace.t_s, values, color="#777777", linewidth=1.0)
            side.hist(values, bins=12, density=True, orientation="horizontal", color="#c8c8c8")
            for chosen, colour, marker in ((touchdowns.landed, GREEN, "o"), (~touchdowns.landed, VERMILION, "X")):
                met = np.interp(touchdowns.t_s[chosen], trace.t_s, values)
                label = f"{int(chosen.sum())} {'landed' if marker == 'o' else 'not'}"
                if chosen.any():
                    axes.plot(
                        touchdowns.t_s[chosen], met, color=unit(colour), marker=marker, linestyle="none",
                        markersize=5.5, markeredgecolor="white", label=label,
                    )  # fmt: skip
            touched = np.interp(touchdowns.t_s[np.isfinite(touchdowns.t_s)], trace.t_s, values)
            if len(touched):
                side.hist(touched, bins=12, density=True, orientation="horizontal", histtype="step", color=unit(GREEN))
            axes.set_xlim(float(trace.t_s[0]), float(trace.t_s[-1]))
            side.tick_params(labelleft=False, labelbottom=False)
            side.set_title("share" if row == 0 else "")
            if row == 2:
                axes.set_xlabel("time [s]")
                side.set_xlabel("grey: motion\ngreen: touchdowns", fontsize=8.5)
            else:
                axes.tick_params(labelbottom=False)
            if row == 0:
                axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        save_figure(figure, path, parameters.dpi)
