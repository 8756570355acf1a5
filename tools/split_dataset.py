"""Split a set in YOLO's layout in two: every n-th picture, by name, is kept for measuring.

    python tools/split_dataset.py my-ship --out out/my-ship --every 5

Leaves OUT/train and OUT/held-out with copies of images/ and labels/; neighbours in a film are all but the same picture,
so split films, not their frames.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Annotated

import tyro


def main(data: Annotated[Path, tyro.conf.Positional], out: Path, every: int = 5) -> None:
    """Copy."""
    pictures = sorted(path for path in (data / "images").glob("*") if path.is_file())
    if not pictures or every < 2:
        sys.exit(f"shipland: {data} holds no images/ or --every is below 2; expected images/NAME.jpg, labels/NAME.txt")
    for index, picture in enumerate(pictures):
        part = out / ("held-out" if index % every == every - 1 else "train")
        label = data / "labels" / f"{picture.stem}.txt"
        for source in (picture, label):
            target = part / source.parent.name / source.name
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.exists():
                shutil.copyfile(source, target)
    print(f"{out}/train, {out}/held-out: {len(pictures)} pictures, every {every}th held out")


if __name__ == "__main__":
    tyro.cli(main)
