"""Hostile files: pictures, configurations, logs, networks and calibrations.

What is read is either good, or refused with an error of the project's own, which the command line prints as one line.
"""

from __future__ import annotations

import functools
import json
import math
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, fields
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.writer import CompressionType, Writer

import shipland
from shipland.calibration_file import read_calibration, write_calibration
from shipland.camera import Camera
from shipland.config import build, defaults
from shipland.errors import ShiplandError
from shipland.evaluation.replays import recorded_flight, replay
from shipland.files import DIGESTS
from shipland.frames import CAMERA_FROM_MOUNT, Pose, rotation_from_euler
from shipland.guidance.horizon.learned import LearnedSteering
from shipland.guidance.horizon.steering import Steered
from shipland.guidance.response import ANAFI_LIKE
from shipland.mcap_records import mcap_records
from shipland.messages import Frame, GimbalAttitude
from shipland.record.reader import read_log
from shipland.scenario.fly import flight_log, fly_quietly
from shipland.scenario.scenario import load_scenario, scenario_table
from shipland.vehicles.address import vehicle_table
from shipland.vehicles.anafi.setup import AnafiParameters
from shipland.vehicles.checks import PreflightParameters
from shipland.vehicles.mavlink.parameters import MavlinkParameters
from shipland.vehicles.touchdown import TouchdownParameters
from shipland.vision.far.layouts import load_reader
from shipland.vision.log_pictures import read_pictures
from shipland.vision.near.deck import DeckVision
from shipland.vision.near.pipeline import NearVision

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the studies stand beside the package
from studies.spoiling import SPOILERS, vary

WEIGHTS = Path(shipland.__file__).parent / "weights"


def damaged(whole: bytes, rng: np.random.Generator) -> bytes:
    """Bits turned, bytes cut off, a length in the middle of it, a part twice."""
    data = bytearray(whole)
    for _ in range(int(rng.integers(1, 5))):
        at, how = int(rng.integers(len(data) + 1)), rng.random()
        if how < 0.5 and at < len(data):
            data[at] ^= 1 << int(rng.integers(8))
        elif how < 0.7:
            size = int(rng.choice([1, 2, 4, 8]))
            value = int(rng.choice([0, 2**31, 2**40, 2**62, 2**63 - 1])) if size == 8 else int(rng.integers(256))
            data[at : at + size] = value.to_bytes(size, "little")
        elif how < 0.85:
            data[at:at] = data[: int(rng.integers(200))]
        else:
            del data[at : at + int(rng.integers(1, 200))]
    return bytes(data)


# Pictures


@functools.cache
def eyes() -> tuple[NearVision, DeckVision, Any]:
    """The visions that look at pictures, and what they look for."""
    chosen = load_scenario("near")
    camera = Camera.from_parameters(chosen.camera)
    near = NearVision(chosen.rig.cue, camera, chosen.vision)
    return near, DeckVision(chosen.rig, camera, chosen.vision.deck), chosen


def drawn(rng: np.random.Generator) -> np.ndarray:
    """The cue from a random place, over noise or a plain sea; or only these."""
    _, _, chosen = eyes()
    camera = Camera.from_parameters(chosen.camera)
    size = camera.height_px, camera.width_px
    picture = rng.integers(0, 256, (*size, 3), np.uint8) if rng.random() < 0.2 else np.full((*size, 3), 120, np.uint8)
    if rng.random() < 0.1:
        return picture
    turn = rotation_from_euler(*rng.normal(0.0, [0.1, 0.2, 0.4])) @ CAMERA_FROM_MOUNT.T
    place_m = [-float(np.exp(rng.uniform(-1.5, 4.0))), *rng.normal(0.0, 1.0, 2)]
    corners_px = camera.project(Pose(turn, np.array(place_m)).inverse().apply(chosen.rig.cue.points_in_bar_m))
    for quad in corners_px.reshape(-1, 4, 2):
        if np.isfinite(quad).all() and np.abs(quad).max() < 1e4:
            cv2.fillPoly(picture, [np.round(quad * 16).astype(np.int32)], (60, 220, 60), cv2.LINE_AA, 4)
    return picture


