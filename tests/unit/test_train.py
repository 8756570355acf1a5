"""Loss, anchors, scores, and the training run: it learns, resumes bit for bit, and loses nothing."""

import itertools
import math
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PIL import ExifTags, Image

torch = pytest.importorskip("torch")

from studies.networks import random_weights  # noqa: E402

from shipland.errors import DataError  # noqa: E402 - after importorskip
from shipland.learning import run as running  # noqa: E402
from shipland.learning import train as training  # noqa: E402
from shipland.learning.arguments import TrainArguments  # noqa: E402
from shipland.learning.checkpoint import Progress, load_checkpoint, save_checkpoint  # noqa: E402
from shipland.learning.dataset import IGNORED, read_dataset  # noqa: E402
from shipland.learning.export import write_onnx  # noqa: E402
from shipland.learning.loss import (  # noqa: E402
    assign,
    complete_iou,
    decoded_boxes,
    detection_loss,
    fit_anchors,
    squared_error,
)
from shipland.learning.metrics import Tally, match  # noqa: E402
from shipland.learning.settings import LossParameters, TrainParameters, train_parameters  # noqa: E402
from shipland.learning.split import Split  # noqa: E402
from shipland.learning.windows import _NOTHING, ResidentWindows, Windows, _asked_for, _clipped, colour  # noqa: E402
from shipland.learning.yolov3 import yolov3_layers  # noqa: E402
from shipland.vision.far.decode import Decoding, DetectorSpec, decode  # noqa: E402
from shipland.vision.far.layouts import load_reader  # noqa: E402

ANCHORS = (((8.0, 8.0), (12.0, 8.0), (8.0, 12.0)), ((24.0, 24.0), (36.0, 24.0), (24.0, 36.0)), ((80.0, 80.0),) * 3)
WIDE = DetectorSpec(("ship",), ANCHORS, Decoding.WIDE, 0.125)
DARKNET = replace(WIDE, decoding=Decoding.DARKNET)
LOSS = train_parameters("far", None).loss
SHAPES = [(8, 8), (4, 4), (2, 2)]


def rows(*targets):
    return torch.tensor(targets, dtype=torch.float32).reshape(-1, 6)


def test_darknets_assignment_by_hand():
    """One anchor, one cell: 11 × 9 px at (21, 37) is nearest 12 × 8 (scale 0, anchor 1), in cell (2, 4)."""
    work = assign(rows((0, 0, 21, 37, 11, 9)), DARKNET, SHAPES, LOSS.anchor_ratio)
    assert [len(item.row) for item in work] == [1, 0, 0]
    assert (int(work[0].anchor), int(work[0].column), int(work[0].row)) == (1, 2, 4)


def test_wide_assignment_by_hand():
    """Three like anchors on scale 0 and two on scale 1 (24 × 36 is too tall), three cells each where they exist."""
    work = assign(rows((0, 0, 21, 37, 11, 9)), WIDE, SHAPES, 3.0)
    cells = {(int(c), int(r)) for c, r in zip(work[0].column, work[0].row, strict=True)}
    assert cells == {(2, 4), (3, 4), (2, 5)}  # centre at (2.625, 4.625): right and below are nearest
    assert sorted(set(work[0].anchor.tolist())) == [0, 1, 2]
    assert sorted(set(work[1].anchor.tolist())) == [0]  # 36 / 11 and 36 / 9 exceed 3
    assert len(work[2].row) == 0


def test_cells_outside_the_picture_are_left_out():
    work = assign(rows((0, 0, 1, 1, 8, 8)), WIDE, SHAPES, 3.0)
    for item, (height, width) in zip(work, SHAPES, strict=True):
        assert ((item.row >= 0) & (item.row < height) & (item.column >= 0) & (item.column < width)).all()


def test_complete_iou_is_one_only_for_the_same_box():
    box = torch.tensor([[20.0, 20.0, 10.0, 6.0]])
    assert complete_iou(box, box).item() == pytest.approx(1.0, abs=1e-6)
    for change in ([1, 0, 0, 0], [0, 0, 3, 0], [0, 0, 2, -2], [40, 0, 0, 0]):
        assert complete_iou(box + torch.tensor([change], dtype=torch.float32), box).item() < 0.95
    apart = [complete_iou(box + torch.tensor([[shift, 0.0, 0.0, 0.0]]), box).item() for shift in (20.0, 40.0)]
    assert apart[1] < apart[0] < 0.0, "without overlap, nearer must still be better"


