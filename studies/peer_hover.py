"""Other quadrotor simulators in a hover, in environments of their own: `studies/peer_hover.py rotorpy` prints rates.

Steps, and simulated seconds, in a second of one core, as JSON. shipland is not imported: `make peers` makes the
environments, studies/speed_peers.py asks.
"""

from __future__ import annotations

import json
import os
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


def crazyflow_rate(drones: int, seconds: float) -> Rate:
    """Crazyflow's Sim, all drones in one call: a hover under its state controller, a set-point 30 times a second."""
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    import jax
    import numpy as np
    from crazyflow.sim import Sim

    sim = Sim(n_worlds=drones, control="state")
    set_points = np.zeros((drones, 1, 16))
    set_points[..., 2], set_points[..., 12] = 0.5, 1.0  # height, and w of the attitude
    sim.reset()
    steps = sim.freq // 30

    def hover(calls: int) -> None:
        for _ in range(calls):
            sim.state_control(set_points)
            sim.step(steps)
        jax.block_until_ready(sim.data)

    hover(2)
    calls, started_s = round(seconds * sim.freq / steps), time.process_time()
    hover(calls)
    spent_s = time.process_time() - started_s
    done = drones * calls * steps
    return done / spent_s, done / sim.freq / spent_s


RATES = {
    "rotorpy": rotorpy_rate,
    "pyflyt": pyflyt_rate,
    "crazyflow": lambda: crazyflow_rate(1, HOVER_S),
    "crazyflow-1000": lambda: crazyflow_rate(1000, 2.0),
}

if __name__ == "__main__":
    print(json.dumps(RATES[sys.argv[1]]()))
