"""What MkDocs does beyond Markdown: tables of the packaged configuration, and formulas as MathML without scripts."""

from __future__ import annotations

import html
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from itertools import groupby
from pathlib import Path
from typing import Any

import griffe
from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError

from shipland.cli import COMMANDS
from shipland.config import plain, toml_value
from shipland.report.configuration import Setting, settings_of
from shipland.scenario.scenario import Scenario

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
sys.path.insert(0, str(ROOT))  # the studies stand beside the package
from studies.tables import TableError, checked  # noqa: E402

NO_BREAK_SPACE = "\u00a0"
SHOWN = re.compile(r'^\[[^\]\n]+\]\(([^)\s]+) "(shown|tables|commands|columns of \w+)"\)$', re.MULTILINE)
OUTSIDE = re.compile(r'(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)\s#]+)(?: "[^"]*")?\)')
SEVERAL_NAMES = re.compile(r"^( +)(\w+(?:, | … )\w[\w, …]*): ", re.MULTILINE)
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_pre_build(**_: Any) -> None:  # noqa: ANN401 - MkDocs passes its own objects by name
    """Fails the build when a table of the README differs from its results."""
    _compared((ROOT / "README.md").read_text(encoding="utf-8"), "README.md")


def _compared(markdown: str, page: str) -> str:
    try:
        return checked(markdown, page)
    except TableError as error:
        raise PluginError(str(error)) from None


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:  # noqa: ANN401
    """Puts in what a page links to or names, so that the page reads whole on a forge as well.

    A line that is a link with the title `shown`, `tables`, `commands` or `columns of …` becomes the file, the tables of
    a configuration, every command's help, or the tables of columns. Links to files outside `docs/` become their text,
    because the site does not hold these files. Tables of results are compared with them;
    those of earlier code get a note.
    """
    markdown = _compared(markdown, page.file.src_uri)
    folder = (DOCS / page.file.src_uri).parent
    markdown = SHOWN.sub(lambda match: _shown((folder / match[1]).resolve(), match[2]), markdown)
    return OUTSIDE.sub(lambda match: _inside(match, folder), markdown)


def _shown(path: Path, how: str) -> str:
    if how.startswith("columns of "):
        return column_table(how.removeprefix("columns of "))
    if how == "commands":
        return "\n\n".join(f"## shipland {name}\n\n```text\n{help_of(name)}\n```" for name in COMMANDS)
    if how == "tables":
        return f"`{path.relative_to(ROOT)}`:\n\n{page_tables(path.name)}"
    return f"```{path.suffix[1:]}\n{path.read_text(encoding='utf-8')}```"


def page_tables(module: str) -> str:
    """Markdown of the sections that a module's file name stands for: see `markdown_tables`."""
    from shipland.learning.evaluate import EvaluateParameters
    from shipland.learning.settings import PROFILES
    from shipland.learning.shots import SynthParameters
    from shipland.record.channels import LogParameters
    from shipland.report.video import VideoParameters
    from shipland.vehicles.anafi.setup import AnafiParameters
    from shipland.vehicles.camera_stream import StreamParameters
    from shipland.vehicles.checks import PreflightParameters
    from shipland.vehicles.mavlink.parameters import MavlinkParameters
    from shipland.vehicles.ros2.setup import Ros2Parameters
    from shipland.vehicles.touchdown import TouchdownParameters

    training = {f"train.{name}": profile for name, profile in PROFILES.items()}
    pages: dict[str, dict[str, Any]] = {
        "scenario.py": {"": Scenario(name="near")},
        "outputs.py": {"log": LogParameters(), "video": VideoParameters()},
        "settings.py": {**training, "synth": SynthParameters(), "evaluate": EvaluateParameters()},
        "address.py": {
            "mavlink": MavlinkParameters(),
            "ros2": Ros2Parameters(),
            "anafi": AnafiParameters(),
            "touchdown": TouchdownParameters(),
            "camera": StreamParameters(),
            "preflight": PreflightParameters(),
        },
    }
    inside = [settings_of(type(it), plain(it), section) for section, it in pages[module].items()]
    return markdown_tables(setting for settings in inside for setting in settings)


def markdown_tables(settings: Iterable[Setting]) -> str:
    """Markdown: for each section a heading and a table of key, default, unit, bounds, meaning and source."""
    lines: list[str] = []
    for section, inside in groupby(settings, key=lambda setting: setting.section):
        first, *others = inside
        lines += ["", f"### `[{section}]`" if section else "### Above all sections", ""]
        lines += [first.about, ""] if first.about and section else []
        lines += ["| key | default | unit | bounds | meaning | source |", "|---|---|---|---|---|---|"]
        for setting in (first, *others):
            value = "" if setting.value is None else f"`{toml_value(setting.value)}`"
            cells = (value, setting.unit, setting.bounds, setting.meaning, setting.source)
            lines.append(f"| `{setting.name}` | " + " | ".join(cell.replace("|", "&#124;") for cell in cells) + " |")
    return "\n".join(lines)


def _inside(match: re.Match[str], folder: Path) -> str:
    if (folder / match[2]).resolve().is_relative_to(DOCS):
        return match[0]
    return match[1] if match[1].startswith("`") or "." not in match[1] else f"`{match[1]}`"


def help_of(command: str) -> str:
    """What `shipland COMMAND --help` prints."""
    environment = os.environ | {"COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb"}
    words = [sys.executable, "-m", "shipland.cli", *command.split(), "--help"]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    return "\n".join(line.rstrip() for line in done.stdout.splitlines()).strip()


def column_table(what: str) -> str:
    """Markdown: column, unit and meaning of `landings` (rows of campaigns) or `flight` (rows of the log)."""
    from shipland.descriptions import descriptions, unit_of
    from shipland.evaluation.landing import COLUMNS, Conditions, Landing, Phases
    from shipland.messages import FlightRecord
    from shipland.record.columns import Derived
    from shipland.rows import json_schema

    if what == "landings":
        said = descriptions(Landing) | descriptions(Phases) | descriptions(Conditions)
        meanings = {name: said[name] for name in COLUMNS}
    else:
        rows = {"": FlightRecord, "derived_": Derived}
        schemas = {prefix: json_schema(cls, "")["properties"] for prefix, cls in rows.items()}
        meanings = {
            f"{prefix}{name}": column["description"]
            for prefix, columns in schemas.items()
            for name, column in columns.items()
        }
    lines = [f"| `{name}` | {unit_of(name)} | {meaning.rstrip('.')} |" for name, meaning in meanings.items()]
    return "\n".join(["| column | unit | meaning |", "|---|---|---|", *lines])


def on_page_content(content: str, **_: Any) -> str:  # noqa: ANN401
    """Turns TeX between dollars into MathML, which browsers draw themselves."""
    return FORMULA.sub(
        lambda match: convert(html.unescape(match[2]), display="block" if match[1] == "div" else "inline"), content
    )


class SeveralNames(griffe.Extension):
    """Lets a docstring describe several attributes in one line: `a, b: …` would be read as `a` of type `b`."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:  # noqa: ANN401
        """Makes the spaces between the names non-breaking, which keeps them one name."""
        if obj.docstring:
            obj.docstring.value = SEVERAL_NAMES.sub(
                lambda match: f"{match[1]}{match[2].replace(' ', NO_BREAK_SPACE)}: ", obj.docstring.value
            )
