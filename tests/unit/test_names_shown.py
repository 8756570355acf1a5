"""Names of files, scenarios and pilots are shown as they were typed, whatever characters they hold."""

import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_flight import flight, log_of, write_log
from test_campaign import GOOD
from test_campaign_page import ABOUT, made_up
from test_landings_dataset import HERE

from shipland.commands.report import Report
from shipland.errors import DataError
from shipland.report.again import comparison, plot_pair
from shipland.report.benchmark_page import benchmark_page
from shipland.report.campaign_page import campaign_page
from shipland.report.dataset import write_dataset
from shipland.report.landing_plots import plot_cells, write_campaign
from shipland.report.notebook import flight_html
from shipland.report.plots import plot_flight
from shipland.report.video import VideoParameters, VideoWriter
from shipland.scenario.scenario import load_scenario

NAME = "a$b_{$c"
"""As a formula it has no end."""


def test_a_dollar_in_a_name_begins_no_formula(tmp_path):
    pytest.importorskip("matplotlib")
    plot_cells([replace(cell, name=NAME, pilot=NAME) for cell in made_up(tmp_path)[:2]]).canvas.draw()
    scenario = load_scenario("near")
    scenario = replace(scenario, name=NAME, ship=replace(scenario.ship, same_motion=True))
    write_campaign(tmp_path, SimpleNamespace(scenario=scenario, pilot=NAME, vision="geometric"), [GOOD])
    log = log_of(flight(from_s=33.8, to_s=34.0))
    log = replace(log, header=replace(log.header, info=replace(log.header.info, scenario=NAME)))
    plot_pair(tmp_path / "pair.png", log, log)
    plot_flight(tmp_path / "flight.png", log)
    drawn = {"landings.png", "instants.png", "pair.png", "flight.png"}
    assert {path.name for path in tmp_path.glob("*.png")} == drawn


def test_the_command_of_a_leaderboard_can_be_typed(tmp_path, monkeypatch):
    monkeypatch.setattr("shipland.report.benchmark_page.read_about", lambda _: ABOUT)
    monkeypatch.setattr("shipland.report.benchmark_page._entries", lambda _: "")
    bundle = SimpleNamespace(path=Path("in/my own.zip"), folder=tmp_path)
    page = benchmark_page([bundle], made_up(tmp_path), {}, tmp_path)
    assert "<code>shipland report &#x27;my own.zip&#x27;</code>" in page


def test_a_link_to_a_log_leads_there_whatever_its_folder_is_called(tmp_path):
    cell = made_up(tmp_path)[0]
    logs = tmp_path / "50 % #2?" / "flights"
    logs.mkdir(parents=True)
    (logs / "17.mcap").write_bytes(b"")
    page = campaign_page([replace(cell, logs={17: logs})], ABOUT, {}, tmp_path)
    assert '<a href="50%20%25%20%232%3F/flights/17.mcap">log</a>' in page
    assert '["log","50%20%25%20%232%3F/flights/17.mcap"]' in page


def test_a_page_of_a_folder_whose_name_is_no_unicode_is_written_and_links_there(tmp_path, monkeypatch):
    folder = tmp_path / os.fsdecode(b"sch\xf6n")
    cell = made_up(folder)[0]
    monkeypatch.setattr("shipland.evaluation.campaign.read_cells", lambda _: [cell])
    monkeypatch.setattr("shipland.evaluation.campaign.read_about", lambda _: ABOUT)
    assert Report((folder,), tmp_path / "page.html", oracle_motions=0).run() == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert f'<a href="sch%F6n/{cell.name}/flights/17.mcap">log</a>' in page


def test_a_data_set_wants_names_of_logs_in_unicode(tmp_path):
    log = tmp_path / "flown" / os.fsdecode(b"sch\xf6n.mcap")
    log.parent.mkdir()
    write_log(log, flight(from_s=33.8, to_s=33.9))
    with pytest.raises(DataError, match="no text in UTF-8: rename it"):
        write_dataset(log.parent, tmp_path / "set", HERE)
    assert not (tmp_path / "set").exists()


def test_a_folder_named_by_the_time_of_day_gets_its_film(tmp_path, monkeypatch):
    """FFmpeg takes what stands before a colon for a protocol."""
    pytest.importorskip("av")
    monkeypatch.chdir(tmp_path)
    Path("12:30").mkdir()
    writer = VideoWriter(Path("12:30/flight.mp4"), 64, 48, VideoParameters())
    writer.write(np.zeros((48, 64, 3), np.uint8), 0.0)
    writer.close()
    assert Path("12:30/flight.mp4").stat().st_size > 0


def test_a_films_name_is_no_html(tmp_path):
    film = tmp_path / "a<b>&.mp4"
    film.write_bytes(b"")
    assert "a&lt;b&gt;&amp;.mp4</a>" in flight_html(load_scenario("near"), "landed", None, (), film)


def test_a_landing_circle_is_not_called_a_square():
    log = log_of(flight(from_s=33.8, to_s=34.0))
    round_rig = replace(log.header.rig, landing_area="circle")
    before = replace(log, header=replace(log.header, rig=round_rig))
    assert next(line for line in comparison(before, before) if "yes" in line).startswith("landed in the circle")
