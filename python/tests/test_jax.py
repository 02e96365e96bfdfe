# SPDX-License-Identifier: Apache-2.0
"""Gradients through JAX: against PyTorch and differences, and what JAX may do with a computation."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

jax = pytest.importorskip("jax", reason="JAX is not installed")

import jax.numpy as jnp  # noqa: E402

import tangere  # noqa: E402
import tangere.jax as tj  # noqa: E402


@pytest.fixture
def x64():
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", False)


def numbers(task):
    """Of an observation and of an action, and the largest action."""
    spec = tangere.task_spec(task)
    n = sum(int(np.prod(t.shape)) for t in spec.observations)
    return n, spec.action.shape[0], np.array(spec.action.high)


def weights(task, gain):
    n, na, _ = numbers(task)
    generator = np.random.default_rng(1)
    return {"w": gain * generator.normal(size=(n, na)) / np.sqrt(n), "b": np.full(na, 0.2)}


def closed_loop(task, envs=2, actions=None, **options):
    """tape, and loss(params, seed): what a user of JAX writes."""
    tape = tj.Tape(task, envs, actions, flatten=True, **options)
    high = numbers(task)[2]

    def loss(params, seed=4):
        def policy(obs, t):
            return 0.5 * high * jnp.tanh(obs @ params["w"] + params["b"])

        return -tape.play(policy, seed=seed).rewards.sum(1).mean()

    return tape, loss


def same(a, b):
    leaves = zip(jax.tree_util.tree_leaves(a), jax.tree_util.tree_leaves(b), strict=True)
    return all(np.array_equal(x, y) for x, y in leaves)


@pytest.mark.parametrize(
    "task, actions, gain, bound",
    [
        ("dummy", 20, 0.3, 1e-5),
        ("box_pushing", 10, 0.1, 1e-4),
        ("box_pushing_privileged", 20, 0.1, 1e-4),
        ("cap_opening", 4, 0.01, 1e-4),
        ("stable_grasp", 1, 0.002, 1e-4),
    ],
)
def test_closed_loops_agree_with_differences(x64, task, actions, gain, bound):
    _, loss = closed_loop(task, actions=actions, precision="double", dtype=jnp.float64)
    params = weights(task, gain)
    value, gradient = jax.jit(jax.value_and_grad(loss)), None
    _, gradient = value(params)
    generator, play = np.random.default_rng(2), jax.jit(loss)
    along = {key: generator.normal(size=w.shape) for key, w in params.items()}
    analytic = sum(float((gradient[key] * along[key]).sum()) for key in params)
    errors = []
    for step in (1e-5, 1e-6, 1e-7, 1e-8):  # contacts have kinks; small steps lose digits
        ends = [{k: w + s * step * along[k] for k, w in params.items()} for s in (1, -1)]
        difference = float(play(ends[0]) - play(ends[1])) / (2 * step)
        errors.append(abs(analytic - difference) / max(abs(analytic), abs(difference)))
    assert min(errors) < bound, (analytic, errors)
    assert abs(analytic) > 1e-8


@pytest.mark.parametrize("task, envs, dtype", [("dummy", 3, "float32"), ("dummy", 3, "float64"),
                                               ("box_pushing_privileged", 2, "float64")])  # fmt: skip
def test_a_rollout_has_the_bits_of_pytorch(x64, task, envs, dtype):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    import tangere.torch as tt

    _, na, high = numbers(task)
    kinds = {tj.rollout: dtype, tt.rollout: getattr(torch, dtype)}
    given = np.random.default_rng(0).uniform(-high, high, (envs, 30, na)).astype(dtype)

    def loss(actions, rollout):
        run = rollout(task, actions, seed=2, dtype=kinds[rollout])
        seen = sum((obs[:, 1:] ** 2).sum() for obs in run.observations.values())
        return run.rewards.sum() + 0.3 * seen, run

    actions = torch.tensor(given, requires_grad=True)
    value, theirs = loss(actions, tt.rollout)
    value.backward()
    for compiled in (jax.jit, lambda f: f):
        gradient, run = compiled(jax.grad(lambda a: loss(a, tj.rollout), has_aux=True))(given)
        assert gradient.dtype == dtype and np.array_equal(gradient, actions.grad)
        assert run.rewards.dtype == "float64"
        assert np.array_equal(run.rewards, theirs.rewards.detach())
        assert run.observations.keys() == theirs.observations.keys()
        for key, obs in theirs.observations.items():
            assert np.array_equal(run.observations[key], obs.detach())
        assert np.array_equal(run.alive, theirs.alive)
        assert np.array_equal(run.success, theirs.success)
