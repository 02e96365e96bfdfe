# SPDX-License-Identifier: Apache-2.0
"""Zarr as Diffusion Policy reads it, version 2 of the format, as a format of exports.

    data/KEY           (frames, …)  the frames of all episodes, one after the other
    meta/episode_ends  (episodes)   int64: the frame after the last one of each

A part is a range of frames. Chunks of all arrays end where it ends, so that no two processes write
the same file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numcodecs
import numpy as np
import zarr

from . import _core
from ._export_frames import Arrays, Frames, action_unit, action_units, unit_and_meaning, unit_text

_CHUNK_BYTES = 1 << 20  # of a chunk, at most, where a row is smaller
_PART_BYTES = 1 << 26  # of the numbers of a part
_MOST_ROWS = 4096  # of a chunk


class Column(NamedTuple):
    """An array of the store: shape of a frame, type, and what its attributes say."""

    shape: tuple[int, ...]
    dtype: np.dtype
    attributes: dict[str, Any]


class ZarrStore:
    """What formats in Zarr share. They add `columns` and `arrays`."""

    kind, sign, origin = "Zarr data set", ".zgroup", ".zattrs"
    folder_keys = True
    fps: int

    def __init__(
        self, frames: Frames, columns: dict[str, Column], said: dict[str, Any] | None = None
    ):
        self.frames, self.columns, self._said = frames, columns, said or {}
        self.names = list(columns)
        arrays = [*(f"data/{name}" for name in columns), "meta/episode_ends"]
        self.common = ["meta/episode_ends/0", *(f"{name}/.zarray" for name in arrays)]
        self.fps = max(1, round(1 / frames.seconds))
        sizes = [_bytes_of(column) for column in columns.values()]
        part = _power_below(_PART_BYTES // max(1, sum(sizes)))
        self._rows = min(max(part, 1), _MOST_ROWS)  # of a chunk, at most
        self._part = max(part // self._rows, 1) * self._rows
        count = len(frames)
        self.parts = [min(self._part, count - at) for at in range(0, count, self._part)]

    def arrays(self, frames: Arrays, start: int) -> Arrays:
        """NAME → rows of all columns, from those of frames; `start` is the first frame of all."""
        raise NotImplementedError

    def job(self) -> dict[str, Any]:
        columns = {name: [c.shape, str(c.dtype)] for name, c in self.columns.items()}
        return {
            "format": type(self).__name__, "zarr": zarr.__version__,
            "numcodecs": numcodecs.__version__, "columns": columns,
        }  # fmt: skip

    def begin(self, folder: Path) -> None:
        """Describes the arrays."""
        episodes = self.frames.episodes
        root = zarr.open_group(str(folder), mode="a", zarr_format=2)
        root.attrs.update(
            {
                "command": episodes.command,
                "tangere_version": str(episodes.attributes["tangere_version"]),
                "seconds_per_frame": self.frames.seconds,
                "window": self.frames.window,
                "frames": len(self.frames),
                "demos": [episodes.names[i] for i in self.frames.chosen],
                "touch": episodes.touch,
                "privileged": episodes.privileged,
                **self._said,
                **self.frames.scene_note(),
            }
        )
        data = root.create_group("data")
        for name, column in self.columns.items():
            data.create_array(
                name, shape=(len(self.frames), *column.shape), dtype=column.dtype,
                chunks=(self._chunk_rows(column), *column.shape),
                compressors=numcodecs.Blosc("lz4", 5), attributes=column.attributes,
            )  # fmt: skip
        meta = root.create_group("meta")
        ends = meta.create_array(
            "episode_ends", shape=self.frames.ends.shape, dtype=np.int64,
            chunks=self.frames.ends.shape, compressors=None,
        )  # fmt: skip
        ends[:] = self.frames.ends.astype(np.int64)

    def write(self, folder: Path, part: int) -> None:
        numcodecs.blosc.use_threads = False  # the other cores have parts of their own
        start = part * self._part
        stop = start + self.parts[part]
        found = self.arrays(self.frames.between(start, stop), start)
        data = zarr.open_group(str(folder / "data"), mode="r+", zarr_format=2)
        for name, rows in found.items():
            if rows.dtype.kind == "f" and not np.isfinite(rows).all():
                where = start + int(np.argwhere(~np.isfinite(rows))[0, 0])
                place = int(np.searchsorted(self.frames.ends, where, "right"))
                raise _core.InputError(
                    f"{self.frames.name(place)} has a number in {name!r} that is not finite; see "
                    "`tangere validate`"
                )
            array = data[name]
            assert isinstance(array, zarr.Array)
            array[start:stop] = rows

    def files(self, part: int) -> list[str]:
        names, start = [], part * self._part
        for name, column in self.columns.items():
            rows, rest = self._chunk_rows(column), ".0" * len(column.shape)
            chunks = range(start // rows, -(-(start + self.parts[part]) // rows))
            names += [f"data/{name}/{chunk}{rest}" for chunk in chunks]
        return names

    def _chunk_rows(self, column: Column) -> int:
        rows = _power_below(_CHUNK_BYTES // _bytes_of(column))
        return min(max(rows, 1), self._rows)

    def finish(self, folder: Path) -> None:
        """Nothing is left to do: every part has written its chunks."""


class Zarr(ZarrStore):
    """The format. Observations keep their names, shapes and types; beside them are "action",
    "reward", "done" and, of a task, "success". Of q and v of a scene "q" and "v" have the
    coordinates of joints with a motor, if there are any; "q_privileged", "v_privileged" the rest.

    privileged: observations that a robot could not measure come along.
    """

    def __init__(self, frames: Frames, privileged: bool = False):
        episodes = frames.episodes
        measured, hidden = frames.split()
        sources = {key: key for key in episodes.keys
                   if key in measured or key not in episodes.privileged}  # fmt: skip
        rest = {f"{key}_privileged" if key in measured else key: key for key in hidden}
        sources |= rest if privileged else {}
        self._numbers = {key: places for key, places in measured.items() if key in sources}
        self._numbers |= {f"{key}_privileged": hidden[key] for key in hidden if key in measured}
        others = {"action": "actions", "reward": "rewards", "done": "dones"}
        others |= {"success": "success"} if episodes.task else {}
        clash = [name for name in sources if name in others]
        clash += [name for name in rest if name in episodes.keys and name != rest[name]]
        if clash:
            raise _core.InputError(
                f"{episodes.path}: an observation is called {clash[0]!r}, which the format has for "
                "something else; expected another name of the sensor"
            )
        about, self._sources = attributes_of(frames), sources | others
        said = {"privileged": [name for name in rest if name in sources]}
        super().__init__(frames, {
            name: Column(
                (len(self._numbers[name]),) if name in self._numbers else frames.shapes[source],
                frames.types[source],
                self._chosen(name, about.get(source if source in about else name, {})),
            )
            for name, source in self._sources.items()
        }, said)  # fmt: skip

    def _chosen(self, name: str, about: dict[str, Any]) -> dict[str, Any]:
        """What is said of those numbers of a vector that an array has."""
        if name not in self._numbers:
            return about
        lists = {what: [about[what][k] for k in self._numbers[name]] for what in ("names", "units")}
        return about | lists | {"unit": unit_text(lists["units"])}

    def arrays(self, frames: Arrays, start: int) -> Arrays:
        found = {name: frames[source] for name, source in self._sources.items()}
        taken = {name: places for name, places in self._numbers.items() if name in found}
        return found | {name: found[name][:, places] for name, places in taken.items()}


def attributes_of(frames: Frames) -> dict[str, dict[str, Any]]:
    """NAME → what is said of an array: its unit, its meaning, names of its numbers, its window."""
    episodes, said = frames.episodes, dict[str, dict[str, Any]]()
    for key in episodes.keys:
        unit, meaning = unit_and_meaning(episodes, key)
        said[key] = {name: text for name, text in (("unit", unit), ("meaning", meaning)) if text}
        if key in ("q", "v"):
            for what in ("names", "units"):
                said[key][what] = [str(x) for x in episodes.attributes[f"{key}_{what}"]]
            said[key].setdefault("unit", unit_text(said[key]["units"]))
    for key, window in frames.windows.items():
        said[key]["window"] = window
    said["action"] = {
        "names": [str(name) for name in episodes.attributes["action_names"]],
        "unit": action_unit(episodes),
        "units": action_units(episodes),
        "meaning": str(episodes.attributes.get("action_meaning", "controls")),
    }
    return said


def _bytes_of(column: Column) -> int:
    return max(1, int(np.prod(column.shape)) * column.dtype.itemsize)


def _power_below(number: int) -> int:
    return 1 << (max(number, 1).bit_length() - 1)
