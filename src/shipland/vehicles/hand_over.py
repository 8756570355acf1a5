"""When a vehicle is handed over to us, whatever the link."""

from __future__ import annotations


class HandOver:
    """Given is what changes into obeying us: a mode that was set before we came was set for somebody else.

    Args:
        asked: we ask for the vehicle, or were called to land it: it counts however it came to obey.
    """

    def __init__(self, asked: bool) -> None:
        self._counts = asked
        self.given = False

    def see(self, obeys: bool) -> None:
        """Whether the vehicle's mode obeys us now."""
        self._counts = self._counts or not obeys
        self.given = obeys and self._counts


def hand_over_words(given_by: str, mode: str, obeys: bool) -> str:
    """What the operator has to do; `given_by` names the mode that hands over, `mode` the present one."""
    if obeys:
        return f"the vehicle is in {mode} already: switch out of it and back to hand over, or start with take=1"
    return f"switch to {given_by} to hand over (it is {mode})"
