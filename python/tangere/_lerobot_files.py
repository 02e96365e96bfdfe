# SPDX-License-Identifier: Apache-2.0
"""The files of a LeRobotDataset v3.0, written with pyarrow: `tangere.lerobot` says what is in them.

    data/chunk-000/file-000.parquet           a row a frame: features, then time stamp and indices
    meta/episodes/chunk-000/file-000.parquet  a row an episode: where it lies, and its statistics
    meta/tasks.parquet                        the text of the task
    README.md                                 the card

A picture is a PNG file in its row. Statistics are per place on a feature's last axis, those of a
picture per colour, from 0 to 1, and (3, 1, 1). Those of all frames come from those of the
episodes, n frames with mean m and sum of squared deviations s each, one after the other:

    n = n1 + n2,   m = m1 + (m2 - m1) n2/n,   s = s1 + s2 + (m2 - m1)^2 n1 n2/n
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Iterator

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from . import _core
from ._lerobot_features import BOOKKEEPING, Feature
from ._png import png

CHUNK = 1000  # files of a folder
_GROUP_BYTES = 1 << 25  # of rows that are written at once
_GROUP_EPISODES = 1000  # rows of the table of episodes that are written at once
_SAMPLE = 4_000_000  # numbers of a feature that its quantiles are taken from
_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


class Statistics:
    """Moments of a feature over frames, per place on its last axis."""

    def __init__(self, feature: Feature, frames: int):
        per_frame = int(np.prod(feature.shape))
        self._stride = max(1, -(-frames * per_frame // _SAMPLE))  # of frames in the sample
        self._frames, self._numbers = 0, 0
        self._sample: list[np.ndarray] = []
        width = feature.shape[-1]
        self._min, self._max = np.full(width, np.inf), np.full(width, -np.inf)
        self._mean, self._square = np.zeros(width), np.zeros(width)
        self._unit = 255.0 if feature.is_picture else 1.0
        self._shape = (-1, 1, 1) if feature.is_picture else (-1,)

    def add(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Takes the frames of an episode, (n, *shape), and returns its own statistics."""
        flat = rows.reshape(-1, rows.shape[-1]).astype(np.float64) / self._unit
        low, high, mean = flat.min(0), flat.max(0), flat.mean(0)
        square = ((flat - mean) ** 2).sum(0)
        before, count = self._numbers, len(flat)
        self._numbers += count
        self._square += square + (mean - self._mean) ** 2 * (before * count / self._numbers)
        self._mean += (mean - self._mean) * (count / self._numbers)
        self._min, self._max = np.minimum(self._min, low), np.maximum(self._max, high)
        sample = rows[-self._frames % self._stride :: self._stride]
        self._sample.append(sample.reshape(-1, rows.shape[-1]).copy())
        self._frames += len(rows)
        return self._named(low, high, mean, np.sqrt(square / count), len(rows), flat)

    def result(self) -> dict[str, list[Any]]:
        """Those of all frames. Quantiles are of evenly spaced frames if there are many numbers."""
        std = np.sqrt(self._square / self._numbers)
        sample = np.concatenate(self._sample).astype(np.float64) / self._unit
        found = self._named(self._min, self._max, self._mean, std, self._frames, sample)
        return {name: values.tolist() for name, values in found.items()}

    def _named(
        self, low: np.ndarray, high: np.ndarray, mean: np.ndarray, std: np.ndarray, count: int,
        flat: np.ndarray,
    ) -> dict[str, np.ndarray]:  # fmt: skip
        quantiles = np.quantile(flat, list(_QUANTILES.values()), axis=0)
        found = {"min": low, "max": high, "mean": mean, "std": std}
        found |= dict(zip(_QUANTILES, quantiles, strict=True))
        shaped = {name: values.reshape(self._shape) for name, values in found.items()}
        return shaped | {"count": np.asarray([count])}


class Table:
    """A parquet file on its way. Rows are collected and written many at once."""

    def __init__(self, path: Path, schema: pa.Schema, most_bytes: float, most_batches: int):
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = open(path, "xb")
        self._parquet = pq.ParquetWriter(self._file, schema, compression="snappy")
        self._schema, self._most = schema, (most_bytes, most_batches)
        self._pending: list[pa.RecordBatch] = []
        self._bytes = 0

    def add(self, batch: pa.RecordBatch) -> int:
        """Takes rows and returns the size of the file so far [bytes]."""
        self._pending.append(batch)
        self._bytes += batch.nbytes
        if self._bytes >= self._most[0] or len(self._pending) >= self._most[1]:
            self._flush()
        return int(self._file.tell())

    def close(self) -> None:
        self._flush()
        self._parquet.close()
        _sync(self._file)
        self._file.close()

    def _flush(self) -> None:
        if self._pending:
            self._parquet.write_table(pa.Table.from_batches(self._pending, self._schema))
        self._pending, self._bytes = [], 0


