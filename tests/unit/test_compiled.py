"""Compilation: machine code belongs to the sources that it was made of."""

import re
from pathlib import Path
from pickle import UnpicklingError

import pytest

from shipland import compiled as module
from shipland.compiled import cache_folder, compiled
from shipland.environments.landing import LandingEnv

COMPILED = "from shipland.compiled import compiled\n\n\n@compiled\ndef f(x):\n    return x + {}\n"


@pytest.fixture(autouse=True)
def _found_anew():
    yield
    cache_folder.cache_clear()


@pytest.fixture
def folder(tmp_path):
    """The cache's folder of a package whose one file has a compiled function, and another none."""
    package = tmp_path / "package"
    package.mkdir()

    def of(added: int, note: str = "") -> Path | None:
        (package / "kernels.py").write_text(COMPILED.format(added))
        (package / "other.py").write_text(f"# {note}\n")
        cache_folder.cache_clear()
        return cache_folder(package)

    return of


def test_other_sources_have_another_folder(folder):
    assert folder(1) != folder(2)
    assert folder(1, "plain code changes nothing") == folder(1)


def test_a_file_whose_functions_others_compile_says_so():
    sources = {path: path.read_text(encoding="utf-8") for path in Path(module.__file__).parent.rglob("*.py")}
    called = {name for text in sources.values() for name in re.findall(r"(?<![@\w] )\bcompiled\((\w+)\)", text)}
    homes = {path for path, text in sources.items() for name in called if re.search(rf"^def {name}\(", text, re.M)}
    assert homes
    assert not [path for path in homes if "@compiled" not in sources[path]]


def test_where_nothing_can_be_written_functions_are_compiled_without_a_cache(monkeypatch):
    monkeypatch.setattr(module, "cache_folder", lambda _: None)

    def twice(x: float) -> float:
        return 2.0 * x

    assert compiled(twice)(1.5) == 3.0


def test_the_machine_code_lies_in_that_folder(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "cache_folder", lambda _: tmp_path)
    before = module.numba.config.CACHE_DIR

    def thrice(x: float) -> float:
        return 3.0 * x

    assert compiled(thrice)(1.5) == 4.5
    assert list(tmp_path.rglob("*.nbi"))
    assert before == module.numba.config.CACHE_DIR


def test_machine_code_that_a_loss_of_power_cut_off_is_compiled_again(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(module._SETTINGS, "DISABLE_JIT", 0)
    monkeypatch.setattr(module._SETTINGS, "CACHE_DIR", str(tmp_path))
    cache_folder.cache_clear()

    def four_times(x: float) -> float:
        return 4.0 * x

    assert compiled(four_times)(1.5) == 6.0
    index, code = next(tmp_path.rglob("*.nbi")), next(tmp_path.rglob("*.nbc"))
    for path, left in ((index, 0), (code, 100)):
        whole = path.read_bytes()
        path.write_bytes(whole[:left])
        with pytest.raises((EOFError, UnpicklingError)):
            compiled(four_times)(1.5)
        cache_folder.cache_clear()  # as in the next process
        assert compiled(four_times)(1.5) == 6.0
        assert path.read_bytes()[-1:] == b"."
    cache_folder.cache_clear()
    assert compiled(four_times)(1.5) == 6.0
    assert caplog.messages.count("machine code was cut off (1 files) and is compiled again") == 2


def test_a_first_flight_says_that_it_compiles_and_a_second_does_not(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(module, "cache_folder", lambda _: tmp_path)
    monkeypatch.setattr(module._SETTINGS, "DISABLE_JIT", 0)
    module.say_that_it_compiles()
    assert caplog.messages == ["compiling for this processor, once; takes about a minute"]
    assert module.compiles_for_all()
    (tmp_path / "kernels.nbi").write_text("")
    module.say_that_it_compiles()
    assert len(caplog.messages) == 1
    assert not module.compiles_for_all()
    monkeypatch.setattr(module, "cache_folder", lambda _: None)
    module.say_that_it_compiles()
    assert not module.compiles_for_all()  # each process compiles for itself
    assert "each time: no cache folder can be written" in caplog.messages[1]


def test_an_environment_says_so_too(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(module, "cache_folder", lambda _: tmp_path)
    monkeypatch.setattr(module._SETTINGS, "DISABLE_JIT", 0)
    LandingEnv("near").close()
    assert caplog.messages == ["compiling for this processor, once; takes about a minute"]
