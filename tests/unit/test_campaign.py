"""Campaigns: rows survive the file, what is done is not flown again, rows of different flights never mix."""

import itertools
import json
import math
import os
import resource
import signal
import subprocess
import threading
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from small_jobs import die, die_at_two, square

from shipland.errors import DataError
from shipland.evaluation import folder as folders
from shipland.evaluation.campaign import CampaignPlan, open_campaign, processes, read_cells
from shipland.evaluation.folder import folder_in, read_campaign
from shipland.evaluation.landing import COLUMNS, Conditions, Landing, Phases, landing_from, row_of
from shipland.evaluation.leaderboard import rules_table
from shipland.evaluation.suite import Overrides, SuiteEntry, cells_of
from shipland.evaluation.tables import causes_table, landings_table, modes_table, summary_of
from shipland.rig import Rig
from shipland.scenario.scenario import load_scenario
from shipland.workers import run_jobs

PHASES = Phases(1.0, 0.0, 0.0, 20.0, 8.0, 0.5, 0.0, 0)
CONDITIONS = Conditions(
    5.0, 10.0, 10.0, "land", 12.0, 3.0, 1.5, -2.0, "still", 0.0, "natops", False, None, None, 1, 0.0, 0.28, 0.025,
    "paper", 15.0, "attitude", "anafi", 40000.0, "", 6.5, 8.0,
)  # fmt: skip
GOOD = Landing(
    1, True, True, "", 29.5, PHASES, CONDITIONS, "landed", forward_m=0.03, starboard_m=-0.04, control_forward_m=0.03,
    control_starboard_m=-0.04, deck_forward_m=0.0, deck_starboard_m=0.0, oracle_forward_m=0.0, oracle_starboard_m=0.0,
    oracle_in_square=True, sink_mps=0.45, slide_mps=0.05, tilt_deg=6.0, slip_m=0.01, force_n=17.0, rest_forward_m=0.03,
    rest_starboard_m=-0.05, deck_roll_deg=2.0, deck_pitch_deg=-1.0, deck_heave_m=0.02, deck_sink_mps=0.01,
    step_percent=20.0, over_slew_percent=0.0,
)  # fmt: skip
NOWHERE = Landing(3, False, False, "never steady over the deck", 120.0, PHASES, CONDITIONS, "no touchdown: time limit")


def seeded(landing, seed):
    return replace(landing, seed=seed, conditions=replace(landing.conditions, motion_seed=seed))


VERSION_OF = cache(folders._version_of)


def make_up_flights(patch, land):
    """Landings are made up by `land`; the versions of libraries are looked up once, not for every folder."""
    patch.setattr("shipland.evaluation.job.land_once", land)
    patch.setattr(folders, "_version_of", VERSION_OF)


def run_campaign(plan):
    with open_campaign(plan) as bench:
        list(bench.fly(processes(1)))
    return read_cells([plan.out])[0].landings


def cell_of(plan):
    return plan.out / plan.cells[0].name


def changed(plan, **change):
    return replace(plan, cells=[replace(cell, **change) for cell in plan.cells])


@pytest.fixture
def flown(monkeypatch):
    """Seeds of the flights, which are made up."""
    flown = []

    def land(flight):
        flown.append(flight.seed)
        return replace(seeded(GOOD, flight.seed), sink_mps=round(0.1 * flight.seed, 4))

    make_up_flights(monkeypatch, land)
    return flown


@pytest.fixture
def plan(tmp_path, flown):
    """A campaign of three."""
    return CampaignPlan(cells_of([SuiteEntry(("near",))], Overrides(("paper",))), range(1, 4), tmp_path / "out")


@pytest.fixture
def first(plan):
    """Its landings, once it is flown."""
    return run_campaign(plan)


@pytest.fixture
def table(plan, first):
    """The file of its rows."""
    return cell_of(plan) / "landings.csv"


def test_rows_survive_the_file_and_are_not_flown_again(plan, first, flown):
    again = run_campaign(replace(plan, seeds=range(1, 6)))
    assert again[:3] == first
    assert flown == [1, 2, 3, 4, 5]


