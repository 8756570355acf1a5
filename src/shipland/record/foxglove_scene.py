"""Shipland's frames, solids, camera and corners as Foxglove messages."""

from __future__ import annotations

import math

import numpy as np
from foxglove import messages as fg
from scipy.spatial.transform import Rotation

from shipland.camera import Camera, level_from_camera
from shipland.frames import MUJOCO_FROM_NED, Array, Pose, rotation_from_euler
from shipland.messages import Box, FlightRecord, GroundTruth, Observation
from shipland.rig import Rig

_GREY, _DARK = fg.Color(r=0.62, g=0.65, b=0.68, a=1.0), fg.Color(r=0.25, g=0.27, b=0.30, a=1.0)
_DECK, _WHITE = fg.Color(r=0.35, g=0.38, b=0.40, a=1.0), fg.Color(r=1.0, g=1.0, b=1.0, a=1.0)
_GREEN, _ORANGE = fg.Color(r=0.10, g=0.75, b=0.25, a=1.0), fg.Color(r=0.90, g=0.62, b=0.0, a=1.0)
_BLUE = fg.Color(r=0.34, g=0.71, b=0.91, a=1.0)
_THIN_M = 0.02


_MOST_NS = 2**32 * 1_000_000_000 - 1
"""Latest time stamp that can be written: seconds are 32 bits wide."""


def nanoseconds(t_s: float) -> int:
    """A vehicle time as the log counts it: whole nanoseconds, never negative, at most what the format holds."""
    return max(0, min(round(min(t_s, 2.0**32) * 1e9), _MOST_NS))


