"""The bench: suites name flights completely, what was flown is kept, every flight counts once."""

import csv
import gc
import json
import logging
import re
import resource
import signal
import tracemalloc
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_campaign import GOOD, NOWHERE, make_up_flights, seeded

from shipland.commands.report import Report
from shipland.config import packaged_names
from shipland.errors import ConfigError, DataError
from shipland.evaluation import campaign, job
from shipland.evaluation.campaign import CampaignPlan, open_campaign, processes, read_about, read_cells, write_rows
from shipland.evaluation.leaderboard import (
    campaign_pairings,
    leaderboard,
    oracle_rates_of,
    pairings_table,
    pilot_pairings,
    rests_in_area,
    rivals,
    swept_keys,
)
from shipland.evaluation.suite import Overrides, SuiteEntry, cells_of, load_suite, task_digest
from shipland.report.campaign_page import campaign_page
from shipland.rig import Rig
from shipland.statistics import quantile_interval

GRID = (SuiteEntry(("rig-natops", "ship-sea6")),)


@pytest.fixture
def plan(tmp_path, monkeypatch):
    """Two scenarios, two winds, two pilots, three seeds, flown by making them up: the paper's pilot misses seed 2."""

    def land(flight):
        if flight.pilot == "paper" and flight.seed == 2:
            return seeded(NOWHERE, 2)
        return replace(seeded(GOOD, flight.seed), sink_mps=round(0.1 * flight.seed, 4))

    make_up_flights(monkeypatch, land)
    cells = cells_of(GRID, Overrides(("paper", "horizon"), ("wind.mean_mps=0,5",)))
    return CampaignPlan(cells, range(1, 4), tmp_path / "out", "made-up 1", "shipland campaign")


def fly(plan, stop_after=10**9):
    with open_campaign(plan) as bench, closing(bench.fly(processes(1))) as flights:
        for count, _ in enumerate(flights, start=1):
            if count >= stop_after:
                break
        return count


FROZEN = json.loads(Path(__file__).with_name("suite_digests.json").read_text())
"""Digest of each version of a packaged suite, as it was flown."""


@pytest.mark.parametrize("name", packaged_names("suites"))
def test_a_suite_can_be_flown_and_keeps_its_version_only_while_its_flights_stay(name):
    suite = load_suite(name)
    cells = cells_of(suite.cells, Overrides(("paper",)))
    assert len({cell.name for cell in cells}) == len(cells) > 5
    assert all(len(cell.name) < 200 for cell in cells)
    digest, frozen = task_digest(cells), FROZEN.get(name, {}).get(str(suite.version))
    assert digest == frozen, (
        f"suite {name} {suite.version} sets other flights than it did ({frozen} before, {digest} now): results of that "
        f"version are on record. Take the change back, or count `version` up in configs/suites/{name}.toml and write "
        f'"{suite.version + 1}": "{digest}" into tests/unit/suite_digests.json.'
    )


def test_what_a_flight_meets_is_in_the_digest_and_who_flies_is_not():
    def digest(*changes):
        return task_digest(cells_of((SuiteEntry(("rig-natops",), changes),), Overrides(("paper",))))

    assert digest("wind.mean_mps=6") != digest("wind.mean_mps=5")
    assert digest("geometric.miss_rate=0.5") != digest("geometric.miss_rate=0.1")
    assert digest("safety.stale_s=0.7") == digest("guidance.search.climb_s=4.0") == digest()


def test_a_stopped_run_goes_on_and_gives_the_same_table(plan, tmp_path):
    whole = replace(plan, out=tmp_path / "whole")
    assert fly(whole) == 24
    assert fly(plan, stop_after=7) == 7
    assert fly(plan) == 17
    one, two = read_cells([whole.out]), read_cells([plan.out])
    assert leaderboard(one, {}) == leaderboard(two, {})
    assert pairings_table(pilot_pairings(one)) == pairings_table(pilot_pairings(two))
    assert rivals(one) == rivals(two)


