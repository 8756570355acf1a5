"""`shipland synth`: labelled pictures from the simulator's scene, in YOLO's layout.

Picture n of a seed is always the same, whatever was made before it, so the same command resumes an interrupted run.
The scene's description is written last: a picture without it is made again.
"""

from __future__ import annotations

import itertools
import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.config import build
from shipland.errors import ConfigError, DataError
from shipland.files import claim, replacing, write_atomically
from shipland.learning.arguments import SynthArguments
from shipland.learning.dataset import coco_table, read_dataset
from shipland.learning.decoys import foot_box_px, paint
from shipland.learning.ranges import BoxRow
from shipland.learning.sensor import degrade
from shipland.learning.shot import PACKAGED, ShipAndCamera, Shot
from shipland.learning.shots import SynthParameters, draw_scene, draw_shot
from shipland.progress import followed
from shipland.rig import Rig
from shipland.sim.scene.scene import Scene
from shipland.sim.state import NearestBox, target_box
from shipland.vision.parameters import learning_table
from shipland.vision.pictures import Picture
from shipland.workers import run_jobs

T = TypeVar("T")
DEFAULT_COUNTS = {"ship": 2000, "bar": 1000}  # [Lee2022, §Machine Learning Based Approach]
FRAME_S = 0.1


def synth_parameters(config: Path | None) -> SynthParameters:
    """The packaged `[synth]`, the user's file laid over it."""
    return build(SynthParameters, learning_table("synth", config), "synth")


def synth(arguments: SynthArguments, drawn: ShipAndCamera = PACKAGED) -> Path:
    """Make the set, of the packaged ship unless another is given; its folder. DataError where it holds another set."""
    parameters = synth_parameters(arguments.config)
    count = DEFAULT_COUNTS[arguments.kind] if arguments.count is None else arguments.count
    out, widest = arguments.out, drawn.camera.width_px
    if arguments.crop_px > widest:
        raise ConfigError(f"--crop-px must be {widest} or less, the picture's width, got {arguments.crop_px}")
    _claim(out, arguments, drawn)
    missing = [it for it in range(count) if not all(file.is_file() for file in _files(arguments, it))]
    work, block = partial(make_files, arguments, parameters, drawn), parameters.pictures_per_scene
    made = in_workers(work, missing, block, arguments.workers, arguments.minutes)
    for _ in followed(itertools.chain.from_iterable(made), f"{arguments.kind} pictures", count, count - len(missing)):
        pass
    scenes = [path.read_text(encoding="utf-8") for path in sorted((out / "scenes").glob("*.json"))]
    write_atomically(out / "scenes.jsonl", "".join(f"{scene}\n" for scene in scenes).encode())
    if arguments.coco:
        write_atomically(out / "coco.json", json.dumps(coco_table(read_dataset(out))).encode())
    return out


