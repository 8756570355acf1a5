"""A bundle: a campaign's rows in a zip, with what binds them to code, configuration and seeds; and its own consistency.

A bundle holds `bundle.json`, the campaign's cells.json, and of each cell campaign.json, landings.csv and the logs of a
few flights; `code/` holds the files of pilots and visions of one's own. What is checked here needs no flight: files
against their digests, rows against the summary and the way they are written, seeds, configurations, the suite's cells,
logs. A row that was made up well is found only by flying it again (`verify`).
"""

from __future__ import annotations

import tempfile
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from shipland import factories
from shipland.errors import ConfigError, DataError
from shipland.evaluation.campaign import CellResult, read_about, read_cells
from shipland.evaluation.folder import rows_in
from shipland.evaluation.landing import COLUMNS, Landing, as_text, row_of
from shipland.evaluation.suite import Cell, Overrides, cells_of, load_suite, salt_digest, sealed_seeds, task_digest
from shipland.evaluation.tally import Tally
from shipland.files import json_bytes, json_of, read_text, replacing, writing
from shipland.record.info import config_digest, file_digest
from shipland.record.reader import read_log
from shipland.scenario.scenario import load_scenario

FORMAT = 1
_MOST_BYTES = 4 << 30
"""Of what a bundle holds, unpacked."""
_UNREADABLE = (
    *(EOFError, zipfile.BadZipFile, zlib.error, RuntimeError),
    *(LookupError, TypeError, ValueError, AttributeError, OverflowError),
)
"""What reading a zip, or a table of another shape than expected, raises; RuntimeError of an encrypted zip."""
_BOUND = ("source", "version", "python", "libraries")
"""What every cell's campaign.json says, and bundle.json once."""


@dataclass(frozen=True)
class Bundle:
    """An opened bundle, checked.

    Attributes:
        path, about, folder: the zip, its bundle.json, and where it is unpacked.
        cells: as `read_cells` gives them.
        seeds_checked: they are 1, 2, 3 … or those of the salt; False where the salt was not given.
        notes: what could not be checked, in words.
        groups: of each cell its suite's name for what was flown; its own without a suite.
    """

    path: Path
    about: Mapping[str, Any]
    folder: Path
    cells: tuple[CellResult, ...]
    seeds_checked: bool = True
    notes: list[str] = field(default_factory=list)
    groups: dict[str, str] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """What the submission is called."""
        return str(self.about["title"])

    @property
    def flights(self) -> list[tuple[CellResult, Landing]]:
        """Every row with its cell."""
        return [(cell, landing) for cell in self.cells for landing in cell.landings]

    @property
    def digest(self) -> str:
        """SHA-256 of the zip."""
        return sha256(self.path.read_bytes()).hexdigest()


def write_bundle(folder: Path, out: Path, title: str, logs: int, salt: Path | None) -> Mapping[str, Any]:
    """Pack a campaign's folder into the zip `out`, with so many logs of each cell; bundle.json is returned.

    The seeds were derived from the salt; without one they are 1, 2, 3 … DataError where there is no whole campaign of
    one code.
    """
    _check_title(out, title)
    cells = read_cells([folder])
    for cell in cells:
        if not cell.landings:
            raise DataError(f"{cell.name} has no flights yet; run the campaign again to resume")
        _check_rows(cell, folder)
    key = cells[0].key
    for word in _BOUND:
        if any(cell.key[word] != key[word] for cell in cells):
            raise DataError(f"{folder}: its cells were flown with different {word}; fly them with one installation")
    files = {"cells.json": (folder / "cells.json").read_bytes()}
    for cell in cells:
        kept = [f"flights/{it.seed}.mcap" for it in cell.landings]
        kept = [name for name in kept if (folder / cell.name / name).exists()]
        for name in ("campaign.json", "landings.csv", *kept[:logs]):
            files[f"{cell.name}/{name}"] = (folder / cell.name / name).read_bytes()
    own = {name: _code_file(name) for cell in cells for name in _own_names(cell.key)}
    files |= {f"code/{path.name}": path.read_bytes() for path in own.values()}
    about = {
        "format": FORMAT,
        "title": title,
        "suite": cells[0].suite,
        "runs": len(cells[0].landings),
        "salt": "" if salt is None else salt_digest(salt),
        "command": key["command"],
        **{word: key[word] for word in _BOUND},
        "own_code": {name: f"code/{path.name}" for name, path in own.items()},
        "summary": _summary(cells),
        "files": {name: sha256(data).hexdigest() for name, data in files.items()},
    }
    _check_seeds(cells, len(cells[0].landings), salt, about["salt"])
    with writing(out), replacing(out) as beside, zipfile.ZipFile(beside, "w") as packed:
        for name, data in {"bundle.json": json_bytes(about), **files}.items():
            # of no date: the same rows, the same zip
            packed.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return about


