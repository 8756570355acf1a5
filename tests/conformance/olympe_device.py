"""An ANAFI's far side by Parrot's own code: Olympe's device end, with a kinematic aircraft and a video stream.

    python olympe_device.py FILM.h264

Runs in Olympe's environment, in a process of its own, and knows nothing of shipland. Words on standard input: `begin`
a new aircraft, `end` it; of the one that is: `report`, `state NAME` (a flying state that nobody asked for), `home` (a
return by itself), `mute` (no events), `freeze` (no pictures), `thaw`, `deck` (it cannot sink any more). `begin`, `end`
and `report` answer a line of JSON on standard output.
"""

import ctypes
import json
import math
import os
import sys
import threading
import time
from pathlib import Path

import olympe_deps as od
from olympe.controllers.device import DeviceBase
from olympe.messages import gimbal
from olympe.messages.ardrone3 import PilotingSettingsState, PilotingState
from olympe.messages.ardrone3.SpeedSettingsState import MaxRotationSpeedChanged, MaxVerticalSpeedChanged
from olympe.messages.common.CommonState import AllStatesChanged, BatteryStateChanged, LinkSignalQuality
from olympe.messages.common.SettingsState import AllSettingsChanged
from rtsp_server import RtspServer

STEP_S, EVENT_S, PICTURE_HZ = 0.01, 0.2, 30.0
FORWARD_PICTURE_RAD = 0.02  # the gimbal's control error in roll, so that it can be told from the aircraft's


def quaternion(target, roll, pitch, yaw):
    """Into a vmeta quaternion: NED from body."""
    cr, sr, cp, sp, cy, sy = (turn(angle / 2) for angle in (roll, pitch, yaw) for turn in (math.cos, math.sin))
    target.w, target.x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    target.y, target.z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy


class Aircraft:
    """Tilts, climbs and turns as PCMD says; with its flag down and no sticks it brakes and holds."""

    def __init__(self):
        self.state, self.state_s = "landed", 0.0
        self.up, self.velocity = 0.0, [0.0, 0.0, 0.0]  # north, east, up
        self.roll = self.pitch = self.yaw = 0.0
        self.gimbal = 0.0
        self.limits = {"tilt": 20.0, "climb": 2.0, "turn": 60.0}
        self.sticks = (0, 0, 0, 0, 0)  # flag, roll, pitch, yaw, gaz
        self.deck = False

    def step(self):
        """One step of time."""
        now_s = time.monotonic()
        if self.state == "takingoff" and now_s - self.state_s > 0.5:
            self.enter("hovering")
        if self.state == "landing" and now_s - self.state_s > 0.5:
            self.enter("landed")
        if self.state == "landed":
            self.velocity, self.roll, self.pitch = [0.0, 0.0, 0.0], 0.0, 0.0
            return
        flag, roll, pitch, yaw, gaz = self.sticks if self.state in ("hovering", "flying") else (0, 0, 0, 0, 0)
        if self.state in ("hovering", "flying"):
            self.state = "flying" if any((flag, roll, pitch, yaw, gaz)) else "hovering"
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        full = math.radians(self.limits["tilt"])
        north, east, up = self.velocity
        if flag:
            tilt = full * roll / 100.0, -full * pitch / 100.0
        else:
            ahead, aside = c * north + s * east, c * east - s * north
            tilt = -math.atan(0.15 * aside), math.atan(0.15 * ahead)
        self.roll += (tilt[0] - self.roll) * STEP_S / 0.15
        self.pitch += (tilt[1] - self.pitch) * STEP_S / 0.15
        turn = math.radians(self.limits["turn"]) * yaw / 100.0
        self.yaw = (self.yaw + turn * STEP_S + math.pi) % (2.0 * math.pi) - math.pi
        ahead, aside = -9.81 * math.tan(self.pitch), 9.81 * math.tan(self.roll)
        climb = 1.0 if self.state == "takingoff" else self.limits["climb"] * gaz / 100.0
        self.velocity = [
            north + (c * ahead - s * aside - 0.3 * north) * STEP_S,
            east + (s * ahead + c * aside - 0.3 * east) * STEP_S,
            0.0 if self.deck and climb < 0.0 else up + (climb - up) * STEP_S / 0.2,
        ]
        self.up += self.velocity[2] * STEP_S

    def enter(self, name):
        """A flying state."""
        self.state, self.state_s = name, time.monotonic()


