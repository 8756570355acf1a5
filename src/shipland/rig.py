"""Dimensions of the ship platform, the landing deck and the horizon bar (`[rig]` in TOML)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from shipland.config import key, parameters, require
from shipland.cue import RIG_TOLERANCE, Cue, Hue, Polygon
from shipland.frames import Array, Pose

_BOARD_MARGIN_M = 0.02
"""Least margin of board around the cue."""


@dataclass(frozen=True)
class DeckMark:
    """A line painted on the deck.

    Attributes:
        points_m: its outline, forward and starboard of the deck's centre; of a circle, the middle.
        width_m: of it.
        brightness: against white of 1.5 and a deck of 0.3.
        radius_m: of a circle; 0 of a line.
    """

    points_m: tuple[tuple[float, float], ...]
    width_m: float
    brightness: float
    radius_m: float = 0.0

    @staticmethod
    def frame(side_m: float, width_m: float, brightness: float) -> DeckMark:
        """A square about the centre."""
        h = 0.5 * side_m
        return DeckMark(((h, h), (h, -h), (-h, -h), (-h, h), (h, h)), width_m, brightness)


def area_of(rigs: Iterable[Rig]) -> str:
    """What a touchdown must lie in, in a word: `square` or `circle`; `landing area` where rigs differ."""
    kinds: set[str] = {rig.landing_area for rig in rigs}
    return kinds.pop() if len(kinds) == 1 else "landing area"


def in_area(area: str, size_m: float, forward_m: float, starboard_m: float) -> bool:
    """Whether a point lies in a `square` of this side, or in a `circle` of this diameter; NaN does not.

    >>> in_area("square", 2.0, 0.9, 0.9), in_area("circle", 2.0, 0.9, 0.9)
    (True, False)
    """
    if area == "circle":
        return math.hypot(forward_m, starboard_m) <= 0.5 * size_m
    return abs(forward_m) <= 0.5 * size_m and abs(starboard_m) <= 0.5 * size_m


def view_share(ahead_m: float, right_m: float, half_m: float, box_m: tuple[float, float, float, float]) -> float:
    """Share of a square view, straight down, that shows a box: what part of an optical flow is the ship's.

    `@compiled` by its caller.

    Args:
        ahead_m: the view's centre, in the axes of the box.
        right_m: likewise.
        half_m: half the view's side, positive.
        box_m: stern, bow, port and starboard side.
    """
    along_m = min(ahead_m + half_m, box_m[1]) - max(ahead_m - half_m, box_m[0])
    across_m = min(right_m + half_m, box_m[3]) - max(right_m - half_m, box_m[2])
    return along_m * across_m / (4.0 * half_m * half_m) if along_m > 0.0 and across_m > 0.0 else 0.0


@parameters
class Rig:
    """The ship platform [Lee2022, §Experimental Setup] and this project's choices where the paper gives none.

    [Lee2022, §Experimental Setup] gives platform, deck and limits; the rest is chosen.
    """

    platform_length_m: float = key(3.0, "of the platform, from stern to bow", "[Lee2022]", gt=0)
    platform_width_m: float = key(1.8, "of the platform", "[Lee2022]", gt=0)
    superstructure_height_m: float = key(1.8, "top of the superstructure above ground", "[Lee2022]", gt=0)
    deck_size_m: float = key(1.22, "side of the square deck", "[Lee2022], 4 ft", gt=0)
    deck_ahead_of_stern_m: float = key(
        0.71, "deck centre ahead of the stern", "chosen: 0.1 m of platform behind the deck", gt=0
    )
    deck_height_m: float = key(0.9, "neutral deck surface above ground", gt=0)
    landing_square_m: float = key(
        0.35, "side of the landing square, or diameter of the landing circle", "[Lee2022]", gt=0
    )
    bar_ahead_of_stern_m: float = key(2.8, "the bar's plane ahead of the stern", gt=0)
    bar_height_m: float = key(1.65, "the bar's centre above ground", gt=0)
    board_width_m: float = key(
        1.4, "of the grey board behind the rectangles", "chosen; with it Table 1's bar setpoint lies at 10.3 m", gt=0
    )
    board_height_m: float = key(0.3, "of the grey board", gt=0)
    rectangle_width_m: float = key(0.45, "of each of the two green rectangles", gt=0)
    rectangle_height_m: float = key(0.15, "of each rectangle", gt=0)
    rectangle_gap_m: float = key(0.3, "between the two rectangles", gt=0)
    surge_limit_m: float = key(1.02, "of the motion base, either side", "[Lee2022]", gt=0)
    sway_limit_m: float = key(1.02, "of the motion base, either side", "[Lee2022]", gt=0)
    heave_limit_m: float = key(0.64, "of the motion base, either side", "[Lee2022]", gt=0)
    roll_limit_deg: float = key(13.0, "of the motion base, either side", "[Lee2022]", gt=0)
    pitch_limit_deg: float = key(15.0, "of the motion base, either side", "[Lee2022]", gt=0)
    yaw_limit_deg: float = key(16.0, "of the motion base, either side", "[Lee2022]", gt=0)
    polygon: tuple[Polygon, ...] = key(
        (), "another cue in place of the two rectangles, in `bar`; one `[[rig.polygon]]` each"
    )
    manufacturing_tolerance: float = key(RIG_TOLERANCE, "how exactly the cue is made, as in `Cue`")
    hue: Hue | None = key(None, "of the cue's light, as in `Cue`; without one that of `[vision]`")
    status_light_m: float = key(
        0.0,
        "side of the square red light in the bar's centre that flashes while the ship waves off (`ship.waves_off_s`)",
        "0 for none",
        ge=0,
    )
    landing_area: Literal["square", "circle"] = key("square", "what a touchdown must lie in")
    hull: Literal["platform", "frigate"] = key(
        "platform", "a platform with a motion base, or a ship whose flight deck is part of the hull"
    )
    house_length_m: float | None = key(
        None, "of the superstructure ahead of the bar; without one it reaches to the bow", gt=0
    )

    def __post_init__(self) -> None:
        require(
            all(len(polygon.corners_m) == 4 and polygon.convex for polygon in self.polygon),
            "polygon: a scenario draws convex polygons of four corners; `shipland see` takes others",
        )
        require(self.landing_square_m <= self.deck_size_m, "landing_square_m must fit on the deck")
        require(
            bool(self.polygon) or self.status_light_m < self.rectangle_gap_m,
            "status_light_m must fit between the two rectangles",
        )
        require(self.bar_ahead_of_stern_m > self.deck_ahead_of_stern_m, "the bar must be ahead of the deck")

    def in_landing_area(self, forward_m: float, starboard_m: float) -> bool:
        """Whether a point of the deck, from its centre, lies in the landing square or circle."""
        return in_area(self.landing_area, self.landing_square_m, forward_m, starboard_m)

    @cached_property
    def cue(self) -> Cue:
        """The cue: the rig's own polygons where it has some, else the two rectangles."""
        if self.polygon:
            return Cue(self.polygon, self.manufacturing_tolerance, self.hue, self.status_light_m)
        offset = 0.5 * (self.rectangle_gap_m + self.rectangle_width_m)
        rectangles = tuple(
            Polygon.rectangle((side * offset, 0.0), self.rectangle_width_m, self.rectangle_height_m)
            for side in (-1.0, 1.0)
        )
        return Cue(rectangles, self.manufacturing_tolerance, self.hue, self.status_light_m)

    @cached_property
    def board_size_m(self) -> tuple[float, float]:
        """Width and height of the board around the bar's centre: as stated, or as the cue needs."""
        right_m, down_m = np.abs(self.cue.points_in_bar_m[:, 1:]).max(axis=0).tolist()
        return (
            max(self.board_width_m, 2.0 * (right_m + _BOARD_MARGIN_M)),
            max(self.board_height_m, 2.0 * (down_m + _BOARD_MARGIN_M)),
        )

    @cached_property
    def deck_marks(self) -> tuple[DeckMark, ...]:
        """What is painted on the platform's deck."""
        size, square, white = self.deck_size_m, self.landing_square_m, 1.5
        inner, outer, letter = 0.5 * square, 0.4 * size, 0.055
        cross = [((a * inner, 0.0), (a * outer, 0.0)) for a in (-1.0, 1.0)]
        cross += [((0.0, a * inner), (0.0, a * outer)) for a in (-1.0, 1.0)]
        strokes = [((-letter, a * letter), (letter, a * letter)) for a in (-1.0, 1.0)]
        strokes.append(((0.0, -letter), (0.0, letter)))
        return (
            DeckMark.frame(size - 0.05, 0.025, 1.0),
            DeckMark(((0.0, 0.0),), 0.022, white, outer),
            DeckMark.frame(square, 0.025, white),
            *(DeckMark(line, 0.018, white) for line in cross),
            *(DeckMark(line, 0.016, white) for line in strokes),
        )

    @cached_property
    def bar_in_ship_m(self) -> Array:
        """(3,) the bar's centre in `ship` [m]."""
        return np.array(
            [
                self.bar_ahead_of_stern_m - self.deck_ahead_of_stern_m,
                0.0,
                self.deck_height_m - self.bar_height_m,
            ]
        )

    @cached_property
    def ship_from_bar(self) -> Pose:
        """The bar in `ship`, in rig mode (the bar moves with the platform alone)."""
        return Pose(np.eye(3), self.bar_in_ship_m)

    @cached_property
    def deck_in_bar_m(self) -> Array:
        """(3,) the deck centre's neutral point in `bar` [m]."""
        return -self.bar_in_ship_m


