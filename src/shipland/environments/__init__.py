"""Gymnasium environments; importing this package registers them.

`shipland/Landing-v0` is a whole landing by its sticks; `shipland/LastPhase-v0` is its last metres, as a learned policy
flies them.
"""

from __future__ import annotations

from shipland.extras import require

require("rl", "shipland.environments")
import gymnasium  # noqa: E402 - the line above says what to install

LANDING = "shipland/Landing-v0"
LAST_PHASE = "shipland/LastPhase-v0"

gymnasium.register(LANDING, entry_point="shipland.environments.landing:LandingEnv")
gymnasium.register(LAST_PHASE, entry_point="shipland.environments.last_phase:LastPhaseEnv")
