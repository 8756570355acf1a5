"""What users bring themselves (pilot, vision, vehicle, aircraft, …), looked up by name.

A name is one of three things: a packaged one (`paper`), an entry point of the group `shipland.pilots` and so on that
an installed package declares, or `module:factory` of any module that Python can import, files of the current folder
included. Names are passed on as they are: a worker process looks them up again.

`module:factory` is code that runs where it is named: the user names it, on the command line or in their own
configuration; a name found in a log or a table does not count (`is_own_code`).
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

from shipland.errors import ConfigError, ShiplandError

Factory = Callable[..., Any]

_PILOTS = (
    *("horizon", "paper", "p", "pid", "residual", "learned"),
    *("deck_following", "image_servoing", "spectral_mpc", "velocity_matching"),
)
PACKAGED: dict[str, dict[str, str]] = {
    "pilots": {name: f"shipland.guidance.pilot:{name}" for name in _PILOTS},
    "visions": {name: f"shipland.scenario.visions:{name}" for name in ("geometric", "published", "rendered")},
    "vehicles": {
        "anafi": "shipland.vehicles.anafi.vehicle:anafi",
        "mavlink": "shipland.vehicles.mavlink.vehicle:mavlink",
        "replay": "shipland.scenario.real_vehicle:replay",
        "ros2": "shipland.vehicles.ros2.vehicle:ros2",
    },
    "aircraft": {
        "quadrotor": "shipland.sim.aircraft.aircraft:Quadrotor",
        "servo_quadrotor": "shipland.sim.aircraft.servo:ServoQuadrotor",
    },
    "loops": {
        "attitude": "shipland.sim.aircraft.loops:AttitudeLoop",
        "velocity": "shipland.sim.aircraft.loops:VelocityLoop",
    },
    "detectors": {},
}
"""`module:factory` of everything that comes with the package, by group and name."""


def names(group: str) -> list[str]:
    """Names that `resolve` knows in a group: the packaged ones and those of installed packages."""
    return sorted({*PACKAGED[group], *(point.name for point in metadata.entry_points(group=f"shipland.{group}"))})


def resolve(group: str, name: object) -> Factory:
    """The factory of that name; what is callable already is given back.

    Args:
        group: a key of `PACKAGED`.
        name: a packaged name, an entry point's name, `module:factory`, or the factory itself.

    Raises:
        ConfigError: it is neither a name nor callable, there is no such name (the message lists the ones there are),
            no such module, or nothing callable in it.
    """
    if callable(name):
        return name
    if not isinstance(name, str):
        known = ", ".join(names(group))
        raise ConfigError(f"{name!r} is none of the {group}; expected a name ({known}), module:factory or a factory")
    if name in PACKAGED[group]:
        return _load(group, PACKAGED[group][name])
    if is_own_code(name):
        add_here()
        return _load(group, name)
    for point in metadata.entry_points(group=f"shipland.{group}", name=name):
        return _load(group, point.value)
    known = ", ".join(names(group))
    listed = f"there are: {known}" if known else "none are packaged"
    raise ConfigError(f"no {name!r} among the {group}; {listed}; your own is given as module:factory")


def add_here() -> None:
    """Modules of the current folder can be imported."""
    here = str(Path.cwd())
    if here not in sys.path and "" not in sys.path:
        sys.path.append(here)  # at the end: a file named like a library must not take the library's place


def is_own_code(name: str) -> bool:
    """Whether `resolve` would import a module that the name itself gives: neither packaged nor an entry point."""
    return ":" in name


def name_of(factory: str | Factory) -> str:
    """The name to write down: a name as it is, of a factory `module:factory`."""
    if isinstance(factory, str):
        return factory
    qualified = getattr(factory, "__qualname__", type(factory).__qualname__)
    return f"{getattr(factory, '__module__', type(factory).__module__)}:{qualified}"


def _load(group: str, path: str) -> Factory:
    module_name, _, attribute = path.partition(":")
    try:
        found: Any = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        # A library that the module itself wants is another matter than a module that is not there.
        if error.name is None or not f"{module_name}.".startswith(f"{error.name}."):
            raise ConfigError(f"{path}, of the {group}, cannot be imported: {error}") from error
        raise ConfigError(f"{path}, of the {group}: no module {module_name!r} here or among the installed") from None
    except ShiplandError:  # an extra that is missing; the error says which
        raise
    except Exception as error:
        raise ConfigError(f"{path}, of the {group}, cannot be imported: {type(error).__name__}: {error}") from error
    for part in attribute.split("."):
        found = getattr(found, part, None)
    if not callable(found):
        functions = [key for key, value in vars(sys.modules[module_name]).items() if _own(value, module_name)]
        there = f"; it has: {', '.join(functions)}" if functions else ""
        raise ConfigError(f"{path}, of the {group}: module {module_name} has no {attribute!r} to call{there}")
    factory: Factory = found
    return factory


def _own(value: object, module_name: str) -> bool:
    return callable(value) and getattr(value, "__module__", "") == module_name
