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

_MODES: dict[Mode | None, tuple[str, Rgb]] = {
    Mode.SEARCH: ("search", PURPLE),
    Mode.TRACK_SHIP: ("4 track ship", SKY),
    Mode.TRACK_BAR: ("3 track bar", ORANGE),
    Mode.APPROACH: ("2 approach", BLUE),
    Mode.LAND: ("1 land", GREEN),
    Mode.NO_VISION: ("5 no vision", VERMILION),
    Mode.GO_AROUND: ("go around", YELLOW),
    Mode.DONE: ("done", GREY),
    None: ("no mode", GREY),  # of a pilot without modes
}
"""Names of the modes, with the numbers of [Lee2022], and their colours."""
MODE_COLOURS = {mode: colour for mode, (_, colour) in _MODES.items() if mode is not None}
STICKS: dict[str, Rgb] = {"pitch": BLUE, "roll": VERMILION, "heave": GREEN, "yaw": PURPLE}


def mode_colour(mode: Mode | None) -> Rgb:
    """The colour of a mode."""
    return _MODES[mode][1]


def mode_name(mode: Mode | None) -> str:
    """The name of a mode, or that there is none."""
    return _MODES[mode][0]


def unit(colour: Rgb) -> tuple[float, float, float]:
    """The colour in 0 … 1, as matplotlib wants it."""
    return colour[0] / 255.0, colour[1] / 255.0, colour[2] / 255.0


def bgr(colour: Rgb) -> tuple[int, int, int]:
    """The colour as OpenCV wants it."""
    return colour[2], colour[1], colour[0]
