"""Drawing situations at random: range, aspect, height, light, air, sea, motion, decoys. Same seed, same situations."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from shipland.camera import Camera
from shipland.config import build, key, parameters, require
from shipland.frames import Pose
from shipland.learning.decoys import CONTRAST_LEFT, Decoy, DecoyKind, foot_box_px
from shipland.learning.sensor import ImageSensorParameters, Span, require_spans
from shipland.learning.shot import Shot
from shipland.rig import Rig
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.ship.deck_motion import rig_limits
from shipland.sim.state import target_box

_AWAY_M = 5000.0


@parameters
class SynthParameters:
    """Ranges that are drawn from (`[synth]`), wide on purpose."""

    ship_range_m: Span = key((14.0, 360.0), "nearest and farthest ship", "beyond 15–350 m: the ends are learned too")
    bar_range_m: Span = key((6.0, 165.0), "nearest and farthest bar")
    uniform_share: float = key(0.6, "part of the ranges drawn uniformly, the rest log-uniformly", ge=0, le=1)
    empty_share: float = key(0.15, "part of the pictures without the target", ge=0, le=1)
    height_m: Span = key((1.0, 70.0), "of the camera above the sea, log-uniform")
    steepest_deg: float = key(50.0, "largest depression of the line of sight to the ship", ge=0, le=90)
    aspect_sigma_deg: float = key(35.0, "of the camera's bearing about dead astern", ge=0)
    any_aspect: float = key(0.25, "part of the bearings that is uniform instead", ge=0, le=1)
    roll_sigma_deg: float = key(1.0, "what the gimbal leaves", ge=0)
    edge_px: float = key(12.0, "the target's centre stays so far from the picture's edges, mostly")
    speed_mps: float = key(5.0, "fastest camera between the frames of one scene", ge=0)
    climb_mps: float = key(1.0, "fastest climb between frames", ge=0)
    turn_deg_s: float = key(6.0, "fastest turn between frames", ge=0)
    ship_speed_mps: float = key(4.5, "largest speed of the ship", "[Lee2022]", ge=0)
    visibility_m: Span = key((4000.0, 40000.0), "log-uniform")
    haze_m: Span = key((500.0, 4000.0), "visibility in haze, log-uniform")
    hazy: float = key(0.3, "chance of haze", ge=0, le=1)
    least_contrast: float = key(0.12, "the range is cut so that this part of the contrast is left", ge=0, le=1)
    sun_elevation_deg: Span = key((3.0, 80.0), "uniform")
    cloud_cover: Span = key((0.0, 1.0), "uniform")
    wave_height_m: Span = key((0.0, 1.2), "uniform")
    wind_mps: Span = key((0.0, 14.0), "uniform")
    exposure_ev: Span = key((-0.6, 0.8), "uniform", "sunlit faces clip, shade drowns")
    lamp: Span = key((0.8, 3.0), "uniform")
    sun_glare: Span = key((0.0, 1.2), "uniform")
    shutter_s: Span = key((0.0005, 0.006), "log-uniform, of the scene")
    rainy: float = key(0.08, "chance of rain, with drops on the lens", ge=0, le=1)
    rain_mm_h: Span = key((1.0, 15.0), "log-uniform")
    drops_max: float = key(0.4, "of drops on the lens, in rain; uniform from 0", ge=0, le=1)
    spray_max: float = key(0.6, "largest spray along the hull; uniform from 0", ge=0, le=1)
    auto_exposure: float = key(0.85, "of the scene", ge=0, le=1)
    pictures_per_scene: int = key(25, "pictures that share light, air and sea", ge=1)
    vessels: float = key(0.7, "mean number in a picture", ge=0)
    buoys: float = key(0.9, "mean number in a picture", ge=0)
    birds: float = key(0.4, "mean number in a picture", ge=0)
    greens: float = key(0.5, "mean number in a picture", ge=0)
    least_visible: float = key(0.5, "part of the target's box that must lie in the picture to be labelled", ge=0, le=1)
    least_facing: float = key(0.17, "sine of the flattest angle at which the bar is labelled", "10° off its plane")
    sensor: ImageSensorParameters = key(ImageSensorParameters(), "see `ImageSensorParameters`")

    def __post_init__(self) -> None:
        require_spans(self)
        for name in ("ship_range_m", "bar_range_m", "height_m", "visibility_m", "haze_m", "shutter_s", "rain_mm_h"):
            require(getattr(self, name)[0] > 0.0, f"{name} must be two positive numbers")


def draw_scene(block: int, parameters: SynthParameters, seed: int) -> tuple[SceneParameters, int]:
    """Light, air and sea of one block of pictures, and the seed of its waves and clouds."""
    rng = np.random.default_rng([seed, block, 0])
    hazy, rainy = rng.random() < parameters.hazy, rng.random() < parameters.rainy
    drawn = {
        "sun_azimuth_deg": rng.uniform(0.0, 360.0),
        "sun_elevation_deg": rng.uniform(*parameters.sun_elevation_deg),
        "visibility_m": _log_uniform(parameters.haze_m if hazy else parameters.visibility_m, rng),
        "cloud_cover": rng.uniform(*parameters.cloud_cover),
        "significant_wave_height_m": rng.uniform(*parameters.wave_height_m),
        "wave_direction_deg": rng.uniform(0.0, 360.0),
        "wind_speed_mps": rng.uniform(*parameters.wind_mps),
        "exposure_ev": rng.uniform(*parameters.exposure_ev),
        "lamp": rng.uniform(*parameters.lamp),
        "glare": rng.uniform(*parameters.sun_glare),
        "shutter_s": _log_uniform(parameters.shutter_s, rng),
        "rain_mm_h": _log_uniform(parameters.rain_mm_h, rng) if rainy else 0.0,
        "lens_drops": rng.uniform(0.0, parameters.drops_max) if rainy else 0.0,
        "spray": rng.uniform(0.0, parameters.spray_max),
    }
    of_the_sensor = {"gamma": 2.2, "contrast": 0.0, "shoulder": 0.0, "sharpening": 0.0, "sensor_noise": 0.0}
    scene = build(SceneParameters, drawn | of_the_sensor | {"auto_exposure": parameters.auto_exposure}, "synth")
    return scene, int(rng.integers(2**31))


def draw_shot(
    number: int,
    kind: Literal["ship", "bar"],
    scene: SceneParameters,
    camera: Camera,
    rig: Rig,
    parameters: SynthParameters,
    seed: int,
) -> Shot:
    """The situation of one picture."""
    rng = np.random.default_rng([seed, number, 1])
    empty = bool(rng.random() < parameters.empty_share)
    span = parameters.ship_range_m if kind == "ship" else parameters.bar_range_m
    clearest_m = scene.visibility_m * -np.log(max(parameters.least_contrast, 1e-6)) / CONTRAST_LEFT
    span = (span[0], max(min(span[1], clearest_m), 1.2 * span[0]))
    range_m = rng.uniform(*span) if rng.random() < parameters.uniform_share else _log_uniform(span, rng)
    steepest_m = range_m * np.sin(np.radians(parameters.steepest_deg))
    height_m = min(_log_uniform(parameters.height_m, rng), max(float(steepest_m), parameters.height_m[0]))
    height_m = min(height_m, 0.95 * range_m)
    if rng.random() < parameters.any_aspect:
        aspect_deg = rng.uniform(-180.0, 180.0)
    else:
        aspect_deg = float(np.clip(rng.normal(0.0, parameters.aspect_sigma_deg), -180.0, 180.0))
    target_up_m = rig.bar_height_m if kind == "bar" else 0.5 * rig.superstructure_height_m
    ship_heading = rng.uniform(-np.pi, np.pi)
    ship_position = np.array([0.0, 0.0, -rig.deck_height_m])
    ned_from_ship = Pose.from_euler(ship_position, 0.0, 0.0, ship_heading)
    target = ned_from_ship.apply(rig.bar_in_ship_m) if kind == "bar" else ship_position
    bearing = ship_heading + np.pi - np.radians(aspect_deg)
    ground_m = float(np.sqrt(max(range_m**2 - (height_m - target_up_m) ** 2, 0.25)))
    eye = np.array([target[0] + ground_m * np.cos(bearing), target[1] + ground_m * np.sin(bearing), -height_m])
    column, row = _place_in_picture(camera, parameters.edge_px, rng)
    roll = np.radians(parameters.roll_sigma_deg) * rng.standard_normal()
    depression = np.arctan2(height_m - target_up_m, ground_m)
    heading = bearing + np.pi - np.arctan((column - camera.matrix[0, 2]) / camera.matrix[0, 0])
    pitch = -depression + np.arctan((row - camera.matrix[1, 2]) / camera.matrix[1, 1])
    course = ship_heading + np.radians(rng.normal(0.0, 3.0))
    ship_velocity = rng.uniform(0.0, parameters.ship_speed_mps) * np.array([np.cos(course), np.sin(course), 0.0])
    fastest_mps = np.array([parameters.speed_mps, parameters.speed_mps, parameters.climb_mps])
    velocity = rng.uniform(-fastest_mps, fastest_mps)
    if empty:
        ship_position = ship_position - max(_AWAY_M, 3.0 * range_m) * np.array([np.cos(heading), np.sin(heading), 0.0])
    shot = Shot(
        number=number,
        kind=kind,
        empty=empty,
        range_m=range_m,
        aspect_deg=aspect_deg,
        visibility_m=scene.visibility_m,
        position_in_ned_m=eye,
        velocity_in_ned_mps=velocity,
        heading_rad=float(heading),
        heading_rate_rad_s=float(np.radians(rng.uniform(-parameters.turn_deg_s, parameters.turn_deg_s))),
        pitch_rad=float(np.clip(pitch, -1.4, 0.6)),
        roll_rad=float(roll),
        ship_position_in_ned_m=ship_position,
        ship_velocity_in_ned_mps=ship_velocity,
        ship_heading_rad=ship_heading,
        deck_amplitude=0.8 * rng.random() * rig_limits(rig) * rng.random(6),
        deck_phase_rad=rng.uniform(0.0, 2.0 * np.pi, 6),
        t0_s=rng.uniform(0.0, 600.0),
        decoys=(),
        sensor_seed=int(rng.integers(2**31)),
    )
    return replace(shot, decoys=_decoys(shot, camera, rig, parameters, rng))


def _log_uniform(span: Span, rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(span[0]), np.log(span[1]))))


def _place_in_picture(camera: Camera, edge_px: float, rng: np.random.Generator) -> Span:
    """Where the target's centre goes: anywhere, one time in twenty over the edge."""
    edge = -0.5 * edge_px if rng.random() < 0.05 else min(edge_px, 0.5 * camera.width_px, 0.5 * camera.height_px)
    return rng.uniform(edge, camera.width_px - edge), rng.uniform(edge, camera.height_px - edge)


