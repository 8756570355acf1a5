"""Bundles: a true one is verified, every forgery is refused with the place, own code runs only when asked for."""

import csv
import json
import shutil
import sys
import zipfile
from errno import ENOSPC
from hashlib import sha256
from os import strerror
from pathlib import Path

import numpy as np
import pytest
from test_campaign import GOOD, NOWHERE, make_up_flights, seeded

import shipland
from shipland.errors import ConfigError, DataError
from shipland.evaluation import job
from shipland.evaluation.bundle import opened, write_bundle
from shipland.evaluation.suite import Suite, SuiteEntry, load_suite, sealed_seeds
from shipland.evaluation.verify import Verified, fly_again, read_receipt, write_receipt
from shipland.record.info import config_digest
from shipland.report.benchmark_page import benchmark_page, entries_of, standings
from shipland.scenario.fly import flight_log
from shipland.scenario.scenario import load_scenario

TINY = Suite("tiny", 1, "made up", (SuiteEntry(("rig-natops", "ship-sea6")),))
REAL = job.land_once
SALT = b"0123456789abcdef the referee's\n"


def land(flight):
    """Made up, the same again: the paper's pilot misses every second seed."""
    missed = str(flight.pilot).endswith("paper") and flight.seed % 2 == 0
    landing = seeded(NOWHERE if missed else GOOD, flight.seed)
    if flight.log is not None and not (flight.only_failed and landing.success):
        with flight_log(flight.log, flight.scenario, flight.pilot, flight.vision, flight.seed) as writer:
            writer.finish(None)
    return landing


@pytest.fixture(autouse=True, scope="module")
def made_up():
    """Flights are made up, and the suite is a packaged one."""
    with pytest.MonkeyPatch.context() as patch:
        make_up_flights(patch, land)
        patch.setattr("shipland.evaluation.bundle.load_suite", lambda _: TINY)
        yield


def fly(folder, pilot="paper", runs=4, **more):
    options = {"workers": 1, "progress": False, "oracle_motions": 0}
    shipland.campaign(TINY, pilot=pilot, runs=runs, out=folder, **options | more)
    return folder


@pytest.fixture(scope="module")
def true_bundle(tmp_path_factory):
    folder = tmp_path_factory.mktemp("true")
    write_bundle(fly(folder / "flown"), folder / "true.zip", "true 1", 1, None)
    return folder


@pytest.fixture
def bundle(true_bundle, tmp_path):
    return shutil.copy(true_bundle / "true.zip", tmp_path / "true.zip")


def forged(path, change, digests=True):
    """The bundle with its files changed by `change(files)`; with the digests of the changed files put right."""
    with zipfile.ZipFile(path) as packed:
        files = {name: packed.read(name) for name in packed.namelist()}
    change(files)
    if digests:
        about = json.loads(files.pop("bundle.json"))
        about["files"] = {name: sha256(data).hexdigest() for name, data in files.items()}
        files["bundle.json"] = json.dumps(about).encode()
    other = path.with_name("forged.zip")
    with zipfile.ZipFile(other, "w") as packed:
        for name, data in files.items():
            packed.writestr(name, data)
    return other


def rows(change):
    """Changes the rows of one cell."""

    def changed(files):
        name = "rig-natops_paper/landings.csv"
        table = list(csv.DictReader(files[name].decode().splitlines()))
        table = change(table)
        lines = [",".join(table[0]), *(",".join(row.values()) for row in table)]
        files[name] = ("\n".join(lines) + "\n").encode()

    return changed


def with_row(seed, /, **values):
    return rows(lambda table: [row | values if row["seed"] == str(seed) else row for row in table])


def in_json(name, change):
    """Changes a table of a file."""

    def changed(files):
        table = json.loads(files[name])
        change(table)
        files[name] = json.dumps(table).encode()

    return changed


