"""`shipland doctor`: a line a thing, and an exit code that says whether a flight can be drawn."""

import sys

from shipland.commands.doctor import Doctor
from shipland.errors import SystemLibraryError
from shipland.extras import EXTRAS, installed
from shipland.sim.scene import gl
from shipland.vision.far.detector import Detector


def lines(capsys):
    return {line[6:20].strip(): line for line in capsys.readouterr().out.splitlines()}


def test_it_looks_at_everything(capsys, monkeypatch, tmp_path):
    program = tmp_path / "arducopter"
    program.write_text("")
    program.chmod(0o755)
    monkeypatch.setenv("SHIPLAND_ARDUCOPTER", str(program))
    monkeypatch.setenv("SHIPLAND_PX4", str(tmp_path / "px4"))
    monkeypatch.setitem(sys.modules, "ray", None)
    installed.cache_clear()
    assert Doctor().run() == 0
    installed.cache_clear()
    said = lines(capsys)
    assert {
        "shipland",
        "cores",
        "disk",
        "OpenGL",
        "compiled",
        "priority",
        *(f"extra {name}" for name in EXTRAS),
    } <= set(said)
    assert said["OpenGL"].startswith("ok    OpenGL         off screen, on the ")
    assert said["detector ship"].startswith("ok ")
    assert said["ArduCopter"].startswith("ok ")
    assert said["PX4"].startswith("- ") and "no program that can be run" in said["PX4"]
    assert said["extra cluster"].endswith("pip install 'shipland[cluster]'")


def test_an_extra_that_is_installed_and_broken_is_none(capsys, monkeypatch, tmp_path):
    for module in ("osqp", "rosbags", "serial"):
        (tmp_path / module).mkdir()
        (tmp_path / module / "__init__.py").write_text("raise ImportError('libowl.so.3: cannot open shared object')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.syspath_prepend(tmp_path)
    installed.cache_clear()
    Doctor().run()
    installed.cache_clear()
    said = lines(capsys)
    for name in ("mpc", "ros2", "mavlink"):
        assert said[f"extra {name}"].startswith("- ")
        assert "broken: ImportError: libowl.so.3: cannot open shared object" in said[f"extra {name}"]
    assert said["extra plots"].startswith("ok ")


def test_what_cannot_even_be_looked_at_is_a_line_and_the_rest_is_looked_at(capsys, monkeypatch):
    def broken(*_):
        raise ImportError("libowl.so.3: cannot open shared object")

    monkeypatch.setattr(Detector, "load", broken)
    assert Doctor().run() == 1
    said = lines(capsys)
    assert said["detectors"] == "FAIL  detectors      ImportError: libowl.so.3: cannot open shared object"
    assert "priority" in said


def test_a_machine_that_cannot_draw_is_said(capsys, monkeypatch):
    def none():
        raise SystemLibraryError("apt-get install libegl1")

    monkeypatch.setattr(gl, "open_context", none)
    assert Doctor().run() == 1
    assert lines(capsys)["OpenGL"] == "FAIL  OpenGL         apt-get install libegl1"
