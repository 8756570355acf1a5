"""The second stage: which quadrilateral of the picture is which of the cue, by geometry or by the last pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

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
    turned, fits = _turned(quads_px, plane_m)
    allowed = fits >= np.cos(max_roll_rad)
    count, models = len(quads_px), len(plane_m)
    if models == 1:
        return [Match((0,), turned[c, 0][None], (int(c),)) for c in np.flatnonzero(allowed[:, 0])]
    frame = _affine(turned, plane_m)
    corners = plane_m.shape[1]
    model_centre = plane_m.sum(axis=1) / corners
    apart_m = model_centre[None] - model_centre[:, None]
    centre = quads_px.sum(axis=1) / corners
    # Differences of points as complex numbers.
    apart_px = _complex(frame @ apart_m.transpose(0, 2, 1)[None])
    reach = np.maximum(np.abs(apart_px), 1.0)[..., None]
    column, row = centre.T
    place = column + 1j * row
    off = np.abs((place[:, None, None] + apart_px)[..., None] - place) / reach
    stretch = np.abs(frame[..., 0, 0] * frame[..., 1, 1] - frame[..., 0, 1] * frame[..., 1, 0])
    expected = np.maximum(stretch[:, :, None] * np.abs(_area(plane_m)), 1e-9)
    ratio = np.abs(_area(quads_px)) / expected[..., None]
    fitting = (off <= _PLACE_TOLERANCE) & (ratio < _SIZE_RATIO) & (ratio > 1.0 / _SIZE_RATIO) & allowed.T
    score = np.where(fitting, off, np.inf)
    matches: dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[int, float, Match]] = {}
    for seed in range(count):
        for model in range(models):
            if not allowed[seed, model]:
                continue
            row = score[seed, model].copy()
            row[:, seed] = np.inf
            row[model] = np.inf
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
    # Mean square distance of corners from predicted ones, for each of the four ways to count them.
    turns = _turns(quads_px.shape[1])
    off = quads_px[:, None, turns] - predicted_px[None, :, None]
    off = off.reshape(len(quads_px), len(predicted_px), len(turns), -1)
    off2 = np.einsum("mnrs,mnrs->mnr", off, off)
    best = off2.argmin(axis=2)
    score = off2.min(axis=2) / (len(turns) * np.maximum(_area(predicted_px), 1.0))
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
    index = np.array(chosen)
    return Match(order, quads_px[index[:, None], turns[best[index, np.array(order)]]], chosen)


def _turned(quads_px: Array, plane: Array) -> tuple[Array, Array]:
    """Each picture quadrilateral with its corners in each model's order (m,n,4,2), and the cosine of what is left."""
    starts = quads_px[:, _turns(quads_px.shape[1])]
    edges, model_edges = _directions(starts), _directions(plane)
    fit = np.einsum("mrsa,nsa->mnr", edges, model_edges) / quads_px.shape[1]
    best = fit.argmax(axis=2)
    return starts[np.arange(len(quads_px))[:, None], best], fit.max(axis=2)


def _directions(quads: Array) -> Array:
    """Unit vectors (…,4,2) along the sides of quadrilaterals (…,4,2)."""
    sides = np.roll(quads, -1, axis=-2) - quads
    lengths = np.sqrt(np.einsum("...a,...a->...", sides, sides))
    return np.asarray(sides / np.maximum(lengths, 1e-9)[..., None])


def _complex(vectors: Array) -> npt.NDArray[np.complex128]:
    """Vectors (…,2,n) as complex numbers (…,n)."""
    return np.asarray(vectors[..., 0, :] + 1j * vectors[..., 1, :])


def _affine(turned: Array, plane_m: Array) -> Array:
    """(m,n,2,2) px/m: the least-squares parallelogram of each quadrilateral over each model's."""
    model = plane_m - plane_m.mean(axis=1, keepdims=True)
    (xx, xy), (_, yy) = np.einsum("nsa,nsb->abn", model, model)
    inverse = np.array([[yy, -xy], [-xy, xx]]).transpose(2, 0, 1) / (xx * yy - xy * xy)[:, None, None]
    return np.asarray(turned.transpose(0, 1, 3, 2) @ (model @ inverse))


def _area(quads: Array) -> Array:
    """Signed areas (…,) of quadrilaterals (…,4,2)."""
    after = np.roll(quads, -1, axis=-2)
    return 0.5 * np.asarray((quads[..., 0] * after[..., 1] - quads[..., 1] * after[..., 0]).sum(axis=-1))


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
