"""The cue is hidden for seconds, and what is seen then is its mirror image in the deck: the flight is not led by it."""

from shipland.scenario.fly import fly_quietly
from shipland.scenario.scenario import load_scenario

MIRROR_M = 0.75
FAULTS = [
    {"kind": "occlusion", "start_s": 6.0, "duration_s": 7.0},
    {"kind": "reflection", "start_s": 6.0, "duration_s": 11.0, "size": MIRROR_M},
]


def test_a_mirrored_cue_after_a_gap_does_not_lead_the_flight_astray():
    rows = []
    flown = fly_quietly(load_scenario("rig-natops", fault=FAULTS), "horizon", "geometric", 1, rows.append)
    refused = [row for row in rows if "mirror image" in row.observation.reason]
    assert len(refused) > 30
    assert all(12.0 <= row.frame.t_s <= 18.0 for row in refused)
    assert flown.success, flown.reason
