"""A flight as messages in Foxglove's schemas: what the log holds and a live view shows.

Log times are exposure times (vehicle time, from 0 for the simulator): no wall clock, so the same flight gives the same
bytes. Viewers want a z-up root: frame `world` is `mujoco` of `frames` (north, west, up); `ned` hangs below it by the
one fixed turn of `frames.MUJOCO_FROM_NED`, everything else below `ned` with the axes of the frame table.

Which topics there are, and when each comes: docs/reference/outputs.md, The log.
"""

from __future__ import annotations

import cv2
import foxglove
from foxglove import Context, channels
from foxglove.messages import CompressedImage, FrameTransforms, LogLevel
from foxglove.messages import Log as LogMessage

from shipland.camera import Camera
from shipland.config import key, parameters
from shipland.mcap_records import IMAGE_TOPIC
from shipland.messages import FlightRecord, Mode, TouchdownVerdict
from shipland.record import foxglove_scene as scene
from shipland.record.columns import Derived, derive
from shipland.record.info import FORMAT_VERSION, FlightInfo, LogHeader
from shipland.record.reader import FLIGHT_TOPIC, HEADER_TOPIC, VERDICT_TOPIC
from shipland.rig import Rig
from shipland.rows import json_schema, to_row


@parameters
class LogParameters:
    """`[outputs.log]`."""

    image_rate_hz: float = key(
        10.0, "pictures kept a second of flight; 0 keeps none", "0 keeps no pictures; the camera's rate keeps all", ge=0
    )
    image_width_px: int = key(
        640, "pictures are shrunk to this width, never enlarged", "30 kB a picture, 15 MB a minute", ge=16
    )
    image_quality: int = key(85, "JPEG quality, 1 … 100", ge=1, le=100)


class FlightChannels:
    """Gives a flight, cycle by cycle, to whatever listens to a context: a file, or a viewer."""

    def __init__(self, context: Context, info: FlightInfo, rig: Rig, camera: Camera, parameters: LogParameters) -> None:
        self._info, self._rig, self._parameters = info, rig, parameters
        width_px = min(parameters.image_width_px, camera.width_px)
        height_px = max(1, round(width_px * camera.height_px / camera.width_px))
        self._camera, self._log_camera = camera, camera.scaled(width_px, height_px)
        self._context = context
        self._header = self._json_channel(HEADER_TOPIC, LogHeader, "shipland.Header")
        self._flight = self._json_channel(FLIGHT_TOPIC, FlightRecord, "shipland.Flight", derived=True)
        self._verdict = self._json_channel(VERDICT_TOPIC, TouchdownVerdict, "shipland.Verdict")
        self._transforms = channels.FrameTransformsChannel("/tf", context=self._context)
        self._aircraft = channels.PoseInFrameChannel("/pose/aircraft", context=self._context)
        self._camera_pose = channels.PoseInFrameChannel("/pose/camera", context=self._context)
        self._image = channels.CompressedImageChannel(IMAGE_TOPIC, context=self._context)
        self._calibration = channels.CameraCalibrationChannel("/camera/calibration", context=self._context)
        self._annotations = channels.ImageAnnotationsChannel("/camera/annotations", context=self._context)
        self._scene = channels.SceneUpdateChannel("/scene", context=self._context)
        self._log = channels.LogChannel("/log", context=self._context)
        self._mode: Mode | None = None
        self._image_due_s: float | None = None
        self._time_ns = 0
        self.started = False
        """Whether anything has been given."""

    def append(self, record: FlightRecord) -> None:
        """One cycle."""
        self._time_ns = time_ns = scene.nanoseconds(record.frame.t_s)
        if not self.started:
            self.begin()
        derived = derive(record, self._rig)
        row = to_row(record) | {f"derived_{name}": value for name, value in to_row(derived).items()}
        self._flight.log(row, log_time=time_ns)
        self._transforms.log(FrameTransforms(transforms=scene.transforms(record, self._rig)), log_time=time_ns)
        decision, pose = record.decision, record.observation.bar_pose
        estimate = decision.estimate
        if estimate is not None:
            place = scene.pose_in_bar(estimate.aircraft_in_bar_m, estimate.yaw_rad, scene.nanoseconds(estimate.t_s))
            self._aircraft.log(place, log_time=time_ns)
        if pose is not None:
            place = scene.pose_in_bar(pose.position_in_bar_m, pose.yaw_rad, time_ns)
            self._camera_pose.log(place, log_time=time_ns)
        self._append_picture(record)
        if decision.mode is not None and decision.mode is not self._mode:
            self._mode = decision.mode
            self._say(f"{decision.mode.name}: {decision.reason}", "pilot", LogLevel.Info)

    def finish(self, verdict: TouchdownVerdict | None, end: str = "") -> None:
        """Why the flight ended, and the verdict."""
        if not self.started:
            self.begin()
        if end:
            self._say(end, "flight", LogLevel.Info)
        if verdict is not None:
            self._verdict.log(to_row(verdict), log_time=self._time_ns)
            self._say(verdict.reason, "verdict", LogLevel.Info if verdict.success else LogLevel.Warning)

    def begin(self) -> None:
        """Header and solids, at the newest time; again for a viewer that comes later."""
        self.started = True
        header = LogHeader(FORMAT_VERSION, self._info, self._rig, self._camera)
        self._header.log(to_row(header), log_time=self._time_ns)
        update = scene.scene_update(self._rig, self._info.aircraft_diagonal_m, self._time_ns)
        self._scene.log(update, log_time=self._time_ns)

    def _json_channel(self, topic: str, cls: type, title: str, derived: bool = False) -> foxglove.Channel:
        schema = json_schema(cls, title)
        if derived:
            extra = json_schema(Derived, title)["properties"]
            schema["properties"] |= {f"derived_{name}": what for name, what in extra.items()}
        return foxglove.Channel(topic, schema=schema, context=self._context)

    def _append_picture(self, record: FlightRecord) -> None:
        image, rate_hz, t_s = record.frame.image, self._parameters.image_rate_hz, record.frame.t_s
        # Half a millisecond of slack: exposure times are sums of 1/30 s and must not miss their turn by rounding.
        if image is None or rate_hz == 0.0 or (self._image_due_s is not None and t_s < self._image_due_s - 5e-4):
            return
        due_s = t_s if self._image_due_s is None else self._image_due_s
        self._image_due_s = max(due_s + 1.0 / rate_hz, t_s)
        camera, time_ns = self._log_camera, self._time_ns
        shrunk: cv2.typing.MatLike = image
        if image.shape[1] > camera.width_px:
            shrunk = cv2.resize(image, (camera.width_px, camera.height_px), interpolation=cv2.INTER_AREA)
        ok, jpeg = cv2.imencode(".jpg", shrunk, [cv2.IMWRITE_JPEG_QUALITY, self._parameters.image_quality])
        if not ok:
            return
        stamp = scene.timestamp(time_ns)
        self._calibration.log(scene.calibration(camera, time_ns), log_time=time_ns)
        picture = CompressedImage(timestamp=stamp, frame_id="camera", data=jpeg.tobytes(), format="jpeg")
        self._image.log(picture, log_time=time_ns)
        scale = camera.width_px / self._camera.width_px
        self._annotations.log(scene.image_annotations(record.observation, scale, time_ns), log_time=time_ns)

    def _say(self, message: str, name: str, level: LogLevel) -> None:
        stamp = scene.timestamp(self._time_ns)
        self._log.log(LogMessage(timestamp=stamp, level=level, message=message, name=name), log_time=self._time_ns)
