# SPDX-License-Identifier: Apache-2.0
"""Calls of the simulator in the midst of a computation of JAX, in the order of one run."""

from __future__ import annotations

import operator
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.buffer_callback import buffer_callback

from . import _core


def real() -> Any:
    """float64, or float32 where JAX has no other."""
    return jnp.zeros((), float).dtype


def checked_dtype(dtype: Any) -> Any:
    if np.dtype(dtype) not in (np.float32, real()):
        raise _core.InputError(f"{dtype}; expected float32, or float64 with jax_enable_x64")
    return dtype


def known(value: Any) -> np.ndarray | None:
    """The numbers of an array, also where derivatives are taken; None where jit traces it."""
    while isinstance(value, jax.core.Tracer) and hasattr(value, "primal"):
        value = value.primal
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value)


def integer(value: Any, name: str) -> jax.Array:
    if isinstance(value, jax.core.Tracer) and value.shape == () and value.dtype.kind in "iu":
        return value
    largest = np.iinfo(jnp.zeros((), int).dtype).max
    if not 0 <= operator.index(value) <= largest:
        raise _core.InputError(f"{name} {value}; expected 0 to {largest} (see jax_enable_x64)")
    return jnp.asarray(operator.index(value))


def shapes_of(arrays: Any) -> list[Any]:
    return [jax.ShapeDtypeStruct(x.shape, x.dtype) for x in arrays]


def call(callback: Any, results: Any, *arguments: Any, effect: bool = False) -> Any:
    """Calls Python in the midst of a computation, at the place that data dependence gives it.

    The callback writes into buffers of XLA. Callbacks that get arrays of JAX instead wait for
    ever where one core computes: the copy of their arguments waits for the thread they run on.
    """

    @jax.custom_batching.custom_vmap  # type: ignore[untyped-decorator]
    def plain(*given: Any) -> Any:
        return buffer_callback(callback, results, has_side_effect=effect)(*given)

    @plain.def_vmap  # type: ignore[untyped-decorator]
    def refuse_vmap(*_: Any) -> Any:
        raise _core.InputError("vmap over a tape; its batch are the num_envs environments")

    if effect:  # JAX has no derivatives around effects; integers have none anyway
        return plain(*arguments)
    smooth = jax.custom_jvp(plain)

    @smooth.defjvp  # type: ignore[untyped-decorator]
    def refuse_jvp(*_: Any) -> Any:
        raise _core.InputError(
            "forward-mode or second derivatives through a tape; it has first ones in reverse mode"
        )

    return smooth(*arguments)


