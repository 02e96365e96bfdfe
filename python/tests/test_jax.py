# SPDX-License-Identifier: Apache-2.0
"""Gradients through JAX: against PyTorch and differences, and whatever JAX does to a function."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial

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
    return n, spec.action.shape[0], spec.action.high


def weights(task, gain):
    n, na, _ = numbers(task)
    generator = np.random.default_rng(1)
    return {"w": gain * generator.normal(size=(n, na)) / np.sqrt(n), "b": np.full(na, 0.2)}


def closed_loop(task="box_pushing_privileged", envs=2, actions=4, **options):
    """loss(params, seed), as a user of JAX writes it, and its tape."""
    tape = tj.Tape(task, envs, actions, flatten=True, **options)
    high = numbers(task)[2]

    def loss(params, seed=4):
        def policy(obs, t):
            return 0.5 * high * jnp.tanh(obs @ params["w"] + params["b"])

        return -tape.play(policy, seed=seed).rewards.sum(1).mean()

    return loss, tape


PARAMS = weights("box_pushing_privileged", 0.1)


def same(a, b):
    leaves = zip(jax.tree_util.tree_leaves(a), jax.tree_util.tree_leaves(b), strict=True)
    return all(np.array_equal(x, y) for x, y in leaves)


def close(a, b, bound):
    leaves = zip(jax.tree_util.tree_leaves(a), jax.tree_util.tree_leaves(b), strict=True)
    return all(np.allclose(x, y, rtol=bound, atol=bound * np.abs(y).max()) for x, y in leaves)


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
    loss, _ = closed_loop(task, actions=actions, precision="double", dtype=jnp.float64)
    params, play = weights(task, gain), jax.jit(loss)
    gradient = jax.jit(jax.grad(loss))(params)
    generator = np.random.default_rng(2)
    along = {key: generator.normal(size=w.shape) for key, w in params.items()}
    analytic = sum(float((gradient[key] * along[key]).sum()) for key in params)
    errors = []
    for step in (1e-5, 1e-6, 1e-7, 1e-8):  # contacts have kinks; small steps lose digits
        ends = [{k: w + s * step * along[k] for k, w in params.items()} for s in (1, -1)]
        difference = float(play(ends[0]) - play(ends[1])) / (2 * step)
        errors.append(abs(analytic - difference) / max(abs(analytic), abs(difference)))
    assert min(errors) < bound, (analytic, errors)
    assert abs(analytic) > 1e-8


def test_a_closed_loop_is_that_of_pytorch(x64):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    import tangere.torch as tt

    loss, _ = closed_loop(actions=20, dtype=jnp.float64)
    value, gradient = jax.jit(jax.value_and_grad(loss))(PARAMS)
    params = {key: torch.tensor(w, requires_grad=True) for key, w in PARAMS.items()}
    tape = tt.Tape("box_pushing_privileged", 2, 20, flatten=True, dtype=torch.float64)
    obs, total = tape.reset(4), 0
    for _ in range(20):
        obs, reward, _ = tape.step(0.5 * torch.tanh(obs @ params["w"] + params["b"]))
        total = total - reward
    total.mean().backward()
    assert float(value) == pytest.approx(float(total.detach().mean()), rel=1e-12)
    assert close(gradient, {key: w.grad.numpy() for key, w in params.items()}, 1e-10)


@pytest.mark.parametrize(
    "task, count, dtype",
    [
        ("dummy", 30, "float32"),
        ("box_pushing", 8, "float64"),
        ("insertion_rotation", 3, "float32"),  # episodes end after one action or more
    ],
)
def test_a_rollout_has_the_bits_of_pytorch(x64, task, count, dtype):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    import tangere.torch as tt

    _, na, high = numbers(task)
    kinds = {tj.rollout: dtype, tt.rollout: getattr(torch, dtype)}
    given = np.random.default_rng(0).uniform(-high, high, (4, count, na)).astype(dtype)

    def loss(actions, rollout):
        run = rollout(task, actions, seed=1, first_episode=1, dtype=kinds[rollout])
        seen = sum(2 * obs[1:3, 1:].sum() for obs in run.observations.values())
        return run.rewards[:, 0].sum() + seen, run

    actions = torch.tensor(given, requires_grad=True)
    value, theirs = loss(actions, tt.rollout)
    value.backward()
    assert actions.grad.abs().max() > 0 and theirs.alive.all() == (task != "insertion_rotation")
    for compiled in (jax.jit, lambda f: f):
        gradient, run = compiled(jax.grad(lambda a: loss(a, tj.rollout), has_aux=True))(given)
        assert gradient.dtype == dtype and run.rewards.dtype == "float64"
        assert same([gradient, run.rewards], [actions.grad, theirs.rewards.detach()])
        assert same([run.alive, run.success], [theirs.alive, theirs.success])
        assert same(run.observations, {k: obs.detach() for k, obs in theirs.observations.items()})


def test_calls_again_have_the_same_bits_and_another_seed_compiles_nothing():
    loss, _ = closed_loop(actions=20)
    traced = []

    def counted(params, seed):
        traced.append(seed)
        return loss(params, seed)

    function = jax.jit(jax.value_and_grad(counted))
    first, other, again = (function(PARAMS, seed) for seed in (4, 5, 4))
    assert same(first, again) and not same(first, other) and len(traced) == 1
    static = jax.jit(jax.value_and_grad(lambda params: loss(params, 4)))(PARAMS)
    assert same(static, first)
    assert first[0].dtype == "float32" and close(jax.value_and_grad(loss)(PARAMS), first, 1e-4)


def test_what_jax_makes_of_a_loss_has_the_same_numbers(x64):
    loss, tape = closed_loop(dtype=jnp.float64)
    truth = jax.value_and_grad(loss)(PARAMS)
    assert close(jax.value_and_grad(jax.jit(loss))(PARAMS), truth, 1e-12)
    either = jax.value_and_grad(lambda p: jax.lax.cond(p["b"].sum() > 0, loss, lambda p: 0.0, p))
    assert close(jax.jit(either)(PARAMS), truth, 1e-12)
    # A run inside a loop: XLA must not move its start out of the loop.
    descend = jax.jit(
        lambda p: jax.tree_util.tree_map(lambda w, g: w - 1e-4 * g, p, jax.grad(loss)(p))
    )
    params, _ = jax.lax.scan(lambda p, _: (descend(p), None), PARAMS, None, length=3)
    assert close(params, descend(descend(descend(PARAMS))), 1e-12)
    one, two = jax.jit(lambda: [tape.reset(4)[0].token for _ in range(2)])()
    assert one[0] != two[0]  # nor make one of two


def steps(tape, actions):
    """Rewards of each action, one `step` after the other."""
    state, _ = tape.reset(1)
    rewards = []
    for action in actions:
        state, _, reward = tape.step(state, action)
        rewards.append(reward.sum())
    return rewards


def test_losses_of_one_run_do_not_mix(x64):
    tape = tj.Tape("box_pushing_reduced", 2, 6)
    actions = 0.1 * jnp.arange(1, 37, dtype=float).reshape(6, 2, 3) / 6

    def losses(actions):
        _, back = jax.vjp(lambda a: jnp.stack(steps(tape, a)), actions)
        return [back(one)[0] for one in jnp.eye(6)]

    rows = losses(actions)
    for k, row in enumerate(rows):
        alone = jax.jit(jax.grad(lambda a, k=k: steps(tape, a[: k + 1])[-1]))(actions)
        within = jax.grad(lambda a, k=k: steps(tape, a)[k])(actions)
        assert same(row, alone) and same(row, within)
        assert not row[k + 1 :].any() and row[: k + 1].any(), k
    try:  # one computation may mix them, which never gives other numbers
        assert same(jax.block_until_ready(jax.jit(losses)(actions)), rows)
    except RuntimeError as error:
        assert "two ways back" in str(error)


def test_states_and_ends_of_episodes():
    tape = tj.Tape("insertion", 6, 3)
    zeros = jnp.zeros((6, 3))
    state, obs = tape.reset(2)
    assert obs["flow"].shape == (6, 4, 13, 10) and obs["flow"].dtype == "float32"
    for _ in range(3):
        before = tape.tape.terminated()
        state, obs, reward = tape.step(state, zeros)
        assert same(state.alive, ~before) and not np.asarray(reward)[before].any()
        assert same(state.success, tape.tape.success())
        assert same(obs["flow"].reshape(6, -1), tape.tape.observations().astype("float32"))
    run = jax.jit(lambda: tape.play(lambda obs, t: zeros, seed=2))()
    assert same(run.success, state.success) and same(run.alive[:, -1], state.alive)
    assert run.observations["flow"].shape == (6, 4, 4, 13, 10)
    assert state.success.any() and not state.success.all() and not state.alive.all()


def test_threads_and_neighbours_change_no_bit():
    given = np.full((20, 6, 3), 0.3, np.float32)

    def gradient(envs, threads):
        def value(actions):
            run = tj.rollout("box_pushing", actions, seed=4, threads=threads)
            return run.rewards.sum() + run.observations["tactile"].sum()

        return jax.jit(jax.grad(value))(given[:envs])

    alone, among, shared = gradient(1, 1), gradient(20, 1), gradient(20, 2)
    assert same(alone[0], among[0]) and same(among, shared) and alone.any()


@pytest.mark.parametrize("devices", [1, 2])  # with two, XLA has two threads
def test_one_core_and_any_device_are_enough(devices):
    # Observations of more than 100 kB, whose copy would wait for the thread that asks for it.
    program = f"""
