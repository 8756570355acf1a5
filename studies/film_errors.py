"""What a rolling shutter and H.264 do to the near vision's poses, and whether their covariance stays true.

Films of eight pictures at 30 Hz by a camera that moves, turns and shakes (`Motion`); light differs from scene to scene.
Ranges are log-uniform in each bin, up to 40° off the bar's axis, sensor noise 1.5. The last picture of each film is
judged: once followed through the last four, and, behind a rolling shutter, once alone, and once by a camera that is not
told its row time. Coded films are files that `shipland see` looks at, once with the camera's attitude and once without.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from shipland.camera import Camera
from shipland.frames import Array, Pose, rotation_from_euler
from shipland.messages import Frame
from shipland.sim.scene.scene import Scene
from shipland.vision.attitude import AttitudeTrack
from shipland.vision.near.files import see_paths
from shipland.vision.near.pipeline import NearVision
from studies.harness import Case, Column, Row, Study
from studies.spoiling import FRAME_RATE_HZ, Picture, noise, to_h264
from studies.views import COLUMNS, Setting, Trial, View, bins, error_of, figures, lit_scenes, view_at

RANGES = bins((2.0, 4.0, 8.0, 15.0))
FILM, FOLLOWED = 8, 4
"""Pictures that are coded, and those of them that are looked at."""
NOISE = 1.5
READ_OUTS_MS = (0.0, 10.0, 20.0, 30.0)
MEGABIT_S = (1.0, 2.0, 4.0, 8.0)
OFF_AXIS_DEG = 38.0
FILMS_A_SCENE = 5
SEED = 31


@dataclass(frozen=True)
class Motion:
    """How the camera moves about a place that it passes at t = 0.

    Attributes:
        velocity_in_bar_mps: (3,).
        yaw_rate_rad_s: of the aircraft.
        pitch_rate_rad_s: of the gimbal, which states it.
        shake_rad: (2,) amplitude of what stabilisation leaves, about the camera's right and down axes; not stated.
        shake_hz: (2,) its frequency.
        shake_phase_rad: (2,) its phase at t = 0.
    """

    velocity_in_bar_mps: Array
    yaw_rate_rad_s: float
    pitch_rate_rad_s: float
    shake_rad: Array
    shake_hz: Array
    shake_phase_rad: Array

    @staticmethod
    def drawn(rng: np.random.Generator) -> Motion:
        """As over the deck: 0.3 m/s on every axis, 8°/s of yaw, 4°/s of pitch (rms), up to half a pixel of shake."""
        return Motion(
            velocity_in_bar_mps=rng.normal(0.0, 0.3, 3),
            yaw_rate_rad_s=float(rng.normal(0.0, np.radians(8.0))),
            pitch_rate_rad_s=float(rng.normal(0.0, np.radians(4.0))),
            shake_rad=rng.uniform(0.0, 5e-4, 2),
            shake_hz=rng.uniform(2.0, 12.0, 2),
            shake_phase_rad=rng.uniform(0.0, 2.0 * np.pi, 2),
        )

    def view(self, at_rest: View, t_s: float) -> View:
        """Where the camera is and what its gimbal states, of a camera that is `at_rest` at t = 0 but for its shake."""
        pitch_rad = self.pitch_rate_rad_s * t_s
        about_right, about_down = self.shake_rad * np.sin(2.0 * np.pi * self.shake_hz * t_s + self.shake_phase_rad)
        turn = rotation_from_euler(0.0, 0.0, self.yaw_rate_rad_s * t_s)
        within = cv2.Rodrigues(np.array([pitch_rad + about_right, about_down, 0.0]))[0]
        place_in_bar_m = at_rest.bar_from_camera.translation_m + self.velocity_in_bar_mps * t_s
        pose = Pose(turn @ at_rest.bar_from_camera.rotation @ within, place_in_bar_m)
        return View(pose, replace(at_rest.gimbal, pitch_rad=at_rest.gimbal.pitch_rad + pitch_rad))


def rendered(scene: Scene, at_rest: View, motion: Motion, times_s: Array, setting: Setting) -> list[Picture]:
    """A picture a time, all rows exposed at once, without noise."""
    return [
        scene.render(motion.view(at_rest, float(t_s)).state(setting.rig, float(t_s)), setting.camera) for t_s in times_s
    ]


def row_by_row(
    picture: Picture, at_rest: View, motion: Motion, t_s: float, read_out_s: float, setting: Setting
) -> Picture:
    """A picture of t_s as a rolling shutter has it that reads all rows in `read_out_s`, the middle one at t_s.

    Each row shows the bar's plane as the camera saw it when that row was exposed; what lies off it moves with it.
    """
    height, width = picture.shape[:2]
    rows = np.arange(height, dtype=float)
    moments_s = t_s + read_out_s * (rows - 0.5 * (height - 1)) / height
    here = _pixels_from_plane(motion.view(at_rest, t_s), setting)
    maps = np.array([here @ np.linalg.inv(_pixels_from_plane(motion.view(at_rest, s), setting)) for s in moments_s])
    left = maps @ np.stack([np.zeros(height), rows, np.ones(height)], axis=1)[:, :, None]
    points = left + maps[:, :, :1] * np.arange(width)
    columns, lines = (points[:, axis] / points[:, 2] for axis in (0, 1))
    moved = cv2.remap(
        picture, columns.astype(np.float32), lines.astype(np.float32), cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(moved, np.uint8)


def _pixels_from_plane(view: View, setting: Setting) -> Array:
    """(3,3) homography from the bar's plane (right, down, 1) [m] to pixels."""
    camera_from_bar = view.bar_from_camera.inverse()
    plane = np.column_stack([camera_from_bar.rotation[:, 1:], camera_from_bar.translation_m])
    return np.asarray(setting.camera.matrix @ plane)


