"""What was recorded under former names is still read, and a former key is told its new name."""

import dataclasses
import re

import pytest

from shipland.config import defaults
from shipland.errors import ConfigError
from shipland.former import FORMER, GONE, renamed
from shipland.guidance.horizon.steering import AXIS_ENTRIES, WHOLE_ENTRIES
from shipland.messages import Intent, Mode, PilotCommand
from shipland.rows import from_row, to_row
from shipland.scenario.scenario import Scenario, load_scenario


def test_a_table_gets_todays_keys_all_the_way_down():
    former = {"eyes": {"patience_s": 1.0}, "rig": {"made_to": 0.01, "quad": [{"made_to": 1}]}}
    today = {"manufacturing_tolerance": 0.01, "polygon": [{"manufacturing_tolerance": 1}]}
    assert renamed(former) == {"selector": {"patience_s": 1.0}, "rig": today}


def test_a_row_with_a_former_mode_is_read():
    command = PilotCommand(1.0, 0.0, 0.0, 60.0, 0.0, 0.0, Intent.GO_AROUND)
    row = to_row(command)
    assert row["intent"] == "GO_AROUND"
    assert from_row(PilotCommand, row | {"intent": "CLIMB_OUT"}) == command


def test_a_former_key_is_refused_with_its_new_name():
    with pytest.raises(ConfigError, match=r"guidance\.approach: 'astray_m' is called 'abort_offset_m' now"):
        load_scenario("near", guidance={"approach": {"astray_m": 0.3}})


def test_a_key_that_is_gone_is_refused_with_what_does_its_work_and_read_past_in_a_log():
    with pytest.raises(ConfigError, match=r"vision: 'corners' is no key any more; --vision published"):
        load_scenario("near", vision={"corners": "forstner"})
    former = {"vision": {"corners": "edges", "track_s": 1.0}, "corners": 1}
    assert renamed(former) == {"vision": {"track_s": 1.0}, "corners": 1}
    watched = {"moment": "deck", "watch_seen_s": 0.3, "descent": {"poise_s": 0.8, "drop_mps": 1.0}}
    assert renamed({"guidance": {"horizon": watched}})["guidance"]["horizon"] == {"descent": {"final_descent_mps": 1.0}}


@pytest.mark.parametrize("gone", GONE)
def test_every_key_that_is_gone_is_read_past_where_it_stood(gone):
    *tables, key = gone.split(".")
    today = defaults(Scenario)
    former, left = {key: 1.0, "other": 2.0}, {"other": 2.0}
    for table in tables:
        today = today[table]
    for table in reversed(tables):
        former, left = {table: former}, {table: left}
    assert key not in today
    assert renamed(former) == left
    with pytest.raises(ConfigError, match=f"'{key}' is no key any more; {re.escape(GONE[gone])}"):
        load_scenario("near", **{gone: 1.0})


def test_every_new_name_is_one_and_no_former_name_is_used_again():
    def keys(table):
        for key, value in table.items():
            yield key
            yield from keys(value) if isinstance(value, dict) else ()

    used = set(keys(defaults(Scenario))) | {member.name for enumeration in (Mode, Intent) for member in enumeration}
    elsewhere = {"score_gain", "go_around_s", "manufacturing_tolerance", "polygon", "oracle_in_square"}
    elsewhere |= {f"{of}_{along}_m" for of in ("control", "oracle") for along in ("forward", "starboard")}
    elsewhere |= {name for name, _ in (*AXIS_ENTRIES, *WHOLE_ENTRIES)}
    assert set(FORMER.values()) <= used | elsewhere
    assert not set(FORMER) & {field.name for field in dataclasses.fields(PilotCommand)}
    assert not set(FORMER) & used
