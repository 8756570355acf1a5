"""`shipland scenarios`: what can be flown."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scenarios:
    """List the packaged scenarios."""

    def run(self) -> int:
        """Print a line each."""
        from shipland.config import packaged_names, packaged_toml

        for name in packaged_names("scenarios"):
            print(f"{name:16s} {packaged_toml(f'scenarios/{name}').get('description', '')}")
        return 0
