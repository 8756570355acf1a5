"""Training windows of labelled pictures: cut at native size, zoomed, mirrored, put together and coloured, in batches.

The pictures are read when they are wanted, or lie in the device's memory, decoded once by many threads: a GPU would
starve on reading.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn import functional

from shipland.learning.dataset import IGNORED, Dataset, Targets
from shipland.learning.settings import AugmentParameters, TrainParameters
from shipland.vision.pictures import Picture

HardPoint = tuple[int, float, float]
"""A place where the detector erred: number of the picture, column and row [px]."""
HARD_JITTER = 0.35
"""How far from a window's middle a hard place may lie, in sides."""
_NOTHING = -2.0
"""Class of a row that only fills up a table."""

Blocks = dict[tuple[int, ...], tuple[Tensor, Tensor]]
"""Pictures (n,h,w,3) and their targets (n,k,5), filled up to the most that a picture has, by the pictures' shape."""
Place = tuple[tuple[int, ...], int]
"""Of a picture in `Blocks`: its shape and its row."""


def to_batch(pictures: Sequence[Picture], device: torch.device) -> Tensor:
    """Pictures as the network takes them: (n,3,h,w), 0 … 1, channels last in memory."""
    batch = torch.from_numpy(np.stack(pictures)).to(device, non_blocking=True)
    return batch.permute(0, 3, 1, 2).float().div_(255.0)


