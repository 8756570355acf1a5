"""Raw maps to boxes, tiles, weights files, and the far vision's tracks."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studies.networks import random_weights

from shipland.errors import DataError
from shipland.learning.export import onnx_bytes, write_int8, write_onnx
from shipland.learning.yolov3 import yolov3_layers
from shipland.messages import Box, Frame, GimbalAttitude
from shipland.rig import Rig
from shipland.vision.far.decode import Decoding, DetectorSpec, decode, iou, suppress, to_boxes
from shipland.vision.far.detector import Detector, cut_tile, padded, weights_path
from shipland.vision.far.far import FarVision
from shipland.vision.far.layouts import load_reader
from shipland.vision.far.search import log_odds
from shipland.vision.parameters import detector_parameters

ANCHORS = (((6.0, 5.0), (9.0, 7.0), (12.0, 12.0)), ((20.0, 14.0), (30.0, 20.0), (40.0, 36.0)), ((60.0, 50.0),) * 3)
SPEC = DetectorSpec(("ship",), ANCHORS, Decoding.WIDE, 0.125)


def empty_maps(rows=8, columns=8):
    return [np.full((18, rows // step, columns // step), -20.0, np.float32) for step in (1, 2, 4)]


def test_wide_decoding_by_hand():
    """Scale 1 (stride 16), anchor 2, cell (3, 1): x = 0.4 → σ = 0.5987; w = −0.3 → σ = 0.4256."""
    maps = empty_maps()
    maps[1].reshape(3, 6, 4, 4)[2, :, 1, 3] = (0.4, 0.0, -0.3, 0.0, 1.0, 2.0)
    boxes, scores, kinds = decode(maps, SPEC, 0.3)
    np.testing.assert_allclose(
        boxes, [[16 * (3 + 2 * 0.598688 - 0.5), 16 * 1.5, 40 * (2 * 0.425557) ** 2, 36.0]], rtol=1e-5
    )
    assert scores[0] == pytest.approx(0.731059 * 0.880797, rel=1e-5)
    assert kinds[0] == 0


def test_darknets_decoding_by_hand():
    """[YOLOv3, §2.1]: centre s(c + σ(x)), size a·exp(w)."""
    spec = DetectorSpec(("ship",), ANCHORS, Decoding.DARKNET, 0.125)
    maps = empty_maps()
    maps[0].reshape(3, 6, 8, 8)[0, :, 5, 2] = (0.4, 0.0, -0.3, 0.2, 1.0, 2.0)
    boxes, _, _ = decode(maps, spec, 0.3)
    np.testing.assert_allclose(boxes, [[8 * 2.598688, 8 * 5.5, 6 * np.exp(-0.3), 5 * np.exp(0.2)]], rtol=1e-5)


def test_nothing_sure_gives_nothing():
    boxes, scores, kinds = decode(empty_maps(), SPEC, 0.05)
    assert boxes.shape == (0, 4) and len(scores) == len(kinds) == 0
    assert suppress(boxes, scores, kinds, 0.5, merge=True)[0].shape == (0, 4)


def test_a_least_confidence_of_one_and_a_box_that_is_no_number_spoil_nothing():
    maps = empty_maps()
    cells = maps[0].reshape(3, 6, 8, 8)
    cells[0, :, 5, 2], cells[1, :, 5, 2] = (np.nan, 0.0, 0.0, 0.0, 9.0, 9.0), (0.4, 0.0, 0.0, 0.0, 6.0, 6.0)
    boxes, scores, kinds = decode(maps, SPEC, 0.3)
    np.testing.assert_allclose(boxes, [[8 * (2 + 2 * 0.598688 - 0.5), 44.0, 9.0, 7.0]], rtol=1e-5)
    assert len(suppress(boxes, scores, kinds, 0.5, merge=True)[0]) == 1
    assert len(decode(maps, SPEC, 1.0)[0]) == 0


box_rows = st.tuples(*[st.floats(5.0, 60.0)] * 2, *[st.floats(1.0, 40.0)] * 2)


@given(box_rows, box_rows)
def test_overlap_against_a_count_of_cells(a, b):
    """The peer counts the midpoints of a 0.25-px grid; its error is a cell along both outlines."""
    grid = np.arange(-20.0, 90.0, 0.25) + 0.125

    def inside(box):
        x, y, w, h = box
        return np.outer(np.abs(grid - y) < h / 2, np.abs(grid - x) < w / 2)

    both, either = (inside(a) & inside(b)).sum() / 16, (inside(a) | inside(b)).sum() / 16
    ours = float(iou(np.array([a]), np.array([b]))[0, 0])
    outline = 0.25 * 2 * (a[2] + a[3] + b[2] + b[3])
    assert abs(ours - both / either) <= 2.0 * outline / max(either - outline, 1.0)
    assert ours == pytest.approx(float(iou(np.array([b]), np.array([a]))[0, 0]), abs=1e-6)


@given(st.lists(st.tuples(box_rows, st.floats(0.1, 1.0)), min_size=1, max_size=12))
def test_suppression_leaves_no_two_alike(rows):
    boxes = np.array([row for row, _ in rows], np.float32)
    scores = np.array([score for _, score in rows], np.float32)
    kept, sure, _ = suppress(boxes, scores, np.zeros(len(rows), np.float32), 0.45, merge=False)
    assert sure[0] == scores.max()
    assert np.all(np.diff(sure) <= 0.0)
    overlap = iou(kept, kept)
    assert np.all(overlap[~np.eye(len(kept), dtype=bool)] <= 0.4501)


def test_merging_weighs_by_confidence_and_keeps_the_best_ones():
    boxes = np.array([[10, 10, 8, 8], [11, 10, 8, 8], [12, 10, 8, 8]], np.float32)
    kept, sure, _ = suppress(boxes, np.array([0.8, 0.4, 0.1], np.float32), np.zeros(3, np.float32), 0.3, merge=True)
    np.testing.assert_allclose(kept, [[(0.8 * 10 + 0.4 * 11) / 1.2, 10, 8, 8]], rtol=1e-6)
    assert sure == pytest.approx([0.8])


def test_pixel_centres_of_a_tile():
    """A box over the tile's first pixel, edges 0 … 1, is centred on the picture's pixel of that column and row."""
    (box,) = to_boxes(np.array([[0.5, 0.5, 1, 1]], np.float32), np.array([0.9], np.float32), (100.0, 40.0), 1.0)
    assert box.centre_px == (100.0, 40.0)
    (box,) = to_boxes(np.array([[0.5, 0.5, 1, 1]], np.float32), np.array([0.9], np.float32), (100.0, 40.0), 2.0)
    assert box.centre_px == (100.5, 40.5)  # it covers the pixels 100 and 101


@pytest.mark.parametrize("centre", [(0.0, 0.0), (100.0, 60.0), (199.0, 119.0), (-50.0, 500.0)])
def test_tile_is_a_part_of_the_picture(centre, rng):
    picture = rng.integers(0, 256, (120, 200, 3), dtype=np.uint8)
    tile, (left, top) = cut_tile(picture, centre, 96)
    np.testing.assert_array_equal(tile, picture[int(top) : int(top) + 96, int(left) : int(left) + 96])
    wide, _ = cut_tile(picture, centre, 160)
    assert wide.shape == (160, 160, 3)


def test_padding_mirrors_at_the_last_pixel(rng):
    picture = rng.integers(0, 256, (70, 96, 3), dtype=np.uint8)
    whole = padded(picture)
    assert whole.shape == (96, 96, 3)
    np.testing.assert_array_equal(whole[:70], picture)
    np.testing.assert_array_equal(whole[80], picture[58])
    assert padded(picture[:1, :1]).shape == (32, 32, 3)


@pytest.fixture(scope="module")
def weights_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "tiny.onnx"
    layers = yolov3_layers(1, 0.125)
    write_onnx(path, layers, random_weights(layers, np.random.default_rng(5)), SPEC, half=False)
    return path


@pytest.mark.parametrize("runtime", ["openvino", "onnxruntime"])
def test_runtimes_agree_with_torch(weights_file, runtime):
    """Same weights, same picture; float32 sums over 75 layers in another order, so a thousandth of the spread."""
    torch = pytest.importorskip("torch")
    pytest.importorskip(runtime)
    from shipland.learning.network import Network, load_weights

    layers = yolov3_layers(1, 0.125)
    network = Network(layers).eval()
    load_weights(network, random_weights(layers, np.random.default_rng(5)))
    picture = np.random.default_rng(6).integers(0, 256, (64, 96, 3), dtype=np.uint8)
    with torch.no_grad():
        wanted = network(torch.from_numpy(picture.transpose(2, 0, 1)[None].astype(np.float32) / 255.0))
    reader = load_reader(weights_file, runtime, "fp32", 1)
    assert reader.classes == SPEC.classes
    for mine, theirs in zip(reader.network.run(picture), wanted, strict=True):
        np.testing.assert_allclose(mine, theirs[0].numpy(), atol=1e-3 * float(theirs.std()))


def test_pictures_of_many_sizes_leave_few_networks_behind(weights_file):
    pytest.importorskip("openvino")
    network = load_reader(weights_file, "openvino", "fp32", 1).network
    for rows in range(1, 14):
        network.run(np.zeros((32 * rows, 32, 3), np.uint8))
    assert len(network._requests) == 8
    network.run(np.zeros((32 * 6, 32, 3), np.uint8))  # the oldest that is left
    network.run(np.zeros((32, 32, 3), np.uint8))
    assert (32 * 6, 32, 3, 1.0) in network._requests


def test_half_and_int8_files_are_near_the_full_one(weights_file, tmp_path):
    """16-bit weights to a fiftieth of the maps' spread, 8-bit ones (random weights, one picture) to a half."""
    pytest.importorskip("onnxruntime")
    layers = yolov3_layers(1, 0.125)
    weights = random_weights(layers, np.random.default_rng(5))
    picture = np.random.default_rng(0).integers(0, 256, (64, 96, 3), dtype=np.uint8)
    write_onnx(tmp_path / "half.onnx", layers, weights, SPEC, half=True)
    write_int8(tmp_path / "int8.onnx", layers, weights, SPEC, lambda: iter([picture]))
    assert (tmp_path / "half.onnx").stat().st_size < 0.55 * weights_file.stat().st_size
    assert (tmp_path / "int8.onnx").stat().st_size < 0.45 * weights_file.stat().st_size
    wanted = load_reader(weights_file, "openvino", "fp32", 1).network.run(picture)
    for name, share in (("half", 0.02), ("int8", 0.5)):
        maps = load_reader(tmp_path / f"{name}.onnx", "openvino", "fp32", 1).network.run(picture)
        for mine, full in zip(maps, wanted, strict=True):
            assert np.sqrt(np.mean((mine - full) ** 2)) < share * full.std(), name