KEY = "rig-natops_paper/campaign.json"
windless = in_json(KEY, lambda table: table["scenario"]["wind"].update(mean_mps=0.0))


def about(**values):
    return in_json("bundle.json", lambda table: table.update(values))


def key(**values):
    return in_json(KEY, lambda table: table.update(values))


def windless_throughout(files):
    windless(files)
    key(configuration=config_digest(json.loads(files[KEY])["scenario"]))(files)


def without_a_cell(files):
    for name, part in (("cells.json", "cells"), ("bundle.json", "summary")):
        in_json(name, lambda table, part=part: table[part].pop("ship-sea6_paper"))(files)
    for name in [name for name in files if name.startswith("ship-sea6")]:
        del files[name]


def check(path, sample=0, salt=None):
    with opened(path, salt) as found:
        return fly_again(found, sample, np.random.default_rng(1), 1)


def test_a_true_bundle_is_verified_and_the_same_rows_make_the_same_zip(bundle, true_bundle, tmp_path):
    found = check(bundle)
    assert (found.flights, found.again) == (8, 8)
    assert check(bundle, sample=3).again == 3
    again = tmp_path / "again.zip"
    write_bundle(true_bundle / "flown", again, "true 1", 1, None)
    assert again.read_bytes() == bundle.read_bytes()
    with zipfile.ZipFile(bundle) as packed:
        assert "rig-natops_paper/flights/2.mcap" in packed.namelist()


def test_a_title_that_no_table_can_show_leaves_no_bundle(true_bundle, tmp_path):
    with pytest.raises(DataError, match="the title holds what cannot be printed"):
        write_bundle(true_bundle / "flown", tmp_path / "mine.zip", "one | two", 1, None)
    assert not (tmp_path / "mine.zip").exists()


def test_half_a_last_row_leaves_no_bundle(true_bundle, tmp_path):
    folder = shutil.copytree(true_bundle / "flown", tmp_path / "flown")
    for cell in ("rig-natops_paper", "ship-sea6_paper"):
        table = folder / cell / "landings.csv"
        table.write_text(table.read_text()[:-20])
    with pytest.raises(DataError, match="ends within a row; run the campaign again"):
        write_bundle(folder, tmp_path / "mine.zip", "mine", 1, None)
    assert not (tmp_path / "mine.zip").exists()


FORGERIES = {
    "a file changed": (with_row(2, reason="landed"), False, "landings.csv is not the file that was submitted"),
    "a summary brushed up": (
        about(summary={"rig-natops_paper": {"flights": 4, "landed": 4}}), True, "not those that the summary counts",
    ),
    "success without landing": (with_row(2, success="True"), True, "seed 2: success is True, but .* make it False"),
    "a row dropped": (rows(lambda table: table[:-1]), True, "rig-natops_paper: its rows are not"),
    "a row twice": (rows(lambda table: [*table, table[0]]), True, "seed 1 is in its rows 2 times"),
    "a seed swapped": (with_row(3, seed="33"), True, "rig-natops_paper: seed 3 is missing"),
    "code of another name": (key(source="0" * 16), True, "its source is 0000000000000000, that of the bundle"),
    "less wind": (windless, True, "its configuration is not the one that its digest means"),
    "less wind, digests and all": (windless_throughout, True, "is none of the flights of suite tiny 1"),
    "a pilot of another name": (key(pilot="horizon"), True, "name different pilots"),
    "a cell left out": (without_a_cell, True, "did not fly ship-sea6 of suite tiny 1"),
    "rows left out": (lambda files: files.pop("ship-sea6_paper/landings.csv"), True, "its rows are not in the bundle"),
    "a file unlisted": (lambda files: files.update({"more": b""}), False, "more is twice in it, not in it or"),
    "a way out": (lambda files: files.update({"../more": b""}), True, "leads out of the bundle"),
    "code that is not in it": (key(pilot="antigravity:fly"), True, "names code that the bundle does not hold: antig"),
    "a cell without its pilot": (
        in_json("cells.json", lambda table: table["cells"]["rig-natops_paper"].clear()), True, "not what a campaign",
    ),
    "settings that are no texts": (
        in_json("cells.json", lambda table: table["cells"]["rig-natops_paper"].update(settings={"wind": 5})), True,
        "rig-natops_paper: not what a campaign leaves",
    ),
    "a script for a number": (
        in_json("cells.json", lambda table: table["machine"].update(cores="<script>fetch('https://…')</script>")), True,
        "cells.json is not readable",
    ),
    "no machine": (in_json("cells.json", lambda table: table.pop("machine")), True, "cells.json is not readable"),
    "a file of no cell": (lambda files: files.update({"code/numpy.py": b""}), True, "numpy.py is neither a file of"),
    "a seed written otherwise": (with_row(3, seed="03"), True, "seed 03: seed is 03, but its other columns make it 3"),
    "no cell, seeds sealed": (
        lambda files: [
            in_json("cells.json", lambda table: table.update(cells={}))(files), about(runs=0, salt="0" * 16)(files),
        ], True, "holds no flights",
    ),
    "no number of runs": (about(runs=5), True, "seed 5 is missing"),
}  # fmt: skip


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_bundle_is_refused_without_a_flight(name, bundle):
    change, digests, words = FORGERIES[name]
    with pytest.raises(DataError, match=words), opened(forged(bundle, change, digests)):
        pass


