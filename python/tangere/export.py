# SPDX-License-Identifier: Apache-2.0
"""Data sets of `tangere generate` in the formats of learners, written by all cores.

    tangere export out/pushes out/pushes_lerobot --to lerobot

`export` is what the command runs, which is also `python -m tangere.export`. A frame is a row of the
data set, or a window of rows. Numbers are those of the files, in SI units. The bytes depend neither
on the number of processes nor on a run that was stopped and resumed.

Processes that a scheduler has started share the work through a common folder, as those of `tangere
generate` do. The folder has its name when it is complete. Until then it is called OUT.part.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import os
import signal
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Callable, Literal, Sequence, get_args

from . import _core, _export_job
from ._export_frames import Frames, hidden_in_words
from ._generate import run_command
from .data import Episodes, _none_left

__all__ = ["Exported", "export", "main"]

To = Literal["lerobot", "zarr", "ftp1", "univtac", "csv"]

_FORMATS = {
    "lerobot": ("tangere._lerobot_format", "LeRobot"),
    "zarr": ("tangere._export_zarr", "Zarr"),
    "ftp1": ("tangere._export_ftp1", "Ftp1"),
    "univtac": ("tangere._export_univtac", "UniVtac"),
}


@dataclass
class Exported:
    """What `export` has written."""

    output: str
    to: str  #: the format
    complete: bool  #: False if other processes still write parts
    episodes: int
    frames: int
    files: int  #: parts, which for lerobot are files of frames
    fps: int  #: frames a second, rounded
    seconds_per_action: float  #: of a frame; 1/fps, unless that is no whole number
    features: list[str]  #: the arrays
    notes: list[str]  #: what the format does not have as the data set has it


def export(
    data: str | Path | Episodes,
    output: str | Path,
    to: To = "lerobot",
    *,
    mask: str | None = None,
    only_success: bool = False,
    window: int = 1,
    overwrite: bool = False,
    resume: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> Exported:
    """Writes a data set in another format into the new folder `output`.

    Parameters
    ----------
    data: a folder of `tangere generate`, one of its files, or an `Episodes`.
    output: the folder; of "csv" a file.
    to: "lerobot" (LeRobotDataset v3.0), "zarr" (as Diffusion Policy reads it), "ftp1" (FTP-1's Zarr
        with its tactile keys), "univtac" (UniVTAC's HDF5, a file an episode) or "csv".
    mask: a mask of robomimic.hdf5, such as "train"; None for all episodes.
    only_success: leave out episodes that did not succeed.
    window: rows of a frame. Readings of sensors are then (window, …), the newest row last; all else
        is that of the row of the frame.
    overwrite: replace a data set of this format that is there.
    resume: go on with what a run that was stopped or killed has left in OUTPUT.part. An output that
        is complete stays.
    workers: processes; they change no byte. None: one for each core.
    progress: called with frames written and all frames of this process.
    options: of the format: those that `tangere.lerobot.export` and docs/datasets.md name.

    Every file of the data set is read and compared with its checksum. Raises InputError for a data
    set without episodes and for options that do not fit it, IoError or OSError if a file is
    damaged, if reading or writing fails or a library is missing. Nothing is left under the name
    `output` then.
    """
    if to not in get_args(To):
        raise _core.InputError(f"to {to!r}; expected one of {', '.join(get_args(To))}")
    output = Path(output)
    if to == "csv":
        return _csv(data, output, overwrite, {
            "mask": mask, "only_success": only_success, "window": window > 1, "resume": resume
        } | options)  # fmt: skip
    episodes = data if isinstance(data, Episodes) else Episodes(data)
    frames = Frames(episodes, _chosen(episodes, mask, only_success), window)
    format = _format(to, frames, options)
    if Path(episodes.path).resolve().is_relative_to(output.resolve()):
        raise _core.InputError(f"{output} holds the input {episodes.path}; expected another folder")
    if workers is not None and workers < 1:
        raise _core.InputError(f"workers {workers}; expected 1 or above")
    count = workers or len(os.sched_getaffinity(0))
    job = format.job() | {
        "window": window, "demos": [episodes.names[i] for i in frames.chosen],
        "content": episodes.content,
    }  # fmt: skip
    complete = _export_job.run(
        format, job, output, sources=episodes.files,
        overwrite=overwrite, resume=resume, workers=count, progress=progress,
    )  # fmt: skip
    return Exported(
        str(output), to, complete, len(frames.lengths), len(frames), len(format.parts),
        format.fps, frames.seconds, format.names,
        [*getattr(format, "notes", []), *_left_out(to, frames, options)],
    )  # fmt: skip


def _left_out(to: To, frames: Frames, options: dict[str, Any]) -> list[str]:
    """Notes about observations that this format is not given."""
    notes = []
    hidden = hidden_in_words(frames)
    if hidden and to in ("lerobot", "zarr") and not options.get("privileged"):
        notes.append(
            f"left out, because a robot could not measure them: {hidden}; "
            "--privileged writes them"
        )
    thinned = [str(name) for name in frames.episodes.attributes.get("samples", [])]
    if thinned:
        notes.append(f"left out, because they are not in every row: {', '.join(thinned)}")
    return notes


def _chosen(episodes: Episodes, mask: str | None, only_success: bool) -> list[int]:
    chosen = list(range(len(episodes))) if mask is None else episodes.mask(mask)
    if only_success and not episodes.task:
        raise _core.InputError(f"{episodes.path}: only_success of a scene, which has no task")
    solved = set(episodes.succeeded()) if only_success else set()
    chosen = [i for i in chosen if episodes.lengths[i] and (i in solved or not only_success)]
    if not chosen:
        raise _none_left(episodes, mask, only_success, "write")
    return chosen


def _format(to: str, frames: Frames, options: dict[str, Any]) -> _export_job.Format:
    module, name = _FORMATS[to]
    try:
        made = getattr(importlib.import_module(module), name)
    except ModuleNotFoundError as error:
        package = {"PIL": "pillow"}.get(str(error.name), error.name)
        raise _core.IoError(
            f"{to} needs the package {package}; expected it from `pip install {package}`"
        ) from None
    known = [name for name in inspect.signature(made).parameters if name != "frames"]
    for option in options:
        if option not in known:
            raise _core.InputError(f"{to} has no option {option!r}; it has {', '.join(known)}")
    return made(frames, **options)


def _csv(data: Any, output: Path, overwrite: bool, options: dict[str, Any]) -> Exported:
    for option, value in options.items():
        if value:
            raise _core.InputError(f"csv has no option {option!r}; it has episode")
    if _core.worker_from_environment()[0] > 0:
        return Exported(str(output), "csv", False, 0, 0, 0, 0, 0, [], [])
    path = data.path if isinstance(data, Episodes) else data
    words = ["export", str(path), "--csv", str(output), "--quiet"]
    said = run_command([*words, *(["--overwrite"] if overwrite else [])])
    episodes = Episodes(path)
    seconds = float(episodes.attributes["timestep"]) * int(episodes.attributes["every"])
    return Exported(
        str(output), "csv", True, len(episodes), said["rows"], 1, max(1, round(1 / seconds)),
        seconds, [], [],
    )  # fmt: skip


class _Line:
    """Progress as one line of a terminal that rewrites itself, at most ten times a second."""

    def __init__(self) -> None:
        self._start, self._last, self._open = time.monotonic(), 0.0, False
        self._kept: int | None = None

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if self._kept is None:
            self._kept = done
        if now - self._last < 0.1 and done < total:
            return
        self._last, self._open = now, True
        left = ""
        if done > self._kept and done < total:
            seconds = (now - self._start) * (total - done) / (done - self._kept)
            left = f", about {seconds:.0f} s left"
        share = 100 * done // max(total, 1)
        print(f"\r{share} % of {total} frames{left}\033[K", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        if self._open:
            print(file=sys.stderr)


def _parser(prog: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=prog, description="Write a data set of `tangere generate` in the format of a learner.",
        allow_abbrev=False,
    )  # fmt: skip
    parser.add_argument("data", metavar="DIR", help="folder of shards, or one file of a data set")
    parser.add_argument("output", metavar="OUT", help="folder to write; it must not exist")
    parser.add_argument("--to", choices=get_args(To), default="lerobot", help="format")
    parser.add_argument("--mask", metavar="NAME", help="write the episodes of this mask alone")
    parser.add_argument("--only-success", action="store_true", help="write solved episodes alone")
    parser.add_argument(
        "--window", type=int, default=1, metavar="N",
        help="rows of a frame: touch becomes (N, …), the newest row last",
    )  # fmt: skip
    parser.add_argument("--workers", type=int, metavar="N", help="processes [default: one a core]")
    parser.add_argument("--resume", action="store_true", help="go on with a run that was stopped")
    parser.add_argument("--overwrite", action="store_true", help="replace a data set of this name")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    return parser


def _add_format_options(parser: argparse.ArgumentParser) -> list[str]:
    """Options that are given to the format if they are there; their names."""
    before = {action.dest for action in parser._actions}
    group = parser.add_argument_group("of formats", argument_default=argparse.SUPPRESS)
    group.add_argument(
        "--privileged", action="store_true", help="also write what a robot could not measure"
    )
    group.add_argument(
        "--touch", choices=["state", "image"],
        help="lerobot: write fields of sensors as its policies read them: as numbers of "
        "observation.environment_state, or as pictures",
    )  # fmt: skip
    group.add_argument(
        "--pictures", choices=["image", "video"], help="lerobot: pictures in rows, or as video"
    )
    group.add_argument("--task", metavar="TEXT", help="text of the task for language policies")
    group.add_argument("--fps", type=int, metavar="N", help="lerobot: frames a second")
    group.add_argument("--license", metavar="NAME", help="lerobot: of the data, in README.md")
    group.add_argument(
        "--joints", metavar="NAMES", help="ftp1, univtac: coordinates of the arm, with commas"
    )
    group.add_argument(
        "--hand", metavar="NAME=SLOT",
        help="ftp1: coordinates of the hand with FTP-1's numbers of joints, with commas",
    )  # fmt: skip
    group.add_argument("--side", choices=["left", "right"], help="ftp1: hand with the sensors")
    group.add_argument("--sensor", metavar="NAME", help="ftp1: the sensor's name in the data")
    return [action.dest for action in parser._actions if action.dest not in before]


def main(arguments: Sequence[str] | None = None, prog: str = "python -m tangere.export") -> int:
    """The command; returns its exit code: 0 done, 2 usage or data set, 3 input or output failed,
    75 stopped by SIGTERM, 130 by SIGINT."""
    parser = _parser(prog)
    _add_format_options(parser)
    given = vars(parser.parse_args(arguments))
    as_json, quiet = given.pop("json"), given.pop("quiet")
    data, output, to = given.pop("data"), given.pop("output"), given.pop("to")
    line = None if quiet or not sys.stderr.isatty() else _Line()

    def fail(code: int, text: str) -> int:
        if as_json:
            print(json.dumps({"command": "export", "exit_code": code, "error": text}))
        else:
            print(f"tangere export: {text}", file=sys.stderr)
        return code

    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(75))
    try:
        done = export(data, output, to, progress=line, **given)
    except _core.InputError as error:
        return fail(2, str(error))
    except (OSError, _core.IoError) as error:
        return fail(3, str(error))
    except SystemExit:
        return fail(75, f"stopped; --resume goes on with {output}.part")
    except KeyboardInterrupt:
        return fail(130, f"stopped; --resume goes on with {output}.part")
    finally:
        signal.signal(signal.SIGTERM, before)
        if line:
            line.close()
    _report(done, as_json, quiet)
    return 0


def _report(done: Exported, as_json: bool, quiet: bool) -> None:
    if as_json:
        print(json.dumps({"command": "export", "exit_code": 0} | asdict(done)))
    if as_json or quiet:
        return
    if not done.complete:
        print(f"wrote parts of {done.output}; other processes write the rest")
        return
    print(
        f"wrote {done.output}: {done.episodes} episodes, {done.frames} frames, {done.files} files"
    )
    for note in _notes(done):
        print(f"note: {note}", file=sys.stderr)


def _notes(done: Exported) -> list[str]:
    notes = [*done.notes]
    read = ("observation.state", "observation.environment_state", "observation.images.")
    if done.to == "lerobot":
        fields = [
            n for n in done.features if n.startswith("observation.") and not n.startswith(read)
        ]
        if fields:
            notes.append(f"policies of lerobot do not read {', '.join(fields)}; see --touch")
        if abs(done.seconds_per_action * done.fps - 1) > 1e-6:
            notes.append(
                f"an action lasts {done.seconds_per_action:g} s; frames are stamped as {done.fps} "
                "a second"
            )
    return notes


if __name__ == "__main__":
    sys.exit(main())
