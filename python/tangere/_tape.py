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


def shear_state_of(readings: Mapping[str, Any]) -> Any:
    if "shear_state" not in readings:
        raise _core.InputError(
            f"shear_state of a state with the readings {list(readings)}; expected it in read="
        )
    return readings["shear_state"]


def reading_of(readings: Mapping[str, Any], name: str) -> Any:
    if name not in readings:
        raise _core.InputError(f"no reading {name!r}; read= of the simulation has {list(readings)}")
    return readings[name]


def state_text(state: Any) -> str:
    """The shapes of a state, for its repr."""
    parts = {"q": state.q, "v": state.v, **state.readings}
    return f"State({', '.join(f'{name} {tuple(x.shape)}' for name, x in parts.items())})"


def check_state_type(state: Any, expected: type) -> None:
    if not isinstance(state, expected):
        raise _core.InputError(
            f"a state of type {type(state).__name__}; expected what reset() or step() returned"
        )


def check_count(taken: int, steps: int) -> None:
    if taken >= steps:
        raise _core.InputError(
            f"step() after {taken} calls of it; expected at most steps={steps} after a reset()"
        )


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
    """A scene in E environments, recorded for the way back: what does not depend on the library."""

    def __init__(
        self,
        scene: _core.Scene | str | Path,
        num_envs: int = 1,
        steps: int = 100,
        *,
        every: int = 1,
        read: Sequence[str] | None = None,
        points: bool = False,
        threads: int | None = None,
        precision: str = "double",
        tape_bytes: float = 1e9,
        dtype: Any = None,
    ):
        """Compiles the scene.

        Parameters
        ----------
        scene: a file, or a `tangere.Scene`.
        num_envs: E. Environment e has draw e of a seed.
        steps: calls of step() after a reset(), at most.
        every: steps of the simulation in each.
        read: names of what s[name] holds, for each environment: "pad" (rows, cols, 3) [N],
            "pad.sum" (6), "pad.pressure", "pad.shear", "pad.flow", "pad.markers",
            "pad.surface", "pad.channels" of sensors;
            "bodies" (nb, 13) or "bodies.box" (13): x y z, quaternion w x y z, angular and linear
            velocity; "variables" (n, 3), the end effectors, or one by its name (3); "shear_state"
            (points, 3) [m] of contacts with ks. None: end effectors and all fields.
        points: whether reset() may move points of sensors.
        threads: None for all cores.
        precision: of tactile fields, "double" or "mixed".
        tape_bytes: limit for the tapes [bytes]. Longer runs are played again from checkpoints.
        dtype: of states. None: float64 in PyTorch, float32 in JAX, where float64 needs
            jax_enable_x64. Controls may have any floating type.
        """
        if isinstance(read, str):
            raise _core.InputError(f"read {read!r}; expected a list of names")
        for name, value in {"num_envs": num_envs, "steps": steps, "every": every}.items():
            if not isinstance(value, (int, np.integer)) or value < 1:
                raise _core.InputError(f"{name} {value!r}; expected a whole number from 1 on")
        self.scene = scene if isinstance(scene, _core.Scene) else _core.Scene(scene)
        self.num_envs, self.steps, self.every = num_envs, steps, every
        names = None if read is None else list(read)
        self.tape = _core.SceneTape(
            self.scene, num_envs, steps, every, names, points, threads, precision, tape_bytes
        )
        self._observations = self.tape.spec.observations  # an array whose points move stays one
        self._sensors = {s.name: s.points for s in self.tape.model.sensors}
        self._begin(dtype)

    def _begin(self, dtype: Any) -> None:
        """What a subclass adds to the constructor."""
        raise NotImplementedError

    def _made_anew(self) -> None:
        """The scene was compiled with other parameters, which ended the run on the tape."""
        raise NotImplementedError

    @property
    def units(self) -> dict[str, str]:
        """Name → unit of the numbers that parameters() has named."""
        return dict(zip(self.tape.parameters, self.tape.units))

    def _parameters(self, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """Name → (E): numbers that get derivatives, as they are now."""
        for name in names:
            if not isinstance(name, str):
                raise _core.InputError(f"parameters({name!r}); expected parameters(name, …)")
        if any(name not in self.tape.parameters for name in names):
            self.tape.add_parameters(list(names))
            self._made_anew()
        columns = dict(zip(self.model.scene.varying, self.tape.varying().T))
        for name, value in self.tape.shared.items():  # the same in all environments
            columns[name] = np.full(self.num_envs, value)
        return {name: columns[name].copy() for name in names or self.tape.parameters}

    def _rows_of(self, given: Mapping[str, Any] | None, convert: Any, fill: Any) -> dict[str, Any]:
        """Name → (E) of what reset() or step() was given by name. fill(x) makes (E) of ()."""
        rows = {}
        for name, x in (given or {}).items():
            x = convert(x)
            x = fill(x) if tuple(x.shape) in ((), (1,)) else x
            if tuple(x.shape) != (self.num_envs,):
                raise _core.InputError(
                    f"{name} of shape {tuple(x.shape)}; expected ({self.num_envs},) or ()"
                )
            rows[name] = x
        return rows

    def _check_parameters(self, given: Mapping[str, Any] | None) -> None:
        unknown = sorted(set(given or ()) - set(self.tape.parameters))
        if unknown:
            raise _core.InputError(
                f"parameters {unknown}; expected names that parameters() was called with: "
                f"{self.tape.parameters}"
            )

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
