"""`shipland evaluate`: a detector on a labelled set, or on fresh scenes of the simulator over range.

Fresh scenes are whole frames. Each is looked at twice: its first frame by the detector alone, and all its frames by the
far vision that flies, with its tracks and its confirmation. One line a scene goes to `scenes.jsonl` as soon as it is
known, so an interrupted run is resumed by the same command.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from shipland.camera import Camera
from shipland.config import build, key, parameters, require
from shipland.errors import ConfigError, DataError
from shipland.figures import drawn
from shipland.files import claim, read_text, write_atomically
from shipland.learning.arguments import EvaluateArguments
from shipland.learning.dataset import Dataset, read_dataset
from shipland.learning.looks import LEAST_CONFIDENCE, Look, edges_of, looks_at
from shipland.learning.metrics import COCO_IOUS, Tally
from shipland.learning.ranges import (
    BoxRow,
    RangeBin,
    RangeTable,
    SceneRecord,
    SureBox,
    hits,
    markdown,
    range_table,
    summary,
)
from shipland.learning.sensor import Span
from shipland.learning.shot import PACKAGED, ShipAndCamera, Shot
from shipland.learning.shots import SynthParameters, draw_scene, draw_shot
from shipland.learning.synth import (
    FRAME_S,
    asked_of,
    centred,
    compressed,
    draw,
    in_workers,
    jpeg_quality,
    synth_parameters,
)
from shipland.messages import Box, Frame, GimbalAttitude
from shipland.progress import followed
from shipland.rig import Rig
from shipland.sim.scene.scene import Scene
from shipland.sim.state import target_box
from shipland.vision.far.detector import Detector
from shipland.vision.far.far import FarVision
from shipland.vision.parameters import DetectorParameters, detector_parameters, learning_table
from shipland.vision.pictures import Picture

BAROMETER_M = 0.7
"""Error of the camera's height, of one scene: drift, and a take-off point above the water. Chosen."""
_LEAST_SEEN, _LEAST_OVERLAP = 0.01, 1e-12


@parameters
class EvaluateParameters:
    """How detectors are measured (`[evaluate]`)."""

    ship_range_m: Span = key((15.0, 350.0), "nearest and farthest ship of fresh scenes, drawn uniformly")
    bar_range_m: Span = key((6.0, 150.0), "nearest and farthest bar of fresh scenes, drawn uniformly")
    ship_bin_m: float = key(25.0, "width of the table's bins", gt=0)
    bar_bin_m: float = key(10.0, "width of the table's bins", gt=0)
    empty_share: float = key(0.2, "part of the fresh scenes without the target", ge=0, lt=1)
    edge_px: float = key(30.0, "the target's centre stays so far from the picture's edges in the first frame")
    match_iou: float = key(0.3, "overlap from which a box is a hit", "one pixel costs a 7-px box a quarter", gt=0, lt=1)
    hazy_below_m: float = key(4000.0, "visibility that parts haze from clear air")
    pictures_per_scene: int = key(8, "scenes that share light, air and sea", ge=1)

    def __post_init__(self) -> None:
        for name in ("ship_range_m", "bar_range_m"):
            low, high = getattr(self, name)
            require(0.0 < low < high, f"{name} must be two positive numbers, the smaller first")


@dataclass(frozen=True)
class Evaluation:
    """What was measured.

    Attributes:
        detector: runtime, arithmetic and the weights' own note.
        average_precision, recall, precision: over all single pictures, at `match_iou` and boxes from `confidence` on.
        average_precision_50, average_precision_50_95: at IoU 0.5, and the mean over IoU 0.5, 0.55 … 0.95.
        match_iou: overlap from which a box is a hit, in all figures that do not say another.
        tables: over range, by name (all, clear, haze, no decoys); empty where ranges are not known.
        missed, looks: of a labelled set, pictures with a target that was not found, and all of them.
    """

    detector: str
    confidence: float
    pictures: int
    average_precision: float
    recall: float
    precision: float
    average_precision_50: float
    average_precision_50_95: float
    match_iou: float
    tables: dict[str, RangeTable]
    missed: tuple[str, ...]
    looks: tuple[Look, ...] = ()

    def text(self) -> str:
        """For people: Markdown."""
        parts = [
            f"{self.detector}: {self.pictures} pictures, average precision {self.average_precision:.3f} at IoU "
            f"{self.match_iou:g}, {self.average_precision_50:.3f} at IoU 0.5, {self.average_precision_50_95:.3f} over "
            f"IoU 0.5 to 0.95; recall {self.recall:.3f} and precision {self.precision:.3f} at IoU {self.match_iou:g} "
            f"and confidence {self.confidence:g}. All tables: IoU {self.match_iou:g}."
        ]
        if self.tables:
            parts.append(summary(self.tables))
        for name, table in self.tables.items():
            parts += [f"## {name}", markdown(table)]
        return "\n\n".join(parts) + "\n"