def test_foreign_weights_are_refused_by_name(weights_file, tmp_path):
    with pytest.raises(DataError, match="do not exist"):
        load_reader(tmp_path / "none.onnx")
    text = tmp_path / "text.onnx"
    text.write_text("hello")
    with pytest.raises(DataError, match=r"text\.onnx is no ONNX network"):
        load_reader(text)
    cut = tmp_path / "cut.onnx"
    cut.write_bytes(weights_file.read_bytes()[:5000])
    for runtime in ("openvino", "onnxruntime"):
        with pytest.raises(DataError, match=r"cut\.onnx is no ONNX network"):
            load_reader(cut, runtime)


def test_maps_without_our_metadata_are_refused(tmp_path):
    onnx = pytest.importorskip("onnx")
    layers = yolov3_layers(1, 0.125)
    model = onnx.load_from_string(
        onnx_bytes(layers, random_weights(layers, np.random.default_rng(1)), SPEC, half=False)
    )
    del model.metadata_props[:]
    path = tmp_path / "foreign.onnx"
    path.write_bytes(model.SerializeToString())
    for runtime in ("openvino", "onnxruntime"):
        with pytest.raises(DataError, match=r"scale0 \[1, 18, .*expected a file of `shipland train`"):
            load_reader(path, runtime)


