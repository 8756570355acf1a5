"""Gymnasium environments; importing this package registers them.

`shipland/Landing-v0` is the real loop, one landing; `shipland/LastPhase-v0`, for `gymnasium.make_vec`, is a batched
model of the last phase (extra `train`).
"""

from __future__ import annotations

from shipland.errors import SystemLibraryError

try:
    import gymnasium
except ImportError:
    raise SystemLibraryError(
        "shipland.environments wants Gymnasium, which is not installed; pip install 'shipland[rl]'"
    ) from None

LANDING = "shipland/Landing-v0"
LAST_PHASE = "shipland/LastPhase-v0"

gymnasium.register(LANDING, entry_point="shipland.environments.landing:LandingEnv")
gymnasium.register(LAST_PHASE, vector_entry_point="shipland.environments.last_phase:LastPhaseEnv")