class Device:
    """What the aircraft says and hears."""

    def __init__(self):
        self.aircraft, self.lock = Aircraft(), threading.Lock()
        self.heard, self.pcmd_s, self.pcmd = [], [], []
        self.muted, self.told = False, None
        self.end = DeviceBase(drone_type=od.ARSDK_DEVICE_TYPE_ANAFI4K)
        self.end.subscribe(self.hear, None)
        self.listens = self.end.listen().result(5.0)

    def say(self, message, **values):
        """An event to whoever flies it."""
        if self.end.connected and not self.muted:
            self.end(message.as_command(**values))

    def hear(self, event, _):
        """A command."""
        message = getattr(event, "message", None)
        if message is None or message.message_type.name != "CMD":
            return
        name, args = message.fullName, {key: getattr(it, "name", it) for key, it in event.args.items()}
        with self.lock:
            if name == "ardrone3.Piloting.PCMD":
                self.pcmd_s.append(time.monotonic())
                self.pcmd.append([args[key] for key in ("flag", "roll", "pitch", "yaw", "gaz", "timestampAndSeqNum")])
                self.aircraft.sticks = tuple(self.pcmd[-1][:5])
                return
            self.heard.append([name, args])
        self.answer(name, args)

    def answer(self, name, args):
        """What a command makes of the aircraft."""
        craft, low = self.aircraft, {"min": 1.0}
        if name == "common.Common.AllStates":
            self.say(PilotingState.FlyingStateChanged, state=craft.state)
            self.say(BatteryStateChanged, percent=83)
            self.say(LinkSignalQuality, value=4)
            self.say(AllStatesChanged)
        elif name == "common.Settings.AllSettings":
            self.say(PilotingSettingsState.MaxDistanceChanged, current=150.0, min=10.0, max=2000.0)
            self.say(PilotingSettingsState.MaxAltitudeChanged, current=30.0, min=1.0, max=150.0)
            self.say(PilotingSettingsState.NoFlyOverMaxDistanceChanged, shouldNotFlyOver=1)
            self.say(AllSettingsChanged)
        elif name == "ardrone3.PilotingSettings.MaxTilt":
            craft.limits["tilt"] = min(max(args["current"], 1.0), 40.0)
            self.say(PilotingSettingsState.MaxTiltChanged, current=craft.limits["tilt"], max=40.0, **low)
        elif name == "ardrone3.SpeedSettings.MaxVerticalSpeed":
            craft.limits["climb"] = min(max(args["current"], 0.1), 4.0)
            self.say(MaxVerticalSpeedChanged, current=craft.limits["climb"], min=0.1, max=4.0)
        elif name == "ardrone3.SpeedSettings.MaxRotationSpeed":
            craft.limits["turn"] = min(max(args["current"], 3.0), 200.0)
            self.say(MaxRotationSpeedChanged, current=craft.limits["turn"], min=3.0, max=200.0)
        elif name == "gimbal.set_target":
            craft.gimbal = args["pitch"]
        elif name == "ardrone3.Piloting.TakeOff" and craft.state == "landed":
            craft.enter("takingoff")
        elif name == "ardrone3.Piloting.Landing" and craft.state != "landed":
            craft.enter("landing")

    def tell(self):
        """The events of one turn, five turns a second; the flying state when it changes."""
        craft = self.aircraft
        north, east, up = craft.velocity
        self.say(PilotingState.AttitudeChanged, roll=craft.roll, pitch=craft.pitch, yaw=craft.yaw)
        self.say(PilotingState.SpeedChanged, speedX=north, speedY=east, speedZ=-up)
        self.say(PilotingState.AltitudeChanged, altitude=craft.up)
        if craft.state != self.told:
            self.told = craft.state
            self.say(PilotingState.FlyingStateChanged, state=craft.state)
        self.say(
            gimbal.attitude, gimbal_id=0, yaw_frame_of_reference="relative", pitch_frame_of_reference="absolute",
            roll_frame_of_reference="absolute", yaw_relative=0.0, pitch_relative=0.0, roll_relative=0.0,
            yaw_absolute=math.degrees(craft.yaw), pitch_absolute=craft.gimbal, roll_absolute=0.0,
            list_flags=0,
        )  # fmt: skip

    def metadata(self):
        """The next picture's, as Parrot writes them into an RTP header extension."""
        craft, frame = self.aircraft, od.struct_vmeta_frame()
        frame.type = od.VMETA_FRAME_TYPE_V3
        base = frame.vmeta_frame_0.v3.base
        quaternion(base.drone_quat, craft.roll, craft.pitch, craft.yaw)
        quaternion(base.frame_quat, FORWARD_PICTURE_RAD, math.radians(craft.gimbal), craft.yaw)
        base.speed.north, base.speed.east, base.speed.down = (*craft.velocity[:2], -craft.velocity[2])
        data = ctypes.create_string_buffer(512)
        buffer = od.struct_vmeta_buffer()
        buffer.vmeta_buffer_0.data, buffer.len = ctypes.cast(data, od.POINTER_T(ctypes.c_ubyte)), len(data)
        od.vmeta_frame_write(ctypes.byref(buffer), ctypes.byref(frame))
        return data.raw[: buffer.pos]

    def report(self):
        """What came, and what it made of it."""
        craft = self.aircraft
        with self.lock:
            return {
                "state": craft.state, "up": craft.up, "limits": craft.limits, "gimbal": craft.gimbal,
                "heard": self.heard, "pcmd": self.pcmd, "pcmd_s": self.pcmd_s, "now_s": time.monotonic(),
                "connected": self.end.connected,
            }  # fmt: skip

    def obey(self, words):
        """A line of standard input that is for the aircraft."""
        if words[0] == "report":
            say(self.report())
        elif words[0] == "state":
            self.aircraft.enter(words[1])
        elif words[0] == "home":
            self.say(PilotingState.NavigateHomeStateChanged, state="inProgress", reason="lowBattery")
        elif words[0] == "mute":
            self.muted = True
        elif words[0] == "deck":
            self.aircraft.deck = True


