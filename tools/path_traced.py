"""Ship and bar drawn by a path tracer and by us, from the same places: what far and near vision make of both.

    pip install bpy==5.0.1                                  # Blender: GPL, for this tool alone, Python 3.11
    python tools/path_traced.py draw --out out/path-traced  # 200 ships, 150 bars far off, 150 bars near
    python tools/path_traced.py look --out out/path-traced  # table.md, looks.csv, beside.png

The places, the light, the air and what the camera makes of the light are those of `shipland evaluate` and of
studies/views.py; nothing is trained on these pictures. Every picture is the window of 224 px around the target (or
of what the near bar needs), taken at the same place by both. The path tracer knows the ship's shapes and paint from us;
sky, waves, reflections, shadows and all that light does on its way are its own. Left out of both: rain, spray, motion
blur, decoys. Drawing goes on where it was stopped.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt
import tyro
from rich.console import Console
from rich.progress import track

from shipland.camera import Camera
from shipland.errors import DataError
from shipland.learning.evaluate import EvaluateParameters, fresh_scenes
from shipland.learning.sensor import degrade
from shipland.learning.shots import SynthParameters, draw_scene, draw_shot
from shipland.learning.synth import compressed, crop_camera, jpeg_quality
from shipland.messages import Box
from shipland.sim.scene.scene import Scene
from shipland.sim.scene.tone import develop
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.state import NearestBox, SceneState, target_box
from shipland.statistics import share_interval
from shipland.vision.far.decode import iou
from shipland.vision.far.detector import Detector
from shipland.vision.parameters import detector_parameters

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the studies stand beside the package
from studies.tags import grain
from studies.views import Setting, View, light, view_at
from studies.views import look as look_near

Picture = npt.NDArray[np.uint8]
Light16 = npt.NDArray[np.uint16]
COUNTS = {"ship": 200, "bar": 150, "near": 150}
SEED = 7_000_000
CROP_PX = 224
BLOCK = 8
"""Pictures that share light, air and sea, as in `[evaluate]`."""
NEAR_M = (2.0, 15.0)
NEAR_MARGIN = 1.3
NEAR_LEAST_PX = 160
NOISE = 1.5
BINS_M = {"ship": (15.0, 60.0, 120.0, 180.0, 250.0, 350.0), "bar": (6.0, 30.0, 60.0, 90.0, 120.0, 150.0)}
NEAR_BINS_M = (2.0, 4.0, 8.0, 11.0, 15.0)
NEAR_HEADER = (
    "near, range [m]",
    "drawn by",
    "pose",
    "distance, mean [%]",
    "rms [%]",
    "worst [%]",
    "yaw, mean [°]",
    "rms [°]",
    "worst [°]",
    "error² / 4",
)
RENDERERS = ("path tracer", "ours")


@dataclass(frozen=True)
class Arguments:
    """What is drawn or looked at.

    Attributes:
        step: draw, by the path tracer; look, at its pictures and ours.
        out: folder.
        kinds: of pictures.
        share: of the 500 pictures.
        seed: of the places.
        samples: of the path tracer, a pixel, at most.
    """

    step: tyro.conf.Positional[Literal["draw", "look"]]
    out: Path = Path("out/path-traced")
    kinds: tuple[Literal["ship", "bar", "near"], ...] = ("ship", "bar", "near")
    share: float = 1.0
    seed: int = SEED
    samples: int = 32


TILE_PX = 160


@dataclass(frozen=True)
class Place:
    """One place that both draw.

    Attributes:
        kind: ship, bar, or near.
        number: of the picture.
        range_m: to the target.
        scene: light and air.
        waves: seed of the sea, of clouds and of stains.
        state: poses.
        camera: of the window.
        view: of the near vision.
        sensor_seed: of what the camera adds.
        quality: of its JPEG.
        box: the target in the window, of far places.
    """

    kind: str
    number: int
    range_m: float
    scene: SceneParameters
    waves: int
    state: SceneState
    camera: Camera
    view: View | None
    sensor_seed: int
    quality: int
    box: NearestBox | None

    @property
    def name(self) -> str:
        """Of its files."""
        return f"{self.kind}-{self.number:04d}"


@dataclass(frozen=True)
class Looked:
    """What was found in one picture: a row of looks.csv.

    Attributes:
        kind, number, range_m: of the place.
        renderer: who drew it.
        found: the target's box was found at the detector's confidence, or a pose was given.
        confidence: of the best box that fits the target; 0 for none.
        distance_error: of the near pose, as a share of the range; NaN without one.
        yaw_error_deg: likewise.
        nees: its error squared over 4, in units of its stated covariance.
        reason: why there is no near pose.
    """

    kind: str
    number: int
    range_m: float
    renderer: str
    found: bool
    confidence: float
    distance_error: float
    yaw_error_deg: float
    nees: float
    reason: str


def places(kind: str, count: int, seed: int) -> Iterator[Place]:
    """The places of a kind, the same for the same seed."""
    yield from _near(count, seed) if kind == "near" else _far(kind, count, seed)


def _plain(scene: SceneParameters) -> SceneParameters:
    return replace(scene, shutter_s=0.0, rain_mm_h=0.0, spray=0.0, lens_drops=0.0, sensor_noise=0.0, wake=0.0)


def _synth() -> SynthParameters:
    parameters = EvaluateParameters()
    none = replace(fresh_scenes(parameters), empty_share=0.0, vessels=0.0, buoys=0.0, birds=0.0, greens=0.0)
    return replace(none, pictures_per_scene=BLOCK)


def _far(kind: str, count: int, seed: int) -> Iterator[Place]:
    assert kind in ("ship", "bar")
    setting, synth = Setting.packaged(), _synth()
    for number in range(count):
        scene, waves = draw_scene(number // BLOCK, synth, seed)
        shot = draw_shot(number, "ship" if kind == "ship" else "bar", scene, setting.camera, setting.rig, synth, seed)
        camera = crop_camera(shot, setting.camera, setting.rig, synth, CROP_PX)
        state = shot.at(0.0, setting.rig)
        box = target_box(kind, state, camera, setting.rig, synth.least_visible, synth.least_facing)
        quality = jpeg_quality(shot, synth)
        seen = (_plain(scene), waves, state, camera, None, shot.sensor_seed, quality, box)
        yield Place(kind, number, shot.range_m, *seen)


def _near(count: int, seed: int) -> Iterator[Place]:
    setting = Setting.packaged()
    packaged = SceneParameters()
    for number in range(count):
        scene = _plain(replace(packaged, **light(np.random.default_rng([seed, number // BLOCK, 8]))))
        rng = np.random.default_rng([seed, number, 9])
        range_m = float(rng.uniform(*NEAR_M))
        view = view_at(range_m, float(rng.uniform(-40.0, 40.0)), setting.gimbal_noise_rad, rng)
        camera = _window(view, setting)
        seen = (scene, seed + number // BLOCK, view.state(setting.rig), camera, view, number, 100, None)
        yield Place("near", number, range_m, *seen)


def _window(view: View, setting: Setting) -> Camera:
    """The part of the camera's picture that holds the bar with room around it."""
    px = setting.camera.project(view.bar_from_camera.inverse().apply(setting.rig.cue.points_in_bar_m))
    middle, span = 0.5 * (px.min(axis=0) + px.max(axis=0)), float(np.ptp(px, axis=0).max())
    side = int(max(NEAR_MARGIN * span, NEAR_LEAST_PX)) // 2 * 2
    corner = np.round(middle - 0.5 * side)
    matrix = setting.camera.matrix.copy()
    matrix[:2, 2] -= corner
    return Camera(side, side, matrix)


