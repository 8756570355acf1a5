"""What the pictures are of: a ship, and the camera that sees it."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.camera import CameraParameters
from shipland.rig import Rig


@dataclass(frozen=True)
class ShipAndCamera:
    """A ship, the camera that sees it, and the name of the scenario of both; None for the packaged ones."""

    name: str | None
    rig: Rig
    camera: CameraParameters

    @staticmethod
    def packaged() -> ShipAndCamera:
        """The rig and the camera of the packaged configuration."""
        return ShipAndCamera(None, Rig(), CameraParameters())

    def note(self) -> dict[str, object]:
        """What a folder's note tells of it, so that two ships are not mixed in one; nothing of the packaged ones."""
        return {} if self.name is None else {"scenario": self.name}