def pictures(rng: np.random.Generator) -> None:
    """A short film of the cue, spoiled and varied: no picture raises, a pose is finite and in reach."""
    near, below, chosen = eyes()
    near.reset()
    for number in range(3):
        picture = drawn(rng)
        for name in rng.permutation(list(SPOILERS))[: rng.integers(3)]:
            picture = SPOILERS[str(name)](picture, rng)
        if rng.random() < 0.3:
            picture = vary(picture, rng)
        if rng.random() < 0.1:
            picture = picture[: rng.integers(1, 800), : rng.integers(1, 1400)]
        if rng.random() < 0.05:
            picture = np.asfortranarray(picture)[::-1]
        gimbal = GimbalAttitude(float(rng.choice([0.0, 0.0, 0.0, 1.0, -1.6])), float(rng.normal(0.0, 0.2)))
        frame = Frame(float(rng.choice([0.04 * number, 0.0, 7.0, math.nan])), picture, gimbal)
        pose = near.see(frame).bar_pose
        below.see(frame)
        if pose is not None:
            assert np.isfinite([*pose.position_in_bar_m, pose.yaw_rad, *pose.covariance.ravel()]).all(), pose
            assert np.linalg.norm(pose.position_in_bar_m) <= chosen.vision.max_distance_m + 1.0, pose
            assert np.linalg.eigvalsh(pose.covariance).min() >= -1e-12, pose


# Configurations

VALUES = (
    "0", "-1", "1", "1e300", "-1e300", "inf", "nan", "1e-300", "true", "''", "'x'", "[]", "{}", "[1, 2]", "[[1], 2]",
    "{a = 1}", "9" * 30, "9" * 5000, "0x" + "f" * 5000, "[" * 200 + "]" * 200, "1979-05-27", "'\\u0000'", "0.5", "2",
)  # fmt: skip
SECTIONS = {
    "mavlink": MavlinkParameters,
    "anafi": AnafiParameters,
    "touchdown": TouchdownParameters,
    "preflight": PreflightParameters,
}


def keys(table: dict[str, Any], before: str = "") -> Iterator[str]:
    """Dotted names of everything in a table, sections included."""
    for key, value in table.items():
        yield f"{before}{key}"
        if isinstance(value, dict):
            yield from keys(value, f"{before}{key}.")


@functools.cache
def known(name: str) -> tuple[str, ...]:
    """Keys of a packaged table."""
    own = {section: defaults(cls) for section, cls in SECTIONS.items()}
    return tuple(keys(own if name == "vehicles" else scenario_table(name)))


def configurations(rng: np.random.Generator) -> None:
    """Random `--set` and files of a flight and of a vehicle: taken as they are, or refused."""
    value = str(rng.choice(VALUES)) if rng.random() < 0.7 else repr(float(10.0 ** rng.uniform(-6, 9)))
    changes = [f"{rng.choice(known('near'))}={value}" for _ in range(rng.integers(1, 4))]
    path = Path("own.toml")
    if rng.random() < 0.5:
        lines = [f"{rng.choice(known('near'))} = {value}" for _ in range(3)]
        path.write_bytes(damaged("\n".join(lines).encode(), rng) if rng.random() < 0.5 else "\n".join(lines).encode())
    with suppress(ShiplandError):
        chosen = load_scenario(scenario_table("near", path if path.exists() else None, changes))
        assert load_scenario(json.loads(json.dumps(chosen.table()))) == chosen, changes
    path.write_text(f"{rng.choice(known('vehicles'))} = {value}\n")
    with suppress(ShiplandError):
        table = vehicle_table(path)
        for section, cls in SECTIONS.items():
            for each in asdict(build(cls, table[section], section)).values():
                assert not isinstance(each, float) or abs(each) <= 1e4, (section, each)


# Logs


@functools.cache
def whole_log() -> bytes:
    """A second of a flight, its first rows with pictures."""
    chosen, records = load_scenario("rig-natops", time_limit_s=1.0), []
    fly_quietly(chosen, "paper", "geometric", 1, records.append)
    with flight_log(Path("whole.mcap"), chosen, "paper", "geometric", 1) as log:
        for record in records:
            log.append(record)
        log.finish(None)
    return Path("whole.mcap").read_bytes()