def test_an_outcome_made_up_well_is_found_by_flying_it_again(bundle):
    improved = with_row(1, sink_mps="0.4")
    path = forged(bundle, improved)
    with opened(path):
        pass
    with pytest.raises(DataError, match=r"rig-natops_paper, seed 1: sink_mps is 0\.4 in the bundle, 0\.45 flown again"):
        check(path)


def test_a_log_that_ends_otherwise_is_refused(bundle):
    row = dict.fromkeys(("landed", "in_square", "success"), "True")
    path = forged(bundle, with_row(2, **row, forward_m="0.01", starboard_m="0.0", error_m="0.01"))
    with zipfile.ZipFile(path) as packed:
        wanted = json.loads(packed.read("bundle.json"))
    wanted["summary"]["rig-natops_paper"]["landed"] = 3
    path = forged(path, about(summary=wanted["summary"]))
    with pytest.raises(DataError, match="rig-natops_paper, seed 2: its log ends otherwise"), opened(path):
        pass


def test_seeds_of_a_salt_are_checked_with_it_alone(tmp_path):
    salt, path = tmp_path / "salt", tmp_path / "sealed.zip"
    salt.write_bytes(SALT)
    folder = fly(tmp_path / "flown", salt=salt)
    with pytest.raises(DataError, match="is missing"):
        write_bundle(folder, path, "sealed", 0, None)
    write_bundle(folder, path, "sealed", 0, salt)
    assert check(path, salt=salt).again == 8
    with opened(path) as found:
        assert "sealed" in found.notes[0]
        write_receipt(path, fly_again(found, 1, np.random.default_rng(1), 1))
        assert "not checked" in benchmark_page([found], entries_of([found]), {}, tmp_path)
        write_receipt(path, check(path, 1, salt))
        assert "not checked" not in benchmark_page([found], entries_of([found]), {}, tmp_path)
        assert {it.seed for _, it in found.flights} == set(sealed_seeds(salt, 1, 4))
        assert SALT.strip() not in b"".join(file.read_bytes() for file in found.folder.rglob("*") if file.is_file())
    salt.write_bytes(b"another secret, as long")
    with pytest.raises(DataError, match="another salt"), opened(path, salt):
        pass
    salt.write_bytes(b"short")
    with pytest.raises(ConfigError, match="too few for a secret"):
        sealed_seeds(salt, 1, 1)


