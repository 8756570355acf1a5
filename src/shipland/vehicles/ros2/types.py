"""ROS 2 message types and their CDR, by rosbags; those it does not bring stand here."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from shipland.errors import VehicleError
from shipland.extras import require

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_OWN = {
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id"
    ),
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
    "mavros_msgs/msg/State": (
        "std_msgs/Header header\nbool connected\nbool armed\nbool guided\nbool manual_input\nstring mode\n"
        "uint8 system_status"
    ),
    "mavros_msgs/msg/AttitudeTarget": (
        "std_msgs/Header header\nuint8 type_mask\ngeometry_msgs/Quaternion orientation\n"
        "geometry_msgs/Vector3 body_rate\nfloat32 thrust"
    ),
}
"""Fields of vision_msgs 4 and mavros_msgs 2, as their packages define them, without comments and constants."""


PRIMITIVES = {"byte": "uint8", "char": "uint8"}
"""ROS 2's names for which NumPy and IDL have another."""

Message = Any
"""A message of any type; they have no static ones."""


@lru_cache(maxsize=1)
def store() -> Typestore:
    """The types of ROS 2 Jazzy and `_OWN`; VehicleError without the extra."""
    require("ros2", "ros2://", VehicleError)
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    made = get_typestore(Stores.ROS2_JAZZY)
    for name, text in _OWN.items():
        made.register(get_types_from_msg(text, name))
    return made


def message(kind: str, **fields: object) -> Message:
    """A message; fields that are not given are zero, empty, or the zero message.

    >>> message("std_msgs/msg/String", data="hello").data
    'hello'
    """
    from rosbags.interfaces import Nodetype

    types = store()
    values: dict[str, Any] = {}
    for name, (node, what) in types.fielddefs[kind][1]:
        if name in fields:
            values[name] = fields.pop(name)
        elif node is Nodetype.NAME:
            values[name] = message(what)
        elif node is Nodetype.BASE:
            values[name] = "" if what[0] == "string" else False if what[0] == "bool" else 0
        else:
            values[name] = _no_items(node, what)
    if fields:
        raise TypeError(f"{kind} has no field {', '.join(fields)}; there are: {', '.join(values)}")
    return types.types[kind](**values)


def _no_items(node: Any, what: Any) -> Any:  # noqa: ANN401
    """The empty sequence, or the array of zeros."""
    import numpy as np
    from rosbags.interfaces import Nodetype

    (inner, name), count = what
    if inner is not Nodetype.BASE or name[0] == "string":
        return []
    return np.zeros(count if node is Nodetype.ARRAY else 0, dtype=PRIMITIVES.get(name[0], name[0]))


def cdr_of(sent: Message) -> bytes:
    """A message as it goes over the wire: CDR with its header, padded to four bytes."""
    data = bytes(store().serialize_cdr(sent, sent.__msgtype__))
    return data.ljust((len(data) + 3) & ~3, b"\0")


def message_of(data: bytes, kind: str) -> Message:
    """The inverse of `cdr_of`; whatever it raises means that the bytes are no such message."""
    return store().deserialize_cdr(data, kind)


def type_hash(kind: str) -> str:
    """ROS 2's own hash of a type (`RIHS01_…`), which `ros2 topic info --verbose` shows."""
    return str(store().hash_rihs01(kind))
