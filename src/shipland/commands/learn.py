"""`shipland learn`: a policy for the last metres, from nothing."""

from __future__ import annotations

from dataclasses import dataclass

from shipland.commands.options import names_of
from shipland.errors import DataError
from shipland.learning.policy.arguments import LearnArguments


@dataclass(frozen=True)
class Learn(LearnArguments):
    """Train a policy for the last metres by TD3 in the simulator (needs the extra `learn`).

    Leaves policy.onnx, model-card.md, curves.csv and .png, and a checkpoint in the output folder. Ctrl-C exports the
    best policy so far; `--resume` goes on. A policy flies in the simulator, or on a vehicle whose sticks mean a tilt,
    behind the same safety as every pilot, and gives way to `horizon` when it fails.

    Example: shipland learn --kind residual --minutes 240 --out out/residual

    Example: shipland fly --pilot residual --set guidance.learned.residual=out/residual/policy.onnx
        --scenario rig-natops --vision geometric --out out/flown
    """

    def run(self) -> int:
        """Train and export."""
        try:
            from shipland.learning.policy.train import learn
        except ModuleNotFoundError as error:
            raise DataError(f"training needs {error.name}; install it with: pip install 'shipland[learn]'") from None
        from shipland.environments.last_phase import last_phases

        scenarios = names_of("scenario", self.scenario)
        count = self.environments or len(scenarios)
        print(learn(self, last_phases(scenarios, self.changes, self.kind, self.bound, count)))
        return 0
