# SPDX-License-Identifier: Apache-2.0
"""Gradients through simulation in PyTorch: policies are trained through time.

    tape = tangere.torch.Tape("box_pushing", num_envs=64)
    obs = tape.reset(seed=1)
    total = 0
    for t in range(100):
        obs, reward, alive = tape.step(torch.tanh(policy(obs)))
        total = total + reward
    (-total.mean()).backward()

`Simulation` does it for any scene, with rewards of the caller, `EnvTape` for a task in Python.

The derivatives are analytic (docs/gradients.md). Draws, resets and which point is touched count as
given. `import tangere` does not import this module; it needs PyTorch.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from . import _core
from ._env_tape import EnvTape
from ._simulation import Simulation, State
from ._tape import Observations, TapeBase, check_rollout
from ._torch_run import Line, Run, first_derivatives, host_numbers, refuse_transforms


__all__ = [
    "Check",
    "EnvTape",
    "Rollout",
    "Simulation",
    "State",
    "Tape",
    "check_gradient",
    "gradcheck",
    "rollout",
]


class Tape(TapeBase):
    """A batch of episodes of one task, recorded for the way back.

    Parameters
    ----------
    task: a name of `tangere.task_names()`.
    num_envs: E; environment e plays episode first_episode + e of a seed, once.
    actions: of an episode, at most; None for the task's horizon.
    threads: None for all cores. Training scripts should also call torch.set_num_threads(1).
    normalise: observations are divided by their scales, as in `tangere.make_vec`.
    flatten: observations as one tensor (E, n) instead of a dict of (E, …).
    precision: of tactile fields, "mixed" or "double".
    tape_bytes: limit for the tapes [bytes]. Longer episodes are played again from checkpoints.
    dtype: of observations. Actions may have any floating type.
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
        dtype: torch.dtype = torch.float32,
        scene: _core.Scene | str | Path | None = None,
    ):
        options = dict(scaled=normalise, precision=precision, tape_bytes=tape_bytes)
        super().__init__(task, num_envs, actions, flatten, scene, threads=threads, **options)
        self.dtype = dtype
        self._token: torch.Tensor | None = None
        self._line = Line(self.tape)
        self._run: Run | None = None

    def reset(self, seed: int = 0, first_episode: int = 0) -> Observations:
        """Starts the episodes; returns the first observations, which have no derivative."""
        self._run = Run(self._line, seed, first_episode)
        self._token = torch.zeros((), dtype=torch.float64)
        return self._split(torch.from_numpy(self.tape.observations()).to(self.dtype))

    def step(self, actions: torch.Tensor) -> tuple[Observations, torch.Tensor, torch.Tensor]:
        """Takes one action (E, na) of every environment; one call for the whole batch.

        Returns observations, rewards (E) float64 (0 where the episode had ended) and alive (E)
        bool, whether the action was taken. Observations and rewards are differentiable by this and
        all earlier actions. After a backward() no step can follow until reset(). Raises InputError
        as `tangere.TaskTape.step` does, and under torch.no_grad() after recorded steps, where the
        chain of derivatives would be cut.
        """
        if self._token is None or self._run is None:
            raise _core.InputError("step() without episodes; call reset() first")
        if self._token.requires_grad and not torch.is_grad_enabled():
            raise _core.InputError(
                "step() under no_grad() after steps that are recorded; call reset()"
            )
        if not self._run.current:
            raise _core.InputError("step() after backward() through another run; call reset()")
        actions = torch.as_tensor(actions)
        refuse_transforms(actions)
        rows, reward, self._token = _Step.apply(actions, self._token, self._run, self.dtype)
        return self._split(rows), reward, torch.from_numpy(self.tape.alive())

    @property
    def success(self) -> torch.Tensor:
        """(E) bool."""
        return torch.from_numpy(self.tape.success())

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """q (E, nq) and v (E, nv) now, without derivatives."""
        return self.tape.q(), self.tape.v()


class _Step(torch.autograd.Function):  # type: ignore[misc]
    """One action. A token passes from step to step, so that backward takes them in order."""

    @staticmethod
    def forward(ctx: Any, actions: Any, token: Any, run: Any, dtype: Any) -> Any:
        ctx.run, ctx.step, ctx.dtype = run, run.taken, actions.dtype
        run.step(host_numbers(actions))
        ctx.save_for_backward(token)  # PyTorch frees it after a backward() that keeps no graph
        rows = torch.from_numpy(run.observations()).to(dtype)
        return rows, torch.from_numpy(run.rewards()), token.clone()

    @staticmethod
    @first_derivatives
    def backward(ctx: Any, rows_bar: Any, reward_bar: Any, token_bar: Any) -> Any:
        try:
            _ = ctx.saved_tensors
        except RuntimeError:
            raise _core.InputError(
                "a second backward() through the same steps; give the first one retain_graph=True"
            ) from None
        action_bar = ctx.run.reverse(ctx.step, host_numbers(rows_bar), host_numbers(reward_bar))
        return torch.from_numpy(action_bar).to(ctx.dtype), token_bar, None, None


