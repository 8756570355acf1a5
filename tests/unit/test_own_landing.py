"""The study of an autopilot's own landing: a flight is kept, a late one does not count, no binary leaves it out."""

import contextlib
import json

import pytest
import tyro
from studies import __main__ as command
from studies import harness, own_landing
from tools.land_outside import Arguments

from shipland.errors import DataError

ROW = {"success": True, "reason": "landed in the square, 4 cm from its centre", "off_m": 0.04, "at_s": 30.1}
ROW |= {"rest": "motors at rest 2.50 s after the touch", "world_fell_behind_s": 0.01}
LOST = {
    "success": False,
    "reason": "no verdict: 0.88 m over the deck at the end",
    "rest": "",
    "world_fell_behind_s": 0.0,
}
LATE = ROW | {"world_fell_behind_s": 0.2}


@pytest.fixture
def flown(tmp_path, monkeypatch):
    """Flights are made up: seed 2 is lost, the world falls behind in seed 3, and the tool is stopped once."""
    commands = []

    def run(words, *, check):
        assert check
        commands.append(words)
        if len(commands) == 2:
            raise KeyboardInterrupt
        asked = tyro.cli(Arguments, args=words[2:])
        row = {2: LOST, 3: LATE}.get(asked.first, ROW) | {"seed": asked.first}
        asked.out.mkdir(parents=True, exist_ok=True)
        (asked.out / f"{asked.scenario}.json").write_text(json.dumps([row]))

    monkeypatch.setattr(own_landing, "PARTS", tmp_path)
    monkeypatch.setattr(own_landing, "digest", lambda _: "of the code")
    monkeypatch.setattr(own_landing.subprocess, "run", run)
    for autopilot, binary in own_landing.BINARIES.items():
        monkeypatch.setenv(binary, f"/opt/{autopilot}")
    return commands


def test_a_row_resumes_flight_by_flight_and_counts_what_kept_pace(flown):
    study = harness.load("own_landing")
    case = study.cases()[0]
    with pytest.raises(KeyboardInterrupt):
        study.measure(case, 3)
    row = study.measure(case, 3)
    assert [words[words.index("--first") + 1] for words in flown] == ["1", "2", "2", "3"]
    assert (row["flights"], row["late"], row["success"]["value"]) == (2, 1, 0.5)
    assert (row["off_m"], row["most_m"], row["rest_s"]) == (0.04, 0.04, 2.5)
    assert row["others"] == "1 in the air at the end"
    assert {**case, **row}.keys() <= study.columns.keys()
    assert study.measure(case, 3) == row
    assert flown[4:] == [flown[3]], "the late one is flown again"
    assert "--own-landing" in flown[0]
    assert "delays.video_s=0.3" in flown[0]


def test_each_autopilot_is_flown_with_and_without_its_own_landing(flown):
    for case in own_landing.cases():
        with contextlib.suppress(KeyboardInterrupt):
            own_landing.landing(case, 1)
        asked = tyro.cli(Arguments, args=flown[-1][2:])
        assert asked.autopilot == str(case["autopilot"]).lower()
        assert asked.own_landing == (case["who"] == "itself")


def test_where_nothing_flies_there_is_no_row(flown, monkeypatch):
    monkeypatch.setitem(ROW, "world_fell_behind_s", 9.0)
    monkeypatch.setitem(ROW, "fly", "cannot connect")
    with pytest.raises(DataError, match="cannot connect"):
        own_landing.measure(own_landing.cases()[0], 1)


def test_another_case_and_another_binary_fly_anew(flown, monkeypatch):
    first, beside = own_landing.cases()[:2]
    own_landing.landing(first, 1)
    flown.append("stopped once")
    own_landing.landing(beside, 1)
    monkeypatch.setenv("SHIPLAND_ARDUCOPTER", "/opt/another")
    own_landing.landing(first, 1)
    assert len(flown) == 4
    assert "--own-landing" not in flown[2]


def test_without_a_binary_the_study_is_left_out(monkeypatch, capsys):
    monkeypatch.setenv("SHIPLAND_ARDUCOPTER", "/opt/arducopter")
    monkeypatch.delenv("SHIPLAND_PX4", raising=False)
    monkeypatch.setattr(command, "update_pages", list)
    command.main(("own_landing",))
    assert capsys.readouterr().err == "studies: own_landing is left out: SHIPLAND_PX4 names nothing\n"
