"""Take the documentation's picture from the demo's video.

make demo && python tools/demo_picture.py out/demo/flight.mp4 docs/pictures/demo.jpg --at 18
"""

from __future__ import annotations

import argparse
from pathlib import Path

import av
import cv2


def main() -> None:
    """Write the frame at the time asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("video", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--at", type=float, default=18.0, help="time in the video [s]")
    arguments = parser.parse_args()
    with av.open(str(arguments.video)) as container:
        for frame in container.decode(video=0):
            if frame.time is not None and frame.time >= arguments.at:
                cv2.imwrite(str(arguments.picture), frame.to_ndarray(format="bgr24"), [cv2.IMWRITE_JPEG_QUALITY, 88])
                return
    raise SystemExit(f"{arguments.video} ends before {arguments.at} s")


if __name__ == "__main__":
    main()
