"""How much of the bar's wave motion the deck's centre has, on a ship that carries its bar level over a deck that rolls.

The bar stands above the deck, so a roll moves it farther, and earlier. Along the ship's axes: the standard deviations
of the point that the bar defines and of the deck's centre, and what is left of the second when it is predicted from
pictures of the bar: by one share of the bar's motion, by the pilot's shares of the wave motion's four states
(`guidance.horizon.wave.deck_shares`), and by those that are best here, now and so far ahead as a picture is old; and
what the best linear filter over five seconds of pictures leaves, fitted to half of the motions, in the other half. And
the deck's tilt along the axis, which the pilot takes from how much farther the bar moves than the deck below it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_discrete_are

from shipland.estimation.relative_state import discretised
from shipland.estimation.waves import WAVE_STATES, WaveMotion
from shipland.frames import Array
from shipland.guidance.horizon.parameters import HorizonParameters
from shipland.scenario.autonomy import drawn_ship
from shipland.scenario.scenario import load_scenario
from studies.harness import Case, Column, Row, Study

SCENARIOS = ("ship-natops", "ship-sea5", "ship-sea6")
AXES = ("forward", "starboard", "down")
DOWN = 2
STEP_S, SETTLED_S, AHEAD_S = 1.0 / 30.0, 10.0, 0.5
TIMES_S = np.arange(0.0, 60.0, STEP_S)
PICTURE_M = 0.01
"""Standard deviation of a picture's place."""
FILTER_S, EVERY = 5.0, 5
"""What a linear filter looks back on, and which pictures of it."""


def cases() -> Sequence[Case]:
    """Ships that carry their bar."""
    return [{"scenario": name} for name in SCENARIOS]


def estimated(wave: WaveMotion, places_m: Array) -> Array:
    """(n,4) states of a wave motion by pictures (n,) of it: the stationary Kalman filter."""
    transition, _, noise = discretised(wave.matrix, np.zeros((WAVE_STATES, 1)), wave.noise, STEP_S)
    seen = np.array([[1.0, 0.0, 0.0, 0.0]])
    predicted = solve_discrete_are(transition.T, seen.T, noise, np.array([[PICTURE_M**2]]))
    gain = predicted[:, 0] / (predicted[0, 0] + PICTURE_M**2)
    state, states = np.zeros(WAVE_STATES), []
    for place_m in places_m.tolist():
        state = transition @ state
        state = state + gain * (place_m - state[0])
        states.append(state)
    return np.array(states)


