# SPDX-License-Identifier: Apache-2.0
"""Gradients through time of tasks of one's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch

from . import _core
from ._simulation import Simulation
from ._tensor_batch import RecordedBatch, TensorBatch
from .scene_env import VectorSceneEnv, registered_task


class EnvTape:
    """A batch of episodes of a `tangere.VectorSceneEnv`, recorded for the way back.

        tape = tangere.torch.EnvTape(Press, num_envs=64)
        obs, total = tape.reset(seed=1), 0
        for t in range(Press.horizon):
            obs, reward, alive = tape.step(policy(obs["touch"]))
            total = total + reward
        (-total.mean()).backward()

    The class has `arrays = "torch"`, and its methods compute with tensors. Each runs once when the
    tape is made, which shows what it reads and how many steps it takes at a time. Starts, goals and
    drawn numbers count as given, also what a `warm_up` does, and so do ends of episodes. A tape
    begins with the springs (ks) as `restart` leaves them; a scheme of two steps begins anew.

    Parameters
    ----------
    task: the class, or its id of Gymnasium.
    num_envs: E; environment e plays episode first_episode + e of a seed, once.
    actions: of an episode, at most; None for the task's horizon.
    read: readings that the task does not use in its first states, beside those that it does.
    flatten: observations as one tensor (E, n) instead of a dict of (E, …).
    threads, tape_bytes: as for `Simulation`.
    precision: of tactile fields, "double", where gradients are exact, or "mixed", which is
        quicker.
    dtype: of observations; states and rewards are float64.
    arguments: of the class.
    """

    def __init__(
        self,
        task: str | type[VectorSceneEnv],
        num_envs: int,
        actions: int | None = None,
        *,
        read: Sequence[str] = (),
        flatten: bool = False,
        threads: int | None = None,
        precision: str = "double",
        tape_bytes: float = 1e9,
        dtype: torch.dtype = torch.float32,
        **arguments: Any,
    ):
        if isinstance(task, str) and task in gymnasium.registry:
            task, registered = registered_task(task)
            arguments = registered | arguments
        if not (isinstance(task, type) and issubclass(task, VectorSceneEnv)):
            raise _core.InputError(f"task {task!r}; expected a subclass of VectorSceneEnv itself")
        if task.arrays != "torch":
            raise _core.InputError(f'{task.__name__}: arrays "{task.arrays}"; expected "torch"')
        for name in ("seed", "first_episode"):
            if name in arguments:
                raise _core.InputError(f"{name} of a tape; expected it in reset()")
        if task.readings:
            raise _core.InputError(
                f"{task.__name__}: readings {[*task.readings]} of a tape; expected them in "
                "observe()"
            )
        self.env = task(num_envs, threads=threads, seed=0, **arguments)
        self.num_envs, self.flatten, self.dtype = num_envs, flatten, dtype
        self.actions = actions or self.env.horizon
        if not 1 <= self.actions <= self.env.horizon:
            horizon = self.env.horizon
            raise _core.InputError(f"actions {actions}; expected 1 to the horizon {horizon}")
        self._low, self._high = (torch.from_numpy(x.copy()) for x in self.env.bounds)
        names, stride = self._noted()
        self.simulation = Simulation(
            self.env.model.scene,
            num_envs,
            self.actions * self.env.steps_per_action // stride,
            every=stride,
            read=[*dict.fromkeys([*names, *read])],
            threads=threads,
            precision=precision,
            tape_bytes=tape_bytes,
        )
        self._recorded: RecordedBatch | None = None

    def reset(self, seed: int = 0, first_episode: int = 0) -> Any:
        """Starts the episodes; returns the first observations, which have no derivative."""
        for name, value in vars(self.env).items():  # with gradients of an earlier run
            if isinstance(value, torch.Tensor) and value.requires_grad:
                setattr(self.env, name, value.detach().clone())
        self.env.reset(seed=seed, options={"first_episode": first_episode})
        batch = self._batch()
        start, springs = {"q": batch.q, "v": batch.v}, batch.shear_state
        if springs.any():
            start["shear_state"] = springs
        given = {name: torch.from_numpy(x) for name, x in start.items()}
        state = self.simulation.reset(**given, randomized=batch.randomized())
        self._recorded = self.env.batch = RecordedBatch(self.simulation, state, batch)
        self._ended = np.zeros(self.num_envs, bool)
        self._success = np.zeros(self.num_envs, bool)
        return self._observe()

    def step(self, actions: torch.Tensor) -> tuple[Any, torch.Tensor, torch.Tensor]:
        """Takes one action (E, na), or (na) for all, of every environment, clipped to its bounds.

        Returns observations, rewards (E) float64 (0 where the episode had ended) and alive (E)
        bool, whether the action counted. A component beyond its bounds has derivative 0. Raises
        InputError as `Simulation.step` and the environments do.
        """
        if self._recorded is None:
            raise _core.InputError("step() without episodes; call reset() first")
        if (taken := int(self.env.lengths[0])) >= self.actions:
            raise _core.InputError(
                f"action {taken + 1} of an episode of actions={self.actions}; call reset()"
            )
        actions = torch.as_tensor(actions).to(torch.float64)
        shape = (self.num_envs, *self._low.shape)
        if actions.shape not in (shape, shape[1:]):
            raise _core.InputError(f"actions of shape {tuple(actions.shape)}; expected {shape}")
        actions = torch.minimum(torch.maximum(actions, self._low), self._high)
        actions = actions.expand(shape).contiguous()
        controls = torch.as_tensor(self.env.controls(actions))
        controls = controls.expand(self.env._shape_of_controls(controls))
        before, expected = self._recorded.taken, self.env.steps_per_action
        self.env.simulate(controls, np.arange(self.num_envs))
        taken = self._recorded.taken - before
        if taken != expected:
            said = f"{type(self.env).__name__}: simulate() took {taken} steps"
            raise _core.InputError(f"{said}; expected {expected}")
        alive = ~self._ended
        self.env.lengths += 1
        reward = torch.as_tensor(self.env.reward(actions)).to(torch.float64)
        if reward.shape != (self.num_envs,):
            said = f"{type(self.env).__name__}: reward() of shape {tuple(reward.shape)}"
            raise _core.InputError(f"{said}; expected ({self.num_envs},)")
        if not bool(torch.isfinite(reward[torch.from_numpy(alive)]).all()):
            said = f"{type(self.env).__name__}: reward() {reward.tolist()[:5]}"
            raise _core.InputError(f"{said}; expected finite numbers")
        reward = torch.where(torch.from_numpy(alive), reward, torch.zeros_like(reward))
        failed = self._recorded.status.numpy() < 0
        self._success[alive] = (self.env.flags("success") & ~failed)[alive]
        self._ended = self._ended | self.env.flags("terminated") | failed
        return self._observe(), reward, torch.from_numpy(alive)

    @property
    def success(self) -> torch.Tensor:
        """(E) bool: the task was solved after the last action that counted."""
        return torch.from_numpy(self._success.copy())

    def _batch(self) -> _core.Batch:
        return self.env._batch

    def _noted(self) -> tuple[list[str], int]:
        """The readings that the task uses in its first action, and the steps that it takes at a
        time."""
        batch = self.env.batch = TensorBatch(self._batch())
        action = torch.zeros((self.num_envs, *self._low.shape), dtype=torch.float64)
        self.env.observe()
        controls = torch.as_tensor(self.env.controls(action))
        controls = controls.expand(self.env._shape_of_controls(controls)).to(torch.float64)
        self.env.simulate(controls, np.arange(self.num_envs))
        self.env.reward(action), self.env.terminated(), self.env.success(), self.env.observe()
        return batch.names, math.gcd(self.env.steps_per_action, *batch.strides)

    def _observe(self) -> Any:
        seen = {k: torch.as_tensor(x).to(self.dtype) for k, x in self.env.observe().items()}
        for key, x in seen.items():
            if not bool(torch.isfinite(x).all()):
                said = f"{type(self.env).__name__}: observe()[{key!r}]"
                raise _core.InputError(f"{said} with numbers that are not finite")
        if not self.flatten:
            return seen
        return torch.cat([x.reshape(self.num_envs, -1) for x in seen.values()], 1)
