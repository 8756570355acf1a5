"""What is sent in our place when no set-point of ours comes any more: pure, on the times that it is given.

It speaks only while the autopilot's newest heartbeat shows a mode that obeys us: a person's mode is never touched.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass

from shipland.vehicles.mavlink.dialect import AUTOPILOT, Codec, Message, dialect

_SET_POINTS = ("SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED")
_BEAT_S = 1.0
_ASKS = 3
"""Number of requests for the holding mode."""
_ASK_S = 0.8
"""Time between two requests: below a second, the time between two heartbeats."""
ASK_TIME_S = 0.25
"""From one question of the time to the next; several may be lost before an answer is missed."""
ANSWERED_S = 1.5
"""Age of the newest question of the time that was answered, beyond which the link lags: what comes may be as old."""
FRESH_S = 0.1
"""Largest age of a heartbeat that shows the present mode."""
_GRANTED_S = 2.0
"""From our request for a mode to the heartbeat that shows it, at most."""
_ALONE_S = 5.0
"""Time for which the guard outlives our process: enough for every request and its answer."""


@dataclass(frozen=True)
class Orders:
    """What is to be done without us. Messages are MAVLink's bytes, in hexadecimal digits.

    Attributes:
        own: our system and component id.
        vehicle: system id.
        autopilot: MAV_AUTOPILOT: another program may speak as component 1.
        key: for signing, in hexadecimal digits; empty for none.
        setpoint_hz: holds a second.
        gap_s: without a set-point for so long we hold.
        silence_s: without a set-point for so long the holding mode is requested; without a heartbeat of the vehicle
            for so long its mode is not known, and nothing is sent.
        mode_mask: the part of a heartbeat's custom mode that says who is obeyed.
        holds: set-point to hold, by each mode that obeys us.
        ask: command for the mode that holds.
        beat: our heartbeat.
    """

    own: tuple[int, int]
    vehicle: int
    autopilot: int
    key: str
    setpoint_hz: float
    gap_s: float
    silence_s: float
    mode_mask: int
    holds: dict[str, str]
    ask: str
    beat: str

    def to_json(self) -> bytes:
        """To be read by `from_json`."""
        return json.dumps(asdict(self)).encode()

    @staticmethod
    def from_json(text: bytes) -> Orders:
        """The orders that `to_json` wrote."""
        return Orders(**json.loads(text))


class Guard:
    """Listens to both sides and says what is to be sent; times are `time.monotonic` [s]."""

    def __init__(self, orders: Orders, stream: bool) -> None:
        system, component = orders.own
        key = bytes.fromhex(orders.key) or None
        self._orders, self._stream, self._period_s = orders, stream, 1.0 / orders.setpoint_hz
        self._codec = Codec(system, component, key, link=(component + 1) % 256)
        self._ours = Codec(system, component)
        self._holds = {int(mode): self._message(text) for mode, text in orders.holds.items()}
        self._ask, self._beat = self._message(orders.ask), self._message(orders.beat)
        self._hold: Message | None = None
        """Set-point to hold in the newest heartbeat's mode; None: the mode is not ours."""
        self._level: list[float] | None = None
        """Quaternion of the last commanded heading."""
        self._heard_s = -math.inf
        """Newest heartbeat that did not wait for us."""
        self._answered_s = -math.inf
        """When the newest question of the time that was answered was put: what comes now is no older."""
        self._set_point_s: float | None = None
        """Newest set-point of ours that was obeyed; None: nothing to guard."""
        self._gone_s: float | None = None
        """End of our process."""
        self._turn_s = self._beat_s = self._ask_s = self._time_s = -math.inf
        self._asks = 0
        self._mode_asked_s = -math.inf
        """When we asked for a mode: one that comes then is ours, too."""
        self.taken = False
        """Whether the vehicle was taken while our process was silent: it is not ours again, whatever mode comes."""

    @property
    def news(self) -> str:
        """What our process is to know, in words; empty where nothing happened without it."""
        if self.taken:
            return "the vehicle was taken while our process had fallen silent"
        return "our process had fallen silent, so its guard asked for a mode that holds" if self._ask_s > 0.0 else ""

    def hear_us(self, data: bytes, now_s: float) -> None:
        """What leaves for the vehicle; a set-point in a mode that obeys it begins the watch."""
        for message in self._ours.decode_some(data, stream=False)[0]:
            if message.get_type() in _SET_POINTS and self._hold is not None:
                self._set_point_s, self._asks = now_s, 0
            if message.get_type() == "COMMAND_LONG" and message.command == dialect.MAV_CMD_DO_SET_MODE:
                self._mode_asked_s = now_s
            if message.get_type() == "SET_ATTITUDE_TARGET":
                w, _, _, z = message.q
                if (norm := math.hypot(w, z)) > 0.0:
                    self._level = [w / norm, 0.0, 0.0, z / norm]

    def hear_vehicle(self, data: bytes, now_s: float, waited: bool = False) -> None:
        """What came from the vehicle; a mode that is not ours ends the watch.

        What `waited` while this process stood still may not be the present mode.
        """
        for message in self._codec.decode_some(data, self._stream)[0]:
            sender = message.get_srcSystem(), message.get_srcComponent()
            if sender != (self._orders.vehicle, AUTOPILOT):
                continue
            if message.get_type() == "TIMESYNC" and message.tc1 > 0 and 1e-9 * message.ts1 <= now_s:
                self._answered_s = max(self._answered_s, 1e-9 * message.ts1)
            if message.get_type() != "HEARTBEAT" or message.autopilot != self._orders.autopilot:
                continue
            armed = message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
            self._heard_s = self._heard_s if waited else now_s
            self._hold = self._holds.get(message.custom_mode & self._orders.mode_mask) if armed else None
            if self._hold is None and self._set_point_s is not None:
                silent_s = now_s - self._set_point_s
                self.taken = silent_s > self._orders.gap_s and now_s - self._mode_asked_s > _GRANTED_S
                self._set_point_s = None

    def lose_us(self, now_s: float) -> None:
        """Our process has gone."""
        self._gone_s = now_s

    def over(self, now_s: float) -> bool:
        """Whether our process has gone and nothing is left to do."""
        return self._gone_s is not None and (self._set_point_s is None or now_s - self._gone_s > _ALONE_S)

    def due_s(self) -> float:
        """When `due` has something to send, as far as is known now."""
        if self._set_point_s is None:
            return math.inf
        silent_s = self._set_point_s + self._orders.gap_s if self._gone_s is None else self._gone_s
        return max(silent_s, self._turn_s + self._period_s)

    def due(self, now_s: float) -> list[bytes]:
        """What is to be sent now."""
        if now_s < self.due_s():
            return []
        self._turn_s = now_s
        heard_ago_s = now_s - self._heard_s
        if self._hold is None or self._set_point_s is None or heard_ago_s > self._orders.silence_s:
            return []
        if self._hold.get_type() == "SET_ATTITUDE_TARGET":
            if self._level is None:
                return []
            self._hold.q = self._level
        self._hold.time_boot_ms = int(1e3 * now_s) & 0xFFFFFFFF
        messages = [self._hold]
        if now_s - self._beat_s >= _BEAT_S:
            self._beat_s = now_s
            messages.append(self._beat)
        if now_s - self._time_s >= ASK_TIME_S:
            self._time_s = now_s
            messages.append(dialect.MAVLink_timesync_message(0, int(1e9 * now_s)))
        silent = self._gone_s is not None or now_s - self._set_point_s >= self._orders.silence_s
        # only straight after a heartbeat of our mode: a mode that a person chose since must not be taken away
        known = heard_ago_s < FRESH_S and now_s - self._answered_s <= ANSWERED_S
        if silent and known and self._asks < _ASKS and now_s - self._ask_s >= _ASK_S:
            self._asks, self._ask_s = self._asks + 1, now_s
            messages.append(self._ask)
        return [self._codec.encode(message) for message in messages]

    def _message(self, text: str) -> Message:
        return self._ours.decode_some(bytes.fromhex(text), stream=False)[0][0]
