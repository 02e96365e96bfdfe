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
    return kind(
        tangere.Scene.from_string(scene.text),
        E,
        STEPS,
        every=EVERY,
        read=scene.read,
        parameters=scene.parameters,
        points=scene.points,
        threads=1,
        **options,
    )


def start(sim, seed):
    """What a run begins with: controls, a first state off the scene's, parameters, points."""
    random = np.random.default_rng(100 + seed)
    q = sim.reset(seed=seed).q.numpy().copy()
    q[:, :5] += random.uniform(-2e-4, 2e-4, (E, 5))
    q[:, 1] += random.uniform(-0.02, 0.02, E)
    lift, turn = (random.uniform(-x, x, (STEPS, E)) for x in (0.2, 0.05))
    names = len(sim.parameter_names)
    return {
        "u": np.stack([lift, turn], 2),
        "q": q,
        "v": random.uniform(-0.01, 0.01, (E, sim.model.nv)),
        "parameters": sim.parameters().numpy() * random.uniform(0.9, 1.1, (E, names)),
        "points": np.zeros((30, 7)),
    }


def loss_of(s):
    total = (s.v**2).sum() + 10 * s.q.sum()
    for scale, name in ((1, "pad"), (0.1, "pad.sum"), (1e3, "pad.markers"), (0.1, "bodies")):
        total = total + scale * (s[name] ** 2).sum()
    total = total + (s["pad.shear"] ** 2).sum() + 2 * (s["pad.pressure"] ** 2).sum()
    return total + s["tip"].sum()


def rolled(sim, u, q, v, parameters, points=None):
    given = {} if points is None else {"points": {"pad": points}}
    s = sim.reset(q=q, v=v, parameters=parameters, **given)
    total = loss_of(s)
    for t in range(STEPS):
        s = sim.step(s, u[t])
        total = total + loss_of(s)
    return total


def gradients(sim, at):
    leaves = {key: torch.from_numpy(x).requires_grad_() for key, x in at.items()}
    value = rolled(sim, **leaves)
    value.backward()
    return float(value), {key: x.grad.numpy() for key, x in leaves.items()}


def direction(sim, key, x, random):
    along = random.standard_normal(x.shape)
    if key == "parameters":
        along *= x
    if key == "q":
        along *= 1e-3  # of quaternions, too: a reset makes their length one
    if key == "points":
        along *= [1e-4, 1e-4, 1e-4, 100, 0.5, 0.6, 50]
    return along


@pytest.mark.parametrize("seed", range(12))
def test_gradients_agree_with_differences(seed):
    scene = random_scene(seed)
    sim = simulation(tt.Simulation, scene)
    at = start(sim, seed)
    if not scene.points:
        del at["points"]
    gradient = gradients(sim, at)[1]
    random = np.random.default_rng(seed)
    for key, x in at.items():
        along = direction(sim, key, x, random)
        analytic, errors = float((gradient[key] * along).sum()), []
        for step in (1e-3, 1e-4, 1e-5, 1e-6):
            sides = []
            with torch.no_grad():
                for sign in (2, 1, -1, -2):
                    moved = {k: torch.from_numpy(y) for k, y in at.items()}
                    moved[key] = moved[key] + sign * step * torch.from_numpy(along)
                    sides.append(float(rolled(sim, **moved)))
            # Of fourth order: 8 (f₁ - f₋₁) - (f₂ - f₋₂), over 12 h.
            difference = (8 * (sides[1] - sides[2]) - (sides[0] - sides[3])) / (12 * step)
            errors.append(abs(difference - analytic) / max(abs(difference), abs(analytic)))
        assert min(errors) < 1e-6, (key, analytic, errors)


def test_jax_has_the_gradients_of_pytorch():
    jax = pytest.importorskip("jax", reason="JAX is not installed")
    import tangere.jax as tj

    jax.config.update("jax_enable_x64", True)
    try:
        for seed in range(12):
            scene = random_scene(seed)
            sim = simulation(tt.Simulation, scene)
            at = start(sim, seed)
            if not scene.points:
                del at["points"]
            value, expected = gradients(sim, at)
            other = simulation(tj.Simulation, scene, dtype=np.float64)
            found, bars = jax.jit(jax.value_and_grad(lambda at: rolled(other, **at)))(at)
            assert abs(float(found) - value) < 1e-12 * abs(value)
            for key, bar in bars.items():
                np.testing.assert_allclose(bar, expected[key], rtol=1e-9, atol=1e-12)
    finally:
        jax.config.update("jax_enable_x64", False)
