"""The pilots of this package, by factory."""

from __future__ import annotations

from shipland.guidance.far import far_control
from shipland.guidance.mode_pilot import ModePilot
from shipland.guidance.near import PublishedNear
from shipland.guidance.offset_free import OffsetFreeNear
from shipland.guidance.offset_free_far import OffsetFreeFar
from shipland.guidance.pilot import Pilot, PilotSetup


def paper(setup: PilotSetup) -> Pilot:
    """The published pilot: Eq. 1 on boxes, Eq. 2 and 3 on corners [Lee2022], as the errata read them."""
    guidance = setup.guidance
    far = far_control(
        guidance.far_control, guidance.far_variant, guidance.far_baselines, guidance.near, setup.camera.focal_px
    )
    return ModePilot(setup, far, PublishedNear(guidance.near))


def offset_free(setup: PilotSetup) -> Pilot:
    """The same modes with filters that know the disturbance: no steady error from wind or a ship under way."""
    guidance, rig, camera = setup.guidance, setup.rig, setup.camera
    board_width_m, board_height_m = rig.board_size_m
    areas_m2 = [
        (guidance.ship, rig.platform_width_m * rig.superstructure_height_m),
        (guidance.bar, board_width_m * board_height_m),
    ]
    middle_px = (float(camera.matrix[0, 2]), float(camera.matrix[1, 2]))
    far = OffsetFreeFar(guidance.offset_free_far, setup.response, camera.focal_px, middle_px, areas_m2)
    return ModePilot(setup, far, OffsetFreeNear(guidance.offset_free, setup.response))
