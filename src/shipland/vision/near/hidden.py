"""Sides of the cue that something hides: the others settle the pose.

What a region shows there is not the cue's side. It lies inside of where the cue has its side, and runs otherwise: a cue
of other dimensions has parallel sides.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipland.frames import Array
from shipland.vision.near.segment import edge_distances

if TYPE_CHECKING:
    from shipland.vision.near.edges import MeasuredCorners
    from shipland.vision.near.pose import PoseCandidate

Hidden = npt.NDArray[np.bool_]
"""(n,k) sides of the cue's polygons, each from its corner to the next."""

_LEAST_TURN = math.sin(math.radians(8.0))
"""Sine of the least angle between what is seen and the side that it hides."""

_INSIDE_PX = 2.0
"""How far outside of the cue the middle of what is seen may lie: an oblique line meets the sides beside it beyond
their ends."""

_MOST_HIDDEN = 2
"""Sides of a cue that may be hidden."""

_MOST_LEFT = 2.0
"""Error of the sides left, to first order, over a pixel and what the cue is made to, up to which they are solved."""

_UNKNOWN = 1e-6
"""Weight of a hidden side against a measured one."""


def hidden_sides(candidate: PoseCandidate) -> list[Hidden]:
    """The single side, and the sides, one a polygon, without which the others agree best; none where no telling is.

    To first order about the pose that solves all of them: leaving out some residuals r of a least-squares fit lowers
    the sum of squares by rᵀ (1 − H)⁻¹ r, with H their block of the hat matrix.
    """
    corners_px = candidate.freed_px
    polygons, sides = corners_px.shape[:2]
    if polygons < 2 or candidate.measured.edge_bias_px is None or candidate.measured.held is not None:
        return []
    normal = _normals(corners_px)
    ends = np.stack([np.arange(sides), np.roll(np.arange(sides), -1)], axis=1)
    residual = np.einsum("nsea,nsa->nse", candidate.solutions[0].residual_px[:, ends], normal).reshape(-1)
    jacobian = np.einsum("nsead,nsa->nsed", _jacobian(candidate)[:, ends], normal).reshape(-1, 6)
    hat = np.eye(len(residual)) - jacobian @ np.linalg.pinv(jacobian)
    remains = hat @ residual
    found = []
    extent_px = math.hypot(*np.ptp(corners_px.reshape(-1, 2), axis=0))
    most_px = _MOST_LEFT * (1.0 + candidate.setup.manufacturing_tolerance * extent_px)
    for count in range(1, _MOST_HIDDEN + 1):
        some = np.array(list(itertools.combinations(range(polygons * sides), count)))
        some = some[(np.diff(some // sides, axis=1) > 0).all(axis=1)]
        rows = (2 * some[..., None] + np.arange(2)).reshape(len(some), -1)
        blocks = np.linalg.pinv(hat[rows[:, :, None], rows[:, None]])
        gains = np.einsum("mi,mij,mj->m", remains[rows], blocks, remains[rows])
        left = max(float(remains @ remains - gains.max()), 0.0) / (len(residual) - 2 * count)
        if math.sqrt(2.0 * left) > most_px:
            continue
        hidden = np.zeros(polygons * sides, bool)
        hidden[some[gains.argmax()]] = True
        found.append(hidden.reshape(polygons, sides))
    return found


def cut_sides(candidate: PoseCandidate) -> list[Hidden]:
    """The sides along the picture's edge, which may be the edge's instead of the cue's; none where too few are left.

    Two polygons without one side each still settle the pose with sides to spare.
    """
    held = candidate.measured.held
    return [] if held is None or len(held) < 2 or held.sum(axis=1).max() > 1 else [held]


def without(measured: MeasuredCorners, hidden: Hidden) -> MeasuredCorners:
    """Measured corners whose hidden sides say nothing."""
    rows = np.where(hidden.repeat(2, axis=1), _UNKNOWN, 1.0)
    return replace(measured, whiten=measured.whiten * rows[..., None], hidden=hidden)


def alike(corners_px: Array, noise_px: float, hidden: Hidden | None) -> Array:
    """(n,2k,2k) whitening of corners (n,k,2) whose sides all have the same noise, and of which some are hidden."""
    polygons, sides = corners_px.shape[:2]
    if hidden is None:
        return np.broadcast_to(np.eye(2 * sides) / noise_px, (polygons, 2 * sides, 2 * sides))
    rows = _normals(corners_px) * np.where(hidden, _UNKNOWN, 1.0)[..., None] / noise_px
    whiten = np.zeros((polygons, sides, 2, sides, 2))
    side = np.arange(sides)
    whiten[:, side, 0, side] = rows
    whiten[:, side, 1, np.roll(side, -1)] = rows
    return whiten.reshape(polygons, 2 * sides, 2 * sides)


def seen_error_px(candidate: PoseCandidate) -> float:
    """Root-mean-square distance of corners from reprojected ones, by the sides that are seen."""
    hidden, residual_px = candidate.measured.hidden, candidate.solutions[0].residual_px
    if hidden is None:
        return candidate.solutions[0].reprojection_px
    normal = _normals(candidate.freed_px)
    off_px = np.stack([(residual_px * normal).sum(-1), (np.roll(residual_px, -1, axis=1) * normal).sum(-1)])
    return math.sqrt(2.0 * float(np.mean(off_px[:, ~hidden] ** 2)))


def may_be_hidden(candidate: PoseCandidate) -> bool:
    """Whether what the picture shows of each hidden side lies inside of the cue and runs otherwise than the side."""
    hidden, held = candidate.measured.hidden, candidate.measured.held
    if hidden is None:
        return True
    if held is not None:
        return _beyond_picture(candidate, held)
    seen_px = candidate.freed_px
    predicted_px = seen_px + candidate.solutions[0].residual_px
    normal = _normals(predicted_px)
    outside_px = np.einsum("nsa,nsa->ns", seen_px - predicted_px, normal)
    outside_next_px = np.einsum("nsa,nsa->ns", np.roll(seen_px - predicted_px, -1, axis=1), normal)
    turn = np.abs(np.einsum("nsa,nsa->ns", normal[..., ::-1] * [-1.0, 1.0], _normals(seen_px)))
    inside = 0.5 * (outside_px + outside_next_px) <= _INSIDE_PX
    return bool(np.all((inside & (turn >= _LEAST_TURN))[hidden]))


def _beyond_picture(candidate: PoseCandidate, held: Hidden) -> bool:
    """Whether sides that the picture's edge cuts off lie beyond it by the pose."""
    camera = candidate.setup.camera
    ends_px = candidate.corners_px  # where the pose has them
    outside_px = -edge_distances(ends_px, camera.width_px, camera.height_px).min(axis=-1)
    beside = held | np.roll(held, 1, axis=1)
    return bool(np.all(outside_px[beside] >= -_INSIDE_PX))


def _normals(corners_px: Array) -> Array:
    """(n,k,2) outward unit normals of the sides of clockwise polygons (n,k,2)."""
    side = np.roll(corners_px, -1, axis=1) - corners_px
    return np.asarray(side[..., ::-1] * [1.0, -1.0] / np.maximum(np.hypot(*side.T).T[..., None], 1e-9))


def _jacobian(candidate: PoseCandidate) -> Array:
    """(n,k,2,6) how the corners move in the picture [px] with the pose's rotation vector and translation."""
    pose, setup = candidate.camera_from_plane, candidate.setup
    plane_m = candidate.corners.plane_m
    arms = np.concatenate([plane_m, np.zeros((*plane_m.shape[:2], 1))], axis=2) @ pose.rotation.T
    x, y, z = np.moveaxis(arms + pose.translation_m, -1, 0)
    none = np.zeros_like(x)
    by_place = np.stack(
        [np.stack([1.0 / z, none, -x / z**2], axis=-1), np.stack([none, 1.0 / z, -y / z**2], axis=-1)], axis=-2
    )
    ax, ay, az = np.moveaxis(arms, -1, 0)
    by_turn = np.stack(
        [np.stack([none, az, -ay], -1), np.stack([-az, none, ax], -1), np.stack([ay, -ax, none], -1)], axis=-2
    )
    by_pose = np.concatenate([by_place @ by_turn, by_place], axis=-1)
    return np.asarray(setup.camera.matrix[:2, :2] @ by_pose)