def timestamp(time_ns: int) -> fg.Timestamp:
    """A Foxglove time of whole nanoseconds."""
    return fg.Timestamp(sec=time_ns // 1_000_000_000, nsec=time_ns % 1_000_000_000)


def transforms(record: FlightRecord, rig: Rig) -> list[fg.FrameTransform]:
    """Edges world → ned → {ship → {deck, bar}, body → camera} at the exposure.

    Without truth the ship lies still at the origin, headed north, and the aircraft is where the pilot has it, at the
    estimate's own time; when the pilot has no place for it, `body` and `camera` are left as they were.
    """
    truth, estimate = record.truth, record.decision.estimate
    edges = [("world", "ned", Pose(MUJOCO_FROM_NED, np.zeros(3)))]
    edges += _estimated(record, rig) if truth is None else _true(truth)
    times_s = dict.fromkeys(("body", "camera"), estimate.t_s) if truth is None and estimate is not None else {}
    return [
        fg.FrameTransform(
            timestamp=timestamp(nanoseconds(times_s.get(child, record.frame.t_s))),
            parent_frame_id=parent,
            child_frame_id=child,
            translation=_vector(pose.translation_m),
            rotation=rotation,
        )
        for (parent, child, pose), rotation in zip(
            edges, _quaternions(np.array([pose.rotation for _, _, pose in edges])), strict=True
        )
    ]


def _true(truth: GroundTruth) -> list[tuple[str, str, Pose]]:
    ship_from_ned = truth.ned_from_ship.inverse()
    return [
        ("ned", "ship", truth.ned_from_ship),
        ("ship", "deck", ship_from_ned @ truth.ned_from_deck),
        ("ship", "bar", ship_from_ned @ truth.ned_from_bar),
        ("ned", "body", truth.ned_from_body),
        ("body", "camera", truth.ned_from_body.inverse() @ truth.ned_from_camera),
    ]


def _estimated(record: FlightRecord, rig: Rig) -> list[tuple[str, str, Pose]]:
    ned_from_ship = Pose(np.eye(3), np.array([0.0, 0.0, -rig.deck_height_m]))
    edges = [("ned", "ship", ned_from_ship), ("ship", "deck", Pose.identity()), ("ship", "bar", rig.ship_from_bar)]
    estimate = record.decision.estimate
    if estimate is not None:
        telemetry = record.telemetry
        level_from_body = rotation_from_euler(telemetry.roll_rad or 0.0, telemetry.pitch_rad or 0.0, 0.0)
        bar_from_level = Pose.from_euler(estimate.aircraft_in_bar_m, 0.0, 0.0, estimate.yaw_rad)
        ned_from_body = ned_from_ship @ rig.ship_from_bar @ bar_from_level @ Pose(level_from_body, np.zeros(3))
        body_from_camera = level_from_body.T @ level_from_camera(record.frame.gimbal)
        edges += [("ned", "body", ned_from_body), ("body", "camera", Pose(body_from_camera, np.zeros(3)))]
    return edges


def pose_in_bar(position_m: Array, yaw_rad: float, time_ns: int) -> fg.PoseInFrame:
    """A place (3,) [m] in `bar` and a heading about the down axis, at a time."""
    (orientation,) = _quaternions(rotation_from_euler(0.0, 0.0, yaw_rad)[None])
    pose = fg.Pose(position=_vector(position_m), orientation=orientation)
    return fg.PoseInFrame(timestamp=timestamp(time_ns), frame_id="bar", pose=pose)


def calibration(camera: Camera, time_ns: int) -> fg.CameraCalibration:
    """The intrinsics as ROS knows them; coefficients past the eighth (thin prism, tilt) have no place there."""
    k = camera.distortion.tolist()
    if camera.has_distortion:
        name, coefficients = ("plumb_bob", [*k, 0.0][:5]) if len(k) <= 5 else ("rational_polynomial", k[:8])
    else:
        name, coefficients = "plumb_bob", [0.0] * 5
    return fg.CameraCalibration(
        timestamp=timestamp(time_ns),
        frame_id="camera",
        width=camera.width_px,
        height=camera.height_px,
        distortion_model=name,
        D=coefficients,
        K=camera.matrix.ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=np.column_stack([camera.matrix, np.zeros(3)]).ravel().tolist(),
    )


def image_annotations(observation: Observation, scale: float, time_ns: int) -> fg.ImageAnnotations:
    """Corners and boxes of an observation over a picture shrunk by `scale`."""
    stamp, points = timestamp(time_ns), list[fg.PointsAnnotation]()
    if observation.bar_pose is not None:
        quads = observation.bar_pose.corners_px.reshape(-1, 4, 2) * scale
        points.extend(_loop(stamp, quad, _GREEN) for quad in quads)
    for box, colour in ((observation.bar_box, _ORANGE), (observation.ship_box, _BLUE)):
        if box is not None:
            points.append(_loop(stamp, _box_corners(box) * scale, colour))
    return fg.ImageAnnotations(timestamp=stamp, points=points)


def scene_update(rig: Rig, aircraft_diagonal_m: float, time_ns: int) -> fg.SceneUpdate:
    """Platform, deck, bar and aircraft as simple solids, locked to their frames."""
    stern_m, stamp = -rig.deck_ahead_of_stern_m, timestamp(time_ns)
    length_m, width_m, face_m = rig.platform_length_m, rig.platform_width_m, rig.bar_ahead_of_stern_m
    slab_m = 0.25 * rig.deck_height_m
    base_m = rig.deck_height_m  # of the platform below the deck's neutral surface; z points down
    ship = [
        _cube((stern_m + 0.5 * length_m, 0.0, base_m - 0.5 * slab_m), (length_m, width_m, slab_m), _GREY),
        _cube(
            (stern_m + 0.5 * (face_m + _THIN_M + length_m), 0.0, base_m - 0.5 * rig.superstructure_height_m),
            (length_m - face_m - _THIN_M, width_m, rig.superstructure_height_m),
            _GREY,
        ),
    ]
    half_m, corners = 0.5 * rig.landing_square_m, [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)]
    if rig.landing_area == "circle":
        corners = [(math.cos(angle_rad), math.sin(angle_rad)) for angle_rad in np.arange(0.0, 6.2, 0.2)]
    landing = [fg.Point3(x=x * half_m, y=y * half_m, z=-0.005) for x, y in corners]
    deck = [_cube((0.0, 0.0, 0.5 * _THIN_M), (rig.deck_size_m, rig.deck_size_m, _THIN_M), _DECK)]
    bar = [_cube((0.5 * _THIN_M, 0.0, 0.0), (_THIN_M, *rig.board_size_m), _DARK)]
    for quad in rig.cue.points_in_bar_m.reshape(-1, 4, 3):
        size_m = np.ptp(quad, axis=0)
        bar.append(_cube(tuple(quad.mean(axis=0) - [0.004, 0.0, 0.0]), (0.008, size_m[1], size_m[2]), _GREEN))
    rotor_m = 0.5 * aircraft_diagonal_m
    hub_m = rotor_m / np.sqrt(2.0)
    aircraft = [_cube((0.0, 0.0, 0.0), (0.7 * aircraft_diagonal_m, 0.25 * aircraft_diagonal_m, 0.04), _DARK)]
    rotors = [
        fg.CylinderPrimitive(
            pose=_place((x * hub_m, y * hub_m, -0.02)),
            size=fg.Vector3(x=rotor_m, y=rotor_m, z=0.01),
            bottom_scale=1.0,
            top_scale=1.0,
            color=_ORANGE if x > 0 else _BLUE,
        )
        for x in (-1, 1)
        for y in (-1, 1)
    ]
    outline = fg.LinePrimitive(
        type=fg.LinePrimitiveLineType.LineLoop,
        pose=_place((0.0, 0.0, 0.0)),
        thickness=0.02,
        points=landing,
        color=_WHITE,
    )
    entities = [
        fg.SceneEntity(timestamp=stamp, frame_id="ship", id="platform", frame_locked=True, cubes=ship),
        fg.SceneEntity(timestamp=stamp, frame_id="deck", id="deck", frame_locked=True, cubes=deck, lines=[outline]),
        fg.SceneEntity(timestamp=stamp, frame_id="bar", id="bar", frame_locked=True, cubes=bar),
        fg.SceneEntity(
            timestamp=stamp, frame_id="body", id="aircraft", frame_locked=True, cubes=aircraft, cylinders=rotors
        ),
    ]
    return fg.SceneUpdate(entities=entities)


