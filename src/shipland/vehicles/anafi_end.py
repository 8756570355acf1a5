"""The far end of `anafi://`: runs in Olympe's own environment, and imports nothing of shipland.

    python anafi_end.py ADDRESS

Standard input takes a JSON object a line: {"sticks": [roll, pitch, yaw, gaz]} in whole percent, {"gimbal_deg": -20.0},
{"take_off": true}, {"land": true}, {"limits": {"tilt_deg": 15, "climb_mps": 1, "turn_deg_s": 40}}. Standard output
gives records: a JSON object a line, and after one with "bytes" so many bytes of picture. Times are CLOCK_MONOTONIC.

The sticks go out 25 times a second. When none come for a second, or standard input ends, they are released: the ANAFI
then holds its place.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
import time

PERIOD_S, STALE_S = 0.04, 1.0


class Out:
    """Records to the one who started us."""

    def __init__(self, stream):
        self._stream, self._lock = stream, threading.Lock()

    def say(self, record, data=b""):
        """One record; a reader that is gone ends us."""
        line = json.dumps({**record, "t_s": time.monotonic(), "bytes": len(data)}).encode() + b"\n"
        try:
            with self._lock:
                self._stream.write(line + data)
                self._stream.flush()
        except (OSError, ValueError):
            os._exit(1)


class Sticks:
    """The newest, sent at a steady rate from a thread of its own."""

    def __init__(self, drone, pcmd):
        self._drone, self._pcmd = drone, pcmd
        self._sticks, self._at_s = (0, 0, 0, 0), 0.0
        self.stopped = False

    def take(self, sticks):
        """Roll, pitch, yaw, gaz in percent."""
        self._sticks = tuple(max(-100, min(100, round(value))) for value in sticks)
        self._at_s = time.monotonic()

    def run(self):
        """Until stopped."""
        due_s, sequence = time.monotonic(), 0
        while not self.stopped:
            fresh = time.monotonic() - self._at_s < STALE_S
            roll, pitch, yaw, gaz = self._sticks if fresh else (0, 0, 0, 0)
            flag = 1 if roll or pitch else 0
            sequence = (sequence + 1) % 256
            stamp = (int(time.monotonic() * 1000) & 0xFFFFFF) | sequence << 24
            self._drone(self._pcmd(flag, roll, pitch, yaw, gaz, stamp))
            due_s = max(due_s + PERIOD_S, time.monotonic())
            time.sleep(max(0.0, due_s - time.monotonic()))


def main():
    """Connect, tell what comes, do what is asked."""
    out = Out(os.fdopen(os.dup(1), "wb"))
    os.dup2(2, 1)  # Olympe prints to standard output
    logging.disable(logging.WARNING)
    import olympe
    from olympe.messages import gimbal
    from olympe.messages.ardrone3.Piloting import PCMD, Landing, TakeOff
    from olympe.messages.ardrone3.PilotingSettings import MaxTilt
    from olympe.messages.ardrone3.PilotingState import (
        AltitudeChanged,
        AttitudeChanged,
        FlyingStateChanged,
        SpeedChanged,
    )
    from olympe.messages.ardrone3.SpeedSettings import MaxRotationSpeed, MaxVerticalSpeed
    from olympe.messages.common.CommonState import BatteryStateChanged, LinkSignalQuality

    drone = olympe.Drone(sys.argv[1])
    events = {
        "ardrone3.PilotingState.AttitudeChanged": "attitude",
        "ardrone3.PilotingState.SpeedChanged": "speed",
        "ardrone3.PilotingState.AltitudeChanged": "altitude",
        "ardrone3.PilotingState.FlyingStateChanged": "flying",
        "common.CommonState.BatteryStateChanged": "battery",
        "common.CommonState.LinkSignalQuality": "link",
        "gimbal.attitude": "gimbal",
    }

    class Listener(olympe.EventListener):
        @olympe.listen_event(
            AttitudeChanged()
            | SpeedChanged()
            | AltitudeChanged()
            | FlyingStateChanged()
            | BatteryStateChanged()
            | LinkSignalQuality()
            | gimbal.attitude()
        )
        def on_event(self, event, _controller):
            name = events.get(event.message.fullName)
            if name is not None:
                values = {key: getattr(value, "name", value) for key, value in event.args.items()}
                out.say({"kind": name, "values": values})

    if not drone.connect():
        out.say({"kind": "problem", "words": f"no ANAFI answers at {sys.argv[1]}"})
        return
    listener = Listener(drone)
    listener.subscribe()
    out.say({"kind": "connected"})
    _stream(drone, out)
    sticks = Sticks(drone, PCMD)
    thread = threading.Thread(target=sticks.run, daemon=True)
    thread.start()

    def limits(wanted):
        drone(MaxTilt(wanted["tilt_deg"])).wait(3.0)
        drone(MaxVerticalSpeed(wanted["climb_mps"])).wait(3.0)
        drone(MaxRotationSpeed(wanted["turn_deg_s"])).wait(3.0)
        read = {}
        for key, message, state in (
            ("tilt_deg", "MaxTiltChanged", "PilotingSettingsState"),
            ("climb_mps", "MaxVerticalSpeedChanged", "SpeedSettingsState"),
            ("turn_deg_s", "MaxRotationSpeedChanged", "SpeedSettingsState"),
        ):
            module = __import__(f"olympe.messages.ardrone3.{state}", fromlist=[message])
            try:
                read[key] = float(drone.get_state(getattr(module, message))["current"])
            except Exception:
                read[key] = None
        out.say({"kind": "limits", "values": read})

    try:
        for line in sys.stdin:
            try:
                asked = json.loads(line)
                if "sticks" in asked:
                    sticks.take(asked["sticks"])
                if "gimbal_deg" in asked:
                    drone(gimbal.set_target(0, "position", "none", 0.0, "absolute", asked["gimbal_deg"], "none", 0.0))
                if "limits" in asked:
                    limits(asked["limits"])
                if asked.get("take_off"):
                    drone(TakeOff())
                if asked.get("land"):
                    drone(Landing())
            except Exception as error:
                out.say({"kind": "refused", "words": f"{type(error).__name__}: {error}"})
    finally:
        sticks.take((0, 0, 0, 0))
        time.sleep(2 * PERIOD_S)
        sticks.stopped = True
        thread.join(1.0)
        listener.unsubscribe()
        drone.disconnect()


def _stream(drone, out):
    """Pictures as BGR, with the metadata that every one carries."""

    def on_picture(picture):
        picture.ref()
        try:
            import cv2
            import olympe

            info, metadata = picture.info(), picture.vmeta()
            planes = picture.as_ndarray()
            code = {olympe.VDEF_I420: cv2.COLOR_YUV2BGR_I420, olympe.VDEF_NV12: cv2.COLOR_YUV2BGR_NV12}
            image = cv2.cvtColor(planes, code[picture.format()])
            stamp_s = info["raw"]["frame"]["timestamp"] / info["raw"]["frame"]["timescale"]
            record = {"kind": "picture", "stamp_s": stamp_s, "shape": list(image.shape)}
            record["metadata"] = json.loads(json.dumps(metadata[1], default=str)) if metadata[1] else None
            out.say(record, image.tobytes())
        except Exception as error:
            out.say({"kind": "refused", "words": f"picture: {type(error).__name__}: {error}"})
        finally:
            picture.unref()

    try:
        drone.streaming.set_callbacks(raw_cb=on_picture)
        drone.streaming.start()
    except Exception as error:
        out.say({"kind": "problem", "words": f"no video: {type(error).__name__}: {error}"})


if __name__ == "__main__":
    main()