def maps_for(targets, spec):
    """Maps that say exactly what the assignment asks for, from the decoding's inverse."""
    maps = [torch.full((1, 18, *shape), -9.0) for shape in SHAPES]
    for scale, work in enumerate(assign(targets, spec, SHAPES, LOSS.anchor_ratio)):
        cells = maps[scale].view(1, 3, 6, *SHAPES[scale])
        stride = (8, 16, 32)[scale]
        for anchor, row, column, target in zip(work.anchor, work.row, work.column, work.target, strict=True):
            place = (target[1:3] / stride - torch.tensor([column, row]) + 0.5) / 2.0
            size = (target[3:5] / torch.tensor(spec.anchors_px[scale][anchor])).sqrt() / 2.0
            cells[0, anchor, :4, row, column] = torch.logit(torch.cat([place, size]), eps=1e-6)
            cells[0, anchor, 4:, row, column] = 9.0
    return maps


def test_right_answers_cost_nothing_and_decode_to_the_target():
    targets = rows((0, 0, 21, 37, 11, 9))
    maps = maps_for(targets, WIDE)
    total, _ = detection_loss(maps, targets, WIDE, LOSS)
    assert total.item() < 1e-3
    boxes, _, _ = decode([item[0].numpy() for item in maps], WIDE, 0.5)
    assert len(boxes) > 3
    np.testing.assert_allclose(boxes, np.tile([21, 37, 11, 9], (len(boxes), 1)), atol=1e-3)
    wrong = [item.clone() for item in maps]
    wrong[0][0, 4, 0, 0] = 9.0  # sure of a box where there is none
    assert detection_loss(wrong, targets, WIDE, LOSS)[0].item() > 100 * total.item()


def test_squared_error_by_hand_and_of_darknets_decoding_alone():
    target, anchor, stride = torch.tensor([[20.0, 36.0, 20.0, 5.0]]), torch.tensor([[10.0, 10.0]]), 8
    raw = torch.tensor([[0.0, 0.0, math.log(2.0), 0.0]])  # the middle of cell (2, 4), twice the anchor's width
    errors = squared_error(raw, torch.tensor([[2.0, 4.0]]), target, anchor, stride)
    assert errors[0].tolist() == pytest.approx([0.0, 0.0, 0.0, 0.5 * math.log(2.0) ** 2], abs=1e-6)
    box = decoded_boxes(raw, torch.tensor([[2.0, 4.0]]), anchor, stride, Decoding.DARKNET)
    assert box[0].tolist() == pytest.approx([20.0, 36.0, 20.0, 10.0])
    squared = LossParameters(box_error="squared")
    assert TrainParameters(decoding=Decoding.DARKNET, loss=squared).loss == squared
    with pytest.raises(ValueError, match="Darknet's decoding"):
        TrainParameters(loss=squared)


def test_unasked_boxes_are_neither_taught_nor_punished():
    target = (0, 0, 21, 37, 11, 9)
    maps = maps_for(rows(target), WIDE)
    ignored = rows((0, -1, *target[2:]))
    assert detection_loss(maps, ignored, WIDE, LOSS)[0].item() < 1e-3
    assert detection_loss(maps, rows(), WIDE, LOSS)[0].item() > 1.0


def test_a_batch_without_targets_has_gradients():
    maps = [torch.zeros(2, 18, *shape, requires_grad=True) for shape in SHAPES]
    detection_loss(maps, rows(), WIDE, LOSS)[0].backward()
    assert all(torch.isfinite(item.grad).all() and item.grad.abs().max() > 0.0 for item in maps)


def test_anchors_cover_the_sizes_they_were_fitted_to(rng):
    sizes = np.exp(rng.normal(np.log(20.0), 0.8, (500, 1)) + rng.normal(0.0, 0.2, (500, 2)))
    anchors = np.array(fit_anchors(sizes, 1)).reshape(9, 2)
    assert np.all(np.diff(anchors.prod(axis=1)) > 0.0)
    worst = np.maximum(sizes[:, None] / anchors, anchors / sizes[:, None]).max(axis=2).min(axis=1)
    assert np.quantile(worst, 0.9) < 1.8
    assert len(np.array(fit_anchors(np.full((5, 2), 10.0), 1)).reshape(9, 2)) == 9
    few = np.exp(rng.normal(np.log(20.0), 0.8, (10, 2)))  # centres lose their targets, which SciPy warns of
    assert len(np.array(fit_anchors(few, 1)).reshape(9, 2)) == 9
    with pytest.raises(DataError, match="no target"):
        fit_anchors(np.zeros((0, 2)), 1)


