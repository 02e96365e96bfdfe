# SPDX-License-Identifier: Apache-2.0
"""Frames of a data set, as all formats of `tangere.export` write them.

A frame is a row of an episode, or with a window of n the rows j n … (j + 1) n - 1 of it. Then it
has

    observations  of row j n
    touch         of rows (j - 1) n + 1 … j n, the newest last: (n, …). Rows before the first repeat
                  the first one
                  the first one. Where rows are windows of k readings already: (n k, …)
    action        of all n rows, which must be the same
    reward        the sum of those of the n rows
    done, success true in the last frame of an episode

Arrays are those of the files, without a change of type or unit.
"""

from __future__ import annotations

import re
from typing import Any, Collection, Sequence

import numpy as np

from . import _core
from .data import Episodes

Arrays = dict[str, np.ndarray]

_SIZE = re.compile(r"(body|joint) .*(size|radius|length|pos|quat)")  # of shapes, places


class Frames:
    """The frames of chosen episodes of a data set, in order.

    chosen: indices of episodes, which have rows. window: rows of a frame.
    """

    def __init__(self, episodes: Episodes, chosen: Sequence[int], window: int = 1):
        if not isinstance(window, int) or window < 1:
            raise _core.InputError(f"window {window!r}; expected a whole number, 1 or above")
        self.episodes, self.chosen, self.window = episodes, list(chosen), window
        self.lengths = -(-episodes.lengths[self.chosen] // window)
        self.ends = np.cumsum(self.lengths)
        self.solved = set(episodes.succeeded()) if episodes.task else set()
        self.types = {key: rows.dtype for key, rows in self._read(0).items()}
        if window > 1 and not any(self.is_touch(key) for key in episodes.keys):
            raise _core.InputError(
                f"{episodes.path}: window {window} of a data set without a reading of a sensor; "
                f"its observations are {episodes.keys}"
            )
        self.shapes = {key: rows.shape[1:] for key, rows in self.of(0).items()}

    def __len__(self) -> int:
        return int(self.ends[-1])

    @property
    def seconds(self) -> float:
        """Between two frames of an episode [s]."""
        attributes = self.episodes.attributes
        return float(attributes["timestep"]) * int(attributes["every"]) * self.window

    @property
    def bytes(self) -> int:
        """Of the numbers of a frame."""
        return sum(
            int(np.prod(shape)) * self.types[key].itemsize for key, shape in self.shapes.items()
        )

    def name(self, place: int) -> str:
        """Of an episode, for messages."""
        return f"{self.episodes.path}: {self.episodes.names[self.chosen[place]]}"

    def scene_note(self) -> dict[str, Any]:
        """What `tangere view` needs beside the numbers of an export; empty without q."""
        episodes, said = self.episodes, self.episodes.attributes
        if "q" not in episodes.keys:
            return {}
        first = episodes.arrays(self.chosen[0], ["q"])["q"][0]
        note: dict[str, Any] = {
            "name": str(said["name"]), "text": str(said["text"]),
            **({"included": str(said["included"])} if "included" in said else {}),
            "q_names": [str(name) for name in said["q_names"]],
            "q_start": [float(x) for x in first],
            "sensors": {
                name: {"pressure_sign": int(about["pressure_sign"]), "points": _points(about)}
                for name, about in episodes.sensors.items()
            },
        }  # fmt: skip
        drawn = [name for name in map(str, said.get("randomized_names", ())) if _SIZE.match(name)]
        if drawn:
            values = (episodes.randomized(i) for i in self.chosen)
            note["randomized_names"] = drawn
            note["randomized"] = [[of[name] for name in drawn] for of in values]
        return {"scene": note}

    def split(self) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
        """What a robot measures of privileged observations, and what it does not: KEY → places of
        numbers. No places stand for a whole observation. q and v of a scene are in both, where some
        joints have motors."""
        episodes = self.episodes
        measured = {key: places for key in episodes.keys if (places := episodes.measured(key))}
        hidden: dict[str, list[int]] = {}
        for key in episodes.privileged:
            width = len(episodes.attributes[f"{key}_names"]) if key in measured else 0
            rest = [k for k in range(width) if k not in measured[key]]
            if rest or key not in measured:
                hidden[key] = rest
        return measured, hidden

    def is_touch(self, key: str) -> bool:
        """Whether an observation is a reading of a sensor and no picture in colours."""
        episodes = self.episodes
        if self.types[key] == np.uint8:
            return False
        return key in episodes.touch or key.split(".")[0] in episodes.sensors

    def has_window(self, key: str) -> bool:
        """Whether a frame has several readings, along the first axis of its shape."""
        return key in self.episodes.windows or (self.window > 1 and self.is_touch(key))

    @property
    def windows(self) -> dict[str, dict[str, float]]:
        """KEY → count of the readings of a frame, and the time between two of them [s]."""
        apart = self.seconds / self.window
        return {
            key: {
                "readings": self.shapes[key][0],
                "seconds": self.episodes.windows.get(key, apart),
            }
            for key in self.episodes.keys
            if self.has_window(key)
        }

    def pads(self, key: str) -> tuple[int, ...]:
        """The shape of a reading at one time: without the axis of a window."""
        return self.shapes[key][1:] if self.has_window(key) else self.shapes[key]

    def pads_apart(self, key: str, rows: np.ndarray) -> np.ndarray:
        """A reading of frames (t, …) as (t, pads, *shape), with a window (t, pads, n, *shape)."""
        shape = self.pads(key)
        samples = rows.reshape(-1, *shape)
        apart = by_pads(samples) if len(shape) >= 3 else samples[:, None]
        if shape == self.shapes[key]:
            return apart
        return np.moveaxis(apart.reshape(len(rows), -1, *apart.shape[1:]), 1, 2)

    def of(self, place: int) -> Arrays:
        """Observations by key, "actions", "rewards", "dones" and "success" of an episode."""
        arrays = self._read(place)
        return arrays if self.window == 1 else self._windowed(arrays, place)

    def group(self, first: int, last: int) -> Arrays:
        """Those of the episodes first … last - 1, one after the other."""
        parts = [self.of(place) for place in range(first, last)]
        return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}

    def between(self, start: int, stop: int) -> Arrays:
        """Frames start … stop - 1 of all."""
        first, last = (int(np.searchsorted(self.ends, at, "right")) for at in (start, stop - 1))
        before = int(self.ends[first] - self.lengths[first])
        whole = self.group(first, last + 1)
        return {key: rows[start - before : stop - before] for key, rows in whole.items()}

    def _read(self, place: int) -> Arrays:
        episode = self.chosen[place]
        episodes = self.episodes
        arrays = episodes.arrays(episode, [*episodes.keys, "actions", "rewards", "dones"])
        count = len(arrays["actions"])
        for key, rows in arrays.items():
            if len(rows) != count:
                raise _core.InputError(
                    f"{self.name(place)} has {len(rows)} rows of {key!r}; expected {count}, one "
                    "for each action"
                )
        for key in episodes.keys:
            if self._is_stack(key, arrays[key].shape[1:]):
                arrays[key] = np.expand_dims(arrays[key], -2)
        success = np.zeros(count, bool)
        success[-1] = episode in self.solved
        arrays["success"] = success
        return arrays

    def _is_stack(self, key: str, shape: Sequence[int]) -> bool:
        """Whether an observation is that of curved pads, (pads, points, c), which have no rows and
        columns. It is then read as (pads, points, 1, c)."""
        sensors = self.episodes.sensors
        if key in sensors or len(shape) != 3 or shape[-1] > 3:
            return False
        curved = [s for s in sensors.values() if "resolution" not in s]
        return len(curved) == len(sensors) == shape[0] and all(
            _points(s) == shape[1] for s in curved
        )

    def _windowed(self, arrays: Arrays, place: int) -> Arrays:
        n, count = self.window, len(arrays["actions"])
        starts = np.arange(0, count, n)
        taken: Arrays = {}
        for key, rows in arrays.items():
            if key == "rewards":
                taken[key] = np.add.reduceat(rows, starts)
            elif key in ("dones", "success"):
                taken[key] = np.logical_or.reduceat(rows, starts)
            elif key == "actions":
                _check_held(rows, starts, n, self.name(place))
                taken[key] = rows[starts]
            elif self.is_touch(key):
                at = starts[:, None] + np.arange(1 - n, 1)
                found = np.asarray(rows)[np.maximum(at, 0)]
                if key in self.episodes.windows:
                    found[at < 0] = rows[0][0]  # the oldest one
                    found = found.reshape(len(found), -1, *rows.shape[2:])
                taken[key] = found
            else:
                taken[key] = rows[starts]
        return taken


