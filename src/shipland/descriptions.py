"""What the fields of a dataclass mean, in the words of its docstring, and their units, from their names."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import re

_ENTRY = re.compile(r"^ {4}(\w[\w, …]*): (.*)")
_UNITS = {
    "rad_per_sqrt_s": "rad/√s",
    "m_per_sqrt_s": "m/√s",
    "percent_per_s": "%/s",
    "px_per_m": "px/m",
    "per_s2": "1/s²",
    "per_s": "1/s",
    "per_m": "1/m",
    "rad_s2": "rad/s²",
    "rad_s": "rad/s",
    "deg_s": "°/s",
    "px_s": "px/s",
    "mm_h": "mm/h",
    "kgm2": "kg m²",
    "mps2": "m/s²",
    "m_s": "m/s",
    "mps": "m/s",
    "percent": "%",
    "deg": "°",
    "hz": "Hz",
    "ev": "EV",
    "n": "N",
    **{unit: unit for unit in ("rad", "px", "kg", "kn", "m", "s")},
}
"""By the last part of a name; the longer first."""


@functools.cache
def descriptions(cls: type) -> dict[str, str]:
    """Meanings of the fields that the docstring's `Attributes` list; `a, b: …` and `a … c: …` describe several."""
    body = inspect.getdoc(cls) or ""
    attributes = body.partition("\nAttributes:\n")[2].partition("\n\n")[0]
    found: dict[str, str] = {}
    names: list[str] = []
    for line in attributes.splitlines():
        entry = _ENTRY.match(line)
        if entry:
            names = _named(cls, entry[1])
        for name in names:
            text = entry[2] if entry else line
            found[name] = f"{found.get(name, '')} {text.strip()}".strip()
    return found


def unit_of(name: str) -> str:
    """The unit that a field's name ends in; empty where it has none."""
    return next((unit for ending, unit in _UNITS.items() if name.endswith(f"_{ending}")), "")


def _named(cls: type, text: str) -> list[str]:
    """`a, b` or `a … c` as the names of fields."""
    if "…" not in text:
        return [name.strip() for name in text.split(",")]
    first, last = (name.strip() for name in text.split("…"))
    every = [field.name for field in dataclasses.fields(cls)]
    return every[every.index(first) : every.index(last) + 1] if {first, last} <= set(every) else []
