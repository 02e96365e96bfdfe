# SPDX-License-Identifier: Apache-2.0
"""Gradients through simulation in JAX: policies are trained through time.

    tape = tangere.jax.Tape("box_pushing_privileged", num_envs=16, flatten=True)

    def loss(params):
        played = tape.play(lambda obs, t: policy(params, obs), seed=1)
        return -played.rewards.sum(1).mean()

    value, gradient = jax.jit(jax.value_and_grad(loss))(params)

The derivatives are analytic (docs/gradients.md). Draws, resets and which point is touched count as
given. It runs on JAX's CPU backend. `import tangere` does not import this module; it needs JAX.
"""

from __future__ import annotations

import operator
import threading
from functools import partial
from pathlib import Path
from typing import Any, Callable, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.buffer_callback import buffer_callback

from . import _core
from ._tape import Observations, TapeBase, check_rollout


class State(NamedTuple):
    """What passes from one action to the next. It is a pytree."""

    token: jax.Array  #: the number of the run and of its actions; only `Tape` uses it
    alive: jax.Array  #: (E) bool: the last action was taken
    success: jax.Array  #: (E) bool


class Rollout(NamedTuple):
    """What `rollout` and `Tape.play` return. It is a pytree, differentiable by the actions."""

    rewards: jax.Array  #: (E, A), 0 where the episode had ended
    observations: Observations  #: KEY → (E, A + 1, …)
    alive: jax.Array  #: (E, A) bool: the action was taken
    success: jax.Array  #: (E) bool


class Tape(TapeBase):
    """A batch of episodes of one task, recorded for the way back.

    It holds one run at a time. A computation with two runs needs two tapes; with one tape, it ends
    with an error. A mistake is an InputError. Under jit it shows only while XLA computes, and is an
    error of JAX, whose last line is that InputError.

    Parameters
    ----------
    task: a name of `tangere.task_names()`.
    num_envs: E; environment e plays episode first_episode + e of a seed, once.
    actions: of an episode, at most; None for the task's horizon.
    threads: None for all cores.
    normalise: observations are divided by their scales, as in `tangere.make_vec`.
    flatten: observations as one array (E, n) instead of a dict of (E, …).
    precision: of tactile fields, "mixed" or "double".
    tape_bytes: limit for the tapes [bytes]. Longer episodes are played again from checkpoints.
    dtype: of observations. Rewards are float64 with jax_enable_x64 and float32 without it.
    """

    def __init__(
        self,
        task: str,
        num_envs: int,
        actions: int | None = None,
        *,
        threads: int | None = None,
        normalise: bool = True,
        flatten: bool = False,
        precision: str = "mixed",
        tape_bytes: float = 1e9,
        dtype: Any = jnp.float32,
        scene: _core.Scene | str | Path | None = None,
    ):
        if np.dtype(dtype) not in (np.float32, _real()):
            raise _core.InputError(f"{dtype}; expected float32, or float64 with jax_enable_x64")
        options = dict(scaled=normalise, precision=precision, tape_bytes=tape_bytes)
        super().__init__(task, num_envs, actions, flatten, scene, threads=threads, **options)
        self._host = _Host(self.tape, dtype)

    def reset(self, seed: Any = 0, first_episode: Any = 0) -> tuple[State, Observations]:
        """Starts the episodes; returns the first observations, which have no derivative.

        Integers may be traced: a function under jit takes another seed without being compiled
        again.
        """
        given = [_integer(seed, "seed"), _integer(first_episode, "first_episode")]
        host = self._host
        token, rows, _, alive, success = _call(host.reset, host.shown, *given, effect=True)
        return State(token, alive, success), self._split(rows)

    def step(self, state: State, actions: jax.Array) -> tuple[State, Observations, jax.Array]:
        """Takes one action (E, na) of every environment; one call for the whole batch.

        Returns the next state, observations and rewards (E), 0 where the episode had ended.
        Observations and rewards are differentiable by this and all earlier actions. InputError:
        another shape, an action that is not finite, one too many, or a state that is not the last
        one of the tape. Where steps are not in a `jax.lax.scan`, a loss under jit must depend on
        the last one, or XLA may begin the way back too early, which is an InputError, too.
        """
        actions, expected = jnp.asarray(actions), self._host.actions
        if actions.shape != expected.shape:
            raise _core.InputError(f"actions of shape {actions.shape}; expected {expected.shape}")
        actions = actions.astype(expected.dtype)
        token, given = _known(state.token), _known(actions)
        if token is not None and given is not None:
            with self._host.lock:
                self._host.check(token, given)
        token, rows, reward, alive, success = _step(self._host, state.token, actions)
        return State(token, alive, success), self._split(rows), reward

    def play(
        self,
        policy: Callable[[Observations, jax.Array], jax.Array],
        seed: Any = 0,
        first_episode: Any = 0,
    ) -> Rollout:
        """Plays the episodes with policy(observations, t) → actions (E, na); t counts from 0.

        It is a `jax.lax.scan` of `step`, so the time to compile does not depend on the horizon.
        """

        def take(carry: Any, t: jax.Array) -> Any:
            state, seen = carry
            state, after, reward = self.step(state, policy(seen, t))
            return (state, after), (seen, reward, state.alive)

        start = self.reset(seed, first_episode)
        self._host.failure = None
        try:
            (state, last), (seen, rewards, alive) = jax.lax.scan(
                take, start, jnp.arange(self.actions, dtype=jnp.int32)
            )
            _known(state.token)  # waits for the end, where nothing traces
        except RuntimeError:
            if self._host.failure is None:
                raise
            raise self._host.failure from None
        observations = jax.tree_util.tree_map(
            lambda rows, row: jnp.swapaxes(jnp.concatenate([rows, row[None]]), 0, 1), seen, last
        )
        return Rollout(rewards.T, observations, alive.T, state.success)


