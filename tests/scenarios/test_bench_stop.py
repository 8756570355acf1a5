"""A bench that is killed, without a word or with one, and gone on with gives the same tables to the last digit."""

import signal
import subprocess
import sys
import time

import pytest

GRID = ["--scenario", "rig-natops", "--pilot", "paper", "horizon", "--set", "time_limit_s=2.0", "--runs", "6"]


def bench(out, *more):
    return [
        sys.executable,
        "-m",
        "shipland.cli",
        "bench",
        "run",
        *GRID,
        "--ceiling-motions",
        "0",
        "--out",
        str(out),
        *more,
    ]


def rows(out):
    return sum(len(path.read_text().splitlines()) - 1 for path in out.glob("*/landings.csv"))


@pytest.mark.parametrize(("how", "workers"), [(signal.SIGKILL, "2"), (signal.SIGTERM, "2"), (signal.SIGINT, "1")])
def test_a_killed_run_resumed_gives_the_same_tables(tmp_path, how, workers):
    out, whole = tmp_path / "out", tmp_path / "whole"
    with subprocess.Popen(
        bench(out, "--workers", workers), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        while rows(out) < 3:
            assert run.poll() is None, run.stderr.read()
            time.sleep(0.05)
        run.send_signal(how)
        said = run.communicate(timeout=60)[1]
    assert "Traceback" not in said
    assert run.returncode == (-signal.SIGKILL if how is signal.SIGKILL else 1)
    assert 3 <= rows(out) < 12
    assert subprocess.run(bench(out, "--workers", "1"), capture_output=True, timeout=300).returncode == 0
    assert subprocess.run(bench(whole, "--workers", "1"), capture_output=True, timeout=300).returncode == 0
    assert (out / "tables.md").read_text() == (whole / "tables.md").read_text()
    assert not list(out.rglob("*.part"))
