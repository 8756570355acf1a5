"""Figures of deck motion and wind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shipland.figures import drawn
from shipland.frames import Array
from shipland.report.palette import BLUE, GREEN, GREY, VERMILION, unit
from shipland.sim.ship.deck_motion import DOF_NAMES

_DPI = 80
_AXIS_UNITS = ("m", "m", "m, down", "°", "°", "°")
RULE_NAMES = {"froude": "Froude: time / √scale", "length_only": "lengths only: time as at sea"}
_RULE_COLOURS = {"froude": unit(BLUE), "length_only": unit(VERMILION)}


def plot_case(path: Path, t_s: Array, deck: Array, wind_in_ned_mps: Array) -> None:
    """Six traces of the deck and three of the wind over it.

    Args:
        path: PNG to write; DataError when it cannot be.
        t_s: (N,) times.
        deck: (N, 6) motion [m, deg].
        wind_in_ned_mps: (N, 3) air velocity.
    """
    with drawn(path, (10.0, 11.0), _DPI) as figure:
        axes = figure.subplots(7, 1, sharex=True)
        for index, name in enumerate(DOF_NAMES):
            axes[index].plot(t_s, deck[:, index], color=unit(BLUE))
            axes[index].set_ylabel(f"{name} [{_AXIS_UNITS[index]}]")
        for index, name in enumerate(("north", "east", "down")):
            axes[6].plot(t_s, wind_in_ned_mps[:, index], color=unit((VERMILION, GREEN, GREY)[index]), label=name)
        axes[6].set_ylabel("air over deck [m/s]")
        axes[6].legend(loc="upper right", ncols=3)
        axes[6].set_xlabel("time [s]")
        axes[6].set_xlim(t_s[0], t_s[-1])
        figure.align_ylabels(axes)


def plot_headings(path: Path, panels: Mapping[str, Mapping[str, tuple[Array, Array]]], limit: Array) -> None:
    """Six traces, one column a heading, one curve a time rule, the motion base's limits where they are near.

    Args:
        path: PNG to write; DataError when it cannot be.
        panels: heading → time rule → times (N,) and motion (N, 6) [m, deg].
        limit: (6,) the motion base's limits [m, deg].
    """
    with drawn(path, (13.0, 11.0), _DPI) as figure:
        axes = figure.subplots(6, len(panels), sharex=True, sharey="row", squeeze=False)
        for column, (heading, rules) in enumerate(panels.items()):
            axes[0, column].set_title(f"waves from {heading}")
            axes[5, column].set_xlabel("time on the rig [s]")
            for index in range(6):
                for rule, (t_s, deck) in rules.items():
                    axes[index, column].plot(t_s, deck[:, index], color=_RULE_COLOURS[rule], label=RULE_NAMES[rule])
                    axes[index, column].set_xlim(t_s[0], t_s[-1])
        for index, name in enumerate(DOF_NAMES):
            axes[index, 0].set_ylabel(f"{name} [{_AXIS_UNITS[index]}]")
            largest = max(np.abs(deck[:, index]).max() for rules in panels.values() for _, deck in rules.values())
            if largest > 0.8 * limit[index]:
                for axis in axes[index]:
                    for sign in (-1.0, 1.0):
                        axis.axhline(sign * limit[index], color=unit(GREY), linestyle="--", linewidth=1.0)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
        figure.align_ylabels(axes[:, 0])
