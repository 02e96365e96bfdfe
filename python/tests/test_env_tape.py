# SPDX-License-Identifier: Apache-2.0
"""Gradients through time of a task in Python, against those of its twin in C++ and differences."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from ball_rolling import BallRolling

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

import tangere  # noqa: E402
import tangere.torch as tt  # noqa: E402

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
from stable_grasp import StableGrasp  # noqa: E402


class Rolling(BallRolling):
    arrays = "torch"

    def terminated(self):
        return self.batch.q[:, 2] < -0.0158  # the pad is deep in the ball


def policy(obs, weights):
    touch = 1e3 * obs["tactile"].reshape(len(obs["pad"]), -1, 3).sum(1)
    features = torch.cat([100 * obs["pad"], 100 * obs["goal"], touch], 1).double()
    return 0.3 * torch.tanh(features @ weights) + torch.tensor([0.0, 0.0, -0.6])


def played(tape, weights, actions, seed=3):
    obs, total, alive_steps = tape.reset(seed), 0, 0
    for _ in range(actions):
        obs, reward, alive = tape.step(policy(obs, weights))
        total = total + reward
        alive_steps = alive_steps + int(alive.sum())
    return total, alive_steps


def weights():
    random = torch.Generator().manual_seed(2)
    return (0.1 * torch.randn(8, 3, generator=random, dtype=torch.float64)).requires_grad_()


def test_a_closed_loop_has_the_gradient_of_its_twin():
    class Endless(Rolling):
        def terminated(self):
            return torch.zeros(self.num_envs, dtype=torch.bool)

    ours = tt.EnvTape(Endless, 4, dtype=torch.float64, threads=1)
    options = dict(normalise=False, precision="double", dtype=torch.float64, threads=1)
    theirs = tt.Tape("ball_rolling_small", 4, 8, **options)
    theirs.reset(3)
    goals = [theirs.tape.observations()[e][3:5] + theirs.state()[0][e][3:5] for e in range(4)]
    ours.reset(3)
    np.testing.assert_array_equal(ours.env._batch.q, theirs.state()[0])

    def with_goals(seed):
        obs = type(ours).reset(ours, seed)
        ours.env.goal[:] = torch.from_numpy(np.array(goals))
        obs["goal"] = ours.env.observe()["goal"]
        return obs

    ours.reset = with_goals
    w = weights()
    value, _ = played(ours, w, 8)
    (gradient,) = torch.autograd.grad(value.sum(), w)
    expected, _ = played(theirs, w, 8)
    (twin,) = torch.autograd.grad(expected.sum(), w)
    torch.testing.assert_close(value, expected, rtol=1e-9, atol=1e-9)
    torch.testing.assert_close(gradient, twin, rtol=1e-8, atol=1e-10)
    assert float(gradient.abs().max()) > 1e-3


def test_ends_and_differences():
    tape = tt.EnvTape(Rolling, 3, dtype=torch.float64, threads=1)
    w = weights()
    _, steps = played(tape, w, 8)
    assert 0 < steps < 24  # some episodes end early
    checks = tt.check_gradient(lambda: played(tape, w, 8)[0].mean(), [w], directions=2)
    assert max(c.error for c in checks) < 1e-5, checks


def test_the_rewards_are_those_of_the_environment():
    env = Rolling(3, threads=1, seed=3, autoreset="disabled")
    tape = tt.EnvTape(Rolling, 3, threads=1)
    seen, obs = env.reset(seed=3)[0], tape.reset(3)
    for _ in range(3):
        np.testing.assert_allclose(seen["goal"], obs["goal"], atol=1e-7)
        seen, rewards, terminated, _, _ = env.step([0.1, 0.0, -0.05])
        obs, reward, alive = tape.step(torch.tensor([0.1, 0.0, -0.05]))
        assert not terminated.any() and alive.all()
        np.testing.assert_allclose(rewards, reward, rtol=1e-4)  # solved to other tolerances


def test_numbers_that_vary_are_those_of_the_episodes():
    class Heavy(Rolling):
        scene = tangere.Scene(tangere.scenes()["rolling_ball_small"]).vary(["body ball density"])

        def restart(self, envs):
            super().restart(envs)
            drawn = self.uniform(envs, 1, 100)
            self.batch.set_randomized({"body ball density": drawn}, envs=envs)

    tape = tt.EnvTape(Heavy, 3, threads=1)
    tape.reset(1)
    drawn = tape.env.randomized()
    assert np.ptp(drawn["body ball density"]) > 1
    twin = tangere.Batch(tape.env.model, 3, seed=1)
    drawn = {name: x for name, x in drawn.items() if not name.startswith("joint")}
    twin.set_randomized(drawn)
    twin.set_state(tape.env._batch.q, tape.env._batch.v)
    for _ in range(4):
        tape.step(torch.tensor([0.2, 0.0, -1.0]))
    for _ in range(20):
        twin.step([0.2, 0.0, -1.0])
    np.testing.assert_allclose(tape.env.batch.q.numpy(), twin.q, atol=1e-6)
    assert np.ptp(twin.q[:, 3]) > 0


def test_what_is_missing_is_named():
    class Plain(Rolling):
        arrays = "numpy"

    with pytest.raises(tangere.InputError, match="expected a subclass of VectorSceneEnv"):
        tt.EnvTape("ball_rolling", 2)
    with pytest.raises(tangere.InputError, match='arrays "numpy"; expected "torch"'):
        tt.EnvTape(Plain, 2)

    class Late(Rolling):
        def reward(self, actions):
            if self.lengths[0] > 1:
                return self.batch.tactile("pad.sum")[:, 2]
            return actions.sum(1)

    tape = tt.EnvTape(Late, 2, threads=1)
    tape.reset()
    tape.step(torch.zeros(3))
    with pytest.raises(tangere.InputError, match="'pad.sum', which the task did not read"):
        tape.step(torch.zeros(3))
    tape = tt.EnvTape(Late, 2, threads=1, read=["pad.sum"])
    tape.reset()
    for _ in range(3):
        tape.step(torch.zeros(3))
    with pytest.raises(tangere.InputError, match=r"actions of shape \(2, 2\)"):
        tape.step(torch.zeros(2, 2))
    for name in ("q", "v"):  # a tensor could be written
        with pytest.raises(tangere.InputError, match=f"batch.{name}_view .* expected {name}$"):
            getattr(Rolling(2, threads=1).batch, f"{name}_view")


def test_a_task_may_keep_tensors():
    class Progress(Rolling):
        def restart(self, envs):
            super().restart(envs)
            if not hasattr(self, "last"):
                self.last = torch.zeros((self.num_envs, 3), dtype=torch.float64)
            self.last[envs] = 0.0

        def reward(self, actions):
            here = self.batch.q
            here[:, 3:5] -= self.goal  # its own copy
            change, self.last = actions - self.last, actions
            return super().reward(actions) - change.square().sum(1) - here[:, 3].abs()

    tape, w = tt.EnvTape(Progress, 3, threads=1), torch.full((3,), 0.3, requires_grad=True)
    gradients = []
    for _ in range(2):
        tape.reset(1)
        w.grad = None
        sum(tape.step(w * torch.tensor([1.0, 1.0, -0.1]))[1].sum() for _ in range(3)).backward()
        gradients.append(w.grad.clone())
    assert torch.equal(*gradients) and float(gradients[0].abs().max()) > 0


def test_what_a_tape_cannot_do_is_refused():
    class Short(Rolling):
        def simulate(self, controls, envs):
            self.batch.run(controls[:4], every=4, envs=envs)

    tape = tt.EnvTape(Short, 2, threads=1)
    tape.reset()
    with pytest.raises(tangere.InputError, match="simulate.. took 4 steps; expected 5"):
        tape.step(torch.zeros(3))

    class Some(Rolling):
        def simulate(self, controls, envs):
            self.batch.run(controls, every=5, envs=envs[:1])

    tape = tt.EnvTape(Some, 2, threads=1)
    tape.reset()
    with pytest.raises(tangere.InputError, match="of 1 of 2 environments; a tape takes steps of"):
        tape.step(torch.zeros(3))

    class Later(Rolling):
        def simulate(self, controls, envs):
            for part in [controls] if self.lengths[0] == 0 else [controls[:2], controls[2:]]:
                self.batch.run(part, every=len(part), envs=envs)

    tape = tt.EnvTape(Later, 2, threads=1)
    tape.reset()
    tape.step(torch.zeros(3))
    with pytest.raises(tangere.InputError, match="of 2 steps with every=2; expected multiples of"):
        tape.step(torch.zeros(3))

    class Broken(Rolling):
        def reward(self, actions):
            return self.batch.q[:, 3] * float("nan")

    tape = tt.EnvTape(Broken, 2, threads=1)
    tape.reset()
    with pytest.raises(tangere.InputError, match="expected finite numbers"):
        tape.step(torch.zeros(3))
    tape = tt.EnvTape(Rolling, 2, 1, threads=1)
    tape.reset()
    tape.step(torch.zeros(3))
    with pytest.raises(tangere.InputError, match="action 2 of an episode of actions=1; call reset"):
        tape.step(torch.zeros(3))
    with pytest.raises(tangere.InputError, match=r"seed of a tape; expected it in reset\(\)"):
        tt.EnvTape(Rolling, 2, seed=3)
    with pytest.raises(tangere.InputError, match="actions 9; expected 1 to the horizon 8"):
        tt.EnvTape(Rolling, 2, 9)


def test_grasps_are_trained_through_time():
    """A task with a warm-up, controls for each step and a reading within its actions."""
    made = tt.EnvTape(StableGrasp, 3, 2, dtype=torch.float64, threads=1)
    assert made.simulation.every == 60  # of 180: it reads once, after 60 steps
    w = torch.full((520, 1), 1e-3, dtype=torch.float64, requires_grad=True)

    def mean_return():
        obs, total = made.reset(1), 0
        for _ in range(2):
            obs, reward, _ = made.step(torch.tanh(obs["flow"].reshape(3, -1) @ w + 0.1))
            total = total + reward
        return total.mean()

    checks = tt.check_gradient(mean_return, [w], directions=2, steps=(1e-4, 1e-5, 1e-6))
    assert max(abs(c.analytic) for c in checks) > 1e-3
    assert max(c.error for c in checks) < 1e-4, checks
    env = StableGrasp(3, seed=1, threads=1, autoreset="disabled")
    seen = env.reset(seed=1)[0]["flow"]
    np.testing.assert_allclose(made.reset(1)["flow"], seen, atol=1e-6)  # after the warm-up
    _, reward, _ = made.step(torch.full((3, 1), 0.1))
    np.testing.assert_allclose(reward, env.step([0.1])[1], rtol=1e-3)

    tape, actions = tt.EnvTape(StableGrasp, 16, 1, threads=1), torch.zeros(16, 1)
    optimiser = torch.optim.Adam([actions.requires_grad_()], 0.1)
    tilts = []
    for _ in range(8):
        tape.reset(1)
        tape.step(actions)
        tilts.append(tape.env.tilt.mean())
        optimiser.zero_grad()
        tilts[-1].backward()
        optimiser.step()
    assert tilts[-1] < 0.85 * tilts[0], tilts


def test_a_tape_begins_with_loaded_springs():
    class Gripped(tangere.VectorSceneEnv):
        scene = tangere.scenes()["grip_rod"]
        steps_per_action, horizon, arrays = 4, 3, "torch"

        def restart(self, envs):
            self.batch.run(np.tile([0.0, 0.8, 0.8], (60, self.num_envs, 1)), every=60)

        def reward(self, actions):
            return self.batch.q[:, 0] + 1e3 * self.batch.shear_state.square().sum((1, 2))

    tape = tt.EnvTape(Gripped, 2, threads=1, dtype=torch.float64)
    actions = torch.tensor([[0.1, 0.8, 0.7]], dtype=torch.float64).expand(2, 3).clone()
    actions.requires_grad_()

    def total():
        tape.reset(1)
        return sum(tape.step(actions)[1] for _ in range(3)).sum()

    assert max(c.error for c in tt.check_gradient(total, actions, directions=2)) < 1e-5
    tape.reset(1)
    start, batch = tape.env._batch, tangere.Batch(tape.env.model, 2, threads=1)
    assert np.abs(start.shear_state).max() > 1e-5
    batch.set_state(start.q, start.v)  # begins the scheme of two steps anew, as a tape does
    batch.set_shear_state(start.shear_state)
    for _ in range(3):
        tape.step(actions.detach())
        batch.run(np.tile(actions.detach()[0].numpy(), (4, 2, 1)), every=4)
        np.testing.assert_allclose(tape.env.batch.q, batch.q, rtol=1e-5, atol=1e-7)
