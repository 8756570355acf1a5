"""What is installed beside the base only where it is wanted: one table for errors, `shipland doctor` and the pages."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec

from shipland.errors import ShiplandError, SystemLibraryError


@dataclass(frozen=True)
class Extra:
    """One extra of pyproject.toml.

    Attributes:
        module: what importing it takes.
        use: what it is for.
    """

    module: str
    use: str


EXTRAS: dict[str, Extra] = {
    "plots": Extra("matplotlib", "pictures of flights and campaigns, `paper`, `motion`, `print-cue`"),
    "film": Extra("av", "videos and streams that are looked at; flight.mp4 in H.264, which browsers play"),
    "openvino": Extra("openvino", "detectors in half the time on a CPU that computes in bf16"),
    "dataset": Extra("pyarrow", "`shipland dataset` in Parquet, and in LeRobot's layout"),
    "mavlink": Extra("pymavlink", "ArduPilot and PX4 vehicles, their logs for `see`"),
    "ros2": Extra("rosbags", "`ros2://` vehicles, nodes and bags"),
    "mpc": Extra("osqp", "pilot `spectral_mpc`"),
    "viewer": Extra("rerun", "`shipland replay --viewer`"),
    "rl": Extra("gymnasium", "the Gymnasium environments"),
    "learn": Extra("stable_baselines3", "training policies"),
    "train": Extra("torch", "training detectors"),
    "cluster": Extra("ray", "`shipland campaign --cluster`"),
}


@cache
def installed(name: str) -> bool:
    """Whether an extra's module is here; it is not imported."""
    return find_spec(EXTRAS[name].module) is not None


def require(name: str, what: str, error: type[ShiplandError] = SystemLibraryError, module: str = "") -> None:
    """Do nothing where an extra is installed.

    Args:
        name: the extra.
        what: who wants it, the subject of the error's sentence.
        error: what is raised.
        module: one that is looked for in place of the extra's own.

    Raises:
        ShiplandError: it is not; the message says what to install.
    """
    module = module or EXTRAS[name].module
    if find_spec(module) is None:
        raise error(f"{what} needs {module}; install it with: pip install 'shipland[{name}]'")


def extra_of(module: str) -> str | None:
    """Extra that brings a module (a submodule as well); None for one of no extra."""
    top = module.partition(".")[0]
    return next((name for name, extra in EXTRAS.items() if extra.module == top), None)
