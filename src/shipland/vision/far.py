"""Far vision: ship platform and bar. Acquire on the whole frame, track in a tile, believe after a while.

A box is reported only when it was seen in this very frame by a track that is believed; predictions are never reported.
One whole frame is searched a cycle at most, for the ship or for the bar; everything else is tiles.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.messages import Box, Frame, GimbalAttitude, Observation
from shipland.vision.detector import Detector, DetectorParameters, Picture

NETWORK_STEP_PX = 32


@dataclass
class Track:
    """One target followed over frames.

    Attributes:
        t_s: time of the last hit.
        centre_px, size_px: (2,) last box.
        velocity_px_s: (2,) of the centre, the gimbal's own turning taken out.
        gimbal: the camera's attitude at the last hit.
        confidence: of the last box.
        hits: the last frames, whether each was a hit.
        misses: frames since the last hit.
        believed: confirmed once, and not lost since.
    """

    t_s: float
    centre_px: Array
    size_px: Array
    velocity_px_s: Array
    gimbal: GimbalAttitude
    confidence: float
    hits: deque[bool]
    misses: int = 0
    believed: bool = False

    @staticmethod
    def start(box: Box, frame: Frame, parameters: DetectorParameters) -> Track:
        """A track from its first box."""
        hits = deque([True], maxlen=parameters.confirm_frames)
        believed = parameters.confirm_hits == 1
        return Track(
            frame.t_s,
            np.array(box.centre_px),
            np.array(box.size_px),
            np.zeros(2),
            frame.gimbal,
            box.confidence,
            hits,
            believed=believed,
        )

    def turned_px(self, gimbal: GimbalAttitude, focal_px: float) -> Array:
        """(2,) by how much the gimbal's turning since the last hit moves the picture's content [px]."""
        return focal_px * np.array([-(gimbal.yaw_rad - self.gimbal.yaw_rad), gimbal.pitch_rad - self.gimbal.pitch_rad])

    def predicted_px(self, frame: Frame, focal_px: float) -> Array:
        """(2,) where the centre should be in `frame`."""
        elapsed_s = max(frame.t_s - self.t_s, 0.0)
        return self.centre_px + self.velocity_px_s * elapsed_s + self.turned_px(frame.gimbal, focal_px)

    def takes(self, box: Box, predicted_px: Array, parameters: DetectorParameters) -> bool:
        """Whether a box can be this target: near the prediction, and of like size."""
        longer = float(self.size_px.max())
        reach = parameters.gate_px + parameters.gate_sizes * longer
        growth = max(box.size_px) / longer
        return (
            float(np.hypot(*(np.array(box.centre_px) - predicted_px))) <= reach
            and 1.0 / parameters.gate_growth <= growth <= parameters.gate_growth
        )

    def hit(self, box: Box, frame: Frame, focal_px: float, parameters: DetectorParameters) -> None:
        """Take a box of `frame`."""
        centre = np.array(box.centre_px)
        elapsed_s = frame.t_s - self.t_s
        if elapsed_s > 0.0:
            measured = (centre - self.centre_px - self.turned_px(frame.gimbal, focal_px)) / elapsed_s
            self.velocity_px_s = self.velocity_px_s + parameters.velocity_gain * (measured - self.velocity_px_s)
        self.t_s, self.gimbal, self.confidence = frame.t_s, frame.gimbal, box.confidence
        self.centre_px, self.size_px = centre, np.array(box.size_px)
        self.hits.append(True)
        self.misses = 0
        self.believed = self.believed or sum(self.hits) >= parameters.confirm_hits

    def miss(self) -> None:
        """Note a frame without a box."""
        self.hits.append(False)
        self.misses += 1

    def lost(self, parameters: DetectorParameters) -> bool:
        """Whether to give up: too long unseen, or never confirmed in its time."""
        if self.believed:
            return self.misses >= parameters.lost_frames
        misses = len(self.hits) - sum(self.hits)
        return misses > parameters.confirm_frames - parameters.confirm_hits


@dataclass
class FarVision:
    """Both detectors over a stream of frames; holds the tracks. Never raises on a picture.

    Attributes:
        ship, bar: the detectors; None where there is none.
        camera: intrinsics, for the gimbal's turning.
        parameters: thresholds and counts.
    """

    ship: Detector | None
    bar: Detector | None
    camera: Camera
    parameters: DetectorParameters
    _ship_track: Track | None = field(default=None, init=False)
    _bar_track: Track | None = field(default=None, init=False)
    _count: int = field(default=0, init=False)
    _last_s: float | None = field(default=None, init=False)

    @staticmethod
    def load(camera: Camera, parameters: DetectorParameters) -> FarVision:
        """Both detectors that the parameters name; DataError when one cannot be used."""
        return FarVision(
            Detector.load(parameters.ship_weights, parameters),
            Detector.load(parameters.bar_weights, parameters),
            camera,
            parameters,
        )

    def reset(self) -> None:
        """Forget the tracks."""
        self._ship_track = self._bar_track = None

    def see(self, frame: Frame) -> Observation:
        """Ship box and bar box of one frame, each None unless a believed track was seen in it."""
        if frame.image is None or min(frame.image.shape[:2]) < NETWORK_STEP_PX:
            return Observation(frame.t_s, frame.gimbal, reason="far: no picture")
        if self._last_s is not None and not 0.0 <= frame.t_s - self._last_s <= self.parameters.stale_s:
            self.reset()
        self._last_s = frame.t_s
        self._count += 1
        ship_box, ship_reason, searched = self._see_ship(frame, frame.image)
        bar_box, bar_reason = self._see_bar(frame, frame.image, searched)
        reason = "; ".join(text for text in (ship_reason, bar_reason) if text)
        return Observation(frame.t_s, frame.gimbal, None, bar_box, ship_box, reason)

    def _see_ship(self, frame: Frame, picture: Picture) -> tuple[Box | None, str, bool]:
        """The ship's box, why there is none, and whether the whole frame was searched."""
        if self.ship is None:
            return None, "ship: no detector", False
        box = None
        if self._ship_track is not None:
            box, self._ship_track = self._follow(self._ship_track, self.ship, frame, picture)
        elif self.bar is not None and self._bar_track is None and self._count % 2 == 0:
            # Nothing is tracked: the bar's turn to search the frame.
            return None, "ship: the bar's turn to search", False
        if self._ship_track is not None and self._count % self.parameters.recheck_frames:
            return self._told(self._ship_track, box, "ship")
        found = self.ship.detect(picture, self.parameters.acquire_confidence)
        if found and self._ship_track is None:
            self._ship_track, box = Track.start(found[0], frame, self.parameters), found[0]
        elif found and self._ship_track is not None and self._better(found[0], self._ship_track, frame):
            self._ship_track, self._bar_track, box = Track.start(found[0], frame, self.parameters), None, found[0]
        told, reason, _ = self._told(self._ship_track, box, "ship")
        return told, reason, True

    def _better(self, box: Box, track: Track, frame: Frame) -> bool:
        predicted_px = track.predicted_px(frame, self.camera.focal_px)
        elsewhere = not track.takes(box, predicted_px, self.parameters)
        return elsewhere and box.confidence > track.confidence + self.parameters.recheck_margin

    def _see_bar(self, frame: Frame, picture: Picture, searched: bool) -> tuple[Box | None, str]:
        """The bar's box: its own track, else inside the ship's box, else over the whole frame where the turn allows."""
        if self.bar is None:
            return None, "bar: no detector"
        box, parameters, ship = None, self.parameters, self._ship_track
        if self._bar_track is not None:
            box, self._bar_track = self._follow(self._bar_track, self.bar, frame, picture)
        elif ship is not None:
            if ship.size_px[0] < parameters.bar_search_ship_px:
                return None, "bar: the ship is too small for it"
            tile_px, reduction = self._tile(float(ship.size_px.max()))
            centre = (float(ship.centre_px[0]), float(ship.centre_px[1]))
            found = self.bar.detect_in_tile(picture, centre, tile_px, reduction, parameters.acquire_confidence)
            found = [item for item in found if _inside(item, ship)]
            if found:
                self._bar_track, box = Track.start(found[0], frame, parameters), found[0]
        elif not searched:
            found = self.bar.detect(picture, parameters.acquire_confidence)
            if found:
                self._bar_track, box = Track.start(found[0], frame, parameters), found[0]
        if ship is not None and ship.believed and self._bar_track is not None and box and not _inside(box, ship):
            self._bar_track = None
            return None, "bar: outside the ship"
        told, reason, _ = self._told(self._bar_track, box, "bar")
        return told, reason

    def _follow(
        self, track: Track, detector: Detector, frame: Frame, picture: Picture
    ) -> tuple[Box | None, Track | None]:
        predicted_px = track.predicted_px(frame, self.camera.focal_px)
        tile_px, reduction = self._tile(float(track.size_px.max()))
        centre = (float(predicted_px[0]), float(predicted_px[1]))
        found = detector.detect_in_tile(picture, centre, tile_px, reduction, self.parameters.track_confidence)
        mine = [box for box in found if track.takes(box, predicted_px, self.parameters)]
        if mine:
            track.hit(mine[0], frame, self.camera.focal_px, self.parameters)
            return mine[0], track
        track.miss()
        return None, None if track.lost(self.parameters) else track

    def _tile(self, longer_px: float) -> tuple[int, int]:
        """Side of the tile that the network sees and the reduction, for a target of this longer side."""
        parameters = self.parameters
        wanted = parameters.tile_per_target * longer_px
        reduction = max(1, int(np.ceil(wanted / parameters.tile_max_px)))
        side = NETWORK_STEP_PX * int(np.ceil(wanted / reduction / NETWORK_STEP_PX))
        return min(max(side, parameters.tile_min_px), parameters.tile_max_px), reduction

    def _told(self, track: Track | None, box: Box | None, name: str) -> tuple[Box | None, str, bool]:
        if track is None:
            return None, f"{name}: not found", False
        if not track.believed:
            return None, f"{name}: {sum(track.hits)} of {self.parameters.confirm_hits} sightings", False
        if box is None:
            return None, f"{name}: missed for {track.misses} frames", False
        return box, "", False


def _inside(box: Box, ship: Track) -> bool:
    """Whether a bar's centre lies in the ship's box, a quarter of it as margin."""
    offset = np.abs(np.array(box.centre_px) - ship.centre_px)
    return bool(np.all(offset <= 0.75 * ship.size_px + 2.0))
