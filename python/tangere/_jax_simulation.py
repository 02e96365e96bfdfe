# SPDX-License-Identifier: Apache-2.0
"""Any scene as a differentiable function in JAX."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from . import _core
from ._jax_host import Host, call, checked_dtype, integer, known, shapes_of, take_step
from ._tape import SimulationBase, check_count, check_state_type, reading_of
from ._tape import shear_state_of, split_rows, state_text


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["q", "v", "readings", "status", "token", "varying"],
    meta_fields=["host"],
)
@dataclass(repr=False)
class State:
    """A batch of states. It is a pytree, differentiable by what led to it."""

    q: jax.Array  #: (E, nq) coordinates; quaternions w x y z
    v: jax.Array  #: (E, nv) velocities
    readings: dict[str, jax.Array]  #: name of `read` → (E, …)
    status: jax.Array  #: (E) int8, StepStatus of the last steps
    token: jax.Array  #: the number of the run and of its steps; only `Simulation` uses it
    varying: jax.Array  #: (E, numbers) of what varies, without derivatives
    host: Any  #: only `Simulation` uses it

    def __getitem__(self, name: str) -> jax.Array:
        return reading_of(self.readings, name)

    def __repr__(self) -> str:
        return state_text(self)

    @property
    def bodies(self) -> jax.Array:
        """(E, nb, 13) x y z, quaternion w x y z, angular and linear velocity of every body. They
        are computed from q and v where they are used, unless `read` names them."""
        if "bodies" in self.readings:
            return self.readings["bodies"]
        return _bodies(self.host, self.q, self.v, self.varying)

    @property
    def shear_state(self) -> jax.Array:
        """(E, points, 3) displacements of the springs of contacts with ks [m], which reset() takes.
        InputError: `read` does not name it."""
        return shear_state_of(self.readings)


class Simulation(SimulationBase):
    """A scene in E environments, recorded for the way back.

        sim = tangere.jax.Simulation("scene.xml", num_envs=64, steps=100, every=5)
        p = sim.parameters("body ball radius")

        def loss(controls, p):
            def take(s, u):
                s = sim.step(s, u, p)
                return s, s["pad"].sum() + s.v.sum()
            return jax.lax.scan(take, sim.reset(seed=1), controls)[1].sum()

        value, gradient = jax.jit(jax.value_and_grad(loss, argnums=(0, 1)))(controls, p)

    It holds one run at a time, as `Tape` does, and a mistake shows as there.
    """

    def _begin(self, dtype: Any) -> None:
        dtype = checked_dtype(jnp.float32 if dtype is None else dtype)
        self._host = _Host(self.tape, dtype, self.steps)

    def _made_anew(self) -> None:
        self._host.made_anew()

    def parameters(self, *names: str) -> dict[str, np.ndarray]:
        """Name → (E), as `tangere.torch.Simulation.parameters`. Call it where nothing is traced:
        names that are new end the run, and functions that were compiled before are of no more
        use."""
        return self._parameters(names)

    def reset(
        self,
        seed: Any = 0,
        *,
        q: jax.Array | None = None,
        v: jax.Array | None = None,
        shear_state: jax.Array | None = None,
        parameters: Mapping[str, Any] | None = None,
        points: Mapping[str, jax.Array] | None = None,
        randomized: Mapping[str, Any] | None = None,
    ) -> State:
        """Starts anew, as `tangere.torch.Simulation.reset`. The seed may be traced."""
        moved = None if points is None else jnp.concatenate(
            self._point_rows(points, jnp.zeros, jnp.asarray)
        )
        named = {"q": q, "v": v, "shear_state": shear_state, "points": moved}
        given = {
            name: self._rows(x, self._host.starts[name], name)
            for name, x in named.items()
            if x is not None
        }
        numbers = self._named(randomized)
        given["randomized"] = {k: jax.lax.stop_gradient(x) for k, x in numbers.items()}
        self._check_parameters(parameters)
        given["parameters"] = self._named(parameters)
        number = integer(seed, "seed")
        with self._host.named():
            shown = _start(self._host, given, number)
            known(shown[0])  # waits for the end, where nothing traces
        return self._state(shown)

    def step(
        self, state: State, controls: jax.Array, parameters: Mapping[str, Any] | None = None
    ) -> State:
        """Takes `every` steps, as `tangere.torch.Simulation.step`. InputError: another shape,
        controls that are not finite, one step too many, or a state that is not the last one. Where
        steps are not in a `jax.lax.scan`, a loss under jit must depend on the last one, or XLA may
        begin the way back too early, which is an InputError, too."""
        check_state_type(state, State)
        x, to = jnp.asarray(controls), self._host.actions
        envs, every, nu = to.shape
        shape = (every, envs, nu) if x.ndim == 3 else (envs, nu)
        rows = self._rows(x, jax.ShapeDtypeStruct(shape, to.dtype), "controls")
        rows = jnp.swapaxes(rows, 0, 1) if x.ndim == 3 else rows[:, None]
        rows = jnp.broadcast_to(rows, to.shape)
        self._check_parameters(parameters)
        self._host.check_known(state.token, rows)
        inputs = {"controls": rows, "parameters": self._named(parameters)}
        with self._host.named():
            shown = take_step(self._host, state.token, inputs)
            known(shown[0])
        return self._state(shown)

    def _named(self, given: Mapping[str, Any] | None) -> dict[str, jax.Array]:
        def convert(x: Any) -> jax.Array:
            return jnp.asarray(x).astype(self._host.real)

        return self._rows_of(given, convert, lambda x: jnp.full(self.num_envs, x))

    def _rows(self, x: Any, expected: Any, name: str) -> jax.Array:
        x = jnp.asarray(x)
        if x.shape in (expected.shape[1:], (1, *expected.shape[1:])):
            x = jnp.broadcast_to(x, expected.shape)
        if x.shape != expected.shape:
            raise _core.InputError(f"{name} of shape {x.shape}; expected {expected.shape}")
        return x.astype(expected.dtype)

    def _state(self, shown: Any) -> State:
        token, rows, status, varying = shown
        parts = split_rows(rows, self._observations)
        q, v = parts.pop("state.q"), parts.pop("state.v")
        return State(q, v, parts, status, token, varying, self._host)


class _Host(Host):
    def __init__(self, tape: _core.SceneTape, dtype: Any, steps: int):
        super().__init__(tape, dtype)
        self.steps = steps
        shape, model, envs = jax.ShapeDtypeStruct, tape.model, tape.num_envs
        self.starts = {
            "q": shape((envs, model.nq), self.real),
            "v": shape((envs, model.nv), self.real),
            "shear_state": shape((envs, tape.shear_points, 3), self.real),
            "points": shape((tape.points, 7), self.real),
        }
        self.bodies_shape = shape((envs, model.nb, 13), dtype)
        self.made_anew()

    def made_anew(self) -> None:
        """The scene was compiled with other parameters."""
        shape, envs = jax.ShapeDtypeStruct, self.tape.num_envs
        varying = shape((envs, len(self.tape.model.scene.varying)), self.real)
        self.shown = [self.token, self.rows, shape((envs,), np.int8), varying]
        self.begin_run()

    def results(self) -> tuple[Any, ...]:
        return self.tape.observations(), self.tape.status(), self.tape.varying()

    def check(self, token: Any, actions: Any) -> None:
        check_count(int(token[1]), self.steps)
        super().check(token, actions)

    def take(self, inputs: Any) -> None:
        self.tape.step(inputs["controls"], inputs["parameters"] or None)

    def spread(self, bars: Any, to: Any) -> None:
        to["controls"][...] = bars[0]
        self.spread_numbers(bars[1], to["parameters"])

    def spread_numbers(self, bars: Any, to: Any) -> None:
        for name, array in to.items():
            array[...] = bars[:, self.tape.parameters.index(name)]

    def reset(self, form: Any, _: Any, out: Any, seed: Any, *given: Any) -> None:
        with self.lock, self.failing():
            if int(np.asarray(seed)) < 0:
                raise _core.InputError(f"seed {int(np.asarray(seed))}; expected at least 0")
            self.begin_run()
            start = jax.tree_util.tree_unflatten(form, [np.asarray(x) for x in given])
            numbers = start.pop("randomized") | start.pop("parameters")
            self.tape.reset(int(np.asarray(seed)), numbers=numbers or None, **start)
            self.show(out)

    def reverse_start(
        self, form: Any, _: Any, out: Any, token: Any, token_bar: Any, rows_bar: Any
    ) -> None:
        with self.lock:
            given = np.asarray(rows_bar)
            self._pass(np.asarray(token), np.asarray(token_bar), [given])
            to = jax.tree_util.tree_unflatten(form, [np.asarray(x) for x in out])
            *bars, numbers_bar = self.tape.reverse_start(given)
            self.spread_numbers(numbers_bar, to.pop("parameters"))
            for array in to.pop("randomized").values():
                array[...] = 0
            by_start = dict(zip(self.starts, bars))
            for name, array in to.items():
                array[...] = by_start[name]
            self.left = -1

    def bodies(self, _: Any, out: Any, *given: Any) -> None:
        with self.lock:
            np.asarray(out[0])[...] = self.tape.bodies(*(np.asarray(x) for x in given))

    def reverse_bodies(self, _: Any, out: Any, *given: Any) -> None:
        with self.lock:
            bars = self.tape.reverse_bodies(*(np.asarray(x) for x in given))
            for to, bar in zip(out, bars):
                np.asarray(to)[...] = bar


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _start(host: _Host, given: dict[str, Any], seed: Any) -> Any:
    leaves, form = jax.tree_util.tree_flatten(given)
    return call(partial(host.reset, form), host.shown, seed, *leaves)


def _start_forward(host: _Host, given: dict[str, Any], seed: Any) -> Any:
    shown = _start(host, given, seed)
    return shown, (shown[0], given)


def _start_backward(host: _Host, kept: Any, by: Any) -> Any:
    token, given = kept
    leaves, form = jax.tree_util.tree_flatten(given)
    bars = call(partial(host.reverse_start, form), shapes_of(leaves), token, *by[:2])
    return jax.tree_util.tree_unflatten(form, bars), None


_start.defvjp(_start_forward, _start_backward)


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _bodies(host: _Host, q: Any, v: Any, varying: Any) -> Any:
    return call(host.bodies, [host.bodies_shape], q, v, varying)[0]


def _bodies_forward(host: _Host, q: Any, v: Any, varying: Any) -> Any:
    return _bodies(host, q, v, varying), (q, v, varying)


def _bodies_backward(host: _Host, kept: Any, by: Any) -> Any:
    q, v, varying = kept
    bars = call(host.reverse_bodies, shapes_of((q, v)), *kept, by)
    return (*bars, jnp.zeros_like(varying))


_bodies.defvjp(_bodies_forward, _bodies_backward)