def left_by_filter_m(pictures_m: list[Array], centres_m: list[Array], ahead: int) -> float:
    """Standard deviation of what a linear filter of pictures (n,k) leaves of centres (n,), so many pictures later."""
    back, count = round(FILTER_S / STEP_S), len(pictures_m) // 2
    rows = [
        np.array([shown[at - back : at : EVERY].ravel() for at in range(back, len(shown) - ahead)])
        for shown in pictures_m
    ]
    true = [centre[back + ahead :] for centre in centres_m]
    known, fitted = np.concatenate(rows[:count]), np.concatenate(true[:count])
    ridge = len(known) * PICTURE_M**2 * np.eye(known.shape[1])
    weights = np.linalg.solve(known.T @ known + ridge, known.T @ fitted)
    return float(np.std(np.concatenate(true[count:]) - np.concatenate(rows[count:]) @ weights))


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` motions of a minute; a row an axis."""
    scenario, parameters, rng = load_scenario(str(case["scenario"])), HorizonParameters().wave, np.random.default_rng(1)
    wave = parameters.hypotheses[parameters.first]
    ahead, settled = round(AHEAD_S / STEP_S), round(SETTLED_S / STEP_S)
    rows: list[Row] = []
    motions = []
    for seed in range(runs):
        ship, shown, centres, normals = drawn_ship(scenario, seed), [], [], []
        for at in map(ship.at, TIMES_S.tolist()):
            to_ship = at.ned_from_ship.inverse()
            shown.append((to_ship @ at.ned_from_bar).apply(scenario.rig.deck_in_bar_m))
            centres.append((to_ship @ at.ned_from_deck).translation_m)
            normals.append(-(to_ship @ at.ned_from_deck).rotation[:, 2])
        motions.append(tuple(np.array(some) - np.mean(some, axis=0) for some in (shown, centres, normals)))
    for axis, name in enumerate(AXES):
        bar, deck = (np.concatenate([motion[which][settled:, axis] for motion in motions]) for which in (0, 1))
        shares = wave.deck if axis != DOWN else replace(wave, deck_shares=parameters.deck_heave_shares).deck
        share = float(bar @ deck / (bar @ bar))
        row: Row = {"axis": name, "share": share}
        sizes_m = [float(np.std(some)) for some in (bar, deck, deck - share * bar)]
        row |= dict(zip(("bar_m", "deck_m", "left_m"), sizes_m, strict=True))
        for when, later in (("now", 0), ("ahead", ahead)):
            states, true_m, raised_m, slopes = [], [], [], []
            for shown_m, centres_m, normals in motions:
                pictures_m = shown_m[:, axis] + PICTURE_M * rng.standard_normal(len(shown_m))
                found = np.array([wave.later(state, later * STEP_S) for state in estimated(wave, pictures_m)])
                states.append(found[settled : len(found) - later])
                true_m.append(centres_m[settled + later :, axis])
                raised_m.append((centres_m - shown_m)[settled + later :, axis])
                slopes.append(normals[settled + later :, axis])
            every, truth, raised, slope = (np.concatenate(some) for some in (states, true_m, raised_m, slopes))
            best = np.linalg.lstsq(every, truth, rcond=None)[0]
            guesses = {"one": share * every[:, 0], "pilot": every @ shares[0], "best": every @ best}
            row |= {f"{which}_{when}_m": float(np.std(truth - guess)) for which, guess in guesses.items()}
        if axis == DOWN:
            told = every @ (shares[0] - wave.bar[0])
            row |= {"raised_m": float(np.std(raised)), "raised_left_m": float(np.std(raised - told))}
        else:
            told = every @ (wave.bar[0] - wave.deck[0]) / scenario.rig.deck_in_bar_m[DOWN]
            tilts_deg = {"tilt_deg": np.degrees(slope), "tilt_left_deg": np.degrees(slope - told)}
            row |= {key: float(np.std(tilt_deg)) for key, tilt_deg in tilts_deg.items()}
        seen_m = [shown + PICTURE_M * rng.standard_normal(shown.shape) for shown, _, _ in motions]
        own_m, with_heave_m = [some[:, [axis]] for some in seen_m], [some[:, [axis, DOWN]] for some in seen_m]
        true_m = [centres_m[:, axis] for _, centres_m, _ in motions]
        row["filter_ahead_m"] = left_by_filter_m(own_m, true_m, ahead)
        row["with_heave_ahead_m"] = left_by_filter_m(with_heave_m, true_m, ahead)
        rows.append(row)
    return rows


STUDY = Study(
    question="How much of the bar's wave motion does the deck's centre have?",
    columns={
        "scenario": Column("scenario"),
        "axis": Column("along"),
        "bar_m": Column("bar's point [cm]", ".1f", 100.0),
        "deck_m": Column("deck's centre [cm]", ".1f", 100.0),
        "share": Column("its best share of the bar's", ".2f"),
        "left_m": Column("left by it, bar known [cm]", ".1f", 100.0),
        "one_now_m": Column("left by that share [cm]", ".1f", 100.0),
        "pilot_now_m": Column("left by the pilot's four [cm]", ".1f", 100.0),
        "best_now_m": Column("left by the best four [cm]", ".1f", 100.0),
        "one_ahead_m": Column("0.5 s ahead: left by one share [cm]", ".1f", 100.0),
        "pilot_ahead_m": Column("by the pilot's [cm]", ".1f", 100.0),
        "best_ahead_m": Column("by the best four [cm]", ".1f", 100.0),
        "filter_ahead_m": Column("by the best linear filter over 5 s [cm]", ".1f", 100.0),
        "with_heave_ahead_m": Column("and of the heave [cm]", ".1f", 100.0),
        "raised_m": Column("deck's height against the bar's [cm]", ".1f", 100.0),
        "raised_left_m": Column("0.5 s ahead: left by the pilot's [cm]", ".1f", 100.0),
        "tilt_deg": Column("deck's tilt [°]", ".1f"),
        "tilt_left_deg": Column("0.5 s ahead: left by the pilot's [°]", ".1f"),
    },
    cases=cases,
    measure=measure,
    runs=16,
    minutes=1,
)