def test_unknown_weights_name_the_packaged_ones():
    with pytest.raises(DataError, match="no detector weights 'tanker'"):
        weights_path("tanker")


class Scripted:
    """A detector that sees what it is told to, where a tile covers it."""

    def __init__(self):
        self.boxes = []
        self.whole_frames = 0

    def detect(self, picture, min_confidence):
        self.whole_frames += 1
        return [box for box in self.boxes if box.confidence >= min_confidence]

    def detect_in_tile(self, picture, centre_px, tile_px, reduction, min_confidence):
        _, corner = cut_tile(picture, centre_px, tile_px * reduction)
        reach = tile_px * reduction
        return [
            box
            for box in self.boxes
            if box.confidence >= min_confidence
            and all(0 <= at - low < reach for at, low in zip(box.centre_px, corner, strict=True))
        ]


def ship_at(column, row, width=12.0, confidence=0.9):
    return Box((column, row), (width, 0.7 * width), confidence)


def needed(stage, confidence=0.9):
    """Frames until a ship of this confidence in every frame is believed, where no height is told."""
    settings = stage.parameters.ship
    each = log_odds(confidence) - log_odds(settings.neutral_confidence)
    return max(settings.confirm_hits, math.ceil(settings.believe_evidence / each))


class Stage:
    """Far vision with scripted detectors, frame after frame at 10 Hz."""

    def __init__(self, camera, *, bar=False):
        self.parameters = detector_parameters()
        self.ship = Scripted()
        self.bar = Scripted() if bar else None
        self.far = FarVision(self.ship, self.bar, camera, self.parameters, Rig())
        self.t_s = 0.0

    def see(self, ship=(), bar=(), step_s=0.1, pitch_rad=0.0):
        self.t_s += step_s
        self.ship.boxes = list(ship)
        if self.bar is not None:
            self.bar.boxes = list(bar)
        picture = np.zeros((720, 1280, 3), np.uint8)
        return self.far.see(Frame(self.t_s, picture, GimbalAttitude(0.0, pitch_rad)))


