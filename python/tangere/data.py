# SPDX-License-Identifier: Apache-2.0
"""Data sets of `tangere generate` for learning: windows of rows, scaled, as PyTorch reads them.

Needs h5py (`pip install h5py`). PyTorch is not needed: `Windows` has the interface of
`torch.utils.data.Dataset`, and its items are NumPy arrays, which PyTorch's loader collates.
"""

from __future__ import annotations

import json
import os
from collections import OrderedDict
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Iterator, Literal, Sequence

import h5py
import numpy as np

from . import _core
from ._generate import generate

__all__ = ["Episodes", "Windows", "generate"]

Form = Literal["stored", "image", "points"]
Scale = Literal["task", "standard", "none"]

_LZ4 = 32004  # HDF5's number of a filter, which h5py does not have
if not h5py.h5z.filter_avail(_LZ4):
    h5py.h5z.register_filter(_core.lz4_filter())

_CACHED_BYTES = 1 << 28  # of arrays in chunks, which cannot be mapped
_FLOOR = 0.05  # of a key's root mean square: the least standard deviation that is divided by


class Episodes:
    """The episodes of a data set: `episodes[i]["tactile"]` is (rows, …).

    `path` is a folder of `tangere generate`, whose shards are read, or one file: a shard or
    robomimic.hdf5. Contiguous arrays of shards are mapped, not read: an array is a view of the
    file. Large fields in tiles and compressed ones are read, JPEG files become pictures, and up to
    256 MB are kept. A process opens the files for itself, so an object may go to the workers of a
    loader.

    `windows`: of observations whose rows are windows, (rows, readings, …), the newest reading last:
    KEY → time between two readings [s].
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        one = self.path.is_file()
        self.files = [self.path] if one else sorted(self.path.glob("shard-*.h5"))  #: that are read
        if not self.files:
            what = "no shard-*.h5" if self.path.exists() else "it does not exist"
            raise _core.IoError(
                f"{self.path}: {what}; expected a folder of `tangere generate`, or one of its files"
            )
        self.masks = self.path if one else self.path / "robomimic.hdf5"
        self.names: list[str] = []  # demo_0, demo_1 … in order
        self._shard_of: list[int] = []
        lengths: list[int] = []
        self.attributes: dict[str, Any] = {}
        self.content = 0  # the checksum of all numbers, as of robomimic.hdf5
        found = []
        for number, shard in enumerate(self.files):
            with _damage_named(shard), h5py.File(shard, "r") as file:
                if number == 0:
                    if "dataset_shards" not in file.attrs:
                        raise _core.IoError(f"{shard} is no file of `tangere generate`")
                    expected = 1 if one else int(file.attrs["dataset_shards"])
                    if expected != len(self.files):
                        raise _core.IoError(
                            f"{self.path} has {len(self.files)} shards of {expected}; expected "
                            "all, see `tangere generate --resume`"
                        )
                    self.attributes = dict(file["scene"].attrs)
                    self.command = str(file.attrs["command"])
                    self._mapped = "mask" not in file  # else its numbers lie in other files
                    self._describe(file)
                    sensors = file["scene"].get("sensors", {})
                    self.sensors = {name: dict(sensors[name].attrs) for name in sensors}
                    for name in sensors:  # of a curved pad
                        if "position" in sensors[name]:
                            self.sensors[name]["points"] = len(sensors[name]["position"])
                    cameras = file["scene"].get("cameras", {})
                    self.cameras = {name: dict(cameras[name].attrs) for name in cameras}
                self.content = (self.content + int(file.attrs.get("content_sum", 0))) % 2**64
                for name, demo in file["data"].items():
                    rows = int(demo.attrs["num_samples"])
                    found.append((int(name.removeprefix("demo_")), name, number, rows))
        if not one:
            _core.check_dataset(self.path)
        for _, name, number, rows in sorted(found):
            self.names.append(name)
            self._shard_of.append(number)
            lengths.append(rows)
        self.lengths = np.asarray(lengths)
        self._index = {name: i for i, name in enumerate(self.names)}
        self._process = os.getpid()
        self._maps: dict[int, np.ndarray] = {}
        self._files: dict[int, h5py.File] = {}
        self._rows: dict[str, tuple[tuple[int, ...], np.dtype]] = {}  # shape of a row, type
        self._open: OrderedDict[int, dict[str, np.ndarray]] = OrderedDict()
        self._held = 0  # bytes of arrays in _open that are no views of a file

    def _describe(self, file: h5py.File) -> None:
        scene = file["scene"].attrs
        self.keys = [str(key) for key in scene["observations"]]
        self.task = str(scene["task"]) if "success" in scene else ""  # of a scene alone
        self.scale: dict[str, Any] = {key: 1.0 for key in self.keys}
        self.privileged = [key for key in ("q", "v") if key in self.keys]
        self.actuated = json.loads(scene.get("actuated_joints", "[]"))  # joints with a motor
        self.touch: list[str] = []
        steps = zip(scene.get("windows", ()), scene.get("window_every", ()))
        self.windows = {str(key): float(scene["timestep"]) * int(every) for key, every in steps}
        if "observation_scale" in scene:  # format version 4 on
            self.scale.update(json.loads(scene["observation_scale"]))
            self.privileged = json.loads(scene["privileged"])
            self.touch = json.loads(scene.get("touch", "[]"))  # format version 5 on
        elif self.task:
            raise _core.InputError(
                f"{self.path}: a data set of an older version, without scales of observations; "
                "make it again with `tangere generate`"
            )

    def __len__(self) -> int:
        return len(self.names)

    def named(self, names: Sequence[str]) -> list[int]:
        """Indices of demos by name."""
        return [self._index[name] for name in names]

    def mask(self, name: str) -> list[int]:
        """The episodes of a mask of robomimic.hdf5: train, valid, success …"""
        if not self.masks.exists():
            raise _core.IoError(
                f"{self.masks} is missing; expected a merged data set (tangere merge)"
            )
        with h5py.File(self.masks, "r") as file:
            known = list(file.get("mask", ()))
            if name not in known:
                raise _core.InputError(f"{self.masks}: no mask {name!r}; it has {known}")
            rows = file["mask"][name]
            if not isinstance(rows, h5py.Dataset) or rows.dtype.kind not in "SO" or rows.ndim != 1:
                raise _core.InputError(
                    f"{self.masks}: mask {name!r} is no list of texts; expected names of demos, "
                    "such as 'demo_3'"
                )
            names = [n.decode() for n in rows[()]]
        _core.check_mask(self.masks, name)
        lost = [n for n in names if n not in self._index]
        if lost:
            raise _core.InputError(
                f"{self.masks}: mask {name!r} names {lost[0]}, which the data set does not have"
            )
        return self.named(names)

    def succeeded(self) -> list[int]:
        """The episodes that ended in success."""
        return [i for i in range(len(self)) if self._demo(i).attrs.get("success", 0) == 1]

    def felt(self) -> np.ndarray:
        """Rows of each episode in which something is felt, (episodes) int64.

        Raises InputError if the data set has no observation that is touch.
        """
        if not self.touch:
            raise _core.InputError(
                f"{self.path} does not say where something is felt; expected a data set of format "
                "version 5 that stores touch"
            )
        return np.array([int(self._demo(i).attrs["touching"]) for i in range(len(self))])

    def picture_gains(self, episode: int) -> dict[str, np.ndarray]:
        """Factors that an episode drew for the channels of its pictures: the name of a sensor or
        camera → (3), R, G, B. Empty where no picture has `gain`."""
        if "picture_gain_names" not in self.attributes:
            return {}
        gains = np.asarray(self._demo(episode).attrs["picture_gains"]).reshape(-1, 3)
        names = [str(name).rpartition(" ")[0] for name in self.attributes["picture_gain_names"]]
        return dict(zip(names[::3], gains, strict=True))

    def randomized(self, episode: int) -> dict[str, float]:
        """Name → what `<randomize>` drew for an episode. Empty where the scene draws nothing."""
        names = [str(name) for name in self.attributes.get("randomized_names", ())]
        values = self._demo(episode).attrs["randomized"] if names else ()
        return dict(zip(names, map(float, values), strict=True))

    def driven(self, key: str) -> list[int]:
        """Places of the numbers of "q" or "v" that belong to joints that motors move."""
        names = (str(name) for name in self.attributes[f"{key}_names"])
        return [k for k, name in enumerate(names) if name.rpartition(".")[0] in self.actuated]

    def measured(self, key: str) -> list[int]:
        """Those of a privileged "q" or "v" of a scene that a robot measures: see `driven`. A task
        declares what it shows, so there are none of it."""
        if self.task or key not in ("q", "v") or key not in self.privileged:
            return []
        return self.driven(key)

    def terminated(self, episode: int) -> bool:
        """Whether the task ended the episode; False if it ran out of time, and for a scene."""
        return bool(self._demo(episode).attrs.get("terminated", 0))

    def final(self, episode: int) -> dict[str, np.ndarray]:
        """The observations after the last action, KEY → (1, …)."""
        last = self._demo(episode)["final_obs"]
        return {key: _values(last[key]) for key in last}

    def samples(self, episode: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """What is not stored at every row: KEY → (rows, array), both of one length.

        Row R of an episode of R actions is the last state. Empty for most data sets.
        """
        if "samples" not in self.attributes:
            return {}
        stored = self._demo(episode)["samples"]
        every = int(self.attributes["every"])
        taken = {}
        for key, steps in zip(self.attributes["samples"], self.attributes["sample_every"]):
            last = int(self.lengths[episode])
            rows = np.arange(0, last + 1, int(steps) // every) if steps else np.array([last])
            taken[str(key)] = (rows, _values(stored[str(key)]))
        return taken

    def __getitem__(self, episode: int) -> dict[str, np.ndarray]:
        """Arrays by name: the observations, "actions", "rewards", and derivatives if stored.

        Raises InputError if an observation has the name of one of the other arrays.
        """
        self._here()
        if episode in self._open:
            self._open.move_to_end(episode)
            return self._open[episode]
        demo = self._demo(episode)
        again = {key.replace(".", "_") for key in self.keys} - set(self.keys)  # merged files have
        with self._reading(episode):
            arrays = {key: self._array(episode, demo["obs"][key])
                      for key in demo["obs"] if key not in again}  # fmt: skip
        for name, item in demo.items():
            if not isinstance(item, h5py.Dataset):
                continue
            if name in arrays:
                raise _core.InputError(
                    f"{self.path}: an observation is called {name!r}, as an array of every episode "
                    "is; expected another name of the sensor"
                )
            with self._reading(episode):
                arrays[name] = self._array(episode, item)
        self._open[episode] = arrays
        self._held += _copied(arrays)
        while self._held > _CACHED_BYTES and len(self._open) > 1:
            self._held -= _copied(self._open.popitem(last=False)[1])
        return arrays

    def arrays(self, episode: int, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Some of the arrays that `episodes[episode]` has: quicker for many episodes in order."""
        with self._reading(episode):
            if not self._mapped or episode in self._open:
                whole = self[episode]
                return {name: whole[name] for name in names}
            demo = self._demo(episode).id
            return {name: self._plain(episode, demo, name) for name in names}

    def _plain(self, episode: int, demo: h5py.h5g.GroupID, name: str) -> np.ndarray:
        """An array of an episode, without what h5py's own objects of it cost."""
        stored = h5py.h5d.open(demo, (f"obs/{name}" if name in self.keys else name).encode())
        if name not in self._rows:
            like = h5py.Dataset(stored)
            self._rows[name] = (like.shape[1:], like.dtype)
        shape, dtype = self._rows[name]
        if stored.get_offset() is None or dtype.kind not in "fiub":
            return _values(h5py.Dataset(stored))
        raw = self._bytes(episode, stored.get_offset(), stored.get_storage_size())
        return raw.view(dtype).reshape(-1, *shape)

    def _reading(self, episode: int) -> AbstractContextManager[None]:
        return _damage_named(self.files[self._shard_of[episode]])

    def _here(self) -> None:
        """After a fork the child opens its own files: HDF5 does not share them."""
        if self._process != os.getpid():
            self.__dict__.update(self.__getstate__(), _process=os.getpid())

    def _demo(self, episode: int) -> h5py.Group:
        self._here()
        number = self._shard_of[episode]
        with self._reading(episode):
            if number not in self._files:
                self._files[number] = h5py.File(self.files[number], "r")
            return self._files[number]["data"][self.names[episode]]

    def _array(self, episode: int, dataset: h5py.Dataset) -> np.ndarray:
        offset = dataset.id.get_offset()
        plain = offset is not None and dataset.dtype.kind in "fiu" and dataset.size > 0
        if not (plain and self._mapped):
            return _values(dataset)
        part = self._bytes(episode, offset, dataset.size * dataset.dtype.itemsize)
        return part.view(dataset.dtype).reshape(dataset.shape)

    def _bytes(self, episode: int, offset: int, size: int) -> np.ndarray:
        number = self._shard_of[episode]
        if number not in self._maps:
            # As a plain array: views of the other kind take as long as a small dataset.
            self._maps[number] = np.memmap(self.files[number], mode="r").view(np.ndarray)
        return self._maps[number][offset : offset + size]

    def __getstate__(self) -> dict[str, Any]:
        empty: dict[str, Any] = {"_maps": {}, "_files": {}, "_rows": {}, "_open": OrderedDict()}
        return self.__dict__ | empty | {"_held": 0}


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    """What reading a damaged file raises becomes an IoError that names the file."""
    try:
        yield
    except (_core.InputError, _core.IoError, FileNotFoundError, PermissionError):
        raise
    except (OSError, KeyError, RuntimeError, TypeError, ValueError) as error:
        raise _core.IoError(
            f"'{path}' is damaged: {error}; `tangere validate` says what is wrong with it"
        ) from error


