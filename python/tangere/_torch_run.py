# SPDX-License-Identifier: Apache-2.0
"""The order in which the steps of a tape are taken and reversed by PyTorch."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from . import _core


def refuse_transforms(*values: Any) -> None:
    """Raises InputError for tensors of forward mode, vmap and other transforms of torch.func."""
    active = getattr(torch._C, "_are_functorch_transforms_active", None)
    plain = active is None or not active()
    for x in values:
        if isinstance(x, torch.Tensor):
            try:
                x.detach().data_ptr()  # one of a vmap has no storage
                plain &= torch.autograd.forward_ad.unpack_dual(x).tangent is None
            except RuntimeError:
                plain = False
    if not plain:
        raise _core.InputError(
            "a simulation within forward mode, vmap or another transform of torch.func; expected "
            "backward() or torch.autograd.grad() for derivatives, and num_envs for a batch"
        )


def first_derivatives(backward: Callable[..., Any]) -> Callable[..., Any]:
    """A `backward` that refuses second derivatives. `once_differentiable` of PyTorch does not where
    the derivatives that come in are constant: it returns a gradient that lacks them."""

    @functools.wraps(backward)
    def first(ctx: Any, *bars: Any) -> Any:
        if torch.is_grad_enabled():
            raise _core.InputError(
                "create_graph=True, as for second derivatives, through a simulation; it has first "
                "derivatives alone"
            )
        return backward(ctx, *bars)

    return first


def host_numbers(x: Any) -> Any:
    """float64 numbers of a tensor, without its gradients; None stays."""
    if x is None:
        return None
    try:
        return x.detach().to("cpu", torch.float64).numpy()
    except RuntimeError:  # of a vmap over the way back
        refuse_transforms(x)
        raise


class Line:
    """A `TaskTape` or `SceneTape`, which holds one run at a time, and that run."""

    def __init__(self, tape: Any):
        self.tape = tape
        self.run: Run | None = None


class Run:
    """One pass over a tape, and the order in which its steps are reversed.

    It keeps its start and its inputs, and is played again if it is reversed after the tape has
    begun another run.
    """

    def __init__(self, line: Line, *start: Any, recorded: bool = True):
        line.run = None  # a reset that fails may have ended the run before
        line.tape.reset(*start)
        line.run = self
        self._line = line
        self._start = copy.deepcopy(start)  # the caller may change its own
        self._inputs: list[Any] = []
        self.recorded = recorded
        self.taken = 0
        self.left: int | None = None  # the step reversed last; None: nothing is reversed
        self.passing = False

    @property
    def current(self) -> bool:
        """Whether the tape holds this run."""
        return self._line.run is self

    @property
    def tape(self) -> Any:
        return self._line.tape

    def columns(self, numbers_bar: np.ndarray, names: Any) -> list[np.ndarray]:
        """(E) each: derivatives by some of a scene's parameters, from those by all."""
        return [numbers_bar[:, self._line.tape.parameters.index(name)] for name in names]

    def observations(self) -> np.ndarray:
        return self._line.tape.observations()

    def rewards(self) -> np.ndarray:
        return self._line.tape.rewards()

    def step(self, *inputs: Any) -> None:
        self._line.tape.step(*inputs)
        if self.recorded:
            self._inputs.append(copy.deepcopy(inputs))
        self.taken += 1

    def play_again(self) -> None:
        """Takes the steps again, on a tape that has begun another run or has been made anew."""
        self._line.tape.reset(*self._start)
        for inputs in self._inputs:
            self._line.tape.step(*inputs)
        self._line.run = self

    def reverse(self, step: int, *bars: np.ndarray) -> Any:
        """Reverses a step, and later ones on which the loss does not depend."""
        self._begin(again=self.left is not None and step >= self.left)
        self._skip_to(step + 1, *bars)
        self.left = step
        return self._line.tape.reverse(*bars)

    def reverse_start(self, rows_bar: np.ndarray) -> Any:
        """Reverses what is left, then the start."""
        self._begin(again=False)
        self._skip_to(0, rows_bar)
        self.left = 0
        return self._line.tape.reverse_start(rows_bar)

    def _begin(self, again: bool) -> None:
        if self.passing and not self.current:
            raise _core.InputError(
                "two runs of one tape that are reversed by turns; expected one after the other"
            )
        if self.passing and not again:
            return
        if not self.current:
            self.play_again()
        elif self.left is not None:
            # Another backward: it must not go on with what the one before has left.
            self._line.tape.begin_reverse()
        self.left, self.passing = None, True
        torch.autograd.Variable._execution_engine.queue_callback(self._end)

    def _skip_to(self, step: int, *bars: np.ndarray) -> None:
        left = self.taken if self.left is None else self.left
        for _ in range(left - step):
            self._line.tape.reverse(*[np.zeros_like(bar) for bar in bars])

    def _end(self) -> None:
        self.passing = False
