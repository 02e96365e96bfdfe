# SPDX-License-Identifier: Apache-2.0
"""The files of a LeRobotDataset v3.0, written with pyarrow: `tangere.lerobot` says what is in them.

    data/chunk-000/file-000.parquet           a row a frame: features, then time stamp and indices
    meta/episodes/chunk-000/file-000.parquet  a row an episode: where it lies, and its statistics
    meta/tasks.parquet                        the text of the task
    README.md                                 the card

A picture is a PNG file in its row, or a frame of a video.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ._export_job import sync
from ._lerobot_features import BOOKKEEPING, Feature
from ._png import png

CHUNK = 1000  # files of a folder
EPISODES, TASKS = "meta/episodes/chunk-000/file-000.parquet", "meta/tasks.parquet"
_GROUP_BYTES = 1 << 25  # of rows that are written at once
_SORTED = [name for name in BOOKKEEPING if name != "timestamp"]  # readers skip groups by these


class Table:
    """A parquet file on its way; replaces one that a killed run has left."""

    def __init__(self, path: Path, schema: pa.Schema):
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = open(path, "wb")
        # Dictionaries would double the time of fields; LZ4 finds their zeros, and is read fastest.
        self._parquet = pq.ParquetWriter(
            self._file, schema, compression="lz4", use_dictionary=False, write_statistics=_SORTED
        )

    def add(self, batch: pa.RecordBatch) -> None:
        """Writes rows as one group."""
        self._parquet.write_batch(batch)

    def close(self) -> None:
        """Ends the file and brings it to the disk."""
        self._parquet.close()
        sync(self._file)
        self._file.close()


def schema_of(features: list[Feature]) -> pa.Schema:
    """Of all but videos. With pictures it says so to the package `datasets`, for which they are
    bytes otherwise."""
    schema = pa.schema([pa.field(f.name, arrow_type(f), nullable=f.is_picture) for f in features])
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


def arrow_type(feature: Feature) -> pa.DataType:
    """Numbers as a plain column, vectors as lists of fixed size, fields as nested lists. None of
    them is ever null, which readers need not test then."""
    if feature.is_picture:
        return pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    plain = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}[feature.dtype]
    if feature.shape == (1,):
        return plain
    if len(feature.shape) == 1:
        return _list_of(plain, feature.shape[0])
    for _ in feature.shape:
        plain = _list_of(plain)
    return plain


def _list_of(type: pa.DataType, size: int = -1) -> pa.DataType:
    return pa.list_(pa.field("element", type, nullable=False), size)


def arrow_array(rows: np.ndarray, feature: Feature) -> pa.Array:
    if feature.is_picture:
        files = [{"bytes": png(picture), "path": None} for picture in rows]
        return pa.array(files, arrow_type(feature))
    if len(feature.shape) > 1:
        return _nested(rows)
    values = pa.array(np.ascontiguousarray(rows).reshape(-1))
    if feature.shape == (1,):
        return values
    return pa.FixedSizeListArray.from_arrays(values, type=arrow_type(feature))


def write_episodes(path: Path, columns: dict[str, Any]) -> None:
    """The table of episodes: NAME → a number, a list of texts or an array (…) of each episode."""
    arrays = {}
    for name, values in columns.items():
        if isinstance(values, np.ndarray):
            arrays[name] = _nested(values)
        else:
            arrays[name] = pa.array(values, pa.list_(pa.string()))
    table = pa.table(arrays)
    file = Table(path, table.schema)
    for batch in table.to_batches(max_chunksize=max(1, _GROUP_BYTES // (8 * len(arrays)))):
        file.add(batch)
    file.close()


def _nested(values: np.ndarray) -> pa.Array:
    array = pa.array(np.ascontiguousarray(values).reshape(-1))
    for size in reversed(values.shape[1:]):
        ends = np.arange(0, len(array) + 1, size, dtype=np.int32)
        array = pa.ListArray.from_arrays(pa.array(ends), array, type=_list_of(array.type))
    return array


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
    file = Table(folder / TASKS, table.schema)
    for batch in table.to_batches():
        file.add(batch)
    file.close()
