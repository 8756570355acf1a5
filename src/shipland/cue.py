"""The visual cue: what near vision looks for, and what lands on the board of a scenario."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Literal

import numpy as np

from shipland.config import build, parameters, read_toml, require
from shipland.errors import ConfigError
from shipland.frames import Array

Corner = tuple[float, float]
Hue = tuple[int, int] | Literal["white"]
"""OpenCV's hue 0 … 179 from the first number up to the second, over red where the first is the larger."""

RIG_TOLERANCE = 0.003
"""`manufacturing_tolerance` of the rig's bar."""

FILE_TOLERANCE = 0.01
"""`manufacturing_tolerance` of a cue from a file: tape cut by hand, as photographs of it show."""

_LEAST_TURN = 0.1
"""Sine of the least angle between one side of a polygon and the next."""

_USUAL_WIDTH_M = (0.02, 10.0)
"""Widths of cues; others were given in another unit."""

_DOUBTFUL_WIDTH_M = 2.5
"""A cue of that many inches is one for a desk; of metres, one for a ship."""

_INCH_M = 0.0254


@parameters
class Polygon:
    """One lit area of the cue.

    Attributes:
        corners_m: (right, down) points of its outline in the cue's plane from its origin [m], clockwise as seen from
            the approach, a rectangle's in the order top-left, top-right, bottom-right, bottom-left. Other outlines may
            be concave, and start where a side runs to the right along the top.
    """

    corners_m: tuple[Corner, ...]

    def __post_init__(self) -> None:
        points = np.array(self.corners_m, dtype=float)
        require(
            points.ndim == 2 and points.shape[1] == 2 and len(points) >= 3,
            f"corners_m must be three or more (right, down) points, got {len(self.corners_m)}",
        )
        sides = np.roll(points, -1, axis=0) - points
        lengths = np.hypot(*sides.T)
        require(bool(lengths.min() > 0.0), "corners_m must be different points")
        after = np.roll(sides, -1, axis=0)
        turns = (sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]) / (lengths * np.roll(lengths, -1))
        require(
            bool(np.abs(turns).min() >= _LEAST_TURN) and _winds_once(sides) and not _crosses_itself(points),
            "corners_m must be the corners of an outline that does not cross itself, clockwise as seen from the "
            "approach: top-left, top-right, bottom-right, bottom-left",
        )
        require(
            bool(sides[0, 0] > abs(sides[0, 1])),
            "corners_m must start at the top-left corner: its first side must run to the right, within 45° of level",
        )

    @property
    def convex(self) -> bool:
        """Whether all corners turn the same way."""
        points = np.array(self.corners_m)
        sides = np.roll(points, -1, axis=0) - points
        after = np.roll(sides, -1, axis=0)
        return bool(np.all(sides[:, 0] * after[:, 1] > sides[:, 1] * after[:, 0]))

    @staticmethod
    def rectangle(centre_m: Corner, width_m: float, height_m: float) -> Polygon:
        """An upright rectangle around (right, down) `centre_m`."""
        (x, y), w, h = centre_m, 0.5 * width_m, 0.5 * height_m
        return Polygon(((x - w, y - h), (x + w, y - h), (x + w, y + h), (x - w, y + h)))


def _winds_once(sides: Array) -> bool:
    """Whether the sides (n,2) of an outline turn clockwise by a whole turn in all."""
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    turned = np.angle(np.exp(1j * (np.roll(angles, -1) - angles)))
    return bool(np.isclose(turned.sum(), 2.0 * np.pi))


def _crosses_itself(points: Array) -> bool:
    """Whether two sides of an outline (n,2) that are no neighbours cross."""

    def left_of(start: Array, end: Array, point: Array) -> bool:
        across = (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])
        return bool(across > 0.0)

    count = len(points)
    for one in range(count):
        a, b = points[one], points[(one + 1) % count]
        for other in range(one + 2, count - (one == 0)):
            c, d = points[other], points[(other + 1) % count]
            if left_of(a, b, c) != left_of(a, b, d) and left_of(c, d, a) != left_of(c, d, b):
                return True
    return False


