"""Flights in the layout of LeRobot's data sets, version 3.0: what `LeRobotDataset` of lerobot 0.6 reads.

A flight is an episode. `observation.state` and `action` are the flat observation and the action of
`shipland/Landing-v0`: a policy that imitates the pilot flies there. Where every log keeps pictures, a row is a cycle
with a picture, and there is a film of them; else every cycle is a row. LeRobot wants rows at a steady rate, here that
of most cycles: the one nearest to each tick is taken, with all that belongs to it; `exposure_s` is its own time.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shipland.errors import DataError
from shipland.extras import require
from shipland.files import json_bytes, replacing, write_atomically
from shipland.record.observations import Observer, flat_names
from shipland.record.reader import read_log
from shipland.report.palette import STICKS
from shipland.report.posed_pictures import pictures_of
from shipland.report.video import VideoParameters, VideoWriter

_FILM = "observation.images.camera"
_PATH = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_FIRST = _PATH.format(chunk_index=0, file_index=0)
_KEY_FRAMES = 2
"""A film is read at random: every other picture stands for itself."""
_EVERY_PICTURE, _EVERY_PIXEL = 10, 8
"""What the pictures' statistics are of."""
_PICTURES_KEPT = 4
"""Of each flight, for the statistics of all: a thousand flights with pictures fit in memory."""
_LONGEST_S = 36_000.0
"""A log that spans more has a row with a wrong time."""
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}

Columns = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class _Flight:
    """One log's cycles, n of them.

    Attributes:
        t_s, state, action: (n,) exposure times, (n,48) flat observations, (n,4) sticks sent, -1 … 1.
        pictured: the cycle of each picture in the log.
        shape: of a picture, with even sides as H.264 wants them; zeros without one.
    """

    name: str
    path: Path
    task: str
    success: bool
    t_s: npt.NDArray[np.float64]
    state: npt.NDArray[np.float32]
    action: npt.NDArray[np.float32]
    pictured: list[int]
    shape: tuple[int, int, int]


def write_lerobot(logs: Mapping[str, Path], root: Path) -> None:
    """Write logs, by their names, into a folder that must not be there yet.

    DataError where it is, no log has two exposures, one spans ten hours, or pictures differ in size;
    SystemLibraryError without an extra.
    """
    require("dataset", "LeRobot's layout")
    if root.exists():
        raise DataError(f"{root} is there already: name another --out, or remove it")
    flights = [flight for name, path in logs.items() if len(set((flight := _read(name, path)).t_s)) > 1]
    if not flights:
        raise DataError("LeRobot's layout wants a log with two pictures' times at least, and there is none")
    filmed = all(len(flight.pictured) > 1 for flight in flights)
    if filmed:
        require("film", "LeRobot's layout of flights with pictures")
        if odd := next((flight for flight in flights if flight.shape != flights[0].shape), None):
            raise DataError(f"pictures of {odd.path} are of another size than {flights[0].path}'s: give those of one")
    taken = [np.array(it.pictured if filmed else range(len(it.t_s))) for it in flights]
    steps_s = np.concatenate([np.diff(flight.t_s[cycles]) for flight, cycles in zip(flights, taken, strict=True)])
    steps_s = steps_s[steps_s > 0.0]  # a cycle of telemetry alone repeats an exposure
    fps = max(1, round(1.0 / float(np.mean(steps_s[steps_s < 1.5 * np.median(steps_s)]))))
    with replacing(root) as beside:
        _write_flights(beside, flights, taken, fps, filmed=filmed)


