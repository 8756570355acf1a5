"""Names and colours of modes and curves, the same in pictures, plots and videos; safe for the colour-blind."""

from __future__ import annotations

from shipland.messages import Mode

Rgb = tuple[int, int, int]

# Okabe and Ito, "Color Universal Design" (2008).
BLACK: Rgb = (0, 0, 0)
ORANGE: Rgb = (230, 159, 0)
SKY: Rgb = (86, 180, 233)
GREEN: Rgb = (0, 158, 115)
YELLOW: Rgb = (240, 228, 66)
BLUE: Rgb = (0, 114, 178)
VERMILION: Rgb = (213, 94, 0)
PURPLE: Rgb = (204, 121, 167)
GREY: Rgb = (130, 130, 130)

MODE_COLOURS: dict[Mode, Rgb] = {
    Mode.SEARCH: PURPLE,
    Mode.TRACK_SHIP: SKY,
    Mode.TRACK_BAR: ORANGE,
    Mode.APPROACH: BLUE,
    Mode.LAND: GREEN,
    Mode.NO_VISION: VERMILION,
    Mode.GO_AROUND: YELLOW,
    Mode.DONE: GREY,
}

MODE_NAMES: dict[Mode, str] = {
    Mode.SEARCH: "search",
    Mode.TRACK_SHIP: "4 track ship",
    Mode.TRACK_BAR: "3 track bar",
    Mode.APPROACH: "2 approach",
    Mode.LAND: "1 land",
    Mode.NO_VISION: "5 no vision",
    Mode.GO_AROUND: "go around",
    Mode.DONE: "done",
}
"""Names of the modes, with the numbers of [Lee2022]."""


def mode_colour(mode: Mode | None) -> Rgb:
    """The colour of a mode; grey for a pilot without modes."""
    return GREY if mode is None else MODE_COLOURS[mode]


def mode_name(mode: Mode | None) -> str:
    """The name of a mode, or that there is none."""
    return "no mode" if mode is None else MODE_NAMES[mode]


STICK_NAMES = ("pitch", "roll", "heave", "yaw")
STICK_COLOURS: tuple[Rgb, ...] = (BLUE, VERMILION, GREEN, PURPLE)


def unit(colour: Rgb) -> tuple[float, float, float]:
    """The colour in 0 … 1, as matplotlib wants it."""
    return colour[0] / 255.0, colour[1] / 255.0, colour[2] / 255.0


def bgr(colour: Rgb) -> tuple[int, int, int]:
    """The colour as OpenCV wants it."""
    return colour[2], colour[1], colour[0]
