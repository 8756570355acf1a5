"""Tests of `test_mavlink` before an end whose MAVLink is MAVSDK's: no code of ours or pymavlink's encodes it."""

from collections.abc import Callable

import pytest

pytest.importorskip("pymavlink")
pytest.importorskip("mavsdk", reason="an independent MAVLink end: pip install mavsdk")

import test_mavlink
from mavlink_bench import bench

pytestmark = [pytest.mark.slow, pytest.mark.flaky(reruns=2, reruns_delay=2)]
"""They fly in real time: other tests beside them can keep the machine from it, not three times."""

TESTS: list[Callable[[], None]] = [
    test_mavlink.test_sticks_become_tilt_climb_and_heading,
    test_mavlink.test_a_px4_gets_set_points_before_offboard_and_velocities_only,
    test_mavlink.test_nothing_is_taken_or_armed_unasked,
    test_mavlink.test_touchdown_on_a_moving_deck_stops_the_motors_by_force,
    test_mavlink.test_a_lost_link_ends_the_flight_and_the_vehicle_holds_by_itself,
    test_mavlink.test_the_checklist_finds_what_is_not_in_order,
]


@pytest.fixture(autouse=True)
def by_mavsdk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(test_mavlink, "bench", lambda kind="ardupilot", **more: bench(f"{kind}-by-mavsdk", **more))


@pytest.mark.parametrize("test", TESTS, ids=lambda test: test.__name__.removeprefix("test_"))
def test_by_mavsdk(test: Callable[[], None]) -> None:
    test()


@pytest.mark.parametrize(("words", "mode", "reason"), [("mode 5", 5, "LOITER"), ("sticks 1700", 5, "sticks")])
def test_whoever_takes_the_vehicle_keeps_it(words: str, mode: int, reason: str) -> None:
    test_mavlink.test_whoever_takes_the_vehicle_keeps_it(words, mode, reason)


def test_a_vehicle_that_flies_on_in_our_mode_is_left_holding_after_a_restart() -> None:
    test_mavlink.test_a_vehicle_that_flies_on_in_our_mode_is_left_holding_whatever_ended_the_flight(
        "ardupilot", test_mavlink.restart, "restarted"
    )
