# SPDX-License-Identifier: Apache-2.0
"""The features of a LeRobot data set, made of the arrays of an episode or of an environment.

Policies of lerobot read `observation.state`, `observation.environment_state` and pictures. Touch is
written for them as vectors or as pictures. A reading is (…, rows, cols, c) or (points, c) with
c ≤ 3, or (channels, rows, cols):

    mean     of all points, for each pad and component
    grid     means over blocks of k × k points, k the least for which at most 600 numbers are left;
             of (points, c) over k points that follow each other
    picture  round(127.5 + 127.5 x / range), cut at 0 and 255: three components of a pad; without a
             third one this is 128, as 0 is

An observation of bytes (height, width, 3) is a picture already, such as `pad.rgb`, which shows a
gel. Its bytes are written as they are, whatever is said of touch. What else cameras of the scene
see, depths and numbers of bodies, are arrays of their own.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal, Sequence, get_args

import numpy as np

from . import _core
from ._export_frames import Frames, by_pads, is_picture, picture_rows
from .data import Episodes

Touch = Literal["state", "image"]
Pictures = Literal["image", "video"]

BOOKKEEPING = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
STATE, ENVIRONMENT = "observation.state", "observation.environment_state"
_RESERVED = {*BOOKKEEPING, "success"}  # columns and arrays that are not observations
_RESERVED_FIELDS = {"state", "environment_state", "images"}  # what others are joined to
_MOST_NUMBERS = 600  # of a reading in a grid
_PICTURE_AXES = ["height", "width", "channels"]


@dataclass
class Feature:
    """A column: the arrays that it is made of, and what info.json says of it.

    blocks: KEY → points along a side of a block, over which the key's reading is averaged.
    numbers: KEY → places of the numbers of a vector that are taken; others are taken whole.
    pad, range: of a picture of touch: which pad it shows, and for each component x the number that
    255 means; 0 means -x. Without range a picture's bytes are those of the array.
    """

    name: str
    keys: list[str]
    shape: tuple[int, ...]
    dtype: str = "float32"
    names: list[str] | None = None
    blocks: dict[str, int] = field(default_factory=dict)
    numbers: dict[str, list[int]] = field(default_factory=dict)
    pad: int = 0
    range: list[float] = field(default_factory=list)

    @property
    def is_picture(self) -> bool:
        return self.dtype in ("image", "video")

    @property
    def is_video(self) -> bool:
        return self.dtype == "video"

    def rows(self, arrays: dict[str, np.ndarray]) -> np.ndarray:
        """(rows, *shape), of a picture as uint8."""
        if self.is_picture and not self.range:
            return picture_rows(arrays, self.keys[0])
        if self.is_picture:
            shown = 127.5 + 127.5 * _pad(arrays[self.keys[0]], self.pad) / np.asarray(self.range)
            whole = np.full((len(shown), *self.shape), 128, np.uint8)
            whole[..., : shown.shape[-1]] = np.clip(np.rint(shown), 0, 255)
            return whole
        parts = []
        for key in self.keys:
            part = np.asarray(arrays[key])
            part = block_means(part, self.blocks[key]) if key in self.blocks else part
            part = part[:, self.numbers[key]] if key in self.numbers else part
            parts.append(part.astype(self.dtype, copy=False))
        if len(parts) > 1:
            parts = [np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)]
        return parts[0].reshape(len(parts[0]), *self.shape)

    def described(self) -> dict[str, Any]:
        return {"dtype": self.dtype, "shape": list(self.shape), "names": self.names}

    def recipe(self) -> dict[str, Any]:
        """From which `Feature(**recipe)` makes the feature again."""
        return {name: value for name, value in asdict(self).items() if value not in ({}, [], None)}


def _grid_axes(shape: Sequence[int]) -> tuple[int, ...]:
    """The axes of a reading, without that of the frames, along which points lie side by side."""
    last = len(shape) - 1
    if shape[-1] > 3:
        return (last - 1, last)
    return (last - 2, last - 1) if last >= 2 else (0,)


def block_means(rows: np.ndarray, block: int) -> np.ndarray:
    """Means over blocks of points; rows (n, *shape). The last block of a side may be smaller."""
    means = rows.astype(np.float64)
    for axis in (1 + at for at in _grid_axes(rows.shape[1:])):
        starts = np.arange(0, rows.shape[axis], block)
        sizes = np.diff([*starts, rows.shape[axis]])
        means = np.add.reduceat(means, starts, axis)
        means /= sizes.reshape([-1 if a == axis else 1 for a in range(means.ndim)])
    return means


def _blocked(shape: Sequence[int], block: int) -> tuple[int, ...]:
    axes = _grid_axes(shape)
    return tuple(-(-n // block) if axis in axes else n for axis, n in enumerate(shape))


def _least_block(shape: Sequence[int]) -> int:
    longest = max(shape[axis] for axis in _grid_axes(shape))
    fits = (k for k in range(1, longest) if np.prod(_blocked(shape, k)) <= _MOST_NUMBERS)
    return next(fits, longest)


def _pad(rows: np.ndarray, pad: int) -> np.ndarray:
    return np.asarray(by_pads(np.asarray(rows))[:, pad], np.float64)


def features_of(
    frames: Frames, privileged: bool, touch: Touch | None, pictures: Pictures = "image"
) -> list[Feature]:
    """The features of a data set, without those for bookkeeping. `pictures`: in rows or as video.

    Vectors become one state, as policies of lerobot expect. Pictures in colours stay what they are.
    Fields keep their shape, unless `touch` says how a policy reads them. Raises InputError for
    names that the format uses, and for touch that cannot be written so.
    """
    if touch not in (None, *get_args(Touch)):
        raise _core.InputError(f"touch {touch!r}; expected None, 'state' or 'image'")
    if pictures not in get_args(Pictures):
        raise _core.InputError(f"pictures {pictures!r}; expected 'image' or 'video'")
    episodes, shapes = frames.episodes, frames.shapes
    for key in episodes.keys:
        if key in _RESERVED or (key in _RESERVED_FIELDS and len(shapes[key]) > 1):
            raise _core.InputError(
                f"{episodes.path}: an observation is called {key!r}, which the format has for "
                "something else; expected another name of the sensor"
            )
    shown = [key for key in episodes.keys if is_picture(shapes[key], frames.types[key])]
    seen = [key for key in episodes.keys if key not in episodes.privileged and key not in shown]
    fields = [key for key in seen if len(shapes[key]) > 1]
    felt = [key for key in fields if frames.is_touch(key)]
    if touch and not felt:
        raise _core.InputError(
            f"{episodes.path}: touch {touch!r} of a data set without a reading of a sensor that "
            f"is no picture in colours; its observations are {episodes.keys}"
        )
    _check_window(frames, felt if touch else [], touch)
    measured, rest = frames.split()
    hidden = [key for key in [*rest] if privileged and key not in shown]
    if touch is None:
        vectors = [k for k in episodes.keys if k in measured or (k in seen and k not in fields)]
        features = _joined(STATE, vectors, episodes, shapes, numbers=measured)
        features += [Feature(f"observation.{key}", [key], shapes[key]) for key in fields]
        features += _joined(ENVIRONMENT, hidden, episodes, shapes, numbers=rest)
    else:
        whole = {key: max(shapes[key]) for key in felt}
        grid = {key: _least_block(shapes[key]) for key in felt} if touch == "state" else {}
        views = [key for key in fields if key.rpartition(".")[0] in episodes.cameras]
        plain = [
            key for key in episodes.keys
            if key in measured or (key in seen and key not in felt and key not in views)
        ]  # fmt: skip
        features = _joined(STATE, plain + felt, episodes, shapes, whole, measured)
        features += _joined(ENVIRONMENT, [*grid, *hidden], episodes, shapes, grid, rest)
        features += [Feature(f"observation.{key}", [key], shapes[key]) for key in views]
        if touch == "image":
            features += [picture for key in felt for picture in _pictures(key, frames)]
    features += [
        Feature(f"observation.images.{key}", [key], shapes[key], pictures, _PICTURE_AXES)
        for key in shown
        if privileged or key not in episodes.privileged
    ]
    action = [str(name) for name in episodes.attributes["action_names"]]
    if not action:
        raise _core.InputError(
            f"{episodes.path}: its scene has no motor, so no action; expected an action for LeRobot"
        )
    features.append(Feature("action", ["actions"], (len(action),), names=action))
    features.append(Feature("next.reward", ["rewards"], (1,)))
    features.append(Feature("next.done", ["dones"], (1,), "bool"))
    if episodes.task:
        features.append(Feature("next.success", ["success"], (1,), "bool"))
    names = [feature.name for feature in features]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise _core.InputError(f"{episodes.path}: two observations would be called {twice.pop()}")
    return features


def _joined(
    name: str, keys: Sequence[str], episodes: Episodes, shapes: dict[str, tuple[int, ...]],
    blocks: dict[str, int] | None = None, numbers: dict[str, list[int]] | None = None,
) -> list[Feature]:  # fmt: skip
    """One vector of all `keys`, or none if there are no keys."""
    blocks = blocks or {}
    taken = {key: places for key, places in (numbers or {}).items() if key in keys and places}
    names: list[str] = []
    for key in keys:
        shape = _blocked(shapes[key], blocks[key]) if key in blocks else shapes[key]
        mean = key in blocks and blocks[key] >= max(shapes[key])
        if key in ("q", "v"):
            said = [str(name) for name in episodes.attributes[f"{key}_names"]]
            names += [said[k] for k in taken[key]] if key in taken else said
        elif shape == (1,):
            names.append(key)
        else:
            axes = [a for a in range(len(shape)) if not (mean and a in _grid_axes(shapes[key]))]
            title = f"{key}.mean" if mean else key
            names += [title + "".join(f"[{at[a]}]" for a in axes) for at in np.ndindex(*shape)]
    if not keys:
        return []
    return [Feature(name, list(keys), (len(names),), names=names, blocks=blocks, numbers=taken)]


def _check_window(frames: Frames, felt: Sequence[str], touch: Touch | None) -> None:
    """Raises InputError where a window of touch has no form that a policy reads."""
    for key in filter(frames.has_window, felt):
        if touch == "image" or len(frames.pads(key)) < 3:
            raise _core.InputError(
                f"{frames.episodes.path}: touch {touch!r} of {key!r}, {frames.pads(key)}, with a "
                f"window of {frames.shapes[key][0]}; expected touch 'state' of rows and columns, "
                "or none"
            )


def _pictures(key: str, frames: Frames) -> list[Feature]:
    """One picture for each pad. Its range is the largest number of the component, of all pads."""
    shape = frames.shapes[key]
    if len(_grid_axes(shape)) != 2 or shape[-2] == 1:
        raise _core.InputError(
            f"{frames.episodes.path}: touch 'image' of {key!r}, (points, {shape[-1]}), which has "
            "no rows and columns; expected touch 'state'"
        )
    fields = (frames.of(place)[key] for place in range(len(frames.chosen)))
    most = np.max([by_pads(np.abs(field)).max((0, 1, 2, 3)) for field in fields], axis=0)
    pads, rows, cols = by_pads(frames.of(0)[key]).shape[1:4]
    return [
        Feature(
            f"observation.images.{key}" + (f"_{pad}" if pads > 1 else ""), [key], (rows, cols, 3),
            "image", _PICTURE_AXES, pad=pad, range=[float(x) if x > 0 else 1.0 for x in most],
        )
        for pad in range(pads)
    ]  # fmt: skip
