"""How often the near vision takes something for the cue: pictures without it, and what became of each.

    python tools/false_accepts.py                      # 10,000 pictures, some ten minutes of one core; goes on where it
                                                       # was cut off
    python tools/false_accepts.py --pictures 200 --out out/some
    python tools/false_accepts.py --cue src/shipland/configs/cues/bar_asymmetric.toml --decoys "the bar in a wet deck" \
        "the bar in rippled water" --out out/asymmetric    # only these decoys, of another cue
    python tools/false_accepts.py --pictures 20000 --only "the bar in a wet deck" "the bar in rippled water"
                                                       # of these 20,000 the 666 that hold one of the two

Scenes are rendered with the bar's board painted over; each serves for 40 pictures: 32 are other cuts of it, in other
light, hues and weather, 8 have a decoy painted in (tools/false_pictures.py) and are spoiled in one way or not at all
(tools/spoiling.py). Every picture is searched afresh. A pose that is given is also shown to a flight that knows where
the cue hangs (`[safety.cue_height]`), by a barometer that errs by 0.3 m (standard deviation). Writes results.jsonl,
table.md, and every picture with a pose.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from false_pictures import DECOYS, Canvas, Picture, decoy_view, hide_bar
from near_views import Setting, View, light, markdown, view_at
from rich.progress import track
from spoiling import SPOILERS, noise, vary

from shipland.cue import Cue
from shipland.messages import Frame, Observation, Telemetry
from shipland.safety.cue_height import CueHeight, CueHeightParameters
from shipland.sim.scene.scene import Scene

PICTURES_A_SCENE = 40
DECOYS_A_SCENE = 8
PLAIN = "none"
SCENES_A_LIGHT = 10
BAROMETER_M = 0.3
CUE_HEIGHT = CueHeightParameters()


@dataclass(frozen=True)
class Result:
    """What became of one picture.

    Attributes:
        number: of the picture.
        decoy: what was painted in, or "none".
        spoiler: what was done to it, or "none".
        reason: the refusal in words; empty for a pose.
        flown: the pose passes in a flight that knows where the cue hangs.
    """

    number: int
    decoy: str
    spoiler: str
    reason: str
    flown: bool = False


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


def decoy_number(number: int, decoys: Sequence[str]) -> int | None:
    """Of the picture among those with a decoy; None for one without."""
    if len(decoys) < len(DECOYS):
        return number
    place = number % PICTURES_A_SCENE
    return number // PICTURES_A_SCENE * DECOYS_A_SCENE + place if place < DECOYS_A_SCENE else None


def decoy_of(number: int, decoys: Sequence[str]) -> str:
    """What is painted into a picture, or "none"."""
    index = decoy_number(number, decoys)
    return PLAIN if index is None else decoys[index % len(decoys)]


def make(
    number: int, seed: int, view: View, scene: Picture, setting: Setting, decoys: Sequence[str]
) -> tuple[Result, Frame, View]:
    """One picture, its result with the reason still open, and where it was taken."""
    rng = np.random.default_rng([seed, number, 2])
    index, decoy = decoy_number(number, decoys), decoy_of(number, decoys)
    if index is not None:
        # Each decoy comes once with each spoiler before one comes twice.
        spoilers = [PLAIN, *SPOILERS]
        spoiler = spoilers[index // len(decoys) % len(spoilers)]
        view = decoy_view(decoy, setting, rng)
        picture = vary(scene, rng)
        DECOYS[decoy](Canvas(picture, setting, view, rng))
    else:
        spoiler = str(rng.choice([PLAIN, *(name for name in SPOILERS if name != "H.264")]))
        picture = vary(scene, rng)
    if spoiler == "H.264":
        picture = SPOILERS[spoiler](noise(picture, rng, 1.5), rng)
    else:
        if spoiler != PLAIN:
            picture = SPOILERS[spoiler](picture, rng)
        picture = noise(picture, rng, rng.uniform(0.5, 4.0))
    return Result(number, decoy, spoiler, ""), Frame(0.0, picture, view.gimbal), view


def flown(observation: Observation, view: View, setting: Setting, rng: np.random.Generator) -> bool:
    """Whether a flight takes a first pose, told by its barometer how high over the water it is."""
    bar_height_m = setting.rig.bar_height_m
    known = CueHeight.of(replace(CUE_HEIGHT, over_takeoff_m=bar_height_m), setting.rig)
    height_m = bar_height_m - float(view.bar_from_camera.translation_m[2]) + rng.normal(0.0, BAROMETER_M)
    telemetry = Telemetry(observation.t_s, None, None, None, height_m, None, None, None, True)
    return known.with_height(telemetry).checked(observation)[1].bar_pose is not None


def table(results: list[Result]) -> str:
    """Poses and refusals by kind of picture."""
    reasons = [reason for reason, _ in Counter(r.reason for r in results if r.reason).most_common()]
    rows = []
    kinds = [PLAIN, *DECOYS]
    for title, attribute, names in (("decoy", "decoy", kinds), ("spoiled by", "spoiler", [PLAIN, *SPOILERS])):
        for name in names:
            some = [r for r in results if getattr(r, attribute) == name]
            if attribute == "spoiler":
                some = [r for r in some if r.decoy != PLAIN]
            label = "no decoy" if (title, name) == ("decoy", PLAIN) else f"{title}: {name}"
            rows.append([label, str(len(some)), *_poses(some),
                         *(str(sum(r.reason == reason for r in some)) for reason in reasons)])  # fmt: skip
    rows.append(["all", str(len(results)), *_poses(results),
                 *(str(sum(r.reason == reason for r in results)) for reason in reasons)])  # fmt: skip
    return markdown(["pictures", "number", "poses given", "taken in flight", *reasons], rows)


def _poses(results: list[Result]) -> tuple[str, str]:
    """Given by the picture alone, and taken by a flight that knows where the cue hangs."""
    return f"**{sum(not r.reason for r in results)}**", f"**{sum(r.flown for r in results)}**"


def main() -> None:
    """Run and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=6)
    parser.add_argument("--out", type=Path, default=Path("out/false_accepts"))
    parser.add_argument("--cue", type=Path, help="TOML of another cue in the bar's place")
    parser.add_argument("--manufacturing-tolerance", type=float, help="in place of the cue's own")
    parser.add_argument("--decoys", nargs="+", default=list(DECOYS), choices=list(DECOYS), help="nothing but these")
    parser.add_argument("--only", nargs="+", choices=[PLAIN, *DECOYS], help="leave out the pictures that hold another")
    arguments = parser.parse_args()
    out: Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    path = out / "results.jsonl"
    results = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            item = json.loads(line)
            results[item["number"]] = Result(**item)
    setting = Setting.packaged()
    if arguments.cue is not None:
        cue = Cue.from_file(arguments.cue)
        setting = replace(
            setting, rig=replace(setting.rig, polygon=cue.polygon, manufacturing_tolerance=cue.manufacturing_tolerance)
        )
    if arguments.manufacturing_tolerance is not None:
        setting = replace(setting, rig=replace(setting.rig, manufacturing_tolerance=arguments.manufacturing_tolerance))
    eyes, backgrounds = setting.eyes(), Backgrounds(setting, arguments.seed)
    scenes = -(-arguments.pictures // PICTURES_A_SCENE)
    with path.open("a", encoding="utf-8") as kept:
        for number in track(range(scenes), description="scenes"):
            first = number * PICTURES_A_SCENE
            numbers = range(first, min(first + PICTURES_A_SCENE, arguments.pictures))
            open_ones = [
                n
                for n in numbers
                if n not in results and (arguments.only is None or decoy_of(n, arguments.decoys) in arguments.only)
            ]
            if not open_ones:
                continue
            view, scene = backgrounds.get(number)
            for index in open_ones:
                result, frame, view_of = make(index, arguments.seed, view, scene, setting, arguments.decoys)
                eyes.reset()
                observation = eyes.see(frame)
                result = replace(result, reason=observation.reason)
                if observation.bar_pose is not None and frame.image is not None:
                    rng = np.random.default_rng([arguments.seed, index, 3])
                    result = replace(result, flown=flown(observation, view_of, setting, rng))
                    cv2.imwrite(str(out / f"pose-{index:05d}.png"), frame.image)
                results[index] = result
                kept.write(json.dumps(vars(result)) + "\n")
            kept.flush()
    text = table([results[n] for n in sorted(results) if n < arguments.pictures])
    (out / "table.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