def evaluate(arguments: EvaluateArguments, drawn: ShipAndCamera = PACKAGED) -> Evaluation:
    """Measure; leaves `evaluation.json`, `table.md`, with ranges `recall.png`, and for fresh scenes `scenes.jsonl`.

    DataError or ConfigError where set or weights cannot be used, the folder holds another run, or a setting is wrong.
    """
    settings = detector_parameters(arguments.config)
    settings = replace(settings, runtime=arguments.runtime, precision=arguments.precision, threads=arguments.threads)
    parameters = build(EvaluateParameters, learning_table("evaluate", arguments.config), "evaluate")
    confidence = settings.acquire_confidence if arguments.confidence is None else arguments.confidence
    if not LEAST_CONFIDENCE <= confidence <= 1.0:
        raise ConfigError(f"the confidence must be in {LEAST_CONFIDENCE:g} … 1, got {confidence:g}")
    tally, strict = Tally(parameters.match_iou), [Tally(overlap) for overlap in COCO_IOUS]
    looks: tuple[Look, ...] = ()
    if arguments.data is not None:
        dataset = read_dataset(arguments.data, arguments.classes)
        arguments = replace(arguments, kind=dataset.samples[0].scene.get("kind", arguments.kind))
        detector = _detector(arguments, settings, dataset)
        looks = tuple(looks_at(detector, dataset, [tally, *strict]))
        found = [_record(number, look) for number, look in enumerate(looks)]
        records = [record for record in found if record is not None]
    else:
        detector = _detector(arguments, settings)
        records = list(fresh_records(arguments, parameters, drawn, detector, settings))
        for each in (tally, *strict):
            for record in records:
                record.count(each)
    tables = _tables(records, arguments, parameters, confidence)
    result = Evaluation(
        detector.description,
        confidence,
        tally.pictures,
        tally.average_precision(),
        tally.recall(confidence),
        tally.precision(confidence),
        strict[0].average_precision(),
        float(np.mean([item.average_precision() for item in strict])),
        parameters.match_iou,
        tables,
        tuple(look.path.name for look in looks if look.above(confidence).missed),
        looks,
    )
    kept = asdict(replace(result, looks=()))
    del kept["looks"]
    write_atomically(arguments.out / "evaluation.json", json.dumps(kept, indent=1).encode())
    write_atomically(arguments.out / "table.md", result.text().encode())
    if tables:
        plot_recall(arguments.out / "recall.png", tables, arguments.kind)
    return result


