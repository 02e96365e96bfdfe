# SPDX-License-Identifier: Apache-2.0
"""Gradients through simulation in JAX: policies are trained through time.

    tape = tangere.jax.Tape("box_pushing_privileged", num_envs=16, flatten=True)

    def loss(params):
        played = tape.play(lambda obs, t: policy(params, obs), seed=1)
        return -played.rewards.sum(1).mean()

    value, gradient = jax.jit(jax.value_and_grad(loss))(params)

`Simulation` does the same for any scene, with losses of the caller.

The derivatives are analytic (docs/gradients.md). Draws, resets and which point is touched count as
given. It runs on JAX's CPU backend. `import tangere` does not import this module; it needs JAX.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Callable, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from . import _core
from ._jax_host import Host, call, checked_dtype, integer, known, take_step
from ._jax_simulation import Simulation
from ._tape import Observations, TapeBase, check_rollout

__all__ = ["Rollout", "Simulation", "State", "Tape", "rollout"]


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
        checked_dtype(dtype)
        options = dict(scaled=normalise, precision=precision, tape_bytes=tape_bytes)
        super().__init__(task, num_envs, actions, flatten, scene, threads=threads, **options)
        self._host = _Host(self.tape, dtype)

    def reset(self, seed: Any = 0, first_episode: Any = 0) -> tuple[State, Observations]:
        """Starts the episodes; returns the first observations, which have no derivative.

        Integers may be traced: a function under jit takes another seed without being compiled
        again.
        """
        given = [integer(seed, "seed"), integer(first_episode, "first_episode")]
        host = self._host
        token, rows, _, alive, success = call(host.reset, host.shown, *given, effect=True)
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
        self._host.check_known(state.token, actions)
        token, rows, reward, alive, success = take_step(self._host, state.token, actions)
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
        with self._host.named():
            (state, last), (seen, rewards, alive) = jax.lax.scan(
                take, start, jnp.arange(self.actions, dtype=jnp.int32)
            )
            known(state.token)  # waits for the end, where nothing traces
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


class _Host(Host):
    differentiable = 3  # with the reward

    def __init__(self, tape: _core.TaskTape, dtype: Any):
        super().__init__(tape, dtype)
        shape = jax.ShapeDtypeStruct
        flags = [shape((tape.num_envs,), bool)] * 2
        self.shown = [self.token, self.rows, shape((tape.num_envs,), self.real), *flags]

    def results(self) -> tuple[Any, ...]:
        tape = self.tape
        return tape.observations(), tape.rewards(), tape.alive(), tape.success()

    def reset(self, _: Any, out: Any, *given: Any) -> None:
        with self.lock:
            self.begin_run()
            seed, first_episode = (int(np.asarray(number)) for number in given)
            if seed < 0:
                raise _core.InputError(f"seed {seed}; expected at least 0")
            self.tape.reset(seed, first_episode)
            self.show(out)
