"""`shipland/LastPhase-v0`: the flights of the pilots `horizon`, `residual` and `learned`, action by action."""

import numpy as np
import pytest

import shipland
from shipland.errors import ConfigError
from shipland.guidance.horizon.learned import LearnedSteering, policy_path
from shipland.guidance.response import ANAFI_LIKE
from shipland.scenario.scenario import load_scenario

pytest.importorskip("gymnasium", reason="the extra rl is not installed")

from shipland.environments.last_phase import START, LastPhaseEnv

HEIGHT = "height_m"


def flown(env, seed, act, steps=2000):
    """Observations, rewards and the last info."""
    seen, info = env.reset(seed=seed)
    rows, rewards, over = [seen], [], False
    while not over and len(rewards) < steps:
        seen, reward, terminated, truncated, info = env.step(act(seen))
        rows.append(seen)
        rewards.append(reward)
        over = terminated or truncated
    return np.array(rows), np.array(rewards), info


@pytest.mark.parametrize(("pilot", "name", "kind"), [("residual", "td3", "residual"), ("learned", "direct", "direct")])
def test_a_policy_flies_here_what_its_pilot_flies(pilot, name, kind):
    """What is trained is what flies, to the last digit."""
    key = {"residual": "guidance.learned.residual", "learned": "guidance.learned.direct"}[pilot]
    pilots = shipland.fly(load_scenario("ship-sea5", **START, **{key: name}), pilot=pilot, seed=5)
    steering = LearnedSteering(name, kind, ANAFI_LIKE)
    session, meaning = steering._session, steering._action

    def act(seen):
        return session.run(None, {"observation": seen[None]})[0][0]

    env = LastPhaseEnv("ship-sea5", action=kind, bound_mps2=meaning.bound_mps2, reach_m=meaning.reach_m)
    rows, rewards, info = flown(env, 5, act)
    assert policy_path(name).is_file()
    assert (info["reason"], info["error_m"], info["slip_m"]) == (pilots.reason, pilots.error_m, pilots.verdict.slip_m)
    assert 100 < len(rewards) < len(pilots.records)  # the approach is no step
    assert rows[:, env.entries.index(HEIGHT)].min() < 0.4


def test_the_same_seed_and_actions_repeat():
    rng = np.random.default_rng(2)
    drawn = rng.uniform(-1.0, 1.0, (40, 2)).astype(np.float32)
    first, same, other = (
        flown(LastPhaseEnv(), seed, lambda _, it=it: next(it), 40)
        for seed, it in zip((4, 4, 5), map(iter, [drawn] * 3), strict=True)
    )
    assert np.array_equal(first[0], same[0])
    assert np.array_equal(first[1], same[1])
    assert not np.array_equal(first[0], other[0])


def test_a_flight_that_never_comes_near_is_refused_in_one_line(monkeypatch):
    monkeypatch.setattr("shipland.environments.flight_env._DRAWS", 2)
    env = LastPhaseEnv(overrides={"time_limit_s": 1.0})
    for seed in (1, None):
        with pytest.raises(ConfigError, match="before an action is due") as found:
            env.reset(seed=seed)
        assert "\n" not in str(found.value)