def test_average_precision_by_hand():
    """Scores .9 hit, .8 false, .7 hit, one target missed: precision 1 at recall 1/3, 2/3 at recall 2/3."""
    tally = Tally(0.5)
    targets = np.array([[0, 10, 10, 8, 8], [0, 40, 10, 8, 8], [0, 70, 10, 8, 8]], np.float32)
    boxes = np.array([[10, 10, 8, 8], [90, 30, 8, 8], [40, 11, 8, 8]], np.float32)
    tally.add(boxes, np.array([0.9, 0.8, 0.7], np.float32), targets)
    assert tally.average_precision() == pytest.approx(1 / 3 + 2 / 3 / 3)
    assert tally.recall(0.75) == pytest.approx(1 / 3)
    assert tally.precision(0.5) == pytest.approx(2 / 3)


def test_a_target_is_hit_once_and_unasked_ones_do_not_count():
    targets = np.array([[0, 10, 10, 8, 8], [-1, 40, 10, 8, 8]], np.float32)
    boxes = np.array([[10, 10, 8, 8], [11, 10, 8, 8], [40, 10, 8, 8]], np.float32)
    assert match(boxes, np.array([0.6, 0.9, 0.8], np.float32), targets, 0.3).tolist() == [-1, 0, -2]


def test_rate_warms_up_and_falls():
    parameters = replace(train_parameters("far", None), steps=1000, warmup_steps=100, learning_rate=0.01)
    rates = [running.learning_rate(step, step / 1000, parameters) for step in range(1000)]
    assert rates[0] == pytest.approx(0.0001)
    assert max(rates) == pytest.approx(0.01, rel=0.03)
    assert rates[-1] == pytest.approx(0.0002, rel=0.05)
    assert np.all(np.diff(rates[100:]) <= 0.0)


@pytest.fixture(scope="module")
def squares(tmp_path_factory):
    """24 noisy pictures of 64 px with a light rectangle of 9–20 px; every fourth is empty."""
    folder = tmp_path_factory.mktemp("squares")
    (folder / "images").mkdir()
    (folder / "labels").mkdir()
    (folder / "classes.txt").write_text("ship\n")
    rng = np.random.default_rng(8)
    for number in range(24):
        picture = rng.normal(80.0, 12.0, (64, 64, 3))
        line = ""
        if number % 4:
            w, h = rng.integers(9, 21, 2)
            x, y = rng.integers(0, 64 - w), rng.integers(0, 64 - h)
            picture[y : y + h, x : x + w] += 110.0
            line = f"0 {(x + w / 2) / 64} {(y + h / 2) / 64} {w / 64} {h / 64}\n"
        cv2.imwrite(str(folder / "images" / f"{number:02d}.png"), np.clip(picture, 0, 255).astype(np.uint8))
        (folder / "labels" / f"{number:02d}.txt").write_text(line)
    return folder


SETTINGS = """[train]
warmup_steps = 5
calibration_pictures = 2
[train.far]
evaluate_every = 5
validation_pictures = 4
hard_rounds = 2
mine_pictures = 8
mine_keep = 4
learning_rate = 0.004
held_out = 0.15
"""


def arguments(folder: Path, out: Path, steps: int, **more) -> TrainArguments:
    config = folder / "settings.toml"
    config.write_text(SETTINGS)
    return TrainArguments(
        (folder,), out, steps=steps, batch=6, window_px=64, width=0.125, device="cpu", config=config, **more
    )


def test_training_learns(squares, tmp_path):
    """On one batch the loss falls to a third within 24 steps."""
    wanted = arguments(squares, tmp_path / "run", 24)
    parameters, dataset = training._parameters(wanted), read_dataset(squares)
    torch.set_num_threads(1)
    run = training._start(wanted, parameters, Split(dataset, dataset, ""))
    batch = Windows(dataset, parameters, run.device).draw([], np.random.default_rng(1))
    losses = []
    for step in range(24):
        losses.append(float(running.step(run, *batch, 0.0).sum()))
        run.progress.step = step + 1
    assert losses[-1] < losses[0] / 3.0