class FrameWriter:
    """Writes episodes into files of frames, whole ones each, and the table of episodes.

    frames: how many there will be. megabytes: a file of frames ends with the episode that brings it
    beyond this size. fps: frames a second.
    """

    def __init__(
        self, folder: Path, features: list[Feature], frames: int, fps: int, megabytes: float,
        task: str,
    ):  # fmt: skip
        self._folder, self._fps, self._task = folder, fps, task
        self._limit = megabytes * 2**20
        self.episodes, self.frames, self.files = 0, 0, 0
        self._features = features + [Feature(n, [n], (1,), d) for n, d in BOOKKEEPING.items()]
        self._statistics = {f.name: Statistics(f, frames) for f in self._features}
        self._schema = _schema(self._features)
        self._table: Table | None = None
        self._episodes: Table | None = None

    def add(self, name: str, arrays: dict[str, np.ndarray]) -> None:
        """Adds an episode. Throws InputError that calls it `name` if its arrays do not fit."""
        count = len(arrays["actions"])
        frame = np.arange(count)
        arrays = arrays | {
            "timestamp": frame / self._fps,
            "frame_index": frame,
            "episode_index": np.full(count, self.episodes),
            "index": self.frames + frame,
            "task_index": np.zeros(count, int),
        }
        if self._table is None:
            chunk, number = divmod(self.files, CHUNK)
            path = self._folder / f"data/chunk-{chunk:03d}/file-{number:03d}.parquet"
            self._table = Table(path, self._schema, min(_GROUP_BYTES, self._limit), _GROUP_EPISODES)
            self.files += 1
        row: dict[str, Any] = {
            "episode_index": self.episodes,
            "tasks": [self._task],
            "length": count,
            "data/chunk_index": (self.files - 1) // CHUNK,
            "data/file_index": (self.files - 1) % CHUNK,
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames + count,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        columns = []
        for feature in self._features:
            rows = feature.rows(arrays)
            if len(rows) != count:
                raise _core.InputError(
                    f"{name} has {len(rows)} rows of {feature.keys[0]!r}; expected {count}, one "
                    "for each action"
                )
            statistics = self._statistics[feature.name].add(rows)
            if not np.isfinite([statistics["min"], statistics["max"]]).all():
                raise _core.InputError(
                    f"{name} has a number in {feature.name!r} that is not finite; see `tangere "
                    "validate`"
                )
            for key, values in statistics.items():
                row[f"stats/{feature.name}/{key}"] = values.tolist()
            columns.append(_arrow_array(rows, feature))
        self._describe(row)
        self.episodes += 1
        self.frames += count
        size = self._table.add(pa.RecordBatch.from_arrays(columns, schema=self._schema))
        if size >= self._limit:
            self._end_file()

    def _describe(self, row: dict[str, Any]) -> None:
        batch = pa.RecordBatch.from_pylist([row])
        if self._episodes is None:
            path = self._folder / "meta/episodes/chunk-000/file-000.parquet"
            self._episodes = Table(path, batch.schema, _GROUP_BYTES, _GROUP_EPISODES)
        self._episodes.add(batch)

    def close(self) -> dict[str, dict[str, list[Any]]]:
        """Ends the files and returns the statistics of each feature."""
        self._end_file()
        if self._episodes is not None:
            self._episodes.close()
        return {name: statistics.result() for name, statistics in self._statistics.items()}

    def _end_file(self) -> None:
        if self._table is not None:
            self._table.close()
        self._table = None


def _schema(features: list[Feature]) -> pa.Schema:
    """With pictures it says so to the package `datasets`, for which they are bytes otherwise."""
    schema = pa.schema([(f.name, _arrow_type(f)) for f in features])
    if not any(f.is_picture for f in features):
        return schema
    said = {"info": {"features": {f.name: _hub_type(f) for f in features}}}
    return schema.with_metadata({"huggingface": json.dumps(said)})


def _hub_type(feature: Feature) -> dict[str, Any]:
    if feature.is_picture:
        return {"_type": "Image"}
    said: dict[str, Any] = {"dtype": feature.dtype, "_type": "Value"}
    for size in reversed(feature.shape if feature.shape != (1,) else ()):
        length = size if len(feature.shape) == 1 else -1
        said = {"feature": said, "length": length, "_type": "Sequence"}
    return said


def _arrow_type(feature: Feature) -> pa.DataType:
    """Numbers as a plain column, vectors as lists of fixed size, fields as nested lists."""
    if feature.is_picture:
        return pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    plain = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}[feature.dtype]
    if feature.shape == (1,):
        return plain
    if len(feature.shape) == 1:
        return pa.list_(plain, feature.shape[0])
    for _ in feature.shape:
        plain = pa.list_(plain)
    return plain


