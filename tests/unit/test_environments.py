"""The Gymnasium environment: it conforms, repeats, flies the real loop, and its safety stays in it."""

import importlib
from pathlib import Path

import numpy as np
import pytest

import shipland
from shipland.errors import ShiplandError
from shipland.messages import BarPose, Box, Decision, GimbalAttitude, Intent, Observation, PilotCommand, Telemetry
from shipland.report.palette import GREY, ORANGE
from shipland.scenario.scenario import load_scenario

gymnasium = pytest.importorskip("gymnasium", reason="the extra rl is not installed")
env_checker = pytest.importorskip("gymnasium.utils.env_checker", reason="the extra rl is not installed")

from shipland.environments import LANDING, LAST_PHASE  # noqa: E402
from shipland.environments.actions import ResidualPilot  # noqa: E402
from shipland.environments.flight_env import SteppedFlight  # noqa: E402
from shipland.environments.landing import LandingEnv, observation_space  # noqa: E402
from shipland.environments.last_phase import LastPhaseEnv  # noqa: E402
from shipland.guidance.pilot import horizon  # noqa: E402
from shipland.record.observations import OLDEST_S, Observer  # noqa: E402
from shipland.safety.assurance import Safety  # noqa: E402

EXAMPLES = Path(__file__).parents[2] / "examples"
ZERO = np.zeros(4, np.float32)
LEVEL = GimbalAttitude(0.0, 0.0)


def make(**settings):
    return gymnasium.make(LANDING, **settings)


def flown(env, seed, actions):
    """Observations, rewards and the last info of a flight that ends with its actions or before."""
    seen, info = env.reset(seed=seed)
    observations, rewards = [seen], []
    for action in actions:
        seen, reward, terminated, truncated, info = env.step(action)
        observations.append(seen)
        rewards.append(reward)
        if terminated or truncated:
            break
    return observations, rewards, info


def drawn(count):
    return np.random.default_rng(5).uniform(-1.0, 1.0, (count, 4)).astype(np.float32)


@pytest.mark.parametrize("settings", [{}, {"observation": "flat", "action": "residual", "bound": [0.1, 0.1, 0.0, 0.0]}])
def test_it_conforms_to_gymnasium(settings):
    env_checker.check_env(make(**settings).unwrapped)
    env_checker.check_env(make(**settings, render_mode="rgb_array").unwrapped)


def test_the_last_phase_conforms_to_gymnasium():
    env_checker.check_env(gymnasium.make(LAST_PHASE).unwrapped)


@pytest.mark.parametrize(
    ("which", "settings"), [(LANDING, {"observation": "dict"}), (LANDING, {"observation": "flat"}), (LAST_PHASE, {})]
)
def test_it_conforms_to_stable_baselines(which, settings):
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="stable-baselines3 is not installed")
    env = gymnasium.make(which, **settings)
    checker.check_env(env.unwrapped)
    env.close()


def test_the_same_seed_and_actions_give_the_same_flight_flat_or_not():
    entries = observation_space()
    first, second, flat = (flown(make(observation=kind), 4, drawn(60)) for kind in ("dict", "dict", "flat"))
    other = flown(make(), 5, drawn(60))
    assert first[1] == second[1] == flat[1] != other[1]
    for one, same, row in zip(first[0], second[0], flat[0], strict=True):
        assert one in entries
        for name, value in gymnasium.spaces.unflatten(entries, row).items():
            assert np.array_equal(value, one[name])
            assert np.array_equal(one[name], same[name])


def test_flights_after_the_first_are_drawn_from_its_seed():
    env = make()
    seeds = [[env.reset(seed=seed)[1]["seed"], env.reset()[1]["seed"], env.reset()[1]["seed"]] for seed in (7, 7, 8)]
    env.close()
    assert seeds[0] == seeds[1]
    assert seeds[0][0] == 7
    assert len({*seeds[0], *seeds[2]}) == 6


FAULTS = {
    "time_limit_s": 9.0,
    "fault": [
        {"kind": "link_loss", "start_s": 2.0, "duration_s": 1.0},
        {"kind": "pilot_stalls", "start_s": 5.0, "duration_s": 0.7},
        {"kind": "nan_telemetry", "start_s": 6.5, "duration_s": 0.5},
    ],
}


