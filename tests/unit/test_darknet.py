import cv2
import numpy as np
import pytest
from studies.networks import random_weights, write_cfg, write_weights

from shipland.errors import DataError
from shipland.learning.yolov3 import PUBLISHED_ANCHORS_PX, ConvWeights, read_weights, yolov3_layers
from shipland.vision.far.decode import Decoding, DetectorSpec, decode

SPEC = DetectorSpec(("ship", "buoy"), PUBLISHED_ANCHORS_PX, Decoding.DARKNET, 0.125)
LAYERS = yolov3_layers(classes=2, width=0.125)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("darknet")
    weights = random_weights(LAYERS, np.random.default_rng(3))
    # Heads a little larger, so that objectness spreads over 0 … 1.
    weights = [item if item.scale is not None else ConvWeights(3 * item.kernel, item.bias) for item in weights]
    write_cfg(folder / "net.cfg", LAYERS, SPEC, 96, 64)
    write_weights(folder / "net.weights", weights, pictures_seen=12_345)
    return folder / "net.cfg", folder / "net.weights", weights


def test_round_trip(files):
    _, numbers, weights = files
    for mine, back in zip(weights, read_weights(numbers, LAYERS), strict=True):
        for name in ("kernel", "bias", "scale", "mean", "variance"):
            np.testing.assert_array_equal(getattr(mine, name), getattr(back, name))


def test_opencv_reads_what_we_write_and_decodes_alike(files):
    """The peer is OpenCV 4's Darknet importer: same file, same picture, same boxes and probabilities."""
    torch = pytest.importorskip("torch")
    from shipland.learning.network import Network, load_weights

    cfg, numbers, weights = files
    picture = np.random.default_rng(4).random((1, 3, 64, 96), dtype=np.float32)
    peer = cv2.dnn.readNetFromDarknet(str(cfg), str(numbers))
    peer.setPreferableBackend(cv2.dnn.DNN_BACKEND_OPENCV)
    peer.setInput(picture)
    outputs = peer.forward(peer.getUnconnectedOutLayersNames())

    network = Network(LAYERS)
    load_weights(network, weights)
    network.eval()
    with torch.no_grad():
        maps = [item[0].numpy() for item in network(torch.from_numpy(picture))]
    for scale, output in enumerate(sorted(outputs, key=len, reverse=True)):
        only = [item if index == scale else np.full_like(item, -50.0) for index, item in enumerate(maps)]
        boxes, scores, kinds = decode(only, SPEC, 0.05)
        assert len(boxes) > 5, "too few candidates to say anything"
        theirs = output[output[:, 5:].max(axis=1) >= 0.05]
        # Darknet zeroes class scores below its own threshold of 0.2, so compare above that.
        mine = np.column_stack([boxes / [96, 64, 96, 64], scores, kinds])[scores > 0.25]
        theirs = np.column_stack([theirs[:, :4], theirs[:, 5:].max(axis=1), theirs[:, 5:].argmax(axis=1)])
        theirs = theirs[theirs[:, 4] > 0.25]
        assert len(mine) == len(theirs) > 0
        mine, theirs = (rows[np.lexsort(np.round(rows[:, :2], 4).T)] for rows in (mine, theirs))
        np.testing.assert_allclose(mine, theirs, atol=2e-3, rtol=2e-3)  # float32 through 75 convolutions


def test_older_header_has_a_short_counter(files, tmp_path):
    _, numbers, weights = files
    data = numbers.read_bytes()
    old = tmp_path / "old.weights"
    old.write_bytes(np.array([0, 1, 0, 77], "<i4").tobytes() + data[20:])
    back = read_weights(old, LAYERS)
    np.testing.assert_array_equal(back[-1].kernel, weights[-1].kernel)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[:-400], "truncated"),
        (lambda data: data + b"\0" * 400, "of another network"),
        (lambda data: data[:10], "truncated or another kind"),
        (lambda data: b"\x89PNG\r\n\x1a\n" + data[8:], "not Darknet weights"),
        (lambda data: data[:20] + b"\xff" * 64 + data[84:], "not finite"),
    ],
)
def test_foreign_weights_are_refused_by_name(files, tmp_path, change, message):
    path = tmp_path / "foreign.weights"
    path.write_bytes(change(files[1].read_bytes()))
    with pytest.raises(DataError, match=f"foreign.weights.*{message}"):
        read_weights(path, LAYERS)


def test_wide_decoding_cannot_be_written_as_darknet(tmp_path):
    spec = DetectorSpec(("ship",), PUBLISHED_ANCHORS_PX, Decoding.WIDE, 0.125)
    with pytest.raises(DataError, match="wide decoding"):
        write_cfg(tmp_path / "net.cfg", yolov3_layers(1, 0.125), spec, 96, 64)
