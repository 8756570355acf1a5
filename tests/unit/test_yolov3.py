import numpy as np
import pytest
from studies.networks import random_weights

from shipland.learning.yolov3 import (
    Conv,
    Head,
    Route,
    flop_count,
    input_channels,
    layer_shapes,
    parameter_count,
    yolov3_layers,
)


def test_published_size_and_cost():
    """[YOLOv3]: 61.95 M parameters; 65.86 "Bn Ops" at 416 with 80 classes in Darknet's own print-out."""
    layers = yolov3_layers(classes=80)
    assert parameter_count(layers) == 61_949_149
    assert flop_count(layers, 416, 416) / 1e9 == pytest.approx(65.86, abs=0.01)


def test_layers_stand_where_darknet_has_them():
    """yolov3.cfg: 107 layers, heads at 82, 94 and 106, routes to 61 and 36, 75 convolutions."""
    layers = yolov3_layers(classes=80)
    assert len(layers) == 107
    heads = {index: layer.scale for index, layer in enumerate(layers) if isinstance(layer, Head)}
    assert heads == {82: 2, 94: 1, 106: 0}
    assert [layer.sources for layer in layers if isinstance(layer, Route)] == [(79,), (85, 61), (91,), (97, 36)]
    assert sum(isinstance(layer, Conv) for layer in layers) == 75


def test_one_class_gives_the_papers_outputs():
    """[Lee2022]: N × N × 3·(4 + 1 + 1) at three scales."""
    layers = yolov3_layers(classes=1)
    shapes = layer_shapes(layers, 416, 416)
    heads = [shapes[index] for index, layer in enumerate(layers) if isinstance(layer, Head)]
    assert heads == [(18, 13, 13), (18, 26, 26), (18, 52, 52)]


def test_quarter_width_is_a_sixteenth():
    full, slim = yolov3_layers(1), yolov3_layers(1, 0.25)
    assert parameter_count(slim) / parameter_count(full) == pytest.approx(1 / 16, rel=0.02)
    assert flop_count(slim, 736, 1280) / flop_count(full, 736, 1280) == pytest.approx(1 / 16, rel=0.02)


def test_whole_frame_needs_a_multiple_of_32():
    with pytest.raises(ValueError, match="multiples of 32"):
        layer_shapes(yolov3_layers(1), 720, 1280)


@pytest.mark.parametrize(("classes", "width"), [(0, 1.0), (1, 0.0)])
def test_nonsense_is_refused(classes, width):
    with pytest.raises(ValueError, match="classes ≥ 1 and width > 0"):
        yolov3_layers(classes, width)


def test_folding_keeps_the_convolution():
    """Folded kernel and bias give what convolution, then normalisation gave."""
    rng = np.random.default_rng(1)
    layers = yolov3_layers(1, 0.125)
    weights = random_weights(layers, rng)[0]
    x = rng.standard_normal((input_channels(layers)[0], 3, 3)).astype(np.float32)
    raw = np.tensordot(weights.kernel, x, axes=3)
    wanted = (raw - weights.mean) / np.sqrt(weights.variance + 1e-6) * weights.scale + weights.bias
    kernel, bias = weights.folded()
    np.testing.assert_allclose(np.tensordot(kernel, x, axes=3) + bias, wanted, atol=1e-5)  # float32 sums of 27 terms


def test_network_agrees_with_its_description():
    torch = pytest.importorskip("torch")
    from shipland.learning.network import Network, load_weights, weights_of

    layers = yolov3_layers(2, 0.125)
    network = Network(layers)
    assert sum(parameter.numel() for parameter in network.parameters()) == parameter_count(layers)
    weights = random_weights(layers, np.random.default_rng(2))
    load_weights(network, weights)
    back = weights_of(network)
    for mine, other in zip(weights, back, strict=True):
        np.testing.assert_array_equal(mine.kernel, other.kernel)
        np.testing.assert_array_equal(mine.bias, other.bias)
    network.eval()
    with torch.no_grad():
        maps = network(torch.zeros(1, 3, 64, 96))
    assert [tuple(item.shape) for item in maps] == [(1, 21, 8, 12), (1, 21, 4, 6), (1, 21, 2, 3)]