def rollout(
    task: str,
    actions: jax.Array,
    *,
    seed: Any = 0,
    first_episode: Any = 0,
    threads: int | None = None,
    normalise: bool = True,
    dtype: Any = jnp.float32,
) -> Rollout:
    """Plays E episodes with the actions (E, A, na) and returns all that they show.

    Each call makes a tape, under jit each compilation. `Tape.play` uses one tape again and again.
    """
    actions = jnp.asarray(actions)
    envs, count = check_rollout(actions)
    tape = Tape(task, envs, count, threads=threads, normalise=normalise, dtype=dtype)
    return tape.play(lambda _, t: actions[:, t], seed, first_episode)


def _real() -> Any:
    """float64, or float32 where JAX has no other."""
    return jnp.zeros((), float).dtype


def _known(value: Any) -> np.ndarray | None:
    """The numbers of an array, also where derivatives are taken; None where jit traces it."""
    while isinstance(value, jax.core.Tracer) and hasattr(value, "primal"):
        value = value.primal
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value)


def _integer(value: Any, name: str) -> jax.Array:
    if isinstance(value, jax.core.Tracer) and value.shape == () and value.dtype.kind in "iu":
        return value
    largest = np.iinfo(jnp.zeros((), int).dtype).max
    if not 0 <= operator.index(value) <= largest:
        raise _core.InputError(f"{name} {value}; expected 0 to {largest} (see jax_enable_x64)")
    return jnp.asarray(operator.index(value))


def _call(callback: Any, results: Any, *arguments: Any, effect: bool = False) -> Any:
    """Calls Python in the midst of a computation, at the place that data dependence gives it.

    The callback writes into buffers of XLA. Callbacks that get arrays of JAX instead wait for
    ever where one core computes: the copy of their arguments waits for the thread they run on.
    """

    @jax.custom_batching.custom_vmap  # type: ignore[untyped-decorator]
    def call(*given: Any) -> Any:
        return buffer_callback(callback, results, has_side_effect=effect)(*given)

    @call.def_vmap  # type: ignore[untyped-decorator]
    def refuse_vmap(*_: Any) -> Any:
        raise _core.InputError("vmap over a tape; its batch are the num_envs environments")

    if effect:  # JAX has no derivatives around effects; integers have none anyway
        return call(*arguments)
    smooth = jax.custom_jvp(call)

    @smooth.defjvp  # type: ignore[untyped-decorator]
    def refuse_jvp(*_: Any) -> Any:
        raise _core.InputError(
            "forward-mode or second derivatives through a tape; it has first ones in reverse mode"
        )

    return smooth(*arguments)


