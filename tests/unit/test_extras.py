"""Without an extra: what flies goes on, what cannot says in one line what to install."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from shipland.commands.publish import Publish
from shipland.errors import ConfigError, SystemLibraryError
from shipland.extras import EXTRAS, extra_of, installed, require
from shipland.vehicles.ros2.vehicle import Ros2Vehicle
from shipland.vision.near.files import default_camera

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

WITHOUT = """
import sys
for name in {modules}:
    sys.modules[name] = None
from shipland.cli import main
for words in {commands}:
    sys.argv = ["shipland", *words]
    try:
        main()
    except SystemExit as end:
        print(end.code)
"""


def without(modules, *commands, cwd):
    """The command lines, in turn in a process where these modules are not installed; it prints their codes."""
    code = WITHOUT.format(modules=modules, commands=commands)
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=cwd, timeout=300, check=True
    )


def test_every_extra_is_in_the_project():
    declared = PROJECT["optional-dependencies"]
    assert set(EXTRAS) <= set(declared)
    assert set(declared) - set(EXTRAS) == {"dev", "docs", "full", "parrot"}  # what no command asks for
    page = (ROOT / "docs" / "how-to" / "install.md").read_text(encoding="utf-8")
    assert not [name for name in EXTRAS if f"`{name}`" not in page]


def test_one_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    installed.cache_clear()
    assert not installed("cluster")
    with pytest.raises(ConfigError, match=r"^--cluster needs ray; install it with: pip install 'shipland\[cluster\]'$"):
        require("cluster", "--cluster", ConfigError)
    with pytest.raises(SystemLibraryError, match="it needs nowhere"):
        require("train", "it", module="nowhere")
    installed.cache_clear()


def test_a_submodule_is_of_its_extra():
    assert extra_of("matplotlib.backends.backend_pdf") == "plots"
    assert extra_of("numpy") is None


def test_ros2_is_told_without_mavlink(monkeypatch, capsys):
    class Ended(Ros2Vehicle):
        camera, _stream = default_camera(), None

        def __init__(self):
            pass

        def connect(self, *_):
            return None

        look = inform_of = close = connect

    monkeypatch.setitem(sys.modules, "shipland.vehicles.mavlink.vehicle", None)
    monkeypatch.setattr("shipland.scenario.real_vehicle.make_vehicle", lambda *_: Ended())
    assert Publish(vehicle="ros2://drone").run() == 0
    assert capsys.readouterr().out == "0 poses published; the camera has ended\n"


@pytest.mark.slow
def test_the_base_flies_films_and_says_what_is_missing(tmp_path):
    words = ("fly", "--set", "time_limit_s=0.4", "--vision", "geometric", "--out", "out")
    again = ("again", "out/flight.mcap", "--out", "again")
    done = without(["matplotlib", "av", "openvino"], words, again, cwd=tmp_path)
    said = done.stdout.splitlines()
    assert (said[0], *said[-2:]) == ("1", "the same flight, bit for bit", "1"), done.stderr  # flown, not landed
    assert "no side-by-side.png: pip install 'shipland[plots]'" in done.stderr
    assert "no plots.png: pip install 'shipland[plots]'" in done.stderr
    assert "H.264: pip install 'shipland[film]'" in done.stderr
    names = {path.name for path in (tmp_path / "out").glob("[!.]*")}
    assert names == {"flight.mcap", "flight.mp4", "foxglove-layout.json", "summary.json", "timing.json"}
    assert (tmp_path / "out" / "flight.mp4").stat().st_size > 1000


@pytest.mark.slow
def test_what_cannot_be_done_is_one_line(tmp_path):
    (tmp_path / "film.mp4").write_bytes(b"")
    said = {
        ("print-cue",): "needs matplotlib; install it with: pip install 'shipland[plots]'",
        ("motion",): "needs matplotlib",
        ("paper",): "needs matplotlib",
        ("evaluate",): "needs matplotlib",
        ("see", "film.mp4"): "looking at film.mp4 needs av; install it with: pip install 'shipland[film]'",
    }
    done = without(["matplotlib", "av"], *said, cwd=tmp_path)
    assert done.stdout.splitlines() == ["2"] * len(said), done.stderr
    for line, words in zip(done.stderr.splitlines(), said.values(), strict=True):
        assert words in line