def rewritten(rng: np.random.Generator) -> bytes:
    """The log with values of some rows replaced, uncompressed."""
    Path("whole.mcap").write_bytes(whole_log())
    topics: dict[int, str] = {}
    values = (
        None,
        "",
        "x",
        [],
        {},
        True,
        -1,
        1e300,
        10**400,
        [[1]],
        math.nan,
        "[" * 9999,
        "NaN",
        0,
        [None] * 3,
        '{"a":1}',
    )
    with Path("rewritten.mcap").open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start()
        for item in mcap_records(Path("whole.mcap")):
            if type(item).__name__ == "Channel":
                topics[item.id] = item.topic
            elif type(item).__name__ == "Message" and topics[item.channel_id] in ("/flight", "/header", "/verdict"):
                row = json.loads(item.data)
                for key in rng.permutation(list(row))[: rng.choice([0, 0, 0, 1, 2])]:
                    row[str(key)] = values[rng.integers(len(values))]
                channel = writer.register_channel(topics[item.channel_id], "json", 0)
                stamp_ns = item.log_time if rng.random() < 0.95 else int(rng.integers(2**63))
                writer.add_message(channel, stamp_ns, json.dumps(row).encode(), stamp_ns)
        writer.finish()
    return Path("rewritten.mcap").read_bytes()


def logs(rng: np.random.Generator) -> None:
    """A damaged log: read to where it is whole, replayed if it can be, or refused."""
    path = Path("flight.mcap")
    path.write_bytes(rewritten(rng) if rng.random() < 0.5 else damaged(whole_log(), rng))
    with suppress(ShiplandError):
        read_log(path)
    with suppress(ShiplandError):
        for _ in islice(read_pictures(path), 10):
            pass
    with suppress(ShiplandError):
        replay(recorded_flight(path))


# Networks


def networks(rng: np.random.Generator) -> None:
    """Bits turned in shipped networks: refused by their digest; without one they are refused or harmless."""
    sources = sorted(WEIGHTS.glob("policies/*.onnx")) if rng.random() < 0.9 else sorted(WEIGHTS.glob("*.onnx"))
    source = sources[rng.integers(len(sources))]
    policy = source.parent.name == "policies"
    load: Callable[[Path], Any] = load_reader
    if policy:
        kind = "direct" if source.stem == "direct" else "residual"
        load = lambda path: LearnedSteering(str(path), kind, ANAFI_LIKE)  # noqa: E731
    path, data = Path(source.name), bytearray(source.read_bytes())
    for _ in range(int(rng.integers(1, 4))):
        data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)
    shutil.copy(source.parent / DIGESTS, DIGESTS)
    if bytes(data) != source.read_bytes():
        try:
            load(path)
        except ShiplandError as error:
            assert "is damaged" in str(error), error
        else:
            raise AssertionError(f"{source.name} was taken with bits turned")
    Path(DIGESTS).unlink()
    with suppress(ShiplandError):
        network = load(path)
        if policy:
            flown_by(network, rng)
        else:
            network.candidates(rng.integers(0, 256, (64, 96, 3), np.uint8), 0.05)


def flown_by(policy: LearnedSteering, rng: np.random.Generator) -> None:
    """A policy's input is finite and bounded, whatever its numbers."""
    seen = {"height_m": 0.4, "sink_mps": 0.3, "contact_s": 0.9, "landing": True, "in_final_descent": False}
    pairs = {each.name: rng.normal(0.0, 1.0, 2) for each in fields(Steered) if each.name not in seen}
    found = policy.input_mps2(Steered(**pairs, **seen))
    assert np.isfinite(found).all(), found
    assert np.abs(found).max() < 30.0, found


# Calibrations


def calibrations(rng: np.random.Generator) -> None:
    """A damaged calibration: refused, or a camera that projects; with its digest, the same camera."""
    matrix = np.array([[900.0, 0.0, 640.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]]) + np.diag([*rng.normal(0, 9, 2), 0])
    camera = Camera(1280, 720, matrix, rng.normal(0.0, 0.1, 5), float(rng.choice([0.0, 1e-5])))
    path = Path(f"camera.{rng.choice(['yaml', 'xml', 'json'])}")
    write_calibration(camera, path)
    data = bytearray(path.read_bytes())
    data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)
    with suppress(ShiplandError):
        assert read_calibration(path).digest == camera.digest
    lines = [line for line in bytes(data).splitlines() if b"digest" not in line]
    path.write_bytes(damaged(b"\n".join(lines), rng))
    with suppress(ShiplandError):
        other = read_calibration(path)
        assert other.project(np.array([[0.1, 0.1, 3.0]])).shape == (1, 2)
        assert other.back_project(np.array([[10.0, 20.0]])).shape == (1, 3)
