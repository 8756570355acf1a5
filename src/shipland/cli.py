"""The command line: one module of `shipland.commands` a command, light to import; the heavy work comes in `run`."""

from __future__ import annotations

import ast
import importlib
import inspect
import io
import itertools
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout, suppress
from pathlib import Path
from typing import Annotated, Any, Protocol, Union, get_type_hints

import docstring_parser
import tyro

from shipland.errors import ConfigError, ShiplandError
from shipland.extras import extra_of
from shipland.former import FORMER_OPTIONS
from shipland.stopping import signals_interrupt

COMMANDS = (
    "demo", "fly", "campaign", "envelope", "compare", "report", "submit", "verify", "dataset", "again", "replay", "bag",
    "paper", "motion", "see", "detect", "synth", "train", "evaluate", "learn", "print-cue", "calibrate", "identify",
    "publish", "serve-physics", "scenarios", "example", "config", "suites", "doctor", "version",
)  # fmt: skip
"""In the order of `shipland --help`; each is a class in its own module of `shipland.commands`."""


class Command(Protocol):
    """One command: its fields are its arguments."""

    def run(self) -> int:
        """Do it; the exit code."""


def command_of(name: str) -> type[Command]:
    """`ServePhysics` of `serve-physics`."""
    module = importlib.import_module(f"shipland.commands.{name.replace('-', '_')}")
    found: type[Command] = getattr(module, name.title().replace("-", ""))
    return found


def briefly(name: str) -> Any:  # noqa: ANN401 - tyro reads annotations of any form
    """What tyro makes a subcommand of, with the first sentence of its help alone."""
    command = command_of(name)
    text = inspect.cleandoc(command.__doc__ or "").partition("\n\n")[0]
    return Annotated[command, tyro.conf.subcommand(name, description=text)]


def parsed(words: Sequence[str]) -> Command:
    """The command that the words ask for; SystemExit after help, or after words that say what is wrong."""
    if words[:1] == ["--version"]:
        return command_of("version")()
    command: Any = command_of(words[0]) if words and words[0] in COMMANDS else None
    said = _Said()
    try:
        with redirect_stdout(said) if {"-h", "--help"} & set(words) else nullcontext():
            if command is not None:
                _polish(command)
                return tyro.cli(command, args=words[1:], prog=f"shipland {words[0]}", config=_CONFIG)  # type: ignore[no-any-return]
            any_command: Any = Union[tuple(map(briefly, COMMANDS))]  # noqa: UP007 - made at run time
            return tyro.cli(any_command, args=words, prog="shipland", config=_CONFIG, description=_ABOUT)  # type: ignore[no-any-return]
    finally:
        said.show()


_CONFIG = (tyro.conf.DisallowNone, tyro.conf.FlagCreatePairsOff)
_ABOUT = """Lands a camera-carrying VTOL drone on a ship: no GPS, no link to the ship.

`shipland COMMAND --help` explains one command, with an example. A first flight: shipland demo"""


class _Said(io.StringIO):
    """Help as tyro prints it: where it breaks no line of prose, a terminal breaks within words."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        """As the real one, for colours."""
        return sys.__stdout__ is not None and sys.__stdout__.isatty()

    def show(self) -> None:
        """Print it, with prose broken at the terminal's width and one empty line between paragraphs."""
        width = min(shutil.get_terminal_size().columns, 100)
        text = re.sub(r"\[-h\] \{.*\}", "[-h] [--version] COMMAND …", self.getvalue())
        for line in re.sub("\n{3,}", "\n\n", text).splitlines():
            prose = (line[:1].isalpha() or line[:1] == "`") and not line.startswith("Example:")
            print(textwrap.fill(line, width, break_on_hyphens=False) if prose else line)


def _polish(command: type[Command]) -> None:
    """Options' words flow over their lines; a default that says nothing (None, an empty text, a flag's) is left out."""
    words = _words_of_fields(command)
    for name, hint in get_type_hints(command, include_extras=True).items():
        default = getattr(command, name, 0)
        hidden = "" if default in (None, "", ()) or isinstance(default, bool) else None
        metavar = "PATH …" if hint == tuple[Path, ...] else "NAME …" if hint == tuple[str, ...] else None
        if getattr(hint, "__metadata__", ())[-1:] == (tyro.conf.Positional,):
            metavar = f"[{name.upper()}]" if hasattr(command, name) else name.upper()
        said = words.get(name, "")
        shown: Any = tyro.conf.arg(metavar=metavar, help=said[:1].upper() + said[1:], help_behavior_hint=hidden)
        command.__annotations__[name] = Annotated[hint, shown]


def _words_of_fields(command: type[Command]) -> dict[str, str]:
    """What a docstring says of each field, its own or the class's, in one line; tyro breaks where the source does."""
    told = docstring_parser.parse(command.__mro__[1].__doc__ or "").params
    words = {each.arg_name: " ".join((each.description or "").split()) for each in told}
    for owner in command.__mro__[-2::-1]:
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
        for field, below in itertools.pairwise(getattr(tree, "body", [])):
            match field, below:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                    words[name] = " ".join(text.split())
    return words


def main() -> None:
    """Entry point. An error prints one line, exit 2; after Ctrl-C and its like the files are complete, exit 130."""
    # Matrices here are small: threads of their own would only spin. Before NumPy is imported; workers inherit it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal without ° or – shows ? in their place
            stream.reconfigure(errors="replace")
    try:
        _refuse_former(sys.argv[1:])
        command = parsed(sys.argv[1:])
        with signals_interrupt():
            code = command.run()
    except ShiplandError as error:
        _tell(" ".join(str(error).split()))
        code = 2
    except KeyboardInterrupt:
        _tell("interrupted; what was written is complete")
        code = 130
    except BrokenPipeError:
        code = 1
    except ModuleNotFoundError as error:
        extra = extra_of(error.name or "")
        if extra is None:
            raise
        _tell(f"this needs {error.name}; install it with: pip install 'shipland[{extra}]'")
        code = 2
    except OSError as error:  # a full disk, a missing permission
        where = f"{error.filename}: " if error.filename else ""
        _tell(f"{where}{error.strerror or error}")
        code = 2
    _let_go_of_broken_streams()
    raise SystemExit(code)


def _refuse_former(words: Sequence[str]) -> None:
    """ConfigError for an option's former name; it says the new one."""
    for word in words[1:]:
        option = word.partition("=")[0]
        new = FORMER_OPTIONS.get((words[0], option))
        if new is not None:
            raise ConfigError(f"{option} of `shipland {words[0]}` is called {new} now")


def _tell(words: str) -> None:
    """One line, where there still is somebody to read it."""
    with suppress(OSError, ValueError):
        print(f"shipland: {words}", file=sys.stderr)


def _let_go_of_broken_streams() -> None:
    """Python flushes once more at its end, and would make exit code 120 of a reader that has gone."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


if __name__ == "__main__":
    main()
