"""A cue that is not as large as stated is not landed by."""

import pytest

from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario


@pytest.mark.parametrize("size", [-0.3, 0.4])
def test_the_aircraft_stays_off_the_deck_and_says_what_is_wrong(size):
    fault = [{"kind": "misstated_cue", "start_s": 0.0, "duration_s": 600.0, "size": size}]
    rows = []
    flown = fly_quietly(
        load_scenario("rig-natops", fault=fault, time_limit_s=40.0), "horizon", "geometric", 3, rows.append
    )
    assert flown.verdict is None
    assert any("is the cue as large, the camera as stated?" in row.decision.reason for row in rows)
