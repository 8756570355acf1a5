"""The pilots of this package, by factory."""

from __future__ import annotations

from shipland.guidance.far import FarTables, far_control
from shipland.guidance.horizon.learned import LearnedSteering
from shipland.guidance.horizon.pilot import HorizonPilot
from shipland.guidance.mode_pilot import ModePilot
from shipland.guidance.near import PublishedNear
from shipland.guidance.pilot import Pilot, PilotSetup


def paper(setup: PilotSetup) -> Pilot:
    """The published pilot: Eq. 1 on boxes, Eq. 2 and 3 on corners [Lee2022], as the errata read them."""
    guidance = setup.guidance
    tables = FarTables.for_camera(guidance.ship, guidance.bar, setup.camera)
    far = far_control(
        guidance.far_control, guidance.far_variant, guidance.far_baselines, guidance.near, tables, setup.camera
    )
    return ModePilot(setup, tables, far, PublishedNear(guidance.near))


def horizon(setup: PilotSetup) -> Pilot:
    """Ours: one estimate from the first box to contact, with the vehicle's own velocity, and linear-quadratic gains."""
    return HorizonPilot(setup)


def residual(setup: PilotSetup) -> Pilot:
    """`horizon` with a learned, bounded addition to its horizontal input over the deck (docs/learning.md)."""
    return HorizonPilot(setup, LearnedSteering(setup.guidance.learned.residual, "residual", setup.response))


def learned(setup: PilotSetup) -> Pilot:
    """`horizon` whose horizontal input over the deck is a learned policy's (docs/learning.md)."""
    return HorizonPilot(setup, LearnedSteering(setup.guidance.learned.direct, "direct", setup.response))
