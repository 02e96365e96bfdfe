# SPDX-License-Identifier: Apache-2.0
"""LeRobotDataset v3.0 as a format of exports: a part is a file of frames of whole episodes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from . import _core, _lerobot_video
from ._export_frames import Frames, action_unit, number_units, unit_text
from ._export_job import sync, write_json, write_text
from ._lerobot_card import card
from ._lerobot_features import BOOKKEEPING, Feature, Pictures, Touch, features_of
from ._lerobot_files import (
    CHUNK, EPISODES, TASKS, Table, arrow_array, schema_of, write_episodes, write_task
)  # fmt: skip
from ._lerobot_statistics import Statistics, joined, moments, of_all, of_episodes

VERSION = "v3.0"
_GROUP_BYTES = 1 << 25  # of numbers that are written at once
_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"


class LeRobot:
    """The format, with the options of `tangere.lerobot.export`."""

    kind, sign, origin = "LeRobot data set", "meta/info.json", "meta/tangere.json"
    folder_keys, common = False, [EPISODES, TASKS, "meta/stats.json"]

    def __init__(
        self, frames: Frames, privileged: bool = False, touch: Touch | None = None,
        task: str | None = None, fps: int | None = None, license: str = "unknown",
        file_megabytes: float = 100, pictures: Pictures = "image",
    ):  # fmt: skip
        if fps is None:
            fps = max(1, round(1 / frames.seconds))
        if not isinstance(fps, int) or fps < 1:
            raise _core.InputError(f"fps {fps!r}; expected a whole number, 1 or above")
        if not file_megabytes > 0:
            raise _core.InputError(f"file_megabytes {file_megabytes}; expected a positive number")
        self.frames, self.fps, self.text = frames, fps, task_text(frames, task)
        self.features = features_of(frames, privileged, touch, pictures)
        for feature in self.features:
            if feature.is_video:
                _lerobot_video.check_video(feature)
        self._license, self._megabytes = license, file_megabytes
        self._ends = _cut(frames, file_megabytes * 2**20)
        self.parts = [
            int(frames.lengths[first:last].sum())
            for first, last in zip([0, *self._ends], self._ends)
        ]

    @property
    def names(self) -> list[str]:
        """Of the columns, without those for bookkeeping."""
        return [feature.name for feature in self.features]

    def job(self) -> dict[str, Any]:
        return {
            "format": f"LeRobot {VERSION}", "pyarrow": pa.__version__, "text": self.text,
            "fps": self.fps, "columns": [feature.recipe() for feature in self.features],
            "license": self._license, "file_megabytes": self._megabytes,
        }  # fmt: skip

    def begin(self, folder: Path) -> None:
        """Nothing is there before the first part."""

    def write(self, folder: Path, part: int) -> None:
        pa.set_cpu_count(1)
        frames = self.frames
        first, last = [0, *self._ends][part], self._ends[part]
        place = _place(part)
        before = int(frames.ends[first] - frames.lengths[first])
        counting = _Bookkeeping(self.fps, before)
        statistics = {f.name: Statistics(f, len(frames), before) for f in self.features}
        for name, dtype in BOOKKEEPING.items():
            statistics[name] = Statistics(Feature(name, [name], (1,), dtype), len(frames), before)
        columns = [f for f in self.features if not f.is_video] + counting.features
        schema = schema_of(columns)
        table = Table(folder / _PATH.format(**place), schema)
        videos = {
            f.name: _lerobot_video.Video(
                folder / _lerobot_video.PATH.format(video_key=f.name, **place), f, self.fps
            )
            for f in self.features
            if f.is_video
        }
        for start, stop in _groups(frames, first, last):
            arrays = frames.group(start, stop)
            rows = {f.name: f.rows(arrays) for f in self.features}
            self._count(rows, statistics, start, stop)
            rows |= counting.rows(frames.lengths[start:stop], start, statistics)
            for name, video in videos.items():
                video.add(rows[name])
            batch = [arrow_array(rows[f.name], f) for f in columns]
            table.add(pa.RecordBatch.from_arrays(batch, schema=schema))
        table.close()
        for video in videos.values():
            video.close()
        packed = {
            f"{name}/{key}": values
            for name, of in statistics.items()
            for key, values in of.packed().items()
        }
        with open(folder / f".parts/{part:05d}.npz", "wb") as file:
            np.savez(file, **packed)
            sync(file)

    def files(self, part: int) -> list[str]:
        place = _place(part)
        videos = [f.name for f in self.features if f.is_video]
        return [_PATH.format(**place)] + [
            _lerobot_video.PATH.format(video_key=name, **place) for name in videos
        ]

    def _count(
        self, rows: dict[str, np.ndarray], statistics: dict[str, Statistics], start: int, stop: int
    ) -> None:
        """Adds the episodes start … stop - 1 to the statistics of features."""
        lengths = self.frames.lengths[start:stop]
        ends = np.cumsum(lengths)
        for feature in self.features:
            taken, to = rows[feature.name], statistics[feature.name]
            for place, (end, length) in enumerate(zip(ends, lengths, strict=True)):
                found = moments(taken[end - length : end])
                if not np.isfinite(found["square"]).all():
                    raise _core.InputError(
                        f"{self.frames.name(start + place)} has a number in {feature.name!r} that "
                        "is not finite; see `tangere validate`"
                    )
                to.add_moments(found, int(length))
            to.add_sample(taken)

    def finish(self, folder: Path) -> None:
        """The statistics, the tables of episodes and tasks, the card and info.json."""
        frames, episodes = self.frames, self.frames.episodes
        packed = [np.load(folder / f".parts/{part:05d}.npz") for part in range(len(self.parts))]
        bookkeeping = [Feature(name, [name], (1,), dtype) for name, dtype in BOOKKEEPING.items()]
        table, overall = self._table(), {}
        for feature in self.features + bookkeeping:
            start = f"{feature.name}/"
            named = [{k.removeprefix(start): part[k] for k in part.files if k.startswith(start)}
                     for part in packed]  # fmt: skip
            whole = joined(named)
            overall[feature.name] = of_all(feature, whole)
            for key, values in of_episodes(feature, whole).items():
                table[f"stats/{feature.name}/{key}"] = values
        (folder / "meta").mkdir(exist_ok=True)
        for name in ("README.md", "meta/stats.json", "meta/tangere.json", "meta/info.json"):
            (folder / name).unlink(missing_ok=True)
        write_episodes(folder / EPISODES, table)
        write_task(folder, self.text)
        info = self._info([*self.features, *bookkeeping])
        solved = len(frames.solved & set(frames.chosen))
        text = card(frames, self.features, info, self.text, solved, self._license)
        write_text(folder / "README.md", text)
        write_json(folder / "meta/stats.json", overall)
        write_json(folder / "meta/tangere.json", self._origin())
        write_json(folder / "meta/info.json", info)

    def _table(self) -> dict[str, Any]:
        frames, count = self.frames, len(self.frames.lengths)
        part = np.repeat(range(len(self._ends)), np.diff([0, *self._ends]))
        chunk, number = np.divmod(part, CHUNK)
        start = frames.ends - frames.lengths
        nowhere = np.zeros(count, int)
        table: dict[str, Any] = {
            "episode_index": np.arange(count),
            "tasks": [[self.text]] * count,
            "length": frames.lengths,
            "data/chunk_index": chunk,
            "data/file_index": number,
            "dataset_from_index": start,
            "dataset_to_index": frames.ends,
            "meta/episodes/chunk_index": nowhere,
            "meta/episodes/file_index": nowhere,
        }
        first = start[[0, *self._ends[:-1]]][part]  # frame of the file in which the episode is
        for feature in self.features:
            if feature.is_video:
                name = f"videos/{feature.name}"
                table |= {f"{name}/chunk_index": chunk, f"{name}/file_index": number}
                table[f"{name}/from_timestamp"] = (start - first) / self.fps
                table[f"{name}/to_timestamp"] = (frames.ends - first) / self.fps
        return table

    def _info(self, features: list[Feature]) -> dict[str, Any]:
        episodes = self.frames.episodes
        shapes = {f.name: f.described() for f in features}
        videos = [f for f in features if f.is_video]
        for feature in videos:
            shapes[feature.name]["info"] = _lerobot_video.described(feature, self.fps)
        return {
            "codebase_version": VERSION,
            "robot_type": f"tangere_{episodes.task or episodes.attributes['name']}",
            "total_episodes": len(self.frames.lengths),
            "total_frames": len(self.frames),
            "total_tasks": 1,
            "chunks_size": CHUNK,
            "data_files_size_in_mb": math.ceil(self._megabytes),
            "video_files_size_in_mb": 200,
            "fps": self.fps,
            "splits": {"train": f"0:{len(self.frames.lengths)}"},
            "data_path": _PATH,
            "video_path": _lerobot_video.PATH if videos else None,
            "features": shapes,
        }

    def _origin(self) -> dict[str, Any]:
        frames, episodes = self.frames, self.frames.episodes
        return {
            "command": episodes.command,
            "tangere_version": str(episodes.attributes["tangere_version"]),
            "seconds_per_action": frames.seconds,
            "window": frames.window,
            "frames": len(frames),
            **({"windows": frames.windows} if frames.windows else {}),
            "demos": [episodes.names[i] for i in frames.chosen],
            "observation_scale": episodes.scale,
            "privileged": episodes.privileged,
            "touch": episodes.touch,
            "task": episodes.task,
            "text": self.text,
            "units": self._units(),
            **frames.scene_note(),
            "columns": [feature.recipe() for feature in self.features],
        }

    def _units(self) -> dict[str, str]:
        """Of columns: one unit, or those of the numbers in turn."""
        episodes = self.frames.episodes
        units = {"action": action_unit(episodes)}
        for feature in self.features:
            if not feature.name.startswith("observation.") or feature.is_picture:
                continue
            found: list[str] = []
            for key in feature.keys:
                width = math.prod(self.frames.shapes[key])
                found += number_units(episodes, key, width, feature.numbers.get(key, ()))
            if len(set(found)) == 1 or not feature.blocks:  # means are fewer numbers
                units[feature.name] = unit_text(found)
        return {name: unit for name, unit in units.items() if unit}


class _Bookkeeping:
    """Time stamps and indices, whose statistics follow from the lengths of episodes."""

    features = [Feature(name, [name], (1,), dtype) for name, dtype in BOOKKEEPING.items()]

    def __init__(self, fps: int, first: int):
        self._fps, self._next = fps, first
        self._known: dict[int, tuple[dict[str, np.ndarray], dict[str, np.ndarray]]] = {}

    def rows(
        self, lengths: np.ndarray, first: int, statistics: dict[str, Statistics]
    ) -> dict[str, np.ndarray]:
        """NAME → (frames, 1) of the episodes first, first + 1 …; adds them to `statistics`."""
        frame = np.concatenate([np.arange(length) for length in lengths])
        start = np.repeat(np.cumsum(lengths) - lengths, lengths) + self._next
        index = np.arange(first, first + len(lengths))
        rows = {
            "timestamp": (frame / self._fps).astype(np.float32),
            "frame_index": frame,
            "episode_index": np.repeat(index, lengths),
            "index": start + frame,
            "task_index": np.zeros(len(frame), np.int64),
        }
        rows = {name: values[:, None] for name, values in rows.items()}
        for episode, length in zip(index, lengths.tolist(), strict=True):
            stamp, count = self._of_length(length)
            for name, found in (
                ("timestamp", stamp), ("frame_index", count), ("index", _moved(count, self._next)),
                ("episode_index", _moved(_NONE, int(episode))), ("task_index", _NONE),
            ):  # fmt: skip
                statistics[name].add_moments(found, length)
            self._next += length
        for name, values in rows.items():
            statistics[name].add_sample(values)
        return rows

    def _of_length(self, length: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        if length not in self._known:
            frame = np.arange(length)[:, None]
            stamp = (frame / self._fps).astype(np.float32)
            self._known[length] = moments(stamp), moments(frame)
        return self._known[length]


_NONE = moments(np.zeros((1, 1)))


def _moved(found: dict[str, np.ndarray], by: int) -> dict[str, np.ndarray]:
    return {name: values if name == "square" else values + by for name, values in found.items()}


def _place(part: int) -> dict[str, int]:
    chunk, number = divmod(part, CHUNK)
    return {"chunk_index": chunk, "file_index": number}


def task_text(frames: Frames, text: str | None) -> str:
    """What a policy that reads a text is told."""
    episodes = frames.episodes
    if text is not None and not isinstance(text, str):
        raise _core.InputError(f"task {text!r}; expected a text")
    if text is not None:
        return text
    if not episodes.task:
        return str(episodes.attributes["name"])
    return f"{episodes.task}: {episodes.attributes['success']}"


def _cut(frames: Frames, most_bytes: float) -> list[int]:
    """Ends of files: one ends with the episode that brings its numbers beyond this size."""
    ends, size = [], 0
    for place, length in enumerate(frames.lengths):
        size += int(length) * frames.bytes
        if size >= most_bytes:
            ends.append(place + 1)
            size = 0
    return ends if ends and ends[-1] == len(frames.lengths) else [*ends, len(frames.lengths)]


def _groups(frames: Frames, first: int, last: int) -> list[tuple[int, int]]:
    sizes = frames.lengths[first:last] * frames.bytes
    groups, start, size = [], first, 0
    for place in range(first, last):
        size += int(sizes[place - first])
        if size >= _GROUP_BYTES or place + 1 == last:
            groups.append((start, place + 1))
            start, size = place + 1, 0
    return groups
