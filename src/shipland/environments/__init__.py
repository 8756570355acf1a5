"""Gymnasium environments over the real loop; importing this package registers `shipland/Landing-v0`."""

from __future__ import annotations

from shipland.errors import SystemLibraryError

try:
    import gymnasium
except ImportError:
    raise SystemLibraryError(
        "shipland.environments wants Gymnasium, which is not installed; pip install 'shipland[rl]'"
    ) from None

LANDING = "shipland/Landing-v0"

gymnasium.register(LANDING, entry_point="shipland.environments.landing:LandingEnv")