def test_a_salt_gives_the_same_seeds_wherever_they_begin(tmp_path):
    salt = tmp_path / "salt"
    salt.write_bytes(SALT)
    seeds = sealed_seeds(salt, 1, 500)
    assert seeds[100:] == sealed_seeds(salt, 101, 400)
    assert len(set(seeds)) == 500
    assert max(seeds) < 2**53, "a column of floats holds them"


def test_own_code_is_taken_along_and_runs_only_when_asked_for(tmp_path, monkeypatch, here):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "mine_paper.py").write_text("def paper(setup):\n    raise ValueError('nobody calls it')\n")
    fly(tmp_path / "flown", pilot="mine_paper:paper")
    made = here("submit", "flown", "--title", "mine", "--out", "mine.zip")
    assert made.returncode == 0 and "code/mine_paper.py" in made.stdout
    (tmp_path / "mine_paper.py").write_text("raise ValueError('not this one')\n")
    sys.modules.pop("mine_paper", None)
    refused = here("verify", "mine.zip")
    assert refused.returncode == 2 and "give --run-own-code" in refused.stderr
    verified = here("verify", "mine.zip", "--run-own-code", "--workers", "1", "--sample", "3")
    assert verified.returncode == 0 and "3 of 8 rows flown again" in verified.stdout
    assert "mine_paper" not in sys.modules
    with opened(tmp_path / "mine.zip") as found:
        assert read_receipt(found).again == 3


def test_own_code_is_that_which_flew(tmp_path, monkeypatch, here):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "edited_paper.py").write_text("def paper(setup):\n    raise ValueError('nobody calls it')\n")
    fly(tmp_path / "flown", pilot="edited_paper:paper")
    (tmp_path / "edited_paper.py").write_text("def paper(setup):\n    return better(setup)\n")
    made = here("submit", "flown", "--title", "mine", "--out", "mine.zip")
    assert made.returncode == 2 and "rig-natops_edited_paper.paper: the code that flew is" in made.stderr


DAMAGE = {
    "no block of that type": (30 + len("bundle.json"), 0x06),
    "encrypted": (8, 0x01),
    "packed by nobody": (10, 99),
}
"""In the first file's header, the second and third in its entry in the list: which byte, and bits set in it."""


@pytest.mark.parametrize("what", DAMAGE)
def test_a_damaged_bundle_is_one_line(bundle, what):
    data, (at, bits) = bytearray(bundle.read_bytes()), DAMAGE[what]
    begin = data.index(b"PK\x03\x04" if at >= 30 else b"PK\x01\x02")
    data[begin + at] |= bits
    bundle.write_bytes(data)
    with pytest.raises(DataError, match="is no bundle of"), opened(bundle):
        pass


