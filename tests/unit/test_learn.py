"""`shipland learn`: from nothing to files that its pilots fly, and on from where it stopped."""

import subprocess
import sys

import numpy as np
import pytest

from shipland.commands.learn import Learn
from shipland.errors import ConfigError, DataError
from shipland.guidance.horizon.learned import LearnedSteering
from shipland.guidance.horizon.steering import ENTRIES
from shipland.guidance.response import ANAFI_LIKE
from shipland.learning.policy.arguments import LearnArguments

NEEDED = ("torch", "stable_baselines3", "gymnasium", "onnx", "safetensors")


@pytest.fixture
def train(monkeypatch):
    """The trainer, that trains from the first steps on."""
    for package in NEEDED:
        pytest.importorskip(package, reason="the extra learn is not installed")
    from shipland.learning.policy import agent, train

    for module, name, value in (
        (agent, "BEGIN", 10),
        (agent, "MEMORY", 2_000),
        (train, "FROZEN", 20),
        (train, "CHUNK", 20),
        (train, "EVALUATED", 40),
        (train, "_mean_return", lambda run, *_: float(run.progress.step)),  # later is better
    ):
        monkeypatch.setattr(module, name, value)
    return train


def learned(train, arguments):
    return train.learn(arguments, makers(arguments))


def makers(arguments):
    from shipland.environments.last_phase import last_phases

    return last_phases(arguments.scenario.split(","), arguments.changes, arguments.kind, arguments.bound, 2)


def asked(out, **values):
    small = {"scenario": "rig-natops,ship-sea6", "steps": 80, "batch": 16, "hidden": 8, "flights": 2}
    return LearnArguments(out=out, **(small | values))


def test_it_leaves_a_policy_that_answers_as_its_network_curves_and_a_card(train, tmp_path, capsys):
    path = learned(train, asked(tmp_path))
    names = {item.name for item in tmp_path.iterdir()}
    assert names == {"policy.onnx", "SHA256SUMS", "curves.csv", "curves.png", "model-card.md", "last.safetensors"}
    envs = train.vector_of(makers(asked(tmp_path)))
    layers = train.dense_of(train._start(asked(tmp_path, resume=True), envs).best)
    seen = np.random.default_rng(0).normal(size=len(ENTRIES)).astype(np.float32)
    expected = train.answer(layers, seen)
    steering = LearnedSteering(str(path), "residual", ANAFI_LIKE)
    found = steering._session.run(None, {"observation": seen[None]})[0][0]
    assert np.abs(found - expected).max() < 1e-6
    assert np.abs(found).max() > 0.0
    assert steering._action.bound_mps2 == 0.5
    assert len((tmp_path / "curves.csv").read_text().splitlines()) == 5
    assert "80 steps" in (tmp_path / "model-card.md").read_text()
    assert "4 of 4" in capsys.readouterr().err


def test_the_same_seed_and_steps_give_the_same_policy(train, tmp_path):
    first, same = (learned(train, asked(tmp_path / name)).read_bytes() for name in ("a", "b"))
    other = learned(train, asked(tmp_path / "c", seed=2)).read_bytes()
    assert first == same != other


@pytest.mark.parametrize("kind", ["residual", "direct"])
def test_a_first_actor_flies_as_the_pilot_alone(train, kind, tmp_path):
    arguments = asked(tmp_path, kind=kind, hidden=32)
    envs = train.vector_of(makers(arguments))
    actor = train.Run(arguments, envs).agent.actor
    envs.close()
    seen = 0.7 * np.random.default_rng(0).normal(size=(200, len(ENTRIES))).astype(np.float32)
    wanted = seen[:, [ENTRIES.index("wanted_mps2.forward"), ENTRIES.index("wanted_mps2.starboard")]]
    expected = np.zeros((200, 2)) if kind == "residual" else 0.5 * wanted  # of 2 m/s² a unit, of 4 m/s²
    found = actor(train.torch.from_numpy(seen)).detach().numpy()
    assert np.abs(found - expected).max() < (1e-9 if kind == "residual" else 0.15)


