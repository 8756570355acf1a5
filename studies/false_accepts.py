"""How often the near vision takes something for the cue: pictures without it, and what became of each.

Scenes are rendered with the bar's board painted over; each serves for 40 pictures: other cuts of it, in other light,
hues and weather, or with a decoy painted in (studies/decoys.py), spoiled in one way or not at all
(studies/spoiling.py); every one is searched afresh. A pose that is given is also shown to a flight that knows where the
cue hangs (`[safety.cue_height]`), by a barometer that errs by 0.3 m (standard deviation).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shipland.messages import Frame, Observation, Telemetry
from shipland.safety.cue_checks import CueHeight, CueHeightParameters
from shipland.sim.scene.scene import Scene
from studies.decoys import DECOYS, Canvas, Picture, decoy_view, hide_bar
from studies.harness import Case, Column, Row, Study, share
from studies.spoiling import SPOILERS, noise, vary
from studies.views import Setting, View, light, view_at

PLAIN = "no decoy"
PICTURES_A_SCENE = 40
SCENES_A_LIGHT = 10
PLAIN_TIMES = 16
"""So many times as many pictures without a decoy as with each."""
BAROMETER_M = 0.3
CUE_HEIGHT = CueHeightParameters()
SEED = 6


class Backgrounds:
    """Rendered scenes from somewhere astern of the bar, with the bar's board painted over."""

    def __init__(self, setting: Setting, seed: int) -> None:
        self._setting, self._seed = setting, seed
        self._lit: tuple[int, Scene] | None = None

    def get(self, number: int) -> tuple[View, Picture]:
        """One of them; the same number gives the same."""
        setting, rng = self._setting, np.random.default_rng([self._seed, number, 0])
        range_m = float(np.exp(rng.uniform(np.log(1.8), np.log(40.0))))
        view = view_at(range_m, float(rng.uniform(-60.0, 60.0)), setting.gimbal_noise_rad, rng)
        picture = self._scene(number // SCENES_A_LIGHT).render(view.state(setting.rig), setting.camera)
        hide_bar(Canvas(picture, setting, view, rng))
        return view, picture

    def _scene(self, number: int) -> Scene:
        if self._lit is None or self._lit[0] != number:
            if self._lit is not None:
                self._lit[1].close()
            rng = np.random.default_rng([self._seed, number, 1])
            visibility_m = float(np.exp(rng.uniform(np.log(80.0), np.log(4e4))))
            self._lit = number, self._setting.scene(number, **light(rng), visibility_m=visibility_m)
        return self._lit[1]


def cases() -> Sequence[Case]:
    """What is painted in."""
    return [{"decoy": name} for name in (PLAIN, *DECOYS)]


def measure(case: Case, runs: int) -> Row:
    """`runs` pictures with a decoy, or many more without; every way of spoiling in turn."""
    decoy, setting = str(case["decoy"]), Setting.packaged()
    kind = [PLAIN, *DECOYS].index(decoy)
    eyes, backgrounds = setting.eyes(), Backgrounds(setting, SEED + 100 * kind)
    count, given, taken, reasons = runs * (PLAIN_TIMES if decoy == PLAIN else 1), 0, 0, Counter[str]()
    for number in range(count):
        rng = np.random.default_rng([SEED, kind, number])
        if number % PICTURES_A_SCENE == 0:
            scene_view, scene = backgrounds.get(number // PICTURES_A_SCENE)
        view, picture = scene_view, vary(scene, rng)
        if decoy != PLAIN:
            view = decoy_view(decoy, setting, rng)
            DECOYS[decoy](Canvas(picture, setting, view, rng))
        eyes.reset()
        observation = eyes.see(Frame(0.0, spoiled(picture, number, rng), view.gimbal))
        given += observation.bar_pose is not None
        taken += observation.bar_pose is not None and flown(observation, view, setting, rng)
        reasons[observation.reason] += observation.bar_pose is None
    words = ", ".join(f"{n} {reason}" for reason, n in reasons.most_common(4) if n)
    return {"pictures": count, "given": given, "given_share": share(given, count), "taken": taken, "refusals": words}


def spoiled(picture: Picture, number: int, rng: np.random.Generator) -> Picture:
    """In one of the ways, or not at all, with a sensor's noise."""
    name = [PLAIN, *SPOILERS][number % (1 + len(SPOILERS))]
    if name == "H.264":
        return SPOILERS[name](noise(picture, rng, 1.5), rng)
    return noise(picture if name == PLAIN else SPOILERS[name](picture, rng), rng, rng.uniform(0.5, 4.0))


def flown(observation: Observation, view: View, setting: Setting, rng: np.random.Generator) -> bool:
    """Whether a flight takes a first pose, told by its barometer how high over the water it is."""
    bar_height_m = setting.rig.bar_height_m
    known = CueHeight.of(replace(CUE_HEIGHT, over_takeoff_m=bar_height_m), setting.rig)
    height_m = bar_height_m - float(view.bar_from_camera.translation_m[2]) + rng.normal(0.0, BAROMETER_M)
    telemetry = Telemetry(observation.t_s, None, None, None, height_m, None, None, None, True)
    return known.with_height(telemetry).checked(observation)[1].bar_pose is not None


STUDY = Study(
    question="How often does the near vision take something else for the cue?",
    columns={
        "decoy": Column("pictures"),
        "pictures": Column("number", ",d"),
        "given": Column("poses given", "d"),
        "given_share": Column("share [%] (95 % interval)", ".2f", 100.0),
        "taken": Column("taken in flight", "d"),
        "refusals": Column("most refusals"),
    },
    cases=cases,
    measure=measure,
    runs=400,
    minutes=15,
)
