"""Take the documentation's picture from the demo's video: frames at some times, one below the other.

make demo && python tools/demo_picture.py out/demo/flight.mp4 docs/pictures/demo.jpg --at 25 56
"""

from __future__ import annotations

import argparse
from pathlib import Path

import av
import cv2
import numpy as np


def main() -> None:
    """Write the frames at the times asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("video", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--at", type=float, nargs="+", default=[25.0, 56.0], help="times in the video, rising [s]")
    parser.add_argument("--quality", type=int, default=85, help="of the JPEG, 1 … 100")
    arguments = parser.parse_args()
    times, taken = list(arguments.at), []
    with av.open(str(arguments.video)) as container:
        for frame in container.decode(video=0):
            if times and frame.time is not None and frame.time >= times[0]:
                taken.append(frame.to_ndarray(format="bgr24"))
                times.pop(0)
    if times:
        raise SystemExit(f"{arguments.video} ends before {times[0]} s")
    cv2.imwrite(str(arguments.picture), np.vstack(taken), [cv2.IMWRITE_JPEG_QUALITY, arguments.quality])


if __name__ == "__main__":
    main()