class _Host:
    """The side of the simulator. XLA may call it from any thread, so a lock guards each call.

    A token (run, action) of float32 passes from step to step, so that XLA takes them in order. On
    the way back its derivative has the number of the pass, 0 where a pass begins. What does not
    follow the order of one run is found by these two.
    """

    def __init__(self, tape: _core.TaskTape, dtype: Any):
        self.tape, self.lock = tape, threading.Lock()
        self.run = self.passing = 0  # up to 2**24, which float32 has
        self.failure: _core.InputError | None = None  # of a step
        self.left: int | None = None  # actions not yet reversed; None: nothing is reversed
        real = _real()
        n = sum(int(np.prod(t.shape)) for t in tape.spec.observations)
        envs, shape = tape.envs, jax.ShapeDtypeStruct
        self.token, flags = shape((2,), np.float32), [shape((envs,), bool)] * 2
        self.shown = [self.token, shape((envs, n), dtype), shape((envs,), real), *flags]
        self.actions = shape((envs, *tape.spec.action.shape), real)

    def show(self, out: Any) -> None:
        tape = self.tape
        token = (self.run, tape.taken)
        found = (token, tape.observations(), tape.rewards(), tape.alive(), tape.success())
        for to, value in zip(out, found):
            np.asarray(to)[...] = value

    def reset(self, _: Any, out: Any, *given: Any) -> None:
        with self.lock:
            self.run, self.left = self.run % (1 << 24) + 1, None
            seed, first_episode = (int(np.asarray(number)) for number in given)
            if seed < 0:
                raise _core.InputError(f"seed {seed}; expected at least 0")
            self.tape.reset(seed, first_episode)
            self.show(out)

    def check(self, token: Any, actions: Any) -> None:
        """Raises InputError for a step that cannot follow."""
        if tuple(token) != (self.run, self.tape.taken):
            raise _core.InputError(
                "a step from a state that is not the last one of its tape; take one step from "
                "each state, and one tape for each run of a computation"
            )
        self.tape.check_step(actions)

    def step(self, _: Any, out: Any, token: Any, actions: Any) -> None:
        with self.lock:
            given = np.asarray(actions)
            try:
                self.check(np.asarray(token), given)
                self.tape.step(given)
            except _core.InputError as error:
                self.failure = error
                raise
            self.show(out)

    def reverse(self, _: Any, out: Any, token: Any, *by: Any) -> None:
        token_bar, rows_bar, reward_bar = (np.asarray(array) for array in by)
        with self.lock:
            (run, taken), passing = np.asarray(token), token_bar[0]
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
                    self.tape.reverse(np.zeros_like(rows_bar), np.zeros_like(reward_bar))
            if passing != self.passing or self.left != taken:
                raise _core.InputError("two ways back over one tape at the same time")
            np.asarray(out[1])[...] = self.tape.reverse(rows_bar, reward_bar)
            np.asarray(out[0])[...] = (passing, 0)
            self.left = int(taken) - 1


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _step(host: _Host, token: Any, actions: Any) -> Any:
    return _call(host.step, host.shown, token, actions)


def _forward(host: _Host, token: Any, actions: Any) -> Any:
    shown = _step(host, token, actions)
    return shown, shown[0]  # the token after the step, so that the way back cannot come before it


def _backward(host: _Host, token: Any, by: Any) -> Any:
    return tuple(_call(host.reverse, [host.token, host.actions], token, *by[:3]))


_step.defvjp(_forward, _backward)
