"""The geometric camera's look down: the true place of the deck with the errors of the rendered one's.

The deck's attitude goes with it as a tag on the deck would give it: true but for noise, without the second solution
that a small plane's pose has, and seen wherever the deck's centre is. No drawn picture gives it.
"""

from __future__ import annotations

import math

import numpy as np

from shipland.camera import Camera, level_from_camera
from shipland.geometric.parameters import DeckErrors
from shipland.messages import DeckSight, Frame, Observation
from shipland.vehicles.vehicle import GroundTruthSource
from shipland.vision.near.gates import Refusal

LEAST_FACING = 0.5
"""Cosine of the angle at which a deck is seen most steeply."""
NORMAL_NOISE_RAD = 0.01
"""Standard deviation of the deck's attitude, each way.

Derived: a 0.30 m tag 1.2 m below, each corner off by 0.3 px; a radian of tilt moves one by 14.5 px.
"""


class GeometricDeck:
    """Sees the deck's centre where it is in the picture, for a vehicle whose truth is known."""

    def __init__(
        self, truth_source: GroundTruthSource, camera: Camera, errors: DeckErrors, rng: np.random.Generator
    ) -> None:
        self._truth_source, self._camera, self._errors, self._rng = truth_source, camera, errors, rng
        self._normal_rng = rng.spawn(1)[0]

    def see(self, frame: Frame) -> Observation:
        """What the look down would find; never raises."""
        noise_m = self._errors.noise_m * self._rng.standard_normal(3)
        tilted = NORMAL_NOISE_RAD * self._normal_rng.standard_normal(2)
        missed = self._rng.random() < self._errors.miss_rate
        truth = self._truth_source.truth_at(frame.t_s if frame.stamp_s is None else frame.stamp_s)
        if truth is None:
            return Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_PICTURE.value)
        nothing = Observation(frame.t_s, frame.gimbal, reason=Refusal.NO_DECK.value)
        camera, deck = truth.ned_from_camera, truth.ned_from_deck
        sight_m = deck.translation_m - camera.translation_m
        in_camera_m = camera.rotation.T @ sight_m
        range_m = math.hypot(*sight_m.tolist())
        facing = float(deck.rotation[:, 2] @ sight_m) / max(range_m, 1e-9)
        if missed or not self._errors.least_m <= range_m <= self._errors.most_m or facing < LEAST_FACING:
            return nothing
        column_px, row_px = self._camera.project(in_camera_m[None, :])[0].tolist()
        if not (0.0 <= column_px < self._camera.width_px and 0.0 <= row_px < self._camera.height_px):
            return nothing
        # Levelled as the vision levels it: by what the gimbal says of itself, which errs.
        gimbal = frame.gimbal
        centre_m = level_from_camera(gimbal) @ in_camera_m + noise_m
        normal = level_from_camera(gimbal) @ camera.rotation.T @ deck.rotation[:, 2] + np.array([*tilted, 0.0])
        normal /= math.hypot(*normal.tolist())
        return Observation(frame.t_s, gimbal, deck=DeckSight(centre_m, np.full(3, self._errors.noise_m), normal))
