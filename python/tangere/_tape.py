# SPDX-License-Identifier: Apache-2.0
"""The parts of tapes and simulations that tangere.torch and tangere.jax share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from .gym import task_scene

# KEY → array, or with `flatten` one array.
Observations = Any


def split_rows(rows: Any, observations: Sequence[_core.TensorSpec]) -> dict[str, Any]:
    """Rows (E, n) by name, each (E, …)."""
    parts: dict[str, Any] = {}
    first = 0
    for t in observations:
        last = first + int(np.prod(t.shape))
        parts[t.name] = rows[:, first:last].reshape(rows.shape[0], *t.shape)
        first = last
    return parts


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
        return rows if self.flatten else split_rows(rows, self.spec.observations)


class SimulationBase:
    """Holds a `tangere.SceneTape` and the names of what goes in and out."""

    def __init__(
        self,
        scene: _core.Scene | str | Path,
        num_envs: int,
        steps: int,
        every: int,
        read: Sequence[str] | None,
        parameters: Sequence[str],
        **options: Any,
    ):
        for name, given in (("read", read), ("parameters", parameters)):
            if isinstance(given, str):
                raise _core.InputError(f"{name} {given!r}; expected a list of names")
        self.scene = scene if isinstance(scene, _core.Scene) else _core.Scene(scene)
        self.num_envs, self.steps, self.every = num_envs, steps, every
        self.parameter_names = list(parameters)
        names = None if read is None else list(read)
        self.tape = _core.SceneTape(
            self.scene, num_envs, steps, every, names, self.parameter_names, **options
        )
        self._observations = self.tape.spec.observations  # an array whose points move stays one
        self._sensors = {s.name: s.points for s in self.tape.model.sensors}

    @property
    def model(self) -> _core.Model:
        """The compiled scene, with the points of the last reset()."""
        return self.tape.model

    def _point_rows(self, points: Mapping[str, Any], zeros: Any, convert: Any) -> list[Any]:
        """Changes of the points of all sensors, (points, 7) each, from those of some."""
        sensors = self._sensors
        unknown = sorted(set(points) - set(sensors))
        if unknown:
            raise _core.InputError(f"points of {unknown}; expected sensors of {sorted(sensors)}")
        if self.tape.points == 0:
            raise _core.InputError("points without points=True in the constructor")
        rows = []
        for name, count in sensors.items():
            own = points.get(name)
            if own is None:
                own = zeros((count, 7))
            own = convert(own)
            if tuple(own.shape) != (count, 7):
                raise _core.InputError(
                    f"points of {name} of shape {tuple(own.shape)}; expected ({count}, 7)"
                )
            rows.append(own)
        return rows


def check_rollout(actions: Any) -> tuple[int, int]:
    """E and A of the actions (E, A, na) of a rollout. Raises InputError for another shape."""
    if actions.ndim != 3 or actions.shape[1] == 0:
        raise _core.InputError(f"actions of shape {tuple(actions.shape)}; expected (E, A, na)")
    return actions.shape[0], actions.shape[1]