def _vector(values: Array) -> fg.Vector3:
    return fg.Vector3(x=float(values[0]), y=float(values[1]), z=float(values[2]))


def _quaternions(rotations: Array) -> list[fg.Quaternion]:
    """Of (n,3,3): SciPy takes as long for one as for many."""
    found = Rotation.from_matrix(rotations).as_quat(canonical=True).tolist()
    return [fg.Quaternion(x=x, y=y, z=z, w=w) for x, y, z, w in found]


def _place(centre_m: tuple[float, ...]) -> fg.Pose:
    return fg.Pose(position=_vector(np.array(centre_m)), orientation=fg.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))


def _cube(centre_m: tuple[float, ...], size_m: tuple[float, float, float], colour: fg.Color) -> fg.CubePrimitive:
    return fg.CubePrimitive(pose=_place(centre_m), size=_vector(np.array(size_m)), color=colour)


def _loop(stamp: fg.Timestamp, corners_px: Array, colour: fg.Color) -> fg.PointsAnnotation:
    points = [fg.Point2(x=float(column), y=float(row)) for column, row in corners_px]
    return fg.PointsAnnotation(
        timestamp=stamp, type=fg.PointsAnnotationType.LineLoop, points=points, outline_color=colour, thickness=2.0
    )


def _box_corners(box: Box) -> Array:
    (column, row), (width, height) = box.centre_px, box.size_px
    return np.array([column, row]) + 0.5 * np.array(
        [[-width, -height], [width, -height], [width, height], [-width, height]]
    )
