"""The protocol of a pilot, the arguments of its factory, and the factories of the packaged pilots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from shipland.camera import Camera
from shipland.frames import Array
from shipland.guidance.parameters import FarKind, GuidanceParameters
from shipland.guidance.response import Response
from shipland.messages import Decision, Observation, PilotCommand, Telemetry
from shipland.rig import Rig

if TYPE_CHECKING:  # each pilot imports what it alone flies with
    from shipland.guidance.mode_pilot import ModePilot
    from shipland.guidance.near import NearControl


class Pilot(Protocol):
    """Observation and telemetry in, decision out. Time comes with the data and may start anywhere."""

    def decide(self, observation: Observation, telemetry: Telemetry, sent: PilotCommand | None) -> Decision:
        """One cycle, decided at the telemetry's time; never raises.

        Args:
            observation: of the newest frame.
            telemetry: when the command is decided; also "now".
            sent: the command of the cycle before as it left the safety; None in the first cycle.
        """


@dataclass(frozen=True)
class PilotSetup:
    """Arguments of a pilot's factory.

    Attributes:
        guidance: the sections of `[guidance]`.
        rig: dimensions of ship, deck and bar.
        camera: intrinsics of the pictures.
        camera_in_body_m: (3,) the camera's optical centre.
        response: what the sticks do on this vehicle.
        rng: for pilots that draw.
    """

    guidance: GuidanceParameters
    rig: Rig
    camera: Camera
    camera_in_body_m: Array
    response: Response
    rng: np.random.Generator


def paper(setup: PilotSetup) -> Pilot:
    """The published pilot: Eq. 3 on boxes, Eq. 4 and 5 on corners [Lee2022], as the errata read them."""
    from shipland.guidance.near import PublishedNear

    return _by_modes(setup, setup.guidance.far_control, PublishedNear(setup.guidance.near))


def p(setup: PilotSetup) -> Pilot:
    """A baseline: the published modes with a linear P far and near, the near one by SIMC from the response."""
    from shipland.guidance.linear import LinearNear
    from shipland.guidance.simc import simc_p

    return _by_modes(setup, "p", LinearNear(simc_p, setup.guidance.near_baselines, setup.response))


def pid(setup: PilotSetup) -> Pilot:
    """A baseline: the published modes with a linear PID far and near, the near one by SIMC from the response."""
    from shipland.guidance.linear import LinearNear
    from shipland.guidance.simc import simc_pid

    return _by_modes(setup, "pid", LinearNear(simc_pid, setup.guidance.near_baselines, setup.response))


def velocity_matching(setup: PilotSetup) -> Pilot:
    """A rival: the published modes with a near control that matches the ship's velocity, as PX4's gains fly."""
    from shipland.guidance.rivals.velocity_matching import VelocityMatching

    return _by_modes(setup, "p", VelocityMatching(setup.guidance.velocity_matching, setup.response))


def image_servoing(setup: PilotSetup) -> Pilot:
    """A rival: the published modes with image-based visual servoing on the cue's corners."""
    from shipland.guidance.rivals.image_servoing import ImageServoing

    parameters, cue = setup.guidance.image_servoing, setup.rig.cue
    return _by_modes(
        setup, "p", ImageServoing(parameters, setup.response, cue, setup.camera, np.asarray(setup.camera_in_body_m))
    )


def spectral_mpc(setup: PilotSetup) -> Pilot:
    """A rival: the published modes with model predictive control to the waves that a spectrum predicts."""
    from shipland.guidance.rivals.spectral_mpc import SpectralMpc, SpectralPilot

    return _by_modes(setup, "p", SpectralMpc(setup.guidance.spectral_mpc, setup.response), SpectralPilot)


def deck_following(setup: PilotSetup) -> Pilot:
    """A rival: to the hover by the bar, then down by a tag on the deck, whose motion and attitude it follows."""
    from shipland.guidance.rivals.deck_following import DeckFollowing
    from shipland.guidance.rivals.velocity_matching import VelocityMatching

    return _by_modes(setup, "p", VelocityMatching(setup.guidance.velocity_matching, setup.response), DeckFollowing)


def horizon(setup: PilotSetup) -> Pilot:
    """Ours: one estimate from the first box to contact, with the vehicle's own velocity, and linear-quadratic gains."""
    from shipland.guidance.horizon.pilot import HorizonPilot

    return HorizonPilot(setup)


def residual(setup: PilotSetup) -> Pilot:
    """`horizon` with a learned, bounded addition to its input over the deck (docs/explanation/learned-policies.md)."""
    from shipland.guidance.horizon.learned import LearnedSteering
    from shipland.guidance.horizon.pilot import HorizonPilot

    return HorizonPilot(setup, LearnedSteering(setup.guidance.learned.residual, "residual", setup.response))


def learned(setup: PilotSetup) -> Pilot:
    """`horizon` whose horizontal input over the deck is a learned policy's (docs/explanation/learned-policies.md)."""
    from shipland.guidance.horizon.learned import LearnedSteering
    from shipland.guidance.horizon.pilot import HorizonPilot

    return HorizonPilot(setup, LearnedSteering(setup.guidance.learned.direct, "direct", setup.response))


def _by_modes(setup: PilotSetup, far_kind: FarKind, near: NearControl, pilot: type[ModePilot] | None = None) -> Pilot:
    """The published modes around a far law and a near control; a rival that differs beyond these has a pilot."""
    from shipland.guidance.far import FarTables, far_control
    from shipland.guidance.mode_pilot import ModePilot

    guidance = setup.guidance
    tables = FarTables.for_camera(guidance.ship, guidance.bar, setup.camera)
    far = far_control(far_kind, guidance.far_variant, guidance.far_baselines, guidance.near, tables, setup.camera)
    return (pilot or ModePilot)(setup, tables, far, near)