def _check_title(path: Path, title: str) -> None:
    if not title.isprintable() or "|" in title:
        raise DataError(f"{path}: the title holds what cannot be printed, or a |")


def _code_file(name: str) -> Path:
    module = _module_of(name)
    factories.add_here()
    spec = find_spec(module)
    if "." in module or spec is None or spec.origin is None or not Path(spec.origin).is_file():
        raise DataError(f"{name}: a bundle takes one file of code along, OWN.py in this folder, given as OWN:factory")
    return Path(spec.origin)


def _summary(cells: Sequence[CellResult]) -> dict[str, dict[str, int]]:
    return {cell.name: Tally.of(cell.landings)._asdict() for cell in cells}


@contextmanager
def opened(path: Path, salt: Path | None = None) -> Iterator[Bundle]:
    """A bundle, unpacked for the time being and found consistent in itself; DataError says what is wrong, and where."""
    with tempfile.TemporaryDirectory() as temporary:
        try:
            bundle = _checked(path, Path(temporary), salt)
        except OSError as error:
            raise DataError(f"{path} cannot be unpacked: {error.strerror or error}") from None
        except _UNREADABLE as error:
            raise DataError(f"{path} is no bundle of `shipland submit`: {type(error).__name__}: {error}") from None
        yield bundle


def _checked(path: Path, folder: Path, salt: Path | None) -> Bundle:
    about = _unpacked(path, folder)
    for name in read_about(folder)["cells"]:
        if not {f"{name}/campaign.json", f"{name}/landings.csv"} <= about["files"].keys():
            raise DataError(f"{name}: its rows are not in the bundle")
    cells = tuple(read_cells([folder]))
    if not any(cell.landings for cell in cells):
        raise DataError(f"{path} holds no flights")
    bundle = Bundle(path, about, folder, cells, seeds_checked=not about["salt"] or salt is not None)
    _check_names(bundle)
    for cell in cells:
        _check_rows(cell, folder)
        _check_key(bundle, cell)
    if _summary(cells) != about["summary"]:
        wrong = [name for name, counts in _summary(cells).items() if about["summary"].get(name) != counts]
        raise DataError(f"{(wrong or ['bundle.json'])[0]}: its rows are not those that the summary counts")
    _check_seeds(cells, about["runs"], salt, about["salt"])
    if not bundle.seeds_checked:
        bundle.notes.append("its seeds are sealed and were not checked: give the salt")
    _check_suite(bundle)
    _check_logs(bundle)
    return bundle


