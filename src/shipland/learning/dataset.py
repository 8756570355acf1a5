"""Labelled pictures in YOLO's layout: `images/NAME.jpg` with `labels/NAME.txt`, one line a box.

A line is `class centre_x centre_y width height`, the last four as fractions of the picture; or a polygon, `class x y x
y x y …`, of which the upright box is taken. An empty label file says that the picture shows no target; a missing one is
an error. `classes.txt` or `data.yaml` names the classes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.files import json_of, read_text
from shipland.vision.pictures import PICTURE_SUFFIXES, Picture, read_picture

Targets = npt.NDArray[np.float32]
"""(n,5) rows (class, centre column, centre row, width, height) [px, edges at whole numbers]; class -1: do not care."""

EDGE_TOLERANCE = 2e-3
"""Fraction of the picture by which a labelling tool's rounding may put a box outside."""
POLYGON_TOLERANCE = 0.1
"""The same for a polygon's points: those of a target that the picture's edge cuts may lie beyond, and are cut off."""
IGNORED = -1.0


@dataclass(frozen=True)
class Sample:
    """One labelled picture.

    Attributes:
        boxes: (n,5) rows (class, centre x, centre y, width, height), fractions of the picture.
        scene: what is known of how it was made (range, weather …), from `scenes.jsonl`; empty otherwise.
    """

    path: Path
    boxes: Targets
    scene: dict[str, Any]

    def load(self, fit_px: int = 0) -> tuple[Picture, Targets]:
        """The picture (h,w,3) BGR, scaled to this longer side unless 0, and its targets [px]; DataError if broken."""
        picture = read_picture(self.path)
        if fit_px:
            scale = fit_px / max(picture.shape[:2])
            size = [max(1, round(scale * side)) for side in picture.shape[1::-1]]
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), np.uint8)
        height, width = picture.shape[:2]
        targets = self.boxes * np.array([1, width, height, width, height], np.float32)
        return picture, targets.astype(np.float32)


@dataclass(frozen=True)
class Dataset:
    """A set of labelled pictures and the names of their classes."""

    folder: Path
    classes: tuple[str, ...]
    samples: tuple[Sample, ...]


def read_dataset(folder: Path, classes: Sequence[str] | None = None) -> Dataset:
    """Read a set of `images/` and `labels/`, or both side by side, and check every label; classes default to its own.

    Raises:
        DataError: names the first file, and counts the others: no picture, missing label, broken line, unknown class,
            box outside the picture.
    """
    if not folder.is_dir():
        raise DataError(f"data set {folder} is no folder")
    images, labels = folder / "images", folder / "labels"
    if not images.is_dir():
        images = labels = folder
    elif not labels.is_dir():
        raise DataError(f"data set {folder} has images/ but no labels/")
    paths = sorted(path for path in images.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES)
    if not paths:
        raise DataError(f"data set {folder} holds no picture in {images}; expected images/NAME.jpg, labels/NAME.txt")
    scenes, names = read_scenes(folder), tuple(classes or _class_names(folder))
    samples: list[Sample] = []
    faults: list[DataError] = []
    for path in paths:
        try:
            boxes = read_label(labels / f"{path.stem}.txt", path, len(names))
        except DataError as error:
            faults.append(error)
        else:
            samples.append(Sample(path, boxes, scenes.get(path.name, {})))
    if faults:
        more = f"; {len(faults)} of the set's {len(paths)} labels cannot be used" if len(faults) > 1 else ""
        raise DataError(f"{faults[0]}{more}")
    return Dataset(folder, names, tuple(samples))


def _text(path: Path) -> str:
    """A file's text; the byte-order mark that some editors write is no part of it."""
    return read_text(path).removeprefix("\ufeff")


def _class_names(folder: Path) -> list[str]:
    """The names that classes.txt or data.yaml has, in the set's folder or above it."""
    for place in (folder, folder.resolve().parent):
        listed = place / "classes.txt"
        if listed.is_file():
            names = [line.strip() for line in _text(listed).splitlines() if line.strip()]
            if not names:
                raise DataError(f"{listed} names no class")
            return names
        for table in (place / "data.yaml", place / "data.yml"):
            if table.is_file():
                return yaml_names(table)
    raise DataError(
        f"{folder} does not name its classes: write classes.txt there, one name a line, number 0 first, "
        "or give --classes"
    )


