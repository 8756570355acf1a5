"""Round trips of ROS 2 messages between our node and an echo in another process: ours, or a real rclpy.

    python tools/ros2_round_trip.py
    python tools/ros2_round_trip.py --rclpy /path/to/python     # of an environment with rclpy and message packages

Prints per message: its size, how many of how many came back whole, and the round trip's median, 99 % and maximum. An
rclpy knows the messages of its own packages; those that it does not have are marked.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from shipland.vehicles.ros2.dds import Node

ECHOED = {
    "geometry_msgs/msg/TwistStamped": "set-point",
    "nav_msgs/msg/Odometry": "telemetry",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "cue's pose",
    "geometry_msgs/msg/QuaternionStamped": "camera's attitude",
    "sensor_msgs/msg/BatteryState": "battery",
    "sensor_msgs/msg/CameraInfo": "camera's intrinsics",
    "diagnostic_msgs/msg/DiagnosticArray": "mode and reason",
    "std_msgs/msg/Bool": "land",
    "tf2_msgs/msg/TFMessage": "TF",
    "vision_msgs/msg/Detection2DArray": "boxes",
    "mavros_msgs/msg/State": "armed, guided",
    "mavros_msgs/msg/AttitudeTarget": "attitude set-point",
    "sensor_msgs/msg/CompressedImage": "picture, JPEG 1280 × 720",
    "sensor_msgs/msg/Image": "picture, 1280 × 720",
}

RCLPY_ECHO = """
import importlib, sys
import rclpy
from rclpy.qos import QoSProfile
rclpy.init()
node, kept = rclpy.create_node("echo"), []
for kind in sys.argv[1:]:
    package, _, name = kind.split("/")
    try:
        made = getattr(importlib.import_module(package + ".msg"), name)
    except ImportError:
        print("lacks", kind, flush=True)
        continue
    back = node.create_publisher(made, "pong/" + name, QoSProfile(depth=10))
    kept.append(node.create_subscription(made, "ping/" + name, back.publish, QoSProfile(depth=10)))
print("ready", flush=True)
rclpy.spin(node)
"""


def own_echo() -> None:
    """Give every message back; until killed."""
    from shipland.vehicles.ros2.dds import Node, domain_id, only_this_machine

    node = Node(domain_id(None), only_this_machine())
    for kind in ECHOED:
        name = kind.rpartition("/")[2]
        node.subscribe(f"ping/{name}", kind, node.publisher(f"pong/{name}", kind).send)
    print("ready", flush=True)
    threading.Event().wait()


def example(kind: str) -> Any:  # noqa: ANN401
    """A message with numbers in it."""
    from shipland.vehicles.ros2 import conversions as ros
    from shipland.vehicles.ros2 import image_messages as images
    from shipland.vehicles.ros2 import telling as sights
    from shipland.vehicles.ros2.types import message

    picture = np.random.default_rng(1).integers(0, 255, (90, 160, 3), dtype=np.uint8).repeat(8, 0).repeat(8, 1)
    if kind.endswith("/Image"):
        return images.image_message(picture, 1.5, "camera")
    if kind.endswith("/CompressedImage"):
        return images.jpeg_message(picture, 1.5, "camera")
    if kind.endswith("/DiagnosticArray"):
        return sights.status("APPROACH", "the bar's corners seen for 0.2 s", {"distance_m": "4.20"}, 1.5)
    if kind.endswith("/PoseWithCovarianceStamped"):
        made = message(kind, header=ros.header(1.5, "cue"))
        made.pose.covariance[:] = np.arange(36.0)
        return made
    if kind.endswith("/Bool"):
        return message(kind, data=True)
    return message(kind) if kind.endswith(("Array", "TFMessage")) else message(kind, header=ros.header(1.5, "a"))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rclpy", help="Python of an environment with rclpy")
    parser.add_argument("--count", type=int, default=200, help="messages of each type")
    parser.add_argument("--hz", type=float, default=30.0, help="messages a second")
    parser.add_argument("--echo", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.echo:
        own_echo()
    from shipland.vehicles.ros2.dds import Node, domain_id, only_this_machine
    from shipland.vehicles.ros2.types import cdr_of

    own = [sys.executable, __file__, "--echo"]
    command = own if options.rclpy is None else [options.rclpy, "-c", RCLPY_ECHO, *ECHOED]
    environment = {name: value for name, value in os.environ.items() if options.rclpy is None or name != "PYTHONPATH"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as echo:
        assert echo.stdout is not None
        lacks = set()
        for line in echo.stdout:
            if line.strip() == "ready":
                break
            lacks.add(line.split()[-1])
        node = Node(domain_id(None), only_this_machine())
        try:
            print(f"| {'message':<44} | {'bytes':>9} | {'back':>9} | median [ms] | 99 % [ms] | most [ms] |")
            print("|---|--:|--:|--:|--:|--:|")
            for kind in ECHOED:
                if kind in lacks:
                    print(f"| {kind:<44} | not in that environment | | | | |")
                    continue
                size, came, trips_ms = measure(node, kind, options.count, options.hz, len(cdr_of(example(kind))))
                shown = (
                    "   –   "
                    if not trips_ms
                    else " | ".join(f"{np.percentile(trips_ms, share):.2f}" for share in (50, 99, 100))
                )
                print(f"| {kind:<44} | {size:>9,} | {came:>4}/{options.count} | {shown} |", flush=True)
        finally:
            node.close()
            echo.kill()


def measure(node: Node, kind: str, count: int, rate_hz: float, size: int) -> tuple[int, int, list[float]]:
    """Size, how many came back as they were, and their round trips [ms]."""
    from shipland.vehicles.ros2.types import cdr_of

    name, sent, wanted = kind.rpartition("/")[2], example(kind), cdr_of(example(kind))
    back, at_s, trips_ms = threading.Event(), [0.0], []

    def take(came: Any) -> None:  # noqa: ANN401
        now_s = time.monotonic()
        if cdr_of(came) == wanted and not back.is_set():
            trips_ms.append(1e3 * (now_s - at_s[0]))
        back.set()

    ping = node.publisher(f"ping/{name}", kind)
    node.subscribe(f"pong/{name}", kind, take)
    until_s = time.monotonic() + 10.0
    while time.monotonic() < until_s and not back.is_set():  # until both ends have found each other
        at_s[0] = time.monotonic()
        ping.send(sent)
        back.wait(0.2)
    trips_ms.clear()
    for _ in range(count):
        back.clear()
        at_s[0] = time.monotonic()
        ping.send(sent)
        back.wait(1.0)
        time.sleep(max(0.0, 1.0 / rate_hz - (time.monotonic() - at_s[0])))
    return size, len(trips_ms), trips_ms


if __name__ == "__main__":
    main()
