"""The node of `examples/ros2_land.py` before a stand-in of rclpy: what it asks for, and when it stops asking."""

import asyncio
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "ros2_land.py"


class StandIn:
    """Of rclpy's node, without a wire."""

    def __init__(self, _name: str) -> None:
        self.published: list[bool] = []
        self.listeners = 1

    def create_publisher(self, *_: object) -> Any:
        return SimpleNamespace(
            publish=lambda told: self.published.append(told.data), get_subscription_count=lambda: self.listeners
        )

    def create_subscription(self, *_: object) -> None: ...
    def create_service(self, *_: object, **__: object) -> None: ...
    def create_timer(self, *_: object) -> None: ...


@pytest.fixture
def land(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Makes the node."""
    types: dict[str, dict[str, object]] = {
        "rclpy": {},
        "rclpy.callback_groups": {"ReentrantCallbackGroup": object},
        "rclpy.executors": {"ExternalShutdownException": RuntimeError},
        "rclpy.node": {"Node": StandIn},
        "rclpy.task": {"Future": asyncio.Future},
        "std_msgs.msg": {"Bool": SimpleNamespace, "String": SimpleNamespace},
        "std_srvs.srv": {"SetBool": SimpleNamespace(Request=SimpleNamespace, Response=SimpleNamespace)},
    }
    for name, members in types.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(EXAMPLE))["Land"]


async def called(node: Any) -> asyncio.Task[Any]:
    """A call for a landing, which waits for its answer."""
    call = asyncio.ensure_future(node.land(SimpleNamespace(data=True), SimpleNamespace()))
    await asyncio.sleep(0)  # up to the wait
    node.ask()
    return call


def test_every_call_is_answered_with_the_end_and_asked_for_until_then(land: Any) -> None:
    async def scene() -> None:
        node = land()
        calls = [await called(node), await called(node)]
        assert node.published == [True, True]
        node.end(SimpleNamespace(data="landed: the motors have stopped"))
        for call in calls:
            answer = await asyncio.wait_for(call, 5.0)
            assert (answer.success, answer.message) == (True, "landed: the motors have stopped")
        node.ask()
        assert node.published == [True, True]

    asyncio.run(scene())


def test_a_landing_that_is_called_off_is_not_asked_for_again(land: Any) -> None:
    async def scene() -> None:
        node = land()
        call = await called(node)
        await node.land(SimpleNamespace(data=False), SimpleNamespace())
        node.ask()
        assert node.published == [True, False]
        assert not (await asyncio.wait_for(call, 5.0)).success

    asyncio.run(scene())


def test_a_call_is_answered_where_the_flights_process_has_gone(land: Any) -> None:
    async def scene() -> None:
        node = land()
        call = await called(node)
        node.listeners = 0
        node.ask()
        answer = await asyncio.wait_for(call, 5.0)
        assert not answer.success
        assert "has gone" in answer.message
        assert node.published == [True]

    asyncio.run(scene())
