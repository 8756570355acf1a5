"""What MkDocs does beyond Markdown: tables of the packaged configuration, and formulas as MathML without scripts."""

from __future__ import annotations

import html
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import griffe
from latex2mathml.converter import convert

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))  # the studies stand beside the package
CONFIGS = ROOT / "src" / "shipland" / "configs"
NO_BREAK_SPACE = "\u00a0"
FILE = re.compile(r"<!-- file ([\w/]+\.(\w+)) -->")
HELP = re.compile(r"<!-- help of ([\w -]+) -->")
COLUMNS = re.compile(r"<!-- columns of (\w+) -->")
TABLES = re.compile(r"<!-- tables of (\w+\.toml) -->")
SEVERAL_NAMES = re.compile(r"^( +)(\w+(?:, | … )\w[\w, …]*): ", re.MULTILINE)
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_pre_build(**_: Any) -> None:  # noqa: ANN401 - MkDocs passes its own objects by name
    """Fails the build when a table of the README differs from its results."""
    from mkdocs.exceptions import PluginError
    from studies.tables import TableError, checked

    try:
        checked((ROOT / "README.md").read_text(encoding="utf-8"), "README.md")
    except TableError as error:
        raise PluginError(str(error)) from None


def on_page_markdown(markdown: str, page: Any = None, **_: Any) -> str:  # noqa: ANN401
    """Puts in what a page asks for: the comments that `FILE`, `HELP`, `COLUMNS` and `TABLES` match.

    Tables of results are compared with results/NAME.json; rows of earlier code get a badge.
    """
    from mkdocs.exceptions import PluginError
    from studies.tables import TableError, checked

    try:
        markdown = checked(markdown, page.file.src_path if page else "the page")
    except TableError as error:
        raise PluginError(str(error)) from None
    markdown = FILE.sub(lambda match: f"```{match[2]}\n{(ROOT / match[1]).read_text(encoding='utf-8')}```", markdown)
    markdown = HELP.sub(lambda match: f"```text\n{help_of(match[1])}\n```", markdown)
    markdown = COLUMNS.sub(lambda match: column_table(match[1]), markdown)
    return TABLES.sub(lambda match: configuration_tables((CONFIGS / match[1]).read_text(encoding="utf-8")), markdown)


def help_of(command: str) -> str:
    """What `shipland COMMAND --help` prints."""
    environment = os.environ | {"COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb"}
    words = [sys.executable, "-m", "shipland.cli", *command.split(), "--help"]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment)
    return "\n".join(line.rstrip() for line in done.stdout.splitlines()).strip()


def column_table(what: str) -> str:
    """Markdown: column, unit and meaning of `landings` (rows of campaigns) or `flight` (rows of the log)."""
    from shipland.evaluation.landing import COLUMNS, Conditions, Landing, Phases
    from shipland.messages import FlightRecord
    from shipland.record.columns import Derived
    from shipland.record.descriptions import descriptions, unit_of
    from shipland.record.rows import json_schema

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


def configuration_tables(text: str) -> str:
    """Markdown: for each section of a TOML text a heading and a table of key, value and comment."""
    lines, pending = [], ""
    for raw in text.splitlines():
        if raw.startswith("#") or not (pending or raw.strip()):
            continue
        pending = f"{pending}\n{raw}" if pending else raw
        parsed = _split(pending)
        if parsed is None:
            continue  # a value that goes on in the next line
        code, comment = parsed
        if code.startswith("["):
            lines += [
                "",
                f"### `{code}`",
                "",
                *([comment, ""] if comment else []),
                "| key | value | source or meaning |",
            ]
            lines += ["|---|---|---|"]
        else:
            if not lines:
                lines += ["### Above all sections", "", "| key | value | source or meaning |", "|---|---|---|"]
            key, _, value = code.partition("=")
            lines.append(f"| `{key.strip()}` | `{' '.join(value.split())}` | {comment.replace('|', '&#124;')} |")
        pending = ""
    return "\n".join(lines)


def _split(statement: str) -> tuple[str, str] | None:
    """Code and comment of one TOML statement, or None while it is not complete."""
    for end in [index for index, letter in enumerate(statement) if letter == "#"] + [len(statement)]:
        code = statement[:end].strip()
        try:
            tomllib.loads(code)
        except tomllib.TOMLDecodeError:
            continue
        return code, statement[end:].lstrip("# ").strip()
    return None
