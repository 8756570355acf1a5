"""The command line. Heavy imports come after the arguments are read, so that `--help` answers at once."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from shipland import __version__
from shipland.errors import DataError, ShiplandError
from shipland.learning.arguments import EvaluateArguments, SynthArguments, TrainArguments

Changes = Annotated[tuple[str, ...], tyro.conf.arg(name="set", metavar="KEY=VALUE"), tyro.conf.UseAppendAction]


@dataclass(frozen=True)
class Fly:
    """Fly one landing in the simulator and judge the touchdown.

    Leaves flight.mcap (opens in Foxglove), flight.mp4, plots.png and summary.json in the output folder.
    Exit code: 0 landed in the square, 1 not, 2 bad input.

    Example: shipland fly --scenario near --seed 7 --out out/seven
    """

    scenario: str = "near"
    """Packaged scenario, or the path of a TOML file laid over the defaults (see `shipland scenarios`)."""
    pilot: str = "paper"
    """Who flies: `paper` is the published system, `offset_free` ours; your own as `module:factory`."""
    vision: str = "rendered"
    """`rendered`: vision on drawn pictures; `geometric`: true corners with vision's errors, at a fraction of the
    cost; your own as `module:factory`."""
    seed: int = 1
    """Seed of everything random; the same seed gives the same flight."""
    out: Path = Path("out/flight")
    """Output folder; made when missing."""
    config: Path | None = None
    """TOML file laid over the scenario, any section of the configuration."""
    changes: Changes = ()
    """One value laid over all, as `--set wind.mean_mps=5`; may be given again and again."""
    video: bool = True
    """Write flight.mp4 (costs a second picture a frame, for the chase view)."""

    def run(self) -> int:
        """Fly; the exit code."""
        from shipland.commands.fly import FlyRequest, fly_one

        return fly_one(FlyRequest(**vars(self)))


@dataclass(frozen=True)
class Campaign:
    """Fly many seeds of one scenario and sum them up; what was flown before is kept and not flown again.

    Leaves landings.csv, table.md and landings.png in the output folder.

    Example: shipland campaign --scenario near --count 20 --out out/near20
    """

    scenario: str = "near"
    """Packaged scenario, or the path of a TOML file laid over the defaults."""
    pilot: str = "paper"
    """Who flies, as in `shipland fly`."""
    vision: str = "geometric"
    """As in `shipland fly`."""
    first_seed: int = 1
    """First seed."""
    count: int = 20
    """Number of landings."""
    out: Path = Path("out/campaign")
    """Output folder; made when missing."""
    config: Path | None = None
    """TOML file laid over the scenario."""
    changes: Changes = ()
    """One value laid over all, as `--set wind.mean_mps=5`; may be given again and again."""
    workers: int = 2
    """Processes."""
    logs: bool = False
    """Keep each flight's log, without pictures, as flights/SEED.mcap: `shipland paper --flights` draws from them."""

    def run(self) -> int:
        """Fly; 0 when all landed in the square, 1 when not."""
        from shipland.commands.campaign import campaign
        from shipland.missions.campaign import CampaignRequest

        return campaign(
            CampaignRequest(
                self.scenario,
                self.pilot,
                self.vision,
                self.first_seed,
                self.count,
                self.out,
                self.config,
                self.workers,
                self.logs,
                self.changes,
            )
        )


@dataclass(frozen=True)
class Paper:
    """Make the figures of the paper's controllers, each with its table: "The paper, reproduced" in the documentation.

    Leaves a picture a figure and table.md in the output folder. With --flights, draws recorded flights instead:
    trajectories.png, commands.png (of the flight from farthest away) and landings.png.

    Example: shipland paper --only far-steps --out out/paper
    """

    out: Path = Path("out/paper")
    """Output folder; made when missing."""
    only: Literal["roll-law", "far-steps", "far-readings", "derivative-gain", "near-false"] | None = None
    """One figure instead of all."""
    flights: Path | None = None
    """Folder with logs of simulated flights, of `shipland fly` or `shipland campaign --logs`."""

    def run(self) -> int:
        """Make them."""
        from shipland.reproduce.paper import PaperRequest, run_paper

        return run_paper(PaperRequest(self.out, self.only, self.flights))


