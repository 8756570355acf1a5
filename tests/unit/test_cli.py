"""The command line: answers at once, teaches, and turns every bad input into one line and exit code 2."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from shipland import progress
from shipland.cli import COMMANDS
from shipland.commands import example
from shipland.commands.example import Example
from shipland.commands.fly import Fly
from shipland.record.reader import read_log

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_the_list_of_commands_fits_two_screens_and_each_command_tells_all(here):
    every, fly = here("--help").stdout, here("fly", "--help").stdout
    assert len(every.splitlines()) < 70
    assert "Fly one landing" in every and "Example:" not in every
    assert len([line for line in fly.splitlines() if line.startswith("Example: ")]) == 2
    assert "Exit code: 0 landed" in fly


def test_a_campaign_leaves_tables_and_is_compared_and_reported(tmp_path, here, monkeypatch):
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.0)
    out = tmp_path / "out"
    words = ["campaign", "--set", "time_limit_s=1", "--runs", "2", "--workers", "1", "--oracle-motions", "0"]
    done = here(*words, "--pilot", "paper,horizon", "--out", str(out))
    assert done.returncode == 0, done.stderr
    # How far it is, where there is no terminal.
    assert re.search(r"flights: 2 of 4 after .* left  0 of 2 landed in the square \(0–84 %\)", done.stderr)
    assert "4 of 4 flown" in done.stderr
    cell = out / "near_time_limit_s=1_horizon"
    assert re.search(r"\| near \| horizon \| [\d., ]+ \| 2 \| 0 \(0.0 %\) \|", done.stdout)
    assert "| seed |" in (cell / "table.md").read_text()
    assert (cell / "landings.png").exists()
    assert len((out / "flights.csv").read_text().splitlines()) == 5
    assert "2 seeds flown by both" in here("compare", cell, out / "near_time_limit_s=1_paper").stdout
    assert "| near_time_limit_s=1_paper | 2 |" in here("compare", out, out).stdout
    assert here("report", out, "--oracle-motions", "0").returncode == 0
    own = (out / "report.html").read_bytes()
    monkeypatch.chdir(tmp_path)
    several = here("report", out, shutil.copytree(out, tmp_path / "second"), "--oracle-motions", "0")
    assert several.stdout.strip() == str(Path("out", "report", "report.html"))
    assert (out / "report.html").read_bytes() == own
    compared = here("compare", out, tmp_path)
    assert compared.returncode == 2
    assert f"{tmp_path} holds no campaign" in compared.stderr


def test_cycles_that_no_viewer_saw_are_told(without_plots, tmp_path, here, monkeypatch):
    monkeypatch.setattr("shipland.commands.fly._VIEWER_S", 0.0)
    monkeypatch.setattr("shipland.record.live.LiveView.left_out", 3)
    said = []
    monkeypatch.setattr("shipland.commands.terminal.Terminal.say", lambda _, text: said.append(text))
    words = ["fly", "--vision", "geometric", "--set", "time_limit_s=0.5", "--no-video", "--live", "--live-port", "0"]
    here(*words, "--out", tmp_path)
    assert any("3 cycles were left out" in text for text in said)


def test_version_and_scenarios(here):
    assert here("version").stdout.strip() == here("--version").stdout.strip() != ""
    assert "near" in here("scenarios").stdout


def test_help_teaches_and_says_nothing_that_helps_nobody(here):
    for command in COMMANDS:
        said = " ".join(here(command, "--help").stdout.split())
        assert len(said) > 100, command
        for noise in (
            "{None}",
            "(default: None)",
            "(default: '')",
            "(default: )",
            "(default: False)",
            "PATH PATH",
            "[[PATH",
        ):
            assert noise not in said, f"{command}: {noise}"
    assert "usage: shipland print-cue [-h] [CUE]" in here("print-cue", "--help").stdout
    assert "usage: shipland compare [-h] FIRST SECOND" in here("compare", "--help").stdout
    assert "(default: 20)" in here("campaign", "--help").stdout


def test_help_breaks_no_word_and_an_error_names_the_commands_own_options(here):
    lines = here("campaign", "--help").stdout.splitlines()
    assert max(len(line) for line in lines if "Example" not in line) <= 100
    wrong = here("fly", "--sed", "4")
    assert wrong.returncode == 2
    assert "--seed INT" in wrong.stderr and "shipland again" not in wrong.stderr


def test_examples_are_listed_and_written(here, tmp_path):
    listed = here("example").stdout
    assert "own_pilot.py           A pilot of one's own in twenty lines" in listed
    assert len(listed.splitlines()) == len(list(EXAMPLES.glob("*.*")))
    out = tmp_path / "mine.py"
    assert here("example", "own_pilot.py", "--out", str(out)).returncode == 0
    assert out.read_text() == (EXAMPLES / "own_pilot.py").read_text()
    out.write_text("changed")
    again = here("example", "own_pilot.py", "--out", str(out))
    assert (again.returncode, out.read_text()) == (2, "changed")
    assert "is there already" in again.stderr
    assert "did you mean own_pilot.py?" in here("example", "own_pilto").stderr


def test_a_folder_beside_the_examples_is_none(tmp_path, monkeypatch, capsys):
    """Jupyter leaves one."""
    (tmp_path / "examples" / ".ipynb_checkpoints").mkdir(parents=True)
    (tmp_path / "examples" / "own.py").write_text("# Mine.\n")
    monkeypatch.setattr(example, "_PACKAGE", tmp_path)
    assert Example().run() == 0
    assert capsys.readouterr().out.split() == ["own.py", "Mine"]


BAD_TOML = "this is [ not toml"
UNKNOWN_KEY = "[rig]\ndeck_sise_m = 1.0\n"
BAD_VALUE = "[wind]\nmean_mps = -3.0\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fly", "--scenario", "nowhere"), "nowhere"),
        (("fly", "--config", "missing.toml"), "does not exist"),
        (("fly", "--pilot", "papper"), "there are: deck_following, horizon, image_servoing, learned"),
        (("fly", "--vision", "nowhere:eyes"), "no module 'nowhere'"),
        (("fly", "--set", "wind.mean_mps=-1"), "mean_mps"),
        (("fly", "--set", "wind.mean_mps=1,2"), "one value"),
        (("fly", "--set", "wind.meen_mps=1"), "did you mean 'mean_mps'"),
        (("campaign", "--set", "wind"), "section.key=value"),
        (("fly", "--config", "bad.toml"), "not valid TOML"),
        (("fly", "--config", "unknown.toml"), "did you mean 'deck_size_m'"),
        (("fly", "--config", "value.toml"), "mean_mps"),
        (("fly", "--vision", "geometric", "--out", "file.txt"), "file.txt"),
        (("campaign", "--runs", "0"), "1 or more"),
        (("motion", "--set", "ship.sea.sea_state=9"), "sea_state"),
        (("fly", "--seed", "-1"), "0 or more"),
        (("campaign", "--first-seed", "-1"), "0 or more"),
        (("motion", "--seed", "-1"), "0 or more"),
        (("synth", "--out", "set", "--seed", "-1"), "--seed must be 0 or more"),
        (("evaluate", "--seed", "-1"), "--seed must be 0 or more"),
        (("train", "--data", "set", "--out", "run", "--minutes", "0"), "--minutes must be positive"),
        (("campaign", "--minutes", "-1"), "--minutes must be positive"),
        (("campaign", "near", "--print-only", "--out", "nowhere"), "nowhere does not exist"),
        (("campaign", "--minutes", "nan"), "--minutes must be positive"),
        (("envelope", "near", "--first-seed", "-1"), "0 or more"),
        (("submit", "out", "--title", "mine", "--logs", "-1"), "--logs must be 0 or more"),
        (
            ("fly", "--vehicle", "mavlink://udp:1.1.1.1:0?camera=film.mp4", "--vision", "nowhere"),
            "no 'nowhere' among the visions",
        ),
        (("serve-physics", "--port", "99999"), "--port must be 1 to 65535"),
        (("serve-physics", "--frames-port", "0"), "--frames-port must be 1 to 65535"),
        (("fly", "--live", "--live-port", "70000"), "--live-port must be 0 to 65535"),
        (("identify", "flight.mcap", "--uplink-s", "-1"), "--uplink-s must be 0 or more"),
        (("envelope", "near", "--every-deg", "100"), "--every-deg must divide 360°"),
        (("envelope", "near", "--every-deg", "1e-6"), "--every-deg must divide 360°"),
        (("envelope", "near", "--finest-kn", "1e-4"), "--finest-kn must be 0.1 or more"),
        (("fly", "--wind-mps", "9"), "--set wind.mean_mps"),
        (("fly", "--calibration", "camera.yaml"), "give --vehicle too"),
        (("fly", "--check"), "give --vehicle too"),
        (("fly", "--vehicle", "replay://film.mp4", "--wind-mps=-9"), "--wind-mps must be 0 or more"),
        (("serve-physics", "--interface", "ros2", "--port", "9002"), "--port is of json and px4"),
        (("campaign", "--out", "file.txt/out"), "cannot be written"),
        (("compare", "here", "there"), "holds no campaign"),
        (("see", "missing.png"), "missing.png"),
        (("see", "picture.png", "--calibration", "missing.yaml"), "missing.yaml"),
        (("see", "picture.png", "--cue", "bad.toml"), "not valid TOML"),
        (("see", "picture.png", "--cue", "unknown.toml"), "unknown key"),
        (("see", "file.txt"), "file.txt"),
        (("see", "picture.png", "--camera=camera.yaml"), "--camera of `shipland see` is called --calibration now"),
        (("replay", "film.mp4", "--camera", "camera.yaml"), "is called --calibration now"),
        (("evaluate", "--scenes", "3"), "is called --count now"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, words, tmp_path, here, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("bad.toml", BAD_TOML), ("unknown.toml", UNKNOWN_KEY), ("value.toml", BAD_VALUE)):
        (tmp_path / name).write_text(text)
    (tmp_path / "file.txt").write_text("not a picture")
    (tmp_path / "picture.png").write_bytes(b"")
    done = here(*arguments)
    assert done.returncode == 2, done.stdout + done.stderr
    line = done.stderr.strip()
    assert line.startswith("shipland: ")
    assert "\n" not in line
    assert words in line


def test_a_table_that_cannot_be_written_is_said_with_the_first_picture(tmp_path, here, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("grey.png", np.full((72, 128, 3), 90, np.uint8))
    done = here("see", "grey.png", "--csv", "grey.png/poses.csv")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == "shipland: grey.png/poses.csv: Not a directory"


def test_letters_that_a_terminal_does_not_know_are_replaced():
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-m", "shipland", "--help"], capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert "COMMAND ?\n" in done.stdout  # an ellipsis


def test_a_full_disk_is_one_line_after_the_flight(tmp_path, here):
    (tmp_path / "flight.mcap").symlink_to("/dev/full")
    short = ("--set", "time_limit_s=2", "--vision", "geometric", "--no-video")
    done = here("fly", *short, "--out", tmp_path)
    assert done.returncode == 2
    *_, last = done.stderr.strip().splitlines()
    assert last.startswith("shipland: the flight is not on record as asked: log given up:")
    assert "No space left on device" in last
    assert done.stderr.count("No space left") == 1
    assert sorted(path.name for path in tmp_path.glob("[!.]*") if path.is_file()) == [
        "foxglove-layout.json", "timing.json",
    ]  # fmt: skip


SHORT = ("fly", "--vision", "geometric", "--no-video", "--set", "time_limit_s=4", "--out")


@pytest.mark.slow
def test_a_reader_that_has_gone_does_not_end_the_flight(tmp_path):
    with subprocess.Popen([sys.executable, "-m", "shipland.cli", *SHORT, tmp_path], stderr=subprocess.PIPE) as process:
        try:
            assert any(b"SEARCH" in line for line in process.stderr)
            process.stderr.close()  # as `| head -1` does
            assert process.wait(120.0) == 1  # it did not land: nothing else
        finally:
            process.kill()
    log = read_log(tmp_path / "flight.mcap")
    assert log.complete
    assert log.records[-1].telemetry.t_s > 3.9


_ON_ITS_TERMINAL = (
    "import fcntl, os, sys, termios; os.setsid(); fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
    "from shipland.cli import main; main()"
)


@pytest.mark.slow
def test_a_connection_that_is_lost_ends_the_flight_in_order(tmp_path):
    master, slave = os.openpty()
    words = [sys.executable, "-c", _ON_ITS_TERMINAL, "fly", "--vision", "geometric", "--no-video", "--out", tmp_path]
    with subprocess.Popen(words, stdin=slave, stdout=slave, stderr=slave) as process:
        try:
            os.close(slave)
            said = b""
            while b"SEARCH" not in said:
                said += os.read(master, 4096)
            os.close(master)  # its shell gets a hang-up, what it prints an error
            assert process.wait(120.0) == 130
        finally:
            process.kill()
    assert sorted(path.name for path in tmp_path.glob("[!.]*")) == [
        "flight.mcap", "foxglove-layout.json", "plots.png", "summary.json", "timing.json",
    ]  # fmt: skip
    assert read_log(tmp_path / "flight.mcap").complete


def test_demo_is_the_demo_scenario_and_says_what_to_look_at(here, monkeypatch):
    flown = []
    monkeypatch.setattr(Fly, "run", lambda command: flown.append(command) or 1)
    done = here("demo", "--seed", "3", "--out", "out/a b")
    assert (done.returncode, flown) == (1, [Fly(scenario="demo", seed=3, out=Path("out/a b"))])
    assert "look at 'out/a b/flight.mp4'" in done.stderr
    makefile = (EXAMPLES.parent / "Makefile").read_text(encoding="utf-8")
    assert "$(BIN)/shipland demo $(ARGS)" in makefile


def test_what_needs_a_missing_module_says_what_to_install(here, monkeypatch):
    def run(command):
        raise ModuleNotFoundError("No module named 'matplotlib.figure'", name="matplotlib.figure")

    monkeypatch.setattr(Fly, "run", run)
    done = here("fly")
    assert (done.returncode, done.stderr) == (
        2,
        "shipland: this needs matplotlib.figure; install it with: pip install 'shipland[plots]'\n",
    )