def test_folders_are_merged_and_a_flight_counts_once(plan, tmp_path):
    fly(replace(plan, seeds=range(1, 3)))
    other = replace(plan, out=tmp_path / "other", seeds=range(2, 4))
    fly(other)
    merged = read_cells([plan.out, other.out])
    assert [it.seed for it in merged[0].landings] == [1, 2, 3]
    key = other.out / merged[0].name / "campaign.json"
    key.write_text(json.dumps(json.loads(key.read_text()) | {"source": "other"}))
    with pytest.raises(DataError, match="other code"):
        read_cells([plan.out, other.out])


def test_each_flight_of_merged_folders_is_flown_again_from_its_own(plan, tmp_path):
    fly(replace(plan, seeds=range(1, 3)))  # the paper's pilot misses seed 2
    other = replace(plan, out=tmp_path / "other", seeds=range(3, 4))
    fly(other)
    text = campaign_page(read_cells([plan.out, other.out]), read_about(other.out), {}, tmp_path)
    name = plan.cells[0].name
    assert f"<code>shipland again {plan.out}/{name} --video --seed 2</code>" in text
    told = json.loads(re.search(r'id="flights">(.*?)</script>', text)[1])
    assert {told["cells"][cell]["again"] + str(seed) for cell, seed, *_ in told["flights"] if cell < 2} == {
        *(f"shipland again {plan.out}/{name} --video --seed {seed}" for seed in (1, 2)),
        f"shipland again {other.out}/{name} --video --seed 3",
    }


def test_pilots_of_one_group_meet_one_scenario(plan, tmp_path):
    def by_horizon(text):
        (tmp_path / "laid.toml").write_text(text)
        cells = cells_of(GRID, Overrides(("horizon",), ("wind.mean_mps=0",), tmp_path / "laid.toml"))
        return replace(plan, cells=cells)

    fly(replace(plan, cells=[cell for cell in plan.cells if cell.pilot == "paper"]))
    calm = by_horizon("[ship.course]\nspeed_mps = 3.0\n")
    words = "rig-natops_mean_mps=0_horizon and rig-natops_mean_mps=0_paper are both called rig-natops_mean_mps=0, but"
    with pytest.raises(DataError, match=words):
        fly(calm)
    assert not read_about(plan.out)["cells"].keys() & {cell.name for cell in calm.cells}
    apart = replace(calm, out=tmp_path / "apart")
    fly(apart)
    with pytest.raises(DataError, match=words):
        read_cells([plan.out, apart.out])
    assert fly(by_horizon("[guidance.search]\nclimb_s = 4.0\n")) == 6, "who flies may be set otherwise"
    assert {pairing.flights for pairing in pilot_pairings(read_cells([plan.out])).values()} == {3}


def test_a_full_disk_leaves_the_report_that_was_there(plan):
    fly(plan)
    Report((plan.out,), oracle_motions=0).run()
    before = (plan.out / "report.html").read_text()
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
        with pytest.raises(DataError, match="cannot be written: File too large"):
            Report((plan.out,), oracle_motions=0).run()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert (plan.out / "report.html").read_text() == before


def test_a_broken_campaign_json_is_one_line_and_former_keys_in_it_are_read(plan):
    plan = replace(plan, cells=plan.cells[:1])
    fly(plan)
    path = plan.out / plan.cells[0].name / "campaign.json"
    key = json.loads(path.read_text())
    rig = key["scenario"]["rig"]
    rig["made_to"] = rig.pop("manufacturing_tolerance")
    path.write_text(json.dumps(key))
    assert read_cells([plan.out])[0].rig == plan.cells[0].scenario.rig
    for damage in ("{", "[]"):
        path.write_text(damage)
        with pytest.raises(DataError, match=r"campaign\.json is not readable"):
            read_cells([plan.out])
    for damage in ({}, {"scenario": {}}, {"scenario": 3}):
        path.write_text(json.dumps(damage and key | damage))
        with pytest.raises(DataError, match="not what a campaign leaves"):
            read_cells([plan.out])


