"""A campaign as a data set: rows as CSV and Parquet, logs in a zip, and a Croissant card that describes them.

Croissant 1.0 (MLCommons) is JSON-LD on schema.org: files with their digests, and what each column of the rows means.
"""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from shipland.descriptions import descriptions, unit_of
from shipland.errors import DataError
from shipland.evaluation.campaign import CellResult, read_cells, rows_of, write_rows
from shipland.evaluation.landing import Conditions, Landing, Phases, column_of
from shipland.files import json_bytes, write_atomically

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
_BESIDE = {
    "suite": "suite and version, empty where there is none",
    "cell": "scenario, settings and pilot in a word",
    "scenario": "what was flown",
    "pilot": "who flew",
    "vision": "who saw",
    "success": "landed, and in the landing square or circle",
}


class Described(NamedTuple):
    """How the card calls the data set."""

    name: str
    licence: str
    url: str
    version: str = "1.0.0"


def write_dataset(folder: Path, out: Path, described: Described) -> list[str]:
    """Write landings.csv, landings.parquet where pyarrow is installed, logs.zip where there are logs, croissant.json.

    The names of the files are returned.

    Raises:
        DataError: the folder holds no flights.
    """
    cells = read_cells([folder])
    if not any(cell.landings for cell in cells):
        raise DataError(f"{folder} holds no flights yet")
    out.mkdir(parents=True, exist_ok=True)
    write_rows(out / "landings.csv", cells)
    files = {"landings.csv": "text/csv"}
    table = {name: column_of(name, [row[name] for row in rows_of(cells)]) for name in next(rows_of(cells))}
    if find_spec("pyarrow") is not None:
        import pyarrow
        from pyarrow import parquet

        parquet.write_table(
            pyarrow.table({name: values.tolist() for name, values in table.items()}), out / "landings.parquet"
        )
        files["landings.parquet"] = "application/x-parquet"
    if _pack_logs(cells, out / "logs.zip"):
        files["logs.zip"] = "application/zip"
    fields = [(name, _TYPES.get(values.dtype.kind, "sc:Text")) for name, values in table.items()]
    card = _card(out, described, files, fields, sum(len(cell.landings) for cell in cells))
    write_atomically(out / "croissant.json", json_bytes(card))
    return [*files, "croissant.json"]


def _pack_logs(cells: Sequence[CellResult], path: Path) -> int:
    """The logs that the campaign kept, as CELL/SEED.mcap; how many."""
    logs = [
        (f"{cell.name}/{landing.seed}.mcap", log)
        for cell in cells
        for landing in cell.landings
        if cell.logs is not None and (log := cell.logs / f"{landing.seed}.mcap").is_file()
    ]
    if logs:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as packed:  # a log is compressed
            for name, log in logs:
                packed.writestr(zipfile.ZipInfo(name), log.read_bytes())
    return len(logs)


def _card(
    out: Path, described: Described, files: dict[str, str], fields: Sequence[tuple[str, str]], flights: int
) -> dict[str, Any]:
    meanings = _BESIDE | descriptions(Landing) | descriptions(Phases) | descriptions(Conditions)
    objects: list[dict[str, Any]] = []
    for name, form in files.items():
        with (out / name).open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        size = f"{(out / name).stat().st_size} B"
        objects.append({"@type": "cr:FileObject", "@id": name, "name": name, "contentUrl": name, "contentSize": size,
                        "encodingFormat": form, "sha256": digest})  # fmt: skip
    if "logs.zip" in files:
        objects.append({"@type": "cr:FileSet", "@id": "logs", "name": "logs", "containedIn": {"@id": "logs.zip"},
                        "description": "flight logs, CELL/SEED.mcap: a row a cycle, in Foxglove's schemas",
                        "encodingFormat": "application/octet-stream", "includes": "*/*.mcap"})  # fmt: skip
    rows = []
    for name, kind in fields:
        unit, said = unit_of(name), meanings.get(name, f"the cell's value of the setting {name}")
        said = f"{said.rstrip('.')} [{unit}]" if unit else said
        rows.append({"@type": "cr:Field", "@id": f"landings/{name}", "name": f"landings/{name}", "description": said,
                     "dataType": kind, "source": {"fileObject": {"@id": "landings.csv"}, "extract": {"column": name}}}
                    )  # fmt: skip
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": described.name,
        "description": f"{flights} landings of a drone on a moving deck, simulated by shipland: a row each, and logs.",
        "license": described.licence,
        "url": described.url,
        "version": described.version,
        "distribution": objects,
        "recordSet": [{"@type": "cr:RecordSet", "@id": "landings", "name": "landings",
                       "description": "a row a flight", "field": rows}],
    }  # fmt: skip