def _unpacked(path: Path, folder: Path) -> dict[str, Any]:
    """bundle.json; every other file of the zip is in the folder and is the one that its digest means."""
    with zipfile.ZipFile(path) as packed:
        if sum(info.file_size for info in packed.infolist()) > _MOST_BYTES:
            raise DataError(f"{path} unpacks to more than {_MOST_BYTES >> 30} GiB")
        names = packed.namelist()
        about = json_of(packed.read("bundle.json"))
        if about["format"] != FORMAT:
            raise DataError(f"{path} is of format {about['format']}, expected {FORMAT}")
        listed = {str(name): str(digest) for name, digest in about["files"].items()}
        twice = [name for name, count in Counter(names).items() if count > 1]
        odd = sorted(set(names) ^ {"bundle.json", *listed})
        if twice or odd:
            raise DataError(f"{path}: {(twice or odd)[0]} is twice in it, not in it or not listed")
        for name, digest in listed.items():
            target = (folder / name).resolve()
            if not target.is_relative_to(folder.resolve()):
                raise DataError(f"{path}: {name} leads out of the bundle")
            data = packed.read(name)
            if sha256(data).hexdigest() != digest:
                raise DataError(f"{path}: {name} is not the file that was submitted: its digest differs")
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
        for word in ("title", "suite", "runs", "salt", "summary", "own_code", *_BOUND):
            about[word]
        _check_title(path, str(about["title"]))
        return dict(about)


def _check_names(bundle: Bundle) -> None:
    """It holds files of its cells, and the code that they name; no other."""
    held, meant, own = bundle.about["files"], {"cells.json"}, dict[str, str]()
    for cell in bundle.cells:
        names = ("campaign.json", "landings.csv", *(f"flights/{it.seed}.mcap" for it in cell.landings))
        meant |= {f"{cell.name}/{name}" for name in names}
        for name in _own_names(cell.key):
            own[name] = f"code/{_module_of(name)}.py"
            if own[name] not in held:
                raise DataError(f"{cell.name}: it names code that the bundle does not hold: {name}")
    if odd := sorted(held.keys() - meant - set(own.values())):
        raise DataError(f"{bundle.path}: {odd[0]} is neither a file of its cells nor the code that they name")
    if bundle.about["own_code"] != own:
        raise DataError(f"{bundle.path}: its own code is {bundle.about['own_code']} in bundle.json, {own} in its cells")


def _own_names(key: Mapping[str, Any]) -> list[str]:
    """Of a cell's pilot, vision, aircraft and loop those that are own code."""
    aircraft = key["scenario"]["aircraft"]
    names = (key["pilot"], key["vision"], aircraft["kind"], aircraft["loop"]["kind"])
    return [name for name in names if factories.is_own_code(name)]


def _module_of(name: str) -> str:
    return name.partition(":")[0]


def _check_rows(cell: CellResult, folder: Path) -> None:
    """landings.csv is, to the letter, what its landings are written as, each seed once."""
    text = read_text(folder / cell.name / "landings.csv")
    if not text.endswith("\n"):
        raise DataError(f"{cell.name}: its landings.csv ends within a row; run the campaign again to resume")
    table = rows_in(text)
    if table.fieldnames != COLUMNS:
        raise DataError(f"{cell.name}: the columns of its landings.csv are not this version's")
    rows = list(table)
    for seed, count in Counter(row["seed"] for row in rows).items():
        if count > 1:
            raise DataError(f"{cell.name}: seed {seed} is in its rows {count} times")
    by_seed = {it.seed: texts_of(it) for it in cell.landings}
    for row in rows:
        seed = row["seed"]
        for name, found in row.items():
            if found != (meant := by_seed[int(seed)].get(name)):
                raise DataError(f"{cell.name}, seed {seed}: {name} is {found}, but its other columns make it {meant}")


def texts_of(landing: Landing) -> dict[str, str]:
    """A landing as its row writes it, by column."""
    return {name: str(value) for name, value in as_text(row_of(landing)).items()}


def _check_key(bundle: Bundle, cell: CellResult) -> None:
    key = cell.key
    if config_digest(key["scenario"]) != key["configuration"]:
        raise DataError(f"{cell.name}: its configuration is not the one that its digest means")
    for word in _BOUND:
        if key[word] != bundle.about[word]:
            raise DataError(f"{cell.name}: its {word} is {key[word]}, that of the bundle {bundle.about[word]}")
    held = {name: file_digest(bundle.folder / bundle.about["own_code"][name]) for name in _own_names(key)}
    if key["own_code"] != held:
        raise DataError(f"{cell.name}: the code that flew is {key['own_code']} by its digest, in the bundle {held}")
    if (key["pilot"], key["vision"]) != (cell.pilot, cell.vision):
        raise DataError(f"{cell.name}: campaign.json and cells.json name different pilots or visions")


