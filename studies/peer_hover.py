"""Other quadrotor simulators in a hover, in their own environment: `python studies/peer_hover.py rotorpy` prints rates.

Steps, and simulated seconds, in a second of one core, as JSON. shipland is not imported: `make peers` makes the
environment, studies/speed_peers.py asks.
"""

from __future__ import annotations

import json
import sys
import time

HOVER_S = 20.0
Rate = tuple[float, float]


def rotorpy_rate() -> Rate:
    """RotorPy's Environment: a Crazyflie and its SE(3) controller in a hover, as its examples make it."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.environments import Environment
    from rotorpy.trajectories.hover_traj import HoverTraj
    from rotorpy.vehicles.crazyflie_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    def hover(seconds: float) -> None:
        world = Environment(Multirotor(quad_params), SE3Control(quad_params), HoverTraj(), sim_rate=100)
        world.run(t_final=seconds, terminate=None, plot=False, animate_bool=False, verbose=False)

    hover(1.0)
    started_s = time.process_time()
    hover(HOVER_S)
    spent_s = time.process_time() - started_s
    return 100.0 * HOVER_S / spent_s, HOVER_S / spent_s


def pyflyt_rate() -> Rate:
    """PyFlyt's Aviary: its QuadX in a hover under its own position controller, physics at its 240 Hz."""
    import numpy as np
    from PyFlyt.core import Aviary

    env = Aviary(np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3)), drone_type="quadx", seed=1)
    env.set_mode(7)
    env.set_setpoint(0, np.array([0.0, 0.0, 0.0, 1.0]))
    for _ in range(20):
        env.step()
    begun_s, started_s = env.elapsed_time, time.process_time()
    while env.elapsed_time - begun_s < HOVER_S:
        env.step()
    spent_s, simulated_s = time.process_time() - started_s, env.elapsed_time - begun_s
    env.disconnect()
    return env.physics_hz * simulated_s / spent_s, simulated_s / spent_s


if __name__ == "__main__":
    print(json.dumps({"rotorpy": rotorpy_rate, "pyflyt": pyflyt_rate}[sys.argv[1]]()))