class Aircrafts:
    """One after the other, because Olympe takes seconds to import."""

    def __init__(self, film):
        self.device = None
        self.video = RtspServer(film, PICTURE_HZ, lambda: self.device.metadata() if self.device else b"")

    def obey(self, words):
        """A line of standard input."""
        if words[0] == "begin":
            self.video.frozen.clear()
            self.device = Device()
            say({"listens": self.device.listens, "video_port": self.video.port})
        elif words[0] == "end":
            device, self.device = self.device, None
            device.end.destroy()
            say({})
        elif words[0] == "freeze":
            self.video.frozen.set()
        elif words[0] == "thaw":
            self.video.frozen.clear()
        else:
            self.device.obey(words)

    def listen(self):
        """Until standard input ends."""
        for line in sys.stdin:
            self.obey(line.split())
        os._exit(0)


def say(record):
    """A line of standard output."""
    print(json.dumps(record), flush=True)


def main():
    """Step and tell, until standard input ends."""
    aircrafts = Aircrafts(Path(sys.argv[1]).read_bytes())
    threading.Thread(target=aircrafts.listen, daemon=True).start()
    due_s, told_s = time.monotonic(), 0.0
    while True:
        device = aircrafts.device
        if device is not None:
            device.aircraft.step()
            if due_s - told_s >= EVENT_S:
                told_s = due_s
                device.tell()
        due_s = max(due_s + STEP_S, time.monotonic() - 0.1)
        time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    main()
