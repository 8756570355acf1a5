"""Make a film for the documentation from a flight's video: faster, smaller; the landing at its own pace.

python tools/short_film.py out/demo/flight.mp4 docs/pictures/full-scale.mp4 --faster 16 --last 12
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import av
import cv2

from shipland.report.video import VideoParameters, VideoWriter
from shipland.vision.pictures import Picture, read_video


def chosen(video: Path, rate_hz: float, faster: float, last_s: float, end_s: float) -> Iterator[Picture]:
    """Pictures `1 / rate_hz` apart in the film: of every `faster`-th moment, of every moment near the end."""
    due_s = 0.0
    for t_s, picture in read_video(video):
        if t_s >= due_s:
            yield picture
            due_s += (1.0 if t_s >= end_s - last_s else faster) / rate_hz


def main() -> None:
    """Write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("video", type=Path)
    parser.add_argument("film", type=Path)
    parser.add_argument("--faster", type=float, default=16.0, help="than the video, before its last seconds")
    parser.add_argument("--last", type=float, default=12.0, help="seconds at their own pace")
    parser.add_argument("--width", type=int, default=960, help="px, even")
    parser.add_argument("--rate", type=float, default=15.0, help="pictures a second")
    parser.add_argument("--crf", type=float, default=30.0, help="of H.264: more is smaller")
    asked = parser.parse_args()
    with av.open(str(asked.video)) as container:
        assert container.duration is not None
        end_s = container.duration / av.time_base
    packaged = VideoParameters()
    parameters = replace(packaged, rate_hz=asked.rate, chase_rate_hz=min(packaged.chase_rate_hz, asked.rate))
    parameters = replace(parameters, crf=asked.crf, preset="slow")
    writer = None
    for picture in chosen(asked.video, asked.rate, asked.faster, asked.last, end_s):
        height = 2 * round(0.5 * picture.shape[0] * asked.width / picture.shape[1])
        small = cv2.resize(picture, (asked.width, height), interpolation=cv2.INTER_AREA)
        if writer is None:
            writer = VideoWriter(asked.film, asked.width, height, parameters)
        writer.write(small)
    assert writer is not None  # `read_video` refuses an empty one
    writer.close()
    print(f"{asked.film}: {asked.film.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