def _arrow_array(rows: np.ndarray, feature: Feature) -> pa.Array:
    if feature.is_picture:
        files = [{"bytes": png(picture), "path": None} for picture in rows]
        return pa.array(files, _arrow_type(feature))
    values = pa.array(np.ascontiguousarray(rows).reshape(-1))
    if feature.shape == (1,):
        return values
    if len(feature.shape) == 1:
        return pa.FixedSizeListArray.from_arrays(values, feature.shape[0])
    for size in reversed(feature.shape):
        ends = np.arange(0, len(values) + 1, size, dtype=np.int32)
        values = pa.ListArray.from_arrays(pa.array(ends), values)
    return values


def write_task(folder: Path, task: str) -> None:
    """meta/tasks.parquet: one text, which is the index of the table for pandas."""
    columns = [("task_index", "task_index", "int64", "int64")]
    columns += [(None, "__index_level_0__", "unicode", "object")]  # type: ignore[list-item]
    said = {
        "index_columns": ["__index_level_0__"],
        "column_indexes": [],
        "columns": [
            {"name": n, "field_name": f, "pandas_type": p, "numpy_type": k, "metadata": None}
            for n, f, p, k in columns
        ],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.0.0",
    }
    table = pa.table({"task_index": pa.array([0], pa.int64()), "__index_level_0__": [task]})
    table = table.replace_schema_metadata({"pandas": json.dumps(said)})
    file = Table(folder / "meta/tasks.parquet", table.schema, _GROUP_BYTES, _GROUP_EPISODES)
    for batch in table.to_batches():
        file.add(batch)
    file.close()


def write_json(path: Path, value: Any) -> None:
    write_text(path, json.dumps(value, indent=4, ensure_ascii=False, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    with open(path, "x", encoding="utf-8") as file:
        file.write(text)
        _sync(file)


def _sync(file: Any) -> None:
    file.flush()
    os.fsync(file.fileno())


@contextmanager
def new_folder(output: Path, overwrite: bool) -> Iterator[Path]:
    """A folder OUTPUT.part, which gets its name at the end and is removed if anything fails.

    What was called OUTPUT is OUTPUT.old.part while the names change. A run that was killed then
    left it so: it gets its name back first, unless that run had begun to remove it.

    Throws InputError if `output` is there and is not to be replaced, or is no LeRobot data set, and
    if another process writes it.
    """
    _check_free(output, overwrite)
    part, old = (output.with_name(output.name + end) for end in (".part", ".old.part"))
    part.mkdir(parents=True, exist_ok=True)
    with open(part / ".lock", "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise _core.InputError(f"{part} is being written by another process") from None
        try:
            _empty(part)  # what a run that was killed has left
            if old.exists() and (output.exists() or not _is_data_set(old)):
                _remove(old)
            elif old.exists():
                old.rename(output)
                _check_free(output, overwrite)
            yield part
            if output.exists():
                output.rename(old)
            (part / ".lock").unlink()
            part.rename(output)
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            if old.exists() and not output.exists():
                old.rename(output)
            raise
    if old.exists():
        _remove(old)


def _is_data_set(folder: Path) -> bool:
    return (folder / "meta/info.json").is_file()


def _remove(folder: Path) -> None:
    """Removes a data set so that what a killed process leaves of it is none."""
    (folder / "meta/info.json").unlink(missing_ok=True)
    shutil.rmtree(folder)


def _check_free(output: Path, overwrite: bool) -> None:
    if output.exists() or output.is_symlink():
        if not overwrite:
            raise _core.InputError(f"{output} exists; expected a new folder, or overwrite")
        if not _is_data_set(output):
            raise _core.InputError(f"{output} is no LeRobot data set; it is not overwritten")


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name != ".lock":
            path.unlink()
