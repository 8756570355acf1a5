"""From a connected vehicle to one that is ours and in the air."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

from shipland.errors import VehicleError
from shipland.stopping import sleep_or_stop
from shipland.vehicles.hand_over import hand_over_words
from shipland.vehicles.mavlink.control import Control
from shipland.vehicles.mavlink.dialect import dialect
from shipland.vehicles.mavlink.modes import mode_name, modes_of
from shipland.vehicles.mavlink.parameters import MavlinkParameters
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.setup import Engagement
from shipland.vehicles.mavlink.state import PX4, AutopilotState
from shipland.vehicles.mavlink.telemetry import transmitter_heard
from shipland.vehicles.waiting import wait_until

_log = logging.getLogger(__name__)

_TAKE_OFF_S = 30.0
"""Longest time of a take-off beyond its climb."""


class Taking:
    """Waits for the guided mode or asks for it, arms, and takes off at `climb_mps` or more, as far as allowed.

    It is given up where control is lost, or where `ended` says why the flight is over.
    """

    def __init__(
        self,
        session: Session,
        control: Control,
        parameters: MavlinkParameters,
        climb_mps: float,
        ended: Callable[[], str],
    ) -> None:
        self._session, self._control, self._climb_mps, self._ended = session, control, climb_mps, ended
        self._timeout_s = parameters.engage_timeout_s
        self.climbing = False
        """In our own take-off."""

    def run(self, engagement: Engagement) -> None:
        """Take the vehicle; VehicleError when it does not come to us, or a pilot takes it back."""
        session = self._session
        if not transmitter_heard(session.state, time.monotonic()):
            _log.warning("no transmitter is heard: taking over by stick is not possible, only by mode or key")
        self._control.begin(session.state, engagement.asks)
        if engagement.asks:
            # PX4 wants set-points before it gives OFFBOARD
            sleep_or_stop(1.0 if session.state.autopilot == PX4 else 0.0)
            self._insist(self._ask_guided, "the autopilot refuses its guided mode")
        else:
            _log.warning(self._hand_over_words())
        self._await_control()
        if engagement.take_off_m > 0.0:
            self._take_off(engagement.take_off_m)
        elif not session.state.armed:
            raise VehicleError("the vehicle is not armed; arm it and take off, or ask for it: takeoff=METRES")

    def _await_control(self) -> None:
        wait_until(
            lambda: self._control.granted or self._over(),
            self._timeout_s,
            lambda: f"the mode was not given to us ({self._hand_over_words()})",
        )
        if not self._control.granted:
            self._refuse_if_over()

    def _hand_over_words(self) -> str:
        """What the operator has to do."""
        state = self._session.state
        return hand_over_words(modes_of(state).guided_name, mode_name(state), self._control.obeys(state))

    def _over(self) -> str:
        """Why the flight is over, in words; empty while it is not."""
        return self._control.lost or self._ended()

    def _refuse_if_over(self) -> None:
        if words := self._over():
            raise VehicleError(words)

    def _wait(self, until: Callable[[AutopilotState], bool], timeout_s: float, otherwise: str) -> None:
        """As `Session.wait`, while control is ours."""
        self._session.wait(lambda state: self._over() or until(state), timeout_s, otherwise)
        self._refuse_if_over()

    def _ask_guided(self) -> int:
        """Ask for the mode that obeys us, until it is given or a pilot chose another; its MAV_RESULT."""
        control, mode = self._control, modes_of(self._session.state).guided
        ask = dialect.MAV_CMD_DO_SET_MODE, 1, *mode
        result = self._session.ask(*ask, unless=lambda: control.granted or self._over())
        return 0 if control.granted else result

    def _insist(self, ask: Callable[[], int], otherwise: str) -> None:
        """Ask every second until it is granted: an autopilot that has just booted refuses until it knows its place."""
        until_s = time.monotonic() + self._timeout_s
        while (result := ask()) != 0:
            self._refuse_if_over()
            if time.monotonic() > until_s:
                said = "; ".join(self._session.state.texts[-3:])
                raise VehicleError(f"{otherwise} (MAV_RESULT {result}): {said}")
            sleep_or_stop(1.0)
        self._refuse_if_over()

    def _take_off(self, height_m: float) -> None:
        session = self._session
        if not session.state.armed:
            arm = dialect.MAV_CMD_COMPONENT_ARM_DISARM
            self._insist(lambda: session.ask(arm, 1, 0, unless=self._over), "the autopilot does not arm")
        self._wait(lambda state: state.armed, 5.0, "the motors did not start")
        self.climbing = True
        try:
            if session.state.autopilot != PX4:
                climb = dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m
                result = session.ask(*climb, timeout_s=1.0, unless=self._over)
                self._refuse_if_over()
                if result < 0:
                    session.command(*climb)  # one that climbs already, and whose answer was lost, denies this
                elif result != 0:
                    raise VehicleError(f"the autopilot does not take off: {'; '.join(session.state.texts[-3:])}")
            near_m = max(0.3, 0.1 * height_m)
            longest_s = _TAKE_OFF_S + height_m / self._climb_mps
            self._wait(lambda state: state.height_m > height_m - near_m, longest_s, "the take-off did not end")
        finally:
            self.climbing = False