def test_a_thing_seen_as_two_boxes_is_one_candidate(camera):
    """Both boxes of a ship jump about; the evidence must not be shared out to two tracks."""
    stage, rng = Stage(camera), np.random.default_rng(4)
    need = needed(stage)
    alone = [stage.see([ship_at(600, 370, 24.0)]).ship_box is not None for _ in range(need + 3)].index(True)
    stage = Stage(camera)
    seen = []
    for _ in range(need + 3):
        beside = ship_at(600 + rng.uniform(8.0, 14.0), 376, 22.0, confidence=0.4)
        seen.append(stage.see([ship_at(600 + rng.uniform(-6.0, 6.0), 370, 24.0), beside]).ship_box is not None)
    assert seen.index(True) == alone
    assert len(stage.far._ship.tracks) == 0


def test_a_buoy_as_sure_as_a_ship_is_told_by_its_size_and_place(camera, rig):
    """From 20 m up; both are as wide in the picture, the buoy lies much lower."""
    ship_px, buoy_px = ship_at(600, 440, 24.0, confidence=0.8), ship_at(300, 660, 24.0, confidence=0.85)
    for height_m, taken in ((20.0, 600), (None, 300)):
        stage = Stage(camera)
        stage.far = FarVision(stage.ship, None, camera, stage.parameters, rig)
        picture, seen = np.zeros((720, 1280, 3), np.uint8), None
        stage.ship.boxes = [ship_px, buoy_px]
        for number in range(30):
            seen = stage.far.see(Frame(0.1 * number, picture, GimbalAttitude(0.0, -0.05), height_m)).ship_box
        assert seen is not None and seen.centre_px[0] == taken


def test_a_box_is_believed_after_some_hits_and_only_where_it_is_seen(camera):
    stage = Stage(camera)
    need = needed(stage)
    seen = [stage.see([ship_at(600, 350)]).ship_box for _ in range(need)]
    assert seen[:-1] == [None] * (need - 1)
    assert seen[-1].centre_px == (600, 350)
    nothing = stage.see()
    assert nothing.ship_box is None
    assert "missed" in nothing.reason
    assert stage.see([ship_at(601, 350)]).ship_box is not None


def test_a_flash_is_never_believed(camera):
    """Boxes that jump about the frame, one a frame, as sure as can be."""
    stage = Stage(camera)
    rng = np.random.default_rng(2)
    for _ in range(40):
        assert stage.see([ship_at(*rng.uniform([50, 50], [1230, 670]))]).ship_box is None


def test_tracking_looks_at_tiles(camera):
    stage = Stage(camera)
    need = needed(stage, 0.97)
    for number in range(need + stage.parameters.recheck_frames):
        stage.see([ship_at(600 + number, 370, confidence=0.97)])
    assert stage.ship.whole_frames == need
    stage.see([ship_at(633, 370, confidence=0.97)])
    assert stage.ship.whole_frames == need + 1  # searched again, for a surer one


def test_a_steady_drift_is_followed(camera):
    """120 px/s across the frame: 12 px a frame, the whole way."""
    stage = Stage(camera)
    seen = [stage.see([ship_at(100 + 12 * number, 350)]).ship_box for number in range(60)]
    assert all(box is not None for box in seen[needed(stage) - 1 :])