def test_the_table_is_plain_csv_and_the_rest_stands_beside_it(table):
    assert table.read_text().splitlines()[0] == ",".join(COLUMNS)
    beside = json.loads((table.parent / "campaign.json").read_text())
    assert beside["scenario"]["ship"]["motion"] == "natops"
    assert {"version", "source", "configuration", "weights", "libraries", "command"} <= set(beside)


def test_a_table_without_cells_is_refused(plan):
    plan.out.mkdir()
    (plan.out / "landings.csv").write_text("")
    with pytest.raises(DataError, match="give another folder"):
        run_campaign(plan)


@pytest.mark.parametrize(
    ("part", "words"),
    [("scenario", "another configuration"), ("source_digest", "another code"), ("file_digest", "another weights")],
)
def test_rows_of_another_kind_are_refused(plan, monkeypatch, part, words):
    plan = changed(plan, vision="rendered")
    run_campaign(plan)
    if part == "scenario":
        plan = changed(plan, scenario=load_scenario("near", wind={"mean_mps": 7.0}))
    else:
        monkeypatch.setattr(folders, part, lambda *_: "0" * 16)
    with pytest.raises(DataError, match=words):
        run_campaign(plan)


def test_broken_row_is_named(plan, table):
    table.write_text(table.read_text().replace("\n2,True", "\n2,perhaps"))
    with pytest.raises(DataError, match="line 3"):
        run_campaign(plan)


@pytest.mark.parametrize("more", [-8, -1, 1])
def test_a_row_of_other_columns_than_its_head_is_named(plan, table, more):
    head, first, second, *rest = table.read_text().splitlines()
    values = [*second.split(","), "7"][: len(second.split(",")) + more]
    table.write_text("\n".join([head, first, ",".join(values), *rest, ""]))
    with pytest.raises(DataError, match="line 3"):
        run_campaign(plan)


def test_a_folder_without_a_row_binds_nobody(plan, monkeypatch):
    with open_campaign(plan):  # none flew: they were stopped, or the pilot raised each time
        pass
    monkeypatch.setattr(folders, "source_digest", lambda: "0" * 16)
    run_campaign(plan)
    assert json.loads((cell_of(plan) / "campaign.json").read_text())["source"] == "0" * 16
    monkeypatch.undo()
    with pytest.raises(DataError, match="another code"), open_campaign(plan):
        pass


def test_a_row_cut_short_is_flown_again(plan, first, table, flown):
    table.write_text(table.read_text()[:-20])
    assert run_campaign(plan) == first
    assert flown == [1, 2, 3, 3]


full_disk = pytest.mark.skipif(not Path("/dev/full").exists(), reason="wants a device that is always full")


@full_disk
def test_a_repair_that_fails_leaves_the_table_whole(plan, table):
    cut = table.read_bytes()[:-20]
    table.write_bytes(cut)
    table.with_name(f".landings.csv.{os.getpid()}.part").symlink_to("/dev/full")
    with pytest.raises(DataError, match="No space left on device"):
        run_campaign(plan)
    assert table.read_bytes() == cut
    assert len(run_campaign(plan)) == 3  # there is space again


def test_who_reads_a_table_leaves_it_as_it_is(table):
    table.write_bytes(table.read_bytes()[:-20])  # the campaign that flies in it is writing this row
    before = table.read_bytes()
    assert [it.seed for it in read_campaign(table.parent)] == [1, 2]
    assert table.read_bytes() == before


@pytest.mark.parametrize("damage", [b"\xff\xfe", b"\x00", b'"' + b"9" * 200_000, b"9" * 5000])
def test_a_table_of_any_content_is_one_line(table, damage):
    table.write_bytes(table.read_bytes().replace(b"\n2,", b"\n" + damage + b"2,"))
    with pytest.raises(DataError, match=r"not a landing|not text in UTF-8"):
        read_campaign(table.parent)


def test_a_second_campaign_in_the_folder_is_refused(plan):
    with open_campaign(plan), pytest.raises(DataError, match="another program flies in this folder"):
        run_campaign(plan)
    unfinished = plan.out / "flights" / ".1.mcap.14278.part"  # of a campaign that was killed
    unfinished.parent.mkdir()
    unfinished.touch()
    assert len(run_campaign(plan)) == 3
    assert not unfinished.exists()


