"""From a touch of the deck to motors at rest."""

from __future__ import annotations

import math

from shipland.messages import Intent, PilotCommand
from shipland.vehicles.mavlink.dialect import dialect
from shipland.vehicles.mavlink.parameters import MavlinkParameters
from shipland.vehicles.mavlink.session import FORCE, Session
from shipland.vehicles.mavlink.state import AutopilotState
from shipland.vehicles.touchdown import ContactSignals, GroundContact, TouchdownParameters, TouchdownWatch

_RANGE_S = 1.0
"""Largest age of a rangefinder's reading that counts."""


class MotorStop:
    """Watches for the touchdown, and asks for the motors to stop; called only while the mode is ours."""

    def __init__(
        self, session: Session, parameters: MavlinkParameters, touchdown: TouchdownParameters, hover_throttle: float
    ) -> None:
        self._session, self._parameters = session, parameters
        self._watch = TouchdownWatch(touchdown, hover_throttle)
        self._asked_s, self._asked, self._answers = -math.inf, 0, 0
        self._told = False
        """It tells its throttle: zero, in a descent as on the deck, is also the word of one that does not."""

    def look(self, command: PilotCommand | None, state: AutopilotState, now_s: float) -> GroundContact:
        """Whether it has touched the deck; where it stands, ask for the motors to stop. A command too old is None."""
        self._told = self._told or state.throttle_percent > 0.0
        touch = ContactSignals(
            t_s=now_s,
            landing=command is not None and command.intent is Intent.LAND and state.armed,
            at_contact_height=command is not None and command.at_contact_height,
            throttle=0.01 * state.throttle_percent if self._told else math.nan,
            throttle_t_s=state.throttle_t_s,
            down_mps=state.velocity_in_ned_mps[2],
            down_t_s=state.velocity_t_s,
            range_m=state.range_m if now_s - state.range_t_s <= _RANGE_S else None,
        )
        contact = self._watch.see(touch)
        if contact is GroundContact.STANDS and state.armed:
            self._disarm(state, now_s)
        elif contact is GroundContact.NONE:
            self._asked = 0  # it was no touchdown: the next disarm request is an ordinary one again
        return contact

    def _disarm(self, state: AutopilotState, now_s: float) -> None:
        """Ask politely; by force as soon as that was denied, or was not obeyed for a while."""
        number = dialect.MAV_CMD_COMPONENT_ARM_DISARM
        denied = self._asked == 1 and state.denied(number, self._answers)
        if self._asked > 0 and not denied and now_s - self._asked_s < self._parameters.disarm_retry_s:
            return
        if self._session.command(number, 0, FORCE if self._asked > 0 and self._parameters.force_disarm else 0):
            self._asked_s, self._answers = now_s, state.answers(number)
            self._asked += 1
