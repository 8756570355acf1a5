"""The far end of `anafi://` before a stand-in of Olympe: which sticks leave, and what ends it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from shipland.vehicles.anafi.setup import END
from waiting import until

OLYMPE = """
import os, sys, time, types
clock_gettime = time.clock_gettime
def clock_of_one_that_may_sleep(clock):
    slept = clock == getattr(time, "CLOCK_BOOTTIME", None) and os.path.exists(os.environ["SLEPT"])
    return clock_gettime(clock) + 30.0 * slept
time.clock_gettime = clock_of_one_that_may_sleep
def module(name, **parts):
    made = sys.modules[name] = types.ModuleType(name)
    made.__dict__.update(parts)
def command(name):
    return lambda *values: (name, values)
class Drone:
    connected = True
    def __init__(self, address):
        self.streaming = types.SimpleNamespace(play_multiple_stream=lambda *_, **__: True)
    def subscribe(self, hear, _):
        values = {"state": types.SimpleNamespace(name="in_progress"), "list_flags": 0}
        self.event = types.SimpleNamespace(message=types.SimpleNamespace(fullName="rth.state"), args=values)
        self.hear = hear
    def connect(self): return True
    def disconnect(self): pass
    def get_state(self, _): raise TimeoutError("it was not told")
    def __call__(self, asked):
        if asked[0] == "take_off": self.hear(self.event, None)
        print(*asked, flush=True, file=heard)
        return types.SimpleNamespace(wait=lambda _: None)
heard = open(os.environ["HEARD"], "w")
VDEF_I420, VDEF_NV12 = 1, 2
each = types.SimpleNamespace
module("olympe_deps", VDEF_FRAME_TYPE_RAW=0)
module("olympe.messages", gimbal=each(set_target=command("gimbal")))
module("olympe.messages.ardrone3", **{
    "PilotingSettings": each(MaxTilt=command("tilt")),
    "SpeedSettings": each(MaxVerticalSpeed=command("climb"), MaxRotationSpeed=command("turn")),
    "PilotingSettingsState": each(MaxTiltChanged=0, NoFlyOverMaxDistanceChanged=0, MaxDistanceChanged=0,
                                  MaxAltitudeChanged=0),
    "SpeedSettingsState": each(MaxVerticalSpeedChanged=0, MaxRotationSpeedChanged=0),
})
module("olympe.messages.ardrone3.Piloting", PCMD=command("PCMD"), Landing=command("land"), TakeOff=command("take_off"))
module("olympe.features.video.pdraw", Callbacks=lambda **_: None, StreamInfoDefault=lambda **_: None)
"""


class FarEnd:
    """The process, and what its drone heard."""

    def __init__(self, folder: Path) -> None:
        (folder / "olympe").mkdir()
        (folder / "olympe/__init__.py").write_text(OLYMPE)
        self._heard = folder / "heard.txt"
        environment = {"PYTHONPATH": str(folder), "HEARD": str(self._heard), "SLEPT": str(folder / "slept")}
        command = [sys.executable, str(END), "192.0.2.1", "rtsp://192.0.2.1/live"]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        assert self.said()["kind"] == "connected"

    def say(self, **asked: object) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(asked).encode() + b"\n")
        self.process.stdin.flush()

    def said(self) -> dict[str, object]:
        assert self.process.stdout is not None
        return json.loads(self.process.stdout.readline())

    def sticks(self) -> list[str]:
        """Flag, roll, pitch, yaw, gaz of each PCMD."""
        lines = self._heard.read_text().splitlines()
        return [line[6:].rpartition(",")[0] for line in lines if line.startswith("PCMD")]


@contextmanager
def far_end(folder: Path) -> Iterator[FarEnd]:
    end = FarEnd(folder)
    try:
        yield end
    finally:
        end.process.kill()
        end.process.wait()
        for pipe in (end.process.stdin, end.process.stdout):
            with suppress(BrokenPipeError):
                pipe.close()


FORWARD, RELEASED = "1, 0, 60, 0, 0", "0, 0, 0, 0, 0"


def test_no_stick_leaves_before_the_first_is_given_and_none_after_another_took_over(tmp_path: Path) -> None:
    with far_end(tmp_path) as end:
        end.say(gimbal_deg=-10.0)
        end.say(take_off=True)
        end.say(limits={"tilt_deg": 15, "climb_mps": 1, "turn_deg_s": 40})
        told = end.said()
        assert (told["kind"], told["values"]) == ("rth", {"state": "in_progress"})  # of a flight home
        limits = end.said()
        assert limits["kind"] == "limits"
        assert set(limits["values"].values()) == {None}  # asked for, and not told: nobody knows
        assert end.sticks() == []
        end.say(sticks=[0, 60, 0, 0])
        assert until(lambda: end.sticks()[-1:] == [FORWARD])
        end.say(sticks=[0, 60])  # malformed: the thread that sends goes on with those before
        assert end.said()["kind"] == "refused"
        count = len(end.sticks())
        assert until(lambda: len(end.sticks()) > count + 2)
        end.say(stop=True)
        end.say(sticks=[])
        assert end.said()["kind"] == "refused"  # both were heard
        count = len(end.sticks())
        end.say(sticks=[0, 60, 0, 0])
        end.process.stdin.close()
        end.process.wait(20.0)
        assert len(end.sticks()) == count  # another's aircraft gets no released sticks either


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGQUIT, signal.SIGINT])
def test_a_closed_terminal_leaves_it_alive_and_the_end_of_its_input_releases_the_sticks(
    tmp_path: Path, number: signal.Signals
) -> None:
    with far_end(tmp_path) as end:
        end.say(sticks=[0, 60, 0, 0])
        assert until(lambda: end.sticks()[-1:] == [FORWARD])
        end.process.send_signal(number)
        count = len(end.sticks())
        end.say(sticks=[0, 60, 0, 0])
        assert until(lambda: len(end.sticks()) > count + 3)
        assert end.process.poll() is None
        end.process.stdin.close()
        assert end.process.wait(20.0) == 0
        assert end.sticks()[-1] == RELEASED


def test_sigterm_releases_the_sticks(tmp_path: Path) -> None:
    with far_end(tmp_path) as end:
        end.say(sticks=[0, 60, 0, 0])
        assert until(lambda: end.sticks()[-1:] == [FORWARD])
        end.process.terminate()
        end.process.wait(20.0)
        assert end.sticks()[-1] == RELEASED


def test_sticks_that_stop_coming_are_released(tmp_path: Path) -> None:
    with far_end(tmp_path) as end:
        end.say(sticks=[0, 60, 0, 0])
        assert until(lambda: end.sticks()[-1:] == [FORWARD])
        assert until(lambda: end.sticks()[-1:] == [RELEASED])
        assert end.process.poll() is None


@pytest.mark.skipif(not hasattr(time, "CLOCK_BOOTTIME"), reason="Linux tells that it was suspended")
def test_no_stick_leaves_after_a_suspension_not_even_a_released_one(tmp_path: Path) -> None:
    with far_end(tmp_path) as end:
        end.say(sticks=[0, 60, 0, 0])
        assert until(lambda: end.sticks()[-1:] == [FORWARD])
        (tmp_path / "slept").touch()
        end.say(sticks=[0, 77, 0, 0])  # it waited in the pipe
        end.process.stdin.close()
        assert end.process.wait(20.0) == 0
        assert set(end.sticks()) == {FORWARD}
