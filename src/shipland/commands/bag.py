"""`shipland bag`: a flight log as a ROS 2 bag."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shipland.commands.options import PathArgument


@dataclass(frozen=True)
class Bag:
    """Write a flight log as a ROS 2 bag.

    No ROS is needed, but the extra `ros2`. The bag is a rosbag2 with storage MCAP and holds the topics of `ros2://`:
    odometry, the camera's attitude, the pictures that the log keeps, the cue's pose, boxes, mode and reason, TF. Times
    are those of the log.

    Example: shipland bag out/flight/flight.mcap --out out/bag
    """

    log: PathArgument
    """Log of a flight (flight.mcap), or its folder."""
    out: Path = Path("out/bag")
    """Folder of the bag; must not be there yet."""
    namespace: str = "drone"
    """Of the vehicle's topics."""

    def run(self) -> int:
        """Write it and print what it holds."""
        from shipland.report.outputs import log_in
        from shipland.report.ros2_bag import write_bag

        for topic, count in write_bag(log_in(self.log), self.out, self.namespace).items():
            print(f"{count:6d}  {topic}")
        return 0