@dataclass(frozen=True)
class Motion:
    """Show a motion of the deck and the wind over it: figure, CSV and a table of amplitudes and periods.

    Options left out keep what the configuration says. The CSV can be flown again as a recorded motion.

    Example: shipland motion --motion sea --sea-state 6 --waves-from-deg 120 --out out/motion
    """

    out: Path = Path("out/motion")
    """Output folder; made when missing."""
    config: Path | None = None
    """TOML file laid over the defaults; sections [rig], [ship] and [wind] are used."""
    scenario: str | None = None
    """Packaged scenario laid over the defaults, before --config."""
    motion: Literal["still", "natops", "sinusoids", "sea", "recorded"] | None = None
    """Kind of motion."""
    sea_state: int | None = None
    """3 to 6."""
    significant_height_m: float | None = None
    """Instead of the sea state's."""
    modal_period_s: float | None = None
    """Instead of the sea state's."""
    waves_from_deg: float | None = None
    """Bearing off the bow that the waves come from: 60 is off the bow, 120 is 60° off the stern."""
    speed_kn: float | None = None
    """Ship's speed at full scale."""
    time_rule: Literal["froude", "length_only"] | None = None
    """How time scales with length."""
    recorded: Path | None = None
    """CSV with the header t_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg."""
    course: Literal["still", "straight", "s", "turn", "turn90", "random"] | None = None
    """Course of the platform."""
    course_speed_mps: float | None = None
    """Its speed, 0 to 4.5 m/s."""
    wind_mps: float | None = None
    """Mean wind."""
    wind_from_deg: float | None = None
    """Compass direction it comes from."""
    duration_s: float = 120.0
    """Length of the CSV and of the figure."""
    statistics_s: float = 1800.0
    """Length of the record behind the table."""
    step_s: float = 0.05
    """Time step of CSV and figure."""
    seed: int = 1
    """Seed of everything random."""
    headings: bool = False
    """Instead of one case: waves 60° off the bow and off the stern, at both time rules (the documentation's figure)."""

    def run(self) -> int:
        """Make them."""
        from shipland.commands.motion_figure import MotionRequest, run_motion

        return run_motion(MotionRequest(**vars(self)))


@dataclass(frozen=True)
class See:
    """Find the cue in pictures or a video with the same near vision that flies.

    One JSON line a picture: file, found, reason, distance_m, position_in_bar_m, yaw_deg, reprojection_px, corners_px.

    Example: shipland see photo.jpg --target bar.toml --camera calibration.yaml --json
    """

    paths: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Pictures and videos."""
    target: Path | None = None
    """TOML with one [[quad]] a quadrilateral, corners_m = [[right, down], …] in metres from the cue's origin, in the
    order top-left, top-right, bottom-right, bottom-left. Default: the rig's bar."""
    camera: Path | None = None
    """OpenCV calibration YAML. Default: the rig's camera."""
    json: bool = False
    """JSON lines instead of a table for people."""

    def run(self) -> int:
        """Look at every picture and say what is in it."""
        from shipland.commands.see_files import SeeRequest, see_paths

        for result in see_paths(SeeRequest(self.paths, self.target, self.camera)):
            print(json.dumps(result.to_json()) if self.json else result.to_line(), flush=True)
        return 0


@dataclass(frozen=True)
class Detect:
    """Look for the ship or the bar with a learned detector in pictures and videos.

    One JSON line a picture: file, boxes: [{x, y, w, h, confidence}] in pixels, x and y the left and top edge.

    Example: shipland detect harbour.jpg film.mp4 --kind ship --json --out out/drawn
    """

    paths: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Pictures, folders of pictures, videos."""
    kind: Literal["ship", "bar"] = "ship"
    """What to look for, with the packaged weights."""
    weights: Path | None = None
    """Another detector's ONNX file."""
    confidence: float | None = None
    """Least confidence of a box."""
    json: bool = False
    """JSON lines instead of lines for people."""
    out: Path | None = None
    """Folder for the pictures and videos with boxes drawn."""
    config: Path | None = None
    """TOML laid over the detector's settings."""

    def run(self) -> int:
        """Look at every picture and say what is in it."""
        from shipland.commands.detect_files import DetectRequest, detect_paths

        request = DetectRequest(self.paths, self.kind, self.weights, self.confidence, self.out, config=self.config)
        for result in detect_paths(request):
            print(json.dumps(result.to_json()) if self.json else result.to_line(), flush=True)
        return 0


