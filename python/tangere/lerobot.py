# SPDX-License-Identifier: Apache-2.0
"""Data sets of `tangere generate` as LeRobotDataset v3.0, which lerobot and torchrl load.

    python -m tangere.lerobot out/pushes out/pushes_lerobot

Needs h5py and pyarrow (`pip install tangere[data]`). A frame is a row of the data set: what was
observed, the action that followed, its reward, and whether the episode ended with it in success.
Numbers are those of the files, in SI units and as float32. The same data set gives the same bytes
with one release of pyarrow.

The folder appears under its name when it is complete. Until then it is called OUT.part.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Sequence

import numpy as np

from . import _core
from ._lerobot_files import BOOKKEEPING, CHUNK, Feature, FrameWriter, new_folder, write_json
from ._lerobot_files import write_task
from .data import Episodes

_VERSION = "v3.0"
_RESERVED = {*BOOKKEEPING, "success"}  # columns and arrays that are not observations
_RESERVED_FIELDS = {"state", "environment_state"}  # what vectors are joined to


@dataclass
class Exported:
    """What `export` has written."""

    output: str
    episodes: int
    frames: int
    files: int  #: of frames
    fps: int  #: frames a second
    seconds_per_action: float  #: 1/fps, unless that was no whole number
    features: list[str]


def export(
    data: str | Path | Episodes,
    output: str | Path,
    *,
    mask: str | None = None,
    only_success: bool = False,
    privileged: bool = False,
    task: str | None = None,
    fps: int | None = None,
    overwrite: bool = False,
    file_megabytes: float = 100,
) -> Exported:
    """Writes a data set as LeRobotDataset v3.0 into the new folder `output`.

    Parameters
    ----------
    data: a folder of `tangere generate`, one of its files, or an `Episodes`.
    mask: a mask of robomimic.hdf5, such as "train"; None for all episodes.
    only_success: leave out episodes that did not succeed.
    privileged: observations that a robot could not measure come along, as
        `observation.environment_state`.
    task: the text of the task, which language-conditioned policies read. None: the name of the
        task and what its success means.
    fps: frames a second. None: actions a second, rounded to a whole number, which the format
        wants. Time stamps are multiples of 1/fps.
    overwrite: replace a data set that is there.
    file_megabytes: a file of frames ends with the episode that brings it beyond this size.

    Raises InputError for a data set without episodes and for options that do not fit it, IoError or
    OSError if reading or writing fails. Nothing is left under the name `output` then.
    """
    episodes = data if isinstance(data, Episodes) else Episodes(data)
    chosen = list(range(len(episodes))) if mask is None else episodes.mask(mask)
    solved = set(episodes.succeeded()) if episodes.task else set()
    if only_success and not episodes.task:
        raise _core.InputError(f"{episodes.path}: only_success of a scene, which has no task")
    chosen = [i for i in chosen if episodes.lengths[i] and (i in solved or not only_success)]
    if not chosen:
        raise _core.InputError(f"{episodes.path}: no episode is left to write")
    seconds = float(episodes.attributes["timestep"]) * int(episodes.attributes["every"])
    if fps is None:
        fps = max(1, round(1 / seconds))
    if not isinstance(fps, int) or fps < 1:
        raise _core.InputError(f"fps {fps!r}; expected a whole number, 1 or above")
    if not file_megabytes > 0:
        raise _core.InputError(f"file_megabytes {file_megabytes}; expected a positive number")
    features = _features(episodes, chosen[0], privileged)
    text = task if task is not None else _task_text(episodes)
    output = Path(output)
    if Path(episodes.path).resolve().is_relative_to(output.resolve()):
        raise _core.InputError(f"{output} holds the input {episodes.path}; expected another folder")
    frames = int(episodes.lengths[chosen].sum())
    with new_folder(output, overwrite) as folder:
        writer = FrameWriter(folder, features, frames, fps, file_megabytes, text)
        for episode in chosen:
            arrays = episodes[episode]
            success = np.zeros(len(arrays["actions"]), bool)
            success[-1] = episode in solved
            name = f"{episodes.path}: {episodes.names[episode]}"
            writer.add(name, arrays | {"success": success})
        statistics = writer.close()
        write_task(folder, text)
        shapes = {f.name: f.described() for f in features}
        for name, dtype in BOOKKEEPING.items():
            shapes[name] = Feature(name, [name], (1,), dtype).described()
        info = {
            "codebase_version": _VERSION,
            "robot_type": f"tangere_{episodes.task or episodes.attributes['name']}",
            "total_episodes": len(chosen),
            "total_frames": frames,
            "total_tasks": 1,
            "chunks_size": CHUNK,
            "data_files_size_in_mb": math.ceil(file_megabytes),
            "video_files_size_in_mb": 200,
            "fps": fps,
            "splits": {"train": f"0:{len(chosen)}"},
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": None,
            "features": shapes,
        }
        origin = {
            "command": episodes.command,
            "tangere_version": str(episodes.attributes["tangere_version"]),
            "seconds_per_action": seconds,
            "demos": [episodes.names[i] for i in chosen],
            "observation_scale": episodes.scale,
            "privileged": episodes.privileged,
            "touch": episodes.touch,
        }
        write_json(folder / "meta/stats.json", statistics)
        write_json(folder / "meta/tangere.json", origin)
        write_json(folder / "meta/info.json", info)
    names = [feature.name for feature in features]
    return Exported(str(output), len(chosen), frames, writer.files, fps, seconds, names)


def _features(episodes: Episodes, first: int, privileged: bool) -> list[Feature]:
    """Columns. Vectors become one state, as policies of lerobot expect; fields keep their shape."""
    arrays, said = episodes[first], episodes.attributes
    shapes = {key: np.shape(arrays[key])[1:] for key in episodes.keys}

    for key in episodes.keys:
        if key in _RESERVED or (key in _RESERVED_FIELDS and len(shapes[key]) > 1):
            raise _core.InputError(
                f"{episodes.path}: an observation is called {key!r}, which the format has for "
                "something else; expected another name of the sensor"
            )

    def names_of(key: str) -> list[str]:
        if key in ("q", "v"):
            return [str(name) for name in said[f"{key}_names"]]
        if shapes[key] == (1,):
            return [key]
        return [f"{key}{''.join(f'[{i}]' for i in at)}" for at in np.ndindex(*shapes[key])]

    def joined(name: str, keys: Sequence[str]) -> list[Feature]:
        names = [n for key in keys for n in names_of(key)]
        return [Feature(name, list(keys), (len(names),), names=names)] if keys else []

    seen = [key for key in episodes.keys if key not in episodes.privileged]
    features = joined("observation.state", [key for key in seen if len(shapes[key]) == 1])
    features += [
        Feature(f"observation.{key}", [key], shapes[key]) for key in seen if len(shapes[key]) > 1
    ]
    if privileged:
        features += joined("observation.environment_state", episodes.privileged)
    action = [str(name) for name in said["action_names"]]
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


def _task_text(episodes: Episodes) -> str:
    if not episodes.task:
        return str(episodes.attributes["name"])
    return f"{episodes.task}: {episodes.attributes['success']}"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit code: 0 done, 2 usage or data set, 3 input or output failed."""
    parser = argparse.ArgumentParser(
        prog="python -m tangere.lerobot",
        description="Write a data set of `tangere generate` as LeRobotDataset v3.0.",
    )
    parser.add_argument("data", metavar="DIR", help="folder of shards, or one file of a data set")
    parser.add_argument("output", metavar="OUT", help="folder to write; it must not exist")
    parser.add_argument("--mask", metavar="NAME", help="write the episodes of this mask alone")
    parser.add_argument("--only-success", action="store_true", help="write solved episodes alone")
    parser.add_argument(
        "--privileged", action="store_true",
        help="also write what a robot could not measure, as observation.environment_state",
    )  # fmt: skip
    parser.add_argument("--task", metavar="TEXT", help="text of the task for language policies")
    parser.add_argument(
        "--fps", type=int, metavar="N", help="frames a second [default: actions a second, rounded]"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace a data set of this name")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    given = vars(parser.parse_args(arguments))
    as_json, data, output = given.pop("json"), given.pop("data"), given.pop("output")
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(75))
    try:
        done = export(data, output, **given)
    except _core.InputError as error:
        print(f"tangere.lerobot: {error}", file=sys.stderr)
        return 2
    except KeyError as error:
        print(f"tangere.lerobot: {data} is damaged: it has no {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"tangere.lerobot: {error}", file=sys.stderr)
        return 3
    except KeyboardInterrupt:
        return 130
    finally:
        signal.signal(signal.SIGTERM, before)
    if as_json:
        print(json.dumps(asdict(done)))
        return 0
    print(
        f"wrote {done.output}: {done.episodes} episodes, {done.frames} frames, {done.files} files"
    )
    if abs(done.seconds_per_action * done.fps - 1) > 1e-6:
        print(
            f"note: an action lasts {done.seconds_per_action:g} s; frames are stamped as "
            f"{done.fps} a second",
            file=sys.stderr,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