class Windows:
    """Windows of a set whose pictures are read when they are wanted, cut on a device as the parameters say."""

    def __init__(self, dataset: Dataset, parameters: TrainParameters, device: torch.device) -> None:
        self.dataset, self.parameters, self.device = dataset, parameters, device

    def load(self, index: int) -> tuple[Picture, Targets]:
        """A whole picture (h,w,3) BGR, fitted to the window where training fits it, and its targets [px]."""
        return self.dataset.samples[index].load(self.parameters.fit_px)

    def _held(self, chosen: Sequence[int]) -> tuple[Blocks, list[Place]]:
        """Blocks that hold the chosen pictures, and where each lies in them."""
        return _in_blocks(map(self.load, chosen), self.device)

    def draw(self, hard: Sequence[HardPoint], rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """One batch: pictures (n,3,s,s) 0 … 1 and targets (m,6) rows (picture, class, centre, size) [px]."""
        count = self.parameters.batch
        generator = self._generator(rng)
        chosen = rng.integers(len(self.dataset.samples), size=count)
        points = np.full((count, 2), np.nan, np.float32)
        if hard:
            taken = np.flatnonzero(rng.random(count) < self.parameters.hard_fraction)
            picked = np.array([hard[index] for index in rng.integers(len(hard), size=len(taken))]).reshape(-1, 3)
            chosen[taken], points[taken] = picked[:, 0].astype(int), picked[:, 1:]
        batch, boxes = self._cut_all(chosen.tolist(), points, generator)
        batch, boxes = self._mosaic(batch, boxes, generator)
        batch, boxes = self._mirror(batch, boxes, generator)
        batch = colour(batch, self.parameters.augment, generator)
        boxes = _asked_for(boxes, self.parameters.augment)
        picture, row = (boxes[..., 0] > _NOTHING).nonzero(as_tuple=True)
        found = torch.cat([picture[:, None].float(), boxes[picture, row, :5]], 1)
        return batch.contiguous(memory_format=torch.channels_last), found

    def plain(self, index: int, rng: np.random.Generator) -> Picture:
        """One window (s,s,3) BGR of a picture, as it is cut."""
        batch, _ = self._cut_all([index], np.full((1, 2), np.nan, np.float32), self._generator(rng))
        return np.asarray((255.0 * batch[0]).round().byte().permute(1, 2, 0).cpu().numpy(), np.uint8)

    def _generator(self, rng: np.random.Generator) -> torch.Generator:
        return torch.Generator(self.device).manual_seed(int(rng.integers(2**62)))

    def _cut_all(
        self, chosen: Sequence[int], points: npt.NDArray[np.float32], generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """A window of each chosen picture, over its point (2,) unless that is NaN; those of one size together."""
        blocks, places = self._held(chosen)
        pictures, targets = [], []
        for shape, block in blocks.items():
            mine = [number for number, place in enumerate(places) if place[0] == shape]
            if mine:
                rows = torch.tensor([places[number][1] for number in mine], device=self.device)
                cut, moved = self._cut(*block, rows, torch.from_numpy(points[mine]).to(self.device), generator)
                pictures.append(cut)
                targets.append(moved)
        return torch.cat(pictures), torch.cat(targets)

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
        corner = torch.where(scale == 1.0, corner.round(), corner)  # a picture's own pixels stay as they are
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
        middle, sides = scale[:, None] * boxes[..., 1:3] - corner[:, None], scale[:, None] * boxes[..., 3:5]
        moved = torch.cat([boxes[..., :1], middle, sides, sides.prod(-1, keepdim=True)], -1)
        return windows, _clipped(moved, torch.zeros(2, device=self.device), size.new_full((2,), float(side)))

    def _mosaic(self, batch: Tensor, boxes: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Some windows become four quarters of four windows, around a random point."""
        a, side, count = self.parameters.augment, self.parameters.window_px, len(batch)
        chosen = torch.rand(count, generator=generator, device=self.device) < a.mosaic
        if not bool(chosen.any()):
            return batch, boxes
        point = ((0.3 + 0.4 * torch.rand((count, 2), generator=generator, device=self.device)) * side).round()
        whole = torch.full_like(point, float(side))
        point = torch.where(chosen[:, None], point, whole)  # one quarter fills the rest
        steps = torch.arange(side, device=self.device, dtype=torch.float32)
        right = (steps[None] >= point[:, :1])[:, None, None, :]
        below = (steps[None] >= point[:, 1:])[:, None, :, None]
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


class ResidentWindows(Windows):
    """Windows of a set that lies in the device's memory, decoded by so many threads."""

    def __init__(self, dataset: Dataset, parameters: TrainParameters, device: torch.device, threads: int) -> None:
        super().__init__(dataset, parameters, device)
        # OpenCV lets go of Python's lock while it decodes.
        with ThreadPoolExecutor(max(1, threads)) as pool:
            self._blocks, self._places = _in_blocks(pool.map(super().load, range(len(dataset.samples))), device)

    def load(self, index: int) -> tuple[Picture, Targets]:
        """See `Windows.load`."""
        shape, row = self._places[index]
        pictures, table = self._blocks[shape]
        targets = table[row].cpu().numpy()
        return pictures[row].cpu().numpy(), targets[targets[:, 0] > _NOTHING]

    def _held(self, chosen: Sequence[int]) -> tuple[Blocks, list[Place]]:
        return self._blocks, [self._places[index] for index in chosen]


def _in_blocks(loaded: Iterable[tuple[Picture, Targets]], device: torch.device) -> tuple[Blocks, list[Place]]:
    """Pictures and their targets on a device, and the place of each."""
    found: dict[tuple[int, ...], tuple[list[Picture], list[Targets]]] = {}
    places: list[Place] = []
    for picture, targets in loaded:
        pictures, table = found.setdefault(picture.shape, ([], []))
        places.append((picture.shape, len(pictures)))
        pictures.append(picture)
        table.append(targets)
    most = max((len(targets) for _, table in found.values() for targets in table), default=0)
    blocks: Blocks = {}
    for shape, (pictures, table) in found.items():
        held = torch.empty((len(pictures), *shape), dtype=torch.uint8, device=device)
        for start in range(0, len(pictures), 256):
            held[start : start + 256] = torch.from_numpy(np.stack(pictures[start : start + 256])).to(device)
        pictures.clear()
        filled = np.full((len(table), max(1, most), 5), _NOTHING, np.float32)
        for index, targets in enumerate(table):
            filled[index, : len(targets)] = targets
        blocks[shape] = held, torch.from_numpy(filled).to(device)
    return blocks, places


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
    """The same windows (n,3,s,s) 0 … 1 through other lenses, lights and sensors."""
    count, shape, device, p = len(batch), batch.shape[2:], batch.device, parameters

    def uniform(low: float, high: float) -> Tensor:
        return low + (high - low) * torch.rand((count, 1), generator=generator, device=device)

    curve = torch.linspace(0.0, 1.0, 256, device=device) ** uniform(1.0 - p.gamma, 1.0 + p.gamma)
    curve = (curve - 0.5) * uniform(1.0 - p.contrast, 1.0 + p.contrast) + 0.5
    curve = (curve + uniform(-p.brightness, p.brightness) / 255.0).clamp(0.0, 1.0)
    curve = curve + 2.0 * uniform(-p.tone, p.tone) * (2.0 * curve - 1.0) * curve * (1.0 - curve)  # an S, or its inverse
    batch = curve.gather(1, (255.0 * batch).round().long().flatten(1)).view(count, 3, -1)
    # The hue turns about the grey axis: v cos + (k × v) sin, k the axis; the saturation stretches what is not grey.
    turn, stretch = uniform(-p.hue_deg, p.hue_deg) * (math.pi / 180.0), 1.0 + uniform(-p.saturation, p.saturation)
    turn, stretch = turn[..., None], stretch[..., None]
    one, grey = torch.eye(3, device=device), torch.full((3, 3), 1.0 / 3.0, device=device)
    across = (one.roll(-1, 1) - one.roll(1, 1)) / math.sqrt(3.0)
    batch = (grey + stretch * (turn.cos() * (one - grey) + turn.sin() * across)) @ batch
    batch = batch.view(count, 3, *shape)
    soft, sharp = uniform(0.0, 1.0) < p.blur, uniform(0.0, 1.0) < p.sharpen
    strength = torch.where(soft, -1.0, sharp * uniform(0.0, p.sharpen_max))  # −1 leaves what is blurred alone
    near = _blurred(batch, uniform(min(0.2, p.blur_max_px), p.blur_max_px).clamp(min=0.2))
    batch = batch + strength[..., None, None] * (batch - near)
    noise = (uniform(0.0, 1.0) < p.noise) * uniform(0.0, p.noise_max) / 255.0
    grain = torch.randn(batch.shape, generator=generator, device=device)
    return (batch + noise[..., None, None] * grain).clamp(0.0, 1.0)


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
