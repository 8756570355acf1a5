"""One seed, one flight: the random generators of everything that is drawn in it.

The rule of the package: whatever draws takes a `numpy.random.Generator`; nothing below a flight knows a seed. Each part
of a flight has its own generator, so that a part that draws more numbers leaves the others' as they were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Generators:
    """Independent generators, one for each part of a flight.

    Attributes:
        ship: course and motion.
        wind: mean wind, turbulence, airwake.
        aircraft: start, sensors, gimbal.
        picture: sensor noise of the camera.
        near, far: near and far vision.
        pilot: the pilot.
        scene: waves, clouds, stains, drops, spray.
        faults: what fails, and how.
    """

    ship: np.random.Generator
    wind: np.random.Generator
    aircraft: np.random.Generator
    picture: np.random.Generator
    near: np.random.Generator
    far: np.random.Generator
    pilot: np.random.Generator
    scene: np.random.Generator
    faults: np.random.Generator


def generators_of(seed: int) -> Generators:
    """The generators of the flight of `seed` (0 or more), each at its beginning."""
    return Generators(*(np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(9)))
