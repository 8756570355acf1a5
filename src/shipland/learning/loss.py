"""The training loss: the anchors, which cells answer for which target, and their targets.

Darknet's assignment [YOLOv3, §2.1]: the one anchor of nine that overlaps a target best, in the one cell that holds its
centre. The wide one, for the wide decoding: every anchor within a ratio of the target's sides, in that cell and its
nearest two neighbours. Boxes are taught by complete IoU [Zheng et al., "Distance-IoU Loss", AAAI 2020] or by squared
errors [YOLOv3, §2.1], objectness by focal cross-entropy [Lin et al., "Focal Loss", ICCV 2017], plain as published with
`focal_power = 0`, over all cells but those that may be right by chance.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn import functional

from shipland.errors import DataError
from shipland.learning.settings import LossParameters
from shipland.vision.far.decode import STRIDES, Decoding, DetectorSpec

Anchors = tuple[tuple[tuple[float, float], ...], ...]


@dataclass(frozen=True)
class Assignment:
    """Answering cells of one scale: index vectors (k,) and targets (k,5) rows (class, centre, size) [px]."""

    picture: Tensor
    anchor: Tensor
    row: Tensor
    column: Tensor
    target: Tensor


def assign(
    targets: Tensor, spec: DetectorSpec, shapes: Sequence[tuple[int, int]], anchor_ratio: float
) -> list[Assignment]:
    """Cells that answer for each target, (m,6) rows (picture, class, centre, size) [px]; `shapes` are of the maps."""
    anchors = torch.tensor(spec.anchors_px, dtype=torch.float32, device=targets.device)  # (3,3,2)
    size = targets[:, None, None, 4:6]
    overlap = torch.minimum(size, anchors).prod(-1)
    likeness = overlap / (size.prod(-1) + anchors.prod(-1) - overlap)  # (m,3,3)
    best = functional.one_hot(likeness.flatten(1).argmax(1), 9).bool().view(-1, 3, 3)
    if spec.decoding is Decoding.WIDE:
        ratio = torch.maximum(size / anchors, anchors / size).amax(-1)
        best = best | (ratio < anchor_ratio)
    assignments = []
    for scale, (stride, (rows, columns)) in enumerate(zip(STRIDES, shapes, strict=True)):
        index, anchor = best[:, scale].nonzero(as_tuple=True)
        place = targets[index, 2:4] / stride
        cell = place.floor()
        cells = [cell]
        if spec.decoding is Decoding.WIDE:
            toward = torch.where(place - cell < 0.5, -1.0, 1.0)
            cells += [cell + toward * torch.tensor(axis, device=cell.device) for axis in ((1.0, 0.0), (0.0, 1.0))]
        for_all = torch.cat(cells)
        inside = (for_all >= 0).all(1) & (for_all[:, 0] < columns) & (for_all[:, 1] < rows)
        index, anchor, for_all = index.repeat(len(cells))[inside], anchor.repeat(len(cells))[inside], for_all[inside]
        column, row = for_all.long().unbind(1)
        assignments.append(Assignment(targets[index, 0].long(), anchor, row, column, targets[index, 1:]))
    return assignments


def decoded_boxes(raw: Tensor, cell: Tensor, anchors: Tensor, stride: int, decoding: Decoding) -> Tensor:
    """Boxes (…,4) rows (centre, size) [px] of raw numbers (…,4), their cells (…,2) and anchors (…,2)."""
    if decoding is Decoding.DARKNET:
        centre = cell + raw[..., :2].sigmoid()
        size = anchors * raw[..., 2:].clamp(-20.0, 20.0).exp()
    else:
        centre = cell + 2.0 * raw[..., :2].sigmoid() - 0.5
        size = anchors * (2.0 * raw[..., 2:].sigmoid()).square()
    return torch.cat([centre * stride, size], -1)


def box_iou(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union of boxes (…,4), broadcast."""
    low = torch.maximum(a[..., :2] - a[..., 2:] / 2, b[..., :2] - b[..., 2:] / 2)
    high = torch.minimum(a[..., :2] + a[..., 2:] / 2, b[..., :2] + b[..., 2:] / 2)
    overlap = (high - low).clamp(min=0).prod(-1)
    return overlap / (a[..., 2:].prod(-1) + b[..., 2:].prod(-1) - overlap + 1e-9)


