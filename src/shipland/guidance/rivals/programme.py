"""The quadratic programme of model predictive control on one axis, solved by OSQP.

[Stellato2020] Stellato et al.: OSQP: an operator splitting solver for quadratic programs, Math. Prog. Comp. 12.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse

from shipland.frames import Array
from shipland.guidance.laws import clamp
from shipland.guidance.parameters import SpectralMpcParameters

STEP_S, STEPS = 0.1, 20
"""Of the horizon."""
_TICK_S = 1e-3
"""To which steps are rounded, so that their transitions are found once."""
_LEAD_S = 0.7
"""Travel at the limit of the speed by which the place aimed at leads, at most, and grows over the horizon."""


class Axis:
    """The programme of one axis over the inputs of the horizon: minimise ½ uᵀPu + qᵀu, limits on u and on the speed.

    State: place, speed, acceleration. acceleration' = (servo (u - speed) - acceleration) / lag, and where `servo_per_s`
    is 0 (u - acceleration) / lag; speed' = acceleration - drag speed + disturbance.

    Args:
        servo_per_s, lag_s, drag_per_s: of the model.
        most_input: limit of the input.
        parameters: weights, and the limit of the speed.
    """

    def __init__(
        self, servo_per_s: float, lag_s: float, drag_per_s: float, most_input: float, parameters: SpectralMpcParameters
    ) -> None:
        import osqp

        self._most_input, self._most_mps, self._step_weight = most_input, parameters.most_mps, parameters.step_weight
        rates = np.zeros((5, 5))  # place, speed, acceleration; input; disturbance
        rates[0, 1] = rates[1, 2] = rates[1, 4] = 1.0
        rates[1, 1], rates[2, 1:4] = -drag_per_s, np.array([-servo_per_s, -1.0, servo_per_s or 1.0]) / lag_s
        self._rates, self._steps = rates, dict[int, Array]()
        step = linalg.expm(STEP_S * rates)
        free, forced, power = [], np.zeros((STEPS, STEPS, 2)), [np.eye(3)]
        for _ in range(STEPS):
            power.append(step[:3, :3] @ power[-1])
        pushed = np.zeros(3)
        for k in range(STEPS):
            pushed = step[:3, :3] @ pushed + step[:3, 4]
            free.append(np.column_stack([power[k + 1], pushed])[:2])
            for i in range(k + 1):
                forced[k, i] = (power[k - i] @ step[:3, 3])[:2]
        self._free = np.array(free)
        self._places, self._speeds = forced[:, :, 0], forced[:, :, 1]
        change = np.eye(STEPS) - np.eye(STEPS, k=-1)
        self._weights = parameters.error_weight, parameters.speed_weight
        cost = (
            self._weights[0] * self._places.T @ self._places
            + self._weights[1] * self._speeds.T @ self._speeds
            + self._step_weight * change.T @ change
        )
        bounds = np.ones(2 * STEPS)
        self._solver = osqp.OSQP()
        self._solver.setup(
            sparse.csc_matrix(np.triu(cost)),
            np.zeros(STEPS),
            sparse.csc_matrix(np.vstack([np.eye(STEPS), self._speeds])),
            -bounds,
            bounds,
            verbose=False,
            adaptive_rho=False,  # its default times itself: the same flight would not be the same
            warm_starting=False,
            max_iter=2000,
            eps_abs=1e-3,
            eps_rel=1e-3,
        )

    def input(self, state: Array, disturbance: float, target: Array, before: float) -> float | None:
        """The first input of the horizon; None where the programme is not solved.

        Args:
            state: (3,) place [m], speed [m/s], acceleration [m/s²].
            disturbance: acceleration that nothing explains [m/s²].
            target: (STEPS, 2) place and speed at the end of each step.
            before: the input that is flown now.
        """
        free = self._free @ np.append(state, disturbance)
        far_m = float(target[0, 0] - state[0])
        beyond_m = np.maximum(abs(far_m) - self._most_mps * (_LEAD_S + STEP_S * np.arange(1.0, STEPS + 1.0)), 0.0)
        short = free - target
        short[:, 0] += np.copysign(beyond_m, far_m)
        slope = self._weights[0] * short[:, 0] @ self._places + self._weights[1] * short[:, 1] @ self._speeds
        slope[0] -= self._step_weight * before
        # Faster than the limit already, it is given no more than that: a programme without a solution helps nobody.
        most_mps = np.maximum(self._most_mps, np.abs(short[:, 1]).max() + 0.1)
        limits = np.full(STEPS, self._most_input)
        high = np.concatenate([limits, target[:, 1] + most_mps - free[:, 1]])
        low = np.concatenate([-limits, target[:, 1] - most_mps - free[:, 1]])
        if not (np.isfinite(slope).all() and np.isfinite(high).all()):
            return None
        self._solver.update(q=slope, l=low, u=high)
        found = self._solver.solve(raise_error=False)
        usable = found.info.status_val in (1, 2) and np.isfinite(found.x).all()  # solved, or nearly
        return clamp(float(found.x[0]), self._most_input) if usable else None

    def after(self, state: Array, disturbance: float, given: float, step_s: float) -> Array:
        """(3,) state after a step with one input, to the millisecond."""
        whole = np.array([*state.tolist(), given, disturbance])
        ticks = round(step_s / _TICK_S)
        if ticks not in self._steps:
            self._steps[ticks] = linalg.expm(ticks * _TICK_S * self._rates)
        return np.asarray((self._steps[ticks] @ whole)[:3])
