"""The landing as a ROS 2 service: `/shipland/land` (std_srvs/SetBool), spoken by your own rclpy beside the flight.

shipland fly --vehicle "ros2://drone?wait=1" ...                                   # waits to be called
python ros2_land.py                                                                # in a ROS 2 environment
ros2 service call /shipland/land std_srvs/srv/SetBool "{data: true}"               # answers when the flight is over

True asks for the landing, and the answer says how it ended; false ends it, and the vehicle holds. Over whichever rmw
your ROS 2 has, as long as that speaks DDS.
"""

from contextlib import suppress

import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool


class Land(Node):
    """Passes the call on as the topic that `shipland fly` listens to, and its last word back."""

    def __init__(self) -> None:
        super().__init__("shipland_land")
        self.asked = self.create_publisher(Bool, "/shipland/land", 1)
        self.create_subscription(String, "/shipland/result", self.end, 1)
        self.create_service(SetBool, "/shipland/land", self.land, callback_group=ReentrantCallbackGroup())
        self.create_timer(0.5, self.ask)
        self.ended: Future | None = None

    def ask(self) -> None:
        """Again and again until the flight is over: who has only just been found may have missed it."""
        if self.asked.get_subscription_count() == 0:
            self.answer("the process of `shipland fly` has gone")
        if self.ended is not None and not self.ended.done():
            self.asked.publish(Bool(data=True))

    def end(self, result: String) -> None:
        """The flight's last word."""
        self.answer(result.data)

    def answer(self, words: str) -> None:
        """To the call that waits for the end, where there is one; it is not asked again after that."""
        if self.ended is not None and not self.ended.done():
            self.ended.set_result(words)

    async def land(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        """Asked for, or ended, at a call."""
        if not request.data:
            self.answer("called off")
            self.asked.publish(Bool(data=False))
            response.success, response.message = True, "the flight ends"
        elif self.asked.get_subscription_count() == 0:
            response.success, response.message = (
                False,
                "nobody waits: start `shipland fly` with ros2://…?wait=1",
            )
        else:
            if self.ended is None or self.ended.done():
                self.ended = Future()
            response.message = await self.ended
            response.success = response.message.startswith("landed")
        return response


if __name__ == "__main__":
    rclpy.init()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Land())
