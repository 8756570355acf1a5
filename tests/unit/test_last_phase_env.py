"""`shipland/LastPhase-v0`: many flights at once, each begun anew in the step that ends it."""

import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shipland.errors import ConfigError
from shipland.guidance.horizon.learned import LearnedSteering
from shipland.guidance.response import ANAFI_LIKE

gymnasium = pytest.importorskip("gymnasium", reason="the extra rl is not installed")
pytest.importorskip("torch", reason="the extra train is not installed")

from shipland.environments import LAST_PHASE  # noqa: E402
from shipland.environments.last_phase import LastPhaseEnv  # noqa: E402
from shipland.learning.policy.setup import EXACT  # noqa: E402


@pytest.fixture(scope="module")
def env():
    return LastPhaseEnv(12, motions=2, random=EXACT)


def flown(env, seed, steps, actions=None):
    rows = [env.reset(seed=seed)[0]]
    rewards, ends = [], []
    for _ in range(steps):
        asked = np.zeros((env.num_envs, 2), np.float32) if actions is None else actions
        seen, reward, terminated, truncated, info = env.step(asked)
        rows.append(seen)
        rewards.append(reward)
        ends.append((terminated, truncated, info))
    return np.array(rows), np.array(rewards), ends


def test_gymnasium_makes_it():
    made = gymnasium.make_vec(LAST_PHASE, num_envs=3, vectorization_mode="vector_entry_point", motions=1)
    assert isinstance(made.unwrapped, LastPhaseEnv)
    assert made.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP
    seen, info = made.reset(seed=1)
    assert made.observation_space.contains(seen)
    assert info == {}
    assert made.single_observation_space.shape == (len(made.unwrapped.entries),)
    made.close()


def test_the_same_seed_and_actions_repeat(env):
    first, second, other = flown(env, 3, 25), flown(env, 3, 25), flown(env, 4, 25)
    assert np.array_equal(first[0], second[0])
    assert np.array_equal(first[1], second[1])
    assert not np.array_equal(first[0], other[0])
    assert not np.array_equal(first[0][:, 0], first[0][:, 1])  # flights of a batch differ


def test_flights_end_at_contact_and_begin_anew_in_the_same_step(env):
    rows, rewards, ends = flown(env, 5, 330)
    over = np.array([terminated | truncated for terminated, truncated, _ in ends])
    assert (over.sum(0) >= 1).mean() > 0.8
    height = list(env.entries).index("height_m")
    checked = 0
    for step, (terminated, _, info) in enumerate(ends):
        for index in np.flatnonzero(terminated):
            final = info["final_info"]
            assert info["_final_obs"][index]
            assert final["touched"][index]
            assert info["final_obs"][index, height] < 0.5
            assert rows[step + 1][index, height] > 0.7  # of the flight that begins
            within = np.abs(final["deck_m"][index]).max() <= 0.175
            assert final["in_square"][index] == within
            assert rewards[step, index] > (9.0 if within else 1.0)
            checked += 1
        if not terminated.any():
            assert info == {}
    assert checked >= 10


def test_a_flight_that_goes_on_is_not_touched_by_those_that_begin_anew(env):
    """Its observations are smooth where its neighbours end."""
    rows, _, ends = flown(env, 5, 330)
    ended = np.array([terminated | truncated for terminated, truncated, _ in ends])
    height = rows[:, :, list(env.entries).index("height_m")]
    steps = np.abs(np.diff(height, axis=0))
    assert steps[~ended].max() < 0.12
    assert steps[ended].min() > 0.2


def test_time_truncates_and_bad_arguments_are_one_line():
    brief = LastPhaseEnv(4, motions=1, time_limit_s=0.5)
    _, rewards, ends = flown(brief, 1, 15)
    assert ends[14][1].all()
    assert not ends[14][0].any()
    assert not any(end[1].any() for end in ends[:14])
    assert np.abs(rewards).max() < 1.0
    for wrong in ({"num_envs": 0}, {"action": "stick"}, {"bound_mps2": 99.0}, {"time_limit_s": 0.0}):
        with pytest.raises(ConfigError, match=next(iter(wrong)).replace("action", "kind")):
            LastPhaseEnv(**({"num_envs": 2, "motions": 1} | wrong))


def test_the_loops_environment_does_not_need_torch():
    code = (
        "import sys, gymnasium, shipland.environments; "
        "gymnasium.make('shipland/Landing-v0'); print('torch' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"


def test_the_example_with_td3_trains_and_its_policy_flies(monkeypatch, tmp_path):
    pytest.importorskip("onnx", reason="the extra train is not installed")
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    monkeypatch.setattr(LastPhaseEnv.__init__, "__kwdefaults__", LastPhaseEnv.__init__.__kwdefaults__ | {"motions": 1})
    train = importlib.import_module("train_td3_batched")
    out = tmp_path / "td3.onnx"
    ended = train.main(train.Arguments(steps=210, flights=8, begin=180, batch=16, out=out))
    assert len(ended) >= 1
    steering = LearnedSteering(str(out), "residual", ANAFI_LIKE)
    assert steering.note == ""