def test_a_folder_that_cannot_be_written_is_one_line(plan, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written: Not a directory"):
        run_campaign(replace(plan, out=tmp_path / "file" / "out"))


EMPTY_KEY = dict.fromkeys(("version", "source", "configuration", "pilot", "vision", "own_code", "weights"), "")


def test_a_text_holds_what_ends_a_line_elsewhere(tmp_path):
    folder, odd = folder_in(tmp_path, EMPTY_KEY), replace(GOOD, reason="one\u2028two\x85three")
    folder.append(odd)
    folder.append(seeded(GOOD, 2))
    assert [landing.reason for landing in read_campaign(tmp_path)] == [odd.reason, GOOD.reason]


def test_a_row_that_a_full_disk_cut_leaves_nothing_behind(tmp_path):
    folder = folder_in(tmp_path, EMPTY_KEY)
    folder.append(GOOD)
    size = (tmp_path / "landings.csv").stat().st_size
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + 20, limits[1]))
        with pytest.raises(DataError, match="cannot be written: File too large"):
            folder.append(seeded(GOOD, 2))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    folder.append(seeded(GOOD, 3))  # there is space again
    assert [landing.seed for landing in read_campaign(tmp_path)] == [1, 3]


@full_disk
def test_after_a_full_disk_the_folder_can_be_used(tmp_path):
    (tmp_path / f".campaign.json.{os.getpid()}.part").symlink_to("/dev/full")
    with pytest.raises(DataError, match="No space left on device"):
        folder_in(tmp_path, EMPTY_KEY)
    assert not (tmp_path / "campaign.json").exists()
    assert not folder_in(tmp_path, EMPTY_KEY).seeds  # there is space again


def test_a_row_holds_everything():
    for landing in (GOOD, NOWHERE):
        texts = {name: str(value) for name, value in row_of(landing).items()}
        assert list(texts) == COLUMNS
        assert str(landing_from(texts)) == str(landing)  # NaN is not equal to itself; its text is
    assert math.isnan(NOWHERE.error_m)


def test_tables_count_right():
    missed = replace(seeded(GOOD, 2), in_square=False, forward_m=0.4, reason="landed outside", cause="control error")
    landings = [GOOD, missed, seeded(NOWHERE, 3)]
    assert "1 of 3 landed in the square" in summary_of(landings, "square")
    assert "at 2 of the 2 instants of contact an oracle would have landed" in summary_of(landings, "square")
    assert landings_table(landings, "square").count("\n| ") == 3
    assert "nan" not in landings_table(landings, "square")
    beside = replace(missed, landed=False, reason="came down beside the deck", cause="came down beside the deck")
    assert "| came down beside the deck |" in landings_table([beside], "square")
    assert "| landed outside; control error |" in landings_table(landings, "square")
    assert causes_table(landings).count("\n| ") == 2
    assert "| 1 land | 8.0 | 8.0 |" in modes_table(landings)
    rules = rules_table(landings, Rig())
    assert "| ours: at rest on its feet in the 0.35 m square, within every limit | 1 of 3 |" in rules
    assert "| any first contact on the deck | 2 of 3 |" in rules
    # Clopper-Pearson for 1 of 1: the lower end is 0.025
    assert "95 % interval 2.5–100.0 %" in summary_of([GOOD], "circle")


def test_limits_come_from_the_rig():
    wide = replace(Rig(), landing_square_m=0.8, deck_size_m=1.0)
    off = replace(GOOD, forward_m=0.39)
    assert "| first contact in the 0.8 m square | 1 of 1 |" in rules_table([off], wide)
    assert "| any first contact on the deck | 0 of 1 |" in rules_table([replace(GOOD, forward_m=0.55)], wide)


def test_intervals_say_what_they_assume():
    assert "independent" in summary_of([GOOD, seeded(GOOD, 2)], "square")
    assert "one record of motion" in summary_of([GOOD, replace(GOOD, seed=2)], "square")


