"""Who flies the vehicle: the guided mode is given to us once, and whoever takes it back has it for good."""

from __future__ import annotations

from shipland.vehicles.hand_over import HandOver
from shipland.vehicles.mavlink.dialect import dialect
from shipland.vehicles.mavlink.modes import lands_by_itself, mode_name, obeys_us
from shipland.vehicles.mavlink.state import AutopilotState
from shipland.vehicles.touchdown import MOTORS_STOPPED

_RESTARTED = "the autopilot has restarted"


class Control:
    """The hand-over and the takeover; given every state by the receiving thread, asked at every set-point.

    Control begins with the guided mode: set by the operator after `begin`, or requested by us. From then on another
    mode or a moved stick end it, whatever mode comes later. The autopilot's own landing is no other mode once we have
    asked for it. A restart, or stopped motors, end the flight alone: nobody has taken a vehicle that, by its newest
    word, flies on in our mode, and it is to hold. One that has restarted before it was given to us is never ours: what
    was asked of it and read from it was lost.

    Args:
        stick_takeover_us: a stick moved by more takes over.
        by_speed: our set-points are velocities.
    """

    def __init__(self, stick_takeover_us: int, by_speed: bool = False) -> None:
        self._stick_takeover_us, self._by_speed = stick_takeover_us, by_speed
        self._hand_over: HandOver | None = None
        self._asked_in: int | None = None
        self._sticks_us: tuple[int, ...] = ()
        self._moved = 0
        self.granted = False
        """The guided mode was given to us."""
        self.over = ""
        """Why the flight is over, in words, though nobody has taken the vehicle, which is to hold; else empty."""
        self.lost = ""
        """Why control is gone for good, in words; empty while it is not."""
        self.by_sticks = False
        """It went to a pilot who moved the sticks, and whose mode does not obey them yet."""
        self.released = False
        """We have released it and requested a mode in which the autopilot holds by itself."""
        self.hands_over = False
        """We ask for the autopilot's own landing, or have been given it; a request that is denied is none."""

    @property
    def asking(self) -> bool:
        """Whether we may ask for the mode ourselves."""
        return self._asked_in is not None

    def begin(self, state: AutopilotState, asking: bool) -> None:
        """From now on the guided mode counts.

        Args:
            state: the newest.
            asking: as of `HandOver`; any third mode is the pilot's word.
        """
        hand_over = HandOver(asking)
        hand_over.see(self.obeys(state))
        self._asked_in = state.mode if asking else None
        self._hand_over = hand_over

    def obeys(self, state: AutopilotState) -> bool:
        """Whether the mode obeys our set-points."""
        return obeys_us(state, self._by_speed)

    def see(self, before: AutopilotState, after: AutopilotState) -> None:
        """Notice what a message has changed."""
        if self.lost or self._hand_over is None:
            return
        asked = dialect.MAV_CMD_DO_SET_MODE
        if not self.lands(before) and after.denied(asked, before.answers(asked)):
            self.hands_over = False
        ours = self.obeys(after) or self.lands(after)
        if not self.granted:
            if after.clock.restarts:
                self.lose(_RESTARTED)
                return
            self._hand_over.see(ours)
            self.granted = self._hand_over.given
            if not ours and self._asked_in not in (None, after.mode):
                self.lose(f"the pilot took over: {mode_name(after)}")
            return
        if after.clock.restarts or (before.armed and not after.armed):
            self.over = self.over or (_RESTARTED if after.clock.restarts else MOTORS_STOPPED)
        if not self._flies(after):
            return
        if not ours or (self.lands(before) and not self.lands(after)):
            self.lose(f"the pilot took over: {mode_name(after)}")
        elif after.sticks_us is not before.sticks_us and self._moved_sticks(after.sticks_us):
            self.by_sticks = True
            self.lose("the pilot moved the sticks")

    def lose(self, reason: str) -> None:
        """Control is gone for good; the first reason stands."""
        self.lost = self.lost or reason

    def has(self, state: AutopilotState) -> bool:
        """Whether we may command now: given to us, not taken, and the mode obeys us."""
        return self.granted and not self.lost and self.obeys(state) and self._flies(state)

    def answers_for(self, state: AutopilotState) -> bool:
        """Whether the vehicle flies as we want it: by our set-points, or in the landing that we have asked for."""
        return self.has(state) or (self.lands(state) and not self.lost and self._flies(state))

    def lands(self, state: AutopilotState) -> bool:
        """Whether the autopilot lands by itself because we have asked for it."""
        return self.hands_over and lands_by_itself(state)

    def holder(self, state: AutopilotState) -> str:
        """Who flies, in words."""
        if self.released or self.lands(state):
            return "the autopilot"
        if not self.obeys(state):
            return f"the pilot ({mode_name(state)})"
        if self.has(state):
            return "shipland"
        return f"nobody: {self.lost or self.over or f'{mode_name(state)} is not handed over'}"

    def _flies(self, state: AutopilotState) -> bool:
        """Whether there is something to hold, or to take, once the flight is over: a disarmed vehicle is neither's."""
        return state.armed or not self.over

    def _moved_sticks(self, sticks_us: tuple[int, ...]) -> bool:
        """Whether they stand twice on end away from where they stood when control was given, or first heard later."""
        self._sticks_us = self._sticks_us or sticks_us
        off_us = [abs(now - then) for now, then in zip(sticks_us, self._sticks_us, strict=False)]
        self._moved = self._moved + 1 if max(off_us, default=0) > self._stick_takeover_us else 0
        return self._moved >= 2
