# SPDX-License-Identifier: Apache-2.0
"""Any scene as a differentiable function in JAX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from . import _core
from ._jax_host import Host, call, checked_dtype, integer, take_step
from ._tape import SimulationBase, split_rows


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["q", "v", "readings", "status", "token"],
    meta_fields=[],
)
@dataclass
class State:
    """A batch of states. It is a pytree, differentiable by what led to it."""

    q: jax.Array  #: (E, nq) coordinates; quaternions w x y z
    v: jax.Array  #: (E, nv) velocities
    readings: dict[str, jax.Array]  #: name of `read` → (E, …)
    status: jax.Array  #: (E) int8, StepStatus of the last steps
    token: jax.Array  #: the number of the run and of its steps; only `Simulation` uses it

    def __getitem__(self, name: str) -> jax.Array:
        return self.readings[name]


class Simulation(SimulationBase):
    """A scene in E environments, recorded for the way back.

        sim = tangere.jax.Simulation("scene.xml", num_envs=64, steps=100, every=5)

        def loss(controls, q):
            def take(s, u):
                s = sim.step(s, u)
                return s, s["pad"].sum() + s.v.sum()
            return jax.lax.scan(take, sim.reset(seed=1, q=q), controls)[1].sum()

        value, gradient = jax.jit(jax.value_and_grad(loss, argnums=(0, 1)))(controls, q)

    Parameters are those of `tangere.torch.Simulation`. `dtype`: of states, float32, or float64 with
    jax_enable_x64. It holds one run at a time, as `Tape` does, and a mistake shows as there.
    """

    def __init__(
        self,
        scene: _core.Scene | str | Path,
        num_envs: int = 1,
        steps: int = 100,
        *,
        every: int = 1,
        read: Sequence[str] | None = None,
        parameters: Sequence[str] = (),
        points: bool = False,
        threads: int | None = None,
        precision: str = "double",
        tape_bytes: float = 1e9,
        dtype: Any = jnp.float32,
    ):
        options = dict(threads=threads, precision=precision, tape_bytes=tape_bytes)
        super().__init__(scene, num_envs, steps, every, read, parameters, points=points, **options)
        self._host = _Host(self.tape, checked_dtype(dtype))

    def reset(
        self,
        seed: Any = 0,
        *,
        q: jax.Array | None = None,
        v: jax.Array | None = None,
        parameters: jax.Array | None = None,
        points: Mapping[str, jax.Array] | None = None,
    ) -> State:
        """Starts anew, as `tangere.torch.Simulation.reset` does, but without `randomized`. The seed
        may be traced."""
        moved = None if points is None else jnp.concatenate(
            self._point_rows(points, jnp.zeros, jnp.asarray)
        )
        named = {"q": q, "v": v, "parameters": parameters, "points": moved}
        given = {
            name: self._rows(x, self._host.starts[name], name)
            for name, x in named.items()
            if x is not None
        }
        return self._state(_start(self._host, given, integer(seed, "seed")))

    def step(self, state: State, controls: jax.Array) -> State:
        """Takes `every` steps with the controls (E, nu), or (nu) for all environments. InputError:
        another shape, controls that are not finite, one step too many, or a state that is not the
        last one. Where steps are not in a `jax.lax.scan`, a loss under jit must depend on the last
        one, or XLA may begin the way back too early, which is an InputError, too."""
        rows = self._rows(controls, self._host.actions, "controls")
        self._host.check_known(state.token, rows)
        return self._state(take_step(self._host, state.token, rows))

    def parameters(self) -> np.ndarray:
        """(E, names) of the run, in SI units: what reset() drew or was given."""
        return self.tape.parameters()

    def _rows(self, x: Any, expected: Any, name: str) -> jax.Array:
        x = jnp.asarray(x)
        if x.shape in (expected.shape[1:], (1, *expected.shape[1:])):
            x = jnp.broadcast_to(x, expected.shape)
        if x.shape != expected.shape:
            raise _core.InputError(f"{name} of shape {x.shape}; expected {expected.shape}")
        return x.astype(expected.dtype)

    def _state(self, shown: Any) -> State:
        token, rows, status = shown
        parts = split_rows(rows, self._observations)
        return State(parts.pop("state.q"), parts.pop("state.v"), parts, status, token)


class _Host(Host):
    def __init__(self, tape: _core.SceneTape, dtype: Any):
        super().__init__(tape, dtype)
        shape, model, envs = jax.ShapeDtypeStruct, tape.model, tape.num_envs
        self.shown = [self.token, self.rows, shape((envs,), np.int8)]
        names = tape.parameters().shape[1]
        self.starts = {
            "q": shape((envs, model.nq), self.real),
            "v": shape((envs, model.nv), self.real),
            "parameters": shape((envs, names), self.real),
            "points": shape((tape.points, 7), self.real),
        }

    def results(self) -> tuple[Any, ...]:
        return self.tape.observations(), self.tape.status()

    def reset(self, names: Any, _: Any, out: Any, seed: Any, *given: Any) -> None:
        with self.lock:
            if int(np.asarray(seed)) < 0:
                raise _core.InputError(f"seed {int(np.asarray(seed))}; expected at least 0")
            self.begin_run()
            self.tape.reset(
                int(np.asarray(seed)), **{n: np.asarray(x) for n, x in zip(names, given)}
            )
            self.show(out)

    def reverse_start(
        self, names: Any, _: Any, out: Any, token: Any, token_bar: Any, rows_bar: Any
    ) -> None:
        with self.lock:
            given = np.asarray(rows_bar)
            self._pass(np.asarray(token), np.asarray(token_bar), [given])
            bars = dict(zip(self.starts, self.tape.reverse_start(given)))
            for to, name in zip(out, names):
                np.asarray(to)[...] = bars[name]
            self.left = -1


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _start(host: _Host, given: dict[str, Any], seed: Any) -> Any:
    return call(partial(host.reset, tuple(given)), host.shown, seed, *given.values())


def _start_forward(host: _Host, given: dict[str, Any], seed: Any) -> Any:
    shown = _start(host, given, seed)
    return shown, (shown[0], {name: None for name in given})


def _start_backward(host: _Host, kept: Any, by: Any) -> Any:
    token, names = kept
    results = [host.starts[name] for name in names]
    bars = call(partial(host.reverse_start, tuple(names)), results, token, *by[:2])
    return dict(zip(names, bars)), None


_start.defvjp(_start_forward, _start_backward)