def test_a_nose_that_swings_under_a_slow_detector_does_not_lose_the_ship(camera):
    """At 2 Hz, as a frigate's drone saw it; what lies beyond the gate once is to cost a frame, not the track."""
    stage = Stage(camera)
    columns = [635.0] * 12 + [602.0, 699.0, 697.0, 671.0, 637.0, 658.0, 692.0, 703.0, 697.0, 707.0, 681.0, 681.0]
    seen = [stage.see([ship_at(column, 350, 24.0)], step_s=0.5).ship_box is not None for column in columns]
    assert all(seen[4:13])
    assert sum(seen[13:]) >= len(seen[13:]) - 1


def test_a_gimbal_step_is_taken_out(camera):
    """Half a radian of pitch in a second moves the picture's content by 46 px a frame, down as the camera looks up."""
    stage = Stage(camera)
    pitch, row = -0.8, 100.0
    for number in range(18):
        seen = stage.see([ship_at(640, row)], pitch_rad=pitch).ship_box
        assert (seen is not None) == (number >= needed(stage) - 1)
        if number >= 6:
            pitch += 0.05
            row += 0.05 * camera.focal_px


def test_a_lost_track_starts_again_from_nothing(camera):
    stage = Stage(camera)
    for _ in range(5):
        stage.see([ship_at(600, 350)])
    for _ in range(stage.parameters.lost_frames):
        stage.see()
    again = [stage.see([ship_at(200, 500)]).ship_box for _ in range(needed(stage))]
    assert again[0] is None
    assert again[-1] is not None


@pytest.mark.parametrize("step_s", [-0.5, 60.0])
def test_time_that_jumps_forgets_the_track(camera, step_s):
    stage = Stage(camera)
    for _ in range(5):
        stage.see([ship_at(600, 350)])
    assert stage.see([ship_at(600, 350)], step_s=step_s).ship_box is None


def test_a_much_surer_ship_elsewhere_takes_over(camera):
    stage = Stage(camera)
    wrong, right = ship_at(200, 350, confidence=0.5), ship_at(900, 350, confidence=0.95)
    for _ in range(5):
        stage.see([wrong])
    frames = 2 * stage.parameters.recheck_frames
    last = [stage.see([right, wrong]) for _ in range(frames)][-1]
    assert last.ship_box.centre_px == (900, 350)


def test_middling_boxes_are_never_believed_and_faint_ones_in_time(camera):
    """Evidence counts: at neutral confidence it never gathers, just above it does, and a sure box needs the least."""
    stage = Stage(camera)
    neutral = stage.parameters.ship.neutral_confidence
    assert all(stage.see([ship_at(600, 370, confidence=neutral)]).ship_box is None for _ in range(60))
    first = []
    for confidence in (neutral + 0.1, 0.97):
        stage = Stage(camera)
        seen = [stage.see([ship_at(600, 370, confidence=confidence)]).ship_box is not None for _ in range(60)]
        first.append(seen.index(True))
    assert first[1] == needed(stage, 0.97) - 1 < first[0]


def test_what_stands_above_the_horizon_is_no_ship(camera):
    """Looking level, the horizon runs through the picture's middle; looking 20° down, over its upper edge."""
    stage = Stage(camera)
    bird = ship_at(600, 250)
    assert all(stage.see([bird]).ship_box is None for _ in range(10))
    assert any(stage.see([bird], pitch_rad=-0.35).ship_box is not None for _ in range(10))


def test_the_surest_of_several_candidates_is_taken(camera):
    stage = Stage(camera)
    boxes = [ship_at(200, 400, confidence=0.75), ship_at(900, 400, confidence=0.95), ship_at(500, 500, confidence=0.8)]
    seen = [stage.see(boxes).ship_box for _ in range(needed(stage, 0.75))]
    assert seen[-1].centre_px == (900, 400)


def test_bar_is_told_only_inside_the_ship(camera):
    stage = Stage(camera, bar=True)
    ship, bar, buoy = ship_at(600, 350, 60.0), ship_at(600, 340, 30.0), ship_at(800, 340, 30.0)
    for _ in range(8):
        seen = stage.see([ship], [buoy])
    assert seen.ship_box is not None and seen.bar_box is None
    for _ in range(8):
        seen = stage.see([ship], [bar, buoy])
    assert seen.bar_box.centre_px == (600, 340)


def test_a_frame_without_picture_is_no_error(camera):
    stage = Stage(camera)
    seen = stage.far.see(Frame(0.0, None, GimbalAttitude(0.0, 0.0)))
    assert seen.ship_box is None and seen.reason == "far: no picture"
    assert (
        FarVision(None, None, camera, stage.parameters, Rig())
        .see(Frame(0.0, np.zeros((720, 1280, 3), np.uint8), GimbalAttitude(0.0, 0.0)))
        .reason.startswith("ship: no detector")
    )


