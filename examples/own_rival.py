"""A rival of one's own: the published modes, and over the ship a law that flies at a speed proportional to the error.

shipland fly --pilot own_rival:proportional --vision geometric --set aircraft.loop.kind=velocity    # in this folder
shipland campaign --pilot own_rival:proportional,velocity_matching --runs 100 --set aircraft.loop.kind=velocity
"""

from shipland.guidance.far import FarTables, far_control
from shipland.guidance.mode_pilot import ModePilot
from shipland.guidance.near import MeasuredError, NearEstimate
from shipland.guidance.pilot import Pilot, PilotSetup
from shipland.guidance.response import HOLD, SticksPercent, clamp

GAIN_PER_S, MOST_MPS = 0.5, 1.5


class Proportional:
    """A `NearControl`: one picture's errors in, sticks out, in the axes of the aircraft's nose."""

    def __init__(self, setup: PilotSetup) -> None:
        self.response, self.estimate = setup.response, None

    def observe(self, measured: MeasuredError) -> NearEstimate:
        """The errors as they are; their rate, by which the modes find it steady, smoothed over some pictures."""
        before, error_m = self.estimate, measured.error_in_level_m
        rate_mps = 0.0 * error_m
        if before is not None and measured.t_s > before.t_s:
            rate_mps = before.rate_in_level_mps
            rate_mps = rate_mps + 0.2 * ((error_m - before.error_in_level_m) / (measured.t_s - before.t_s) - rate_mps)
        self.estimate = NearEstimate(measured.t_s, error_m, rate_mps, measured.yaw_rad, measured.bar_elevation_rad)
        return self.estimate

    def sticks(self, wanted_yaw_rad: float) -> SticksPercent:
        """A speed for every error; sticks that mean a tilt would need a velocity loop before them."""
        if self.estimate is None:
            return HOLD
        forward, right, up = (clamp(GAIN_PER_S * error_m, MOST_MPS) for error_m in self.estimate.error_in_level_m)
        turn = 100.0 * (wanted_yaw_rad - self.estimate.yaw_rad) / self.response.max_turn_rad_s
        pitch, roll = self.response.stick_of(forward), self.response.stick_of(right)
        sticks = SticksPercent(pitch, roll, 100.0 * up / self.response.max_climb_mps, turn)
        return SticksPercent(*(clamp(stick, 100.0) for stick in sticks))

    def reset(self) -> None:
        """The bar was lost, or the reference changed."""
        self.estimate = None


def proportional(setup: PilotSetup) -> Pilot:
    """The factory: called once a flight."""
    guidance = setup.guidance
    tables = FarTables.for_camera(guidance.ship, guidance.bar, setup.camera)
    far = far_control("p", guidance.far_variant, guidance.far_baselines, guidance.near, tables, setup.camera)
    return ModePilot(setup, tables, far, Proportional(setup))