def test_a_stepped_flight_is_the_flight_of_the_loop_whatever_fails(monkeypatch):
    check = Safety.check

    def failing(safety, decision, observation, telemetry, *override):
        if 7.5 < telemetry.t_s < 7.7:
            raise ZeroDivisionError
        return check(safety, decision, observation, telemetry, *override)

    monkeypatch.setattr(Safety, "check", failing)
    scenario = load_scenario("near", **FAULTS)
    records = shipland.fly(scenario, seed=3).records
    flight = SteppedFlight(scenario, horizon, "geometric", 3)
    for record in records:
        cycle = flight.advance()
        assert cycle.telemetry.t_s == record.telemetry.t_s
        decision = flight.decide(cycle)
        assert (decision.command, decision.reason) == (record.decision.command, record.decision.reason)
    flight.close()
    assert len(records) > 200


def where(picture, colour):
    """Middle row and column of a picture's pixels of nearly that colour."""
    return np.argwhere((np.abs(picture.astype(int) - colour) < 30).all(axis=2)).mean(axis=0)


def test_a_zero_residual_lands_as_the_pilot_alone_and_is_drawn_as_it_is_now():
    alone = shipland.fly("near", seed=3)
    env = make(action="residual", render_mode="rgb_array")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.unwrapped.render()
    env.reset(seed=3)
    first = env.render()
    _, rewards, info = flown(env, 3, [ZERO] * 2000)
    last = env.render()
    env.close()
    assert len(rewards) == len(alone.records)
    assert alone.success
    assert info["in_square"] is info["is_success"] is info["landed"] is True
    assert (info["reason"], info["error_m"], info["slip_m"]) == (alone.reason, alone.error_m, alone.verdict.slip_m)
    # From about 12 m away to the middle of the deck in about 17 s, and 10 for the landing.
    start_m = np.linalg.norm(alone.records[0].truth.aircraft_in_deck_m)
    assert sum(rewards) == pytest.approx(10.0 + start_m - 0.05 * info["t_s"], abs=0.5)
    assert first.shape == last.shape == (480, 640, 3)
    assert first.dtype == np.uint8
    for panel in (slice(30, 215), slice(225, 480)):  # from the side, from above
        deck, aircraft = (where(first[panel], colour) for colour in (GREY, ORANGE))
        assert aircraft[1] < deck[1] - 200  # astern is to the left
        deck, aircraft = (where(last[panel], colour) for colour in (GREY, ORANGE))
        assert aircraft == pytest.approx(deck, abs=25)
    assert LandingEnv().render() is None


@pytest.mark.parametrize(
    ("intent", "added"),
    [(Intent.FLY, True), (Intent.LAND, True), (Intent.HOLD, False), (Intent.GO_AROUND, False)],
)
def test_a_residual_is_added_within_its_bound_while_the_pilot_flies_or_lands(intent, added):
    command = PilotCommand(1.0, 10.0, 20.0, 30.0, 40.0, 0.1, intent)

    class Steady:
        def decide(self, observation, telemetry, sent):
            return Decision(command, None, "steady")

    pilot = ResidualPilot(Steady(), np.array([0.1, 0.2, 0.3, 0.0]))
    pilot.action = np.array([1.0, -1.0, 0.5, 1.0])
    flown_command = pilot.decide(Observation(1.0, LEVEL), told(1.0), None).command
    total = PilotCommand(1.0, 20.0, 0.0, 45.0, 40.0, 0.1, intent)
    assert flown_command == (total if added else command)


def test_actions_beyond_the_stick_are_clipped():
    env = make().unwrapped
    env.reset(seed=3)
    env.step(np.array([3.0, -3.0, 0.5, 0.0]))
    env.close()
    assert env._pilot.action.tolist() == [1.0, -1.0, 0.5, 0.0]


def test_sticks_have_the_signs_of_the_project_and_the_safety_stands_behind_them():
    forward, down = np.array([1.0, 0.0, 0.0, 0.0], np.float32), np.array([0.0, 0.0, -1.0, 0.0], np.float32)
    env = make()
    start = flown(env, 3, [ZERO])[2]["aircraft_in_deck_m"]
    seen, rewards, ahead = flown(env, 3, [forward] * 60)
    assert ahead["aircraft_in_deck_m"][0] > start[0] + 1.0
    assert sum(rewards) > 1.0
    assert seen[-1]["sent"].tolist() == [1.0, 0.0, 0.0, 0.0]
    _, _, info = flown(env, 3, [down] * 40)
    assert "floor" in info["reason"]
    _, _, info = flown(env, 3, [down] * 150)
    env.close()
    # The floor is 0.75 m over the deck; 1 m/s brakes within some decimetres.
    assert -1.2 < info["aircraft_in_deck_m"][2] < -0.3