def test_a_full_disk_and_a_missing_file_are_told_as_such(bundle, true_bundle, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(ENOSPC, strerror(ENOSPC))

    with pytest.raises(DataError, match=r"none\.zip cannot be unpacked: No such file"), opened(tmp_path / "none.zip"):
        pass
    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(DataError, match=r"true\.zip cannot be unpacked: No space left"), opened(bundle):
        pass
    monkeypatch.setattr(zipfile.ZipFile, "writestr", full)
    with pytest.raises(DataError, match=r"mine\.zip cannot be written: No space left"):
        write_bundle(true_bundle / "flown", tmp_path / "mine.zip", "mine", 1, None)


def test_a_part_of_a_suite_leaves_no_bundle(tmp_path, here):
    done = here("submit", fly(tmp_path / "part", only="rig-*"), "--title", "part", "--out", tmp_path / "part.zip")
    assert (done.returncode, "every cell counts" in done.stderr) == (2, True)
    assert not (tmp_path / "part.zip").exists()


def test_a_suite_that_nobody_else_has_leaves_no_bundle(tmp_path, monkeypatch, here):
    monkeypatch.setattr("shipland.evaluation.bundle.load_suite", load_suite)
    done = here("submit", fly(tmp_path / "own"), "--title", "own", "--out", tmp_path / "own.zip")
    assert (done.returncode, "flew suite tiny 1, which is none of the packaged ones" in done.stderr) == (2, True)
    assert not (tmp_path / "own.zip").exists()


def test_no_leaderboard_pairs_flights_of_different_scenarios_of_one_name(tmp_path, here):
    calm, bundles = tmp_path / "calm.toml", []
    calm.write_text("[wind]\nmean_mps = 0.0\n")
    for title, config in (("as packaged", None), ("calm", calm)):
        options = {"runs": 2, "workers": 1, "progress": False, "oracle_motions": 0}
        shipland.campaign("near", pilot="paper", out=tmp_path / title, config=config, **options)
        bundles.append(tmp_path / f"{title}.zip")
        write_bundle(tmp_path / title, bundles[-1], title, 0, None)
    done = here("report", *bundles, "--oracle-motions", "0")
    assert (done.returncode, done.stderr) == (
        2, f"shipland: {bundles[1]}: near is another scenario than in the bundles before it\n",
    )  # fmt: skip


def test_an_own_aircraft_is_taken_along(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("bundled_aircraft.py").write_text("from shipland.sim.aircraft.aircraft import Quadrotor as made\n")
    scenario = load_scenario("near", **{"aircraft.kind": "bundled_aircraft:made"})
    shipland.campaign(scenario, pilot="paper", runs=1, out="flown", workers=1, progress=False, oracle_motions=0)
    about = write_bundle(Path("flown"), Path("mine.zip"), "mine", 1, None)
    assert about["own_code"] == {"bundled_aircraft:made": "code/bundled_aircraft.py"}
    with opened(Path("mine.zip")) as found:
        assert len(found.flights) == 1


def test_other_code_is_named(bundle, monkeypatch, here):
    monkeypatch.setattr("shipland.evaluation.verify.source_digest", lambda: "f" * 16)
    done = here("verify", bundle)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "here is ffffffffffffffff" in done.stderr


def test_a_leaderboard_of_bundles(bundle, tmp_path, here):
    other = tmp_path / "other.zip"
    write_bundle(fly(tmp_path / "other", pilot="horizon"), other, "other 2", 1, None)
    with opened(bundle) as one, opened(other) as two:
        write_receipt(bundle, Verified(8, 5, one.digest, "1"))
        cells = entries_of([one, two])
        table = standings(cells)
        assert "<td>true 1</td><td>8</td><td>4 (50.0 %)</td>" in table
        assert "<td>0</td><td>4</td><td>0.12</td></tr>" in table
        page = benchmark_page([one, two], cells, {}, tmp_path)
        assert "5 of 8, all equal" in page
        assert "not verified" in page
        assert page.count("<h2>Entries</h2>") == 1
        with pytest.raises(DataError, match="one title"):
            entries_of([one, one])
    assert here("report", bundle, other, "--oracle-motions", "0", "--out", tmp_path / "board.html").returncode == 0
    assert "other 2" in (tmp_path / "board.html").read_text()


def test_what_is_no_bundle_is_refused(tmp_path):
    path = tmp_path / "none.zip"
    path.write_bytes(b"none")
    with pytest.raises(DataError, match="is no bundle"), opened(path):
        pass
    with pytest.raises(DataError, match="holds no campaign"):
        write_bundle(tmp_path, path, "none", 0, None)


def test_real_flights_come_out_the_same_to_the_last_digit(tmp_path, monkeypatch):
    monkeypatch.setattr(job, "land_once", REAL)
    options = {"workers": 1, "progress": False, "oracle_motions": 0, "settings": ["time_limit_s=0.5"]}
    shipland.campaign("rig-natops", runs=1, out=tmp_path / "flown", **options)
    write_bundle(tmp_path / "flown", tmp_path / "real.zip", "real", 1, None)
    assert check(tmp_path / "real.zip").again == 1
