"""Where a vehicle is: `scheme://place?option=value`, as `--vehicle` takes it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import parse_qsl

from shipland.camera import Camera
from shipland.config import merge, packaged_toml, sections
from shipland.errors import ConfigError

_PASSWORD = re.compile(r"((?:://|%3A%2F%2F)[^/?&@:%\s]*(?::|%3A))(?:(?!%40)[^/?&@\s])+(?=@|%40)", re.IGNORECASE)


def without_password(text: str) -> str:
    """An address, or a command line with one, as it may be shown and written down.

    >>> without_password("rtsp://me:secret@192.168.1.5:554/live")
    'rtsp://me:***@192.168.1.5:554/live'
    """
    return _PASSWORD.sub(r"\1***", text)


@dataclass(frozen=True)
class Address:
    """A vehicle's address.

    Attributes:
        scheme: name of the vehicle's factory, in the group `vehicles`.
        place: what stands after `://`: a file, a host, a link.
        options: what stands after `?`, by name; text as typed.
    """

    scheme: str
    place: str
    options: Mapping[str, str] = field(default_factory=dict)

    @staticmethod
    def parse(text: str) -> Address:
        """Take an address apart.

        >>> Address.parse("mavlink://udp:127.0.0.1:14550?kind=velocity").options
        {'kind': 'velocity'}

        Raises:
            ConfigError: it is no address.
        """
        scheme, separator, rest = text.partition("://")
        place, _, query = rest.partition("?")
        if not separator or not scheme or not place:
            raise ConfigError(
                f"--vehicle {text}: expected scheme://place, as mavlink://udp:127.0.0.1:14550, anafi://192.168.42.1 "
                "or replay://flight.mcap"
            )
        try:  # a + is one, as in a password; in a form's fields it is a space
            given = parse_qsl(query.replace("+", "%2B"), keep_blank_values=True, strict_parsing=bool(query))
        except ValueError:
            raise ConfigError(f"--vehicle {text}: expected option=value after the ?, with & between them") from None
        options = dict(given)
        if len(options) < len(given):
            raise ConfigError(f"--vehicle {text}: an option is given twice; percent-encode the & of a camera's address")
        return Address(scheme, place, options)

    def only(self, *known: str) -> None:
        """Refuse options that the vehicle does not know; ConfigError lists those it does."""
        for name in self.options:
            if name not in known:
                listed = ", ".join(known) or "none"
                raise ConfigError(f"{self.scheme}:// has no option {name!r}; there are: {listed}")

    def number(self, name: str, default: float) -> float:
        """An option as a finite number; ConfigError when it is none."""
        text = self.options.get(name)
        if text is None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ConfigError(f"{self.scheme}://…?{name}={text}: expected a number")
        return value

    def known_number(self, name: str) -> float | None:
        """As `number`; None where the option is not given."""
        return self.number(name, math.nan) if name in self.options else None

    def flag(self, name: str) -> bool:
        """Whether an option is switched on: 1, yes, true; ConfigError for what is neither on nor off."""
        text = self.options.get(name, "0").lower()
        if text not in ("1", "yes", "true", "0", "no", "false"):
            raise ConfigError(f"{self.scheme}://…?{name}={text}: expected 1 or 0")
        return text in ("1", "yes", "true")


@dataclass(frozen=True)
class VehicleSetup:
    """What a vehicle is made from.

    Attributes:
        address: where it is.
        camera: intrinsics of its pictures, where the vehicle does not bring its own.
        table: see `vehicle_table`.
        log: file for what link and vehicle say to each other, where somebody wants it.
        calibrated: whether `camera` is a calibration that the user gave.
    """

    address: Address
    camera: Camera
    table: Mapping[str, Mapping[str, object]]
    log: Path | None = None
    calibrated: bool = False

    def section(self, name: str) -> dict[str, object]:
        """`[NAME]`, with the `kind` that the address may give."""
        return {**self.table[name], **{key: text for key, text in self.address.options.items() if key == "kind"}}

    @property
    def fixed_pitch_rad(self) -> float | None:
        """Pitch of a camera fixed to the body, which the option `mount_deg` gives; None for one on a mount."""
        pitch_deg = self.address.known_number("mount_deg")
        if pitch_deg is None:
            return None
        if not -90.0 <= pitch_deg <= 90.0:
            raise ConfigError(f"{self.address.scheme}://…?mount_deg={pitch_deg:g}: expected -90 to 90")
        return math.radians(pitch_deg)


def vehicle_table(path: Path | None) -> Mapping[str, Mapping[str, object]]:
    """The user's file over what is assumed of vehicles, a table for each section; ConfigError when it is wrong."""
    known = ("mavlink", "anafi", "ros2", "touchdown", "camera", "preflight", "response")
    assumed: Mapping[str, Mapping[str, object]] = {name: {} for name in known} | packaged_toml("vehicles")
    return merge(assumed, sections(path, known))
