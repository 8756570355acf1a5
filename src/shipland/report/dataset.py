"""A campaign or single flights as a data set: rows as CSV and Parquet, logs, pictures, and a Croissant card of them.

Croissant 1.0 (MLCommons) is JSON-LD on schema.org: files with their digests, and what each column of the rows means.
"""

from __future__ import annotations

import difflib
import hashlib
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy.typing as npt

from shipland.descriptions import descriptions, unit_of
from shipland.errors import ConfigError, DataError
from shipland.evaluation.campaign import cells_file, read_cells, rows_of
from shipland.evaluation.landing import Conditions, Landing, Phases, as_text, column_of
from shipland.extras import installed
from shipland.files import json_bytes, replacing, write_atomically, write_csv
from shipland.report.lerobot import write_lerobot
from shipland.report.posed_pictures import MEANINGS, pack_pictures

_WORDS = """citeAs column equivalentProperty extract field fileObject fileProperty fileSet format includes isLiveDataset
    jsonPath key md5 parentField path recordSet references regex repeated replace samplingRate separator source subField
    transform"""
_CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    **{word: f"cr:{word}" for word in _WORDS.split()},
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
}
_TYPES = {"i": "sc:Integer", "f": "sc:Float", "b": "sc:Boolean"}
_FORMS = {".csv": "text/csv", ".json": "application/json", ".mp4": "video/mp4", ".parquet": "application/x-parquet",
          ".zip": "application/zip"}  # fmt: skip
_PACKED = {
    "logs.zip": ("logs", "application/octet-stream", "*.mcap", "flight logs: a row a cycle, in Foxglove's schemas"),
    "pictures.zip": ("images", "image/png", "*.png", "FLIGHT/NUMBER.png, as the logs keep them"),
}
_LICENCES = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    **{
        f"CC-{kind.upper()}-4.0": f"https://creativecommons.org/licenses/{kind}/4.0/"
        for kind in ("by", "by-sa", "by-nc", "by-nc-sa", "by-nd")
    },
    "CDLA-Permissive-2.0": "https://cdla.dev/permissive-2-0/",
    "ODC-By-1.0": "https://opendatacommons.org/licenses/by/1-0/",
    "ODbL-1.0": "https://opendatacommons.org/licenses/odbl/1-0/",
    "PDDL-1.0": "https://opendatacommons.org/licenses/pddl/1-0/",
}
"""Of data, by SPDX's identifiers."""
_BESIDE = {
    "suite": "suite and version, empty where there is none",
    "cell": "scenario, settings and pilot in a word",
    "scenario": "what was flown",
    "pilot": "who flew",
    "vision": "who saw",
    "success": "landed, and in the landing square or circle",
}


class Described(NamedTuple):
    """How the card calls the data set; the licence is an address."""

    name: str
    licence: str
    url: str


def licence_address(text: str) -> str:
    """The address of a licence by its SPDX identifier; an address is taken as it is, ConfigError for anything else."""
    if text.startswith(("https://", "http://")):
        return text
    if text not in _LICENCES:
        near = difflib.get_close_matches(text.upper(), _LICENCES, n=1, cutoff=0.0)[0]
        raise ConfigError(
            f"--licence {text}: did you mean {near}? Known are {', '.join(_LICENCES)}; another is its address: https://…"
        )
    return _LICENCES[text]


