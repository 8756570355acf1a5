"""Campaigns: rows survive the file, what is done is not flown again, wrong files are refused, causes are named."""

import math
from dataclasses import replace

import pytest

from shipland.errors import ConfigError, DataError
from shipland.missions import campaign as campaigns
from shipland.missions.campaign import CampaignRequest, run_campaign
from shipland.missions.landing import Landing, Way, failures_table, no_landing, summary_of, table_of
from shipland.missions.rules import rules_table

WAY = (12.0, 1.0, 0.0, 0.0, 20.0, 8.0, 0.5, 0.0, 0)
NO_WAY = Way(*WAY)
TOUCH = (0.03, -0.04, 0.45, 0.05, 6.0, 0.01, 17.0, 29.5, 29.5, 0.03, -0.04, 0.0, 0.0)
GOOD = Landing(1, True, True, *TOUCH, *WAY, "landed")


@pytest.fixture
def request_(tmp_path, monkeypatch):
    """A campaign of three whose flights are made up; the seeds flown are counted."""
    flown = []

    def land(table, pilot, camera, seed, *_):
        flown.append(seed)
        return replace(GOOD, seed=seed, sink_mps=0.1 * seed)

    monkeypatch.setattr(campaigns, "land_once", land)
    request = CampaignRequest("near", "paper", "geometric", 1, 3, tmp_path / "out", None, 1, False)
    return request, flown


def test_rows_survive_the_file_and_are_not_flown_again(request_):
    request, flown = request_
    first = list(run_campaign(request))
    again = list(run_campaign(replace(request, count=5)))
    assert again[:3] == first
    assert flown == [1, 2, 3, 4, 5]


def test_other_configuration_is_refused(request_):
    request, _ = request_
    list(run_campaign(request))
    with pytest.raises(DataError, match="another configuration"):
        list(run_campaign(replace(request, pilot="offset_free")))


def test_broken_row_is_named(request_):
    request, _ = request_
    list(run_campaign(request))
    path = request.out / "landings.csv"
    path.write_text(path.read_text().replace("\n2,True", "\n2,perhaps"))
    with pytest.raises(DataError, match="line 4"):
        list(run_campaign(request))


@pytest.mark.parametrize(("change", "words"), [({"count": 0}, "--count"), ({"workers": 0}, "--workers")])
def test_bad_requests(request_, change, words):
    with pytest.raises(ConfigError, match=words):
        replace(request_[0], **change)


def test_flights_without_touchdown_survive_the_file_too(request_, monkeypatch):
    request, _ = request_
    monkeypatch.setattr(campaigns, "land_once", lambda *_: no_landing(1, 120.0, 0.0, NO_WAY, "no touchdown"))
    list(run_campaign(replace(request, count=1)))
    (landing,) = run_campaign(replace(request, count=1))
    assert math.isnan(landing.forward_m)
    assert not landing.landed


def test_causes_tell_the_deck_from_the_aircraft():
    outside = replace(GOOD, in_square=False, forward_m=0.3, reason="landed outside the square")
    assert "deck had moved" in replace(outside, place_forward_m=0.02, deck_forward_m=-0.28).cause
    assert "aircraft was off" in replace(outside, place_forward_m=0.3).cause
    assert GOOD.cause == ""


def test_tables_count_right():
    missed = replace(GOOD, seed=2, in_square=False, forward_m=0.4, reason="landed outside the square")
    landings = [GOOD, missed, no_landing(3, 120.0, 0.0, NO_WAY, "no touchdown: time limit")]
    assert "1 of 3 landed in the square" in summary_of(landings)
    assert table_of(landings).count("\n| ") == 3
    assert failures_table(landings).count("\n| ") == 2
    rules = rules_table(landings)
    assert "| ours: at rest on its feet in the 0.35 m square, within every limit | 1 of 3 |" in rules
    assert "| any first contact on the deck | 2 of 3 |" in rules
    # Clopper–Pearson for 1 of 1: the lower end is 0.025
    assert "95 % interval 2.5–100.0 %" in summary_of([GOOD])