@dataclass(frozen=True)
class Synth(SynthArguments):
    """Make labelled pictures from the simulator's scene, in YOLO's layout; goes on where it was cut off.

    Example: shipland synth --out out/ship --kind ship --count 5000 --crop-px 352
    """

    def run(self) -> int:
        """Make them."""
        from shipland.learning.synth import synth

        print(synth(self))
        return 0


@dataclass(frozen=True)
class Train(TrainArguments):
    """Train a detector on labelled pictures in YOLO's layout (needs the extra `train`).

    Example: shipland train --data out/ship --out out/run
    """

    def run(self) -> int:
        """Train, evaluate, export."""
        try:
            from shipland.learning.train import train
        except ModuleNotFoundError as error:
            raise DataError(f"training needs {error.name}; install it with: pip install 'shipland[train]'") from None
        print(train(self))
        return 0


@dataclass(frozen=True)
class Evaluate(EvaluateArguments):
    """Measure a detector on a labelled set, or on fresh scenes of the simulator over range.

    Example: shipland evaluate --weights ship --kind ship --scenes 2000 --out out/evaluate
    """

    def run(self) -> int:
        """Measure and print the tables."""
        from shipland.learning.evaluate import evaluate

        print(evaluate(self).text())
        return 0


@dataclass(frozen=True)
class Calibrate:
    """Calibrate a camera from pictures of a chessboard or ChArUco board.

    Writes an OpenCV calibration file for `shipland see --camera`, and beside it a picture of where the corners lay.

    Example: shipland calibrate board/ --board 9x6 --square-m 0.025 --out camera.yaml
    """

    paths: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Pictures, or folders of pictures; a dozen or more, the board tilted and in every part of the picture."""
    board: str = "9x6"
    """Inner corners across x down."""
    square_m: float = 0.025
    """Side of a square; only the board's distance depends on it."""
    charuco: bool = False
    """The board carries ArUco markers."""
    marker_m: float | None = None
    """Side of a marker; three quarters of a square when left out."""
    dictionary: str = "DICT_4X4_50"
    """OpenCV's name of the markers' dictionary."""
    out: Path = Path("calibration.yaml")
    """Calibration file."""

    def run(self) -> int:
        """Calibrate and print the table."""
        from shipland.commands.calibrate_camera import CalibrateRequest, calibrate

        print(calibrate(CalibrateRequest(**vars(self))).to_text())
        return 0


@dataclass(frozen=True)
class Scenarios:
    """List the packaged scenarios."""

    def run(self) -> int:
        """Print a line each."""
        from shipland.config import packaged_names, packaged_toml

        for name in packaged_names("scenarios"):
            print(f"{name:16s} {packaged_toml(f'scenarios/{name}').get('description', '')}")
        return 0


@dataclass(frozen=True)
class Version:
    """Print the version."""

    def run(self) -> int:
        """Print it."""
        print(__version__)
        return 0


Command = (
    Annotated[Fly, tyro.conf.subcommand("fly")]
    | Annotated[Campaign, tyro.conf.subcommand("campaign")]
    | Annotated[Paper, tyro.conf.subcommand("paper")]
    | Annotated[Motion, tyro.conf.subcommand("motion")]
    | Annotated[See, tyro.conf.subcommand("see")]
    | Annotated[Detect, tyro.conf.subcommand("detect")]
    | Annotated[Synth, tyro.conf.subcommand("synth")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Calibrate, tyro.conf.subcommand("calibrate")]
    | Annotated[Scenarios, tyro.conf.subcommand("scenarios")]
    | Annotated[Version, tyro.conf.subcommand("version")]
)


_AnyCommand = (
    Fly | Campaign | Paper | Motion | See | Detect | Synth | Train | Evaluate | Calibrate | Scenarios | Version
)


def main() -> None:
    """Entry point: one line for every error of ours, exit 2; Ctrl-C leaves what was done in order, exit 130."""
    command: (
        Fly | Campaign | Paper | Motion | See | Detect | Synth | Train | Evaluate | Calibrate | Scenarios | Version
    ) = tyro.cli(
        Command,
        prog="shipland",
        description="Lands a camera-carrying VTOL drone on a ship: no GPS, no link to the ship.",
    )
    try:
        code = command.run()
    except ShiplandError as error:
        print(f"shipland: {' '.join(str(error).split())}", file=sys.stderr)
        code = 2
    except KeyboardInterrupt:
        print("shipland: interrupted; what was written is complete", file=sys.stderr)
        code = 130
    except BrokenPipeError:
        code = 1
    raise SystemExit(code)


if __name__ == "__main__":
    main()
