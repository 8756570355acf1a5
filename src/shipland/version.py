"""Which code this is."""

from __future__ import annotations

import functools
import subprocess  # git alone, with fixed arguments
from pathlib import Path

__version__ = "0.1.0"


@functools.cache
def code_version() -> str:
    """The release; from a checkout also its commit, and `dirty` where files differ from it."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return __version__
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)  # noqa: S603
    except (OSError, subprocess.SubprocessError):
        return __version__
    return f"{__version__}+{done.stdout.strip()}"
