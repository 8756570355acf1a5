"""Where the camera looks while the deck is watched: down at the deck, and up to the bar before its place grows old."""

from __future__ import annotations

from dataclasses import dataclass

DOWN_RAD = -1.48
"""The camera's pitch."""


@dataclass(frozen=True)
class GimbalLookDown:
    """Of a landing that watches the deck.

    Attributes:
        down: at the deck, or up at the bar.
        since_s: when that was asked of the camera.
    """

    down: bool
    since_s: float


def next_look_down(
    before: GimbalLookDown | None, now_s: float, posed_s: float, blind_s: float, seen_s: float
) -> GimbalLookDown:
    """The glance a cycle later; `before` is None when the watch begins.

    Args:
        before: the glance.
        now_s: time of decision.
        posed_s: exposure of the newest picture that gave a pose.
        blind_s: the camera looks down for so long at most.
        seen_s: and then up until poses have come for so long.
    """
    if before is None:
        return GimbalLookDown(True, now_s)
    due = now_s - before.since_s > blind_s if before.down else posed_s - before.since_s > seen_s
    return GimbalLookDown(not before.down, now_s) if due else before