def _values(dataset: h5py.Dataset) -> np.ndarray:
    """What a dataset holds; JPEG files as pictures (rows, height, width, 3) uint8."""
    if dataset.dtype.kind != "S":
        return dataset[()]
    return _core.decode_jpeg(dataset[()].tolist(), f"{dataset.file.filename}: {dataset.name}")


def _copied(arrays: dict[str, np.ndarray]) -> int:
    return sum(a.nbytes for a in arrays.values() if a.flags.owndata)


def _kept(rows: np.ndarray) -> type:
    """The type in which rows are kept: bytes of pictures as they are."""
    return np.uint8 if rows.dtype == np.uint8 and rows.ndim == 4 else np.float32


def _none_left(
    episodes: Episodes, mask: str | None, only_success: bool, purpose: str
) -> _core.InputError:
    """An error that says which episodes were to be there for a purpose."""
    wanted = f"mask {mask!r}" if mask is not None else "all"
    if only_success:
        wanted += ", those that succeeded"
    return _core.InputError(f"{episodes.path}: no episode is left to {purpose} of {wanted}")


class Windows:
    """Windows of rows of a data set, with the interface of `torch.utils.data.Dataset`.

    Item i is {"obs": {KEY: (before + 1, …)}, "past_actions": (before, na), "actions": (ahead, na),
    "mask": (ahead)}: the observations up to one row, oldest first, the actions between them, and
    the actions from that row on. Rows before the start repeat the first observation, with actions
    of 0. Actions after the end repeat the last one, and `mask` is 0 there.
    Observations are float32, pictures in colours uint8 unless they are scaled. `gradients`: names
    of derivatives stored for each action, such as "grad_actions", that come along as (ahead, …).

    Parameters
    ----------
    path: a folder of `tangere generate`, one of its files, or an `Episodes`.
    keys: observations to give. None: those that the task shows; of a bare scene all but q, v and
        motions of bodies.
    before, ahead: rows before the present one, and actions from it on.
    split: a mask of robomimic.hdf5, such as "train" or "valid"; None for all episodes.
    only_success: leave out episodes that did not succeed.
    form: of readings with a last axis of 3 and at least two before it: "stored", "image" (the last
        axis first), or "points" (…, points, 3). The axis of a window stays in front of the points.
    scale: "task" divides by the scales that the task declares, "standard" takes `mean` away and
        divides by `std`, "none" leaves SI units. `mean` and `std` are of the chosen episodes, or
        those of `statistics`: a validation set takes the ones of its training set.
    memory: bytes of rows that may be kept in memory, over all keys. What does not fit is read from
        the files window by window, which is slower.
    """

    def __init__(
        self,
        path: str | Path | Episodes,
        keys: Sequence[str] | None = None,
        before: int = 0,
        ahead: int = 1,
        split: str | None = "train",
        only_success: bool = False,
        form: Form = "stored",
        scale: Scale = "task",
        gradients: Sequence[str] = (),
        statistics: Windows | None = None,
        memory: float = 2e9,
    ):
        self.episodes = path if isinstance(path, Episodes) else Episodes(path)
        for value, name, known in (
            (form, "form", ("stored", "image", "points")),
            (scale, "scale", ("task", "standard", "none")),
        ):
            if value not in known:
                raise _core.InputError(f"{name} {value!r}; expected one of {known}")
        if before < 0 or ahead < 1:
            raise _core.InputError(f"before {before}, ahead {ahead}; expected at least 0 and 1")
        if isinstance(keys, str):
            raise _core.InputError(f"keys {keys!r}; expected a list, such as [{keys!r}]")
        default = [
            key for key in self.episodes.keys
            if key not in ("q", "v")
            and not (key.split(".")[0] == "bodies" and key in self.episodes.privileged)
        ]  # fmt: skip
        self.keys = list(keys) if keys is not None else default
        unknown = [key for key in self.keys if key not in self.episodes.keys]
        if unknown or not self.keys:
            raise _core.InputError(f"keys {unknown}; the data set has {self.episodes.keys}")
        self.before, self.ahead, self.form, self.scale = before, ahead, form, scale
        self.gradients = list(gradients)
        chosen = range(len(self.episodes)) if split is None else self.episodes.mask(split)
        if only_success:
            solved = set(self.episodes.succeeded())
            chosen = [i for i in chosen if i in solved]
        self.chosen = np.asarray([i for i in chosen if self.episodes.lengths[i] > 0], int)
        if len(self.chosen) == 0:
            raise _none_left(self.episodes, split, only_success, "learn from")
        self._ends = np.cumsum(self.episodes.lengths[self.chosen])
        self._statistics: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._flat: dict[str, np.ndarray | None] = {}  # by name; None: too large for memory
        self._free = memory
        self._like = statistics
        self._shift: dict[str, np.ndarray] = {}
        self._factor: dict[str, np.ndarray] = {}
        for key in self.keys:
            shift, by = np.asarray(0, np.float32), np.asarray(1.0)
            if scale == "task":
                by = np.asarray(self.episodes.scale[key], float)
            elif scale == "standard":
                shift, by = self.mean[key].astype(np.float32), self.std[key]
            self._shift[key] = shift
            self._factor[key] = (1 / by).astype(np.float32)

    def __len__(self) -> int:
        return int(self._ends[-1])

    @property
    def mean(self) -> dict[str, np.ndarray]:
        """KEY → mean of its rows, per place on the last axis."""
        return {key: self._moments(key)[0] for key in self.keys}

    @property
    def std(self) -> dict[str, np.ndarray]:
        """KEY → standard deviation, at least 5 % of the key's root mean square."""
        return {key: self._moments(key)[1] for key in self.keys}

    def _moments(self, key: str) -> tuple[np.ndarray, np.ndarray]:
        if self._like is not None:
            return self._like._moments(key)
        if key not in self._statistics:
            count, total, square = 0, np.zeros(1), np.zeros(1)
            for episode in self.chosen:
                rows = np.asarray(self.episodes[episode][key], float)
                rows = rows.reshape(-1, rows.shape[-1])
                count += len(rows)
                total = total + rows.sum(0)
                square = square + (rows**2).sum(0)
            mean, power = total / count, square / count
            floor = _FLOOR * np.sqrt(power.mean())
            std = np.sqrt(np.maximum(power - mean**2, max(floor, 1e-12) ** 2))
            self._statistics[key] = mean, std
        return self._statistics[key]

    def __getitem__(self, item: int) -> dict[str, Any]:
        return self.__getitems__([item])[0]

    def __getitems__(self, items: Sequence[int]) -> list[dict[str, Any]]:
        """Many at once: newer loaders of PyTorch ask for a batch so."""
        batch = self.gather(np.asarray(items))
        return [
            {"obs": {key: values[i] for key, values in batch["obs"].items()}}
            | {name: values[i] for name, values in batch.items() if name != "obs"}
            for i in range(len(items))
        ]

    def batches(
        self, size: int, seed: int = 0, rows: int | None = None
    ) -> Iterator[dict[str, Any]]:
        """Yields whole batches in random order, arrays as in an item with the batch in front.

        Much quicker than a loader that collates items. `rows`: how many windows to give, None for
        each once.
        """
        order = np.random.default_rng(seed).permutation(len(self))
        order = order[:rows] if rows is not None else order
        for first in range(0, len(order), size):
            yield self.gather(order[first : first + size])

    def gather(self, items: np.ndarray) -> dict[str, Any]:
        """The windows `items`, (n), stacked."""
        items = np.asarray(items)
        if items.size and not (0 <= items.min() and items.max() < len(self)):
            raise IndexError(f"windows {items.min()} to {items.max()}; there are {len(self)}")
        places = np.searchsorted(self._ends, items, side="right")
        first = np.concatenate([[0], self._ends])[places][:, None]
        last = self._ends[places][:, None] - 1
        rows = np.maximum(items[:, None] + np.arange(-self.before, 1), first)
        after = items[:, None] + np.arange(self.ahead)
        actions = np.minimum(after, last)
        past = items[:, None] + np.arange(-self.before, 0)
        batch: dict[str, Any] = {
            "obs": {key: self._shown(key, self._rows(key, rows)) for key in self.keys},
            "past_actions": self._rows("actions", np.maximum(past, first))
            * (past >= first)[..., None].astype(np.float32),
            "actions": self._rows("actions", actions),
            "mask": (after <= last).astype(np.float32),
        }
        return batch | {name: self._rows(name, actions) for name in self.gradients}

    def _rows(self, name: str, rows: np.ndarray) -> np.ndarray:
        """Rows of an array, counted over the chosen episodes, (…, shape): float32, or bytes."""
        if name not in self._flat:
            self._flat[name] = self._flattened(name)
        flat = self._flat[name]
        if flat is not None:
            return flat[rows]
        wanted, back = np.unique(rows, return_inverse=True)
        places = np.searchsorted(self._ends, wanted, side="right")
        starts = np.concatenate([[0], self._ends])[places]
        parts = [
            self._of_episode(place, name)[wanted[places == place] - starts[places == place]]
            for place in np.unique(places)
        ]
        found = np.concatenate(parts)
        found = found.astype(_kept(found), copy=False)[back]
        return found.reshape(*rows.shape, *parts[0].shape[1:])

    def _flattened(self, name: str) -> np.ndarray | None:
        """All rows in memory, if they are few enough."""
        first = self._of_episode(0, name)
        shape = first.shape[1:]
        kind: np.dtype[Any] = np.dtype(_kept(first))
        size = len(self) * int(np.prod(shape)) * kind.itemsize
        if size > self._free:
            return None
        self._free -= size
        flat = np.empty((len(self), *shape), kind)
        for place, end in enumerate(self._ends):
            rows = self._of_episode(place, name)
            flat[end - len(rows) : end] = rows
        return flat

    def _of_episode(self, place: int, name: str) -> np.ndarray:
        arrays = self.episodes[int(self.chosen[place])]
        if name not in arrays:
            raise _core.InputError(f"the data set has no {name!r}; it has {sorted(arrays)}")
        return arrays[name]

    def __getstate__(self) -> dict[str, Any]:
        kept = sum(a.nbytes for a in self._flat.values() if a is not None)
        return {**self.__dict__, "_flat": {}, "_free": self._free + kept}

    def _shown(self, key: str, rows: np.ndarray) -> np.ndarray:
        """Rows (…, rows, shape) of an observation, scaled and in the form that was asked for."""
        shown = rows
        scaled = (self._shift[key] != 0).any() or (self._factor[key] != 1).any()
        if rows.dtype != np.uint8 or scaled:
            shown = (np.asarray(rows, np.float32) - self._shift[key]) * self._factor[key]
        shape = self._of_episode(0, key).shape[1:]
        points = len(shape) - (key in self.episodes.windows)  # axes of a reading
        if self.form == "stored" or points < 3 or shape[-1] != 3:
            return shown
        if self.form == "points":
            window = shape[:1] if key in self.episodes.windows else ()
            return shown.reshape(*shown.shape[: -len(shape)], *window, -1, 3)
        return np.moveaxis(shown, -1, -len(shape))
