"""What `shipland learn` takes; light to import, so that the command line starts at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from shipland.errors import ConfigError


@dataclass(frozen=True)
class LearnArguments:
    """Train a policy by gradients through the batched last phase.

    Attributes:
        out: folder for checkpoints, curves, the policy (.onnx) and its model card.
        kind: `residual`: a bounded addition to the command of the pilot `horizon`; `direct`: the command itself.
        scenario: packaged scenarios, or TOML files, that the flights are drawn from in turn.
        minutes: stop in order after so long; the learning rate falls accordingly.
        steps: stop after so many steps; default until the time is up.
        batch: flights a step.
        seconds: that a flight lasts at most.
        hidden: units of each of the network's two hidden layers.
        rate: of learning, at first.
        bound_mps2: acceleration that an action of 1 stands for; default 0.5 residual, 4 direct.
        airframe: share by which aircraft differ, either way.
        latency_s: by how much pictures may be older than they say, or younger.
        wind_mps: lowest and highest mean wind.
        wake: let the superstructure's wake blow where the scenario has it.
        seed: of flights and first weights; the same seed and steps give the same policy.
        resume: go on from the last checkpoint in `out`.
        evaluate_every: steps between evaluations.
        flights: that an evaluation flies, with and without the policy.
    """

    out: Path
    kind: Literal["residual", "direct"] = "residual"
    scenario: tuple[str, ...] = ("rig-natops", "ship-sea6")
    minutes: float = 8.0
    steps: int | None = None
    batch: int = 384
    seconds: float = 12.0
    hidden: int = 64
    rate: float = 2e-3
    bound_mps2: float | None = None
    airframe: float = 0.3
    latency_s: float = 0.02
    wind_mps: tuple[float, float] = (0.0, 9.0)
    wake: bool = True
    seed: int = 1
    resume: bool = False
    evaluate_every: int = 20
    flights: int = 512

    def __post_init__(self) -> None:
        if not self.scenario:
            raise ConfigError("give at least one scenario")
        for name in ("minutes", "seconds", "rate"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive, got {getattr(self, name):g}")
        for name in ("batch", "hidden", "evaluate_every", "flights", "steps"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ConfigError(f"{name} must be at least 1, got {value}")
        if self.seed < 0:
            raise ConfigError(f"a seed must be 0 or more, got {self.seed}")

    @property
    def bound(self) -> float:
        """`bound_mps2`, or its default."""
        if self.bound_mps2 is not None:
            return self.bound_mps2
        return 0.5 if self.kind == "residual" else 4.0
