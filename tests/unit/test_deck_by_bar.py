"""What a ship's bar tells of its deck: a roll makes it sway farther, a pitch makes it heave less or more.

A turn carries the deck round the bar.
"""

from dataclasses import replace

import numpy as np
import pytest

from shipland.estimation.relative_state import (
    POSITION,
    STATES,
    WAVE,
    WAVE_RATE,
    AxisModel,
    Disturbances,
    GaussianState,
    Model,
)
from shipland.estimation.waves import WaveMotion
from shipland.frames import GRAVITY_MPS2
from shipland.guidance.horizon.estimated import Actuation, Estimated
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.guidance.horizon.regulator import Reference, Regulator
from shipland.guidance.response import ANAFI_LIKE

SHIP = WaveMotion(0.12, 2.0, 0.2, deck_shares=(0.6, 0.0, 0.0, 0.0))
HEAVES = replace(SHIP, deck_shares=(1.2, 0.0, 0.0, 0.0))
MOTION = AxisModel(0.1, 0.3)
BAR_ABOVE_DECK_M = 0.75


def estimated(wave: WaveMotion, heave: WaveMotion, sways_m: float = 0.0, heaves: tuple[float, float] = (0.0, 0.0)):
    across, down = np.zeros(2 * STATES), np.zeros(STATES)
    across[STATES + WAVE], down[[WAVE, WAVE_RATE]] = sways_m, heaves
    nothing = np.zeros(2)
    return Estimated(
        t_s=0.0,
        across=GaussianState(0.0, across, np.eye(2 * STATES)),
        down=GaussianState(0.0, down, np.eye(STATES)),
        model=Model(2, MOTION, Disturbances(), wave),
        wave=wave,
        heave=heave,
        tracked_near=1.0,
        place_m=nothing,
        speed_mps=nothing,
        followed_m=nothing,
        followed_mps=nothing,
        down_m=0.5,
        down_mps=0.1,
        nose_rad=0.0,
        bar_rad=0.0,
        turn_rad_s=0.0,
        bar_known=True,
        to_bar_rad=0.0,
        to_bar_rad_s=0.0,
        deck_in_bar_m=np.array([-2.0, 0.0, BAR_ABOVE_DECK_M]),
        actuation=Actuation(MOTION, nothing, None, nothing, 0.0),
    )


def test_a_bar_that_sways_farther_than_its_deck_shows_the_roll() -> None:
    roll_rad = (1.0 - 0.6) * 0.1 / BAR_ABOVE_DECK_M
    normal_mps2 = estimated(SHIP, HEAVES, sways_m=0.1).deck_normal_mps2(0.0)
    assert normal_mps2 == pytest.approx([0.0, GRAVITY_MPS2 * roll_rad])


def test_a_deck_that_heaves_farther_than_its_bar_is_lower_and_sinks_faster() -> None:
    seen = estimated(SHIP, HEAVES, heaves=(0.1, 0.3))
    assert seen.height_m == pytest.approx(BAR_ABOVE_DECK_M - 0.5 + 0.2 * 0.1)
    assert seen.sink_mps == pytest.approx(0.1 - 0.2 * 0.3)
    assert seen.deck_rises_mps(0.0) == seen.followed_rises_mps(0.0) == pytest.approx(-1.2 * 0.3)


def test_a_bar_at_rest_tells_nothing_of_its_deck() -> None:
    still = replace(SHIP, bar_moves=False)
    seen = estimated(still, still, sways_m=0.1, heaves=(0.1, 0.3))
    assert seen.deck_normal_mps2(0.3).tolist() == [0.0, 0.0]
    assert seen.height_m == pytest.approx(BAR_ABOVE_DECK_M - 0.5)
    assert (seen.sink_mps, seen.followed_rises_mps(0.0)) == (0.1, 0.0)
    assert seen.deck_rises_mps(0.0) == pytest.approx(-0.3)


@pytest.mark.parametrize("turn_rad_s", [0.0, 0.1])
def test_the_offset_at_contact_is_that_from_a_landing_point_which_the_reference_trails(turn_rad_s: float) -> None:
    still = WaveMotion(0.003, 1.8, 0.1)
    trails_m, contact_s, nothing = np.array([0.0, 0.12]), 0.5, np.zeros(2)
    across = np.zeros(2 * STATES)
    across[[POSITION, STATES + POSITION]] = place_m = np.array([-2.0, 0.0]) + trails_m
    seen = replace(
        estimated(still, still), across=GaussianState(0.0, across, np.eye(2 * STATES)), turn_rad_s=turn_rad_s
    )
    regulator = Regulator(HorizonParameters(), ANAFI_LIKE, None)
    reference = Reference(place_m, nothing, nothing)  # the aircraft is there, and rests
    offset_m, _ = regulator.at_contact(seen, reference, regulator.gains(seen, False, 0.033), contact_s)
    deck_mps = np.array([0.0, -2.0 * turn_rad_s])
    assert offset_m == pytest.approx(trails_m - contact_s * deck_mps)