PLAIN = dict.fromkeys(("contrast", "brightness", "gamma", "saturation", "hue_deg", "tone"), 0.0)
PLAIN |= dict.fromkeys(("blur", "sharpen", "noise", "mosaic"), 0.0)


def windows_of(source, dataset, parameters):
    """From disk or from memory, on the CPU."""
    more = (1,) if source is ResidentWindows else ()
    return source(dataset, parameters, torch.device("cpu"), *more)


@pytest.mark.parametrize("source", [Windows, ResidentWindows])
@pytest.mark.parametrize("mosaic", [0.0, 1.0])
def test_windows_hold_what_the_pictures_hold(squares, source, mosaic):
    """Uncoloured and near their own scale: inside every target of a window it is light, and nothing light is untold."""
    parameters = training._parameters(arguments(squares, squares / "none", 5))
    augment = replace(parameters.augment, scale_min=0.8, scale_max=1.25, **PLAIN | {"mosaic": mosaic})
    windows = windows_of(source, read_dataset(squares), replace(parameters, augment=augment, batch=40))
    pictures, targets = windows.draw([], np.random.default_rng(3))
    assert pictures.shape == (40, 3, 64, 64)
    light = (pictures.mean(1) > 130.0 / 255.0).float()
    covered = torch.zeros_like(light)
    for number, kind, x, y, w, h in targets.tolist():
        rows, columns = slice(round(y - h / 2), round(y + h / 2)), slice(round(x - w / 2), round(x + w / 2))
        if kind >= 0 and min(w, h) > 4:
            assert light[int(number), rows, columns].mean() > 0.85
        covered[int(number), max(rows.start - 2, 0) : rows.stop + 2, max(columns.start - 2, 0) : columns.stop + 2] = 1.0
    assert (light * (1.0 - covered)).mean() < 0.002
    assert (targets[:, 1] >= 0).sum() > 15


def test_windows_from_disk_and_from_memory_are_the_same(squares):
    parameters, dataset = training._parameters(arguments(squares, squares / "none", 5)), read_dataset(squares)
    drawn = [
        windows_of(source, dataset, parameters).draw([(1, 20.0, 30.0)], np.random.default_rng(7))
        for source in (Windows, Windows, ResidentWindows)
    ]
    for pictures, targets in drawn[1:]:
        assert torch.equal(pictures, drawn[0][0])
        assert torch.equal(targets, drawn[0][1])


def test_a_plain_window_has_the_pictures_own_pixels(squares):
    parameters, dataset = training._parameters(arguments(squares, squares / "none", 5)), read_dataset(squares)
    parameters = replace(parameters, augment=replace(parameters.augment, scale_min=1.0, scale_max=1.0))
    whole = windows_of(Windows, dataset, parameters).plain(1, np.random.default_rng(0))
    np.testing.assert_array_equal(whole, dataset.samples[1].load()[0])


def test_targets_cut_off_or_tiny_are_not_asked_for():
    boxes = torch.tensor(
        [
            [0.0, 20, 20, 10, 10, 100],  # whole
            [0.0, 1, 20, 10, 10, 100],  # six tenths inside
            [0.0, -3, 20, 10, 10, 100],  # two tenths inside
            [0.0, 30, 30, 3, 3, 9],  # tiny
            [0.0, -9, 20, 10, 10, 100],  # outside
        ]
    )
    cut = _asked_for(_clipped(boxes, torch.zeros(2), torch.full((2,), 40.0)), train_parameters("far", None).augment)
    assert cut[:, 0].tolist() == [0.0, 0.0, IGNORED, IGNORED, _NOTHING]
    np.testing.assert_allclose(cut[1, 1:5], [3, 20, 6, 10])


