# SPDX-License-Identifier: Apache-2.0
"""The part of a tape that tangere.torch and tangere.jax share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from .gym import task_scene

# KEY → array, or with `flatten` one array.
Observations = Any


class TapeBase:
    """Holds a `tangere.TaskTape` and splits what it shows."""

    def __init__(
        self,
        task: str,
        num_envs: int,
        actions: int | None,
        flatten: bool,
        scene: _core.Scene | str | Path | None,
        **options: Any,
    ):
        self.num_envs, self.flatten = num_envs, flatten
        self.tape = _core.TaskTape(
            task, task_scene(task, scene), num_envs, actions or 0, **options
        )
        self.spec = self.tape.spec
        self.actions = actions or self.spec.horizon

    def _split(self, rows: Any) -> Observations:
        """Rows (E, n) by key, each (E, …), or as they are with `flatten`."""
        if self.flatten:
            return rows
        parts: dict[str, Any] = {}
        first = 0
        for t in self.spec.observations:
            last = first + int(np.prod(t.shape))
            parts[t.name] = rows[:, first:last].reshape(self.num_envs, *t.shape)
            first = last
        return parts


def check_rollout(actions: Any) -> tuple[int, int]:
    """E and A of the actions (E, A, na) of a rollout. Raises InputError for another shape."""
    if actions.ndim != 3 or actions.shape[1] == 0:
        raise _core.InputError(f"actions of shape {tuple(actions.shape)}; expected (E, A, na)")
    return actions.shape[0], actions.shape[1]
