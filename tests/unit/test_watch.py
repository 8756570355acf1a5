"""The deck watched for the moment of the landing: descent, glances, filter, safety and border, a part at a time."""

import math

import numpy as np
import pytest

from shipland.camera import Camera
from shipland.config import merge
from shipland.errors import ConfigError
from shipland.estimation.delayed import DelayedFilter, DelayedParameters, Inputs
from shipland.estimation.relative_state import POSITION, WAVE, AxisModel, Disturbances, Model
from shipland.estimation.waves import WaveMotion
from shipland.guidance.horizon.descent import GimbalLookDown, Outlook, Phase, next_descent, next_look_down
from shipland.guidance.horizon.parameters import DescentParameters
from shipland.guidance.modes import ModeMemory, Situation, next_mode
from shipland.guidance.parameters import ModeParameters
from shipland.messages import BarPose, DeckSight, Frame, GimbalAttitude, Mode, Observation, Telemetry
from shipland.rig import Rig
from shipland.safety.estimate import SafetyEstimator
from shipland.safety.input_gate import InputGate
from shipland.scenario.scenario import load_scenario, scenario_table

DESCENT = DescentParameters()
STEP_S = 1.0 / 30.0
DOWN = GimbalAttitude(0.0, -1.48)
SIGHT = DeckSight(np.array([-0.1, 0.2, 0.7]), np.full(3, 0.004))


def descended(from_deck_m, seconds=20.0):
    """Phases of a landing from 1.2 m that flies the height it is asked for; `from_deck_m` of the time."""
    phases, descent, t_s = [], None, 0.0
    while t_s < seconds and (descent is None or descent.phase is not Phase.FINAL_DESCENT):
        height_m = 1.2 if descent is None else descent.height_m
        outlook = Outlook(t_s, STEP_S, height_m, 0.0, 0.0, 1.0, 0.3, 1.2, from_deck_m(t_s))
        descent = next_descent(descent, outlook, DESCENT)
        if not phases or phases[-1][0] is not descent.phase:
            phases.append((descent.phase, t_s))
        t_s += STEP_S
    return phases, descent


def test_a_watched_deck_that_will_be_there_is_dropped_onto_after_a_look_up():
    phases, _ = descended(lambda t_s: math.inf if t_s < 5.0 else 0.01)
    assert [phase for phase, _ in phases] == [Phase.SINK, Phase.DECK_WATCH, Phase.REACQUIRE, Phase.FINAL_DESCENT]
    assert phases[2][1] == pytest.approx(5.0, abs=0.1)
    assert phases[3][1] - phases[2][1] == pytest.approx(DESCENT.reacquire_s, abs=0.1)


def test_a_deck_that_will_not_be_there_after_all_is_watched_again():
    phases, descent = descended(lambda t_s: 0.01 if t_s < 5.0 else 0.3, 10.0)
    assert [phase for phase, _ in phases][1:] == [Phase.DECK_WATCH, Phase.REACQUIRE, Phase.DECK_WATCH] or phases[-1][
        0
    ] is Phase.FINAL_DESCENT
    phases, descent = descended(lambda t_s: 0.01 if 4.9 < t_s < 5.0 else 0.3, 10.0)
    assert [phase for phase, _ in phases] == [Phase.SINK, Phase.DECK_WATCH, Phase.REACQUIRE, Phase.DECK_WATCH]
    assert descent.height_m == DESCENT.deck_watch_height_m


def test_a_deck_that_is_never_known_is_landed_on_in_the_end():
    phases, _ = descended(lambda _: math.inf, 120.0)
    assert [phase for phase, _ in phases] == [Phase.SINK, Phase.DECK_WATCH, Phase.FINAL_DESCENT]
    assert phases[-1][1] - phases[1][1] > DESCENT.deck_watch_max_s


def test_glances_go_down_for_so_long_and_up_until_the_bar_was_seen():
    look_down = next_look_down(None, 0.0, -math.inf, 2.5, 0.3)
    assert look_down == GimbalLookDown(True, 0.0)
    assert next_look_down(look_down, 2.4, -math.inf, 2.5, 0.3) is look_down
    look_down = next_look_down(look_down, 2.6, -math.inf, 2.5, 0.3)
    assert look_down == GimbalLookDown(False, 2.6)
    assert next_look_down(look_down, 9.0, 2.7, 2.5, 0.3) is look_down
    assert next_look_down(look_down, 3.3, 3.0, 2.5, 0.3) == GimbalLookDown(True, 3.3)