@dataclass(frozen=True)
class Film:
    """One film without noise.

    Attributes:
        at_rest: the camera's place at the time of the last picture.
        motion: how it moves.
        times_s: (n,) of the pictures, the last at 0.
        pictures: n, all rows exposed at once.
    """

    at_rest: View
    motion: Motion
    times_s: np.ndarray
    pictures: list[Picture]


def ways(film: Film, setting: Setting, rng: np.random.Generator) -> Iterator[tuple[str, list[Picture], Camera]]:
    """The film's last pictures as each camera has them: name, pictures, and the camera as the vision knows it."""
    for read_out_ms in READ_OUTS_MS:
        read_out_s = 1e-3 * read_out_ms
        rolled = [
            row_by_row(picture, film.at_rest, film.motion, float(t_s), read_out_s, setting) if read_out_s else picture
            for picture, t_s in zip(film.pictures[-FOLLOWED:], film.times_s[-FOLLOWED:], strict=True)
        ]
        noisy = [noise(picture, rng, NOISE) for picture in rolled]
        name = f"read out in {read_out_ms:.0f} ms" if read_out_s else "plain"
        yield name, noisy, replace(setting.camera, row_time_s=read_out_s / setting.camera.height_px)
        if read_out_s:
            yield (
                f"{name}, one picture alone",
                noisy[-1:],
                replace(setting.camera, row_time_s=read_out_s / setting.camera.height_px),
            )
            yield f"{name}, row time not known", noisy, setting.camera


def judged(film: Film, pictures: Sequence[Picture], camera: Camera, setting: Setting) -> Trial:
    """The last of some pictures, followed through those before it."""
    vision = NearVision(setting.rig.cue, camera, setting.vision)
    for t_s, picture in zip(film.times_s[-len(pictures) :], pictures, strict=True):
        view = film.motion.view(film.at_rest, float(t_s))
        observation = vision.see(Frame(1.0 + float(t_s), picture, view.gimbal))
    pose = observation.bar_pose
    return Trial(view, observation.reason) if pose is None else Trial(view, "", error_of(pose, view), pose.covariance)


def seen(film: Film, setting: Setting, rng: np.random.Generator) -> Iterator[tuple[str, Trial]]:
    """The last picture of the film as a coded file, as `shipland see` has it."""
    noisy = [noise(picture, rng, NOISE) for picture in film.pictures]
    times_s = np.arange(FILM) / FRAME_RATE_HZ
    gimbals = [film.motion.view(film.at_rest, float(t_s)).gimbal for t_s in film.times_s]
    rows = [(float(t), gimbal.roll_rad, gimbal.pitch_rad) for t, gimbal in zip(times_s, gimbals, strict=True)]
    track = AttitudeTrack.of(rows, setting.vision.gimbal_noise_rad, "the gimbal's")
    view = film.motion.view(film.at_rest, 0.0)
    with tempfile.TemporaryDirectory() as folder:
        for rate in MEGABIT_S:
            path = Path(folder) / f"{rate:g}.mp4"
            path.write_bytes(to_h264(noisy, rate, "mp4"))
            for words, attitude in (("", track), (", no attitude", None)):
                *_, last = see_paths([path], setting.rig.cue, setting.camera, None, None, lambda _, it=attitude: it)
                pose = last.observation.bar_pose
                trial = (
                    Trial(view, last.observation.reason)
                    if pose is None
                    else Trial(view, "", error_of(pose, view), pose.covariance)
                )
                yield f"H.264, {rate:.0f} Mbit/s{words}", trial


def cases() -> Sequence[Case]:
    """Ranges."""
    return [{"range_m": name} for name in RANGES]


def measure(case: Case, runs: int) -> list[Row]:
    """`runs` films; a row for each camera."""
    name, setting, trials = str(case["range_m"]), Setting.packaged(), dict[str, list[Trial]]()
    low_m, high_m = RANGES[name]
    times_s = np.arange(1 - FILM, 1) / FRAME_RATE_HZ
    for scene, rng in lit_scenes(setting, SEED + list(RANGES).index(name), runs, FILMS_A_SCENE):
        range_m = float(np.exp(rng.uniform(np.log(low_m), np.log(high_m))))
        off_deg = float(rng.uniform(-OFF_AXIS_DEG, OFF_AXIS_DEG))
        at_rest, motion = view_at(range_m, off_deg, setting.gimbal_noise_rad, rng), Motion.drawn(rng)
        film = Film(at_rest, motion, times_s, rendered(scene, at_rest, motion, times_s, setting))
        for way, pictures, camera in ways(film, setting, rng):
            trials.setdefault(way, []).append(judged(film, pictures, camera, setting))
        for way, trial in seen(film, setting, rng):
            trials.setdefault(way, []).append(trial)
    return [{"film": way, **row_of(some)} for way, some in trials.items()]


def row_of(trials: Sequence[Trial]) -> dict[str, Any]:
    """Of one camera at one range."""
    row = figures(trials)
    seen = (
        "–"
        if row["nees"] is None
        else f"{100.0 * row['position_m']:.1f} cm / {row['yaw_deg']:.2f}° / {row['nees']:.2f}"
    )
    return row | {"together": f"{100.0 * row['found']:.0f} % / {seen} / {row['wrong']}"}


STUDY = Study(
    question="What do a rolling shutter and H.264 do to poses and their covariance?",
    columns={
        "range_m": Column("range [m]"),
        "film": Column("film"),
        **COLUMNS,
        "together": Column("found / position / yaw rms / error² / 4 / wrong"),
    },
    cases=cases,
    measure=measure,
    runs=80,
    minutes=10,
)
