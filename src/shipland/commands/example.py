"""`shipland example`: the examples, a folder of the source that the wheel carries as `shipland/examples`."""

from __future__ import annotations

import difflib
import itertools
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import NameArgument, say
from shipland.errors import ConfigError, DataError

_PACKAGE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Example:
    """Write one of the examples into this folder; without a name, list them.

    A file that is there already stays as it is.

    Example: shipland example own_pilot.py
    """

    name: NameArgument = ""
    """File name of the example."""
    out: Path | None = None
    """Write it there instead."""

    def run(self) -> int:
        """List or write."""
        packaged = _PACKAGE / "examples"
        folder = packaged if packaged.is_dir() else _PACKAGE.parents[1] / "examples"
        texts = {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.*")) if path.is_file()}
        if not self.name:
            for name, text in texts.items():
                print(f"{name:22s} {_first_sentence(text)}")
            return 0
        if self.name not in texts:
            near = " or ".join(difflib.get_close_matches(self.name, texts, n=1, cutoff=0.0))
            raise ConfigError(f"no example {self.name!r}; did you mean {near}? `shipland example` lists all")
        out = self.out or Path(self.name)
        try:
            with out.open("x", encoding="utf-8") as file:
                file.write(texts[self.name])
        except FileExistsError:
            raise DataError(f"{out} is there already; --out gives another place") from None
        say(f"written: {out}")
        return 0


def _first_sentence(text: str) -> str:
    """Of a notebook's first cell below its heading, of the comment at the top, or of a module's docstring."""
    if text.startswith("{"):
        _, text = "".join(json.loads(text)["cells"][0]["source"]).split("\n\n", 1)
    within: Callable[[str], object] = (lambda line: line.startswith("#")) if text.startswith("#") else str.strip
    head = " ".join(line.strip("\"'# ") for line in itertools.takewhile(within, text.splitlines()))
    return re.split(r"(?<!Eq)\.(?:\s|$)", head, maxsplit=1)[0]
