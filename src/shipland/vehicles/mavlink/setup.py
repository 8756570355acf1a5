"""What a MAVLink vehicle is made from, and how an address says it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from shipland.camera import Camera
from shipland.config import build
from shipland.errors import ConfigError, VehicleError
from shipland.vehicles.address import Address, VehicleSetup
from shipland.vehicles.camera_stream import PictureSource, StreamParameters, VideoSource
from shipland.vehicles.checks import PreflightParameters
from shipland.vehicles.frame_link import FrameSource
from shipland.vehicles.mavlink.guard_process import GuardedPort
from shipland.vehicles.mavlink.link import read_key
from shipland.vehicles.mavlink.parameters import MavlinkParameters
from shipland.vehicles.mavlink.ports import Place
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.state import AutopilotState
from shipland.vehicles.touchdown import TouchdownParameters

OPTIONS = ("camera", "latency_s", "mount_deg", "kind", "system", "key", "take", "takeoff", "own_landing")
"""What may stand after the ? of a mavlink:// address."""
_SET_POINT_BITS = 780
"""Of the longest set-point on a serial line: 78 bytes with its signature."""


@dataclass(frozen=True)
class Engagement:
    """What we may do by ourselves.

    Attributes:
        take: ask for the guided mode.
        take_off_m: arm and take off to this height; 0: somebody else does.
        own_landing: ask for the autopilot's own once our pilot would land, for good.
    """

    take: bool = False
    take_off_m: float = 0.0
    own_landing: bool = False

    @property
    def asks(self) -> bool:
        """Whether we ask for the guided mode; otherwise the operator gives it."""
        return self.take or self.take_off_m > 0.0


@dataclass(frozen=True)
class MavlinkSetup:
    """What a MAVLink vehicle is made from.

    Attributes:
        place: of the link, as `Place.of` takes it.
        vehicle: system id; None for the first that is heard.
        key: for signing, or None.
        log: file for the raw messages, or None.
        camera: intrinsics.
        source: of the pictures.
        brings_gimbal: the pictures come with the camera's attitude.
        latency_s: stated, from exposure to receipt of the quickest picture; None where the pictures tell it.
        fixed_pitch_rad: of a camera fixed to the body; None for a gimbal.
        open_timeout_s: to the first picture.
        engagement: what we may do by ourselves.
        parameters, touchdown, preflight: sections.
        response_table: `[response]`.
    """

    place: str
    vehicle: int | None
    key: bytes | None
    log: Path | None
    camera: Camera
    source: PictureSource
    brings_gimbal: bool
    latency_s: float | None
    fixed_pitch_rad: float | None
    open_timeout_s: float
    engagement: Engagement
    parameters: MavlinkParameters
    touchdown: TouchdownParameters
    preflight: PreflightParameters
    response_table: Mapping[str, object]

    @staticmethod
    def of(setup: VehicleSetup) -> MavlinkSetup:
        """From an address and the vehicles' table; ConfigError when either is wrong."""
        address, table = setup.address, setup.table
        address.only(*OPTIONS)
        system = address.number("system", 0.0)
        if not (0.0 <= system < 256.0 and system == int(system)):
            raise ConfigError(f"mavlink://…?system={system:g}: expected 1 to 255")
        stream = build(StreamParameters, table["camera"], "vehicles.camera")
        stated = {**vars(stream), "latency_s": address.number("latency_s", stream.latency_s)}
        stream = build(StreamParameters, stated, f"{address.scheme}://…")
        source, brings_gimbal = _source(address, setup, stream)
        take_off_m = address.number("takeoff", 0.0)
        if not 0.0 <= take_off_m <= 50.0:
            raise ConfigError(f"mavlink://…?takeoff={take_off_m:g}: expected 0 to 50 m")
        parameters = build(MavlinkParameters, setup.section("mavlink"), "vehicles.mavlink")
        line, least_baud = Place.of(address.place), math.ceil(_SET_POINT_BITS * parameters.setpoint_hz)
        if line.kind == "serial" and line.number < least_baud:  # what leaves would be later and later
            raise ConfigError(
                f"mavlink://{address.place}: {parameters.setpoint_hz:g} set-points a second want {least_baud} baud or "
                "more; raise it, or lower setpoint_hz in [mavlink]"
            )
        return MavlinkSetup(
            place=address.place,
            vehicle=int(system) or None,
            key=read_key(Path(address.options["key"])) if "key" in address.options else None,
            log=setup.log,
            camera=setup.camera,
            source=source,
            brings_gimbal=brings_gimbal,
            latency_s=None if brings_gimbal else stream.latency_s,
            fixed_pitch_rad=setup.fixed_pitch_rad,
            open_timeout_s=stream.open_timeout_s,
            engagement=Engagement(address.flag("take"), take_off_m, address.flag("own_landing")),
            parameters=parameters,
            touchdown=build(TouchdownParameters, table["touchdown"], "vehicles.touchdown"),
            preflight=build(PreflightParameters, table["preflight"], "vehicles.preflight"),
            response_table=table["response"],
        )


def _source(address: Address, setup: VehicleSetup, stream: StreamParameters) -> tuple[PictureSource, bool]:
    """Where the pictures come from, and whether they bring the camera's attitude."""
    url = address.options.get("camera")
    if url is None:
        raise ConfigError(
            f"{address.scheme}://{address.place}: say where the pictures come from: ?camera=rtsp://…, /dev/video0, a "
            "file, gst:PIPELINE, or frames:HOST:PORT of `shipland serve-physics`"
        )
    if url.startswith("frames:"):
        return FrameSource.at(url, setup.camera), True
    size_px = setup.camera.width_px, setup.camera.height_px
    return VideoSource(url, stream.latency_s, size_px, stream.open_timeout_s), False


def open_session(setup: MavlinkSetup, on_state: Callable[[AutopilotState, AutopilotState], None]) -> Session:
    """The conversation, not yet begun; VehicleError when port or log cannot be opened."""
    log = None
    if setup.log is not None:
        try:
            setup.log.parent.mkdir(parents=True, exist_ok=True)
            log = setup.log.open("wb")
        except OSError as error:
            raise VehicleError(f"message log {setup.log} cannot be written: {error.strerror}") from None
    try:
        port = GuardedPort(setup.place)
    except BaseException:
        if log is not None:
            log.close()
        raise
    ids = setup.parameters.system_id, setup.parameters.component_id
    return Session(port, *ids, setup.vehicle, setup.key, log, on_state)