class Host:
    """The side of the simulator. XLA may call it from any thread, so a lock guards each call.

    A token (run, action) of float32 passes from step to step, so that XLA takes them in order. On
    the way back its derivative has the number of the pass, 0 where a pass begins. What does not
    follow the order of one run is found by these two.
    """

    differentiable = 2  #: of what a step returns: the token, the rows …
    shown: list[Any]  #: shapes of what a step returns

    def __init__(self, tape: Any, dtype: Any):
        self.tape, self.lock = tape, threading.Lock()
        self.run = self.passing = 0  # up to 2**24, which float32 has
        self.failure: _core.InputError | None = None  # of the last reset or step
        self.left: int | None = None  # actions not yet reversed; None: nothing is reversed
        self.real = real()
        n = sum(int(np.prod(t.shape)) for t in tape.spec.observations)
        shape = jax.ShapeDtypeStruct
        self.token, self.rows = shape((2,), np.float32), shape((tape.num_envs, n), dtype)
        self.actions = shape((tape.num_envs, *tape.spec.action.shape), self.real)

    def results(self) -> tuple[Any, ...]:
        """What a step returns after the token. A subclass defines it."""
        raise NotImplementedError

    def show(self, out: Any) -> None:
        for to, value in zip(out, ((self.run, self.tape.taken), *self.results())):
            np.asarray(to)[...] = value

    def begin_run(self) -> None:
        self.run, self.left = self.run % (1 << 24) + 1, None

    def take(self, inputs: Any) -> None:
        """Takes a step of the tape with its inputs, here its actions."""
        self.tape.step(inputs)

    def spread(self, bars: Any, to: Any) -> None:
        """Writes what the tape's reverse() returned to arrays of the form of a step's inputs."""
        to[...] = bars

    def check(self, token: Any, actions: Any) -> None:
        """Raises InputError for a step that cannot follow."""
        if tuple(token) != (self.run, self.tape.taken):
            raise _core.InputError(
                "a step from a state that is not the last one of its tape; take one step from "
                "each state, and one tape for each run of a computation"
            )
        self.tape.check_step(actions)

    def check_known(self, token: Any, actions: Any) -> None:
        """The same as soon as the numbers are known, that is without jit."""
        token, actions = known(token), known(actions)
        if token is not None and actions is not None:
            with self.lock:
                self.check(token, actions)

    def step(self, form: Any, _: Any, out: Any, token: Any, *inputs: Any) -> None:
        with self.lock, self.failing():
            given = [np.asarray(x) for x in inputs]
            self.check(np.asarray(token), given[0])
            self.take(jax.tree_util.tree_unflatten(form, given))
            self.show(out)

    @contextmanager
    def failing(self) -> Iterator[None]:
        """Keeps the error of a callback, of which JAX raises the text alone."""
        try:
            yield
        except _core.InputError as error:
            self.failure = error
            raise

    @contextmanager
    def named(self) -> Iterator[None]:
        """Raises the error of a callback instead of JAX's. What is inside waits for its end."""
        self.failure = None
        try:
            yield
        except RuntimeError:
            if self.failure is None:
                raise
            raise self.failure from None

    def reverse(self, form: Any, _: Any, out: Any, token: Any, token_bar: Any, *bars: Any) -> None:
        with self.lock:
            given = [np.asarray(bar) for bar in bars]
            taken = int(np.asarray(token)[1])
            passing = self._pass(np.asarray(token), np.asarray(token_bar), given)
            to = [np.asarray(x) for x in out[1:]]
            self.spread(self.tape.reverse(*given), jax.tree_util.tree_unflatten(form, to))
            np.asarray(out[0])[...] = (passing, 0)
            self.left = taken - 1

    def _pass(self, token: Any, token_bar: Any, bars: Any) -> Any:
        """The number of the pass that comes to a step, which it begins where none is under way."""
        (run, taken), passing = token, token_bar[0]
        if run != self.run:
            raise _core.InputError(
                "derivatives of a run whose tape has begun another one; take one tape for each "
                "run of a computation"
            )
        if passing == 0:
            if self.left is not None:
                self.tape.begin_reverse()
            passing = self.passing = self.passing % (1 << 24) + 1
            self.left = int(taken)
            for _ in range(self.tape.taken - self.left):  # on which the loss does not hang
                self.tape.reverse(*[np.zeros_like(bar) for bar in bars])
        if passing != self.passing or self.left != taken:
            raise _core.InputError("two ways back over one tape at the same time")
        return passing


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def take_step(host: Host, token: Any, inputs: Any) -> Any:
    """One step of a tape, differentiable by its inputs: arrays of any form, the actions first."""
    leaves, form = jax.tree_util.tree_flatten(inputs)
    return call(partial(host.step, form), host.shown, token, *leaves)


def _forward(host: Host, token: Any, inputs: Any) -> Any:
    shown = take_step(host, token, inputs)
    # The token after the step, so that the way back cannot come before it.
    return shown, (shown[0], inputs)


def _backward(host: Host, kept: Any, by: Any) -> Any:
    token, inputs = kept
    bars = by[: host.differentiable]
    leaves, form = jax.tree_util.tree_flatten(inputs)
    results = [host.token, *shapes_of(leaves)]
    token_bar, *input_bars = call(partial(host.reverse, form), results, token, *bars)
    return token_bar, jax.tree_util.tree_unflatten(form, input_bars)


take_step.defvjp(_forward, _backward)
