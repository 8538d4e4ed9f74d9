"""A session as a LeRobotDataset of codebase version 3.0: one episode of what was felt, done, seen and concluded.

Written without ``lerobot``; the form is that of its dataset guide (Parquet tables, MP4 videos, JSON).
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from drivers.core.contacts import Array
from drivers.core.errors import SessionError
from drivers.core.installed.extras import LazyPackage, require_package
from tactile_lab.viewers.lerobot.features import ACTION, STATE, Feature, features_of
from tactile_lab.viewers.lerobot.sampling import PHASES, SampledSession
from tactile_lab.viewers.lerobot.statistics import Statistics, statistics_of
from tactile_lab.viewers.lerobot.video import VideoFile

if TYPE_CHECKING:
    import pyarrow
else:
    pyarrow = LazyPackage("pyarrow")

VERSION = "v3.0"
RATE_Hz = 10
CAMERA = "observation.images.camera"

_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_EPISODES = "meta/episodes/chunk-000/file-000.parquet"
_FIRST = {"chunk_index": 0, "file_index": 0}
_COUNTERS = ("frame_index", "episode_index", "index", "task_index")


@dataclass(frozen=True)
class Label:
    """What a dataset says of itself.

    Attributes:
        robot: kind of robot.
        task: what is done in the episode, in words.
    """

    robot: str
    task: str


@dataclass(frozen=True)
class _Column:
    """A column of the data with its entry in the description."""

    description: Mapping[str, Any]
    values: NDArray[Any]


def write_lerobot(folder: Path, sampled: SampledSession, label: Label) -> int:
    """Write a dataset of one episode into a new folder; nothing is left of one that cannot be completed.

    Returns:
        The number of frames.

    Raises:
        ConfigurationError: PyArrow is not installed.
        SessionError: the folder exists or cannot be written; or nothing of the session can be shown.
    """
    require_package("pyarrow")
    if folder.exists():
        raise SessionError("exists already", where=str(folder), hint="Choose a new folder")
    partial = folder.with_name(f".{folder.name}.part")
    try:
        partial.mkdir(parents=True)
        count = _write(partial, sampled, label)
        partial.replace(folder)
    except OSError as error:
        what = f"cannot be written ({error.strerror or error})"
        raise SessionError(what, where=str(folder), hint="Choose a new folder") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return count


def _write(folder: Path, sampled: SampledSession, label: Label) -> int:
    video = VideoFile(folder / _VIDEO.format(video_key=CAMERA, **_FIRST), RATE_Hz)
    columns = _columns(sampled, video)
    frames = len(columns["index"].values)
    statistics = {key: statistics_of(column.values) for key, column in columns.items()}
    features = {key: dict(column.description) for key, column in columns.items()}
    if video.exists:
        features[CAMERA], statistics[CAMERA] = video.description(), video.statistics()
    _write_table(folder / _DATA.format(**_FIRST), _data_table(columns))
    _write_table(folder / _EPISODES, _episode_table(frames, label.task, statistics, with_video=video.exists))
    _write_table(folder / "meta" / "tasks.parquet", _words_table("task", [label.task]))
    _write_table(folder / "meta" / "subtasks.parquet", _words_table("subtask", PHASES))
    _write_json(folder / "meta" / "stats.json", statistics)
    _write_json(folder / "meta" / "info.json", _info(frames, label.robot, features, with_video=video.exists))
    return frames


def _columns(sampled: SampledSession, video: VideoFile) -> dict[str, _Column]:
    """All columns but the video, which is written on the way. Raises SessionError."""
    features = features_of(sampled)
    rows: list[list[Any]] = [[] for _ in features]
    try:
        for moment in sampled:
            for row, feature in zip(rows, features, strict=True):
                row.append(np.asarray(feature.read(moment), dtype=feature.dtype))
            video.add(moment.picture)
    finally:
        video.close()
    if not rows[0]:
        what = "hand and positioner never answered: there is no state to show"
        raise SessionError(what, where="session", hint="Look at it with 'tactile-lab session show'")
    told = {feature.key: _column(feature, row) for feature, row in zip(features, rows, strict=True)}
    return {**told, ACTION: _action(told[STATE]), **_counters(len(rows[0]))}


def _column(feature: Feature, rows: Sequence[Array]) -> _Column:
    return _Column(feature.description(), np.array(rows))


def _action(state: _Column) -> _Column:
    """Where hand and positioner were one frame later; at the last frame, where they were."""
    return _Column(state.description, np.concatenate([state.values[1:], state.values[-1:]]))


def _counters(frames: int) -> dict[str, _Column]:
    """The columns that every dataset has."""
    numbers, scalar = np.arange(frames, dtype=np.int64)[:, None], {"shape": [1], "names": None}
    told = {name: np.zeros((frames, 1), np.int64) for name in _COUNTERS} | {"frame_index": numbers, "index": numbers}
    seconds = (numbers / RATE_Hz).astype(np.float32)
    counters = {name: _Column({"dtype": "int64", **scalar}, values) for name, values in told.items()}
    return {"timestamp": _Column({"dtype": "float32", **scalar}, seconds), **counters}


# --- tables --------------------------------------------------------------------------------------------------------


def _data_table(columns: Mapping[str, _Column]) -> pyarrow.Table:
    fields, arrays = [], []
    for key, column in columns.items():
        kind = _arrow_type(column)
        plain = column.values[:, 0] if column.values.shape[1:] == (1,) else column.values.tolist()
        fields.append(pyarrow.field(key, kind))
        arrays.append(pyarrow.array(plain, type=kind))
    return pyarrow.table(arrays, schema=pyarrow.schema(fields))


def _arrow_type(column: _Column) -> Any:
    """A number, numbers of a fixed count, or rows of numbers."""
    number, shape = pyarrow.from_numpy_dtype(column.values.dtype), column.values.shape[1:]
    if shape == (1,):
        return number
    return pyarrow.list_(number, shape[0]) if len(shape) == 1 else pyarrow.list_(pyarrow.list_(number))


def _episode_table(frames: int, task: str, statistics: Mapping[str, Statistics], *, with_video: bool) -> pyarrow.Table:
    row: dict[str, Any] = {"episode_index": 0, "tasks": [task], "length": frames}
    row |= {"data/chunk_index": 0, "data/file_index": 0, "dataset_from_index": 0, "dataset_to_index": frames}
    if with_video:
        row |= {f"videos/{CAMERA}/{name}": value for name, value in _FIRST.items()}
        row |= {f"videos/{CAMERA}/from_timestamp": 0.0, f"videos/{CAMERA}/to_timestamp": frames / RATE_Hz}
    for key, told in statistics.items():
        row |= {f"stats/{key}/{name}": value for name, value in told.items()}
    row |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
    return pyarrow.table({name: [value] for name, value in row.items()})


def _words_table(name: str, words: Sequence[str]) -> pyarrow.Table:
    """Numbers by words, which pandas reads as a frame that the words index."""
    table = pyarrow.table({f"{name}_index": pyarrow.array(range(len(words)), pyarrow.int64()), name: list(words)})
    number = {"pandas_type": "int64", "numpy_type": "int64", "metadata": None}
    text = {"pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    columns = [
        {"name": f"{name}_index", "field_name": f"{name}_index", **number},
        {"name": name, "field_name": name, **text},
    ]
    pandas = {"index_columns": [name], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def _write_table(path: Path, table: pyarrow.Table) -> None:
    from pyarrow import parquet

    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table, path, compression="snappy")


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=4, ensure_ascii=False) + "\n", encoding="utf-8")


def _info(frames: int, robot: str, features: Mapping[str, Any], *, with_video: bool) -> dict[str, Any]:
    """The content of ``meta/info.json``."""
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": 1,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": RATE_Hz,
        "splits": {"train": "0:1"},
        "data_path": _DATA,
        "video_path": _VIDEO if with_video else None,
        "features": features,
    }
