"""What `shipland learn` leaves: the policy, curves as table and picture, and a model card."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from shipland.figures import drawn
from shipland.files import write_atomically
from shipland.guidance.horizon.steering import Action
from shipland.learning.policy.arguments import LearnArguments
from shipland.learning.policy.export import Dense, write_policy

History = Sequence[Mapping[str, float]]


def write_results(
    arguments: LearnArguments, layers: Sequence[Dense], action: Action, progress: Mapping[str, Any]
) -> Path:
    """Write `policy.onnx`, `curves.csv`, `curves.png` and `model-card.md`; the first one's path.

    Args:
        arguments: of the command.
        layers: of the best actor.
        action: what its action means.
        progress: of the run, as `train.Progress`.
    """
    out, history = arguments.out, progress["history"]
    policy = out / "policy.onnx"
    write_policy(policy, layers, action, f"shipland learn, {arguments.kind}, step {progress['best_step']}")
    write_atomically(out / "curves.csv", _table(history).encode())
    plot_curves(out / "curves.png", history)
    write_atomically(out / "model-card.md", _card(arguments, action, progress).encode())
    return policy


def _table(history: History) -> str:
    stream = io.StringIO()
    if history:
        writer = csv.DictWriter(stream, list(history[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(history)
    return stream.getvalue()


def plot_curves(path: Path, history: History) -> None:
    """Return and success over the steps, as a picture."""
    with drawn(path, (9.0, 3.6), 110) as figure:
        left, right = figure.subplots(1, 2)
        step = [row["step"] for row in history]
        left.plot(step, [row["return"] for row in history], label="last training flights")
        evaluated = [(row["step"], row["evaluated"]) for row in history if math.isfinite(row["evaluated"])]
        left.plot([at for at, _ in evaluated], [value for _, value in evaluated], "o", label="evaluations")
        left.set(xlabel="step", ylabel="mean return")
        left.legend(frameon=False)
        right.plot(step, [100.0 * row["success"] for row in history])
        right.set(xlabel="step", ylabel="success [%]", ylim=(0.0, 100.0))


def _card(arguments: LearnArguments, action: Action, progress: Mapping[str, Any]) -> str:
    settings = {name: value for name, value in asdict(arguments).items() if name not in ("out", "resume")}
    meaning = "added to the pilot's own input" if action.kind == "residual" else "the input itself"
    lines = [
        f"# Policy: {action.kind}",
        "",
        f"- Action: two accelerations of at most {action.bound_mps2:g} m/s², {meaning}; within "
        f"{action.reach_m:g} m of the landing point, on vehicles whose sticks mean a tilt",
        f"- Training: TD3 in the simulator, {progress['step']} steps, {progress['flown']} flights, "
        f"{progress['updates']} updates in {progress['seconds'] / 60.0:.1f} minutes; these weights are of step "
        f"{progress['best_step']}",
        f"- Settings: `{json.dumps(settings)}`",
        f"- Evaluation: mean return {progress['best']:.2f} of {arguments.flights} flights; a campaign flies others",
        "",
    ]
    return "\n".join(lines)
