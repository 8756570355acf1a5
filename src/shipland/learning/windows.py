"""Where training windows come from: pictures read from disk one by one, or a set that lies in the device's memory.

On a CPU the network is the slow part and windows are cut by OpenCV as they are needed. A GPU would starve on that:
there the pictures are decoded once, by many threads, and windows are cut, mirrored, put together and coloured in
batches. Both draw by the same rules (`augment`), not the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from shipland.learning.augment import HARD_JITTER, training_window
from shipland.learning.dataset import IGNORED, Dataset, Targets
from shipland.learning.settings import AugmentParameters, TrainParameters
from shipland.vision.pictures import Picture

HardPoint = tuple[int, float, float]
"""A place where the detector erred: number of the picture, column and row [px]."""
_NOTHING = -2.0
"""Class of a row that only fills up a table."""


class Windows(Protocol):
    """A source of training windows."""

    def draw(self, hard: Sequence[HardPoint], rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """One batch: pictures (n,3,s,s) 0 … 1 and targets (m,6) rows (picture, class, centre, size) [px]."""

    def load(self, index: int) -> tuple[Picture, Targets]:
        """A whole picture (h,w,3) BGR and its targets [px]."""


def to_batch(pictures: Sequence[Picture], device: torch.device) -> Tensor:
    """Pictures as the network takes them: (n,3,h,w), 0 … 1, channels last in memory."""
    batch = torch.from_numpy(np.stack(pictures)).to(device, non_blocking=True)
    return batch.permute(0, 3, 1, 2).float().div_(255.0)


@dataclass(frozen=True)
class DiskWindows:
    """Windows of pictures that are read when they are wanted."""

    dataset: Dataset
    parameters: TrainParameters
    device: torch.device

    def load(self, index: int) -> tuple[Picture, Targets]:
        """See `Windows.load`."""
        return self.dataset.samples[index].load()

    def draw(self, hard: Sequence[HardPoint], rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """See `Windows.draw`."""
        pictures, rows = [], []
        for number in range(self.parameters.batch):
            over = None
            if hard and rng.random() < self.parameters.hard_fraction:
                index, column_px, row_px = hard[int(rng.integers(len(hard)))]
                over = *self.load(index), (column_px, row_px)
            side = self.parameters.window_px
            picture, targets = training_window(self._drawn, side, self.parameters.augment, rng, over)
            pictures.append(picture)
            rows.append(np.column_stack([np.full(len(targets), number, np.float32), targets]))
        found = np.concatenate(rows).astype(np.float32)
        return to_batch(pictures, self.device), torch.from_numpy(found).to(self.device)

    def _drawn(self, rng: np.random.Generator) -> tuple[Picture, Targets]:
        return self.load(int(rng.integers(len(self.dataset.samples))))


class ResidentWindows:
    """Windows of a set whose pictures, all decoded, lie in the device's memory, in one block for each size.

    Args:
        dataset: the set.
        parameters: of training; where they fit pictures to the window, these are kept already fitted.
        device: that holds the pictures.
        threads: that decode them.
    """

    def __init__(self, dataset: Dataset, parameters: TrainParameters, device: torch.device, threads: int) -> None:
        fit_px = parameters.window_px if parameters.augment.fit else 0
        self.parameters, self.device = parameters, device
        blocks: dict[tuple[int, ...], tuple[list[Picture], list[Targets]]] = {}
        self._place: list[tuple[tuple[int, ...], int]] = []
        # OpenCV lets go of Python's lock while it decodes.
        with ThreadPoolExecutor(max(1, threads)) as pool:
            for picture, targets in pool.map(lambda sample: sample.load(fit_px), dataset.samples):
                pictures, rows = blocks.setdefault(picture.shape, ([], []))
                self._place.append((picture.shape, len(pictures)))
                pictures.append(picture)
                rows.append(targets)
        most = max(1, max((len(rows) for _, table in blocks.values() for rows in table), default=1))
        self._pictures: dict[tuple[int, ...], Tensor] = {}
        self._targets: dict[tuple[int, ...], Tensor] = {}
        for shape, (pictures, table) in blocks.items():
            held = torch.empty((len(pictures), *shape), dtype=torch.uint8, device=device)
            for start in range(0, len(pictures), 256):
                held[start : start + 256] = torch.from_numpy(np.stack(pictures[start : start + 256])).to(device)
            pictures.clear()
            filled = np.full((len(table), most, 5), _NOTHING, np.float32)
            for index, targets in enumerate(table):
                filled[index, : len(targets)] = targets
            self._pictures[shape], self._targets[shape] = held, torch.from_numpy(filled).to(device)

    def load(self, index: int) -> tuple[Picture, Targets]:
        """See `Windows.load`."""
        shape, row = self._place[index]
        targets = self._targets[shape][row].cpu().numpy()
        return self._pictures[shape][row].cpu().numpy(), targets[targets[:, 0] > _NOTHING]

    def draw(self, hard: Sequence[HardPoint], rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """See `Windows.draw`."""
        count = self.parameters.batch
        generator = torch.Generator(self.device).manual_seed(int(rng.integers(2**62)))
        chosen = rng.integers(len(self._place), size=count)
        points = np.full((count, 2), np.nan, np.float32)
        if hard:
            taken = np.flatnonzero(rng.random(count) < self.parameters.hard_fraction)
            picked = np.array([hard[index] for index in rng.integers(len(hard), size=len(taken))]).reshape(-1, 3)
            chosen[taken], points[taken] = picked[:, 0].astype(int), picked[:, 1:]
        pictures, targets = [], []
        for shape in self._pictures:
            mine = [number for number in range(count) if self._place[chosen[number]][0] == shape]
            if not mine:
                continue
            rows = torch.tensor([self._place[chosen[number]][1] for number in mine], device=self.device)
            at = torch.from_numpy(points[mine]).to(self.device)
            cut, moved = self._cut(self._pictures[shape], self._targets[shape], rows, at, generator)
            pictures.append(cut)
            targets.append(moved)
        batch, boxes = torch.cat(pictures), torch.cat(targets)
        batch, boxes = self._mosaic(batch, boxes, generator)
        batch, boxes = self._mirror(batch, boxes, generator)
        batch = colour(batch, self.parameters.augment, generator)
        boxes = _asked_for(boxes, self.parameters.augment)
        picture, row = (boxes[..., 0] > _NOTHING).nonzero(as_tuple=True)
        found = torch.cat([picture[:, None].float(), boxes[picture, row, :5]], 1)
        return batch.contiguous(memory_format=torch.channels_last), found

    def _cut(
        self, pictures: Tensor, targets: Tensor, rows: Tensor, points: Tensor, generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Windows (b,3,s,s) 0 … 1 and their targets (b,k,6): class, centre, size, area before it was cut."""
        a, side, count = self.parameters.augment, self.parameters.window_px, len(rows)
        height, width = pictures.shape[1:3]

        def uniform(*shape: int) -> Tensor:
            return torch.rand(shape, generator=generator, device=self.device)

        low, high = math.log(a.scale_min), math.log(a.scale_max)
        scale = (low + (high - low) * uniform(count)).exp()[:, None]
        size = torch.tensor([width, height], device=self.device, dtype=torch.float32)
        room = scale * size - side
        least, most = room.clamp(max=0.0), room.clamp(min=0.0)
        corner = least + uniform(count, 2) * (most - least)
        boxes = targets[rows]
        wanted = boxes[..., 0] >= 0.0
        any_wanted = wanted.any(1)
        pick = torch.where(wanted, uniform(*wanted.shape), wanted.new_zeros((), dtype=torch.float32)).argmax(1)
        target = boxes[torch.arange(count, device=self.device), pick]
        margin = 0.5 * scale * target[:, 3:5]
        near, far = margin.clamp(max=0.5 * side), (side - margin).clamp(min=0.5 * side)
        over = scale * target[:, 1:3] - (near + uniform(count, 2) * (far - near))
        corner = torch.where((any_wanted & (uniform(count) < a.on_target))[:, None], over, corner)
        jitter = 0.5 + HARD_JITTER * (2.0 * uniform(count, 2) - 1.0)
        corner = torch.where(points.isnan(), corner, scale * points.nan_to_num() - jitter * side)
        corner = torch.minimum(torch.maximum(corner, least), most)
        # Only the part of the picture that is wanted leaves the store; it is then scaled like an affine map would.
        patch = math.ceil(side / a.scale_min) + 2
        first = torch.floor(corner / scale).long()
        steps = torch.arange(patch, device=self.device)
        columns = (first[:, :1] + steps).clamp(0, width - 1)
        lines = (first[:, 1:] + steps).clamp(0, height - 1)
        cut = pictures[rows[:, None, None], lines[:, :, None], columns[:, None, :]].permute(0, 3, 1, 2).float() / 255.0
        centres = torch.arange(side, device=self.device) + 0.5
        place = (centres[None, None] + corner[..., None]) / scale[..., None] - first[..., None]  # (b,2,s) edges
        grid = 2.0 * place / patch - 1.0
        full = torch.stack([grid[:, 0, None, :].expand(-1, side, -1), grid[:, 1, :, None].expand(-1, -1, side)], dim=-1)
        windows = functional.grid_sample(cut, full, mode="bilinear", padding_mode="border", align_corners=False)
        moved = torch.cat(
            [
                boxes[..., :1],
                scale[:, None] * boxes[..., 1:3] - corner[:, None],
                scale[:, None] * boxes[..., 3:5],
                (scale[:, None] * boxes[..., 3:5]).prod(-1, keepdim=True),
            ],
            -1,
        )
        return windows, _clipped(moved, torch.zeros(2, device=self.device), size.new_full((2,), float(side)))

    def _mosaic(self, batch: Tensor, boxes: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Some windows become four quarters of four windows, around a random point."""
        a, side, count = self.parameters.augment, self.parameters.window_px, len(batch)
        chosen = torch.rand(count, generator=generator, device=self.device) < a.mosaic
        if not bool(chosen.any()):
            return batch, boxes
        point = ((0.3 + 0.4 * torch.rand((count, 2), generator=generator, device=self.device)) * side).round()
        point = torch.where(chosen[:, None], point, torch.full_like(point, float(side)))  # one quarter fills the rest
        steps = torch.arange(side, device=self.device, dtype=torch.float32)
        right = (steps[None] >= point[:, :1])[:, None, None, :]
        below = (steps[None] >= point[:, 1:])[:, None, :, None]
        whole = torch.full_like(point, float(side))
        result, tables = batch, []
        for quarter, (to_right, to_below) in enumerate(((False, False), (True, False), (False, True), (True, True))):
            order = torch.randperm(count, generator=generator, device=self.device) if quarter else None
            pictures, targets = (batch, boxes) if order is None else (batch[order], boxes[order])
            inside = (right if to_right else ~right) & (below if to_below else ~below)
            result = torch.where(inside, pictures, result)
            low = torch.stack([point[:, 0] * to_right, point[:, 1] * to_below], 1)
            high = torch.stack([whole[:, 0] if to_right else point[:, 0], whole[:, 1] if to_below else point[:, 1]], 1)
            tables.append(_clipped(targets, low[:, None], high[:, None]))
        return result, torch.cat(tables, 1)

    def _mirror(self, batch: Tensor, boxes: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        flipped = torch.rand(len(batch), generator=generator, device=self.device) < self.parameters.augment.mirror
        batch = torch.where(flipped[:, None, None, None], batch.flip(3), batch)
        column = torch.where(flipped[:, None], self.parameters.window_px - boxes[..., 1], boxes[..., 1])
        return batch, torch.cat([boxes[..., :1], column[..., None], boxes[..., 2:]], -1)


def _clipped(boxes: Tensor, low: Tensor, high: Tensor) -> Tensor:
    """Rows (…,6) with their boxes cut to low … high (2,); those outside become `_NOTHING`."""
    start = torch.maximum(boxes[..., 1:3] - 0.5 * boxes[..., 3:5], low).minimum(high)
    end = torch.minimum(boxes[..., 1:3] + 0.5 * boxes[..., 3:5], high).maximum(low)
    size = end - start
    kind = torch.where((size > 0.0).all(-1), boxes[..., 0], torch.full_like(boxes[..., 0], _NOTHING))
    return torch.cat([kind[..., None], 0.5 * (start + end), size, boxes[..., 5:]], -1)


def _asked_for(boxes: Tensor, parameters: AugmentParameters) -> Tensor:
    """Rows (…,6); targets too small, or of which too little is left, become IGNORED."""
    visible = boxes[..., 3:5].prod(-1) / boxes[..., 5].clamp(min=1e-9)
    hopeless = (visible < parameters.min_visible) | (boxes[..., 3:5].amax(-1) < parameters.min_side_px)
    kind = torch.where(hopeless & (boxes[..., 0] >= 0.0), torch.full_like(visible, IGNORED), boxes[..., 0])
    return torch.cat([kind[..., None], boxes[..., 1:]], -1)


def colour(batch: Tensor, parameters: AugmentParameters, generator: torch.Generator) -> Tensor:
    """The same windows (n,3,s,s) 0 … 1 through other lenses, lights and sensors: as `augment.colour`, in a batch."""
    count, device = len(batch), batch.device

    def uniform(low: float, high: float) -> Tensor:
        return low + (high - low) * torch.rand((count, 1, 1, 1), generator=generator, device=device)

    p = parameters
    batch = batch.clamp(1e-4, 1.0) ** uniform(1.0 - p.gamma, 1.0 + p.gamma)
    batch = (batch - 0.5) * uniform(1.0 - p.contrast, 1.0 + p.contrast) + 0.5
    batch = (batch + uniform(-p.brightness, p.brightness) / 255.0).clamp(0.0, 1.0)
    bend = uniform(-p.tone, p.tone)
    batch = batch + bend * (2.0 * batch - 1.0) * batch * (1.0 - batch) * 2.0  # an S, or its inverse
    turn = uniform(-p.hue_deg, p.hue_deg) * (math.pi / 180.0)
    stretch = 1.0 + uniform(-p.saturation, p.saturation)
    grey = batch.mean(1, keepdim=True)
    chroma = batch - grey
    # Turning about the grey axis: v cos + (k × v) sin, k the axis.
    across = (chroma[:, [2, 0, 1]] - chroma[:, [1, 2, 0]]) / math.sqrt(3.0)
    batch = grey + stretch * (chroma * turn.cos() + across * turn.sin())
    soft = uniform(0.0, 1.0) < p.blur
    sharp = uniform(0.0, 1.0) < p.sharpen
    near = _blurred(batch, (0.2 + (p.blur_max_px - 0.2) * uniform(0.0, 1.0)).clamp(min=0.2))
    batch = torch.where(soft, near, batch)
    batch = torch.where(sharp & ~soft, batch + uniform(0.0, p.sharpen_max) * (batch - near), batch)
    grain = torch.randn(batch.shape, generator=generator, device=device)
    noisy = (uniform(0.0, 1.0) < p.noise) * uniform(0.0, p.noise_max) / 255.0
    return (batch + noisy * grain).clamp(0.0, 1.0)


def _blurred(batch: Tensor, sigma_px: Tensor) -> Tensor:
    """Each picture (n,3,s,s) under its own Gaussian (n,1,1,1), five pixels wide."""
    count, channels, height, width = batch.shape
    steps = torch.arange(-2, 3, device=batch.device, dtype=torch.float32)
    kernel = (-0.5 * (steps / sigma_px.view(-1, 1)).square()).exp()
    kernel = (kernel / kernel.sum(1, keepdim=True)).repeat_interleave(channels, 0)
    flat = functional.pad(batch, (2, 2, 2, 2), mode="replicate").reshape(1, count * channels, height + 4, width + 4)
    flat = functional.conv2d(flat, kernel[:, None, None, :], groups=count * channels)
    flat = functional.conv2d(flat, kernel[:, None, :, None], groups=count * channels)
    return flat.view(count, channels, height, width)


def decoded_bytes(dataset: Dataset) -> int:
    """Memory that the decoded pictures take, estimated from sixteen of them."""
    some = dataset.samples[:: max(1, len(dataset.samples) // 16)]
    return round(sum(sample.load()[0].nbytes for sample in some) / len(some) * len(dataset.samples))