def draw(arguments: Arguments) -> None:
    """Have the path tracer draw what is not there yet."""
    try:
        from blender_scene import Cycles
    except ImportError as error:
        raise DataError(f"the path tracer is missing ({error}): pip install bpy==5.0.1, under Python 3.11") from None
    arguments.out.mkdir(parents=True, exist_ok=True)
    wanted = list(_wanted(arguments))
    missing = [place for place in wanted if not (arguments.out / f"{place.name}.png").is_file()]
    tracer: Cycles | None = None
    scene: tuple[SceneParameters, int] | None = None
    done = len(wanted) - len(missing)
    console = Console(stderr=True)  # Blender's own words on standard output are dropped
    for place in track(missing, "path-traced pictures", total=len(wanted), completed=done, console=console):
        if tracer is None or scene != (place.scene, place.waves):
            scene = place.scene, place.waves
            tracer = Cycles(Setting.packaged().rig, place.scene, np.random.default_rng(place.waves), arguments.samples)
        picture = tracer.light(place.state, place.camera)
        part = arguments.out / f".{place.name}.part.png"
        cv2.imwrite(str(part), picture)
        part.replace(arguments.out / f"{place.name}.png")


def _wanted(arguments: Arguments) -> Iterator[Place]:
    for kind, count in COUNTS.items():
        if kind in arguments.kinds:
            yield from places(kind, round(count * arguments.share), arguments.seed)


