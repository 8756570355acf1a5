"""The bench's page: stands alone, says what the tables say, and draws in a browser without a network."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_campaign import GOOD, NOWHERE

from shipland.commands.report import Report
from shipland.errors import ConfigError
from shipland.evaluation.campaign import CellResult
from shipland.evaluation.oracle import OracleRate
from shipland.evaluation.suite import Overrides, SuiteEntry, cells_of
from shipland.report.campaign_page import campaign_page
from shipland.report.svg import SERIES
from shipland.statistics import Interval

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ABOUT = {"command": "shipland campaign made-up", "machine": {"processor": "p", "cores": 2, "platform": "Linux"}}


def made_up(folder):
    """Two scenarios, three winds, two pilots, 40 flights each, some of them missing."""
    rng = np.random.default_rng(3)
    entries = (SuiteEntry(("rig-natops", "ship-sea6"), ("wind.mean_mps=0,5,9",)),)
    results = []
    for cell in cells_of(entries, Overrides(("paper", "horizon"))):
        wind_mps = float(dict(cell.settings)["wind.mean_mps"])
        scatter_m = 0.04 + 0.012 * wind_mps * (2.0 if cell.pilot == "paper" else 0.7)
        landings = []
        for seed in range(1, 41):
            forward_m, starboard_m = (float(value) for value in np.round(rng.normal(0.0, scatter_m, 2), 3))
            good = max(abs(forward_m), abs(starboard_m)) <= 0.175
            landing = replace(
                GOOD, seed=seed, in_square=good, cause="" if good else "control error", reason="landed",
                forward_m=forward_m, starboard_m=starboard_m, sink_mps=float(rng.uniform(0.3, 0.9)),
                deck_roll_deg=float(rng.normal(0.0, 4.0)), deck_pitch_deg=float(rng.normal(0.0, 1.5)),
                deck_sink_mps=float(rng.normal(0.0, 0.2)),
                conditions=replace(GOOD.conditions, wind_mps=wind_mps, motion_seed=seed),
            )  # fmt: skip
            landings.append(replace(NOWHERE, seed=seed) if seed == 17 else landing)
        logs = folder / cell.name / "flights"
        results.append(
            CellResult(
                cell.name, cell.group, "made-up 1", cell.pilot, cell.vision, cell.settings, cell.scenario.name,
                cell.scenario.rig, cell.scenario.ship, cell.scenario.aircraft.airframe,
                tuple(landings), {landing.seed: logs for landing in landings},
            )
        )  # fmt: skip
    logs = results[0].logs[17]
    logs.mkdir(parents=True)
    (logs / "17.mcap").write_bytes(b"")
    return results


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    cells = made_up(folder)
    oracle_rates = {cells[0].group: OracleRate(0.97, Interval(0.9, 1.0), (0.1, 0.1), 0.1, 60)}
    path = folder / "report.html"
    path.write_text(campaign_page(cells, ABOUT, oracle_rates, folder), encoding="utf-8")
    return path


def test_without_folders_nothing_promises_to_fly_it_again(page, tmp_path):
    assert "flies it again" in page.read_text()
    cells = [replace(cell, logs={}) for cell in made_up(tmp_path)]
    assert "flies it again" not in campaign_page(cells, ABOUT, {}, tmp_path)


def test_the_page_stands_alone(page):
    text = page.read_text()
    assert not re.findall(r"(?:src|href)=.?(?:https?:)?//", text)
    assert "<script src" not in text
    assert "@import" not in text
    body = re.sub(r"<(style|script)\b.*?</\1>", "", text, flags=re.DOTALL)
    assert "nan" not in body
    assert "NaN" not in data_of(text)


def data_of(text):
    return re.search(r'<script type="application/json" id="flights">(.*?)</script>', text, flags=re.DOTALL)[1]


def test_dots_stand_out_on_a_dark_page(page):
    """At 3:1 or more, as WCAG 2.2 (1.4.11) asks of graphics."""
    text = page.read_text()
    dark = text.partition("prefers-color-scheme:dark")[2]
    opacity = float(re.search(r"--dots:([\d.]+)", dark)[1])
    behind = np.array([int(part, 16) for part in re.search(r"--page:#(..)(..)(..)", dark).groups()])

    def luminance(colour):
        linear = np.where(colour <= 10.3, colour / 255.0 / 12.92, ((colour / 255.0 + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    assert 'class="dots"' in text
    for colour in SERIES:
        shown = opacity * np.array(colour) + (1.0 - opacity) * behind
        assert (luminance(shown) + 0.05) / (luminance(behind) + 0.05) >= 3.0


def test_failures_link_to_their_logs_and_say_what_flies_them_again(page):
    text = page.read_text()
    links = re.findall(r'<a href="([^"]+)">log</a>', text)
    assert links == ["rig-natops_mean_mps=0_paper/flights/17.mcap"]
    assert (page.parent / links[0]).is_file()
    cell = page.parent / "rig-natops_mean_mps=0_paper"
    assert f"<code>shipland again {cell} --video --seed 17</code>" in text


def test_a_pilot_and_a_vision_of_ones_own_are_named_to_fly_again(tmp_path):
    """`shipland again` runs no code that a folder alone names."""
    cell = replace(made_up(tmp_path)[0], pilot="own_pilot:patient", vision="own_vision:green_box")
    text = campaign_page([cell], ABOUT, {}, tmp_path)
    named = "--pilot own_pilot:patient --vision own_vision:green_box --video --seed 17"
    assert f"<code>shipland again {tmp_path / cell.name} {named}</code>" in text


def test_every_landing_in_a_chart_is_a_flight_of_the_page(page):
    text = page.read_text()
    told = json.loads(data_of(text))
    assert len(told["flights"]) == 2 * 2 * 3 * 40
    touched = sum(flight[3] is not None for flight in told["flights"])
    charts = [re.findall(r"(\d+) ([\d.]+) ([\d.]+) (\d) (\d)", one) for one in re.findall(r'data-points="(.*?)"', text)]
    assert [len(chart) for chart in charts] == [touched // 2, touched // 2, touched, touched]
    for chart in charts:
        for flight, _, _, series, good in chart:
            cell, _, outcome, *_ = told["flights"][int(flight)]
            assert (outcome == 0) is (good == "1")
            assert told["cells"][cell]["pilot"] == ("paper", "horizon")[int(series)]


def test_a_reason_cannot_end_the_script(tmp_path):
    cell = made_up(tmp_path)[0]
    bad = replace(cell.landings[16], reason="</script><b>x")
    text = campaign_page([replace(cell, landings=(bad,))], ABOUT, {}, tmp_path)
    assert "1 cell, 1 pilot. " in text
    assert "</script><b>" not in text
    assert json.loads(data_of(text))["flights"][0][7] == "</script><b>x"


def test_charts_hold_what_was_flown(page):
    text = page.read_text()
    assert "Against what was drawn" in text
    assert ">Wind<" in text
    assert ">Ship&#x27;s speed<" not in text  # one value of it
    assert "oracle 97.0 %" in text
    shares = re.findall(r"<title>rig-natops_mean_mps=0, horizon: (\d+) of 40", text)
    assert shares == ["39"]


def test_no_deck_heaves_too_fast_for_the_charts(tmp_path):
    cell = made_up(tmp_path)[0]
    both = [replace(cell.landings[0], seed=seed, deck_sink_mps=-rate) for seed, rate in ((1, 0.5), (2, 2.0))]
    text = campaign_page([replace(cell, landings=tuple(both))], ABOUT, {}, tmp_path)
    chart = re.findall(r'data-points="(.*?)"', text)[-1]
    (_, slow), (_, fast) = re.findall(r"(\d+) ([\d.]+) [\d.]+ \d \d", chart)
    middle, edge = 50.0 + 150.0, 50.0 + 300.0
    assert float(fast) == edge
    assert float(slow) - middle == pytest.approx(0.25 * (edge - middle))


def test_no_flight_is_too_windy_or_too_fast_for_the_charts(tmp_path):
    cell = made_up(tmp_path)[0]
    given = {"wind_mps": (2.0, 30.0), "ship_mps": (2.0, 7.7), "waves_from_deg": (20.0, 300.0), "video_s": (0.1, 1.5)}
    both = [
        replace(
            cell.landings[0], seed=at, conditions=replace(GOOD.conditions, **{key: it[at] for key, it in given.items()})
        )
        for at in (0, 1)
    ]
    text = campaign_page([replace(cell, landings=tuple(both))], ABOUT, {}, tmp_path)
    for title in ("wind", "ship&#x27;s speed", "waves", "video latency"):
        assert text.count(f"paper, {title}: 1 of 1") == 2, title


@pytest.mark.parametrize("motions", [1, -3])
def test_an_oracle_rate_wants_two_motions(motions):
    with pytest.raises(ConfigError, match=f"--oracle-motions must be 0, or 2 and more, got {motions}"):
        Report((Path("anywhere"),), oracle_motions=motions).run()


def opened(page, *options):
    """What Chromium writes on opening a page without a network; nothing of it is missing, nothing is refused."""
    if CHROMIUM is None:
        pytest.skip("wants Chromium to open the page")
    command = [
        CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
        f"--user-data-dir={page.parent / 'browser'}", "--host-resolver-rules=MAP * ~NOTFOUND", *options, page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=180)
    assert "CONSOLE" not in done.stderr
    return done


def test_a_browser_draws_it(page):
    shot = page.parent / "page.png"
    done = opened(page, "--hide-scrollbars", "--window-size=1280,3600", f"--screenshot={shot}")
    assert shot.is_file(), done.stderr
    import cv2

    picture = cv2.imread(str(shot))
    assert picture.shape[1] >= 1280
    blue = (np.abs(picture.astype(int) - (178, 114, 0)) < 12).all(axis=2)  # the first pilot's marks
    vermilion = (np.abs(picture.astype(int) - (0, 94, 213)) < 12).all(axis=2)
    assert blue.sum() > 1000
    assert vermilion.sum() > 1000


_ASKED = """
<script>
const svg = document.querySelector("svg[data-points]");
const [flight, x, y] = svg.dataset.points.split("|").map((it) => it.split(" ").map(Number)).find((it) => it[4] === 0);
const at = new DOMPoint(x, y).matrixTransform(svg.getScreenCTM()), where = { clientX: at.x + 2, clientY: at.y + 1 };
svg.dispatchEvent(new PointerEvent("pointermove", where));
svg.dispatchEvent(new MouseEvent("click", where));
const landed = document.querySelector("#outcomes input");
landed.checked = false;
landed.dispatchEvent(new Event("change"));
document.body.dataset.flight = flight;
</script>
"""


def test_a_landing_that_is_pointed_at_says_which_it_is_and_how_to_fly_it_again(page):
    text = page.read_text()
    asked = page.with_name("asked.html")
    asked.write_text(text.replace("</body>", f"{_ASKED}</body>"))
    dom, told = opened(asked, "--dump-dom").stdout, json.loads(data_of(text))
    flight = told["flights"][int(re.search(r'data-flight="(\d+)"', dom)[1])]
    cell = told["cells"][flight[0]]
    assert f"<b>seed {flight[1]}, {cell['pilot']}</b>" in dom
    assert f"{100 * flight[3]:.1f} cm from the centre" in dom
    assert f"<pre>{cell['again']}{flight[1]}</pre>" in dom
    assert 'class="sifted"' in dom
