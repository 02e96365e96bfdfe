# SPDX-License-Identifier: Apache-2.0
"""What a task of one's own reads, as PyTorch tensors: of a batch, or of a recorded simulation."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from . import _core


_VIEWS = ("q_view", "v_view")  # PyTorch has no memory that is read only


def tensors(value: Any) -> Any:
    """Arrays, also in tuples and dicts, as tensors that share their memory."""
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value)
    if isinstance(value, tuple):
        return tuple(tensors(part) for part in value)
    return {k: tensors(v) for k, v in value.items()} if isinstance(value, dict) else value


class TensorBatch:
    """A `tangere.Batch` whose results are tensors. `names`: the readings that were read of it."""

    def __init__(self, batch: _core.Batch):
        self._batch = batch
        self.names: list[str] = []

    def __getattr__(self, name: str) -> Any:
        if name in _VIEWS:
            raise _core.InputError(f"batch.{name} of a task with tensors; expected {name[0]}")
        value = getattr(self._batch, name)
        if not callable(value):
            return tensors(value)

        def call(*arguments: Any, **options: Any) -> Any:
            self._note(name, arguments, options)
            return tensors(value(*arguments, **options))

        return call

    def _note(self, name: str, arguments: Any, options: dict[str, Any]) -> None:
        read = {"bodies": "bodies", "end_effectors": "variables"}.get(name)
        if name == "tactile":
            read = arguments[0] if arguments else options.get("reading")
        if read is not None and read not in self.names:
            self.names.append(read)


class RecordedBatch:
    """The same of a state of `tangere.torch.Simulation`, with its gradients."""

    def __init__(self, state: Any, batch: _core.Batch):
        self._state, self._batch = state, batch
        self.model, self.num_envs = batch.model, batch.num_envs

    # New tensors, as a batch returns new arrays: a task may change them in place.
    q = property(lambda self: self._state.q.clone())
    v = property(lambda self: self._state.v.clone())
    status = property(lambda self: torch.from_numpy(self._state.status))

    def tactile(self, reading: str) -> torch.Tensor:
        return self._read(reading)

    def bodies(self) -> tuple[torch.Tensor, torch.Tensor]:
        both = self._read("bodies")
        return both[..., :7], both[..., 7:]

    def end_effectors(self) -> torch.Tensor:
        return self._read("variables")

    def __getattr__(self, name: str) -> Any:
        raise _core.InputError(
            f"batch.{name} of a recorded task; expected q, v, status, tactile(), bodies(), "
            "end_effectors() or randomized()"
        )

    def randomized(self) -> Any:
        return tensors(self._batch.randomized())

    def _read(self, name: str) -> torch.Tensor:
        if name not in self._state.readings:
            raise _core.InputError(
                f"'{name}', which the task did not read when the tape was made; expected it in "
                f"read=, beside {list(self._state.readings)}"
            )
        return self._state[name].clone()
