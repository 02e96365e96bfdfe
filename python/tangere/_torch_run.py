# SPDX-License-Identifier: Apache-2.0
"""The order in which the steps of a tape are reversed by PyTorch."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from . import _core


class Run:
    """One pass over a `TaskTape` or `SceneTape`, and the order in which its steps are reversed."""

    def __init__(self, tape: Any):
        self.tape: Any = tape  # None: the tape has begun another run
        self.taken = 0
        self.left: int | None = None  # the step reversed last; None: nothing is reversed
        self.passing = False

    def reverse(self, step: int, *bars: np.ndarray) -> np.ndarray:
        """Reverses a step, and later ones on which the loss does not depend."""
        self._begin(again=self.left is not None and step >= self.left)
        self._skip_to(step + 1, *bars)
        self.left = step
        return self.tape.reverse(*bars)

    def reverse_start(self, rows_bar: np.ndarray) -> Any:
        """Reverses what is left, then the start."""
        self._begin(again=False)
        self._skip_to(0, rows_bar)
        self.left = 0
        return self.tape.reverse_start(rows_bar)

    def _begin(self, again: bool) -> None:
        if self.tape is None:
            raise _core.InputError(
                "backward() through a tape that was reset; call it before reset()"
            )
        if self.passing and not again:
            return
        # Another backward: it must not go on with what the one before has left.
        if self.left is not None:
            self.tape.begin_reverse()
        self.left, self.passing = None, True
        torch.autograd.Variable._execution_engine.queue_callback(self._end)

    def _skip_to(self, step: int, *bars: np.ndarray) -> None:
        left = self.taken if self.left is None else self.left
        for _ in range(left - step):
            self.tape.reverse(*[np.zeros_like(bar) for bar in bars])

    def _end(self) -> None:
        self.passing = False