def _decoys(
    shot: Shot, camera: Camera, rig: Rig, parameters: SynthParameters, rng: np.random.Generator
) -> tuple[Decoy, ...]:
    """Decoys in view that do not hide the target; those nearer than it keep clear of it."""
    state = shot.at(0.0, rig)
    camera_from_ned = state.ned_from_camera.inverse()
    box = None if shot.empty else target_box("ship", state, camera, rig, 0.01, 0.0)
    found: list[Decoy] = []
    for kind in get_args(DecoyKind):
        for _ in range(int(rng.poisson(getattr(parameters, f"{kind}s")))):
            decoy = _decoy(kind, shot, camera, rng)
            around = foot_box_px(decoy, camera, camera_from_ned)
            if around is None or (box is not None and _overlap(around, box)):
                continue
            found.append(decoy)
    return tuple(found)


def _decoy(kind: DecoyKind, shot: Shot, camera: Camera, rng: np.random.Generator) -> Decoy:
    size_m, ranges = {
        "vessel": (_log_uniform((6.0, 150.0), rng), (60.0, 4000.0)),
        "buoy": (_log_uniform((0.3, 3.5), rng), (8.0, 400.0)),
        "bird": (_log_uniform((0.3, 1.6), rng), (5.0, 150.0)),
        "green": (_log_uniform((0.2, 2.5), rng), (8.0, 250.0)),
    }[kind]
    distance = max(_log_uniform(ranges, rng), 2.0 * size_m)
    half_view = np.arctan(0.5 * camera.width_px / camera.matrix[0, 0])
    bearing = shot.heading_rad + rng.uniform(-half_view, half_view)
    up = 0.0
    if kind == "bird":
        up = float(max(-shot.position_in_ned_m[2] + distance * rng.uniform(-0.3, 0.3), 0.3))
    place = shot.position_in_ned_m[:2] + distance * np.array([np.cos(bearing), np.sin(bearing)])
    return Decoy(kind, np.append(place, -up), size_m, int(rng.integers(2**31)))


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