def in_workers(
    make: Callable[[list[int]], T], numbers: Sequence[int], block: int, workers: int, minutes: float | None = None
) -> Iterator[T]:
    """What `make` gives for each `block` of numbers, in any order, from so many processes; nothing new out of time."""
    blocks = [list(same) for _, same in itertools.groupby(numbers, lambda number: number // block)]
    end_s = math.inf if minutes is None else time.monotonic() + 60.0 * minutes
    in_time = itertools.takewhile(lambda _: time.monotonic() < end_s, blocks)
    if workers == 1:
        yield from map(make, in_time)
        return
    for _, made in run_jobs(make, in_time, workers, keep=lambda *_: None, lose=_fail):
        yield made


def _fail(_: list[int], why: str) -> None:
    raise DataError(why)


def make_files(
    arguments: SynthArguments, parameters: SynthParameters, drawn: ShipAndCamera, numbers: list[int]
) -> list[str]:
    """Draw pictures of a set, all of one block of light, air and sea, and write their files; their names."""
    camera, rig, crop_px = Camera.from_parameters(drawn.camera), drawn.rig, arguments.crop_px
    scene_parameters, waves = draw_scene(numbers[0] // parameters.pictures_per_scene, parameters, arguments.seed)
    names = []
    with closing(Scene(rig, scene_parameters, np.random.default_rng(waves))) as scene:
        for number in numbers:
            shot = draw_shot(number, arguments.kind, scene_parameters, camera, rig, parameters, arguments.seed)
            view = crop_camera(shot, camera, rig, parameters, crop_px) if crop_px else camera
            picture, box = draw(shot, 0.0, scene, view, rig, parameters)
            quality = jpeg_quality(shot, parameters)
            data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
            files = _files(arguments, number)
            texts = label_line(box, picture.shape).encode(), json.dumps(shot.scene(files[0].name)).encode()
            for file, content in zip(files, (data, *texts), strict=True):
                with replacing(file) as beside:  # does not wait for the disk
                    beside.write_bytes(content)
            names.append(files[0].stem)
    return names


def _files(arguments: SynthArguments, number: int) -> tuple[Path, Path, Path]:
    """Picture, label and the scene's description."""
    name, out = f"{arguments.kind}-{arguments.seed}-{number:06d}", arguments.out
    return out / "images" / f"{name}.jpg", out / "labels" / f"{name}.txt", out / "scenes" / f"{name}.json"


def jpeg_quality(shot: Shot, parameters: SynthParameters) -> int:
    """The compression of a situation's pictures."""
    low, high = parameters.sensor.quality_min, parameters.sensor.quality_max
    return int(np.random.default_rng(shot.sensor_seed).integers(low, high + 1))


def compressed(picture: Picture, quality: int) -> Picture:
    """The picture after JPEG's loss."""
    data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


def _claim(out: Path, arguments: SynthArguments, drawn: ShipAndCamera) -> None:
    """Make the folders, or check that what is there was begun with the same arguments."""
    wanted: dict[str, object] = {"kind": arguments.kind, "seed": arguments.seed, "crop_px": arguments.crop_px}
    wanted |= drawn.note() | asked_of(arguments.config, "synth")
    note = out / "synth.json"
    if not note.is_file() and out.is_dir() and any(out.iterdir()):
        raise DataError(f"{out} is not empty and holds no set of `shipland synth`: choose another folder")
    claim(note, wanted, "a set")
    for name in ("images", "labels", "scenes"):
        (out / name).mkdir(exist_ok=True)
    write_atomically(out / "classes.txt", f"{arguments.kind}\n".encode())


def asked_of(config: Path | None, *names: str) -> dict[str, object]:
    """What a folder's note tells of a user's file, so that two configurations are not mixed in one."""
    return {name: table for name in names if (table := learning_table(name, config))}


def centred(edges: NearestBox) -> BoxRow:
    """Centre and size of a box (left, top, right, bottom)."""
    left, top, right, bottom = edges
    return (0.5 * (left + right), 0.5 * (top + bottom), right - left, bottom - top)


def label_line(box: NearestBox | None, shape: tuple[int, ...]) -> str:
    """YOLO's line of a box (left, top, right, bottom) [px], empty without one."""
    if box is None:
        return ""
    height, width = shape[:2]
    fractions = np.array(centred(box)) / [width, height, width, height]
    return "0 " + " ".join(f"{value:.7f}" for value in fractions) + "\n"


def draw(
    shot: Shot, t_s: float, scene: Scene, camera: Camera, rig: Rig, parameters: SynthParameters
) -> tuple[Picture, NearestBox | None]:
    """One frame of a situation and the target's box in it."""
    state = shot.at(t_s, rig)
    light = scene.light(state, camera)
    paint(light, shot.decoys, camera, state.ned_from_camera, shot.visibility_m)
    steady = np.random.default_rng([shot.sensor_seed, 1])
    grain = np.random.default_rng([shot.sensor_seed, 2, round(t_s / FRAME_S)])
    picture = degrade(light, parameters.sensor, steady, grain)
    box = None
    if not shot.empty:
        box = target_box(shot.kind, state, camera, rig, parameters.least_visible, parameters.least_facing)
    return picture, box


def crop_camera(shot: Shot, camera: Camera, rig: Rig, parameters: SynthParameters, crop_px: int) -> Camera:
    """The camera whose picture is a window of `camera`'s: over the target, over a decoy, or anywhere."""
    rng = np.random.default_rng([shot.sensor_seed, 3])
    state = shot.at(0.0, rig)
    box = target_box(shot.kind, state, camera, rig, parameters.least_visible, parameters.least_facing)
    size = np.array([camera.width_px, camera.height_px], dtype=float)
    centre = rng.uniform(0.0, size)
    if box is not None and not shot.empty and rng.random() < 0.85:
        target = np.array(centred(box))
        slack = np.maximum(0.5 * crop_px - 0.5 * target[2:] - 2.0, 0.0)
        centre = target[:2] + rng.uniform(-slack, slack)
    elif shot.decoys and rng.random() < 0.7:
        decoy = shot.decoys[int(rng.integers(len(shot.decoys)))]
        around = foot_box_px(decoy, camera, state.ned_from_camera.inverse())
        if around is not None:
            centre = centred(around)[:2] + rng.uniform(-0.3, 0.3, 2) * crop_px
    corner = np.round(np.clip(centre - 0.5 * crop_px, 0.0, np.maximum(size - crop_px, 0.0)))
    matrix = camera.matrix.copy()
    matrix[:2, 2] -= corner
    return Camera(crop_px, crop_px, matrix)