def test_a_result_that_comes_twice_counts_once(plan):
    def stutters(flights, keep, _):
        for flight in flights:
            for _ in range(2):
                keep(flight, seeded(GOOD, flight.seed))
            yield flight, GOOD

    with open_campaign(plan) as bench:
        list(bench.fly(stutters))
    assert all(len(cell.landings) == 3 for cell in read_cells([plan.out]))
    assert len((plan.out / plan.cells[0].name / "landings.csv").read_text().splitlines()) == 4


def test_a_flight_that_is_lost_is_named_and_flown_again(plan, monkeypatch):
    land = job.land_once

    def raises_once(flight):
        if flight.seed == 3 and flight.pilot == "horizon":
            raise ValueError("no such thing")
        return land(flight)

    monkeypatch.setattr(job, "land_once", raises_once)
    with open_campaign(plan) as bench:
        assert len(list(bench.fly(processes(1)))) == 20
        assert {(seed, why) for _, seed, why in bench.lost} == {(3, "ValueError: no such thing")}
    monkeypatch.setattr(job, "land_once", land)
    assert fly(plan) == 4


@pytest.mark.parametrize(("compiles", "rounds"), [(True, [[1], [2, 3]]), (False, [[1, 2, 3]])])
def test_the_first_flight_compiles_in_a_process_that_flies_no_other(plan, monkeypatch, compiles, rounds):
    flown = []

    def run_jobs(_do, jobs, workers, _keep, _lose):
        assert workers == 2
        flown.append([job.seed for job in jobs])
        yield from ()

    monkeypatch.setattr(campaign, "compiles_for_all", lambda: compiles)
    monkeypatch.setattr(campaign, "run_jobs", run_jobs)
    with open_campaign(replace(plan, cells=plan.cells[:1])) as bench:
        list(bench.fly(processes(2)))
    assert flown == rounds


def test_memory_does_not_grow_with_the_flights(plan):
    many = replace(plan, cells=plan.cells[:1], seeds=range(1, 601))

    def executor(flights, keep, _):
        for flight in flights:
            keep(flight, seeded(GOOD, flight.seed))
            yield flight, GOOD

    with open_campaign(many) as bench, closing(bench.fly(executor)) as flights:
        tracemalloc.start()
        try:
            held = []
            for _ in range(3):  # caches fill in the first few hundred
                for _ in range(200):
                    next(flights)
                gc.collect()  # beside a large heap Python leaves cycles lying for long
                held.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    # What grows, grows with every flight; once, anything in the process may take its megabytes.
    assert min(np.diff(held)) < 200 * 500  # bytes: a seed in a set, not a landing (kilobytes each)


def test_a_pilot_that_raises_does_not_fill_the_terminal(plan, monkeypatch, caplog):
    def loud(flight):
        logging.getLogger("shipland.flight").error("traceback")
        return seeded(GOOD, flight.seed)

    monkeypatch.setattr(job, "land_once", loud)
    fly(plan)
    assert not caplog.records
    logging.getLogger("shipland.flight").error("heard again")
    assert caplog.records


def test_tables_say_what_was_flown(plan):
    fly(plan)
    cells = read_cells([plan.out])
    assert swept_keys(cells) == ["wind.mean_mps"]
    lines = leaderboard(cells, oracle_rates_of(cells[:1], 2, plan.out / "oracle_rates.json")).splitlines()
    assert len(lines) >= 2 + 8
    assert "| rig-natops | 0 | paper | 5.0, 6.5, 8.0 | 3 | 2 (66.7 %)" in lines[2]
    assert "1 never steady over the deck" in lines[2]
    assert "%" in lines[2].split("|")[8]
    pairs = pairings_table(pilot_pairings(cells))
    assert "nan" not in " ".join([*lines, pairs, rivals(cells)])
    assert "| paper, horizon | 3 | 0 | 1 | 1 |" in pairs
    assert "| 3 | 0 | 0 | 1 |" in pairings_table(campaign_pairings(cells, cells))
    with pytest.raises(ConfigError, match="no cell in common"):
        campaign_pairings(cells[:1], cells[2:3])
    (line,) = pairings_table(campaign_pairings(cells[:1], cells[1:2])).splitlines()[2:]
    assert line.startswith("| rig-natops_mean_mps=0: paper, horizon | 3 | 0 | 1 | 1 |")