def complete_iou(a: Tensor, b: Tensor) -> Tensor:
    """IoU less the penalties for distance and for another aspect, boxes (k,4)."""
    iou = box_iou(a, b)
    low = torch.minimum(a[..., :2] - a[..., 2:] / 2, b[..., :2] - b[..., 2:] / 2)
    high = torch.maximum(a[..., :2] + a[..., 2:] / 2, b[..., :2] + b[..., 2:] / 2)
    diagonal = (high - low).square().sum(-1) + 1e-9
    distance = (a[..., :2] - b[..., :2]).square().sum(-1)
    aspect = torch.atan2(a[..., 2], a[..., 3] + 1e-9) - torch.atan2(b[..., 2], b[..., 3] + 1e-9)
    unlike = 4.0 / np.pi**2 * aspect.square()
    with torch.no_grad():
        weight = unlike / (1.0 - iou + unlike + 1e-9)
    return iou - distance / diagonal - weight * unlike


def squared_error(raw: Tensor, cell: Tensor, target: Tensor, anchors: Tensor, stride: int) -> Tensor:
    """Half the squared errors (k,4) of Darknet's decoding [YOLOv3, §2.1]: centre in cells, logarithm of the size.

    Raw numbers (k,4), cells (k,2) (column, row), targets (k,4) rows (centre, size) [px], anchors (k,2) and stride [px].
    """
    centre = raw[:, :2].sigmoid() - (target[:, :2] / stride - cell)
    size = raw[:, 2:] - (target[:, 2:] / anchors).log()
    return 0.5 * torch.cat([centre, size], -1).square()


def detection_loss(
    maps: Sequence[Tensor], targets: Tensor, spec: DetectorSpec, parameters: LossParameters
) -> tuple[Tensor, Tensor]:
    """The loss of a batch: total (), and its parts (3,), box, objectness, class, detached.

    Maps are per scale (n, 3·(5 + classes), rows, columns); targets (m,6) rows (picture, class, centre, size) [px],
    where class -1 marks a box that the loss ignores.
    """
    batch, count = maps[0].shape[0], 5 + len(spec.classes)
    wanted = targets[targets[:, 1] >= 0.0]
    shapes = [(int(item.shape[2]), int(item.shape[3])) for item in maps]
    assignments = assign(wanted, spec, shapes, parameters.anchor_ratio)
    anchors_px = torch.tensor(spec.anchors_px, dtype=torch.float32, device=maps[0].device)
    box_loss, kind_loss = maps[0].new_zeros((), dtype=torch.float32), maps[0].new_zeros((), dtype=torch.float32)
    object_loss, hits = box_loss, 0
    for scale, (raw, work) in enumerate(zip(maps, assignments, strict=True)):
        rows, columns = shapes[scale]
        cells = raw.float().view(batch, 3, count, rows, columns).permute(0, 1, 3, 4, 2)
        goal = torch.zeros_like(cells[..., 4])
        care = _care(cells.detach(), targets, spec, scale, parameters.ignore_iou)
        if len(work.row):
            mine = cells[work.picture, work.anchor, work.row, work.column]
            cell = torch.stack([work.column, work.row], 1).float()
            box, anchors, stride = work.target[:, 1:], anchors_px[scale][work.anchor], STRIDES[scale]
            if parameters.box_error == "squared":
                errors = squared_error(mine[:, :4], cell, box, anchors, stride)
            else:
                errors = 1.0 - complete_iou(decoded_boxes(mine[:, :4], cell, anchors, stride, spec.decoding), box)
            box_loss = box_loss + errors.sum()
            kind = functional.one_hot(work.target[:, 0].long(), len(spec.classes)).float()
            kind_loss = kind_loss + functional.binary_cross_entropy_with_logits(mine[:, 5:], kind, reduction="sum")
            goal[work.picture, work.anchor, work.row, work.column] = 1.0
            care[work.picture, work.anchor, work.row, work.column] = 1.0
            hits += len(work.row)
        logit = cells[..., 4]
        focal = (logit.sigmoid() - goal).abs().pow(parameters.focal_power)  # less where the answer is already right
        entropy = functional.binary_cross_entropy_with_logits(logit, goal, reduction="none")
        object_loss = object_loss + (entropy * focal * care).sum()
    # A batch of empty pictures must not be divided by next to nothing.
    answered = float(max(hits, batch))
    parts = torch.stack([box_loss, object_loss, kind_loss]) / answered
    weights = parts.new_tensor([parameters.box, parameters.objectness, parameters.kind])
    return (parts * weights).sum(), parts.detach()