def look(arguments: Arguments) -> None:
    """Look at every picture that is there, and at ours of the same place."""
    setting, synth = Setting.packaged(), _synth()
    settings = detector_parameters()
    detectors = cache(lambda kind: Detector.load(kind, settings))
    there = [place for place in _wanted(arguments) if (arguments.out / f"{place.name}.png").is_file()]
    if not there:
        raise DataError(f"{arguments.out} holds no pictures: draw some first")
    looks: list[Looked] = []
    tiles: list[Picture] = []
    scene: Scene | None = None
    drawn: tuple[SceneParameters, int] | None = None
    for place in track(there, description="looks"):
        if scene is None or drawn != (place.scene, place.waves):
            if scene is not None:
                scene.close()
            drawn = place.scene, place.waves
            scene = Scene(setting.rig, place.scene, np.random.default_rng(place.waves))
        traced = np.asarray(cv2.imread(str(arguments.out / f"{place.name}.png"), cv2.IMREAD_UNCHANGED), np.uint16)
        beside: list[Picture] = []
        for renderer, picture in zip(RENDERERS, (traced, scene.light(place.state, place.camera)), strict=True):
            if place.view is not None:
                looked, seen = _look_near(place, picture, renderer, setting)
                looks.append(looked)
            else:
                seen = _camera(place, picture, synth)
                if place.box is not None:
                    looks.append(_look_far(place, seen, renderer, detectors(place.kind), settings.acquire_confidence))
            beside.append(seen)
        if len(tiles) < 36 and place.number % 16 == 3:
            tiles.append(np.hstack([cv2.resize(picture, (TILE_PX, TILE_PX)) for picture in beside]).astype(np.uint8))
    if scene is not None:
        scene.close()
    _write(arguments.out, looks, tiles)


def _camera(place: Place, picture: Light16, synth: SynthParameters) -> Picture:
    """What the place's camera makes of the light: the same for both."""
    steady, noise = (np.random.default_rng([place.sensor_seed, number]) for number in (1, 2))
    return compressed(degrade(picture, synth.sensor, steady, noise), place.quality)


def _look_far(place: Place, picture: Picture, renderer: str, detector: Detector, confidence: float) -> Looked:
    assert place.box is not None
    left, top, right, bottom = place.box
    target = np.array([[0.5 * (left + right), 0.5 * (top + bottom), right - left, bottom - top]])
    match_iou = EvaluateParameters().match_iou
    best = 0.0
    for box in detector.detect(picture, 0.05):
        if float(iou(_row(box), target)[0, 0]) >= match_iou:
            best = max(best, box.confidence)
    return Looked(
        place.kind, place.number, place.range_m, renderer, best >= confidence, best, np.nan, np.nan, np.nan, ""
    )


def _row(box: Box) -> npt.NDArray[np.float64]:
    return np.array([[box.centre_px[0] + 0.5, box.centre_px[1] + 0.5, *box.size_px]])