def _write_flights(
    root: Path, flights: Sequence[_Flight], taken: Sequence[npt.NDArray[np.int64]], fps: int, *, filmed: bool
) -> None:
    """Write of the cycles taken of each flight those nearest to the ticks."""
    tasks = sorted({flight.task for flight in flights})
    episodes: list[dict[str, Any]] = []
    columns: list[Columns] = []
    for number, (flight, cycles) in enumerate(zip(flights, taken, strict=True)):
        t_s = flight.t_s[cycles]
        ticks_s = t_s[0] + np.arange(round((t_s[-1] - t_s[0]) * fps) + 1) / fps
        nearest = np.searchsorted(0.5 * (t_s[1:] + t_s[:-1]), ticks_s)
        start = sum(episode["length"] for episode in episodes)
        numbers = {"episode_index": number, "task_index": tasks.index(flight.task)}
        columns.append(_columns(flight, cycles[nearest], start, numbers, fps))
        if filmed:
            path = root / f"videos/{_FILM}/chunk-000/file-{number:03d}.mp4"
            columns[-1][_FILM] = _write_film(path, flight, nearest, fps)
        episodes.append(_episode(flight, number, start, columns[-1], fps))
        if filmed:
            every = -(-len(columns[-1][_FILM]) // _PICTURES_KEPT)
            columns[-1][_FILM] = columns[-1][_FILM][::every].copy()
    _write_tables(root, columns, tasks, episodes)
    whole = {name: np.concatenate([each[name] for each in columns]) for name in columns[0]}
    write_atomically(root / "meta/stats.json", json_bytes({name: _stats(values) for name, values in whole.items()}))
    info = {
        "codebase_version": "v3.0",
        "robot_type": "multirotor",
        "total_episodes": len(episodes),
        "total_frames": episodes[-1]["dataset_to_index"],
        "total_tasks": len(tasks),
        "fps": fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "data_path": f"data/{_PATH}.parquet",
        "video_path": f"videos/{{video_key}}/{_PATH}.mp4" if filmed else None,
        "features": {name: _feature(name, values, flights[0].shape, fps) for name, values in whole.items()},
    }
    write_atomically(root / "meta/info.json", json_bytes(info))


def _read(name: str, path: Path) -> _Flight:
    log = read_log(path)
    observer, sent = Observer(log.header.camera), None
    state, sticks = [], []
    for record in log.records:
        state.append(np.concatenate([*observer.take(record.observation, record.telemetry, sent).values()]))
        sent = record.decision.command
        sticks.append([0.01 * percent for percent in sent.sticks_percent])
    t_s = np.array([record.frame.t_s for record in log.records], float)
    if len(t_s) and (span_s := float(np.ptp(t_s))) > _LONGEST_S:
        raise DataError(f"{path} spans {span_s:g} s, expected at most {_LONGEST_S:g} s: a row of it has a wrong time")
    pictured, shape = [], (0, 0, 3)
    for cycle, image in pictures_of(path, t_s):
        pictured.append(cycle)
        shape = (image.shape[0] // 2 * 2, image.shape[1] // 2 * 2, 3)
    return _Flight(
        name, path, f"land on the ship: {log.header.info.scenario}", log.verdict is not None and log.verdict.success,
        t_s, np.array(state, np.float32), np.array(sticks, np.float32), pictured, shape,
    )  # fmt: skip


def _columns(
    flight: _Flight, cycles: npt.NDArray[np.int64], start: int, numbers: Mapping[str, int], fps: int
) -> Columns:
    """An episode's rows: the features of these cycles."""
    ticks = np.arange(len(cycles))
    last = ticks == len(ticks) - 1
    return {
        "observation.state": flight.state[cycles],
        "action": flight.action[cycles],
        "exposure_s": flight.t_s[cycles],
        "next.done": last,
        "next.success": last & flight.success,
        "timestamp": (ticks / fps).astype(np.float32),
        "frame_index": ticks,
        "index": start + ticks,
        **{name: np.full(len(ticks), number) for name, number in numbers.items()},
    }


def _write_film(path: Path, flight: _Flight, nearest: npt.NDArray[np.int64], fps: int) -> npt.NDArray[np.uint8]:
    """The pictures at their ticks; some of them (m,h,w,3) RGB, thinned out."""
    height_px, width_px, _ = flight.shape
    parameters = VideoParameters(rate_hz=fps, chase_rate_hz=fps, crf=20.0, preset="medium", tune="film")
    writer, tick, thinned = VideoWriter(path, width_px, height_px, parameters, _KEY_FRAMES), 0, []
    try:
        for number, (_, image) in enumerate(pictures_of(flight.path, flight.t_s)):
            while tick < len(nearest) and nearest[tick] == number:
                writer.write(np.ascontiguousarray(image[:height_px, :width_px]), tick / fps)
                if tick % _EVERY_PICTURE == 0:
                    thinned.append(image[:height_px:_EVERY_PIXEL, :width_px:_EVERY_PIXEL, ::-1])
                tick += 1
    finally:
        writer.close()
    return np.stack(thinned)


def _episode(flight: _Flight, number: int, start: int, columns: Columns, fps: int) -> dict[str, Any]:
    """A row of meta/episodes; `flight` and `success` are ours, for LeRobot's filter of episodes."""
    length = len(columns["index"])
    episode = {
        "episode_index": number,
        "tasks": [flight.task],
        "length": length,
        "flight": flight.name,
        "success": flight.success,
        **{f"{table}/{of}_index": 0 for table in ("data", "meta/episodes") for of in ("chunk", "file")},
        "dataset_from_index": start,
        "dataset_to_index": start + length,
    }
    if _FILM in columns:
        film = {"chunk_index": 0, "file_index": number, "from_timestamp": 0.0, "to_timestamp": length / fps}
        episode |= {f"videos/{_FILM}/{word}": value for word, value in film.items()}
    stats = {name: _stats(values) for name, values in columns.items()}
    return episode | {f"stats/{name}/{word}": value for name, each in stats.items() for word, value in each.items()}


def _stats(values: npt.NDArray[Any]) -> dict[str, list[Any]]:
    """Of each column of (n,) or (n,k); of each colour of pictures (n,h,w,3), as (3,1,1) in shares of the brightest."""
    pictures = values.ndim == 4
    table = values.reshape(-1, 3) / 255.0 if pictures else values.reshape(len(values), -1).astype(float)
    found = {"min": table.min(0), "max": table.max(0), "mean": table.mean(0), "std": table.std(0)}
    found |= dict(zip(_QUANTILES, np.quantile(table, list(_QUANTILES.values()), axis=0), strict=True))
    shape = (3, 1, 1) if pictures else (-1,)
    return {word: it.reshape(shape).tolist() for word, it in found.items()} | {"count": [len(values)]}


def _feature(name: str, values: npt.NDArray[Any], shape: tuple[int, int, int], fps: int) -> dict[str, Any]:
    """As info.json describes it."""
    if name == _FILM:
        info = {"codec": "h264", "pix_fmt": "yuv420p", "height": shape[0], "width": shape[1], "channels": 3, "fps": fps}
        about = {f"video.{word}": value for word, value in info.items()} | {"has_audio": False, "is_depth_map": False}
        return {"dtype": "video", "shape": shape, "names": ["height", "width", "channels"], "info": about}
    names = {"observation.state": flat_names(), "action": list(STICKS)}.get(name)
    return {"dtype": str(values.dtype), "shape": [len(names) if names else 1], "names": names}


def _write_tables(
    root: Path, columns: Sequence[Columns], tasks: Sequence[str], episodes: Sequence[Mapping[str, Any]]
) -> None:
    """Rows, with a row group for each episode; episodes; tasks, which pandas is to take as the index."""
    import pyarrow as pa
    from pyarrow import parquet

    def array(values: npt.NDArray[Any]) -> Any:  # noqa: ANN401 - pyarrow's
        return values if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(values.ravel(), values.shape[1])

    for folder in ("data/chunk-000", "meta/episodes/chunk-000"):
        (root / folder).mkdir(parents=True)
    tables = [pa.table({name: array(values) for name, values in each.items() if name != _FILM}) for each in columns]
    with parquet.ParquetWriter(root / f"data/{_FIRST}.parquet", tables[0].schema) as writer:
        for table in tables:
            writer.write_table(table)
    parquet.write_table(pa.Table.from_pylist(list(episodes)), root / f"meta/episodes/{_FIRST}.parquet")
    index = {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    about = {"index_columns": ["task"], "column_indexes": [], "columns": [index]}
    table = pa.table({"task_index": list(range(len(tasks))), "task": list(tasks)})
    parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(about)}), root / "meta/tasks.parquet")
