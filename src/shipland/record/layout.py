"""A Foxglove layout for a flight's channels, to be imported in Foxglove beside the log or the live view."""

from __future__ import annotations

from pathlib import Path

from foxglove import layouts as fl

from shipland.mcap_records import IMAGE_TOPIC
from shipland.record.reader import FLIGHT_TOPIC

LAYOUT_NAME = "foxglove-layout.json"
_BLUE, _ORANGE, _GREEN, _PINK = "#0072b2", "#d55e00", "#009e73", "#cc79a7"


def write_layout(path: Path) -> None:
    """Write the layout; OSError when that fails."""
    path.write_text(_layout().to_json() + "\n", encoding="utf-8")


def _layout() -> fl.Layout:
    """Ship and aircraft, the picture with what was seen, modes, path, sticks, and the reasons."""
    left = [(3.0, _scene()), (1.0, _modes()), (1.5, _log())]
    right = [(2.0, _picture()), (1.2, _place()), (1.2, _sticks())]
    return fl.Layout(
        content=fl.SplitContainer(
            direction="row",
            items=[fl.SplitItem(proportion=1.0, content=_column(side)) for side in (left, right)],
        )
    )


def _column(panels: list[tuple[float, fl.BasePanel]]) -> fl.SplitContainer:
    items = [fl.SplitItem(proportion=share, content=panel) for share, panel in panels]
    return fl.SplitContainer(direction="column", items=items)


def _scene() -> fl.BasePanel:
    return fl.ThreeDeePanel(
        title="Ship and aircraft",
        config=fl.ThreeDeeConfig(
            follow_tf="ship",
            follow_mode="follow-position",
            camera_state=fl.ThreeDeeCameraState(
                perspective=True, distance=9.0, phi=65.0, theta_offset=115.0, target_offset=(-2.0, 0.0, 0.5)
            ),
            topics={
                "/scene": fl.BaseRendererSceneUpdateTopicSettings(visible=True),
                "/pose/aircraft": fl.BaseRendererPoseTopicSettings(visible=True, type="axis", axis_scale=0.4),
            },
        ),
    )


def _picture() -> fl.BasePanel:
    mode = fl.ImageModeConfig(
        image_topic=IMAGE_TOPIC,
        calibration_topic="/camera/calibration",
        annotations={"/camera/annotations": fl.ImageAnnotationSettings(visible=True)},
    )
    return fl.ImagePanel(title="On board", config=fl.ImageConfig(image_mode=mode))


def _modes() -> fl.BasePanel:
    series = [("mode", "decision_mode"), ("intent", "decision_command_intent")]
    return fl.StateTransitionsPanel(
        title="Mode",
        config=fl.StateTransitionsConfig(
            paths=[fl.StateTransitionsSeries(label=label, value=f"{FLIGHT_TOPIC}.{name}") for label, name in series]
        ),
    )


def _place() -> fl.BasePanel:
    """Truth where there is one, else the estimate: from the landing point, down positive."""
    shown = [("forward", 0, _BLUE), ("starboard", 1, _ORANGE), ("down", 2, _GREEN)]
    return _plot("From the landing point [m]", [
        (f"{label} ({name})", f"derived_{name}_in_pad_m[{axis}]", colour)
        for name in ("estimate", "truth") for label, axis, colour in shown
    ])  # fmt: skip


def _sticks() -> fl.BasePanel:
    sticks = [("pitch", _BLUE), ("roll", _ORANGE), ("heave", _GREEN), ("yaw", _PINK)]
    return _plot("Sticks [%]", [(name, f"decision_command_{name}_percent", colour) for name, colour in sticks])


def _plot(title: str, series: list[tuple[str, str, str]]) -> fl.BasePanel:
    paths = [
        fl.PlotSeries(label=label, value=f"{FLIGHT_TOPIC}.{name}", color=colour, enabled=True)
        for label, name, colour in series
    ]
    return fl.PlotPanel(title=title, config=fl.PlotConfig(paths=paths, show_legend=True, is_synced=True))


def _log() -> fl.BasePanel:
    return fl.LogPanel(title="Why", config=fl.LogConfig(topic_to_render="/log"))