def test_without_sight_only_yaw_and_climb_are_flown():
    env = make()
    env.reset(seed=3)
    pilot = env.unwrapped._pilot
    pilot.action = np.array([1.0, 1.0, -1.0, 0.5])
    nothing, seen = Observation(100.0, LEVEL), Observation(100.0, LEVEL, bar_box=Box((640.0, 100.0), (60.0, 20.0), 0.9))
    blind = pilot.decide(nothing, told(100.0), None).command
    sees = pilot.decide(seen, told(100.1), None).command
    env.close()
    assert blind.sticks_percent == (0.0, 0.0, 0.0, 50.0)
    assert (sees.pitch_percent, sees.heave_percent, sees.intent) == (100.0, -100.0, Intent.LAND)
    assert blind.intent is Intent.SEARCH


@pytest.mark.parametrize("name", [LANDING, LAST_PHASE])
@pytest.mark.parametrize("wrong", ["number", "batch", "longer", "nan"])
def test_an_action_of_another_shape_or_not_finite_is_refused(name, wrong):
    """Neither is left to the safety, which would fly on without the agent."""
    env = gymnasium.make(name).unwrapped
    env.reset(seed=3)
    right = np.zeros(env.action_space.shape, np.float32)
    action = {"number": 0.0, "batch": right[None], "longer": np.zeros(7), "nan": right + np.nan}[wrong]
    with pytest.raises(gymnasium.error.InvalidAction, match="expected finite numbers of the shape"):
        env.step(action)
    assert np.isfinite(env.step(right)[1])
    env.close()


def test_the_time_limit_truncates():
    env = make(overrides={"time_limit_s": 1.0})
    _, rewards, info = flown(env, 3, [ZERO] * 200)
    assert 20 < len(rewards) < 40
    assert "time limit" in info["reason"]
    assert (info["in_square"], info["landed"]) == (False, False)
    assert np.isnan(info["error_m"])
    assert min(rewards) > -1.0  # no penalty
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.unwrapped.step(ZERO)


def told(t_s, **values):
    known = dict.fromkeys(
        ("roll_rad", "pitch_rad", "heading_rad", "height_m", "velocity_in_level_mps", "battery_percent", "link_percent")
    )
    return Telemetry(t_s, **(known | values), flying=True)


def test_what_is_missing_has_an_age_and_is_finite(camera):
    observer, entries = Observer(camera), observation_space()
    first = observer.take(Observation(9.7, LEVEL, reason="nothing"), told(10.0), None)
    assert first in entries
    assert first["picture_age"] == pytest.approx(0.3, abs=1e-6)
    for name in ("pose", "bar_box", "ship_box", "attitude", "heading", "height", "velocity"):
        assert first[f"{name}_age"] == OLDEST_S
        assert not first[name].any()
    pose = BarPose(np.array([-5.0, 0.5, -1.0]), 7.0, np.diag([1.0, 2.0, 3.0, 4.0]), 0.1, np.zeros((8, 2)))
    box = Box((639.5, 359.5), (128.0, 72.0), 0.8)
    velocity = {"velocity_in_level_mps": np.array([1.0, 2.0, 3.0]), "velocity_t_s": 10.9}
    sent = PilotCommand(10.0, 10.0, -20.0, 30.0, -40.0, 0.0)
    observer.take(Observation(10.7, LEVEL, bar_pose=pose, ship_box=box), told(11.0, **velocity), sent)
    later = observer.take(Observation(11.7, LEVEL), told(12.0), sent)
    assert later in entries
    assert later["pose"] == pytest.approx([-5.0, 0.5, -1.0, 7.0 - 2.0 * np.pi])
    assert later["pose_covariance"].tolist() == [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 0.0, 4.0]
    assert later["pose_age"] == pytest.approx(1.3, abs=1e-6)
    assert later["ship_box"] == pytest.approx([0.0, 0.0, 0.1, 0.1, 0.8], abs=0.002)  # half a pixel off the middle
    assert later["velocity"].tolist() == [1.0, 2.0, 3.0]
    assert later["velocity_age"] == pytest.approx(1.1, abs=1e-6)
    assert later["sent"] == pytest.approx([0.1, -0.2, 0.3, -0.4])
    assert observer.take(Observation(90.0, LEVEL), told(90.3), sent)["pose_age"] == OLDEST_S