@pytest.mark.parametrize("unknown", [math.nan, math.inf])
def test_without_the_cameras_attitude_there_is_no_box_and_a_reason(camera, unknown):
    stage = Stage(camera)
    ship = [ship_at(600, 370)]
    for _ in range(needed(stage)):
        followed = stage.see(ship).ship_box
    assert followed is not None
    for gimbal in (GimbalAttitude(unknown, 0.0), GimbalAttitude(0.0, unknown), GimbalAttitude(0.0, 0.0, unknown)):
        seen = stage.far.see(Frame(stage.t_s, np.zeros((720, 1280, 3), np.uint8), gimbal))
        assert seen.ship_box is None and seen.reason == "far: the camera's attitude is not known"
    assert stage.see(ship).ship_box is not None


def test_a_picture_of_another_size_than_the_cameras_has_no_box(camera):
    """Its pixels are other angles, and those of the track."""
    stage = Stage(camera)
    for _ in range(needed(stage)):
        stage.see([ship_at(300, 185)])
    half = np.zeros((360, 640, 3), np.uint8)
    seen = stage.far.see(Frame(stage.t_s + 0.1, half, GimbalAttitude(0.0, 0.0)))
    assert seen.ship_box is None and seen.reason == "far: the picture's size is not the camera's"


def test_detector_pads_and_maps_back(weights_file, rng):
    """A tile's box lies where the whole picture's does when both hold the same pixels."""
    detector = Detector(load_reader(weights_file, "openvino", "fp32", 1), 0.45)
    picture = rng.integers(0, 256, (96, 96, 3), dtype=np.uint8)
    whole = detector.detect(picture, 0.05)
    tile = detector.detect_in_tile(picture, (48.0, 48.0), 96, 1, 0.05)
    assert whole == tile
    assert len(whole) > 0


def test_weights_of_scaled_pictures_scale_what_they_see(weights_file, rng):
    """Every pixel doubled, and halved again by the detector: the same boxes, twice as far and as large."""
    detector = Detector(load_reader(weights_file, "onnxruntime", "fp32", 1), 0.45)
    picture = rng.integers(0, 256, (96, 96, 3), dtype=np.uint8)
    whole = detector.detect(picture, 0.05)
    detector.reader = replace(detector.reader, fit_px=96)
    twice = detector.detect(picture.repeat(2, axis=0).repeat(2, axis=1), 0.05)
    assert len(whole) == len(twice) > 0
    for one, two in zip(whole, twice, strict=True):
        np.testing.assert_allclose(np.array(two.centre_px) + 0.5, 2.0 * (np.array(one.centre_px) + 0.5), atol=1e-3)
        np.testing.assert_allclose(two.size_px, 2.0 * np.array(one.size_px), rtol=1e-5)


@pytest.mark.parametrize(("kind", "range_m"), [("ship", 120.0), ("bar", 60.0)])
def test_packaged_weights_see_their_target(kind, range_m, rig, camera):
    """Clear day, dead astern, 15 m up: the surest box lies over the target."""
    from shipland.learning.shots import draw_scene, draw_shot
    from shipland.learning.synth import synth_parameters
    from shipland.sim.scene.scene import Scene
    from shipland.sim.scene_parameters import SceneParameters
    from shipland.sim.state import target_box

    parameters = replace(
        synth_parameters(None),
        ship_range_m=(range_m, range_m + 1.0),
        bar_range_m=(range_m, range_m + 1.0),
        height_m=(15.0, 15.1),
        any_aspect=0.0,
        aspect_sigma_deg=0.0,
        empty_share=0.0,
    )
    light, _ = draw_scene(0, parameters, 1)
    shot = draw_shot(0, kind, replace(light, visibility_m=40000.0), camera, rig, parameters, 1)
    state = shot.at(0.0, rig)
    scene = Scene(rig, SceneParameters(), np.random.default_rng(1))
    picture = scene.render(state, camera)
    scene.close()
    settings = replace(detector_parameters(), threads=1)
    found = Detector.load(kind, settings).detect(picture, settings.acquire_confidence)
    box = target_box(kind, state, camera, rig, 0.9, 0.1)
    assert found and box is not None
    middle = np.array([0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])]) - 0.5
    np.testing.assert_allclose(found[0].centre_px, middle, atol=3.0)
