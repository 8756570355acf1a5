"""Time of the near vision on photographs as a link brings them, beside the peers' tags in the same ones.

The photographs of the folder that SHIPLAND_PHOTOGRAPHS names are cut to the camera's shape, brought to its size, and
coded as JPEG; the rendered bar, or a peer's board, is laid into each at a range before. One core, as in speed_near;
every photograph is looked at from nothing, and followed in five pictures on the way in.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from time import process_time

import cv2
import numpy as np

from shipland.camera import Camera, CameraParameters
from shipland.messages import Frame
from shipland.rig import Rig
from shipland.vision.near.pipeline import NearVision
from shipland.vision.parameters import VisionParameters
from studies.harness import Case, Column, Row, Study
from studies.speed_near import PEERS, RANGES_M, Look, approach, asking, following, peer_frames, searching
from studies.tags import Board, Picture

FOLDER = "SHIPLAND_PHOTOGRAPHS"
PHOTOGRAPHS = 60
JPEG_QUALITY = 80
SHOWN = ("cv2.aruco, sub-pixel", "pyapriltags, decimate 2")


def photographs(camera: Camera) -> Iterator[Picture]:
    """The folder's photographs by name, cut and brought to the camera's size."""
    for path in sorted(Path(os.environ[FOLDER]).rglob("*")):
        if (photograph := cv2.imread(str(path))) is None:
            continue
        height, width = photograph.shape[:2]
        across = min(width, height * camera.width_px // camera.height_px)
        down = min(height, width * camera.height_px // camera.width_px)
        left, top = (width - across) // 2, (height - down) // 2
        part = photograph[top : top + down, left : left + across, ::-1]
        yield np.asarray(cv2.resize(part, (camera.width_px, camera.height_px)), np.uint8)


def laid_into(photograph: Picture, look: Look, rig: Rig, camera: Camera) -> Picture:
    """A photograph with the rendered bar and its board in it."""
    size_m = 0.5 * np.array([rig.board_width_m, rig.board_height_m])
    whole = Board(np.full((64, 256), 255, np.uint8), size_m * [[-1, -1], [1, -1], [1, 1], [-1, 1]], {})
    cover = whole.hung(np.zeros_like(photograph), camera, look.camera_from_bar) / np.float32(255.0)
    return np.asarray(np.rint(photograph * (1.0 - cover) + look.clean * cover), np.uint8)


def coded(frame: Frame) -> Frame:
    """What comes out of JPEG."""
    assert frame.image is not None
    _, data = cv2.imencode(".jpg", frame.image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert picture is not None
    return replace(frame, image=np.ascontiguousarray(picture[..., ::-1]))


def timed(look: Callable[[Frame], bool], frames: Sequence[Frame]) -> list[tuple[float, bool]]:
    """CPU time [s] of each look, and whether it found."""
    looks = []
    for frame in frames:
        started_s = process_time()
        found = look(frame)
        looks.append((process_time() - started_s, found))
    return looks


def row_of(what: str, whole: list[tuple[float, bool]], followed: list[tuple[float, bool]]) -> Row:
    """Median and 95th percentile over all pictures, and the share in which it found."""
    spent_s = [spent for spent, _ in whole]
    return {
        "what": what,
        "pictures": len(whole),
        "found": sum(found for _, found in whole) / len(whole),
        "whole_s": float(np.median(spent_s)),
        "whole_95_s": float(np.percentile(spent_s, 95)),
        "followed_s": float(np.median([spent for spent, _ in followed])) if followed else None,
    }


def cases() -> Sequence[Case]:
    """Photographs as they are, and with the bar at a range."""
    return [{"in_it": "no bar"}, *({"in_it": f"{range_m:g} m"} for range_m in RANGES_M)]


def measure(case: Case, runs: int) -> list[Row]:
    """The folder's first `runs` photographs."""
    cv2.setNumThreads(1)
    rig, parameters = Rig(), VisionParameters()
    camera = Camera.from_parameters(CameraParameters())
    vision, peers = NearVision(rig.cue, camera, parameters), {name: PEERS[name](rig) for name in SHOWN}
    bare = case["in_it"] == "no bar"
    looks = approach(rig, camera, RANGES_M[-1] if bare else float(str(case["in_it"]).split()[0]))
    ours: dict[str, Callable[[Frame], Frame]] = {"near vision": coded, "near vision, not coded": lambda frame: frame}
    whole: dict[str, list[tuple[float, bool]]] = {name: [] for name in (*ours, *peers)}
    followed: dict[str, list[tuple[float, bool]]] = {name: [] for name in whole}
    searching(vision)(coded(looks[0].frame))  # it compiles
    for photograph in islice(photographs(camera), runs):
        if bare:
            frame = replace(looks[0].frame, image=photograph)
            for name, brought in ours.items():
                whole[name] += timed(searching(vision), [brought(frame)])
            for name, peer in peers.items():
                whole[name] += timed(asking(peer, camera), [coded(frame)])
            continue
        frames = [replace(it.frame, image=laid_into(photograph, it, rig, camera)) for it in looks]
        for name, brought in ours.items():
            brought_frames = [brought(frame) for frame in frames]
            whole[name] += timed(searching(vision), brought_frames[:1])
            followed[name] += timed(following(vision, brought_frames), brought_frames[1:])
        hung = [replace(it, clean=photograph) for it in looks]
        for name, peer in peers.items():
            pictures = [coded(it) for it in peer_frames(peer, hung[:1], camera, None)]
            regions = [coded(it) for it in peer_frames(peer, hung[1:], camera, parameters)]
            whole[name] += timed(asking(peer, camera), pictures)
            followed[name] += timed(asking(peer, camera), regions)
    return [row_of(name, whole[name], followed[name]) for name in whole]


STUDY = Study(
    question="What does a look of the near vision cost on coded photographs?",
    columns={
        "in_it": Column("in the photograph"),
        "what": Column(""),
        "pictures": Column("photographs", "d"),
        "found": Column("found [%]", ".0f", 100.0),
        "whole_s": Column("whole frame [ms]", ".1f", 1e3),
        "whole_95_s": Column("95 % [ms]", ".1f", 1e3),
        "followed_s": Column("followed, or region [ms]", ".2f", 1e3),
    },
    cases=cases,
    measure=measure,
    runs=PHOTOGRAPHS,
    minutes=3,
    alone=True,
    needs=(FOLDER,),
)