def _points(sensor: dict[str, Any]) -> int:
    return int(np.prod(sensor["resolution"])) if "resolution" in sensor else int(sensor["points"])


def _check_held(actions: np.ndarray, starts: np.ndarray, window: int, name: str) -> None:
    held = np.repeat(actions[starts], window, axis=0)[: len(actions)]
    changed = np.flatnonzero((held != actions).any(axis=1))
    if len(changed):
        raise _core.InputError(
            f"{name}: the action changes in row {changed[0]}, within the {window} rows of a frame; "
            "expected actions that are held as long, or a smaller window"
        )


def by_pads(rows: np.ndarray) -> np.ndarray:
    """A reading in rows and columns, (n, *shape) → (n, pads, rows, cols, c)."""
    shape = rows.shape[1:]
    if shape[-1] <= 3:
        return rows.reshape(len(rows), -1, *shape[-3:])
    channels = int(np.prod(shape[:-2]))
    c = next(c for c in (3, 2, 1) if channels % c == 0)
    return np.moveaxis(rows.reshape(len(rows), -1, c, *shape[-2:]), 2, -1)


def picture_rows(arrays: Arrays, key: str) -> np.ndarray:
    """Pictures in colours, (n, height, width, 3) uint8: the one place where they are read."""
    return np.asarray(arrays[key])


