# SPDX-License-Identifier: Apache-2.0
"""What a gradient of a closed loop costs through JAX, as a share of the same through PyTorch.

    PYTHONPATH=build/release/python build/venv/bin/python bench/python_gradients.py [TASK]

Alternates between both on one thread, 16 environments and at most 100 actions of a linear policy,
and prints the median CPU seconds of each.
"""

import sys
import time
from typing import Any, Callable

import jax
import jax.numpy as jnp
import numpy as np
import torch

import tangere.jax
import tangere.torch

task = sys.argv[1] if len(sys.argv) > 1 else "box_pushing_privileged"
spec = tangere.task_spec(task)
actions = min(100, spec.horizon)
through_jax = tangere.jax.Tape(task, 16, actions, threads=1, flatten=True)
through_torch = tangere.torch.Tape(task, 16, actions, threads=1, flatten=True)
n = sum(int(np.prod(t.shape)) for t in spec.observations)
given = np.random.default_rng(0).normal(0, 0.05, (n, *spec.action.shape)).astype(np.float32)
torch.set_num_threads(1)


@jax.jit
@jax.value_and_grad
def loss(weights: Any) -> Any:
    played = through_jax.play(lambda obs, t: jnp.tanh(obs @ weights), seed=1)
    return -played.rewards.sum(1).mean()


def by_jax() -> float:
    _, gradient = jax.block_until_ready(loss(given))
    return float(jnp.linalg.norm(gradient))


def by_torch() -> float:
    weights = torch.tensor(given, requires_grad=True)
    obs, total = through_torch.reset(1), torch.zeros(16)
    for _ in range(actions):
        obs, reward, _ = through_torch.step(torch.tanh(obs @ weights))
        total = total + reward
    (-total.mean()).backward()
    return float(weights.grad.norm())


def cpu(call: Callable[[], float]) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


print(f"{task}: |gradient| {by_jax():.6g} by JAX, {by_torch():.6g} by PyTorch")  # compiles, too
one, other = 1e3 * np.median([[cpu(by_jax), cpu(by_torch)] for _ in range(30)], axis=0)
print(f"JAX {one:.1f} ms, PyTorch {other:.1f} ms: {one / other:.2f}")
