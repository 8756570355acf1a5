"""The far end of `anafi://`: runs in Olympe's own environment, and imports nothing of shipland.

    python end.py ADDRESS STREAM

ADDRESS is the aircraft's, STREAM its video's (`rtsp://…`). Standard input takes a JSON object a line: {"sticks": [roll,
pitch, yaw, gaz]} in whole percent, {"gimbal_deg": -20.0}, {"take_off": true}, {"land": true}, {"limits": {"tilt_deg":
15, "climb_mps": 1, "turn_deg_s": 40}}, {"stop": true}: no sticks from now on. Standard output gives records: a JSON
object a line, and after one with "bytes" so many bytes of picture. Times are CLOCK_MONOTONIC.

From the first sticks on they go out 25 times a second. When none come for a second, or standard input ends, they are
released: the ANAFI then holds its place. None go out after this machine was suspended: who flies it then is not known.
No signal but SIGTERM and SIGKILL ends this process before its input does, so that a closed terminal does not leave the
last sticks flying.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import threading
import time
from collections import deque
from contextlib import suppress

PERIOD_S, STALE_S = 0.04, 1.0
EVENTS = {
    "ardrone3.PilotingState.AttitudeChanged": "attitude",
    "ardrone3.PilotingState.SpeedChanged": "speed",
    "ardrone3.PilotingState.AltitudeChanged": "altitude",
    "ardrone3.PilotingState.FlyingStateChanged": "flying",
    "ardrone3.PilotingState.NavigateHomeStateChanged": "home",
    "rth.state": "rth",
    "ardrone3.PilotingState.AlertStateChanged": "alert",
    "common.CommonState.BatteryStateChanged": "battery",
    "common.CommonState.LinkSignalQuality": "link",
    "gimbal.attitude": "gimbal",
}


class Out:
    """Records to the process that started us, from a thread: a slow reader delays no event."""

    def __init__(self, stream):
        self._stream, self._changed = stream, threading.Condition()
        self._records, self._picture, self._idle = deque(maxlen=1000), None, True
        threading.Thread(target=self._run, daemon=True).start()

    def say(self, record):
        """One record; the oldest are dropped while the reader is slow."""
        with self._changed:
            self._records.append({**record, "t_s": time.monotonic()})
            self._idle = False
            self._changed.notify_all()

    def show(self, record, data):
        """One picture; only the newest waits."""
        with self._changed:
            self._picture = {**record, "t_s": time.monotonic(), "bytes": len(data)}, data
            self._changed.notify_all()

    def complain(self, words):
        """The last record: what is in the way. Ends this process."""
        self.say({"kind": "problem", "words": words})
        with self._changed:
            self._changed.wait_for(lambda: self._idle, 1.0)
        os._exit(1)  # Olympe's threads would keep us

    def _run(self):
        while True:
            with self._changed:
                self._idle = not self._records
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._records or self._picture)
                waiting = [(record, b"") for record in self._records]
                self._records.clear()
                if self._picture:
                    waiting.append(self._picture)
                    self._picture = None
            try:
                for record, data in waiting:
                    self._stream.write(json.dumps(record).encode() + b"\n" + data)
                self._stream.flush()
            except (OSError, ValueError):
                return  # the reader is gone: standard input ends as well, and that ends us in order


class StickSender:
    """The newest, sent at a steady rate from a thread of its own."""

    def __init__(self, drone, pcmd):
        self._drone, self._pcmd = drone, pcmd
        self._sticks, self._at_s, self._slept_s = (0, 0, 0, 0), None, 0.0
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def take(self, sticks):
        """Roll, pitch, yaw, gaz in percent."""
        roll, pitch, yaw, gaz = (max(-100, min(100, round(value))) for value in sticks)
        self._sticks = roll, pitch, yaw, gaz
        if self._at_s is None:
            self._slept_s = slept_s()
        self._at_s = time.monotonic()

    def stop(self):
        """None from now on."""
        self._stopping.set()
        self._thread.join(1.0)

    def release(self):
        """Let go of them, where they are ours, and send none from then on."""
        if self._at_s is not None:
            self.take((0, 0, 0, 0))
            self._stopping.wait(2 * PERIOD_S)
        self.stop()

    def _run(self):
        due_s, sequence = time.monotonic(), 0
        while not self._stopping.is_set():
            if self._at_s is not None and slept_s() - self._slept_s > STALE_S:
                return  # whoever flies it by now keeps it; shipland notices as well, and ends the flight
            if self._at_s is not None and self._drone.connected:
                fresh = time.monotonic() - self._at_s < STALE_S
                roll, pitch, yaw, gaz = self._sticks if fresh else (0, 0, 0, 0)
                flag = 1 if roll or pitch else 0
                sequence = (sequence + 1) % 256
                stamp = (int(time.monotonic() * 1000) & 0xFFFFFF) | sequence << 24
                with suppress(Exception):  # the link may go in between; the next turn must come
                    self._drone(self._pcmd(flag, roll, pitch, yaw, gaz, stamp))
            due_s = max(due_s + PERIOD_S, time.monotonic())
            self._stopping.wait(max(0.0, due_s - time.monotonic()))


def slept_s():
    """Time for which this machine has been suspended since it started; Linux tells."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return 0.0 if boot is None else time.clock_gettime(boot) - time.monotonic()


