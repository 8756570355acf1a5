"""A logged flight flown anew: the same one, where nothing was changed; and what is said where something was."""

import re
from collections.abc import Iterator
from dataclasses import replace
from errno import ENOSPC
from os import strerror
from pathlib import Path

import pytest
from made_up_flight import INFO, flight, write_log

from shipland.api import fly
from shipland.commands.again import Again
from shipland.commands.replay import Replay
from shipland.errors import ConfigError, DataError
from shipland.flight import FlightResult
from shipland.record.reader import read_log
from shipland.report.again import comparison, versions
from shipland.scenario.fly import Flown
from shipland.scenario.scenario import load_scenario
from shipland.version import code_version


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    out = tmp_path_factory.mktemp("flown")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("shipland.report.outputs.installed", lambda _: False)  # the pictures of one flight are slow
        fly(load_scenario("near", time_limit_s=1.5), seed=4, out=out, video=False)
        yield out / "flight.mcap"


def test_the_same_code_flies_the_same_flight(flown, tmp_path, capsys):
    assert Again(flown, out=tmp_path).run() == 1  # a second and a half does not land
    assert capsys.readouterr().out.splitlines()[-1] == "the same flight, bit for bit"
    assert (tmp_path / "side-by-side.png").stat().st_size > 10_000
    assert read_log(tmp_path / "flight.mcap").header.info.seed == 4


def test_a_flights_folder_stands_for_its_log(flown, tmp_path, capsys):
    assert Again(flown.parent, out=tmp_path).run() == 1
    assert Replay(recording=flown.parent).run() == 0
    assert "modes differ in 0 cycles" in capsys.readouterr().out


def test_an_output_that_failed_is_told(flown, tmp_path, monkeypatch):
    def full(_):
        raise OSError(ENOSPC, strerror(ENOSPC))

    monkeypatch.setattr("shipland.report.outputs.write_layout", full)
    with pytest.raises(DataError, match="not on record as asked: layout given up: No space left"):
        Again(flown, out=tmp_path).run()


def test_a_change_parts_them_and_it_is_said_where(flown, tmp_path, capsys):
    Again(flown, changes=("wind.mean_mps=8",), out=tmp_path).run()
    assert capsys.readouterr().out.splitlines()[-1].startswith("they differ from 0.")


def test_a_log_that_breaks_off_is_not_taken_for_the_whole_flight(flown, tmp_path, capsys):
    (tmp_path / "killed.mcap").write_bytes(flown.read_bytes()[: flown.stat().st_size // 2])
    Again(tmp_path / "killed.mcap", out=tmp_path / "again").run()
    assert re.search(r"killed\.mcap breaks off: \d+ cycles read, the log was not closed", capsys.readouterr().err)


def test_a_log_is_not_written_over(flown):
    with pytest.raises(ConfigError, match="would be written over"):
        Again(flown, out=flown.parent).run()


def logged(path, info, count=20):
    records = flight(from_s=20.0, to_s=20.0 + count / 30.0, pictures=False)
    return read_log(write_log(path, records, info=info))


def test_a_flight_of_a_vehicle_outside_is_refused(tmp_path):
    logged(tmp_path / "f.mcap", replace(INFO, command="shipland fly --vehicle mavlink://udp:1"))
    with pytest.raises(DataError, match="no flight of the simulator"):
        Again(tmp_path / "f.mcap", out=tmp_path / "again").run()


def test_a_log_whose_command_is_no_command_line_is_flown_again(tmp_path):
    log = logged(tmp_path / "f.mcap", replace(INFO, command="Tuesday's flight", configuration="{"))
    assert log.header.info.command == "Tuesday's flight"
    with pytest.raises(DataError, match="configuration cannot be read"):  # it gets as far as that
        Again(tmp_path / "f.mcap", out=tmp_path / "again").run()


def test_another_version_is_named():
    assert versions("0.0.7").startswith("flown by version 0.0.7, again by ")
    assert "perhaps" in versions(code_version()) or not versions(code_version())


def test_a_shorter_flight_differs_at_its_end(tmp_path):
    whole, short = (logged(tmp_path / f"{count}.mcap", INFO, count) for count in (20, 12))
    assert list(comparison(whole, whole))[-1] == "the same flight, bit for bit"
    assert list(comparison(whole, short))[-1].startswith("they differ from 20.3")


@pytest.mark.parametrize(
    ("end", "words"),
    [
        ("landed: the motors have stopped", "landed: the motors have stopped; where, nothing here knows"),
        ("time limit of 120 s", "no touchdown: time limit of 120 s"),
    ],
)
def test_a_landing_that_nobody_judged_is_not_called_none(end, words):
    assert Flown(FlightResult(end, 100, 16.0, {}), None).reason == words
