"""Vision-based ship landing of VTOL drones: no GPS, no link to the ship [Lee2022].

```python
import shipland

scenario = shipland.load_scenario("near", wind={"mean_mps": 3.0})
flight = shipland.fly(scenario, pilot="horizon", seed=7)
print(flight.reason, flight.error_m)
many = shipland.campaign("near", pilot=["paper", "horizon"], runs=100)
print(many.compare())
```

Importing the package is light: what it offers is loaded when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shipland.api import Flight, fly
    from shipland.campaigns import Campaign, campaign, load_suite
    from shipland.scenario.scenario import load_scenario
    from shipland.scenario.visions import without_pictures
    from shipland.vision.near.files import see

    __version__: str

_HOMES = {
    "Campaign": "campaigns",
    "Flight": "api",
    "campaign": "campaigns",
    "fly": "api",
    "load_scenario": "scenario.scenario",
    "load_suite": "campaigns",
    "see": "vision.near.files",
    "without_pictures": "scenario.visions",
}
"""Module of each public name."""
__all__ = [
    "Campaign",
    "Flight",
    "__version__",
    "campaign",
    "fly",
    "load_scenario",
    "load_suite",
    "see",
    "without_pictures",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - any of the names above
    if name == "__version__":
        return importlib.import_module("shipland.version").code_version()
    if name in _HOMES:
        return getattr(importlib.import_module(f"shipland.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'shipland' has no attribute {name!r}; it has: {', '.join(__all__)}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