def test_oracle_rates_are_kept(plan, monkeypatch):
    fly(plan)
    cells = read_cells([plan.out])[:1]
    first = oracle_rates_of(cells, 2, plan.out / "oracle_rates.json")
    monkeypatch.setattr("shipland.evaluation.leaderboard.oracle_rate", None)
    assert oracle_rates_of(cells, 2, plan.out / "oracle_rates.json") == first


@pytest.mark.parametrize("damaged", ["[1]", '{"0": 1}', '{"0": {"share": 1.0}}', '{"0": {"interval": [0]', "\x00"])
def test_oracle_rates_that_are_damaged_are_drawn_again(plan, damaged):
    fly(plan)
    cells, cache = read_cells([plan.out])[:1], plan.out / "oracle_rates.json"
    first = oracle_rates_of(cells, 2, cache)
    cache.write_text(damaged, encoding="utf-8")
    assert oracle_rates_of(cells, 2, cache) == first


def test_all_rows_stand_in_one_table_with_conditions(plan):
    fly(plan)
    write_rows(plan.out / "flights.csv", read_cells([plan.out]))
    with (plan.out / "flights.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert len(table) == 24
    assert {row["wind.mean_mps"] for row in table} == {"0", "5"}
    assert {row["cause"] for row in table} == {"", "never steady over the deck"}
    assert all(row["motion_seed"].isdigit() for row in table)
    assert table[0]["suite"] == "made-up 1"


def test_cells_are_chosen_by_pattern_and_a_wrong_one_is_named():
    chosen = cells_of(GRID, Overrides(("paper",), ("wind.mean_mps=0,5",), only=("ship*=5",)))
    assert [cell.group for cell in chosen] == ["ship-sea6_mean_mps=5"]
    with pytest.raises(ConfigError, match="no cell is called nothing"):
        cells_of(GRID, Overrides(("paper",), only=("nothing",)))
    with pytest.raises(ConfigError, match="no suite 'nowhere'; there are: faults, full, hazards, near"):
        load_suite("nowhere")
    with pytest.raises(ConfigError, match="it is a scenario: --scenario rig-natops"):
        load_suite("rig-natops")


def test_rest_in_the_landing_area():
    rig = Rig()
    assert rests_in_area(GOOD, rig)
    assert not rests_in_area(replace(GOOD, rest_starboard_m=-0.2), rig)
    assert not rests_in_area(replace(GOOD, landed=False), rig)
    corner = replace(GOOD, rest_forward_m=0.15, rest_starboard_m=0.15)
    assert rests_in_area(corner, rig)
    assert not rests_in_area(corner, replace(rig, landing_area="circle"))


def test_tables_name_the_landing_area_that_was_flown(plan):
    fly(plan)
    square = read_cells([plan.out])
    round_ = [replace(cell, rig=replace(cell.rig, landing_area="circle")) for cell in square]
    for cells, area in ((square, "square"), (round_, "circle"), ([square[0], round_[1]], "landing area")):
        head, *_, legend = leaderboard(cells, {}).splitlines()
        assert f" | landed in the {area} | " in head
        assert f"landed in the {area}: " in legend


def test_no_table_calls_two_landing_areas_by_the_size_of_one(plan):
    fly(plan)
    small, *_ = cells = read_cells([plan.out])
    large = replace(small, rig=replace(small.rig, landing_square_m=1.0), name="large")
    assert "| first contact in the 0.35 m square |" in rivals(cells)
    head, _, *rows = rivals([small, large]).splitlines()
    assert "| first contact in the landing area |" in head
    assert "0.35" not in head
    assert len(rows) == 2
    text = campaign_page([small, large], read_about(plan.out), {}, plan.out)
    for words in ("0.35 m square", "1 m square"):
        assert f'aria-label="paper: first contact, {words}"' in text


def test_a_median_lies_in_its_interval_as_often_as_said():
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(100):
        low, high = quantile_interval(rng.standard_normal(60), 0.5, rng)
        inside += low <= 0.0 <= high
    assert 88 <= inside <= 99  # 95 % of 100 is 95, its deviation 2; a bootstrap of 60 values is a little narrow
