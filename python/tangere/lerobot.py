# SPDX-License-Identifier: Apache-2.0
"""Data sets of `tangere generate` as LeRobotDataset v3.0, which lerobot and torchrl load.

    tangere export out/pushes out/pushes_lerobot --to lerobot

Needs h5py and pyarrow (`pip install h5py pyarrow`). A frame is a row of the data set: what was
observed, the action that followed, its reward, and whether the episode ended with it in success.
Numbers are those of the files, in SI units and as float32. The same data set gives the same bytes
with one release of pyarrow.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Callable, Sequence

from . import export as exports
from ._lerobot_features import Pictures, Touch
from ._lerobot_play import Checkpoint, FramePolicy, play
from .data import Episodes
from .export import Exported

__all__ = ["Checkpoint", "FramePolicy", "export", "main", "play"]


def export(
    data: str | Path | Episodes,
    output: str | Path,
    *,
    mask: str | None = None,
    only_success: bool = False,
    window: int = 1,
    privileged: bool = False,
    touch: Touch | None = None,
    pictures: Pictures = "image",
    task: str | None = None,
    fps: int | None = None,
    license: str = "unknown",
    overwrite: bool = False,
    resume: bool = False,
    file_megabytes: float = 100,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Exported:
    """Writes a data set as LeRobotDataset v3.0: `tangere.export.export` with its options.

    Parameters
    ----------
    data, output, mask, only_success, window, overwrite, resume, workers, progress: of every format.
    privileged: observations that a robot could not measure come along, as
        `observation.environment_state`.
    touch: how fields of sensors are written. "state": means over blocks of points, at most 600
        numbers of a reading, as `observation.environment_state`. "image": one picture for each pad,
        `observation.images.KEY`, whose colours are the components. With both, the mean of each pad
        and component joins `observation.state`, and so does whatever else is no vector. None: in
        their shape as `observation.KEY`, which policies of lerobot do not read.
    pictures: in colours, as PNG files in rows ("image"), or as video, which needs the package av
        and loses what its codec takes away.
    task: the text of the task, which language-conditioned policies read. None: the name of the
        task and what its success means.
    fps: frames a second. None: actions a second, rounded to a whole number, which the format
        wants. Time stamps are multiples of 1/fps.
    license: of the data, as README.md names it, such as "cc-by-4.0".
    file_megabytes: a file of frames ends with the episode that brings its numbers beyond this size,
        before compression.

    Raises InputError for a data set without episodes and for options that do not fit it, IoError or
    OSError if reading or writing fails. Nothing is left under the name `output` then.
    """
    return exports.export(
        data, output, "lerobot", mask=mask, only_success=only_success, window=window,
        overwrite=overwrite, resume=resume, workers=workers, progress=progress,
        privileged=privileged, touch=touch, pictures=pictures, task=task, fps=fps, license=license,
        file_megabytes=file_megabytes,
    )  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """`tangere.export.main` with `--to lerobot`; returns its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    return exports.main([*words, "--to", "lerobot"], prog="python -m tangere.lerobot")


if __name__ == "__main__":
    sys.exit(main())