def _check_seeds(cells: Sequence[CellResult], runs: int, salt: Path | None, sealed_by: str) -> None:
    if salt is not None and salt_digest(salt) != sealed_by:
        raise DataError(f"its seeds are of another salt than {salt}, or of none")
    if sealed_by and salt is None:
        wanted = {it.seed for it in cells[0].landings}
    else:
        wanted = set(range(1, runs + 1) if salt is None else sealed_seeds(salt, 1, runs))
    for cell in cells:
        found = {it.seed for it in cell.landings}
        if found != wanted or len(found) != runs:
            missing, foreign = sorted(wanted - found), sorted(found - wanted)
            words = f"seed {missing[0]} is missing" if missing else f"seed {foreign[0]} is none of {runs} from 1 on"
            raise DataError(f"{cell.name}: {words}; expected {runs} flights, the same seeds in every cell")


def cell_of(cell: CellResult) -> Cell:
    """What was flown, as it is flown."""
    return Cell(load_scenario(cell.key["scenario"]), cell.settings, cell.pilot, cell.vision)


def _check_suite(bundle: Bundle) -> None:
    """The flights are those of the packaged suite's version: each of its cells once by each pilot, and no other."""
    words = bundle.about["suite"]
    if any(cell.suite != words for cell in bundle.cells):
        raise DataError(f"cells.json and bundle.json name different suites than {words or 'none'}")
    if not words:
        bundle.notes.append("it names no suite: what its flights meet is its own choice")
        bundle.groups.update({cell.name: cell.group for cell in bundle.cells})
        return
    try:
        suite = load_suite(words.rpartition(" ")[0])
    except ConfigError:
        raise DataError(f"it flew suite {words}, which is none of the packaged ones") from None
    if words != f"{suite.name} {suite.version}":
        raise DataError(f"it flew suite {words}; this installation has {suite.name} {suite.version}")
    wanted = {task_digest([cell]): cell.group for cell in cells_of(suite.cells, Overrides(("paper",)))}
    for pilot in dict.fromkeys(cell.pilot for cell in bundle.cells):
        found = Counter[str]()
        for cell in (each for each in bundle.cells if each.pilot == pilot):
            digest = task_digest([cell_of(cell)])
            if digest not in wanted:
                raise DataError(f"{cell.name} is none of the flights of suite {words}")
            bundle.groups[cell.name] = wanted[digest]
            found[digest] += 1
        wrong = [name for digest, name in wanted.items() if found[digest] != 1]
        if wrong:
            raise DataError(f"{pilot} did not fly {wrong[0]} of suite {words} once; every cell counts")


def _check_logs(bundle: Bundle) -> None:
    """Each log is the flight of its row: same seed, pilot and configuration, same end."""
    for cell in bundle.cells:
        for path in sorted((bundle.folder / cell.name / "flights").glob("*.mcap")):
            log, rows = read_log(path), {it.seed: it for it in cell.landings}
            info, landing = log.header.info, rows[int(path.stem)]
            named = (info.seed, info.pilot, info.config_digest)
            if named != (landing.seed, cell.pilot, cell.key["configuration"]):
                raise DataError(f"{cell.name}: the log {path.name} is of another flight than its row")
            touched = log.verdict is not None and log.verdict.touched
            ended = log.verdict is not None and (log.verdict.landed, log.verdict.in_square)
            place = None if log.verdict is None else np.round(log.verdict.touchdown_in_deck_m, 4).tolist()
            row = (landing.landed, landing.in_square), [landing.forward_m, landing.starboard_m]
            if touched != landing.touched or (touched and (ended, place) != row):
                raise DataError(f"{cell.name}, seed {landing.seed}: its log ends otherwise than its row says")
