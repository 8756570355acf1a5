"""What users bring: by name, by entry point, by module:factory; a wrong name teaches."""

import pickle

import pytest

from shipland import factories
from shipland.errors import ConfigError, ShiplandError


@pytest.mark.parametrize("group", list(factories.PACKAGED))
def test_every_packaged_name_resolves(group):
    for name in factories.PACKAGED[group]:
        assert callable(factories.resolve(group, name))


def test_a_factory_is_given_back_and_has_a_name():
    assert factories.resolve("pilots", len) is len
    assert factories.name_of(len) == "builtins:len"
    assert factories.name_of("paper") == "paper"


def test_a_file_of_the_current_folder_is_importable(tmp_path, monkeypatch):
    (tmp_path / "shipland_test_pilot.py").write_text("class Maker:\n    def pilot(setup): return 7\n")
    monkeypatch.chdir(tmp_path)
    factory = factories.resolve("pilots", "shipland_test_pilot:Maker.pilot")
    assert factory(None) == 7
    assert pickle.loads(pickle.dumps(factory))(None) == 7


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("papper", "there are: deck_following, horizon, image_servoing, learned, p, paper, pid, residual"),
        ("nowhere_at_all:pilot", "no module 'nowhere_at_all'"),
        ("shipland.frames:no_such", "no 'no_such' to call"),
        ("shipland_test_broken:pilot", "ValueError: out of order"),
        ("shipland_test_wants:pilot", "No module named 'not_installed_here'"),
    ],
)
def test_a_wrong_name_says_what_there_is(name, words, tmp_path, monkeypatch):
    (tmp_path / "shipland_test_broken.py").write_text("raise ValueError('out of order')\n")
    (tmp_path / "shipland_test_wants.py").write_text("import not_installed_here\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=words):
        factories.resolve("pilots", name)


def test_an_extra_that_a_module_wants_is_named_without_the_module(tmp_path, monkeypatch):
    wants = "from shipland.extras import require\nrequire('cluster', 'nimbus', module='not_installed_here')\n"
    (tmp_path / "shipland_test_extra.py").write_text(wants)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ShiplandError, match=r"^nimbus needs not_installed_here; install it with"):
        factories.resolve("pilots", "shipland_test_extra:pilot")


def test_entry_points_of_installed_packages_count(tmp_path, monkeypatch):
    info = tmp_path / "other-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[shipland.pilots]\nnimbus = shipland_test_nimbus:make\n")
    (tmp_path / "shipland_test_nimbus.py").write_text("def make(setup): return 'nimbus'\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert factories.resolve("pilots", "nimbus")(None) == "nimbus"
    assert "nimbus" in factories.names("pilots")
