"""`shipland doctor`: a line a thing, and an exit code that says whether a flight can be drawn."""

import sys

from shipland.commands.doctor import Doctor
from shipland.errors import SystemLibraryError
from shipland.extras import EXTRAS, installed
from shipland.sim.scene import gl


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


def test_a_machine_that_cannot_draw_is_said(capsys, monkeypatch):
    def none():
        raise SystemLibraryError("apt-get install libegl1")

    monkeypatch.setattr(gl, "open_context", none)
    assert Doctor().run() == 1
    assert lines(capsys)["OpenGL"] == "FAIL  OpenGL         apt-get install libegl1"