def landing(watching, blind_s, deck=None):
    """The mode of a landing whose bar was seen last so long ago, not committed."""
    parameters = ModeParameters()
    pose = BarPose(np.array([-2.0, 0.0, 0.0]), 0.0, np.eye(4), 0.1, np.zeros((8, 2)))
    memory = ModeMemory(mode=Mode.LAND, since_s=-10.0)
    for t_s in np.arange(-2.0, blind_s + 1e-9, STEP_S):
        seen = Observation(float(t_s), DOWN, pose if t_s <= 0.0 else None, deck=deck if t_s > 0.0 else None)
        situation = Situation(float(t_s), seen, "", False, "", True, False, True, watching)
        memory = next_mode(situation, memory, parameters)
    return memory.mode


def test_a_landing_that_looks_down_is_not_blind():
    assert landing(watching=False, blind_s=1.0) is Mode.GO_AROUND
    assert landing(watching=True, blind_s=1.0) is Mode.LAND
    assert landing(watching=True, blind_s=2.0) is Mode.GO_AROUND
    assert landing(watching=True, blind_s=5.0, deck=SIGHT) is Mode.LAND


def test_the_filter_tells_the_decks_swing_from_its_own_way():
    noise = Disturbances(0.1, 1.5, 0.5, 20.0, 0.5, 300.0, 0.001)
    model = Model(2, AxisModel(0.06, 0.4), noise, WaveMotion(0.1, 1.8, 0.2, bar_moves=False))
    late = DelayedFilter(model, DelayedParameters(16.0, 40.0, 0.05, 0.5, 1.0, 0.0, 0.6), 0.02)
    inputs, sure = Inputs(2), 1e-6 * np.eye(2)
    late.start(0.0, np.zeros(2), sure, 0.01)
    for k in range(1, 30):
        assert late.update_pose(STEP_S * k, np.zeros(2), sure, inputs)
    for k in range(30, 45):
        swung_m = np.array([0.0, 0.08])
        assert late.update_deck(STEP_S * k, -swung_m, sure, inputs)  # as if the aircraft were 8 cm to port
    assert late.estimate.of(POSITION) == pytest.approx([0.0, 0.0], abs=0.015)
    assert late.estimate.of(WAVE) == pytest.approx([0.0, 0.08], abs=0.015)


def test_the_safety_takes_a_sight_of_the_deck_for_a_place():
    rig = Rig()
    estimator = SafetyEstimator(rig, Camera.from_fov(1280, 720, 69.0), np.array([0.09, 0.0, 0.0]))
    telemetry = Telemetry(1.0, 0.0, 0.0, 0.0, 2.0, None, 80.0, 80.0, True)
    seen = Observation(0.8, DOWN, deck=SIGHT)
    blind = estimator.updated(seen, telemetry)
    assert blind.place_in_bar_m is None  # whoever never saw the bar does not know where it is
    pose = BarPose(np.array([-3.0, 0.0, 0.0]), 0.0, 1e-4 * np.eye(4), 0.1, np.zeros((8, 2)))
    estimator.updated(Observation(0.7, DOWN, bar_pose=pose), telemetry)
    after = estimator.updated(seen, telemetry)
    assert after.pose_s == 0.8
    assert after.place_in_bar_m == pytest.approx(rig.deck_in_bar_m - [-0.01, 0.2, 0.7])
    assert after.over_deck_at(1.0, 1.5) == pytest.approx(0.7)


@pytest.mark.parametrize(
    "sight",
    [
        DeckSight(np.array([math.nan, 0.0, 1.0]), np.ones(3)),
        DeckSight(np.zeros(3), np.array([0.01, math.inf, 0.01])),
        DeckSight(np.zeros(3), np.array([0.01, -0.01, 0.01])),
    ],
)
def test_the_border_refuses_what_is_no_sight(sight):
    camera, frame = Camera.from_fov(1280, 720, 69.0), Frame(1.0, None, DOWN)
    admitted = InputGate().observation(Observation(1.0, DOWN, deck=sight), frame, camera)
    assert admitted.deck is None
    assert "sight of the deck refused" in admitted.reason
    good = Observation(1.0, DOWN, deck=SIGHT)
    assert InputGate().observation(good, frame, camera) is good


def test_a_frigates_deck_is_not_watched():
    with pytest.raises(ConfigError, match="markings of a platform"):
        load_scenario(merge(scenario_table("frigate-sea5"), {"guidance": {"horizon": {"moment": "deck"}}}))