def test_a_stopped_run_exports_its_policy_and_goes_on_with_all_it_has_learned(train, tmp_path, monkeypatch, capsys):
    from stable_baselines3 import TD3

    learn, calls = TD3.learn, 0

    def stops(agent, *arguments, **named):
        nonlocal calls
        calls += 1
        if calls == 3:
            raise KeyboardInterrupt
        return learn(agent, *arguments, **named)

    monkeypatch.setattr(TD3, "learn", stops)
    LearnedSteering(str(learned(train, asked(tmp_path))), "residual", ANAFI_LIKE)
    monkeypatch.setattr(TD3, "learn", learn)
    envs = train.vector_of(makers(asked(tmp_path)))
    run = train._start(asked(tmp_path, resume=True), envs)
    envs.close()
    assert (run.agent.num_timesteps, run.agent._n_updates) == (40, 15)
    assert run.agent.replay_buffer.pos == 20  # of two environments each
    assert run.agent.replay_buffer.observations[:20].any()
    with pytest.raises(DataError, match="--resume"):
        learned(train, asked(tmp_path))
    with pytest.raises(DataError, match="seed 1, not 2"):
        learned(train, asked(tmp_path, resume=True, seed=2))
    with pytest.raises(DataError, match="hidden 8, not 16"):
        learned(train, asked(tmp_path, resume=True, hidden=16))
    learned(train, asked(tmp_path, resume=True))
    assert "80 steps" in (tmp_path / "model-card.md").read_text()
    assert "training: 4 of 4" in capsys.readouterr().err  # with those before it was stopped


def test_what_does_no_better_than_the_pilot_alone_is_not_exported(train, tmp_path, monkeypatch):
    monkeypatch.setattr(train, "_mean_return", lambda run, *_: -float(run.progress.step))
    path = learned(train, asked(tmp_path))
    session = LearnedSteering(str(path), "residual", ANAFI_LIKE)._session
    seen = np.random.default_rng(0).normal(size=(1, len(ENTRIES))).astype(np.float32)
    assert not session.run(None, {"observation": seen})[0].any()
    assert "these weights are of step 0" in (tmp_path / "model-card.md").read_text()


def test_what_the_last_steps_have_learned_is_evaluated_too(train, tmp_path):
    learned(train, asked(tmp_path, steps=60))
    assert "these weights are of step 60" in (tmp_path / "model-card.md").read_text()
    assert (tmp_path / "curves.csv").read_text().splitlines()[-1].endswith(",60.0")


def test_an_evaluation_flies_the_same_flights_again(train, tmp_path, monkeypatch):
    monkeypatch.undo()
    made = makers(asked(tmp_path))
    envs = train.vector_of(made)
    run = train.Run(asked(tmp_path), envs)
    envs.close()
    first, same = (train._mean_return(run, made, 2) for _ in range(2))
    assert first == same
    assert -20.0 < first < 15.0
    run.averaged["4.bias"] += 1.0
    assert train._mean_return(run, made, 2) != first


def test_environments_in_processes_of_their_own(train, tmp_path):
    assert learned(train, asked(tmp_path, parallel=True, steps=20)).is_file()


@pytest.mark.parametrize("wrong", [{"minutes": 0.0}, {"batch": 0}, {"seed": -1}, {"rate": -1.0}])
def test_wrong_arguments_are_one_line(tmp_path, wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        asked(tmp_path, **wrong)


@pytest.mark.parametrize("missing", ["onnx", "gymnasium"])
def test_without_the_extra_one_line_says_what_to_install(missing, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, missing, None)
    for loaded in [name for name in sys.modules if name.startswith(("shipland.learning.", "shipland.environments"))]:
        monkeypatch.delitem(sys.modules, loaded)
    with pytest.raises(DataError, match=rf"needs {missing}; install it with: pip install 'shipland\[learn\]'"):
        Learn(out=tmp_path).run()


def test_the_environments_do_not_need_torch():
    code = (
        "import sys, gymnasium, shipland.environments; "
        "gymnasium.make('shipland/Landing-v0'); gymnasium.make('shipland/LastPhase-v0'); print('torch' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"
