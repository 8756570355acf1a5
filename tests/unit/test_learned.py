"""The pilots `residual` and `learned`: a policy near the landing point, and the pilot alone wherever it fails."""

from functools import cache

import numpy as np
import pytest

import shipland
from shipland.errors import ConfigError
from shipland.guidance.horizon.learned import LearnedSteering, policy_path
from shipland.guidance.horizon.steering import ENTRIES, Action, Steered
from shipland.guidance.response import ANAFI_LIKE
from shipland.scenario.scenario import load_scenario

pytest.importorskip("onnx", reason="the extra train is not installed")

from shipland.learning.policy.export import Dense, write_policy

RESIDUAL = Action("residual", 0.5, 1.5)
NEAR = {"start.distance_m": 4.0, "start.distance_half_range_m": 0.0}


@pytest.fixture
def policy(tmp_path):
    """Writes a policy of one layer that always answers with `tanh(bias)`."""

    def write(bias=(0.0, 0.0), action=RESIDUAL):
        path = tmp_path / f"{action.kind}.onnx"
        weight = np.zeros((2, len(ENTRIES)), np.float32)
        write_policy(path, [Dense(weight, np.array(bias, np.float32), "Tanh")], action, "of a test")
        return str(path)

    return write


@pytest.mark.parametrize(
    ("weight", "bias", "words"),
    [
        ((len(ENTRIES), 2), 2, r"layer 0 of 1: expected weight and bias of \(\(2, 23\), \(2,\)\), got \(\(23, 2\)"),
        ((3, len(ENTRIES)), 3, "layer 0 of 1: expected"),
        ((2, len(ENTRIES)), 1, "layer 0 of 1: expected"),
    ],
)
def test_layers_that_do_not_fit_are_not_written(tmp_path, weight, bias, words):
    layer = Dense(np.zeros(weight, np.float32), np.zeros(bias, np.float32), "Tanh")
    with pytest.raises(ConfigError, match=words):
        write_policy(tmp_path / "policy.onnx", [layer], RESIDUAL, "of a test")
    assert not any(tmp_path.iterdir())


def seen(**values):
    pair = np.zeros(2)
    names = [name for name in Steered.__dataclass_fields__ if name not in ("height_m", "sink_mps", "contact_s")]
    known = dict.fromkeys(names[:9], pair) | {"landing": False, "in_final_descent": False}
    known |= {"height_m": 1.0, "sink_mps": 0.0, "contact_s": 2.0, "wanted_mps2": np.array([0.2, -0.1])}
    return Steered(**(known | values))


@cache
def flown(pilot, path=None, **overrides):
    key = {"residual": "guidance.learned.residual", "learned": "guidance.learned.direct"}.get(pilot)
    settings = overrides | ({key: path} if path is not None else {})
    return shipland.fly(load_scenario("near", **(NEAR | settings)), pilot=pilot, vision="geometric", seed=3)


def sticks(flight):
    return [record.decision.command.sticks_percent[:3] for record in flight.records]


def test_a_residual_of_zero_is_the_pilot_alone(policy):
    assert sticks(flown("residual", policy())) == sticks(flown("horizon"))


def test_a_residual_pushes_near_the_landing_point_alone(policy):
    alone, pushed = flown("horizon"), flown("residual", policy((0.3, 0.0)))
    pairs = list(zip(sticks(alone), sticks(pushed), strict=False))
    first = next(i for i, (a, b) in enumerate(pairs) if a != b)
    estimate = alone.records[first].decision.estimate
    deck_m = load_scenario("near").rig.deck_in_bar_m
    assert (
        1.0 < np.hypot(*(estimate.aircraft_in_bar_m - deck_m)[:2]) < 2.2
    )  # the estimate is of the picture, the command of 0.4 s later
    assert pushed.success


def test_a_policy_that_is_not_finite_is_left_out_and_said_so(policy):
    flight = flown("residual", policy((float("nan"), 0.0)))
    assert sticks(flight) == sticks(flown("horizon"))
    assert flight.success
    assert any("policy left out: its action is not finite" in r.decision.reason for r in flight.records)


def test_a_policy_that_raises_is_left_out_and_comes_back(policy):
    steering, situation = LearnedSteering(policy((9.0, -9.0)), "residual", ANAFI_LIKE), seen()
    session = steering._session

    class Broken:
        def run(self, *_):
            raise RuntimeError("no\nmemory")

    steering._session = Broken()
    assert steering.input_mps2(situation).tolist() == [0.2, -0.1]
    assert steering.note == "policy left out: RuntimeError: no memory"
    steering._session = session
    assert steering.input_mps2(situation).tolist() == pytest.approx([0.7, -0.6])  # bounded by 0.5
    assert steering.note == ""
    assert steering.input_mps2(seen(offset_m=np.array([1.6, 0.0]))).tolist() == [0.2, -0.1]


def test_a_direct_policy_takes_the_place_of_the_pilots_input(policy):
    steering = LearnedSteering(policy((9.0, 0.0), Action("direct", 4.0, 1.5)), "direct", ANAFI_LIKE)
    assert steering.input_mps2(seen()).tolist() == pytest.approx([4.0, 0.0])


def test_a_vehicle_whose_sticks_mean_a_velocity_flies_without(policy):
    velocity = {"aircraft.loop.kind": "velocity", "time_limit_s": 5.0, "start.distance_m": 3.0}
    flight = flown("residual", policy((0.3, 0.0)), **velocity)
    assert sticks(flight) == sticks(flown("horizon", **velocity))
    assert "sticks of this vehicle mean a velocity" in flight.records[0].decision.reason


def test_wrong_policies_are_refused_in_one_line(policy, tmp_path):
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no policy")
    detector = str(policy_path("residual").parents[1] / "bar.onnx")
    path = policy()
    for name, kind, words in (
        ("nobody", "residual", "packaged: direct, residual, td3"),
        (str(broken), "residual", "no ONNX file"),
        (detector, "residual", "shipland learn"),
        (path, "direct", "'residual', not 'direct'"),
    ):
        with pytest.raises(ConfigError, match=words) as found:
            LearnedSteering(name, kind, ANAFI_LIKE)
        assert "\n" not in str(found.value)


@pytest.mark.parametrize(("name", "kind"), [("residual", "residual"), ("direct", "direct"), ("td3", "residual")])
def test_the_packaged_policies_are_small_and_fly(name, kind):
    path = policy_path(name)
    assert path.stat().st_size < 200_000
    found = LearnedSteering(name, kind, ANAFI_LIKE).input_mps2(seen())
    assert np.isfinite(found).all()
    assert found.tolist() != [0.2, -0.1]
