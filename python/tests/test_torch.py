# SPDX-License-Identifier: Apache-2.0
"""Gradients through PyTorch: closed loops of tasks against differences, and the order of calls."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

import tangere  # noqa: E402
import tangere.torch as tt  # noqa: E402


class Small(torch.nn.Module):
    """A policy that stays away from the bounds, on top of an open-loop action."""

    def __init__(self, task: str, gain: float):
        super().__init__()
        spec = tangere.task_spec(task)
        torch.manual_seed(1)
        n = sum(int(np.prod(t.shape)) for t in spec.observations)
        self.map = torch.nn.Linear(n, spec.action.shape[0])
        with torch.no_grad():
            self.map.weight *= gain
            self.map.bias.zero_()
            self.map.bias += 0.2
        self.high = spec.action.high

    def forward(self, obs):
        return 0.5 * self.high * torch.tanh(self.map(obs))


@pytest.mark.parametrize(
    "task, actions, gain, bound",
    [
        ("dummy", 20, 0.3, 1e-5),
        ("box_pushing", 10, 0.1, 1e-4),
        ("box_pushing_privileged", 20, 0.1, 1e-4),
        ("box_pushing_reduced", 20, 0.1, 1e-4),
        ("cap_opening", 4, 0.01, 1e-4),
        ("cap_opening_blind", 8, 0.05, 1e-4),
        ("ball_rolling_small", 8, 0.001, 1e-4),
        ("stable_grasp", 1, 0.002, 1e-4),
        ("insertion", 1, 0.02, 1e-4),
    ],
)
def test_closed_loops_agree_with_differences(task, actions, gain, bound):
    checks = tt.gradcheck(task, Small(task, gain), actions=actions, num_envs=2, seed=3)
    for check in checks:
        assert check.error < bound, check
    assert any(abs(check.analytic) > 1e-8 for check in checks)


def test_a_rollout_is_that_of_the_environments():
    actions = torch.full((3, 12, 3), 0.4, dtype=torch.float64)
    run = tt.rollout("box_pushing", actions, seed=2, dtype=torch.float64)
    env = tangere.make_vec("box_pushing", 3)
    obs, _ = env.reset(seed=2)
    for t in range(12):
        for key in obs:  # the tape solves its steps to a tighter tolerance
            np.testing.assert_allclose(run.observations[key][:, t], obs[key], atol=2e-3)
        obs, reward, *_ = env.step(actions[:, t].numpy())
        np.testing.assert_allclose(run.rewards[:, t], reward, rtol=1e-4)
    assert run.alive.all() and run.observations["tactile"].shape == (3, 13, 13, 10, 3)
    assert run.observations["tactile"].abs().max() > 0


def test_gradients_by_open_loop_actions():
    torch.manual_seed(0)
    actions = (0.2 * torch.rand(2, 8, 3, dtype=torch.float64)).requires_grad_()
    along = torch.randn_like(actions)

    def value(a):
        run = tt.rollout("box_pushing_privileged", a, seed=1, dtype=torch.float64)
        return run.rewards.sum() + run.observations["box"][:, 1:].pow(2).sum()

    (gradient,) = torch.autograd.grad(value(actions), actions)
    with torch.no_grad():
        step = 1e-6
        difference = (value(actions + step * along) - value(actions - step * along)) / (2 * step)
    assert float((gradient * along).sum()) == pytest.approx(float(difference), rel=1e-5)


def test_a_policy_that_ignores_observations_and_a_loss_of_one_moment():
    tape = tt.Tape("box_pushing_reduced", 2, 5, flatten=True, dtype=torch.float64)
    tape.reset(0)
    actions = [torch.full((2, 3), 0.1, dtype=torch.float64, requires_grad=True) for _ in range(5)]
    rewards = [tape.step(a)[1] for a in actions]
    rewards[2].sum().backward()
    assert all(a.grad.abs().sum() > 0 for a in actions[:3])
    assert all(a.grad is None or (a.grad == 0).all() for a in actions[3:])


def test_a_second_backward_begins_anew():
    tape = tt.Tape("box_pushing_reduced", 2, 4, flatten=True, dtype=torch.float64)
    tape.reset(0)
    action = torch.full((2, 3), 0.1, dtype=torch.float64, requires_grad=True)
    total = sum(tape.step(action)[1].sum() for _ in range(4))
    (one,) = torch.autograd.grad(total, action, retain_graph=True)
    (two,) = torch.autograd.grad(total, action)
    assert torch.equal(one, two)
    with pytest.raises(tangere.InputError, match="second backward.* retain_graph=True"):
        torch.autograd.grad(total, action)


def recorded(steps: int = 6, seed: int = 0):
    """A run of box pushing on tape: its actions, its rewards, and the tape."""
    tape = tt.Tape("box_pushing_reduced", 1, steps, flatten=True, dtype=torch.float64)
    tape.reset(seed)
    actions = [torch.full((1, 3), 0.1 * k, dtype=torch.float64, requires_grad=True)
               for k in range(1, steps + 1)]  # fmt: skip
    return actions, [tape.step(a)[1].sum() for a in actions], tape


def test_losses_of_one_run_do_not_mix():
    actions, rewards, _ = recorded()
    truth = {}
    for k in (2, 5):
        fresh = recorded()
        truth[k] = torch.autograd.grad(fresh[1][k], fresh[0][1])[0]
    for k in (5, 2, 2, 5, 2):
        late = actions[4] if k == 5 else actions[1]
        torch.autograd.grad(rewards[k], late, retain_graph=True)  # this one may stop early
        (found,) = torch.autograd.grad(rewards[k], actions[1], retain_graph=True)
        assert torch.equal(found, truth[k]), k


def test_an_earlier_run_is_played_again():
    actions, rewards, tape = recorded()
    (expected,) = torch.autograd.grad(rewards[5], actions[1], retain_graph=True)
    tape.reset(5)
    for _ in range(6):
        _, other, _ = tape.step(torch.zeros(1, 3, requires_grad=True))
    (found,) = torch.autograd.grad(rewards[5], actions[1], retain_graph=True)
    assert torch.equal(found, expected)
    with pytest.raises(tangere.InputError, match="another run"):
        tape.step(torch.zeros(1, 3))
    (found,) = torch.autograd.grad(rewards[5] + 0 * other.sum(), actions[1])  # of both runs
    assert torch.equal(found, expected)


def test_the_chain_is_not_cut_in_silence():
    _, _, tape = recorded(4)
    tape = tt.Tape("dummy", 1, 5)
    tape.reset()
    tape.step(torch.zeros(1, 1, requires_grad=True))
    with torch.no_grad(), pytest.raises(tangere.InputError, match="no_grad"):
        tape.step(torch.zeros(1, 1))
    quiet = tt.Tape("dummy", 1, 5)
    quiet.reset()
    with torch.no_grad():
        assert not quiet.step(torch.zeros(1, 1))[1].requires_grad


def test_second_derivatives_are_refused():
    actions, rewards, _ = recorded(2)
    with pytest.raises(tangere.InputError, match="it has first derivatives alone"):
        torch.autograd.grad(rewards[1], actions[0], create_graph=True)


def test_gradcheck_leaves_the_policy_alone():
    policy = Small("dummy", 0.1)
    before = [w.clone() for w in policy.parameters()]
    tt.gradcheck("dummy", policy, actions=3, num_envs=1, directions=1)
    for old, new in zip(before, policy.parameters()):
        assert new.dtype == torch.float32 and torch.equal(old, new)


def test_threads_and_neighbours_change_no_bit():
    def gradient(envs, threads):
        tape = tt.Tape("box_pushing", envs, 6, threads=threads, flatten=True)
        policy = Small("box_pushing", 0.1)
        obs, total = tape.reset(4), 0
        scale = torch.ones(envs, 1, requires_grad=True)
        for _ in range(6):
            obs, reward, _ = tape.step(policy(obs) * scale)
            total = total + reward.sum()
        total.backward()
        return scale.grad[0]

    assert torch.equal(gradient(1, 1), gradient(20, 1))
    assert torch.equal(gradient(20, 1), gradient(20, 2))


def test_mistakes_are_told():
    with pytest.raises(tangere.InputError, match="call reset"):
        tt.Tape("dummy", 1).step(torch.zeros(1, 1))
    for shape in ((2, 3), (2, 0, 1)):
        with pytest.raises(tangere.InputError, match=r"expected \(E, A, na\)"):
            tt.rollout("dummy", torch.zeros(shape))
    assert tt.rollout("dummy", np.zeros((1, 2, 1))).rewards.shape == (1, 2)  # arrays, too
    tape = tt.Tape("dummy", 1, 2)
    tape.reset()
    with pytest.raises(tangere.InputError):
        tape.step(torch.full((1, 1), float("nan")))