import os
os.sched_setaffinity(0, {{min(os.sched_getaffinity(0))}})
import sys, tangere
assert "jax" not in sys.modules and "torch" not in sys.modules
import jax, jax.numpy as jnp, tangere.jax
tape = tangere.jax.Tape("cap_opening", num_envs=64, actions=2, flatten=True)
def loss(w):
    return tape.play(lambda obs, t: jnp.tanh(obs @ w)).rewards.sum()
step = jax.jit(lambda w: w + 1e-9 * jax.grad(loss)(w))
ends = []
for device in jax.devices():
    w = jax.device_put(jnp.full((3618, 9), 1e-5), device)
    wide = jax.device_put(jnp.ones((1000, 1000)), device)
    for _ in range(3):  # a call that begins before its argument is there
        w = step(w + 0 * (wide @ wide)[0, 0])
    ends.append(w)
assert len(ends) == {devices}
assert all((end == ends[0]).all() for end in jax.device_get(ends))
"""
    flags = {"XLA_FLAGS": f"--xla_force_host_platform_device_count={devices}"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | flags, timeout=60,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_a_program_ends_in_silence():
    program = """
import jax, jax.numpy as jnp, tangere.jax
tape = tangere.jax.Tape("dummy", 1, 2)
def loss(w):
    return tape.play(lambda obs, t: w * obs["error"]).rewards.sum()
