"""The second stage: which quadrilateral of the picture is which of the cue, by geometry or by the last pose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from shipland.compiled import compiled
from shipland.frames import Array

_PLACE_TOLERANCE = 0.6
"""How far a neighbour may lie from where one quadrilateral's affine frame puts it, as a fraction of its distance.
Perspective alone reaches 0.3 for the rig's bar at 2 m and 40° off."""

_SIZE_RATIO = 5.0
"""Largest ratio of a neighbour's area to the one predicted."""

_APART = 0.7
"""How far corners may lie from where the last pose predicts them, in square roots of their quadrilateral's area."""

_MOST = 24
"""Hypotheses that are looked at."""

_MOST_FITTED = 200
"""Hypotheses that are compared by how well they fit."""

_MOST_MISFIT = 0.13
"""Largest misfit of a hypothesis to any view of the cue, as a share of its extent: two hidden
corners leave 0.12."""


@dataclass(frozen=True)
class Match:
    """A hypothesis: quadrilaterals of the picture for quadrilaterals of the cue.

    Attributes:
        model: indices into the cue's quadrilaterals, rising.
        quads_px: (k,4,2) their corners in the picture, in the cue's order of corners.
        candidates: indices into the picture's quadrilaterals.
    """

    model: tuple[int, ...]
    quads_px: Array
    candidates: tuple[int, ...]


@lru_cache(maxsize=8)
def _turns(count: int) -> npt.NDArray[np.intp]:
    """(count,count) the ways to count a polygon's corners clockwise."""
    return np.add.outer(np.arange(count), np.arange(count)) % count


def match_by_geometry(quads_px: Array, plane_m: Array, max_roll_rad: float) -> list[Match]:
    """Hypotheses, those with most quadrilaterals first, then the best fitting.

    Each quadrilateral of the picture is tried as each of the cue; its affine frame predicts the others.

    Args:
        quads_px: (m,4,2) clockwise corners found, starting anywhere.
        plane_m: (n,4,2) the cue.
        max_roll_rad: largest roll of the camera against the cue; it settles which corner is the first.
    """
    if not len(quads_px):
        return []
    count, (models, corners) = len(quads_px), plane_m.shape[:2]
    first, allowed = np.empty((count, models), np.int64), np.empty((count, models), np.bool_)
    score = np.empty((count, models, models, count))
    _turn(quads_px, plane_m, math.cos(max_roll_rad), first, allowed)
    turned = quads_px[np.arange(count)[:, None, None], _turns(corners)[first]]
    if models == 1:
        return [Match((0,), turned[c, 0][None], (int(c),)) for c in np.flatnonzero(allowed[:, 0])]
    _score(quads_px, turned, plane_m, allowed, score)
    matches: dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[int, float, Match]] = {}
    for seed in range(count):
        for model in range(models):
            if not allowed[seed, model]:
                continue
            row = score[seed, model]
            for others in _alternatives(row):
                members = {model: seed} | others
                if len(set(members.values())) < len(members):
                    continue
                order = tuple(sorted(members))
                chosen = tuple(members[i] for i in order)
                quality = float(sum(row[i, c] for i, c in others.items())) / max(len(others), 1)
                key = (order, chosen)
                if key not in matches or quality < matches[key][1]:
                    quads = np.stack([turned[c, i] for i, c in zip(order, chosen, strict=True)])
                    matches[key] = (len(order), quality, Match(order, quads, chosen))
    ranked = [match for _, _, match in sorted(matches.values(), key=lambda item: (-item[0], item[1]))[:_MOST_FITTED]]
    misfits = _misfits(ranked, plane_m)
    likely = [index for index in range(len(ranked)) if misfits[index] <= _MOST_MISFIT]
    return [ranked[i] for i in sorted(likely, key=lambda i: (-len(ranked[i].model), misfits[i]))[:_MOST]]


