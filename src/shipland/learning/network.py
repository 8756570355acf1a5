"""The torch network of a list of layers, and its weights in and out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from shipland.learning.yolov3 import (
    LEAKY_SLOPE,
    NORM_EPSILON,
    Conv,
    ConvWeights,
    Head,
    Layer,
    Route,
    Shortcut,
    Upsample,
    convolutions,
)

PRIOR_CONFIDENCE = 0.01
"""Objectness of an untrained head: keeps the first steps from drowning in false positives."""


class Network(nn.Module):
    """YOLOv3 from its layers: pictures (n,3,h,w), 0 … 1, BGR, to raw maps, finest scale first."""

    def __init__(self, layers: Sequence[Layer]) -> None:
        super().__init__()
        self.layers = list(layers)
        self.kept = {source for layer in layers if isinstance(layer, Route) for source in layer.sources} | {
            index - layer.back for index, layer in enumerate(layers) if isinstance(layer, Shortcut)
        }
        self.convs = nn.ModuleList(_conv(conv, entering) for conv, entering in convolutions(layers).values())

    def forward(self, pictures: Tensor) -> list[Tensor]:
        """Raw maps [(n, 3·(5 + classes), h/8, w/8), …/16, …/32]."""
        kept: dict[int, Tensor] = {}
        maps: dict[int, Tensor] = {}
        convs = iter(self.convs)
        value = pictures
        for index, layer in enumerate(self.layers):
            match layer:
                case Conv():
                    value = next(convs)(value)
                case Shortcut(back):
                    value = value + kept[index - back]
                case Route(sources):
                    value = torch.cat([kept[source] for source in sources], 1) if len(sources) > 1 else kept[sources[0]]
                case Upsample():
                    value = nn.functional.interpolate(value, scale_factor=2.0, mode="nearest")
                case Head(scale):
                    maps[scale] = value
            if index in self.kept:
                kept[index] = value
        return [maps[scale] for scale in sorted(maps)]


def _conv(layer: Conv, entering: int) -> nn.Module:
    plain = nn.Conv2d(entering, layer.filters, layer.size, layer.stride, layer.size // 2, bias=not layer.normalised)
    if layer.normalised:
        nn.init.kaiming_normal_(plain.weight, a=LEAKY_SLOPE)
        norm = nn.BatchNorm2d(layer.filters, eps=NORM_EPSILON, momentum=0.03)
        return nn.Sequential(plain, norm, nn.LeakyReLU(LEAKY_SLOPE, inplace=True))
    assert plain.bias is not None
    nn.init.normal_(plain.weight, std=0.01)
    with torch.no_grad():
        plain.bias.zero_()
        plain.bias.view(3, -1)[:, 4] = float(np.log(PRIOR_CONFIDENCE / (1.0 - PRIOR_CONFIDENCE)))
        plain.bias.view(3, -1)[:, 5:] = 2.0
    return nn.Sequential(plain)


def load_weights(network: Network, weights: Sequence[ConvWeights]) -> None:
    """Put numbers into a network, convolution by convolution."""
    with torch.no_grad():
        for module, item in zip(network.convs, weights, strict=True):
            given = (numbers for numbers in vars(item).values() if numbers is not None)
            for tensor, numbers in zip(_tensors(module), given, strict=True):
                tensor.copy_(torch.from_numpy(numbers))


def weights_of(network: Network) -> list[ConvWeights]:
    """A network's numbers, convolution by convolution."""
    return [
        ConvWeights(*(np.array(tensor.detach().cpu().float().numpy(), np.float32) for tensor in _tensors(module)))
        for module in network.convs
    ]


def _tensors(module: nn.Module) -> list[Tensor]:
    """Of one convolution, in the order of `ConvWeights`."""
    conv, *others = module.children()
    if not others:
        return [conv.weight, conv.bias]
    norm = others[0]
    return [conv.weight, norm.bias, norm.weight, norm.running_mean, norm.running_var]