def test_colours_change_within_their_bounds_and_not_at_all_without_any():
    windows = torch.rand((6, 3, 32, 32), generator=torch.Generator().manual_seed(1))
    augment = train_parameters("far", None).augment
    same = colour(windows, replace(augment, **PLAIN), torch.Generator().manual_seed(2))
    np.testing.assert_allclose(same, windows, atol=0.5 / 255.0 + 1e-6)
    greys = torch.full((6, 3, 32, 32), 0.5)
    turned = colour(greys, replace(augment, **PLAIN | {"hue_deg": 60.0, "saturation": 0.9}), torch.Generator())
    np.testing.assert_allclose(turned, greys, atol=0.5 / 255.0 + 1e-6)  # grey has no hue
    assert (colour(windows, augment, torch.Generator().manual_seed(2)) - windows).abs().mean() > 0.02


def test_pictures_that_are_fitted_to_the_window_wait_so(squares):
    parameters = training._parameters(arguments(squares, squares / "none", 5))
    parameters = replace(parameters, window_px=96, augment=replace(parameters.augment, fit=True))
    dataset = read_dataset(squares)
    windows = ResidentWindows(dataset, parameters, torch.device("cpu"), 1)
    for index, sample in enumerate(dataset.samples):
        picture, targets = windows.load(index)
        assert picture.shape == (96, 96, 3)
        np.testing.assert_allclose(targets[:, 1:], 1.5 * sample.load()[1][:, 1:], rtol=1e-6)
    drawn, _ = windows.draw([], np.random.default_rng(5))
    assert drawn.shape[1:] == (3, 96, 96)


def test_windows_from_memory_lie_over_hard_places(squares):
    parameters = training._parameters(arguments(squares, squares / "none", 5))
    dataset = read_dataset(squares)
    windows = ResidentWindows(dataset, replace(parameters, hard_fraction=0.99, batch=8), torch.device("cpu"), 1)
    index = next(number for number, sample in enumerate(dataset.samples) if len(sample.boxes))
    picture, rows = windows.load(index)
    np.testing.assert_array_equal(picture, dataset.samples[index].load()[0])
    np.testing.assert_allclose(rows, dataset.samples[index].load()[1])
    _, targets = windows.draw([(index, float(rows[0, 1]), float(rows[0, 2]))], np.random.default_rng(4))
    assert len(targets) >= 8


def test_a_run_from_memory_stops_when_its_time_is_up(squares, tmp_path):
    """A time of no steps still ends with a detector; hard rounds happen in a run of ten steps."""
    wanted = arguments(squares, tmp_path / "run", 1000, minutes=1e-3, memory="device")
    assert load_reader(training.train(wanted).detector, "onnxruntime", "fp32", 1).classes == ("ship",)
    _, _, progress = load_checkpoint(tmp_path / "run" / running.LAST)
    assert 1 <= progress.step < 1000
    training.train(arguments(squares, tmp_path / "hard", 10, memory="device"))
    assert load_checkpoint(tmp_path / "hard" / running.LAST)[2].history[-1]["hard_places"] > 0


@pytest.mark.parametrize("limit_s", [0.025, 0.035, 0.045])
def test_whenever_its_time_is_up_the_last_step_is_kept(squares, tmp_path, monkeypatch, limit_s):
    """A clock that goes on by 10 ms whenever it is read: the time may run out in any part of a step."""
    ticks = itertools.count()
    monkeypatch.setattr(running.time, "monotonic", lambda: 0.01 * next(ticks))
    training.train(arguments(squares, tmp_path, 1000, minutes=limit_s / 60.0))
    assert load_checkpoint(tmp_path / running.LAST)[2].seconds >= limit_s


def test_resume_refuses_another_seed_and_other_weights(squares, tmp_path):
    trained = training.train(arguments(squares, tmp_path / "run", 2)).detector
    with pytest.raises(DataError, match="begun with seed 0, not 7"):
        training.train(arguments(squares, tmp_path / "run", 4, resume=True, seed=7))
    with pytest.raises(DataError, match=r"begun with weights none, not .*onnx"):
        training.train(arguments(squares, tmp_path / "run", 4, resume=True, weights=trained))


def test_a_folder_named_twice_is_refused(squares, tmp_path):
    wanted = replace(arguments(squares, tmp_path / "run", 2), data=(squares, squares / "."))
    with pytest.raises(DataError, match=r"names .* twice"):
        training.train(wanted)