def _misfits(matches: list[Match], plane_m: Array) -> Array:
    """How far the corners of each hypothesis are from a perspective view of the cue, as a share of their extent.

    The least singular value of the homography's equations, in coordinates of unit size. A hypothesis that has none to
    be compared with gets 0.
    """
    misfits = np.zeros(len(matches))
    for size in {len(match.model) for match in matches if len(match.model) > 1}:
        some = [index for index, match in enumerate(matches) if len(match.model) == size]
        if len(some) == 1:
            continue
        x, y = _unit(np.stack([plane_m[list(matches[i].model)] for i in some]).reshape(len(some), -1, 2))
        u, v = _unit(np.stack([matches[i].quads_px for i in some]).reshape(len(some), -1, 2))
        one, none = np.ones_like(x), np.zeros_like(x)
        rows = np.stack([x, y, one, none, none, none, -u * x, -u * y, -u], axis=-1)
        more = np.stack([none, none, none, x, y, one, -v * x, -v * y, -v], axis=-1)
        equations = np.concatenate([rows, more], axis=1)
        values = np.linalg.eigvalsh(equations.transpose(0, 2, 1) @ equations)
        misfits[some] = np.sqrt(np.maximum(values[:, 0], 0.0) / x.shape[1])
    return misfits


def _unit(points: Array) -> tuple[Array, Array]:
    """Points (h,n,2) about their mean, in units of their spread."""
    points = points - points.mean(axis=1, keepdims=True)
    points /= np.maximum(np.sqrt((points**2).mean(axis=(1, 2), keepdims=True)), 1e-9)
    return points[..., 0], points[..., 1]


def match_by_prediction(quads_px: Array, predicted_px: Array) -> Match | None:
    """The quadrilaterals that lie where the last pose predicts those of the cue; None when there are none.

    Args:
        quads_px: (m,4,2) found.
        predicted_px: (n,4,2) predicted, in the cue's order of corners.
    """
    if not len(quads_px):
        return None
    score = np.empty((len(quads_px), len(predicted_px)))
    first = np.empty(score.shape, np.int64)
    _compare(quads_px, predicted_px, score, first)
    near = sorted(
        (value, model, candidate)
        for candidate, row in enumerate(score.tolist())
        for model, value in enumerate(row)
        if value < _APART**2
    )
    members: dict[int, int] = {}
    for _, model, candidate in near:
        if model not in members and candidate not in members.values():
            members[model] = candidate
    if not members:
        return None
    order = tuple(sorted(members))
    chosen = tuple(members[i] for i in order)
    index, turns = np.array(chosen), _turns(quads_px.shape[1])
    return Match(order, quads_px[index[:, None], turns[first[index, np.array(order)]]], chosen)


@compiled
def _compare(quads_px: Array, predicted_px: Array, score: Array, first: npt.NDArray[np.int64]) -> None:
    """Write the mean square distance (m,n) of corners from predicted ones, over the area; and which corner is first."""
    corners = quads_px.shape[1]
    for model in range(len(predicted_px)):
        predicted, (_, _, area_px2) = predicted_px[model], _centre(predicted_px[model])
        for candidate in range(len(quads_px)):
            least = math.inf
            for start in range(corners):
                off2 = 0.0
                for corner in range(corners):
                    for axis in range(2):
                        off = quads_px[candidate, (start + corner) % corners, axis] - predicted[corner, axis]
                        off2 += off * off
                if off2 < least:
                    least, first[candidate, model] = off2, start
            score[candidate, model] = least / (corners * max(area_px2, 1.0))


@compiled
def _turn(
    quads_px: Array,
    plane_m: Array,
    least_cosine: float,
    first: npt.NDArray[np.int64],
    allowed: npt.NDArray[np.bool_],
) -> None:
    """Write which corner (m,n) of each quadrilateral is the first of each model's, and whether what is left is small.

    By the mean cosine between the sides' directions.
    """
    corners = plane_m.shape[1]
    for candidate in range(len(quads_px)):
        for model in range(len(plane_m)):
            best = -math.inf
            for start in range(corners):
                cosine = 0.0
                for corner in range(corners):
                    column, row = _direction(quads_px[candidate], (start + corner) % corners)
                    right, down = _direction(plane_m[model], corner)
                    cosine += (column * right + row * down) / corners
                if cosine > best:
                    best, first[candidate, model] = cosine, start
            allowed[candidate, model] = best >= least_cosine


