"""Vehicles' responses that several tests are about; `ANAFI_LIKE` is the package's."""

from dataclasses import replace

from shipland.guidance.response import ANAFI_LIKE

SPEED_LIKE = replace(
    ANAFI_LIKE,
    kind="velocity",
    max_speed_mps=7.5,
    servo_per_s=2.0,
    integral_per_s2=1.0,
    approach_per_s=2.0,
    smoothing_s=0.15,
)
"""Sticks that mean a speed, tracked by an autopilot with an integral."""
