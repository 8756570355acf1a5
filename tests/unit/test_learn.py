"""`shipland learn`: from nothing to files, resumed as if never stopped; and the batched environment."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shipland.errors import ConfigError, DataError
from shipland.learning.policy.arguments import LearnArguments
from shipland.scenario.last_phase import last_phase_of
from shipland.scenario.scenario import load_scenario

torch = pytest.importorskip("torch", reason="the extra train is not installed")
pytest.importorskip("onnx", reason="the extra train is not installed")

import onnxruntime  # noqa: E402

from shipland.guidance.horizon.steering import ENTRIES, Action  # noqa: E402
from shipland.learning.policy import objective, train  # noqa: E402
from shipland.learning.policy.network import seeded_network  # noqa: E402
from shipland.learning.policy.phase import NOTHING, LastPhase  # noqa: E402
from shipland.learning.policy.setup import EXACT  # noqa: E402


@pytest.fixture(scope="module")
def setups():
    return [last_phase_of(load_scenario("rig-natops"))]


@pytest.fixture(autouse=True)
def few_motions(monkeypatch):
    monkeypatch.setattr("shipland.learning.policy.phase.motion.LENGTH_S", 3.0)
    monkeypatch.setattr(LastPhase.__init__, "__defaults__", (None, None, 2, 0))


def asked(out, **values):
    small = {"steps": 4, "batch": 6, "seconds": 4.0, "hidden": 8, "evaluate_every": 2, "flights": 6}
    return LearnArguments(out=out, scenario=("rig-natops",), **(small | values))


def test_it_leaves_a_policy_that_answers_as_its_network_curves_and_a_card(tmp_path, setups, capsys):
    path = train.learn(asked(tmp_path), setups)
    names = {item.name for item in tmp_path.iterdir()}
    assert names == {"policy.onnx", "curves.csv", "curves.png", "model-card.md", "model-card.json",
                     "SHA256SUMS", "last.safetensors", "best.safetensors"}  # fmt: skip
    run = train._start(replace(asked(tmp_path), resume=True))
    run.load(tmp_path / "best.safetensors")
    observation = np.random.default_rng(0).normal(size=(5, len(ENTRIES))).astype(np.float32)
    found = onnxruntime.InferenceSession(str(path)).run(None, {"observation": observation})[0]
    expected = run.network(torch.from_numpy(observation)).detach().numpy()
    assert np.abs(found - expected).max() < 1e-6
    assert np.abs(found).max() > 0.0
    card = json.loads((tmp_path / "model-card.json").read_text())
    assert card["action"] == {"kind": "residual", "bound_mps2": 0.5, "reach_m": 1.5}
    rows = (tmp_path / "curves.csv").read_text().splitlines()
    assert rows[0].startswith("step,loss,rig-natops rms")
    assert len(rows) == 3
    assert "4 of 4" in capsys.readouterr().err


def test_a_run_that_was_interrupted_goes_on_as_if_it_had_not_been(tmp_path, setups, monkeypatch):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    train.learn(asked(whole), setups)
    steps = 0

    def twice(*arguments):
        nonlocal steps
        steps += 1
        if steps == 3:
            raise KeyboardInterrupt
        return objective.loss_of(*arguments)

    monkeypatch.setattr(train, "loss_of", twice)
    with pytest.raises(KeyboardInterrupt):
        train.learn(asked(cut), setups)
    monkeypatch.setattr(train, "loss_of", objective.loss_of)
    with pytest.raises(DataError, match="--resume"):
        train.learn(asked(cut), setups)
    with pytest.raises(DataError, match="seed 1, not 2"):
        train.learn(asked(cut, resume=True, seed=2), setups)
    train.learn(asked(cut, resume=True), setups)
    assert (whole / "policy.onnx").read_bytes() == (cut / "policy.onnx").read_bytes()


def test_a_small_step_down_the_gradient_lowers_the_loss(setups):
    """On the way, before the descent's decisions make the loss leap."""
    smooth = replace(setups[0], response=replace(setups[0].response, stick_step_percent=0.0))
    phase = LastPhase(smooth, replace(EXACT, wind_mps=(5.0, 5.0)))
    network, meaning = seeded_network(8, 1), Action("residual", 0.5, 1.5)

    def loss():
        return objective.loss_of(phase, phase.draw(32, 5), network, meaning, 0, 40)

    before, contacts = loss()
    before.backward()
    norm = torch.nn.utils.clip_grad_norm_(network.parameters(), 1e9)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter -= 0.003 * parameter.grad / norm
        after, _ = loss()
    assert contacts == 0
    assert float(after) < float(before.detach())


def test_a_first_network_flies_the_pilot_alone(setups):
    phase = LastPhase(setups[0])
    network, meaning = seeded_network(8, 1), Action("residual", 0.5, 1.5)
    scores = [
        objective.score_of(phase, phase.draw(6, 2), policy, action, 200)
        for policy, action in ((None, NOTHING), (network, meaning))
    ]
    assert scores[0] == scores[1]


@pytest.mark.parametrize("wrong", [{"minutes": 0.0}, {"batch": 0}, {"seed": -1}, {"rate": -1.0}])
def test_wrong_arguments_are_one_line(tmp_path, wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        asked(tmp_path, **wrong)