def yaml_names(path: Path) -> list[str]:
    """The `names` of a data.yaml as labelling tools export it: a list in brackets, a list of lines, or `0: name`."""
    form = r"^names:[ \t]*(\[[^\]]*\]|\{[^}]*\}|(?:\s*\n[ \t]*(?:- *|\d+ *:).*)+)"
    match = re.search(form, _text(path), re.MULTILINE)
    body = "" if match is None else match[1].strip()
    items = body[1:-1].split(",") if body[:1] in ("[", "{") else body.splitlines()
    plain = [re.sub(r"\s+#.*$", "", item).strip() for item in items]
    names: dict[int, str] = {}
    for number, name in re.findall(r"^(?:-\s*|(\d+)\s*:\s*)?(.+)$", "\n".join(plain), re.MULTILINE):
        names[int(number or len(names))] = name.strip().strip("'\"")
    if not names:
        raise DataError(f"{path} has no list 'names' of classes: write classes.txt, one name a line")
    if sorted(names) != [*range(len(names))]:
        there, wanted = (", ".join(map(str, numbers)) for numbers in (sorted(names), range(len(names))))
        raise DataError(f"{path} numbers its classes {there}; expected {wanted}")
    return [names[number] for number in sorted(names)]


def read_scenes(folder: Path) -> dict[str, dict[str, Any]]:
    """What `scenes.jsonl` tells of each picture, by file name; empty without the file."""
    path = folder / "scenes.jsonl"
    if not path.is_file():
        return {}
    scenes: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(_text(path).splitlines(), 1):
        try:
            scene = json_of(line)
            scenes[scene["file"]] = scene
        except (KeyError, TypeError, ValueError):
            raise DataError(f"{path}, line {number}: expected a JSON object with a key 'file'") from None
        for key in ("range_m", "visibility_m", "decoys"):
            if not isinstance(scene.get(key, 0), int | float):
                raise DataError(f"{path}, line {number}: expected a number as {key}, got {scene[key]!r}")
    return scenes


def read_label(path: Path, picture: Path, class_count: int) -> Targets:
    """Boxes (n,5) of one label file, fractions of the picture; DataError names the file and line."""
    if not path.exists():
        raise DataError(f"picture {picture} has no label: expected {path} (empty if it shows no target)")
    rows = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        if not line.strip():
            continue
        where = f"label {path}, line {number}"
        try:
            row = [float(item) for item in line.split()]
        except ValueError:
            row = []
        if len(row) >= 7 and len(row) % 2 == 1 and np.isfinite(row).all():
            if min(row[1:]) < -POLYGON_TOLERANCE or max(row[1:]) > 1.0 + POLYGON_TOLERANCE:
                raise DataError(
                    f"{where}: {len(row)} numbers with one of {max(row[1:], key=abs):g}, expected fractions of the "
                    "picture (0 … 1) as a polygon has them; labels with keypoints are not read"
                )
            points = np.clip(np.array(row[1:]).reshape(-1, 2), 0.0, 1.0)
            start, end = points.min(axis=0), points.max(axis=0)
            row = [row[0], *(0.5 * (start + end)).tolist(), *(end - start).tolist()]
        if len(row) != 5 or not np.isfinite(row).all():
            raise DataError(
                f"{where}: expected 'class centre_x centre_y width height' or a polygon, got {line.strip()[:80]!r}"
            )
        kind, x, y, w, h = row
        if kind != int(kind) or not 0 <= kind < class_count:
            raise DataError(f"{where}: unknown class {kind:g}; this set has {class_count}, numbered from 0")
        if w <= 0.0 or h <= 0.0:
            raise DataError(f"{where}: box of size {w:g} × {h:g}; both must be positive")
        low, high = min(x - w / 2, y - h / 2), max(x + w / 2, y + h / 2)
        if low < -EDGE_TOLERANCE or high > 1.0 + EDGE_TOLERANCE:
            raise DataError(f"{where}: box reaches outside the picture ({low:.4f} … {high:.4f}, expected 0 … 1)")
        rows.append(row)
    return np.array(rows, dtype=np.float32).reshape(-1, 5)


def coco_table(dataset: Dataset) -> dict[str, Any]:
    """The set as a COCO annotation table (JSON-ready); boxes are (left, top, width, height) [px]."""
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, sample in enumerate(dataset.samples, 1):
        picture, targets = sample.load()
        height, width = picture.shape[:2]
        images.append({"id": number, "file_name": sample.path.name, "width": width, "height": height})
        for kind, x, y, w, h in targets.tolist():
            box = [round(value, 3) for value in (x - w / 2, y - h / 2, w, h)]
            numbers = {"id": len(annotations) + 1, "image_id": number, "category_id": int(kind) + 1}
            annotations.append(numbers | {"bbox": box, "area": round(w * h, 3), "iscrowd": 0})
    categories = [{"id": index, "name": name} for index, name in enumerate(dataset.classes, 1)]
    return {"images": images, "annotations": annotations, "categories": categories}
