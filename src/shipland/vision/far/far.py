"""Far vision: ship platform and bar. Acquire on the whole frame, track in a tile, believe after a while.

A box is reported only when it was seen in this very frame by a track that is believed; predictions are never reported.
While neither is known, ship and bar take turns at the whole frame; the bar is looked for inside the ship once there is
one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from shipland.camera import Camera
from shipland.messages import Box, Frame, Observation
from shipland.rig import Rig
from shipland.vision.far.detector import Detector, Picture
from shipland.vision.far.horizon_consistency import HorizonConsistency, Subject
from shipland.vision.far.search import NETWORK_STEP_PX, TargetSearch, inside
from shipland.vision.parameters import Confirmation, DetectorParameters

_ASPECT_RAD = math.radians(40.0)
"""From where a ship is approached: astern, give or take."""
_LONG = 1.85
"""So many times as wide as from astern the rig looks from there; its `span_sd` covers that."""
_SHIP_FOOT = 0.45
"""The lower edge of its boxes hangs a little below the water line."""
_BAR_TURNED = 0.9
"""What is left of the board's width, as most often seen."""


def _ship_spans_m(rig: Rig) -> tuple[float, float]:
    """The platform's width as most often seen; of a long hull from dead astern to that."""
    turned_m = rig.platform_width_m * math.cos(_ASPECT_RAD) + rig.platform_length_m * math.sin(_ASPECT_RAD)
    return (rig.platform_width_m if turned_m > _LONG * rig.platform_width_m else turned_m, turned_m)


@dataclass
class FarVision:
    """Both detectors over a stream of frames; holds the tracks. Never raises on a picture.

    Attributes:
        ship, bar: the detectors; None where there is none.
        camera: intrinsics.
        parameters: thresholds and counts.
        rig: the ship, for what the size of a box says.
    """

    ship: Detector | None
    bar: Detector | None
    camera: Camera
    parameters: DetectorParameters
    rig: Rig
    _ship: TargetSearch | None = field(default=None, init=False)
    _bar: TargetSearch | None = field(default=None, init=False)
    _ships_turn: bool = field(default=True, init=False)
    _last_s: float | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        parameters, rig = self.parameters, self.rig
        if self.ship is not None:
            subject = Subject(_ship_spans_m(rig), _SHIP_FOOT, 0.0, parameters.ship_rise)
            self._ship = self._search("ship", self.ship, parameters.ship, subject)
        if self.bar is not None:
            board_m = _BAR_TURNED * rig.board_width_m
            subject = Subject((board_m, board_m), 0.0, rig.bar_height_m, parameters.bar_rise)
            self._bar = self._search("bar", self.bar, parameters.bar, subject)

    def _search(self, name: str, detector: Detector, confirmation: Confirmation, subject: Subject) -> TargetSearch:
        horizon = HorizonConsistency(subject, self.camera, self.parameters)
        return TargetSearch(name, detector, self.camera, self.parameters, confirmation, horizon)

    @staticmethod
    def load(camera: Camera, parameters: DetectorParameters, rig: Rig) -> FarVision:
        """Both detectors that the parameters name; DataError when one cannot be used."""
        return FarVision(
            Detector.load(parameters.ship_weights, parameters, (parameters.ship_class,)),
            Detector.load(parameters.bar_weights, parameters, (parameters.bar_class,)),
            camera,
            parameters,
            rig,
        )

    def reset(self) -> None:
        """Forget the tracks."""
        for search in (self._ship, self._bar):
            if search is not None:
                search.reset()

    def see(self, frame: Frame) -> Observation:
        """Ship box and bar box of one frame, each None unless a believed track was seen in it."""
        picture, gimbal = frame.image, frame.gimbal
        if picture is None or min(picture.shape[:2]) < NETWORK_STEP_PX:
            return Observation(frame.t_s, gimbal, reason="far: no picture")
        if picture.shape[:2] != (self.camera.height_px, self.camera.width_px):
            return Observation(frame.t_s, gimbal, reason="far: the picture's size is not the camera's")
        if not all(map(math.isfinite, (gimbal.roll_rad, gimbal.pitch_rad, gimbal.yaw_rad))):
            return Observation(frame.t_s, gimbal, reason="far: the camera's attitude is not known")
        if self._last_s is not None and not 0.0 <= frame.t_s - self._last_s <= self.parameters.stale_s:
            self.reset()
        self._last_s = frame.t_s
        ship_box, ship_reason, searched = self._see_ship(frame, picture)
        bar_box, bar_reason = self._see_bar(frame, picture, searched)
        reason = "; ".join(text for text in (ship_reason, bar_reason) if text)
        return Observation(frame.t_s, gimbal, None, bar_box, ship_box, reason)

    def _see_ship(self, frame: Frame, picture: Picture) -> tuple[Box | None, str, bool]:
        """The ship's box, why there is none, and whether the whole frame was searched."""
        search = self._ship
        if search is None:
            return None, "ship: no detector", False
        if search.target is None and self._bar is not None:
            self._ships_turn = not self._ships_turn
            if self._ships_turn:
                return None, "ship: not searched, the bar was", False
        if not search.search_due:
            box = search.follow(frame, picture)
            return box, "" if box else search.reason(), False
        before = search.target
        box = search.search(frame, picture)
        if before is not None and search.target is not before and self._bar is not None:
            self._bar.reset()
        return box, "" if box else search.reason(), True

    def _see_bar(self, frame: Frame, picture: Picture, searched: bool) -> tuple[Box | None, str]:
        """The bar's box: its own track, else inside the ship's box, else over the whole frame where the turn allows."""
        search = self._bar
        if search is None:
            return None, "bar: no detector"
        ship = None if self._ship is None else self._ship.target
        box = None
        if ship is None:
            if not searched and search.search_due:
                box = search.search(frame, picture)
            elif search.target is not None:
                box = search.follow(frame, picture)
        elif search.target is not None:
            box = search.follow(frame, picture)
        elif ship.size_px[0] < self.parameters.bar_search_ship_px:
            return None, "bar: the ship is too small for it"
        else:
            box = search.search_tile(frame, picture, ship)
        if ship is not None and box is not None and not inside(box, ship):
            search.reset()
            return None, "bar: outside the ship"
        return box, "" if box else search.reason()
