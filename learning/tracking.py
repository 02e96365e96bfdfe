# SPDX-License-Identifier: Apache-2.0
"""Curves of a training run for TensorBoard: `--log FOLDER`, then `tensorboard --logdir FOLDER`."""

from __future__ import annotations

import argparse
import atexit

HELP = "folder of curves for TensorBoard, one for each run; needs the package tensorboard"


def add_log(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--log", metavar="FOLDER", help=HELP)


class Log:
    """Writes numbers of a run into the folder; without a folder it does nothing."""

    def __init__(self, folder: str | None):
        self._writer = None
        if folder is None:
            return
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError as error:
            raise SystemExit(
                f"--log {folder} needs the package tensorboard (pip install tensorboard): {error}"
            ) from None
        self._writer = SummaryWriter(folder)
        atexit.register(self._writer.close)

    def __call__(self, step: int, **values: float) -> None:
        """Adds one point to the curve of each name. `step`: updates, epochs or actions so far."""
        for name, value in values.items() if self._writer else ():
            self._writer.add_scalar(name, float(value), step)
