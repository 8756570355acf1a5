"""A bench that is killed, without a word or with one, and gone on with gives the same tables to the last digit."""

import signal
import subprocess
import sys
import time

import pytest

from shipland.cli import main

GRID = ["--scenario", "rig-natops", "--pilot", "paper,horizon", "--set", "time_limit_s=2.0", "--runs", "6"]


def campaign(out, workers):
    return ["campaign", *GRID, "--oracle-motions", "0", "--out", str(out), "--workers", str(workers)]


def rows(out):
    return sum(len(path.read_text().splitlines()) - 1 for path in out.glob("*/landings.csv"))


@pytest.mark.slow
def test_a_run_that_is_killed_and_gone_on_with_gives_the_same_tables(tmp_path, monkeypatch):
    out, whole = tmp_path / "out", tmp_path / "whole"
    for how, workers in ((signal.SIGKILL, 2), (signal.SIGINT, 1)):
        before = rows(out)
        command = [sys.executable, "-m", "shipland.cli", *campaign(out, workers)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
            while rows(out) < before + 2:
                assert run.poll() is None, run.stderr.read()
                time.sleep(0.02)
            run.send_signal(how)
            said = run.communicate(timeout=60)[1]
        assert "Traceback" not in said
        assert run.returncode == (-signal.SIGKILL if how is signal.SIGKILL else 130)
        assert before + 2 <= rows(out) < 12
    for each in (out, whole):
        monkeypatch.setattr(sys, "argv", ["shipland", *campaign(each, 1)])
        with pytest.raises(SystemExit, match="0"):
            main()
    assert (out / "tables.md").read_text() == (whole / "tables.md").read_text()
    assert not list(out.rglob("*.part"))