def is_picture(shape: Sequence[int], dtype: Any) -> bool:
    """Whether an observation of this shape of a row is a picture in colours."""
    return dtype == np.uint8 and len(shape) == 3 and shape[-1] == 3


def unit_and_meaning(episodes: Episodes, key: str) -> tuple[str, str]:
    """What a data set says of an observation; empty where it says nothing in one word."""
    said = episodes.attributes
    keys = [str(name) for name in said["observations"]]
    units, meanings = (
        dict(zip(keys, map(str, said.get(f"observation_{name}", []))))
        for name in ("units", "meanings")
    )
    sensor = episodes.sensors.get(key.split(".")[0], {})
    readings = [str(name) for name in sensor.get("readings", [])]
    if key in readings:
        meanings[key] = str(sensor["reading_components"][readings.index(key)])
    unit = units.get(key) or str(episodes.sensors.get(key, {}).get("units", ""))
    return "" if unit.endswith("_units") else unit, meanings.get(key, "")


def action_units(episodes: Episodes) -> list[str]:
    """Of the numbers of an action. Data sets of older versions have one unit, of tasks alone, and
    of scenes none: then each is empty, not known."""
    said = episodes.attributes
    if "action_units" in said:
        return [str(unit) for unit in said["action_units"]]
    return [str(said.get("action_unit", ""))] * len(said["action_names"])


def action_unit(episodes: Episodes) -> str:
    """In one text: "m", or "m, rad, 1" of numbers that differ."""
    return unit_text(action_units(episodes))


def unit_text(units: Sequence[str]) -> str:
    """Of numbers: "m", or "m, rad, 1" of those that differ; empty if one is not known."""
    if not all(units):
        return ""
    return ", ".join(units if len(set(units)) > 1 else units[:1])


def number_units(
    episodes: Episodes, key: str, width: int, places: Sequence[int] = ()
) -> list[str]:
    """Of each number of an observation, or of those `places` of q or v; empty if not known."""
    unit = unit_and_meaning(episodes, key)[0]
    if not unit and key in ("q", "v"):
        units = [str(unit) for unit in episodes.attributes.get(f"{key}_units", ())]
        return [units[k] for k in places] if units and places else units or [""] * width
    return [unit] * (len(places) or width)


def names_of(episodes: Episodes, key: str, places: Sequence[int]) -> list[str]:
    """Names of some numbers of q or v."""
    names = [str(name) for name in episodes.attributes[f"{key}_names"]]
    return [names[k] for k in places]


def hidden_in_words(frames: Frames, written: Collection[str] = ()) -> str:
    """What a robot does not measure, without what is written: "q of rod; v of rod"."""
    words = []
    for key, places in frames.split()[1].items():
        names = names_of(frames.episodes, key, places) if places else []
        joints = dict.fromkeys(name.rpartition(".")[0] for name in names)
        if key not in written:
            words.append(f"{key} of {', '.join(joints)}" if places else key)
    return ("; " if any(" of " in word for word in words) else ", ").join(words)