@parameters
class Cue:
    """Known coplanar polygons in the plane forward = 0 of `bar`.

    Attributes:
        polygon: the polygons, all with the same number of corners.
        manufacturing_tolerance: root-mean-square error of the corners against the stated dimensions, as a share of the
            cue's diagonal.
        hue: of its light; None for that of `[vision]`.
        status_light_m: side of the square status light about its origin; 0 for none.
    """

    polygon: tuple[Polygon, ...]
    manufacturing_tolerance: float = field(default=RIG_TOLERANCE, compare=False)
    hue: Hue | None = field(default=None, compare=False)
    status_light_m: float = field(default=0.0, compare=False)

    def __post_init__(self) -> None:
        require(
            0.0 <= self.manufacturing_tolerance < 0.1,
            f"manufacturing_tolerance is a share of the cue's diagonal, below 0.1; got {self.manufacturing_tolerance}",
        )
        require(len(self.polygon) > 0, "a cue needs at least one [[rig.polygon]]")
        counts = {len(polygon.corners_m) for polygon in self.polygon}
        require(len(counts) == 1, f"all polygons of a cue must have as many corners; got {sorted(counts)}")
        require(sum(len(polygon.corners_m) for polygon in self.polygon) > 3, "a single triangle tells no pose: add one")
        if isinstance(self.hue, tuple):
            require(all(0 <= hue <= 179 for hue in self.hue), f"hue must be two numbers in 0 … 179, got {self.hue}")

    @property
    def points_in_bar_m(self) -> Array:
        """(n, 3) corners in `bar` [m], polygon by polygon."""
        plane = np.array([corner for polygon in self.polygon for corner in polygon.corners_m])
        return np.column_stack([np.zeros(len(plane)), plane])

    @property
    def plane_m(self) -> Array:
        """(n,k,2) corners (right, down) of the polygons [m]."""
        return np.array([polygon.corners_m for polygon in self.polygon], dtype=float)

    @property
    def status_light(self) -> Polygon | None:
        """The lit square; None without one."""
        if self.status_light_m <= 0.0:
            return None
        return Polygon.rectangle((0.0, 0.0), self.status_light_m, self.status_light_m)

    @property
    def count(self) -> int:
        """Number of polygons."""
        return len(self.polygon)

    @property
    def mirrors_itself(self) -> bool:
        """Whether its reflection in level water or a level deck looks the same, to within what it is made to."""
        corners_m = self.points_in_bar_m[:, 1:]
        middle_m = 0.5 * (corners_m.min(axis=0) + corners_m.max(axis=0))
        mirrored_m = corners_m * [1.0, -1.0] + [0.0, 2.0 * middle_m[1]]
        apart_m = np.linalg.norm(corners_m[:, None] - mirrored_m[None], axis=-1).min(axis=0)
        diagonal_m = float(np.linalg.norm(np.ptp(corners_m, axis=0)))
        return bool(apart_m.max() <= 3.0 * self.manufacturing_tolerance * diagonal_m)

    @property
    def size_words(self) -> str:
        """How large it is, so that a wrong unit is noticed: a small cue in inches is within the usual widths."""
        width_m, height_m = np.ptp(self.points_in_bar_m[:, 1:], axis=0)
        said = f"{width_m:.3g} × {height_m:.3g} m"
        if width_m >= _DOUBTFUL_WIDTH_M:
            said += f"; corners_m are metres: were they inches, it is {width_m * _INCH_M:.2f} m wide"
        return said

    @staticmethod
    def from_file(path: Path) -> Cue:
        """The cue in a TOML file, as a scenario has it: one `[[rig.polygon]]` a polygon.

        What else a scenario's file holds does not matter.

        Raises:
            ConfigError: it is wrong, in another unit, or in the former format.
        """
        table = read_toml(path)
        for former in ("quad", "manufacturing_tolerance", "polygon"):
            if former in table:
                raise ConfigError(
                    f"{path}: {former!r} stands in section [rig] now, as in a scenario: [rig] with "
                    "manufacturing_tolerance and hue, then one [[rig.polygon]] with corners_m a polygon"
                )
        from shipland.former import FORMER

        rig = table.get("rig", {})
        if not isinstance(rig, dict):
            raise ConfigError(f"{path}: expected a section [rig]")
        names = {"polygon", "manufacturing_tolerance", "hue", "status_light_m"}
        told = {key: value for key, value in rig.items() if key in names or FORMER.get(key) in names}
        if "polygon" not in rig and len(told) < len(rig):
            told = rig  # a key misspelt
        cue = build(Cue, {"manufacturing_tolerance": FILE_TOLERANCE, **told}, f"{path}: rig")
        cue.require_metres(str(path))
        return cue

    def require_metres(self, where: str) -> None:
        """ConfigError for a cue so wide or narrow that its corners were given in another unit than metres."""
        width_m = float(np.ptp(self.points_in_bar_m[:, 1]))
        low_m, high_m = _USUAL_WIDTH_M
        if not low_m <= width_m <= high_m:
            said = f"{where}: corners_m are in metres: the cue would be {width_m:.4g} m wide"
            if width_m > high_m:
                said += f"; were they inches, {width_m * _INCH_M:.2f} m, millimetres, {width_m * 1e-3:.2f} m"
            raise ConfigError(said)
