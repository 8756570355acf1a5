"""Pictures and films of the documentation, from drawn scenes and from flights.

python tools/doc_pictures.py scene       # the rig in nine weathers: docs/pictures/scene.jpg
python tools/doc_pictures.py frigate     # the frigate on the way in: docs/pictures/full-scale.jpg
python tools/doc_pictures.py airwake     # docs/pictures/airwake.png
python tools/doc_pictures.py frames out/demo/flight.mp4 docs/pictures/demo.jpg --at 25 56
python tools/doc_pictures.py film out/demo/flight.mp4 docs/pictures/full-scale.mp4 --faster 16 --last-s 12
python tools/doc_pictures.py log out/outside/rig-natops-1/flight.mcap out/film.mp4   # of a flight without pictures
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import av
import cv2
import numpy as np
import tyro

from shipland.camera import Camera, CameraParameters
from shipland.frames import Pose
from shipland.messages import FlightRecord
from shipland.record.reader import FlightLog, read_log
from shipland.report.chase import chase_view, look_at
from shipland.report.video import FlightVideo, VideoParameters, VideoWriter
from shipland.rig import Rig
from shipland.scenario.autonomy import aircraft_scale, build_scene, drawn_ship
from shipland.scenario.scenario import Scenario, load_scenario
from shipland.sim.scene.scene import Scene
from shipland.sim.scene_parameters import SceneParameters
from shipland.sim.ship.ship import ShipState
from shipland.sim.state import SceneState
from shipland.vision.pictures import Picture, read_video

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
sys.path.insert(0, str(ROOT))  # the studies stand beside the package
from studies.speed_render import state_at  # noqa: E402

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHEET: list[tuple[float, float, dict[str, float]]] = [  # range, height over the bar, weather
    (3.0, 0.0, {}),
    (12.0, 1.5, {}),
    (100.0, 5.0, {}),
    (9.0, 1.2, {"sun_azimuth_deg": 12.0, "sun_elevation_deg": 12.0}),
    (9.0, 1.2, {"sun_azimuth_deg": 40.0, "sun_elevation_deg": 0.0}),
    (9.0, 1.2, {"visibility_m": 60.0, "cloud_cover": 0.9}),
    (9.0, 1.2, {"rain_mm_h": 20.0, "cloud_cover": 0.95, "visibility_m": 8000.0}),
    (9.0, 1.2, {"significant_wave_height_m": 0.8, "wind_speed_mps": 14.0, "spray": 1.0}),
    (9.0, 1.2, {"lens_drops": 0.8}),
]
WAVED_OFF: list[tuple[float, float, dict[str, float]]] = [
    (6.0, 0.4, {}),
    (9.0, 1.2, {"sun_elevation_deg": -8.0}),
    (9.0, 1.2, {"sun_elevation_deg": -20.0}),
]
"""With the status light on."""
PLACES = {  # forward, starboard, down of the deck's centre [m]
    "3 km": (-3000.0, 260.0, -60.0),
    "1 km": (-1000.0, 80.0, -25.0),
    "300 m": (-300.0, 20.0, -16.0),
    "60 m": (-60.0, -4.0, -9.0),
    "hover": (0.0, 0.0, -6.0),
    "quarter": (-120.0, -110.0, -30.0),
}
TILE_PX = (576, 324)


def tiled(tiles: Sequence[Picture], across: int, path: Path, quality: int) -> None:
    """Pictures of one size, `across` in a row."""
    rows = [np.hstack(tiles[index : index + across]) for index in range(0, len(tiles), across)]
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, quality])


def scene(out: Path = PICTURES / "scene.jpg") -> None:
    """Twelve frames of the rig, in weathers and from ranges, and with the status light on."""
    camera, tiles = Camera.from_parameters(CameraParameters()), []
    for range_m, height_m, changes in SHEET + WAVED_OFF:
        red = (range_m, height_m, changes) in WAVED_OFF
        rig = Rig(status_light_m=0.12 if red else 0.0)
        drawn_scene = Scene(rig, replace(SceneParameters(), **changes), np.random.default_rng(3))
        state = replace(state_at(rig, range_m, 3.6, height_m), waves_off=red)
        image = drawn_scene.render(state, camera, rng=np.random.default_rng(0))
        tiles.append(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
        drawn_scene.close()
    tiled(tiles, 3, out, 82)


def frigate_state(ship: ShipState, place_in_ship_m: tuple[float, float, float], t_s: float) -> SceneState:
    """The scene from a place, the camera aimed at the bar, or at midships from beside."""
    eye_m = ship.ned_from_ship.apply(np.array(place_in_ship_m))
    beside = abs(place_in_ship_m[1]) > 100.0 and place_in_ship_m[0] > -1000.0
    aim_m = ship.ned_from_ship.apply(np.array([40.0, 0.0, 0.0])) if beside else ship.ned_from_bar.translation_m
    camera, still = look_at(eye_m, aim_m), np.zeros(3)
    return SceneState(
        t_s=t_s,
        ned_from_camera=camera,
        ned_from_ship=ship.ned_from_hull,
        ned_from_deck=ship.ned_from_deck,
        ned_from_bar=ship.ned_from_bar,
        ned_from_body=Pose(np.eye(3), eye_m),
        camera_velocity_in_ned_mps=still,
        camera_rate_in_camera_rad_s=still,
    )


def frigate(out: Path = PICTURES / "full-scale.jpg", scenario_name: str = "frigate-sea5") -> None:
    """The frigate as the 25 kg drone's camera sees it on its way in."""
    scenario = load_scenario(scenario_name)
    camera, ship = Camera.from_parameters(scenario.camera), drawn_ship(scenario, 1)
    drawn_scene, tiles = Scene(scenario.rig, scenario.scene, np.random.default_rng(1)), []
    for name, place_m in PLACES.items():
        picture = drawn_scene.render(frigate_state(ship.at(30.0), place_m, 30.0), camera, rng=np.random.default_rng(2))
        tile = cv2.resize(picture, TILE_PX, interpolation=cv2.INTER_AREA)
        if name == "3 km":  # a part at the camera's own resolution
            left, top = (camera.width_px - TILE_PX[0]) // 2, (camera.height_px - TILE_PX[1]) // 2
            tile = picture[top : top + TILE_PX[1], left : left + TILE_PX[0]].copy()
        for colour, width in (((0, 0, 0), 3), ((255, 255, 255), 1)):
            cv2.putText(tile, name, (12, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.7, colour, width, cv2.LINE_AA)
        tiles.append(tile)
    drawn_scene.close()
    tiled(tiles, 2, out, 75)


def draw_ship(axes: Axes, rig: Rig, side: bool) -> None:
    """Outline of platform and superstructure around the deck's centre."""
    from matplotlib.patches import Rectangle

    aft, fore = -rig.deck_ahead_of_stern_m, rig.platform_length_m - rig.deck_ahead_of_stern_m
    face, top = rig.bar_ahead_of_stern_m - rig.deck_ahead_of_stern_m, rig.superstructure_height_m - rig.deck_height_m
    half = 0.5 * rig.platform_width_m
    if side:
        axes.add_patch(Rectangle((aft, -rig.deck_height_m), fore - aft, rig.deck_height_m, color="#777777"))
        axes.add_patch(Rectangle((face, 0.0), fore - face, top, color="#555555"))
    else:
        axes.add_patch(Rectangle((aft, -half), fore - aft, 2 * half, fill=False, edgecolor="#555555"))
        axes.add_patch(Rectangle((face, -half), fore - face, 2 * half, color="#555555"))


def airwake(out: Path = PICTURES / "airwake.png") -> None:
    """The parametric airwake, from the side and from above."""
    from shipland.figures import drawn
    from shipland.sim.wind import Airwake, WindParameters

    rig = Rig()
    wake = Airwake(WindParameters().airwake, rig, np.random.default_rng(0))
    forward = np.linspace(-6.0, 3.0, 181)
    up, starboard = np.linspace(-0.9, 2.5, 86), np.linspace(-2.5, 2.5, 101)
    with drawn(out, (12.0, 8.0), 90) as figure:
        rows = figure.subplots(3, 2, width_ratios=[1.0, 1.0])
        for column, (towards_deg, title) in enumerate(((180.0, "from ahead"), (225.0, "from 45° to port"))):
            towards = np.radians(towards_deg - 2 * 45.0 * column)
            for row, (name, side) in enumerate((("deficit", True), ("turbulence", True), ("deficit", False))):
                axes = rows[row, column]
                others = up if side else starboard
                field = [
                    [getattr(wake.place((x, 0.0, -o) if side else (x, o, -0.45), towards), name) for x in forward]
                    for o in others
                ]
                mesh = axes.pcolormesh(forward, others, field, vmin=0.0, vmax=1.2, cmap="viridis", rasterized=True)
                draw_ship(axes, rig, side)
                axes.set_aspect("equal")
                axes.grid(visible=False)
                axes.set_title(f"{title}: {name}, " + ("from the side" if side else "from above"))
                if not side:
                    axes.invert_yaxis()
                axes.set_ylabel("up [m]" if side else "starboard [m]")
            rows[2, column].set_xlabel("forward of the deck's centre [m]")
        figure.colorbar(mesh, ax=rows, shrink=0.6)


def frames(video: Path, picture: Path, *, at: tuple[float, ...] = (25.0, 56.0), quality: int = 85) -> None:
    """Frames of a video, one below the other.

    Args:
        video: of a flight.
        picture: JPEG to write.
        at: times in the video, rising [s].
        quality: of the JPEG, 1 … 100.
    """
    times, taken = list(at), []
    for t_s, image in read_video(video):
        if times and t_s >= times[0]:
            taken.append(image)
            times.pop(0)
    if times:
        raise SystemExit(f"{video} ends before {times[0]} s")
    tiled(taken, 1, picture, quality)


def chosen(video: Path, rate_hz: float, faster: float, last_s: float, end_s: float) -> Iterator[Picture]:
    """Pictures `1 / rate_hz` apart in the film: of every `faster`-th moment, of every moment near the end."""
    due_s = 0.0
    for t_s, picture in read_video(video):
        if t_s >= due_s:
            yield picture
            due_s += (1.0 if t_s >= end_s - last_s else faster) / rate_hz


def film(video: Path, out: Path, *, faster: float = 16.0, last_s: float = 12.0, width_px: int = 960) -> None:
    """A film from a flight's video: faster, smaller; the landing at its own pace.

    Args:
        video: of a flight.
        out: file to write.
        faster: than the video, before its last seconds.
        last_s: seconds at their own pace.
        width_px: even.
    """
    with av.open(str(video)) as container:
        assert container.duration is not None
        end_s = container.duration / av.time_base
    parameters = replace(VideoParameters(), rate_hz=15.0, chase_rate_hz=15.0, crf=30.0, preset="slow")
    writer = None
    for index, picture in enumerate(chosen(video, parameters.rate_hz, faster, last_s, end_s)):
        height = 2 * round(0.5 * picture.shape[0] * width_px / picture.shape[1])
        small = cv2.resize(picture, (width_px, height), interpolation=cv2.INTER_AREA)
        writer = writer or VideoWriter(out, width_px, height, parameters)
        writer.write(small, index / parameters.rate_hz)
    assert writer is not None  # `read_video` refuses an empty one
    writer.close()


def drawn(flown: FlightLog, scenario: Scenario, scene: Scene) -> Iterator[FlightRecord]:
    """The rows with the picture that their truth shows; times from the first row on."""
    ship = drawn_ship(scenario, flown.header.info.seed)
    first_s, last_s = flown.records[0].frame.t_s, -np.inf
    still = np.zeros(3)
    for row in flown.records:
        truth = row.truth
        if truth is None or truth.t_s <= last_s:
            continue
        last_s = truth.t_s
        state = SceneState(
            truth.t_s, truth.ned_from_camera, ship.at(truth.t_s).ned_from_hull, truth.ned_from_deck,
            truth.ned_from_bar, truth.ned_from_body, still, still,
        )  # fmt: skip
        image = scene.render(state, flown.header.camera)
        t_s, estimate = row.frame.t_s - first_s, row.decision.estimate
        if estimate is not None:
            estimate = replace(estimate, t_s=estimate.t_s - first_s)
        # the truth comes with its world's clock, which a vehicle outside does not know
        yield replace(
            row,
            frame=replace(row.frame, t_s=t_s, image=image),
            truth=replace(truth, t_s=t_s),
            decision=replace(row.decision, estimate=estimate),
        )


def log(flight: Path, video: Path, *, every: int = 1) -> None:
    """The video of a flight whose log keeps the truth but no pictures, as one with `--vision geometric`.

    Args:
        flight: its log.
        video: file to write.
        every: one row of so many is drawn.
    """
    found = read_log(flight)
    scenario = load_scenario(json.loads(found.header.info.configuration))
    drawn_scene = build_scene(scenario, found.header.info.seed)
    chase = chase_view(drawn_scene, found.header.camera, aircraft_scale(scenario), scenario.ship.full_ship)
    shown = FlightVideo(video, found.header.rig, found.header.camera, VideoParameters(), chase)
    for row in drawn(replace(found, records=found.records[::every]), scenario, drawn_scene):
        shown.append(row)
    shown.finish(found.verdict)
    drawn_scene.close()


if __name__ == "__main__":
    commands = (scene, frigate, airwake, tyro.conf.configure(tyro.conf.PositionalRequiredArgs)(frames),
                tyro.conf.configure(tyro.conf.PositionalRequiredArgs)(film),
                tyro.conf.configure(tyro.conf.PositionalRequiredArgs)(log))  # fmt: skip
    tyro.extras.subcommand_cli_from_dict({command.__name__: command for command in commands}, description=__doc__)
