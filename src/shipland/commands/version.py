"""`shipland version`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Version:
    """Print the version; from a checkout with its commit."""

    def run(self) -> int:
        """Print it."""
        from shipland.version import code_version

        print(code_version())
        return 0