compiled = jax.jit(jax.grad(loss)).lower(jnp.ones(())).compile()
compiled(jnp.ones(()))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_what_a_tape_cannot_do_is_told():
    loss, _ = closed_loop()
    two = jax.tree_util.tree_map(lambda w: np.stack([w, w]), PARAMS)
    for compiled in (jax.jit, lambda f: f):
        with pytest.raises(tangere.InputError, match="vmap"):
            compiled(jax.vmap(loss))(two)
        with pytest.raises(tangere.InputError, match="vmap"):
            compiled(jax.vmap(lambda seed: loss(PARAMS, seed)))(jnp.arange(2))
        with pytest.raises(TypeError, match="forward-mode"):
            compiled(lambda p: jax.jvp(loss, (p,), (p,)))(PARAMS)
        with pytest.raises(TypeError, match="forward-mode"):
            compiled(jax.hessian(loss))(PARAMS)
        with pytest.raises(tangere.InputError, match="second derivatives"):
            compiled(jax.grad(lambda p: jax.grad(loss)(p)["b"].sum()))(PARAMS)


@pytest.mark.parametrize("compiled", [jax.jit, lambda f: f])
def test_runs_that_overlap_are_told(compiled):
    loss, tape = closed_loop()
    action = jnp.full((2, 3), 0.1)

    def told(function, match, *arguments, known=compiled is not jax.jit):
        """`known`: the mistake shows before XLA computes, and the error is ours alone."""
        kind = tangere.InputError if known else (RuntimeError, ValueError)
        with pytest.raises(kind, match=match if known else f"InputError: .*{match}"):
            jax.block_until_ready(compiled(function)(*arguments))

    def twice_from_one_state(action):
        state, _ = tape.reset(1)
        return tape.step(state, action)[2] + tape.step(state, 2 * action)[2]

    told(twice_from_one_state, "last one of its tape", action)
    try:  # XLA may happen to end one run before it begins the other
        both = compiled(jax.grad(lambda p: loss(p, 1) + loss(p, 2)))(PARAMS)
        each = [jax.grad(loss)(PARAMS, seed) for seed in (1, 2)]
        assert close(both, jax.tree_util.tree_map(lambda a, b: a + b, *each), 1e-4)
    except (RuntimeError, ValueError) as error:
        assert "one tape for each" in str(error)
    state, _ = tape.reset(1)
    tape.reset(2)
    told(lambda a: tape.step(state, a)[2], "last one of its tape", action)
    told(lambda a: steps(tape, [a] * 5), "on a tape of 4 actions", action)
    told(lambda a: steps(tape, [a * jnp.nan]), "nan", action)
    told(lambda seed: tape.reset(seed), "seed -1", jnp.int32(-1))
    value, back = jax.vjp(lambda a: steps(tape, [a])[0], action)
    loss(PARAMS)
    told(lambda v: back(v), "begun another one", value, known=False)
    if compiled is not jax.jit:
        told(lambda a: tape.play(lambda obs, t: a, 1).rewards, "nan", action * jnp.nan)
        told(jax.grad(lambda a: steps(tape, [a])[0].sum()), "nan", action * jnp.nan)
    assert np.isfinite(jax.jit(loss)(PARAMS))  # and the tape is as good as new


