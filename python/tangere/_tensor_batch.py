# SPDX-License-Identifier: Apache-2.0
"""What a task of one's own reads, as PyTorch tensors: of a batch, or of a recorded simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from . import _core
from ._simulation import Simulation, State


_VIEWS = ("q_view", "v_view")  # PyTorch has no memory that is read only


def tensors(value: Any) -> Any:
    """Arrays, also in tuples and dicts, as tensors that share their memory."""
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value)
    if isinstance(value, tuple):
        return tuple(tensors(part) for part in value)
    return {k: tensors(v) for k, v in value.items()} if isinstance(value, dict) else value


@dataclass
class TensorRun:
    """What `run` leaves, as `tangere.Run`: F = steps / every frames."""

    q: torch.Tensor  #: (F, E, nq)
    v: torch.Tensor  #: (F, E, nv)
    fields: dict[str, torch.Tensor]  #: name → (F, E, …)
    status: torch.Tensor  #: (E)


class TensorBatch:
    """A `tangere.Batch` whose results are tensors. `names`: the readings that were read of it;
    `strides`: numbers of steps between two readings."""

    def __init__(self, batch: _core.Batch):
        self._batch = batch
        self.names: list[str] = []
        self.strides: list[int] = []

    def run(
        self, u: Any, every: int = 1, fields: Sequence[str] = (), envs: Any = None
    ) -> TensorRun:
        self.strides += [len(u), every]
        self.names += [name for name in fields if name not in self.names]
        run = self._batch.run(u, every, list(fields), envs)
        return TensorRun(*tensors((run.q, run.v, run.fields, run.status)))

    def step(self, u: Any) -> None:
        self.strides.append(1)
        self._batch.step(u)

    def __getattr__(self, name: str) -> Any:
        if name in _VIEWS:
            raise _core.InputError(f"batch.{name} of a task with tensors; expected {name[0]}")
        value = getattr(self._batch, name)
        if not callable(value):
            self._note(name, (), {})
            return tensors(value)

        def call(*arguments: Any, **options: Any) -> Any:
            self._note(name, arguments, options)
            return tensors(value(*arguments, **options))

        return call

    def _note(self, name: str, arguments: Any, options: dict[str, Any]) -> None:
        read = {"bodies": "bodies", "end_effectors": "variables", "shear_state": "shear_state"}.get(
            name
        )
        if name == "tactile":
            read = arguments[0] if arguments else options.get("reading")
        if read is not None and read not in self.names:
            self.names.append(read)


class RecordedBatch:
    """The same of a state of `tangere.torch.Simulation`, with its gradients. run() and step() go on
    from it. `taken`: steps that they took."""

    def __init__(self, simulation: Simulation, state: State, batch: _core.Batch):
        self._simulation, self._state, self._batch = simulation, state, batch
        self.model, self.num_envs, self.taken = batch.model, batch.num_envs, 0

    def run(
        self, u: Any, every: int = 1, fields: Sequence[str] = (), envs: Any = None
    ) -> TensorRun:
        stride = self._simulation.every
        count = self.num_envs if envs is None else len(np.arange(self.num_envs)[envs])
        if count != self.num_envs:
            raise _core.InputError(
                f"batch.run() of {count} of {self.num_envs} environments; a tape takes steps of all"
            )
        if len(u) % stride or every % stride or len(u) % every:
            raise _core.InputError(
                f"batch.run() of {len(u)} steps with every={every}; expected multiples of "
                f"{stride}, the steps that the task took at a time when the tape was made"
            )
        frames = []
        for first in range(0, len(u), stride):
            self._state = self._simulation.step(self._state, u[first : first + stride])
            if (first + stride) % every == 0:
                frames.append((self.q, self.v, *(self._read(name) for name in fields)))
        self.taken += len(u)
        q, v, *read = (torch.stack(parts) for parts in zip(*frames))
        return TensorRun(q, v, dict(zip(fields, read)), self.status)

    def step(self, u: Any) -> None:
        self.run(torch.as_tensor(u).expand(1, self.num_envs, -1))

    # New tensors, as a batch returns new arrays: a task may change them in place.
    q = property(lambda self: self._state.q.clone())
    v = property(lambda self: self._state.v.clone())
    status = property(lambda self: torch.from_numpy(self._state.status))
    shear_state = property(lambda self: self._read("shear_state"))

    def tactile(self, reading: str) -> torch.Tensor:
        return self._read(reading)

    def bodies(self) -> tuple[torch.Tensor, torch.Tensor]:
        both = self._read("bodies")
        return both[..., :7], both[..., 7:]

    def end_effectors(self) -> torch.Tensor:
        return self._read("variables")

    def __getattr__(self, name: str) -> Any:
        raise _core.InputError(
            f"batch.{name} of a recorded task; expected q, v, status, shear_state, tactile(), "
            "bodies(), end_effectors(), randomized(), run() or step()"
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
