"""What `shipland learn` leaves: the policy, curves as table and picture, and a model card."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from shipland.files import write_atomically
from shipland.guidance.horizon.steering import Action
from shipland.learning.policy.arguments import LearnArguments
from shipland.learning.policy.export import write_policy
from shipland.learning.policy.network import PolicyNetwork

History = Sequence[dict[str, float]]


def write_results(
    arguments: LearnArguments, network: PolicyNetwork, action: Action, history: History, steps: tuple[int, int, float]
) -> Path:
    """Write `policy.onnx`, `curves.csv`, `curves.png`, `model-card.md` and `model-card.json`; the first one's path.

    Args:
        arguments: of the command.
        network: with the best weights.
        action: what its action means.
        history: a row an evaluation.
        steps: of the best weights, of the whole run, and its seconds.
    """
    out = arguments.out
    policy = out / "policy.onnx"
    write_policy(policy, network.dense(), action, f"shipland learn, {arguments.kind}, step {steps[0]}")
    write_atomically(out / "curves.csv", _table(history).encode())
    plot_curves(out / "curves.png", history, arguments.scenario)
    card = _card(arguments, action, history, steps)
    write_atomically(out / "model-card.json", (json.dumps(card, indent=2) + "\n").encode())
    write_atomically(out / "model-card.md", _markdown(card, arguments.scenario).encode())
    return policy


def _table(history: History) -> str:
    stream = io.StringIO()
    if history:
        writer = csv.DictWriter(stream, list(history[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(history)
    return stream.getvalue()


def plot_curves(path: Path, history: History, scenarios: Sequence[str]) -> None:
    """Loss and rms at contact over the steps, as a picture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    step = [row["step"] for row in history]
    left.plot(step, [row["loss"] for row in history])
    left.set(xlabel="step", ylabel="loss [m²]", yscale="log")
    for number, name in enumerate(scenarios):
        right.plot(step, [100.0 * row[f"{name} rms"] for row in history], color=f"C{number}", label=name)
        alone = [100.0 * row[f"{name} alone"] for row in history]
        right.plot(step, alone, color=f"C{number}", linestyle="--", label=f"{name}, horizon alone")
    right.set(xlabel="step", ylabel="rms offset at contact, model [cm]", ylim=(0.0, None))
    for axes in (left, right):
        axes.grid(alpha=0.3)
    right.legend(frameon=False)
    beside = path.with_suffix(".part.png")
    figure.savefig(beside, dpi=110)
    beside.replace(path)


def _card(
    arguments: LearnArguments, action: Action, history: History, steps: tuple[int, int, float]
) -> dict[str, object]:
    best = next((row for row in history if row["step"] == steps[0]), {})
    settings = {name: value for name, value in asdict(arguments).items() if name not in ("out", "resume")}
    return {
        "kind": action.kind,
        "action": vars(action),
        "settings": settings,
        "best_step": steps[0],
        "steps": steps[1],
        "minutes": round(steps[2] / 60.0, 1),
        "in_the_model": best,
    }


def _markdown(card: dict[str, object], scenarios: Sequence[str]) -> str:
    action, found = card["action"], card["in_the_model"]
    assert isinstance(action, dict)
    assert isinstance(found, dict)
    meaning = "added to the pilot's own input" if card["kind"] == "residual" else "the input itself"
    lines = [
        f"# Policy: {card['kind']}",
        "",
        f"- Action: two accelerations of at most {action['bound_mps2']:g} m/s², {meaning}; within "
        f"{action['reach_m']:g} m of the landing point, on vehicles whose sticks mean a tilt",
        f"- Training: gradients through the batched last phase, {card['steps']} steps in {card['minutes']} minutes; "
        f"these weights are of step {card['best_step']}",
        f"- Settings: `{json.dumps(card['settings'])}`",
    ]
    lines += [
        f"- {name}, in the model: {100 * found[f'{name} rms']:.1f} cm rms at contact, "
        f"{100 * found[f'{name} alone']:.1f} cm by `horizon` alone on the same flights"
        for name in scenarios
        if f"{name} rms" in found
    ]
    limits = "these are the model's figures; the simulator's are what counts (docs/results/learned-policies.md)"
    lines += [f"- Limits: {limits}.", ""]
    return "\n".join(lines)
