"""The documentation: its examples give what they say, its links lead somewhere, it names only what exists."""

import doctest
import importlib.util
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from studies import ORDER

from shipland.cli import COMMANDS
from shipland.config import key, parameters, plain
from shipland.evaluation.landing import COLUMNS
from shipland.report.configuration import scenario_settings, settings_of

ROOT = Path(__file__).parents[2]
DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS]


@pytest.fixture(scope="module")
def hooks():
    """What makes pages of the site."""
    pytest.importorskip("latex2mathml", reason="the docs extra is not installed")
    specification = importlib.util.spec_from_file_location("mkdocs_hooks", ROOT / "tools" / "mkdocs_hooks.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def page_id(path: Path) -> str:
    return str(path.relative_to(ROOT))


def prose(path: Path) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def fences(path: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", path.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("path", PAGES, ids=page_id)
def test_examples_give_what_the_page_says(path):
    source = "\n".join(fences(path, "pycon"))
    example = doctest.DocTestParser().get_doctest(source, {}, page_id(path), str(path), 0)
    report: list[str] = []
    doctest.DocTestRunner().run(example, out=report.append)
    assert not report, "".join(report)


@pytest.mark.parametrize("path", PAGES, ids=page_id)
def test_links_and_pictures_lead_to_files(path):
    targets = re.findall(r"\]\(([^)\s]+)", prose(path)) + re.findall(r'src="([^"]+)"', prose(path))
    local = [target.partition("#")[0] for target in targets if not re.match(r"[a-z]+:", target)]
    measured = {f"{name}.json" for name in ORDER}  # whose results may not be committed yet
    missing = [
        target
        for target in local
        if target and not (path.parent / target).exists() and Path(target).name not in measured
    ]
    assert not missing


def test_every_picture_is_shown_somewhere():
    text = "".join(path.read_text(encoding="utf-8") for path in PAGES)
    pictures = {path.name for path in (ROOT / "docs" / "pictures").iterdir()}
    assert {name for name in pictures if f"pictures/{name}" not in text} == set()


def test_anchors_of_links_between_pages_exist():
    wrong = []
    for path in PAGES:
        for target in re.findall(r"\]\(([^)\s]+#[^)\s]+)\)", prose(path)):
            file, _, anchor = target.partition("#")
            if not re.match(r"[a-z]+:", target) and (path.parent / file).suffix == ".md":
                wrong += [f"{page_id(path)}: {target}"] if anchor not in anchors(path.parent / file) else []
    assert not wrong


def anchors(path: Path) -> set[str]:
    """Of a page's headings, as MkDocs and forges make them."""
    headings = re.findall(r"^#+ (.*)$", prose(path), flags=re.MULTILINE)
    plain = [re.sub(r"[^\w\s-]", "", re.sub(r"\]\([^)]*\)", "", heading).lower()) for heading in headings]
    return {re.sub(r"[\s]+", "-", heading.strip()) for heading in plain}


def test_every_page_is_in_the_navigation_once():
    # MkDocs has tags of its own in its YAML, so the names are read as text.
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[2]
    named = re.findall(r"([\w/-]+\.md)\s*$", navigation, flags=re.MULTILINE)
    assert sorted(named) == sorted(str(path.relative_to(ROOT / "docs")) for path in DOCS)


@pytest.mark.parametrize("path", PAGES, ids=page_id)
def test_every_make_target_that_is_named_exists(path):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    named = set(re.findall(r"(?:^\$ |`)make ([a-z-]+)", path.read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert named <= targets


def test_no_script_or_font_comes_from_elsewhere():
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert re.search(r"^  font: false", settings, flags=re.MULTILINE)
    assert "http" not in settings
    polyfills = re.findall(r"^  polyfills:\n    - (\S+)", settings, flags=re.MULTILINE)
    assert polyfills == ["iframe-worker.js"], "the offline plug-in fetches one from elsewhere unless one has this name"
    assert (ROOT / "docs" / polyfills[0]).is_file()
    assert not [page_id(path) for path in DOCS if re.search(r"<(script|iframe|link)\b", prose(path))]


def test_pages_read_whole_without_a_plug_in():
    assert not [page_id(path) for path in PAGES if "<!--" in path.read_text(encoding="utf-8")]


def test_the_configuration_page_shows_every_key(hooks):
    page = (ROOT / "docs" / "reference" / "configuration.md").read_text(encoding="utf-8")
    files = [Path(file).name for file, how in hooks.SHOWN.findall(page) if how == "tables"]
    tables = "\n".join(map(hooks.page_tables, files))
    shown = re.findall(r"^\| `(\w+)` \|", tables, flags=re.MULTILINE)
    assert {setting.name for setting in scenario_settings("near")} <= set(shown)
    assert {"image_rate_hz", "anchors", "haze_m", "ship_bin_m", "setpoint_hz", "picture_hz", "touch_mps"} <= set(shown)


@parameters
class Inner:
    """`[outer.inner]`: lengths.

    Two of them.
    """

    list_m: tuple[int, ...] = key((1, 2), "two lengths")


@parameters
class Outer:
    inner: Inner = key(Inner(), source="[Lee2022]")
    name: str = key("a # b", source="chosen: a | b")
    ratio: float = key(0.5, "of both", ge=0, le=1)


def test_tables_by_hand(hooks):
    assert hooks.markdown_tables(settings_of(Outer, plain(Outer()), "rig")).splitlines() == [
        "",
        "### `[rig]`",
        "",
        "| key | default | unit | bounds | meaning | source |",
        "|---|---|---|---|---|---|",
        '| `name` | `"a # b"` |  |  |  | chosen: a &#124; b |',
        "| `ratio` | `0.5` |  | 0 to 1 | of both | chosen |",
        "",
        "### `[rig.inner]`",
        "",
        "lengths.  Two of them.",
        "",
        "| key | default | unit | bounds | meaning | source |",
        "|---|---|---|---|---|---|",
        "| `list_m` | `[1, 2]` | m |  | two lengths | [Lee2022] |",
    ]


@pytest.mark.parametrize("name", ["scenario.py", "outputs.py", "settings.py", "address.py"])
def test_the_page_knows_the_meaning_of_every_key(name, hooks):
    page = hooks.page_tables(name)
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    without = [row for row in rows if not row.split(" | ")[4].strip()]
    # The gains of the paper's far laws have the letters of its equations; their class names these.
    assert not [
        row for row in without if not re.match(r"\| `(far_control|far_variant|m|a|setpoint|d|k_p|t_i_s|t_d_s)`", row)
    ]


def test_every_command_has_its_help(hooks, monkeypatch):
    monkeypatch.setattr(hooks, "COMMANDS", COMMANDS[1:2])
    page = (ROOT / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
    made = hooks.on_page_markdown(page, page_of("reference/commands.md"))
    assert "\n## shipland fly\n\n```text\nusage: shipland fly" in made and "--scenario" in made


def test_files_that_pages_show_are_there(hooks):
    shown = [
        (path.parent / file).resolve().relative_to(ROOT)
        for path in DOCS
        for file, how in hooks.SHOWN.findall(path.read_text(encoding="utf-8"))
        if how == "shown"
    ]
    assert Path("examples/own_pilot.py") in shown
    assert all((ROOT / name).is_file() for name in shown)
    line = '[own_pilot.py](../../examples/own_pilot.py "shown")'
    page = hooks.on_page_markdown(line, page_of("tutorials/own-pilot.md"))
    assert page.startswith("```py\n") and page.endswith("\n```")


def test_links_out_of_the_documentation_become_text_on_the_site(hooks):
    line = "[modes.py](../../src/shipland/guidance/modes.py), [a\nb](../../LICENSE), [x](../results/suites.md#faults)"
    made = hooks.on_page_markdown(line, page_of("explanation/modes.md"))
    assert made == "`modes.py`, a\nb, [x](../results/suites.md#faults)"


def test_the_columns_of_files_are_shown_with_unit_and_meaning(hooks):
    page = ROOT / "docs" / "reference" / "outputs.md"
    shown = [how for _, how in hooks.SHOWN.findall(page.read_text(encoding="utf-8"))]
    assert shown == ["columns of flight", "columns of landings"]
    landings = hooks.column_table("landings").splitlines()
    assert re.findall(r"^\| `(\w+)` \|", "\n".join(landings), flags=re.MULTILINE) == COLUMNS
    assert "| `wind_off_bow_deg` | ° | the same clockwise from the bow at the start, within ±180 |" in landings
    assert "| `force_n` | N | largest contact force |" in landings
    flight = hooks.column_table("flight")
    assert "| `decision_command_roll_percent` | % |" in flight and "| `derived_truth_in_pad_m` | m |" in flight


def page_of(path: str):
    """What MkDocs tells a hook of a page."""
    return SimpleNamespace(file=SimpleNamespace(src_uri=path))


def test_the_tests_that_a_page_names_exist():
    written = "".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "tests").rglob("test_*.py")))
    for path in PAGES:
        for name in re.findall(r"`(test_\w+)`", path.read_text(encoding="utf-8")):
            assert f"def {name}(" in written, f"{page_id(path)} names {name}"
