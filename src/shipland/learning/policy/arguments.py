"""What `shipland learn` takes; light to import, so that the command line starts at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from shipland.learning.arguments import at_least, positive


@dataclass(frozen=True)
class LearnArguments:
    """Train a policy for the last metres.

    Attributes:
        out: folder for the checkpoint, curves, the policy (.onnx) and its model card.
        kind: `residual`: a bounded addition to the command of the pilot `horizon`; `direct`: the command itself.
        scenario: as in `shipland fly`; several with commas between, which the environments take in turn.
        changes: one value laid over every scenario; may be given again and again.
        environments: flights at once; default one a scenario.
        parallel: each environment in a process of its own.
        minutes: stop in order after so long.
        steps: stop after so many steps of all environments; default until the time is up.
        bound_mps2: acceleration that an action of 1 stands for; default 0.5 residual, 4 direct.
        hidden: units of each of the network's two hidden layers.
        rate: of learning.
        batch: transitions an update; one update for a step of all environments.
        flights: of an evaluation; what is exported did best in one, and is the pilot alone if nothing did better.
        seed: of flights and first weights; the same seed and steps give the same policy.
        resume: go on from the checkpoint in `out`.
    """

    out: Path
    kind: Literal["residual", "direct"] = "residual"
    scenario: str = "rig-natops,ship-sea6,ship-sea5"
    changes: Annotated[tuple[str, ...], tyro.conf.arg(name="set", metavar="KEY=VALUE"), tyro.conf.UseAppendAction] = (
        "wind.mean_mps=6",
        "wind.mean_half_range_mps=4",
    )
    environments: int | None = None
    parallel: bool = False
    minutes: float = 240.0
    steps: int | None = None
    bound_mps2: float | None = None
    hidden: int = 64
    rate: float = 3e-4
    batch: int = 256
    flights: int = 90
    seed: int = 1
    resume: bool = False

    def __post_init__(self) -> None:
        positive(minutes=self.minutes, rate=self.rate)
        at_least(0, seed=self.seed)
        at_least(1, batch=self.batch, hidden=self.hidden, flights=self.flights)
        at_least(1, environments=self.environments, steps=self.steps)

    @property
    def bound(self) -> float:
        """`bound_mps2`, or its default."""
        from shipland.guidance.horizon.steering import default_bound_mps2  # imports NumPy

        return default_bound_mps2(self.kind) if self.bound_mps2 is None else self.bound_mps2