def test_mistakes_are_told():
    tape = tj.Tape("dummy", 1, 2)
    state, _ = tape.reset()
    for shape in ((1,), (2, 1), (1, 2)):
        with pytest.raises(tangere.InputError, match=r"expected \(1, 1\)"):
            tape.step(state, jnp.zeros(shape))
    for shape in ((2, 3), (2, 0, 1)):
        with pytest.raises(tangere.InputError, match=r"expected \(E, A, na\)"):
            tj.rollout("dummy", jnp.zeros(shape))
    for seed in (-1, 1 << 31):
        with pytest.raises(tangere.InputError, match="expected 0 to 2147483647"):
            tape.reset(seed)
    for seed in (1.5, jnp.zeros(2, int), jnp.ones(())):
        with pytest.raises(TypeError):
            tape.reset(seed)
    for dtype in (jnp.float64, jnp.float16, int):
        with pytest.raises(tangere.InputError, match="jax_enable_x64"):
            tj.Tape("dummy", 1, dtype=dtype)
    assert tj.rollout("dummy", np.zeros((1, 2, 1), int)).rewards.shape == (1, 2)  # arrays, too


def test_simulations_take_what_those_of_pytorch_take():
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    import tangere.torch as tt

    scene = tangere.Scene(tangere.scenes()["rolling_ball_small"])
    jax.config.update("jax_enable_x64", True)
    try:
        options = dict(num_envs=2, steps=3, every=2, read=["pad"], threads=1)
        ours = tj.Simulation(scene, **options, dtype=jnp.float64)
        theirs = tt.Simulation(scene, **options)
        p = ours.parameters("tactile pad kn", "body ball density")
        theirs.parameters(*p)
        assert ours.units == theirs.units
        q = theirs.reset(seed=1).q.numpy().copy()
        q[:, 2] -= 0.0155
        drawn = {"contact pad ball kn": np.array([5.0, 6.0])}
        u = 0.2 * np.random.default_rng(1).standard_normal((3, 2, 2, 3))  # one for each step

        def total(sim, u, p):
            s = sim.reset(q=q if sim is ours else torch.from_numpy(q), randomized=drawn)
            total = 0
            for t in range(3):
                s = sim.step(s, u[t], p if t != 1 else None)
                total = total + (s.bodies**2).sum() + 1e3 * (s["pad"] ** 2).sum()
            return total

        value, bars = jax.jit(jax.value_and_grad(partial(total, ours), argnums=(0, 1)))(u, p)
        leaves = [torch.from_numpy(np.array(x)).requires_grad_() for x in (u, *p.values())]
        expected = total(theirs, leaves[0], dict(zip(p, leaves[1:])))
        expected.backward()
        np.testing.assert_allclose(value, expected.item(), rtol=1e-13)
        in_order = [bars[0], *(bars[1][name] for name in p)]
        for bar, x in zip(in_order, leaves, strict=True):
            np.testing.assert_allclose(bar, x.grad, rtol=1e-9)

        def scanned(p):
            def take(s, u):
                s = ours.step(s, u, p)
                return s, (s.bodies**2).sum()

            return jax.lax.scan(take, ours.reset(seed=1), u)[1].sum()

        by_density = jax.jit(jax.grad(scanned))(p)["body ball density"]
        assert np.isfinite(by_density).all()
        with pytest.raises(tangere.InputError, match="expected names that parameters"):
            ours.reset(parameters=drawn)
        with pytest.raises(tangere.InputError, match="vmap"):
            jax.vmap(lambda q: ours.reset(q=q).q.sum())(q[None])
    finally:
        jax.config.update("jax_enable_x64", False)