def _care(cells: Tensor, targets: Tensor, spec: DetectorSpec, scale: int, ignore_iou: float) -> Tensor:
    """(n,3,rows,columns): 0 where a cell without a target is not punished, else 1."""
    batch, _, rows, columns, _ = cells.shape
    care = torch.ones_like(cells[..., 4])
    if not len(targets):
        return care
    stride = STRIDES[scale]
    across, down = (torch.arange(count, device=cells.device) for count in (columns, rows))
    grid = torch.stack(torch.meshgrid(across, down, indexing="xy"), -1).float()
    anchors = torch.tensor(spec.anchors_px[scale], dtype=torch.float32, device=cells.device)[:, None, None, :]
    boxes = decoded_boxes(cells[..., :4], grid, anchors, stride, spec.decoding)
    # Unasked boxes are wiped out to a cell beyond their edge, whatever the cell answers.
    for mine in _by_picture(targets, batch).unbind(1):  # (n,5): one target of each picture, if it has so many
        there = mine[:, None, None, None, :]
        offset = ((grid + 0.5) * stride)[None, None] - there[..., 1:3]
        near = (offset.abs() <= there[..., 3:5] / 2 + stride).all(-1) & (there[..., 0] < 0.0)
        likely = box_iou(boxes, there[..., 1:]) > ignore_iou
        care = torch.where((likely | near) & (there[..., 3] > 0.0), torch.zeros_like(care), care)
    return care


def _by_picture(targets: Tensor, batch: int) -> Tensor:
    """(batch,k,5) rows (class, centre, size) of each picture, filled up with zeros."""
    picture = targets[:, 0].long()
    order = picture.argsort(stable=True)
    counts = torch.bincount(picture, minlength=batch)
    first = counts.cumsum(0) - counts
    place = torch.arange(len(targets), device=targets.device) - first[picture[order]]
    table = targets.new_zeros(batch, int(counts.max()), 5)
    table[picture[order], place] = targets[order, 1:]
    return table


def fit_anchors(sizes_px: npt.NDArray[np.floating], seed: int) -> Anchors:
    """Nine anchors, three a scale, smallest first: k-means of the targets' sizes [YOLOv3, §2.3].

    Clusters are sought in the logarithm of width and height (n,2) [px], as the network will see them, so that a ratio
    counts alike at 5 px and at 200 px. The seed is of the first centres.
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
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "One of the clusters is empty")  # its centre stays, an anchor as good
        centres, _ = kmeans2(logs, logs[quantiles], iter=50, minit="matrix", seed=seed, missing="warn")
    ordered = np.exp(centres[np.argsort(centres.sum(axis=1))]).round(1).tolist()
    return tuple(tuple((w, h) for w, h in ordered[3 * scale : 3 * scale + 3]) for scale in range(3))
