"""What spoiled pictures do to the near vision: the cue in view, spoiled in every way of studies/spoiling.py.

Ranges are log-uniform in each bin, up to 30° off the bar's axis; light differs from scene to scene. What the light, the
lens and the shutter do comes before the sensor's noise (1.5), codecs after. The rolling shutter leaves the row of the
bar's middle where it is. Another exposure is laid over a picture whose pixels are averages already, which shifts every
edge a little, as a camera's tone curve does. Every picture is searched afresh.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from studies.harness import Case, Column, Row, Study
from studies.spoiling import SPOILERS, Picture, exposed, hue_turned, noise, panned, rolling_shutter, through_h264
from studies.views import COLUMNS, Setting, Trial, bins, figures, lit_scenes, look, view_at

RANGES = bins((2.0, 4.0, 8.0, 12.0, 15.0))
OFF_AXIS_DEG = 28.0
"""And 2° that `view_at` adds."""
NOISE = 1.5
MEGABIT_S = (4.0, 2.0, 1.0)
VIEWS_A_SCENE = 10
SEED = 21


def spoiled(clean: Picture, cue_row: float, rng: np.random.Generator) -> dict[str, Picture]:
    """A rendered picture in every way, by name; `cue_row` is where the cue's middle lies."""
    ways: dict[str, Callable[[Picture], Picture]] = {
        "nothing": lambda picture: picture,
        **{name: partial(SPOILERS[name], rng=rng) for name in ("spray", "glare", "fog", "motion blur")},
        "rolling shutter": lambda picture: rolling_shutter(picture, rng, still_row=cue_row),
        **{f"{ev:+g} EV": partial(exposed, exposure_ev=ev) for ev in (-2.0, 1.5)},
        **{f"hue {turn:+d}": partial(hue_turned, turn=turn) for turn in (-10, 10)},
    }
    pictures = {name: noise(way(clean), rng, NOISE) for name, way in ways.items()}
    pictures["JPEG"] = SPOILERS["JPEG"](noise(clean, rng, NOISE), rng)
    film = [noise(picture, rng, NOISE) for picture in panned(clean, rng)]
    return pictures | {f"H.264, {rate:.0f} Mbit/s": through_h264(film, rate)[-1] for rate in MEGABIT_S}


def cases() -> Sequence[Case]:
    """Ranges."""
    return [{"range_m": name} for name in RANGES]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` views; a row for each way of spoiling them."""
    name, setting, trials = str(case["range_m"]), Setting.packaged(), dict[str, list[Trial]]()
    eyes, (low_m, high_m) = setting.eyes(), RANGES[name]
    for scene, rng in lit_scenes(setting, SEED + list(RANGES).index(name), runs, VIEWS_A_SCENE):
        range_m = float(np.exp(rng.uniform(np.log(low_m), np.log(high_m))))
        view = view_at(range_m, rng.uniform(-OFF_AXIS_DEG, OFF_AXIS_DEG), setting.gimbal_noise_rad, rng)
        clean = scene.render(view.state(setting.rig), setting.camera)
        cue_px = setting.camera.project(view.bar_from_camera.inverse().apply(setting.rig.cue.points_in_bar_m))
        for way, image in spoiled(np.asarray(clean, np.uint8), float(cue_px[:, 1].mean()), rng).items():
            trials.setdefault(way, []).append(look(view, image, eyes, setting))
    return [{"spoiled": way, **row_of(some)} for way, some in trials.items()]


def row_of(trials: Sequence[Trial]) -> dict[str, object]:
    """Of one way at one range."""
    row = figures(trials)
    seen = "–" if row["position_m"] is None else f"{100.0 * row['position_m']:.2f} cm / {row['wrong']}"
    return row | {"together": f"{100.0 * row['found']:.0f} % / {seen}"}


STUDY = Study(
    question="What do spoiled pictures do to the near vision?",
    columns={
        "range_m": Column("range [m]"),
        "spoiled": Column("spoiled by"),
        **COLUMNS,
        "together": Column("accepted / position rms / wrong"),
    },
    cases=cases,
    measure=measure,
    runs=40,
    minutes=4,
)