def test_numbers_that_a_scene_cannot_have_are_named():
    sim = tj.Simulation(tangere.scenes()["rolling_ball_small"], 1, 3, read=["pad"], threads=1)
    density = "body ball density"
    sim.parameters(density)
    expected = "'body ball density' cannot be density=\"-1\"; expected a positive number"
    rest = jnp.zeros(3)
    for wrong in (
        lambda x: sim.reset(parameters={density: x}).q.sum(),
        lambda x: sim.step(sim.reset(), rest, {density: x}).q.sum(),
        lambda x: sim.reset(randomized={density: x}).q.sum(),
    ):
        for f in (wrong, jax.grad(wrong)):
            with pytest.raises(tangere.InputError, match=expected):
                f(-1.0)
        with pytest.raises(RuntimeError, match=expected):
            jax.block_until_ready(jax.jit(wrong)(-1.0))
    with pytest.raises(tangere.InputError, match="a state that is not finite"):
        sim.reset(q=jnp.full(sim.model.nq, jnp.nan))
    s = sim.reset()
    for _ in range(3):
        s = sim.step(s, rest)
    with pytest.raises(tangere.InputError, match="step.. after 3 calls of it; .* at most steps=3"):
        sim.step(s, rest)
    with pytest.raises(tangere.InputError, match=r"no reading 'foo'; .* has \['pad'\]"):
        s["foo"]
    with pytest.raises(tangere.InputError, match="a state of type NoneType; expected what reset"):
        sim.step(None, rest)
    assert repr(s) == "State(q (1, 10), v (1, 9), pad (1, 32, 32, 3))"