def write_dataset(
    folder: Path, out: Path, described: Described, *, lerobot: bool = False, pictures: bool = False
) -> list[str]:
    """Write what there is: landings.csv of a campaign, logs.zip, croissant.json; a .parquet beside where pyarrow is.

    With `lerobot` the logs in LeRobot's layout too, in folder lerobot; with `pictures` those of the logs, with their
    cameras' poses: pictures.csv, pictures.zip. Returns the names of files and folders. DataError where there are no
    flights, logs or pictures that are asked for, or `out` is a campaign's; SystemLibraryError without an extra.
    """
    if cells_file(out).is_file() or (out / "campaign.json").is_file():
        raise DataError(f"{out} holds a campaign, whose rows would be written over: name another --out")
    logs = {str(log.relative_to(folder).with_suffix("")): log for log in sorted(folder.rglob("*.mcap"))}
    flown = cells_file(folder).is_file()
    if not (flown or logs):
        raise DataError(f"{folder} holds neither a campaign (cells.json) nor logs of flights (*.mcap)")
    cells = read_cells([folder]) if flown else []
    if cells:
        if not any(cell.landings for cell in cells):
            raise DataError(f"{folder} holds no flights yet")
        kept = [(cell.name, it.seed, cell.logs[it.seed]) for cell in cells for it in cell.landings]
        paths = {f"{name}/{seed}": at / f"{seed}.mcap" for name, seed, at in kept}
        logs = {name: path for name, path in paths.items() if path.is_file()}
    if (lerobot or pictures) and not logs:
        raise DataError(f"{folder} keeps no logs, which this is made of: `shipland campaign --logs` keeps them")
    if odd := next((name for name in logs if name != name.encode(errors="replace").decode()), None):
        raise DataError(f"the name of the log {odd!r} is no text in UTF-8: rename it")
    out.mkdir(parents=True, exist_ok=True)
    files: list[Path] = []
    sets: list[dict[str, Any]] = []
    if lerobot:  # first, as it refuses
        write_lerobot(logs, out / "lerobot")
        files += [path for path in sorted((out / "lerobot").rglob("*")) if path.is_file()]
    if pictures:
        sets.append(_write_table(out / "pictures", pack_pictures(logs, out / "pictures.zip"), files))
        files.append(out / "pictures.zip")
    if cells:
        sets.append(_write_table(out / "landings", list(rows_of(cells)), files))
    if logs:
        files.append(out / "logs.zip")
        with replacing(files[-1]) as beside, zipfile.ZipFile(beside, "w", zipfile.ZIP_STORED) as packed:
            for name, log in logs.items():
                packed.writestr(zipfile.ZipInfo(f"{name}.mcap"), log.read_bytes())  # a log is compressed
    flights = sum(len(cell.landings) for cell in cells) or len(logs)
    card = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": described.name,
        "description": f"{flights} flights of a drone to a moving deck, by shipland: tables, logs, pictures.",
        "license": described.licence,
        "url": described.url,
        "version": "1.0.0",
        "distribution": [*_objects(out, files)],
        "recordSet": sets,
    }
    write_atomically(out / "croissant.json", json_bytes(card))
    return [*dict.fromkeys(path.relative_to(out).parts[0] for path in files), "croissant.json"]


def _write_table(path: Path, rows: Sequence[Mapping[str, Any]], files: list[Path]) -> dict[str, Any]:
    """Rows as CSV and, with pyarrow, Parquet, noted in `files`; the card's entry: what each column means."""
    files.append(path.with_suffix(".csv"))
    write_csv(files[-1], list(rows[0]), (as_text(dict(row)) for row in rows))
    columns = {column: column_of(column, [row[column] for row in rows]) for column in rows[0]}
    if installed("dataset"):
        import pyarrow
        from pyarrow import parquet

        files.append(path.with_suffix(".parquet"))
        table = pyarrow.table({name: _array(values) for name, values in columns.items()})
        with replacing(files[-1]) as beside:
            parquet.write_table(table, beside)
    meanings = _BESIDE | descriptions(Landing) | descriptions(Phases) | descriptions(Conditions)
    fields = []
    for column, values in columns.items():
        by_start = next((text for start, text in MEANINGS.items() if column.startswith(start)), "")
        said = meanings.get(column) or by_start or f"the cell's value of the setting {column}"
        unit, name = unit_of(column), f"{path.name}/{column}"
        said = f"{said.rstrip('.')} [{unit}]" if unit else said
        kind = _TYPES.get(values.dtype.kind, "sc:Text")
        source = {"fileObject": {"@id": f"{path.name}.csv"}, "extract": {"column": column}}
        fields.append({"@type": "cr:Field", "@id": name, "name": name, "description": said, "dataType": kind,
                       "source": source})  # fmt: skip
    return {"@type": "cr:RecordSet", "@id": path.name, "name": path.name,
            "description": f"a row for each of the {path.name}", "field": fields}  # fmt: skip


def _array(values: npt.NDArray[Any]) -> Any:  # noqa: ANN401 - pyarrow's
    """A column for Parquet; whole numbers that 64 bits do not hold, as a seed may be, are texts."""
    import pyarrow

    try:
        return pyarrow.array(values.tolist())
    except OverflowError:
        return pyarrow.array([str(value) for value in values.tolist()])


def _objects(out: Path, files: Sequence[Path]) -> Iterator[dict[str, Any]]:
    """The card's entries of files, and of what zip files hold."""
    for path in files:
        name, size = path.relative_to(out).as_posix(), f"{path.stat().st_size} B"
        with path.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        yield {"@type": "cr:FileObject", "@id": name, "name": name, "contentUrl": name, "contentSize": size,
               "encodingFormat": _FORMS[path.suffix], "sha256": digest}  # fmt: skip
    for packed, (name, form, pattern, said) in _PACKED.items():
        if out / packed in files:
            yield {"@type": "cr:FileSet", "@id": name, "name": name, "containedIn": {"@id": packed},
                   "description": said, "encodingFormat": form, "includes": pattern}  # fmt: skip