@dataclass(frozen=True)
class Solid:
    """An upright box in its own frame: what is collided with, casts a shadow and bounds the screen box."""

    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]

    @property
    def corners_m(self) -> Array:
        """(8,3)."""
        low, high = self.low_m, self.high_m
        return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


@dataclass(frozen=True)
class Layout:
    """Boxes that everything is built from: hull and superstructure in `ship`, deck in `deck`, board in `bar`."""

    hull: Solid
    house: Solid
    deck: Solid
    board: Solid


def layout(rig: Rig) -> Layout:
    """The rig's boxes.

    The motion base stands on a low hull, so that the deck has room below; the superstructure stands ahead of
    the bar's plane.
    """
    if rig.hull == "frigate":
        return _frigate(rig)
    stern, half = -rig.deck_ahead_of_stern_m, 0.5 * rig.platform_width_m
    bow, ground = stern + rig.platform_length_m, rig.deck_height_m
    tilt = float(np.sin(np.radians(rig.roll_limit_deg + rig.pitch_limit_deg)))
    room = rig.deck_height_m - rig.heave_limit_m - 0.5 * rig.deck_size_m * tilt - 0.05
    freeboard = float(np.clip(room, 0.10, 0.25))
    face = float(rig.bar_in_ship_m[0]) + 0.05
    bow = max(bow, face + 0.10)
    wide, tall = (0.5 * side_m for side_m in rig.board_size_m)
    size = 0.5 * rig.deck_size_m
    return Layout(
        hull=Solid((stern, -half, ground - freeboard), (bow, half, ground)),
        house=Solid((face, -half, ground - rig.superstructure_height_m), (bow, half, ground - freeboard)),
        deck=Solid((-size, -size, 0.0), (size, size, 0.05)),
        board=Solid((0.0, -wide, -tall), (0.02, wide, tall)),
    )


_DECK_PLATE_M = 0.1
"""Thickness of a flight deck above the hull, as in the contact model."""


def _frigate(rig: Rig) -> Layout:
    """A ship's boxes: the hull reaches up to the flight deck, the hangar stands on it."""
    stern, half, size = -rig.deck_ahead_of_stern_m, 0.5 * rig.platform_width_m, 0.5 * rig.deck_size_m
    bow, ground = stern + rig.platform_length_m, rig.deck_height_m
    face = float(rig.bar_in_ship_m[0]) + 0.05
    fore = bow if rig.house_length_m is None else min(bow, face + rig.house_length_m)
    wide, tall = (0.5 * side_m for side_m in rig.board_size_m)
    return Layout(
        hull=Solid((stern, -half, _DECK_PLATE_M), (bow, half, ground)),
        house=Solid((face, -half, ground - rig.superstructure_height_m), (fore, half, _DECK_PLATE_M)),
        deck=Solid((-size, -size, 0.0), (size, size, 0.05)),
        board=Solid((0.0, -wide, -tall), (0.02, wide, tall)),
    )