def _look_near(place: Place, picture: Light16, renderer: str, setting: Setting) -> tuple[Looked, Picture]:
    assert place.view is not None
    rng = np.random.default_rng([place.sensor_seed, 3])
    image = grain(develop(picture, place.scene.tone), NOISE, rng)
    window = replace(setting, camera=place.camera)
    trial = look_near(place.view, image, window.eyes(), window)
    start = (place.kind, place.number, place.range_m, renderer)
    if trial.error is None:
        return Looked(*start, False, 0.0, np.nan, np.nan, np.nan, trial.reason), image
    truth_m = place.view.bar_from_camera.translation_m
    share = float(np.linalg.norm(truth_m + trial.error[:3]) / np.linalg.norm(truth_m)) - 1.0
    return Looked(*start, True, 1.0, share, float(np.degrees(trial.error[3])), trial.nees / 4.0, ""), image


def _write(out: Path, looks: Sequence[Looked], tiles: Sequence[Picture]) -> None:
    with (out / "looks.csv").open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, [each.name for each in fields(Looked)])
        writer.writeheader()
        writer.writerows(asdict(item) for item in looks)
    table = "\n".join(_tables(looks))
    (out / "table.md").write_text(table, encoding="utf-8")
    print(table)
    if tiles:
        empty = np.zeros_like(tiles[0])
        rows = [[*tiles[at : at + 4], *[empty] * 4][:4] for at in range(0, len(tiles), 4)]
        cv2.imwrite(str(out / "beside.png"), np.vstack([np.hstack(row) for row in rows]))


def _tables(looks: Sequence[Looked]) -> Iterator[str]:
    for kind, edges in BINS_M.items():
        rows = []
        for low, high in _spans(edges):
            pairs = _pairs(looks, kind, low, high)
            cells = [f"{low:.0f}–{high:.0f}"]
            for side in (0, 1):
                hits = sum(pair[side].found for pair in pairs)
                least, most = share_interval(hits, len(pairs), "wilson")
                cells.append(f"{hits} of {len(pairs)} ({100 * least:.0f}–{100 * most:.0f} %)")
            cells += [str(sum(pair[side].found and not pair[1 - side].found for pair in pairs)) for side in (0, 1)]
            rows.append(cells)
        names = (*(f"found, {name}" for name in RENDERERS), *(f"only {name}" for name in RENDERERS))
        yield markdown((f"{kind}, range [m]", *names), rows)
    rows = []
    for low, high in _spans(NEAR_BINS_M):
        pairs = _pairs(looks, "near", low, high)
        for side, name in enumerate(RENDERERS):
            good = [pair[side] for pair in pairs if pair[side].found]
            start = [f"{low:.0f}–{high:.0f}", name, f"{len(good)} of {len(pairs)}"]
            rows.append([*start, *(_errors(good) if good else ["–"] * (len(NEAR_HEADER) - len(start)))])
    yield markdown(NEAR_HEADER, rows)


def _errors(good: Sequence[Looked]) -> list[str]:
    distance = 100.0 * np.array([item.distance_error for item in good])
    yaw, nees = np.array([item.yaw_error_deg for item in good]), np.array([item.nees for item in good])
    return [
        f"{distance.mean():+.2f}",
        f"{np.sqrt(np.mean(distance**2)):.2f}",
        f"{np.abs(distance).max():.1f}",
        f"{yaw.mean():+.2f}",
        f"{np.sqrt(np.mean(yaw**2)):.2f}",
        f"{np.abs(yaw).max():.1f}",
        f"{nees.mean():.2f}",
    ]


def _spans(edges: Sequence[float]) -> list[tuple[float, float]]:
    """From edge to edge, and the whole."""
    return [*pairwise(edges), (edges[0], edges[-1])]


def _pairs(looks: Sequence[Looked], kind: str, low_m: float, high_m: float) -> list[tuple[Looked, Looked]]:
    some = [item for item in looks if item.kind == kind and low_m <= item.range_m < high_m]
    by = {(item.number, item.renderer): item for item in some}
    return [(by[number, RENDERERS[0]], by[number, RENDERERS[1]]) for number in sorted({item.number for item in some})]


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    lines = [" | ".join(cells) for cells in (header, ["---"] * len(header), *rows)]
    return "".join(f"| {line} |\n" for line in lines)


def main(arguments: Arguments) -> None:
    """Draw or look."""
    try:
        {"draw": draw, "look": look}[arguments.step](arguments)
    except DataError as error:
        print(error, file=sys.stderr)
        raise SystemExit(2) from None


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=__doc__))