@compiled
def _direction(polygon: Array, corner: int) -> tuple[float, float]:
    """Unit vector along the side of a polygon (k,2) from a corner on."""
    after = (corner + 1) % len(polygon)
    x, y = polygon[after, 0] - polygon[corner, 0], polygon[after, 1] - polygon[corner, 1]
    length = max(math.sqrt(x * x + y * y), 1e-9)
    return x / length, y / length


@compiled
def _score(quads_px: Array, turned: Array, plane_m: Array, allowed: npt.NDArray[np.bool_], score: Array) -> None:
    """Write how far candidates lie from where a seed, as a model, puts other models (seed,model,other,candidate).

    As a fraction of their distance; infinite where they are too far off, too small or too large, or turned. The seed's
    affine frame is the least-squares parallelogram of it over its model's.
    """
    count, models = allowed.shape
    for seed in range(count):
        seed_x, seed_y, _ = _centre(quads_px[seed])
        for model in range(models):
            right_m, down_m, _ = _centre(plane_m[model])
            xx = xy = yy = column_x = column_y = row_x = row_y = 0.0
            for corner in range(plane_m.shape[1]):
                x, y = plane_m[model, corner, 0] - right_m, plane_m[model, corner, 1] - down_m
                xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
                column, row = turned[seed, model, corner, 0], turned[seed, model, corner, 1]
                column_x, column_y = column_x + column * x, column_y + column * y
                row_x, row_y = row_x + row * x, row_y + row * y
            size = xx * yy - xy * xy
            column_right, column_down = (column_x * yy - column_y * xy) / size, (column_y * xx - column_x * xy) / size
            row_right, row_down = (row_x * yy - row_y * xy) / size, (row_y * xx - row_x * xy) / size
            stretch = abs(column_right * row_down - column_down * row_right)
            for other in range(models):
                other_right_m, other_down_m, area_m2 = _centre(plane_m[other])
                x, y = other_right_m - right_m, other_down_m - down_m
                away_x, away_y = column_right * x + column_down * y, row_right * x + row_down * y
                reach, expected = max(math.hypot(away_x, away_y), 1.0), max(stretch * abs(area_m2), 1e-9)
                for candidate in range(count):
                    place_x, place_y, area_px2 = _centre(quads_px[candidate])
                    off = math.hypot(seed_x + away_x - place_x, seed_y + away_y - place_y) / reach
                    ratio = abs(area_px2) / expected
                    fits = off <= _PLACE_TOLERANCE and 1.0 / _SIZE_RATIO < ratio < _SIZE_RATIO
                    another = allowed[candidate, other] and candidate != seed and other != model
                    score[seed, model, other, candidate] = off if fits and another else math.inf


@compiled
def _centre(polygon: Array) -> tuple[float, float, float]:
    """Mean of the corners of a polygon (k,2), and its signed area."""
    corners, x, y, area = len(polygon), 0.0, 0.0, 0.0
    for corner in range(corners):
        after = (corner + 1) % corners
        x, y = x + polygon[corner, 0], y + polygon[corner, 1]
        area += 0.5 * (polygon[corner, 0] * polygon[after, 1] - polygon[corner, 1] * polygon[after, 0])
    return x / corners, y / corners, area


def _alternatives(row: Array) -> list[dict[int, int]]:
    """Candidates by model for the other models: none, the nearest of each, and these with a runner-up for one model.

    Of a cue of two three runners-up are taken, of a larger one a single runner-up.
    """
    index = [int(i) for i in np.flatnonzero(np.isfinite(row).any(axis=1))]
    if not index:
        return [{}]
    found = [{}, {i: int(np.argmin(row[i])) for i in index}]
    most = 3 if len(index) == 1 else 1
    for i in index:
        runners = np.argsort(row[i])[1 : 1 + most]
        found += [found[1] | {i: int(c)} for c in runners if np.isfinite(row[i, c])]
    return found
