"""Anchors fitted to a set: k-means of the targets' sizes, as [YOLOv3, §2.3] took them from COCO."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipland.errors import DataError

Anchors = tuple[tuple[tuple[float, float], ...], ...]


def fit_anchors(sizes_px: npt.NDArray[np.floating], seed: int) -> Anchors:
    """Nine anchors, three a scale, smallest first.

    Clusters are sought in the logarithm of width and height, so that a ratio counts alike at 5 px and at 200 px.

    Args:
        sizes_px: (n,2) width and height of targets as the network will see them [px].
        seed: of the first centres.
    """
    from scipy.cluster.vq import kmeans2

    sizes = np.asarray(sizes_px, dtype=float).reshape(-1, 2)
    sizes = sizes[(sizes > 0.5).all(axis=1)]
    if len(sizes) == 0:
        raise DataError("no target to fit anchors to; does the data set hold only empty pictures?")
    logs = np.log(sizes)
    if len(np.unique(logs.round(6), axis=0)) < 9:
        # Too few different sizes for nine clusters: spread them around what there is.
        rng = np.random.default_rng(seed)
        logs = np.concatenate([logs, logs[rng.integers(len(logs), size=90)] + rng.normal(0.0, 0.25, (90, 2))])
    quantiles = np.argsort(logs.sum(axis=1))[np.linspace(0, len(logs) - 1, 11).round().astype(int)[1:-1]]
    centres, _ = kmeans2(logs, logs[quantiles], iter=50, minit="matrix", seed=seed, missing="warn")
    ordered = np.exp(centres[np.argsort(centres.sum(axis=1))]).round(1).tolist()
    return tuple(tuple((w, h) for w, h in ordered[3 * scale : 3 * scale + 3]) for scale in range(3))
