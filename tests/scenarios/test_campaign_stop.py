"""A bench that is killed, without a word or with one, and gone on with gives the same tables to the last digit."""

import signal
import subprocess
import sys
import time

GRID = ["--scenario", "rig-natops", "--pilot", "paper,horizon", "--set", "time_limit_s=2.0", "--runs", "6"]


def bench(out, workers):
    words = ["campaign", *GRID, "--oracle-motions", "0", "--out", str(out), "--workers", str(workers)]
    return [sys.executable, "-m", "shipland.cli", *words]


def rows(out):
    return sum(len(path.read_text().splitlines()) - 1 for path in out.glob("*/landings.csv"))


def test_a_run_that_is_killed_and_gone_on_with_gives_the_same_tables(tmp_path):
    out, whole = tmp_path / "out", tmp_path / "whole"
    for how, workers in ((signal.SIGKILL, 2), (signal.SIGINT, 1)):
        before = rows(out)
        with subprocess.Popen(bench(out, workers), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
            while rows(out) < before + 2:
                assert run.poll() is None, run.stderr.read()
                time.sleep(0.02)
            run.send_signal(how)
            said = run.communicate(timeout=60)[1]
        assert "Traceback" not in said
        assert run.returncode == (-signal.SIGKILL if how is signal.SIGKILL else 130)
        assert before + 2 <= rows(out) < 12
    assert subprocess.run(bench(out, 1), capture_output=True, timeout=300).returncode == 0
    assert subprocess.run(bench(whole, 1), capture_output=True, timeout=300).returncode == 0
    assert (out / "tables.md").read_text() == (whole / "tables.md").read_text()
    assert not list(out.rglob("*.part"))
