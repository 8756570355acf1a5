"""`shipland learn`: a policy for the last metres, from nothing."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.errors import DataError
from shipland.learning.policy.arguments import LearnArguments


@dataclass(frozen=True)
class Learn(LearnArguments):
    """Train a policy for the last metres by gradients through a batched model of them (needs the extra `train`).

    Leaves policy.onnx, model-card.md and .json, curves.csv and .png, and checkpoints in the output folder. Ctrl-C keeps
    the last checkpoint; `--resume` continues from it. A policy flies in the simulator, or on a vehicle whose sticks
    mean a tilt, behind the same safety as every pilot, and gives way to `horizon` when it fails.

    Example: shipland learn --kind residual --minutes 8 --out out/residual

    Example: shipland fly --pilot residual --set guidance.learned.residual=out/residual/policy.onnx
        --scenario rig-natops --vision geometric --out out/flown
    """

    def run(self) -> int:
        """Train, evaluate, export."""
        from shipland.scenario.last_phase import last_phase_of
        from shipland.scenario.scenario import load_scenario

        setups = [last_phase_of(load_scenario(name)) for name in self.scenario]
        try:
            from shipland.learning.policy.train import learn
        except ModuleNotFoundError as error:
            raise DataError(f"training needs {error.name}; install it with: pip install 'shipland[train]'") from None
        print(learn(self, setups))
        return 0