def copied(folder, to, names):
    for part in ("images", "labels"):
        (to / part).mkdir(parents=True, exist_ok=True)
    for name in names:
        shutil.copy(folder / "images" / f"{name}.png", to / "images")
        shutil.copy(folder / "labels" / f"{name}.txt", to / "labels")
    (to / "classes.txt").write_text("ship\n")
    return to


def test_resume_refuses_pictures_that_divide_otherwise(squares, tmp_path):
    """With pictures more or less, some that are held out now would have been trained on."""
    data = copied(squares, tmp_path / "data", [f"{number:02d}" for number in range(14)])
    training.train(arguments(data, tmp_path / "run", 2))
    copied(squares, data, [f"{number:02d}" for number in range(14, 24)])
    with pytest.raises(DataError, match=r"begun with pictures 12 to train on .*, not 20 to train on"):
        training.train(arguments(data, tmp_path / "run", 4, resume=True))


def test_a_run_stopped_between_its_checkpoints_keeps_the_best(squares, tmp_path, monkeypatch):
    """Stopped within the second evaluation, the best of three, after the first of its two checkpoints."""
    scores = {5: 0.1, 10: 0.9, 15: 0.2}
    save, saved = running.Run.save, []

    def judged(run):
        return SimpleNamespace(average_precision=lambda: scores[run.progress.step], recall=lambda _: 0.0)

    def stopping(run, path):
        save(run, path)
        saved.append(path)
        if len(saved) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(running, "validate", judged)
    monkeypatch.setattr(running.Run, "save", stopping)
    with pytest.raises(KeyboardInterrupt):
        training.train(arguments(squares, tmp_path, 15))
    trained = training.train(arguments(squares, tmp_path, 15, resume=True))
    assert trained.progress.step == 10


def test_anchors_are_fitted_to_targets_as_the_window_shows_them(tmp_path, monkeypatch):
    """Square targets in three pictures of 128 × 64 px, one of which is stored on its side."""
    for part in ("images", "labels"):
        (tmp_path / part).mkdir()
    upright = np.zeros((64, 128, 3), np.uint8)
    for number, picture in enumerate((upright, upright, np.ascontiguousarray(upright.swapaxes(0, 1)))):
        exif = Image.Exif()
        exif[ExifTags.Base.Orientation] = 6 if picture.shape[0] == 128 else 1
        Image.fromarray(picture).save(tmp_path / "images" / f"{number}.jpg", exif=exif)
        (tmp_path / "labels" / f"{number}.txt").write_text("0 0.5 0.5 0.25 0.5\n")
    (tmp_path / "classes.txt").write_text("ship\n")
    sizes_px = []
    monkeypatch.setattr(training, "fit_anchors", lambda sizes, _: sizes_px.append(sizes) or ANCHORS)
    wanted = arguments(tmp_path, tmp_path / "none", 5)
    parameters = training._parameters(wanted)
    for fit in (False, True):
        fitted = replace(parameters, augment=replace(parameters.augment, fit=fit))
        training._spec(wanted, fitted, read_dataset(tmp_path))
    np.testing.assert_allclose(sizes_px[0], np.full((3, 2), 32.0))
    np.testing.assert_allclose(sizes_px[1], np.full((3, 2), 16.0))


def test_resumed_run_equals_one_in_a_piece(squares, tmp_path, monkeypatch):
    """Cut off after five steps and resumed to ten: every tensor as in a run of ten, bit for bit."""
    training.train(arguments(squares, tmp_path / "whole", 10))
    cut = tmp_path / "cut"
    write = running.Run.write_detector

    def stop(run):
        write(run)
        raise KeyboardInterrupt

    monkeypatch.setattr(running.Run, "write_detector", stop)
    with pytest.raises(KeyboardInterrupt):
        training.train(arguments(squares, cut, 10))
    monkeypatch.setattr(running.Run, "write_detector", write)
    assert load_reader(cut / "detector.onnx", "onnxruntime", "fp32", 1).note.startswith("shipland train, step 5")
    assert (cut / "curves.png").is_file()
    with pytest.raises(DataError, match="--resume"):
        training.train(arguments(squares, cut, 10))
    detector = training.train(arguments(squares, cut, 10, resume=True)).detector
    one, _, _ = load_checkpoint(tmp_path / "whole" / training.LAST)
    two, _, _ = load_checkpoint(cut / training.LAST)
    assert one.keys() == two.keys()
    assert all(torch.equal(one[part][name], two[part][name]) for part in one for name in one[part])
    assert load_reader(detector, "onnxruntime", "fp32", 1).classes == ("ship",)
    assert {item.name for item in cut.iterdir()} >= {"detector-int8.onnx", "curves.png", "model-card.md"}


