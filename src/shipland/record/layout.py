"""A Foxglove layout for a flight's channels, in the form that Foxglove and Lichtblick export and import.

The layouts of `foxglove.layouts` are another form, for its notebook widget.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from shipland.files import json_bytes
from shipland.mcap_records import IMAGE_TOPIC
from shipland.record.reader import FLIGHT_TOPIC

LAYOUT_NAME = "foxglove-layout.json"
_BLUE, _ORANGE, _GREEN, _PINK = "#0072b2", "#d55e00", "#009e73", "#cc79a7"

_SCENE = {
    "followTf": "ship",
    "followMode": "follow-position",
    "cameraState": {
        "perspective": True, "distance": 9.0, "phi": 65.0, "thetaOffset": 115.0, "targetOffset": [-2.0, 0.0, 0.5],
        "target": [0, 0, 0], "targetOrientation": [0, 0, 0, 1], "fovy": 45, "near": 0.1, "far": 1000,
    },
    "scene": {},
    "transforms": {},
    "layers": {},
    "topics": {
        "/scene": {"visible": True},
        "/pose/aircraft": {"visible": True, "type": "axis", "axisScale": 0.4},
    },
}  # fmt: skip
"""Ship and aircraft, from astern and above."""
_PICTURE = {
    "imageMode": {
        "imageTopic": IMAGE_TOPIC,
        "calibrationTopic": "/camera/calibration",
        "annotations": {"/camera/annotations": {"visible": True}},
    }
}


def write_layout(path: Path) -> None:
    """Write the layout; OSError when that fails."""
    path.write_bytes(json_bytes(_layout()))


def _layout() -> dict[str, Any]:
    """Ship and aircraft, the picture with what was seen, modes, place, sticks, and the reasons."""
    axes = (("forward", 0, _BLUE), ("starboard", 1, _ORANGE), ("up", 2, _GREEN))
    place = [
        (f"{label} ({name})", f"derived_{name}_in_pad_m[{axis}]", colour)
        for name in ("estimate", "truth") for label, axis, colour in axes
    ]  # fmt: skip
    colours = (("pitch", _BLUE), ("roll", _ORANGE), ("heave", _GREEN), ("yaw", _PINK))
    sticks = [(name, f"decision_command_{name}_percent", colour) for name, colour in colours]
    return {
        "configById": {
            "3D!scene": _SCENE,
            "Image!onboard": _PICTURE,
            "StateTransitions!mode": {"isSynced": True, "paths": [_series("mode", "decision_mode")]},
            "Plot!place": _plot("From the landing point [m]", place),
            "Plot!sticks": _plot("Sticks [%]", sticks),
            "RosOut!log": {"searchTerms": [], "minLogLevel": 1, "topicToRender": "/log"},
        },
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split(
            "row", 50,
            _split("column", 55, "3D!scene", _split("column", 40, "StateTransitions!mode", "RosOut!log")),
            _split("column", 45, "Image!onboard", _split("column", 50, "Plot!place", "Plot!sticks")),
        ),
    }  # fmt: skip


def _split(direction: str, percent: int, first: object, second: object) -> dict[str, Any]:
    return {"direction": direction, "splitPercentage": percent, "first": first, "second": second}


def _series(label: str, name: str, **look: object) -> dict[str, Any]:
    return {"label": label, "value": f"{FLIGHT_TOPIC}.{name}", "timestampMethod": "receiveTime", "enabled": True} | look


def _plot(title: str, series: list[tuple[str, str, str]]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": [_series(label, name, color=colour) for label, name, colour in series],
        "xAxisVal": "timestamp",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": False,
        "isSynced": True,
        "sidebarDimension": 240,
    }