@dataclass
class Rollout:
    """What `rollout` returns. Rewards and observations are differentiable by the actions."""

    rewards: torch.Tensor  #: (E, A) float64
    observations: dict[str, torch.Tensor]  #: KEY → (E, A + 1, …)
    alive: torch.Tensor  #: (E, A) bool
    success: torch.Tensor  #: (E) bool


def rollout(
    task: str,
    actions: torch.Tensor,
    *,
    seed: int = 0,
    first_episode: int = 0,
    threads: int | None = None,
    normalise: bool = True,
    dtype: torch.dtype = torch.float32,
) -> Rollout:
    """Plays E episodes with the actions (E, A, na) and returns all that they show."""
    actions = torch.as_tensor(actions)
    envs, count = check_rollout(actions)
    tape = Tape(task, envs, count, threads=threads, normalise=normalise, dtype=dtype)
    seen, rewards, alive = [tape.reset(seed, first_episode)], [], []
    for t in range(actions.shape[1]):
        obs, reward, taken = tape.step(actions[:, t])
        seen.append(obs)
        rewards.append(reward)
        alive.append(taken)
    return Rollout(
        torch.stack(rewards, 1),
        {key: torch.stack([obs[key] for obs in seen], 1) for key in seen[0]},
        torch.stack(alive, 1),
        tape.success,
    )


@dataclass
class Check:
    """How a gradient along one direction compares with differences."""

    direction: int
    analytic: float
    difference: float
    step: float  #: of the difference
    error: float  #: |analytic - difference| / max(|analytic|, |difference|)


def check_gradient(
    loss: Callable[[], torch.Tensor],
    tensors: torch.Tensor | Iterable[torch.Tensor],
    *,
    directions: int = 3,
    seed: int = 0,
    steps: tuple[float, ...] = (1e-5, 1e-6, 1e-7, 1e-8),
) -> list[Check]:
    """Compares the derivative of `loss()` by tensors that it uses with central differences.

        checks = check_gradient(lambda: loss(sim, u, mass), [u, mass])
        assert max(c.error for c in checks) < 1e-6

    `tensors` are float64 and require gradients; they are changed in place and restored. A
    direction is random in the space of all of them; its part in each tensor has the size of that
    tensor, or 1 where it is zero. Of the `steps` the best one counts, because contacts have kinks
    that large steps cross, and small steps lose digits. A quaternion must stay one: compute it from
    a tensor that may move freely.
    """
    moved = [tensors] if isinstance(tensors, torch.Tensor) else list(tensors)
    gradient = torch.autograd.grad(loss(), moved, allow_unused=True)
    if all(g is None for g in gradient):
        raise _core.InputError("the loss uses none of the tensors; expected some of them")
    generator = torch.Generator().manual_seed(seed)
    checks = []
    for k in range(directions):
        along = []
        for x in moved:
            size = float(x.detach().square().mean().sqrt()) or 1.0
            along.append(size * torch.randn(x.shape, generator=generator, dtype=x.dtype))
        parts = [(g * d).sum() for g, d in zip(gradient, along) if g is not None]
        analytic = float(sum(parts))
        tried = [_check(k, loss, moved, along, analytic, step) for step in steps]
        checks.append(min(tried, key=lambda check: check.error))
    return checks


def _check(
    direction: int,
    loss: Callable[[], torch.Tensor],
    moved: list[torch.Tensor],
    along: list[torch.Tensor],
    analytic: float,
    step: float,
) -> Check:
    kept, values = [x.detach().clone() for x in moved], []
    with torch.no_grad():
        for sign in (1, -1):
            for x, start, d in zip(moved, kept, along):
                x.copy_(start + sign * step * d)
            values.append(float(loss()))
        for x, start in zip(moved, kept):
            x.copy_(start)
    difference = (values[0] - values[1]) / (2 * step)
    error = abs(analytic - difference) / max(abs(analytic), abs(difference), 1e-300)
    return Check(direction, analytic, difference, step, error)


def gradcheck(
    task: str,
    policy: torch.nn.Module,
    *,
    actions: int = 10,
    num_envs: int = 4,
    seed: int = 0,
    directions: int = 3,
    steps: tuple[float, ...] = (1e-5, 1e-6, 1e-7, 1e-8),
) -> list[Check]:
    """Compares the derivative of a task's mean return by a policy's weights with differences.

    `policy` maps flattened observations (E, n) to actions (E, na). It works on a copy of the
    policy, in float64. Directions and steps are those of `check_gradient`.
    """
    policy = copy.deepcopy(policy).double()

    def mean_return() -> torch.Tensor:
        tape = Tape(task, num_envs, actions, flatten=True, precision="double", dtype=torch.float64)
        obs, total = tape.reset(seed), torch.zeros(num_envs, dtype=torch.float64)
        for _ in range(actions):
            obs, reward, _ = tape.step(policy(obs))
            total = total + reward
        return total.mean()

    weights = list(policy.parameters())
    return check_gradient(mean_return, weights, directions=directions, seed=seed, steps=steps)
