"""Pictures held out of training such that none of them has a near twin among the rest.

A detector that has seen one frame of a burst knows the others: held out at random, they say 0.98 where another day's
pictures say 0.50. Pictures of one day, or of one sequence, are therefore held out together. What belongs together is
told by, in this order: the day in a picture's name or in its EXIF data; its folder and its name but for the last
number; and, whatever they say, likeness.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from PIL import Image
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from shipland.errors import DataError
from shipland.learning.dataset import Dataset, Sample
from shipland.vision.far.decode import Float32

ALIKE_BITS = 8
"""Two pictures are alike where at most so many of their 64 signs differ. Of 28,680 pairs of photographs of different
ships two differ in 10, none in fewer."""
_MOST_OVER = 1.5
"""Largest ratio, up or down, of held-out pictures to the requested number, so that groups stay whole."""
_MOST_NAMES = 0.5
"""With more names than this share of the pictures they are names of pictures, not of sequences."""
_MOST_HELD = 0.5
"""Largest share of a set that is held out so that one group stays whole."""
_DAY = re.compile(r"(?<!\d)(20\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])(?=\D|[0-2]\d[0-5]\d|$)")


@dataclass(frozen=True)
class Split:
    """A set in two.

    Attributes:
        fitting, held_out: pictures to train on and those kept for validation, both in the set's order.
        how: what keeps them apart, in words.
        warning: why the held-out score will flatter; empty where the pictures are of different days or sequences.
    """

    fitting: Dataset
    held_out: Dataset
    how: str
    warning: str = ""


def split(dataset: Dataset, fraction: float, seed: int) -> Split:
    """About `fraction` of the pictures held out, drawn by `seed`; DataError of fewer than two, or a broken one."""
    samples = dataset.samples
    if len(samples) < 2:
        raise DataError(f"{dataset.folder} holds {len(samples)} picture; splitting off a part needs two")
    wanted = min(max(1, round(fraction * len(samples))), len(samples) - 1)
    each: Sequence[int] = range(len(samples))
    drawn = all(sample.scene for sample in samples)
    names, kind = ([*each], "drawn situations") if drawn else _named(samples)
    groups = each if drawn else _joined(names or each, signs(samples))
    held, how, warning = _held_out(samples, groups, wanted, np.random.default_rng(seed), kind)
    if not names and not warning:
        warning = (
            "the pictures' names, folders and dates do not tell one day or sequence from another; like pictures are on "
            "one side, but the held-out score is one of the same days, and flatters"
        )
    rest = tuple(samples[index] for index in each if index not in held)
    kept = tuple(samples[index] for index in each if index in held)
    return Split(replace(dataset, samples=rest), replace(dataset, samples=kept), how, warning)


def _named(samples: Sequence[Sample]) -> tuple[list[Hashable], str]:
    """What the name of each picture's day or sequence is, and of which of the two; no names where nothing tells."""
    days, folders = [_day(sample) for sample in samples], [sample.path.parent for sample in samples]
    dated = len(set(days)) > 1
    named: list[Hashable] = [
        day if day and dated else (sample.path.parent, _stem(sample)) for day, sample in zip(days, samples, strict=True)
    ]
    if dated and all(days):
        return named, "days"
    if 1 < len(set(named)) <= _MOST_NAMES * len(samples):
        return named, "days and sequences" if dated else "sequences"
    return ([*folders], "folders") if len(set(folders)) > 1 else ([], "groups of like pictures")


def _held_out(
    samples: Sequence[Sample], groups: Sequence[int], wanted: int, rng: np.random.Generator, kind: str
) -> tuple[set[int], str, str]:
    """Indices held out, how, and a warning: whole groups, in random order, until there are enough.

    Where that does not give as many it is one larger group, or else successive pictures of the largest, by the last
    number in their names: a stretch's ends alone have neighbours.
    """
    members: dict[int, list[int]] = {}
    for index, number in enumerate(groups):
        members.setdefault(number, []).append(index)
    order = [list(members.values())[number] for number in rng.permutation(len(members))]
    held: list[int] = []
    for group in order:
        if len(held) < wanted and len(held) + len(group) <= min(_MOST_OVER * wanted, len(samples) - 1):
            held += group
    if len(held) < wanted / _MOST_OVER:
        large = [group for group in order if wanted / _MOST_OVER <= len(group) <= _MOST_HELD * len(samples)]
        held = min(large, key=len, default=[])
    if held:
        return set(held), f"whole {kind}, of {len(order)}", ""
    longest = max(order, key=len)
    sequence = sorted(longest, key=lambda index: int((re.findall(r"\d+", samples[index].path.stem) or ["0"])[-1]))
    wanted = min(wanted, len(sequence) - 1)
    start = int(rng.integers(0, len(sequence) - wanted + 1))
    warning = (
        "nearly all pictures are of one day or sequence, or too alike to tell: those held out are neighbours of those "
        "trained on, and their score flatters much"
    )
    return set(sequence[start : start + wanted]), "a stretch of one sequence", warning


def _stem(sample: Sample) -> str:
    """The name but for its last number, and for what Roboflow's exports add."""
    stem = re.sub(r"[_.](jpe?g|png)\.rf\.\w+$", "", sample.path.stem)
    return re.sub(r"\d+$", "", stem)


def _day(sample: Sample) -> str:
    """The day that a picture was taken on, as its name or its EXIF data tell it; empty where they do not."""
    match = _DAY.search(sample.path.stem)
    if match is not None:
        return "-".join(match.groups())
    try:
        with Image.open(sample.path) as picture:
            taken = str(picture.getexif().get_ifd(0x8769).get(0x9003, ""))  # DateTimeOriginal
    except (OSError, ValueError, SyntaxError):
        return ""
    match = _DAY.search(taken.replace(":", "-"))
    return "" if match is None else "-".join(match.groups())


def signs(samples: Sequence[Sample]) -> Float32:
    """(n,64) perceptual hashes: ±1, whether each cell of the picture shrunk to 9 × 8 grey ones is darker than its left.

    Source: dHash, N. Krawetz, "Kind of like that", 2013.
    """
    found = np.empty((len(samples), 64), dtype=np.float32)
    for index, sample in enumerate(samples):
        grey = cv2.imread(str(sample.path), cv2.IMREAD_REDUCED_GRAYSCALE_4)
        if grey is None:
            grey = cv2.cvtColor(sample.load()[0], cv2.COLOR_BGR2GRAY)  # says what is wrong with it
        small = cv2.resize(grey, (9, 8), interpolation=cv2.INTER_AREA).astype(np.int16)
        found[index] = np.where(small[:, 1:] > small[:, :-1], 1.0, -1.0).ravel()
    return found


def _joined(names: Sequence[Hashable], found: Float32) -> list[int]:
    """A number for each picture: the same for those of one name, and for those that are alike."""
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    groups = np.array([numbers[name] for name in names])
    ones, others = [np.arange(len(groups))], [len(groups) + groups]  # a picture is joined to its name's node
    for start in range(0, len(found), 1024):
        near = np.argwhere(found[start : start + 1024] @ found.T >= 64.0 - 2.0 * ALIKE_BITS)
        ones.append(near[:, 0] + start)
        others.append(near[:, 1])
    nodes = len(groups) + len(numbers)
    edges = (np.concatenate(ones), np.concatenate(others))
    graph = coo_matrix((np.ones(len(edges[0]), dtype=bool), edges), shape=(nodes, nodes))
    labels: list[int] = connected_components(graph, directed=False)[1][: len(groups)].tolist()
    return labels