def test_checkpoints_that_cannot_be_read_are_named(tmp_path):
    path = tmp_path / "last.safetensors"
    with pytest.raises(DataError, match="does not exist"):
        load_checkpoint(path)
    save_checkpoint(path, {"a": {"b": torch.ones(3)}}, WIDE, Progress(step=7))
    tensors, spec, progress = load_checkpoint(path)
    assert torch.equal(tensors["a"]["b"], torch.ones(3))
    assert (spec, progress.step) == (WIDE, 7)
    path.write_bytes(path.read_bytes()[:-6])
    with pytest.raises(DataError, match="is truncated"):
        load_checkpoint(path)
    path.write_bytes(b"PK\x03\x04 a zip archive, as torch.save writes")
    with pytest.raises(DataError, match=r"last\.safetensors is truncated or no checkpoint"):
        load_checkpoint(path)


def test_a_failed_write_leaves_the_old_checkpoint(tmp_path, monkeypatch):
    path = tmp_path / "last.safetensors"
    save_checkpoint(path, {"a": {"b": torch.ones(3)}}, WIDE, Progress(step=1))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        save_checkpoint(path, {"a": {"b": torch.zeros(3)}}, WIDE, Progress(step=2))
    assert load_checkpoint(path)[2].step == 1
    assert [item.name for item in tmp_path.iterdir()] == ["last.safetensors"]


def test_a_detectors_file_is_a_start(squares, tmp_path):
    """Its network answers as the file does (16-bit weights: to 0.2 %), and its normalisation stays as it is."""
    layers = yolov3_layers(1, 0.125)
    weights = random_weights(layers, np.random.default_rng(3))
    file = tmp_path / "detector.onnx"
    write_onnx(file, layers, weights, replace(WIDE, width=0.125))
    wanted = arguments(squares, tmp_path / "run", 5, weights=file)
    parameters, dataset = training._parameters(wanted), read_dataset(squares)
    assert parameters.freeze_norm
    parameters, parts = replace(parameters, bf16=False), Split(dataset, dataset, "")
    run = training._start(wanted, parameters, parts)
    picture = np.random.default_rng(4).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    ours = run.maps_of([picture])[0]
    for mine, theirs in zip(ours, load_reader(file, "onnxruntime", "fp32", 1).network.run(picture), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=2e-3 * np.abs(theirs).max())
    before = [norm.running_mean.clone() for norm in run.network.modules() if isinstance(norm, torch.nn.BatchNorm2d)]
    windows = Windows(dataset, parameters, run.device)
    running.step(run, *windows.draw([], np.random.default_rng(1)), 0.0)
    after = [norm.running_mean for norm in run.network.modules() if isinstance(norm, torch.nn.BatchNorm2d)]
    assert all(torch.equal(one, two) for one, two in zip(before, after, strict=True))
    with pytest.raises(DataError, match="of another width"):
        training._start(replace(wanted, width=0.25), parameters, parts)
    file.write_bytes(b"not a network")
    (file.parent / "SHA256SUMS").unlink()  # with it the file is damaged, which is said first
    with pytest.raises(DataError, match=r"detector\.onnx is no ONNX network"):
        training._start(wanted, parameters, parts)


def test_start_from_weights_of_another_shape_is_refused(squares, tmp_path):
    other = tmp_path / "other.safetensors"
    save_checkpoint(other, {"average": {"a": torch.ones(1)}}, replace(WIDE, width=0.5), Progress())
    with pytest.raises(DataError, match=r"has width 0\.5"):
        training.train(arguments(squares, tmp_path / "run", 5, weights=other))


def test_settings_that_cannot_be_are_refused(squares, tmp_path):
    with pytest.raises(DataError, match="window_px must be a multiple of 32"):
        training.train(replace(arguments(squares, tmp_path / "run", 5), window_px=100))
    with pytest.raises(DataError, match="no data set given"):
        training.train(replace(arguments(squares, tmp_path / "run", 5), data=()))
