"""The pilots of this package, by factory."""

from __future__ import annotations

from shipland.guidance.far import FarTables, FarTarget, far_control
from shipland.guidance.horizon.pilot import HorizonPilot
from shipland.guidance.mode_pilot import ModePilot
from shipland.guidance.near import PublishedNear
from shipland.guidance.offset_free import OffsetFreeNear
from shipland.guidance.offset_free_far import OffsetFreeFar
from shipland.guidance.pilot import Pilot, PilotSetup


def paper(setup: PilotSetup) -> Pilot:
    """The published pilot: Eq. 1 on boxes, Eq. 2 and 3 on corners [Lee2022], as the errata read them."""
    guidance = setup.guidance
    tables = FarTables.for_camera(guidance.ship, guidance.bar, setup.camera)
    far = far_control(
        guidance.far_control, guidance.far_variant, guidance.far_baselines, guidance.near, tables, setup.camera
    )
    return ModePilot(setup, tables, far, PublishedNear(guidance.near))


def offset_free(setup: PilotSetup) -> Pilot:
    """The same modes with filters that estimate the disturbance: no steady error in wind or behind a moving ship."""
    guidance, rig, camera = setup.guidance, setup.rig, setup.camera
    board_width_m, board_height_m = rig.board_size_m
    areas_m2 = {
        FarTarget.SHIP: rig.platform_width_m * rig.superstructure_height_m,
        FarTarget.BAR: board_width_m * board_height_m,
    }
    middle_px = (float(camera.matrix[0, 2]), float(camera.matrix[1, 2]))
    tables = FarTables.for_camera(guidance.ship, guidance.bar, camera)
    far = OffsetFreeFar(guidance.offset_free_far, setup.response, camera.focal_px, middle_px, tables, areas_m2)
    return ModePilot(setup, tables, far, OffsetFreeNear(guidance.offset_free, setup.response))


def horizon(setup: PilotSetup) -> Pilot:
    """Ours: one estimate from the first box to contact, with the vehicle's own velocity, and linear-quadratic gains."""
    return HorizonPilot(setup)