NOTHING = (lambda *_: None,) * 2
"""To keep and to lose nothing by."""


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_is_done_once_and_one_that_fails_costs_itself_only(workers):
    kept, lost = {}, {}
    numbers = [number for number in range(7) if workers > 1 or number != 2]  # with one worker the jobs run here
    done = dict(run_jobs(die_at_two, numbers, workers, kept.__setitem__, lost.__setitem__))
    assert done == kept == {number: number for number in (0, 1, 3, 5, 6)}
    assert lost[4] == "ValueError: four"
    assert workers == 1 or "exit code 3" in lost[2]


def test_no_more_jobs_are_taken_than_there_are_workers():
    taken = []

    def jobs():
        for number in range(20):
            taken.append(number)
            yield number

    for count, _ in enumerate(run_jobs(square, jobs(), 2, *NOTHING), start=1):
        assert len(taken) <= count + 2


def test_workers_that_all_die_end_the_run_in_one_line(monkeypatch):
    lost, started, popen = [], [], subprocess.Popen

    def noted(*words, **options):
        started.append(popen(*words, **options))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", noted)
    with pytest.raises(DataError, match=r"a worker process died \(exit code 3\); is there memory"):
        list(run_jobs(die, range(100), 2, lambda *_: None, lambda job, _: lost.append(job)))
    assert len(lost) < 10
    assert 2 <= len(started) < 10
    assert all(process.returncode is not None for process in started)


def test_work_that_does_not_pickle_is_one_line_with_advice():
    lock = threading.Lock()
    with pytest.raises(DataError, match=r"'_thread.lock' object; fly with one worker, or .*module:factory"):
        list(run_jobs(lambda number: lock, range(3), 2, *NOTHING))


def test_the_wheels_examples_are_no_part_of_the_code_that_binds_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(folders.resources, "files", lambda _: tmp_path)
    (tmp_path / "code.py").write_text("one")
    before = folders.source_digest.__wrapped__()
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples" / "own.py").write_text("two")
    assert folders.source_digest.__wrapped__() == before
    (tmp_path / "more.py").write_text("two")
    assert folders.source_digest.__wrapped__() != before


def test_weights_bind_every_vision_that_looks_at_pictures(tmp_path, monkeypatch):
    (tmp_path / "own_eyes.py").write_text(
        "from shipland.scenario.visions import geometric, rendered, without_pictures\n"
        "def looks(setup): return rendered(setup)\n"
        "@without_pictures\n"
        "def knows(setup): return geometric(setup)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    scenario, policies = load_scenario("near"), {"residual", "direct"}
    assert folders.campaign_key(scenario, "paper", "own_eyes:looks")["weights"].keys() == {"ship", "bar", *policies}
    assert folders.campaign_key(scenario, "paper", "own_eyes:knows")["weights"].keys() == policies


def test_every_file_that_a_scenario_names_binds_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    own = "from shipland.sim.aircraft.{} as {}\n"
    files = {
        "deck.csv": "t_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg\n",
        "policy.onnx": "",
        "key_aircraft.py": own.format("aircraft import Quadrotor", "made"),
        "key_loop.py": own.format("loops import AttitudeLoop", "made"),
    }
    for name, text in files.items():
        Path(name).write_text(text)
    settings = {
        "ship.motion": "recorded",
        "ship.recorded.path": "deck.csv",
        "guidance.learned.direct": "policy.onnx",
        "aircraft.kind": "key_aircraft:made",
        "aircraft.loop.kind": "key_loop:made",
    }
    scenario = load_scenario("near", **settings)
    keys = [folders.campaign_key(scenario, "paper", "geometric")]
    for name, text in files.items():
        Path(name).write_text(text + "\n")
        keys.append(folders.campaign_key(scenario, "paper", "geometric"))
    bound = [{word: key[word] for word in ("own_code", "weights")} for key in keys]
    assert all(before != after for before, after in itertools.pairwise(bound))
    assert bound[0]["weights"].keys() == {"direct", "residual", "motion"}
    Path("deck.csv").unlink()
    with pytest.raises(DataError, match=r"deck.csv cannot be read: No such file"):
        folders.campaign_key(scenario, "paper", "geometric")
    at_rest = folders.campaign_key(load_scenario("near"), "paper", "geometric")
    assert at_rest["own_code"] == {}, "nothing but the package flies"
    assert at_rest["weights"].keys() == {"direct", "residual"}
