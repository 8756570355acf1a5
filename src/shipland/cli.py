"""The command line: one module of `shipland.commands` a command, light to import; the heavy work comes in `run`."""

from __future__ import annotations

import inspect
import os
import sys
from contextlib import suppress
from typing import Annotated, Any, Protocol, Union, get_type_hints

import tyro

from shipland.commands.again import Again
from shipland.commands.bag import Bag
from shipland.commands.calibrate import Calibrate
from shipland.commands.campaign import Campaign
from shipland.commands.compare import Compare
from shipland.commands.config import Config
from shipland.commands.detect import Detect
from shipland.commands.evaluate import Evaluate
from shipland.commands.example import Example
from shipland.commands.fly import Fly
from shipland.commands.identify import Identify
from shipland.commands.learn import Learn
from shipland.commands.motion import Motion
from shipland.commands.paper import Paper
from shipland.commands.publish import Publish
from shipland.commands.replay import Replay
from shipland.commands.report import Report
from shipland.commands.scenarios import Scenarios
from shipland.commands.see import See
from shipland.commands.serve_physics import ServePhysics
from shipland.commands.suites import Suites
from shipland.commands.synth import Synth
from shipland.commands.train import Train
from shipland.commands.version import Version
from shipland.errors import ShiplandError
from shipland.stopping import signals_interrupt

COMMANDS: tuple[type[Command], ...] = (
    Fly,
    Campaign,
    Compare,
    Report,
    Again,
    Replay,
    Bag,
    Paper,
    Motion,
    See,
    Detect,
    Synth,
    Train,
    Evaluate,
    Learn,
    Calibrate,
    Identify,
    Publish,
    ServePhysics,
    Scenarios,
    Example,
    Config,
    Suites,
    Version,
)
"""In the order of `shipland --help`."""


class Command(Protocol):
    """One command: its fields are its arguments."""

    def run(self) -> int:
        """Do it; the exit code."""


def name_of(command: type[Command]) -> str:
    """`serve-physics` of `ServePhysics`."""
    return "".join(f"-{letter.lower()}" if letter.isupper() else letter for letter in command.__name__).lstrip("-")


def subcommand(command: type[Command], *, brief: bool) -> Any:  # noqa: ANN401 - tyro reads annotations of any form
    """What tyro makes a subcommand of; `brief` shows the first sentence of its help alone."""
    _leave_out_empty_defaults(command)
    text = inspect.cleandoc(command.__doc__ or "").partition("\n\n")[0] if brief else None
    return Annotated[command, tyro.conf.subcommand(name_of(command), description=text)]


def _leave_out_empty_defaults(command: type[Command]) -> None:
    """A default that says nothing (None, an empty text, no values) is not in the help; the option's words say it."""
    unsaid = tyro.conf.arg(help_behavior_hint="")
    for name, hint in get_type_hints(command, include_extras=True).items():
        if getattr(command, name, 0) in (None, "", ()):
            command.__annotations__[name] = Annotated[hint, unsaid]


def main() -> None:
    """Entry point. An error prints one line, exit 2; after Ctrl-C and its like the files are complete, exit 130."""
    # Matrices here are small: threads of their own would only spin. Before NumPy is imported; workers inherit it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    words = ["version"] if sys.argv[1:] == ["--version"] else sys.argv[1:]
    brief = not any(word in map(name_of, COMMANDS) for word in words[:1])  # the list of all commands
    subcommands: Any = tuple(subcommand(it, brief=brief) for it in COMMANDS)
    any_command: Any = Union[subcommands]  # noqa: UP007 - made at run time
    try:
        command: Command = tyro.cli(
            any_command,
            args=words,
            prog="shipland",
            config=(tyro.conf.DisallowNone,),
            description="Lands a camera-carrying VTOL drone on a ship: no GPS, no link to the ship.\n\n"
            "`shipland COMMAND --help` explains one command, with an example. A first flight: "
            "shipland fly --out out/first",
        )
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
    except OSError as error:  # a full disk, a missing permission
        where = f"{error.filename}: " if error.filename else ""
        _tell(f"{where}{error.strerror or error}")
        code = 2
    _let_go_of_broken_streams()
    raise SystemExit(code)


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
