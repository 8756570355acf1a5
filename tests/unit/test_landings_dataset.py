"""A campaign as a data set: every column is described, the digests are those of the files, the card is a Croissant."""

import csv
import json
import zipfile
from hashlib import sha256

import pytest
from test_campaign import GOOD, NOWHERE, seeded

import shipland
from shipland.errors import ConfigError, DataError
from shipland.evaluation import job
from shipland.report.dataset import Described, licence_address, write_dataset

HERE = Described("made-up", "https://creativecommons.org/licenses/by/4.0/", "https://example.org/made-up")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    def land(flight):
        if flight.seed == 2:
            flight.log.parent.mkdir(parents=True, exist_ok=True)
            flight.log.write_bytes(b"a log")
        return seeded(NOWHERE if flight.seed == 2 else GOOD, flight.seed)

    out = tmp_path_factory.mktemp("campaign") / "flown"
    options = {"settings": "wind.mean_mps=0,5", "runs": 3, "workers": 1, "progress": False, "oracle_motions": 0}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(job, "land_once", land)
        shipland.campaign("near", out=out, **options)
    return out


def test_a_licence_is_one_that_is_known_or_an_address():
    assert licence_address("CC-BY-4.0") == HERE.licence
    assert licence_address(HERE.licence) == HERE.licence
    for text, near in (("cc-by-4.0", "CC-BY-4.0"), ("CCBY4", "CC-BY-4.0"), ("odbl", "ODbL-1.0"), ("nonsense", "")):
        with pytest.raises(ConfigError, match=f"--licence {text}: did you mean {near}"):
            licence_address(text)


def test_rows_logs_and_card_agree(folder, tmp_path):
    out = tmp_path / "set"
    files = write_dataset(folder, out, HERE)
    assert {path.name for path in out.iterdir()} == set(files)
    card = json.loads((out / "croissant.json").read_text())
    for item in card["distribution"]:
        if "sha256" in item:
            assert sha256((out / item["name"]).read_bytes()).hexdigest() == item["sha256"]
    with (out / "landings.csv").open() as file:
        rows = list(csv.DictReader(file))
    fields = {field["source"]["extract"]["column"]: field for field in card["recordSet"][0]["field"]}
    assert list(rows[0]) == list(fields)
    assert len(rows) == 6
    kinds = {name: fields[name]["dataType"] for name in ("seed", "sink_mps", "landed", "cause", "wind.mean_mps")}
    assert list(kinds.values()) == ["sc:Integer", "sc:Float", "sc:Boolean", "sc:Text", "sc:Integer"]
    assert fields["sink_mps"]["description"].endswith("[m/s]")
    with zipfile.ZipFile(out / "logs.zip") as packed:
        assert len(packed.namelist()) == 2
        assert all(name.endswith("/2.mcap") for name in packed.namelist())


def test_the_card_is_a_croissant_that_reads_its_rows(folder, tmp_path):
    croissant = pytest.importorskip("mlcroissant", reason="the card is checked by MLCommons' own reader")
    write_dataset(folder, tmp_path / "set", HERE)
    found = croissant.Dataset(jsonld=str(tmp_path / "set" / "croissant.json"))
    assert not found.metadata.issues.errors
    rows = list(found.records("landings"))
    assert len(rows) == 6
    assert {row["landings/sink_mps"] for row in rows} == {0.45, None}


def test_parquet_holds_the_same_rows(folder, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="Parquet wants pyarrow")
    assert "landings.parquet" in write_dataset(folder, tmp_path / "set", HERE)
    table = parquet.read_table(tmp_path / "set" / "landings.parquet").to_pydict()
    assert table["seed"] == [1, 2, 3] * 2
    assert table["success"] == [True, False, True] * 2


def test_parquet_holds_seeds_of_any_size(tmp_path, monkeypatch):
    parquet = pytest.importorskip("pyarrow.parquet", reason="Parquet wants pyarrow")
    monkeypatch.setattr(job, "land_once", lambda flight: seeded(GOOD, flight.seed))
    options = {"runs": 2, "workers": 1, "progress": False, "oracle_motions": 0}
    shipland.campaign("near", out=tmp_path / "flown", first_seed=2**70, **options)
    write_dataset(tmp_path / "flown", tmp_path / "set", HERE)
    table = parquet.read_table(tmp_path / "set" / "landings.parquet").to_pydict()
    assert table["seed"] == [str(2**70), str(2**70 + 1)]


def test_a_folder_without_flights_is_refused(tmp_path):
    with pytest.raises(DataError, match=r"neither a campaign .* nor logs"):
        write_dataset(tmp_path, tmp_path / "set", HERE)


def test_a_campaigns_rows_are_not_written_over(folder):
    for out in (folder, next(folder.glob("*/campaign.json")).parent):
        with pytest.raises(DataError, match="holds a campaign, whose rows would be written over"):
            write_dataset(folder, out, HERE)