@pytest.mark.parametrize(
    ("env", "wrong", "words"),
    [
        (LandingEnv, {"action": "stick"}, "stick.*residual"),
        (LandingEnv, {"observation": "list"}, "list.*flat"),
        (LandingEnv, {"bound": 2.0}, "bound=2.0"),
        (LandingEnv, {"bound": [0.1, 0.2]}, "or four"),
        (LandingEnv, {"bound": "half"}, "bound='half'"),
        (LandingEnv, {"vision": "none"}, "none"),
        (LandingEnv, {"vision": None}, "None is none of the visions; expected a name .*geometric"),
        (LandingEnv, {"action": "residual", "pilot": "nobody"}, "nobody"),
        (LandingEnv, {"pilot": "nobody"}, "nobody"),
        (LandingEnv, {"scenario": "nowhere"}, "nowhere"),
        (LandingEnv, {"overrides": {"wind": {"mean": 1.0}}}, "mean_mps"),
        (LandingEnv, {"overrides": ["wind.mean_mps=1"]}, r"overrides=\['wind.mean_mps=1'\]: expected a table"),
        (LandingEnv, {"overrides": {1: 2}}, "overrides={1: 2}: expected a table"),
        (LastPhaseEnv, {"overrides": "wind.mean_mps=1"}, "overrides='wind.mean_mps=1': expected a table"),
        (LandingEnv, {"render_mode": "human"}, "render_mode='human': expected one of rgb_array"),
        (LandingEnv, {"scenaro": "near"}, "LandingEnv: unknown key 'scenaro'; did you mean 'scenario'"),
        (LastPhaseEnv, {"action": "stick"}, "action='stick': expected one of residual, direct"),
        (LastPhaseEnv, {"reach": 1.0}, "LastPhaseEnv: unknown key 'reach'; did you mean 'reach_m'"),
        (LastPhaseEnv, {"bound_mps2": 99.0}, "bound_mps2"),
        (LastPhaseEnv, {"bound_mps2": "half"}, "bound_mps2"),
        (LastPhaseEnv, {"overrides": {"aircraft.loop.kind": "velocity"}}, "attitude"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(env, wrong, words):
    with pytest.raises(ShiplandError, match=words) as found:
        env(**wrong)
    assert "\n" not in str(found.value)


def test_it_records_for_stable_baselines():
    env_util = pytest.importorskip("stable_baselines3.common.env_util", reason="stable-baselines3 is not installed")
    envs = env_util.make_vec_env(LANDING, 2, env_kwargs={"render_mode": "rgb_array"})
    envs.reset()
    envs.step([ZERO] * 2)
    assert envs.render().shape == (960, 640, 3)
    envs.close()


def test_the_example_holds_an_action_for_a_cycle_at_least(monkeypatch):
    pytest.importorskip("stable_baselines3", reason="stable_baselines3 is not installed")
    monkeypatch.syspath_prepend(EXAMPLES)
    env = make()
    held = importlib.import_module("train_sb3").Held(env, 0.0)
    _, before = held.reset(seed=3)
    after = held.step(ZERO)[-1]
    env.close()
    assert 0.0 < after["t_s"] - before["t_s"] < 0.1


@pytest.mark.parametrize(("algorithm", "environments"), [("sac", 1), ("ppo", 1), ("ppo", 2)])
def test_the_example_with_stable_baselines_runs(monkeypatch, tmp_path, capsys, algorithm, environments):
    pytest.importorskip("stable_baselines3", reason="stable_baselines3 is not installed")
    monkeypatch.syspath_prepend(EXAMPLES)
    train, short = importlib.import_module("train_sb3"), tmp_path / "short.toml"
    short.write_text("time_limit_s = 2.0\n")
    asked = {"steps": 110, "environments": environments, "scenario": str(short), "flights": 1, "out": tmp_path}
    found = train.main(train.Arguments(algorithm, action="sticks", **asked))
    assert {who: score.landed for who, score in found.items()} == {"zero action": 0, "agent": 0}  # no time
    assert {path.name for path in tmp_path.iterdir()} >= {"agent.zip", "normalise.pkl", "curve.csv", "curve.png"}
    said = capsys.readouterr()
    assert said.out.startswith("zero action: 0 of 1 landed in the square, mean return ")
    assert "steps, " in said.err and "min left" in said.err