def main():
    """Connect, tell what comes, do what is asked."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    out = Out(os.fdopen(os.dup(1), "wb"))
    os.dup2(2, 1)  # Olympe prints to standard output
    logging.disable(logging.ERROR)  # it tries services that an ANAFI does not have
    try:
        import olympe
        from olympe.messages.ardrone3.Piloting import PCMD
    except Exception as error:
        out.complain(f'{sys.executable} has no Olympe that works: {error}; see "Fly an ANAFI"')

    address, stream = sys.argv[1:]
    drone = olympe.Drone(address)

    def on_event(event, _):
        if type(event).__name__ == "DisconnectedEvent":
            out.say({"kind": "lost"})
        name = EVENTS.get(event.message.fullName) if hasattr(event, "message") else None
        if name is not None:
            values = {key: getattr(value, "name", value) for key, value in event.args.items()}
            values.pop("list_flags", None)
            out.say({"kind": name, "values": values})

    drone.subscribe(on_event, None)  # before connecting: battery and flying state are reported once
    if not drone.connect():
        out.complain(f"no ANAFI answers at {address}")
    out.say({"kind": "connected"})
    _play(drone, stream, out)
    sticks = StickSender(drone, PCMD)
    try:
        for line in sys.stdin:
            try:
                _do(json.loads(line), drone, sticks, out)
            except Exception as error:
                out.say({"kind": "refused", "words": f"{type(error).__name__}: {error}"})
    finally:
        sticks.release()
        threading.Timer(2.0, os._exit, (0,)).start()  # a link that is down does not say good-bye
        drone.disconnect()
        os._exit(0)


def _do(asked, drone, sticks, out):
    from olympe.messages import gimbal
    from olympe.messages.ardrone3.Piloting import Landing, TakeOff

    if "sticks" in asked:
        sticks.take(asked["sticks"])
    if asked.get("stop"):
        sticks.stop()
    if "gimbal_deg" in asked:
        drone(gimbal.set_target(0, "position", "none", 0.0, "absolute", asked["gimbal_deg"], "none", 0.0))
    if "limits" in asked:
        out.say({"kind": "limits", "values": _limits(drone, asked["limits"])})
    if asked.get("take_off"):
        drone(TakeOff())
    if asked.get("land"):
        drone(Landing())


def _limits(drone, wanted):
    """Set what full sticks mean; what it is then, and what its own fence is."""
    from olympe.messages.ardrone3 import PilotingSettings, PilotingSettingsState, SpeedSettings, SpeedSettingsState

    drone(PilotingSettings.MaxTilt(wanted["tilt_deg"])).wait(3.0)
    drone(SpeedSettings.MaxVerticalSpeed(wanted["climb_mps"])).wait(3.0)
    drone(SpeedSettings.MaxRotationSpeed(wanted["turn_deg_s"])).wait(3.0)

    def reported(message, argument="current"):
        try:
            return float(drone.get_state(message)[argument])
        except Exception:
            return None

    return {
        "tilt_deg": reported(PilotingSettingsState.MaxTiltChanged),
        "climb_mps": reported(SpeedSettingsState.MaxVerticalSpeedChanged),
        "turn_deg_s": reported(SpeedSettingsState.MaxRotationSpeedChanged),
        "fence": reported(PilotingSettingsState.NoFlyOverMaxDistanceChanged, "shouldNotFlyOver"),
        "fence_distance_m": reported(PilotingSettingsState.MaxDistanceChanged),
        "fence_height_m": reported(PilotingSettingsState.MaxAltitudeChanged),
    }


def _play(drone, stream, out):
    """Pictures in the decoder's own planes, with the metadata that every one carries."""
    import olympe
    import olympe_deps as od
    from olympe.features.video.pdraw import Callbacks, StreamInfoDefault

    planes = {olympe.VDEF_I420: "I420", olympe.VDEF_NV12: "NV12"}

    def on_picture(picture):
        try:
            frame, metadata = picture.info()["raw"]["frame"], picture.vmeta()[1]
            record = {
                "kind": "picture",
                "stamp_s": frame["timestamp"] / frame["timescale"],
                "planes": planes[picture.format()],
                "size_px": [frame["info"]["width"], frame["info"]["height"]],
                "metadata": metadata or None,
            }
            out.show(record, picture.as_ndarray().tobytes())
        except Exception as error:
            out.say({"kind": "refused", "words": f"picture: {type(error).__name__}: {error}"})

    # whatever its name: an ANAFI's, an ANAFI Ai's and a SkyController's streams are called differently
    only = StreamInfoDefault(callbacks=[Callbacks(media_type=(od.VDEF_FRAME_TYPE_RAW, None), video_frame=on_picture)])
    try:
        words = "" if drone.streaming.play_multiple_stream(stream, streams_list=[only]) else "it does not play"
    except Exception as error:
        words = f"{type(error).__name__} {error}".strip()
    if words:
        out.say({"kind": "problem", "words": f"no video from {stream}: {words}"})


if __name__ == "__main__":
    main()
