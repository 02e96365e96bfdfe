# SPDX-License-Identifier: Apache-2.0
"""Gradients of random scenes: PyTorch against central differences, JAX against PyTorch."""

from __future__ import annotations

import numpy as np
import pytest
from random_scenes import random_scene

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

import tangere  # noqa: E402
import tangere.torch as tt  # noqa: E402

E, STEPS, EVERY = 2, 4, 2


def simulation(kind, scene, **options):
    sim = kind(
        tangere.Scene.from_string(scene.text),
        E,
        STEPS,
        every=EVERY,
        read=scene.read,
        points=scene.points,
        threads=1,
        **options,
    )
    sim.parameters(*scene.parameters)
    return sim


def start(sim, seed):
    """What a run begins with: controls, a first state off the scene's, parameters, points."""
    random = np.random.default_rng(100 + seed)
    q = sim.reset(seed=seed).q.numpy().copy()
    q[:, :5] += random.uniform(-2e-4, 2e-4, (E, 5))
    q[:, 1] += random.uniform(-0.02, 0.02, E)
    lift, turn = (random.uniform(-x, x, (STEPS, E)) for x in (0.2, 0.05))
    sheared = (E, sim.tape.shear_points, 3)
    own = {name: x.numpy() for name, x in sim.parameters().items()}

    def numbers(*shape):
        return {name: x * random.uniform(0.9, 1.1, (*shape, E)) for name, x in own.items()}

    return {
        "u": np.stack([lift, turn], 2),
        "q": q,
        "v": random.uniform(-0.01, 0.01, (E, sim.model.nv)),
        "shear_state": random.uniform(-1e-6, 1e-6, sheared),
        "parameters": numbers(),
        "step_parameters": numbers(STEPS),
        "points": np.zeros((30, 7)),
    }


def loss_of(s):
    total = (s.v**2).sum() + 10 * s.q.sum()
    for scale, name in ((1, "pad"), (0.1, "pad.sum"), (1e3, "pad.markers"), (0.1, "bodies")):
        total = total + scale * (s[name] ** 2).sum()
    total = total + (s["pad.shear"] ** 2).sum() + 2 * (s["pad.pressure"] ** 2).sum()
    if "shear_state" in s.readings:
        total = total + 1e7 * (s.shear_state**2).sum()
    return total + s["tip"].sum()


def rolled(sim, u, q, v, parameters, shear_state=None, step_parameters=None, points=None):
    given = {} if points is None else {"points": {"pad": points}}
    s = sim.reset(q=q, v=v, shear_state=shear_state, parameters=parameters, **given)
    total = loss_of(s)
    for t in range(STEPS):
        own = None  # those of the step before
        if step_parameters is not None and t % 2 == 1:
            own = {name: x[t] for name, x in step_parameters.items()}
        s = sim.step(s, u[t], own)
        total = total + loss_of(s)
    return total


def mapped(function, at):
    """The same of the arrays of nested dicts."""
    return {k: mapped(function, x) if isinstance(x, dict) else function(x) for k, x in at.items()}


def leaf(x):
    return torch.from_numpy(x).requires_grad_()


def gradients(sim, at):
    leaves = mapped(leaf, at)
    value = rolled(sim, **leaves)
    value.backward()
    return float(value), mapped(lambda x: x.grad.numpy(), leaves)


def direction(key, x, random):
    if isinstance(x, dict):
        return {name: y * random.standard_normal(y.shape) for name, y in x.items()}
    along = random.standard_normal(x.shape)
    if key == "shear_state":
        along *= 1e-6
    if key == "q":
        along *= 1e-3  # of quaternions, too: a reset makes their length one
    if key == "points":
        along *= [1e-4, 1e-4, 1e-4, 100, 0.5, 0.6, 50]
    return along


def added(x, step, along):
    if isinstance(x, dict):
        return {name: added(y, step, along[name]) for name, y in x.items()}
    return x + step * along


def inner(x, y):
    return sum(inner(x[k], y[k]) for k in x) if isinstance(x, dict) else float((x * y).sum())


def leave_out(scene, at):
    """A scene without ks has no shear state, and a skin with ks no derivatives by points. Those of
    others follow the coefficients of the start alone."""
    if not scene.springs:
        del at["shear_state"]
    if not scene.points:
        del at["points"]
        return
    for name in [name for name in at["step_parameters"] if name.startswith("tactile")]:
        del at["step_parameters"][name]


@pytest.mark.parametrize("seed", range(12))
def test_gradients_agree_with_differences(seed):
    scene = random_scene(seed)
    sim = simulation(tt.Simulation, scene)
    at = start(sim, seed)
    leave_out(scene, at)
    gradient = gradients(sim, at)[1]
    random = np.random.default_rng(seed)
    for key, x in at.items():
        along = direction(key, x, random)
        analytic, errors = inner(gradient[key], along), []
        for step in (1e-3, 1e-4, 1e-5, 1e-6):
            sides = []
            with torch.no_grad():
                for sign in (2, 1, -1, -2):
                    moved = at | {key: added(x, sign * step, along)}
                    sides.append(float(rolled(sim, **mapped(torch.from_numpy, moved))))
            # Of fourth order: 8 (f₁ - f₋₁) - (f₂ - f₋₂), over 12 h.
            difference = (8 * (sides[1] - sides[2]) - (sides[0] - sides[3])) / (12 * step)
            errors.append(abs(difference - analytic) / max(abs(difference), abs(analytic)))
        assert min(errors) < 1e-6, (key, analytic, errors)


def test_jax_has_the_gradients_of_pytorch():
    jax = pytest.importorskip("jax", reason="JAX is not installed")
    import tangere.jax as tj

    jax.config.update("jax_enable_x64", True)
    try:
        for seed in range(3):
            scene = random_scene(seed)
            sim = simulation(tt.Simulation, scene)
            at = start(sim, seed)
            leave_out(scene, at)
            value, expected = gradients(sim, at)
            other = simulation(tj.Simulation, scene, dtype=np.float64)
            found, bars = jax.jit(jax.value_and_grad(lambda at: rolled(other, **at)))(at)
            assert abs(float(found) - value) < 1e-12 * abs(value)
            both = (jax.tree_util.tree_leaves(x) for x in (bars, expected))
            for bar, other in zip(*both, strict=True):
                np.testing.assert_allclose(bar, other, rtol=1e-9, atol=1e-12)
    finally:
        jax.config.update("jax_enable_x64", False)