def _tables(
    records: Sequence[SceneRecord], arguments: EvaluateArguments, parameters: EvaluateParameters, confidence: float
) -> dict[str, RangeTable]:
    known = [record for record in records if np.isfinite(record.range_m)]
    if not known:
        return {}
    ship = arguments.kind == "ship"
    span = parameters.ship_range_m if ship else parameters.bar_range_m
    step_m = parameters.ship_bin_m if ship else parameters.bar_bin_m
    edges = [step_m * number for number in range(int(span[0] // step_m), math.ceil(span[1] / step_m) + 1)]
    limit_m = parameters.hazy_below_m
    parts = {
        "all": known,
        "clear": [record for record in known if record.visibility_m >= limit_m],
        "haze": [record for record in known if record.visibility_m < limit_m],
        "no decoys": [record for record in known if record.decoys == 0],
    }
    return {name: range_table(part, edges, confidence, parameters.match_iou) for name, part in parts.items() if part}


def _detector(arguments: EvaluateArguments, settings: DetectorParameters, dataset: Dataset | None = None) -> Detector:
    """As it flies; or one that looks for a set's classes, by number where it has as many, else by name."""
    ship = arguments.kind == "ship"
    weights = arguments.weights or (settings.ship_weights if ship else settings.bar_weights)
    if dataset is None:
        return Detector.load(weights, settings, (settings.ship_class if ship else settings.bar_class,))
    detector = Detector.load(weights, settings)
    if len(detector.kinds) == len(dataset.classes):
        return detector
    why = f"the detector knows {', '.join(detector.reader.classes)}"
    if len(detector.kinds) > len(dataset.classes):
        try:
            return Detector.load(weights, settings, dataset.classes)
        except DataError as error:
            why = str(error)
    raise DataError(
        f"{dataset.folder} has the classes {', '.join(dataset.classes)}; {why}; --classes names the set's classes as "
        "the detector does, --weights gives another detector"
    )


def _record(number: int, look: Look) -> SceneRecord | None:
    """Of a picture whose range is known, and that holds one target at most."""
    if "range_m" not in look.scene or len(look.targets) > 1:
        return None
    target: BoxRow | None = tuple(look.targets[0, 1:5].tolist()) if len(look.targets) else None
    sure = tuple((*row, score) for row, score in zip(look.boxes.tolist(), look.scores.tolist(), strict=True))
    # What is not known of a picture counts neither as clear air nor as haze, nor as without decoys.
    visibility_m, decoys = look.scene.get("visibility_m", math.nan), look.scene.get("decoys", -1)
    return SceneRecord(number, look.scene["range_m"], visibility_m, decoys, target, sure)


def fresh_scenes(parameters: EvaluateParameters, config: Path | None = None) -> SynthParameters:
    """How the scenes of an evaluation are drawn: as `[synth]` says, but for range, place and share of empty ones."""
    return replace(
        synth_parameters(config),
        ship_range_m=parameters.ship_range_m,
        bar_range_m=parameters.bar_range_m,
        uniform_share=1.0,
        empty_share=parameters.empty_share,
        edge_px=parameters.edge_px,
        least_contrast=0.0,
        pictures_per_scene=parameters.pictures_per_scene,
    )


def fresh_records(
    arguments: EvaluateArguments,
    parameters: EvaluateParameters,
    drawn: ShipAndCamera,
    detector: Detector,
    settings: DetectorParameters,
) -> Iterator[SceneRecord]:
    """Records of all fresh scenes: those already in `scenes.jsonl`, then new ones, written as they come."""
    made = _claim(arguments, drawn)
    yield from made.values()
    missing = [number for number in range(arguments.count) if number not in made]
    synth = fresh_scenes(parameters, arguments.config)
    own = None if arguments.workers > 1 else detector
    work = partial(look_at_scenes, arguments=arguments, synth=synth, drawn=drawn, settings=settings, detector=own)
    with (arguments.out / "scenes.jsonl").open("a", encoding="utf-8") as stream:
        made_now = in_workers(work, missing, synth.pictures_per_scene, arguments.workers)
        looks = itertools.chain.from_iterable(made_now)
        for record in followed(looks, f"{arguments.kind} scenes", arguments.count, len(made)):
            stream.write(record.to_json() + "\n")
            stream.flush()
            yield record


def _claim(arguments: EvaluateArguments, drawn: ShipAndCamera) -> dict[int, SceneRecord]:
    """Records that are there already; DataError when they come from other arguments."""
    out = arguments.out
    wanted: dict[str, object] = {"weights": arguments.weights or arguments.kind}
    wanted |= {name: getattr(arguments, name) for name in ("kind", "seed", "frames")} | drawn.note()
    wanted |= asked_of(arguments.config, "detector", "synth", "evaluate")
    if arguments.weights is not None and (file := Path(arguments.weights)).is_file():
        wanted["sha256"] = hashlib.sha256(file.read_bytes()).hexdigest()
    claim(out / "evaluate.json", wanted, "an evaluation")
    lines = out / "scenes.jsonl"
    if not lines.is_file():
        return {}
    text = read_text(lines)
    whole = text[: text.rfind("\n") + 1]  # a line that was cut off is made again
    if whole != text:
        write_atomically(lines, whole.encode())
    records = [SceneRecord.from_json(line, str(lines)) for line in whole.splitlines()]
    return {record.number: record for record in records if record.number < arguments.count}


def look_at_scenes(
    numbers: Sequence[int],
    arguments: EvaluateArguments,
    synth: SynthParameters,
    drawn: ShipAndCamera,
    settings: DetectorParameters,
    detector: Detector | None,
) -> list[SceneRecord]:
    """Draw and look at fresh scenes of one block of light, air and sea; without a detector this process loads it."""
    rig, camera = drawn.rig, Camera.from_parameters(drawn.camera)
    if detector is None:
        detector = _detector(arguments, settings)
    scene_parameters, waves = draw_scene(numbers[0] // synth.pictures_per_scene, synth, arguments.seed)
    with closing(Scene(rig, scene_parameters, np.random.default_rng(waves))) as scene:
        shots = [draw_shot(it, arguments.kind, scene_parameters, camera, rig, synth, arguments.seed) for it in numbers]
        return [_look(shot, scene, camera, rig, synth, detector, settings, arguments) for shot in shots]


class _FirstLook(Detector):
    """A detector that keeps the boxes of the last whole picture: two who look at it cost one look."""

    def __init__(self, detector: Detector) -> None:
        super().__init__(detector.reader, detector.max_iou, detector.kinds, detector.tile_px)
        self._picture: Picture | None = None
        self._found: list[Box] = []

    def detect(self, picture: Picture, min_confidence: float) -> list[Box]:
        if picture is not self._picture:
            self._picture, self._found = picture, super().detect(picture, min(LEAST_CONFIDENCE, min_confidence))
        return [box for box in self._found if box.confidence >= min_confidence]


def _look(
    shot: Shot,
    scene: Scene,
    camera: Camera,
    rig: Rig,
    synth: SynthParameters,
    detector: Detector,
    settings: DetectorParameters,
    arguments: EvaluateArguments,
) -> SceneRecord:
    detector, quality = _FirstLook(detector), jpeg_quality(shot, synth)
    of_ship, of_bar = (detector if shot.kind == kind else None for kind in ("ship", "bar"))
    far = FarVision(of_ship, of_bar, camera, settings, rig)
    targets: list[BoxRow | None] = []
    believed: list[SureBox | None] = []
    found: list[tuple[SureBox, ...]] = []
    heights_m = reported_heights_m(shot, arguments.frames)
    for number in range(arguments.frames):
        t_s = FRAME_S * number
        drawn, edges = draw(shot, t_s, scene, camera, rig, synth)
        picture = compressed(drawn, quality)
        target = None if edges is None else centred(edges)
        partly: BoxRow | None = None
        if target is None and not shot.empty:
            # What is cut off by the picture's edge, or seen too flat, is neither a target nor counted as false.
            cut = target_box(shot.kind, shot.at(t_s, rig), camera, rig, _LEAST_SEEN, 0.0)
            partly = None if cut is None else centred(cut)
        targets.append(target)
        if number == 0 or arguments.keep_boxes:
            rows = map(edges_of, detector.detect(picture, LEAST_CONFIDENCE))
            found.append(tuple(row for row in rows if not hits(row, partly, _LEAST_OVERLAP)))
        gimbal = GimbalAttitude(shot.roll_rad, shot.pitch_rad)
        seen = far.see(Frame(t_s, picture, gimbal, heights_m[number]))
        box = seen.ship_box if shot.kind == "ship" else seen.bar_box
        row = None if box is None else edges_of(box)
        believed.append(None if row is None or hits(row, partly, _LEAST_OVERLAP) else row)
    pairs, kept = tuple(zip(targets, believed, strict=True)), tuple(found) if arguments.keep_boxes else ()
    angles, decoys = (shot.roll_rad, shot.pitch_rad), len(shot.decoys)
    return SceneRecord(
        shot.number, shot.range_m, shot.visibility_m, decoys, targets[0], found[0], pairs, angles, kept, heights_m
    )


def reported_heights_m(shot: Shot, frames: int) -> tuple[float, ...]:
    """What a barometer tells of the camera's height over the water, a frame each; it errs alike in all of them."""
    error_m = BAROMETER_M * float(np.random.default_rng([shot.sensor_seed, 4]).standard_normal())
    up_m, climb_mps = -float(shot.position_in_ned_m[2]), -float(shot.velocity_in_ned_mps[2])
    return tuple(round(up_m + climb_mps * FRAME_S * number + error_m, 3) for number in range(frames))


def plot_recall(path: Path, tables: dict[str, RangeTable], kind: str) -> None:
    """Recall with its intervals, precision, and the boxes' errors over range, as a picture."""
    with drawn(path, (13.0, 3.8), 110) as figure:
        left, centre, right = figure.subplots(1, 3)
        colours = {"clear": "#1f77b4", "haze": "#d98a1f"}
        for name, table in tables.items():
            bins = [item for item in table.bins if item.scenes]
            of = {field: np.array([getattr(item, field) for item in bins]) for field in RangeBin.__dataclass_fields__}
            middle = 0.5 * (of["low_m"] + of["high_m"])
            if name in colours:
                style = {"color": colours[name], "label": f"{name}, one frame"}
                errors = np.maximum((of["recall"] - of["recall_low"], of["recall_high"] - of["recall"]), 0.0)
                left.errorbar(middle, of["recall"], errors, capsize=2, **style)
                centre.plot(middle, of["precision"], **style)
                if np.isfinite(of["confirmed"]).any():
                    style = {"color": colours[name], "label": f"{name}, believed", "linestyle": ":"}
                    left.plot(middle, of["confirmed"], **style)
                    centre.plot(middle, of["believed_precision"], **style)
            elif name == "all":
                right.plot(middle, of["centre_px"], color="#1f77b4", label="centre, median [px]")
                right.plot(middle, of["centre_95_px"], "--", color="#1f77b4", label="centre, 95 % [px]")
                right.plot(middle, 10.0 * of["area_std"], color="#b5446e", label="area, std [10 %]")
        limits = {"recall": 1.02, "precision": 1.02, "error of the box": None}
        for axes, (what, most) in zip((left, centre, right), limits.items(), strict=True):
            axes.set(xlabel=f"range of the {kind} [m]", ylabel=what, ylim=(0.0, most))
            if axes.get_legend_handles_labels()[0]:
                axes.legend(frameon=False, fontsize=8)
