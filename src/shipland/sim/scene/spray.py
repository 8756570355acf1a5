"""Spray that the waves throw up along the hull: puffs of mist and drops on ballistic ways."""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt

from shipland.frames import GRAVITY_MPS2, Array, Pose
from shipland.rig import Solid
from shipland.sim.scene import gl as scene_gl

_EMITTERS = 14
_PUFFS, _DROPS = 16, 40
_LIFE_S = 0.9
_REACH_M = 1.3
_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]], float)


class Spray:
    """Bursts at fixed points of the waterline of a hull's box in `ship`, each with its own period.

    `strength`, 0 … 1, is the opacity and height of the bursts.
    """

    def __init__(self, context: moderngl.Context, hull: Solid, strength: float, rng: np.random.Generator) -> None:
        self._hull, self._strength = hull, strength
        self._key = int(rng.integers(2**63))  # with a burst's number it seeds the burst: a function of time alone
        low, high = np.array(hull.low_m), np.array(hull.high_m)
        along = rng.random(_EMITTERS)
        side = np.where(np.arange(_EMITTERS) % 2 == 0, low[1], high[1])
        self._feet = np.column_stack([low[0] + along * (high[0] - low[0]), side, np.full(_EMITTERS, high[2])])
        for index in range(4):  # some at the stern, where the approach looks
            self._feet[index] = low[0], low[1] + (index + 0.5) / 4.0 * (high[1] - low[1]), high[2]
        self._outward = np.sign(self._feet[:, 1:2]) * [[0.0, 1.0, 0.0]]
        self._outward[:4] = [-1.0, 0.0, 0.0]
        self._period_s = rng.uniform(1.2, 3.0, _EMITTERS)
        self._phase = rng.random(_EMITTERS)
        most = _EMITTERS * (_PUFFS + _DROPS) * 6
        self._buffer = context.buffer(reserve=most * 24, dynamic=True)
        self._program = scene_gl.program(context, "spray.vert", ("spray.frag",))
        self._vertices = context.vertex_array(self._program, [(self._buffer, "4f 2f", "in_position", "in_corner")])
        self._context = context

    @property
    def bounds(self) -> Solid:
        """Box in `ship` that holds the spray."""
        low, high = self._hull.low_m, self._hull.high_m
        return Solid((low[0] - _REACH_M, low[1] - _REACH_M, high[2] - _REACH_M), (high[0], high[1] + _REACH_M, high[2]))

    def draw(self, t_s: float, ned_from_ship: Pose, eye: Pose) -> None:
        """Blend the puffs over the bound target, hidden by what stands before them."""
        data = self._puffs(t_s, ned_from_ship, eye)
        if not len(data):
            return
        self._buffer.write(data.tobytes())
        self._context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        scene_gl.write_depth(self._context, False)
        self._vertices.render(vertices=len(data))
        scene_gl.write_depth(self._context, True)
        self._context.enable_only(moderngl.NOTHING)

    def _puffs(self, t_s: float, ned_from_ship: Pose, eye: Pose) -> npt.NDArray[np.float32]:
        places: list[Array] = []
        for index in range(_EMITTERS):
            cycle, share = divmod(t_s / self._period_s[index] + self._phase[index], 1.0)
            age_s = share * self._period_s[index]
            if age_s > _LIFE_S:
                continue
            rng = np.random.default_rng([self._key, index, int(cycle) & 0x7FFFFFFF])
            count = _PUFFS + _DROPS
            power = self._strength * rng.uniform(0.3, 1.0)
            speed = np.clip(rng.normal(0.0, 0.25, (count, 3)), -0.6, 0.6)
            speed[:, 2] = -rng.uniform(0.8, 2.6, count) * (0.4 + 0.6 * power)
            speed += self._outward[index] * rng.uniform(0.1, 0.5, (count, 1))
            foot = self._feet[index] + rng.normal(0.0, 0.08, (count, 3)) * [1.0, 1.0, 0.0]
            at = foot + speed * age_s
            at[:, 2] += 0.5 * GRAVITY_MPS2 * age_s**2 * np.where(np.arange(count) < _PUFFS, 0.45, 1.0)
            mist = np.arange(count) < _PUFFS
            size = np.where(mist, 0.06 + 0.13 * age_s, 0.007 + 0.010 * rng.random(count))
            fade = 1.0 - age_s / _LIFE_S
            opacity = power * fade * np.where(mist, 0.6, 0.95)
            places.append(np.column_stack([at, size, opacity])[at[:, 2] < self._feet[index, 2] + 0.02])
        if not places:
            return np.zeros((0, 6), np.float32)
        puffs = np.concatenate(places)
        centre = ned_from_ship.apply(puffs[:, :3]) - eye.translation_m
        right, down = eye.rotation[:, 0], eye.rotation[:, 1]
        span = _CORNERS[:, :1] * right + _CORNERS[:, 1:] * down
        corners = centre[:, None, :] + puffs[:, 3, None, None] * span
        data = np.empty((len(puffs), 6, 6), np.float32)
        data[..., :3], data[..., 3], data[..., 4:] = corners, puffs[:, 4:5], _CORNERS
        return data.reshape(-1, 6)
