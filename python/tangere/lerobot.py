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
from ._lerobot_card import card
from ._lerobot_features import BOOKKEEPING, ENVIRONMENT, STATE, Feature, Touch, features_of
from ._lerobot_files import CHUNK, FrameWriter, new_folder, write_json, write_task, write_text
from ._lerobot_play import Checkpoint, FramePolicy, play
from .data import Episodes

__all__ = ["Checkpoint", "Exported", "FramePolicy", "export", "main", "play"]

_VERSION = "v3.0"


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
    touch: Touch | None = None,
    task: str | None = None,
    fps: int | None = None,
    license: str = "unknown",
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
    touch: how fields of sensors are written. "state": means over blocks of points, at most 600
        numbers of a reading, as `observation.environment_state`. "image": one picture for each pad,
        `observation.images.KEY`, whose colours are the components. With both, the mean of each pad
        and component joins `observation.state`, and so does whatever else is no vector. None: in
        their shape as `observation.KEY`, which policies of lerobot do not read.
    task: the text of the task, which language-conditioned policies read. None: the name of the
        task and what its success means.
    fps: frames a second. None: actions a second, rounded to a whole number, which the format
        wants. Time stamps are multiples of 1/fps.
    license: of the data, as README.md names it, such as "cc-by-4.0".
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
    features = features_of(episodes, chosen, privileged, touch)
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
            "task": episodes.task,
            "text": text,
            "columns": [feature.recipe() for feature in features],
        }
        successes = len(solved & set(chosen))
        write_text(folder / "README.md", card(episodes, features, info, text, successes, license))
        write_json(folder / "meta/stats.json", statistics)
        write_json(folder / "meta/tangere.json", origin)
        write_json(folder / "meta/info.json", info)
    names = [feature.name for feature in features]
    return Exported(str(output), len(chosen), frames, writer.files, fps, seconds, names)


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
    parser.add_argument(
        "--touch", choices=["state", "image"],
        help="write fields of sensors as policies of lerobot read them: as numbers of "
        "observation.environment_state, or as pictures",
    )  # fmt: skip
    parser.add_argument("--task", metavar="TEXT", help="text of the task for language policies")
    parser.add_argument(
        "--fps", type=int, metavar="N", help="frames a second [default: actions a second, rounded]"
    )
    parser.add_argument(
        "--license", default="unknown", metavar="NAME", help="of the data, named in README.md"
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
    read = (STATE, ENVIRONMENT, "observation.images.")
    fields = [n for n in done.features if n.startswith("observation.") and not n.startswith(read)]
    if fields:
        print(
            f"note: policies of lerobot do not read {', '.join(fields)}; see --touch",
            file=sys.stderr,
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
