# SPDX-License-Identifier: Apache-2.0
"""Any scene as a differentiable function: against differences, and what is refused."""

from __future__ import annotations

import threading

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

import tangere  # noqa: E402
import tangere.torch as tt  # noqa: E402
from simulation_scenes import CHAIN, loss_of, scene  # noqa: E402

def rolled(sim, u, q, v, numbers):
    s = sim.reset(q=q, v=v, parameters=dict(zip(sim.tape.parameters, numbers.T, strict=True)))
    total = loss_of(s)
    for t in range(u.shape[0]):
        s = sim.step(s, u[t])
        total = total + loss_of(s)
    return total


@pytest.mark.parametrize("name", ["chain", "ball", "rod"])
def test_gradients_agree_with_differences(name):
    of, numbers = scene(name)
    sim = tt.Simulation(of, num_envs=2, steps=6, every=2, threads=1)
    named = sim.parameters(*numbers)
    first = sim.reset(seed=3)
    q0, v0 = first.q.clone(), first.v.clone()
    if name == "ball":
        q0[:, 2] -= 0.0155  # the pad touches the ball
    if name == "rod":
        q0[:, 3] += 1e-4  # the rod is in the ground, not just on it; its x points down
    generator = torch.Generator().manual_seed(1)

    def draw(*shape):
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    given = {
        "u": 0.2 * draw(6, 2, sim.model.nu),
        "q": q0,
        "v": v0 + 0.01 * draw(*v0.shape),
        "numbers": torch.stack(list(named.values()), 1),
    }
    at = {key: x.requires_grad_() for key, x in given.items()}
    rolled(sim, **at).backward()
    for key, x in at.items():
        along = draw(*x.shape)
        if key == "numbers":
            along = along * x.detach()
        if key == "q":  # quaternions keep their length
            along[:, -4:] = 0
            along *= 0.01
        errors = []
        for step in (1e-5, 1e-6, 1e-7, 1e-8):  # contacts have kinks that large steps cross
            sides = []
            with torch.no_grad():
                for sign in (1, -1):
                    moved = {k: y.detach() for k, y in at.items()}
                    moved[key] = moved[key] + sign * step * along
                    sides.append(float(rolled(sim, **moved)))
            difference = (sides[0] - sides[1]) / (2 * step)
            analytic = float((x.grad * along).sum())
            errors.append(abs(difference - analytic) / max(abs(difference), abs(analytic)))
        # The rod's height meets a kink at every point that comes to touch.
        bound = {"q": 1e-3, "numbers": 1e-4}.get(key, 3e-6) if name == "rod" else 3e-6
        assert min(errors) < bound, (key, errors)


def test_derivatives_by_quaternions_are_along_the_sphere():
    sim = tt.Simulation(scene("chain")[0], num_envs=1, steps=3)
    q = sim.reset().q.detach()
    turned = torch.tensor([0.9, 0.1, -0.3, 0.2], dtype=torch.float64)
    q[0, 1:] = turned / turned.norm()
    q.requires_grad_()
    s = sim.reset(q=q)
    for _ in range(3):
        s = sim.step(s, torch.tensor([0.1], dtype=torch.float64))
    (s["variables"].square().sum() + s.q[:, 1:].sum()).backward()
    assert abs(float((q.grad[0, 1:] * q.detach()[0, 1:]).sum())) < 1e-12
    # A turn about z of the hand, on the right: δq = q ⊗ (0, θ)/2.
    w, x, y, z = q.detach()[0, 1:].tolist()
    along = 0.5 * torch.tensor([-z, y, -x, w], dtype=torch.float64)

    def at(e):
        with torch.no_grad():
            moved = q.detach().clone()
            moved[0, 1:] += e * along
            moved[0, 1:] /= moved[0, 1:].norm()
            s = sim.reset(q=moved)
            for _ in range(3):
                s = sim.step(s, torch.tensor([0.1], dtype=torch.float64))
            return float(s["variables"].square().sum() + s.q[:, 1:].sum())

    difference = (at(1e-5) - at(-1e-5)) / 2e-5
    assert abs(float((q.grad[0, 1:] * along).sum()) - difference) < 1e-8


def test_bits_do_not_depend_on_the_batch_or_on_gradients():
    of = scene("rod")[0]
    u = torch.full((5, 3), 0.5, dtype=torch.float64)

    def last(num_envs, threads, recorded):
        sim = tt.Simulation(of, num_envs=num_envs, steps=5, every=3, threads=threads)
        controls = u.clone().requires_grad_(recorded)
        s = sim.reset(seed=1)
        for t in range(5):
            s = sim.step(s, controls[t])
        return s.q[0].detach().numpy(), s["left_finger"][0].detach().numpy()

    q, field = last(1, 1, False)
    for other in (last(1, 1, True), last(17, 2, True)):
        np.testing.assert_array_equal(other[0], q)
        np.testing.assert_array_equal(other[1], field)


def test_environments_have_numbers_of_their_own():
    of, numbers = scene("chain")
    sim = tt.Simulation(of, num_envs=2, steps=4)
    own = sim.parameters(*numbers)
    given = {"body hand density": torch.tensor([900.0, 1800.0]), "joint arm damping": 0.2}
    s = sim.reset(parameters=given)
    now = sim.parameters()
    assert list(now) == numbers
    assert now[numbers[0]].tolist() == [900, 1800] and now[numbers[1]].tolist() == [0.2, 0.2]
    assert sim.units == {numbers[0]: "kg/m^3", numbers[1]: "N m s/rad"}
    for _ in range(4):
        s = sim.step(s, torch.zeros(1))
    assert not torch.equal(s.q[0], s.q[1])
    sim.reset()  # the scene's own
    assert {name: x.tolist() for name, x in own.items()} == {
        numbers[0]: [900.0] * 2,
        numbers[1]: [0.02] * 2,
    }
    for name, x in sim.parameters().items():
        assert torch.equal(x, own[name])


def test_what_cannot_be_done_is_refused():
    of, _ = scene("chain")
    with pytest.raises(tangere.InputError, match="that may vary is named 'weight'"):
        tt.Simulation(of).parameters("weight")
    with pytest.raises(tangere.InputError, match=" mass'"):
        tt.Simulation(of).parameters("body arm mass")
    with pytest.raises(tangere.InputError, match="expected names that parameters"):
        tt.Simulation(of).reset(parameters={"joint arm damping": 1})
    with pytest.raises(tangere.InputError, match="no reading 'pad'; expected one of variables"):
        tt.Simulation(of, read=["pad"])
    with pytest.raises(tangere.InputError, match="read 'pad'; expected a list of names"):
        tt.Simulation(of, read="pad")
    with pytest.raises(tangere.InputError, match="points=True"):
        tt.Simulation(of).reset(points={})
    with pytest.raises(tangere.InputError, match="expected sensors of"):
        tt.Simulation(of, points=True).reset(points={"pad": torch.zeros(1, 7)})
    sim = tt.Simulation(of, num_envs=2, steps=2)
    first = sim.reset()
    u = torch.zeros(1, requires_grad=True)
    second = sim.step(first, u)
    with pytest.raises(tangere.InputError, match="expected its last state"):
        sim.step(first, u)
    with torch.no_grad(), pytest.raises(tangere.InputError, match="no_grad"):
        sim.step(second, u)
    with pytest.raises(tangere.InputError, match="controls of shape"):
        sim.step(second, torch.zeros(2, 3))
    with pytest.raises(tangere.InputError, match=r"expected \(2, 1\) or \(1, 2, 1\)"):
        sim.step(second, torch.zeros(3, 2, 1))
    with pytest.raises(tangere.InputError, match="q of shape"):
        sim.reset(q=torch.zeros(2, 3))
    s = sim.reset()
    for _ in range(2):
        s = sim.step(s, u)
    with pytest.raises(tangere.InputError, match="at most steps=2"):
        sim.step(s, u)
    s.v.sum().backward()
    with pytest.raises(tangere.InputError, match="second backward"):
        s.v.sum().backward()


def test_a_scene_without_motors_has_gradients_by_its_start():
    text = CHAIN.replace("<actuator>", "<!--").replace("</actuator>", "-->")
    sim = tt.Simulation(tangere.Scene.from_string(text), num_envs=2, steps=5)
    q = sim.reset().q.clone().requires_grad_()
    s = sim.reset(q=q)
    for _ in range(5):
        s = sim.step(s, torch.zeros(0))
    s.q[:, 0].sum().backward()
    assert float(q.grad[0, 0]) > 0.5  # of the angle after 25 ms by the first one


def test_readings_are_those_of_a_batch():
    file = tangere.Scene(tangere.scenes()["grip_rod"])
    names = ["left_finger.sum", "right_finger.pressure", "left_finger.flow", "bodies", "bodies.rod"]
    sim = tt.Simulation(file, num_envs=2, steps=40, every=4, read=names, threads=1)
    s = sim.reset(seed=1)
    for _ in range(40):
        s = sim.step(s, torch.tensor([0.0, 0.8, 0.8]))
    batch = tangere.Batch(sim.model, 2)
    batch.set_state(s.q.numpy(), s.v.numpy())
    assert list(s.readings) == names
    for name in names[:3]:
        largest = float(s[name].abs().max())  # a batch reads in mixed precision
        np.testing.assert_allclose(s[name], batch.tactile(name), rtol=0, atol=1e-5 * largest)
        assert largest > 0
    poses = np.concatenate(batch.bodies(), 2)
    np.testing.assert_array_equal(s["bodies"], poses)
    np.testing.assert_array_equal(s["bodies.rod"], poses[:, 3])


def test_another_thread_reads_no_scene_that_is_compiled_anew():
    tape = tt.Simulation(scene("ball")[0], num_envs=2, steps=2, read=["pad"], points=True).tape
    count, enough = tape.points, threading.Event()

    def move():
        for k in range(200):
            if not enough.is_set():
                tape.reset(points=np.full((count, 7), 1e-9 * (k + 1)))

    runner = threading.Thread(target=move)
    runner.start()
    uses = {
        "model": lambda: tape.model, "spec": lambda: tape.spec, "taken": lambda: tape.taken,
        "points": lambda: tape.points, "status": tape.status,
        "check_step": lambda: tape.check_step(np.zeros((2, 1, 3))),
    }  # fmt: skip
    refused = set()
    while runner.is_alive() and len(refused) < len(uses):
        for name, use in uses.items():
            try:
                use()
            except tangere.InputError as error:
                assert "in use by another thread" in str(error)
                refused.add(name)
    enough.set()
    runner.join()
    assert refused == set(uses)
    assert tape.points == count and tape.model.nq == 10


def test_points_move():
    scene = tangere.Scene(tangere.scenes()["rolling_ball_small"])
    sim = tt.Simulation(scene, num_envs=2, steps=2, read=["pad"], points=True)
    q = sim.reset(seed=1).q.clone()
    q[:, 2] -= 0.0155
    still = sim.reset(seed=1, q=q)["pad"]
    assert float(still.abs().max()) > 0
    deeper = torch.zeros(1024, 7, dtype=torch.float64)
    deeper[:, 2] = -1e-4
    field = sim.reset(seed=1, q=q, points={"pad": deeper})["pad"]
    assert field.shape == still.shape == (2, 32, 32, 3)
    touched = still[..., 2].abs() > 0
    assert bool((field[..., 2].abs() > still[..., 2].abs())[touched].all())
    torch.testing.assert_close(sim.reset(seed=1, q=q)["pad"], still, rtol=0, atol=0)

def test_a_users_loss_is_checked_in_one_call():
    of, names = scene("chain")
    sim = tt.Simulation(of, num_envs=2, steps=4, every=2)
    u = torch.full((4, 1), 0.3, dtype=torch.float64, requires_grad=True)
    parameters = torch.stack(list(sim.parameters(*names).values()), 1).requires_grad_()

    def loss(u=u, parameters=parameters):
        s, total = sim.reset(parameters=dict(zip(names, parameters.unbind(-1), strict=True))), 0
        for t in range(4):
            s = sim.step(s, u[t])
            total = total + s["variables"].square().sum()
        return total

    checks = tt.check_gradient(loss, [u, parameters])
    assert len(checks) == 3 and max(c.error for c in checks) < 1e-6, checks
    assert float(u.detach()[0, 0]) == 0.3

    def wrong():
        return loss() + (u - u.detach()).sum()  # a derivative of 1 by each, but no value

    assert min(c.error for c in tt.check_gradient(wrong, [u, parameters])) > 1e-3
    small = torch.tensor([900.0, 0.02], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(loss, (u, small), eps=1e-6, atol=1e-7, rtol=1e-4)


def test_nothing_is_recorded_without_gradients():
    sim = tt.Simulation(scene("chain")[0], num_envs=2, steps=2)
    u = torch.zeros(1, requires_grad=True)
    recorded = sim.step(sim.reset(), u)
    with torch.no_grad():
        first = sim.reset()
        s = sim.step(first, u)
    assert torch.equal(s.q, recorded.q) and not s.q.requires_grad
    with pytest.raises(tangere.InputError, match="records nothing"):
        sim.step(s, u)


def test_what_a_scene_could_not_have_is_refused():
    sim = tt.Simulation(scene("ball")[0], num_envs=2, steps=2, read=["pad"], points=True)
    sim.parameters("contact pad ball kn")
    q = sim.reset().q.clone()
    with pytest.raises(tangere.InputError, match="not finite"):
        sim.reset(q=q * float("nan"))
    flat = q.clone()
    flat[:, -4:] = 0
    with pytest.raises(tangere.InputError, match="expected a unit quaternion"):
        sim.reset(q=flat)
    long = q.clone()
    long[:, -4:] *= 2
    torch.testing.assert_close(sim.reset(q=long).q, q)
    for bad in (-5.0, float("nan")):
        with pytest.raises(tangere.InputError, match="contact pad ball kn"):
            sim.reset(parameters={"contact pad ball kn": bad})
        with pytest.raises(tangere.InputError, match="contact pad ball kn"):
            sim.step(sim.reset(), torch.zeros(3), {"contact pad ball kn": bad})
    with pytest.raises(tangere.InputError, match=r"of shape \(3,\); expected \(2,\) or \(\)"):
        sim.reset(parameters={"contact pad ball kn": torch.ones(3)})
    moved = torch.zeros(1024, 7)
    moved[3, 0] = float("nan")
    with pytest.raises(tangere.InputError, match="not finite"):
        sim.reset(points={"pad": moved})
    moved[3] = torch.tensor([0, 0, 0, -2.0, 0, 0, 0])
    with pytest.raises(tangere.InputError, match="a point of 'pad' with a negative coefficient"):
        sim.reset(points={"pad": moved})
    assert torch.equal(sim.reset(q=q[:1], points={"pad": np.zeros((1024, 7))}).q[1], q[0])


def test_a_late_run_has_the_numbers_that_it_began_with():
    sim = tt.Simulation(scene("ball")[0], num_envs=2, steps=1, every=5, read=["pad"])
    u = torch.tensor([0.0, 0.1, -1.0], dtype=torch.float64, requires_grad=True)
    drawn = np.array([2.0, 3.0])

    def loss():
        s = sim.step(sim.reset(1, randomized={"contact pad ball kn": drawn}), u)
        return s.q.square().sum()

    (expected,) = torch.autograd.grad(loss(), u)
    late = loss()
    drawn[:] = 9
    sim.reset(2)
    assert torch.equal(torch.autograd.grad(late, u)[0], expected)
    with pytest.raises(tangere.InputError, match="uses none of the tensors"):
        tt.check_gradient(loss, torch.zeros(3, dtype=torch.float64, requires_grad=True))
    assert len(tt.check_gradient(loss, u, directions=1)) == 1


def pressed(sim, **given):
    """A run in which the pad presses on the ball, from its first state on."""
    q = sim.reset(seed=1).q.detach().clone()
    q[:, 2] -= 0.0155
    return sim.reset(seed=1, q=q, **given)


def ball(**options):
    return tt.Simulation(scene("ball")[0], num_envs=2, threads=1, **options)


def test_steps_take_parameters_by_name():
    sim = ball(steps=4, every=2, read=["pad", "pad.sum"])
    p = sim.parameters("tactile pad kn", "body ball radius")
    assert {name: x.shape for name, x in p.items()} == dict.fromkeys(p, (2,))
    assert sim.units == {"tactile pad kn": "N/m", "body ball radius": "m"}
    u = torch.tensor([0.0, 0.2, -0.5], dtype=torch.float64)
    for x in p.values():
        x.requires_grad_()

    def total(at_start, at_steps):
        s, total = pressed(sim, parameters=at_start), 0
        for t in range(4):
            s = sim.step(s, u, at_steps(t))
            total = total + 1e3 * s["pad"].square().sum() + s.q.square().sum()
        return total

    def gradient(at_start, at_steps):
        value = total(at_start, at_steps)
        bars = torch.autograd.grad(value, [*p.values()])
        return torch.stack([value.detach(), *(x.abs().sum() for x in bars)])

    once = gradient(p, lambda t: None)
    torch.testing.assert_close(gradient(p, lambda t: p), once, rtol=1e-12, atol=0)
    kept = {name: x.detach() for name, x in p.items()}
    # The start reads nothing that the loss uses, so that the first step has all of it.
    torch.testing.assert_close(gradient(kept, lambda t: p if t == 0 else None), once)
    # A step may bring some of them; the others are those of before.
    some = gradient(p, lambda t: {"tactile pad kn": p["tactile pad kn"]} if t == 2 else None)
    torch.testing.assert_close(some, once, rtol=1e-12, atol=0)
    shared = torch.tensor(p["body ball radius"][0].item(), requires_grad=True, dtype=torch.float64)
    value = total(None, lambda t: {"body ball radius": shared})
    (by_shared,) = torch.autograd.grad(value, shared)
    expected = torch.autograd.grad(total(None, lambda t: p), p["body ball radius"])[0].sum()
    torch.testing.assert_close(by_shared, expected, rtol=1e-12, atol=0)


def test_numbers_may_change_from_step_to_step_on_any_tape():
    def gradients(tape_bytes):
        sim = ball(steps=6, every=5, read=["pad.sum"], tape_bytes=tape_bytes)
        name = "contact pad ball kn"
        kn = sim.parameters(name)[name]
        each = (kn * torch.linspace(1, 2, 6, dtype=torch.float64)[:, None]).requires_grad_()
        u = torch.full((6, 3), -0.2, dtype=torch.float64, requires_grad=True)
        s, total = pressed(sim), 0
        for t in range(6):
            s = sim.step(s, u[t], {name: each[t]} if t != 3 else None)
            total = total + s["pad.sum"][:, :3].square().sum() + 1e3 * s.q.square().sum()
        return torch.autograd.grad(total, [each, u])

    whole, again = gradients(1e9), gradients(6e5)
    assert all(torch.equal(a, b) for a, b in zip(whole, again))
    assert not whole[0][3].any() and bool((whole[0][[0, 1, 2, 4, 5]] != 0).all())


def test_parameters_may_be_named_in_the_midst_of_a_run():
    sim, u = ball(steps=3, every=5, read=["pad"]), torch.tensor([0.0, 0.1, -1.0])
    s = sim.step(pressed(sim), u)
    p = sim.parameters("tactile pad kt")
    p["tactile pad kt"].requires_grad_()
    last = sim.step(s, u, p)
    last["pad"].square().sum().backward()
    assert float(p["tactile pad kt"].grad.abs().min()) > 0
    batch = tangere.Batch(sim.model, 2)
    batch.set_state(s.q.detach().numpy(), s.v.detach().numpy())
    np.testing.assert_array_equal(s.bodies.detach(), np.concatenate(batch.bodies(), 2))


def test_bodies_need_not_be_named():
    of = scene("chain")[0]
    named, other = (
        tt.Simulation(of, num_envs=18, steps=3, read=read) for read in (["bodies"], [])
    )
    weights = torch.linspace(-1, 1, 26, dtype=torch.float64).reshape(2, 13)
    results = []
    for sim in (named, other):
        u = torch.full((3, 1), 0.4, dtype=torch.float64, requires_grad=True)
        q = sim.reset().q.clone().requires_grad_()
        states = [sim.reset(q=q)]
        for t in range(3):
            states.append(sim.step(states[-1], u[t]))
        bodies = torch.stack([s.bodies for s in states])  # also of states that are over
        total = (weights * bodies).square().sum()
        results.append([bodies.detach(), *torch.autograd.grad(total, [u, q])])
    assert "bodies" not in states[0].readings
    for ours, theirs in zip(*results):
        torch.testing.assert_close(ours, theirs, rtol=1e-12, atol=1e-14)


def test_a_run_goes_on_from_the_springs_of_another():
    rod = scene("rod")[0]
    first, second = (
        tt.Simulation(rod, num_envs=2, steps=3, every=every, read=["shear_state", "left_finger"])
        for every in (25, 2)
    )
    u = torch.tensor([[0.0, 0.8, 0.8], [0.01, 0.8, 0.79]], dtype=torch.float64, requires_grad=True)

    def total(carried=True):
        s = first.reset(seed=1)
        for _ in range(3):
            s = first.step(s, u[0])
        state = {"q": s.q, "v": s.v, "shear_state": s.shear_state if carried else None}
        s = second.reset(**state)
        assert torch.equal(s.shear_state, state["shear_state"]) if carried else True
        s = second.step(s, u[1])
        return 1e3 * s["left_finger"].square().sum() + 1e6 * s.shear_state.square().sum()

    assert float(total().detach()) != float(total(carried=False).detach())
    checks = tt.check_gradient(total, u)
    assert max(c.error for c in checks) < 1e-4, checks  # points come to slip nearby
    s = tt.Simulation(rod, steps=1).reset()
    with pytest.raises(tangere.InputError, match="shear_state .* expected it in read="):
        s.shear_state
    with pytest.raises(tangere.InputError, match="expected one of .*"):
        ball(read=["shear_state"])
    with pytest.raises(tangere.InputError, match=r"shear_state of shape .*; expected \(2, "):
        second.reset(shear_state=torch.zeros(2, 3))


def test_each_step_may_have_controls_of_its_own():
    u = 0.3 * torch.randn(2, 5, 2, 3, generator=torch.Generator().manual_seed(1)).double()
    u.requires_grad_()
    results = []
    for every in (5, 1):
        sim = ball(steps=10 // every, every=every, read=["pad.sum"])
        s = pressed(sim)
        for t in range(2):
            for part in [u[t]] if every == 5 else u[t]:
                s = sim.step(s, part)
        total = s.q.square().sum() + s["pad.sum"].square().sum()
        results.append([s.q.detach(), *torch.autograd.grad(total, u)])
    torch.testing.assert_close(*results, rtol=1e-12, atol=0)


def test_what_transforms_cannot_do_is_named():
    sim = ball(steps=1)
    u = torch.zeros(2, 3, dtype=torch.float64)

    def loss(u):
        return sim.step(sim.reset(), u).bodies.sum()

    expected = "expected backward.. or torch.autograd.grad.. .* num_envs for a batch"
    with torch.autograd.forward_ad.dual_level():
        dual = torch.autograd.forward_ad.make_dual(u, torch.ones_like(u))
        with pytest.raises(tangere.InputError, match=expected):
            loss(dual)
        with pytest.raises(tangere.InputError, match=expected):
            sim.reset(q=dual)
        with pytest.raises(tangere.InputError, match=expected):
            tt.rollout("dummy", torch.autograd.forward_ad.make_dual(u[:, :1, None], u[:, :1, None]))
    with pytest.raises(tangere.InputError, match=expected):
        torch.autograd.functional.jacobian(
            lambda u: sim.step(sim.reset(), u).q[:, 0], u, vectorize=True
        )
    func = pytest.importorskip("torch.func" if hasattr(torch, "func") else "functorch")
    for transformed in (func.vmap(loss), func.grad(loss), lambda u: func.jvp(loss, (u,), (u,))):
        with pytest.raises(tangere.InputError, match=expected):
            transformed(u[None].expand(2, 2, 3).clone())


def test_a_reset_that_fails_ends_the_run():
    sim, u = ball(steps=3), torch.zeros(3, dtype=torch.float64, requires_grad=True)
    s = sim.step(sim.reset(), u)
    flat = s.q.detach().clone()
    flat[:, -4:] = 0
    with pytest.raises(tangere.InputError, match="unit quaternion"):
        sim.reset(q=flat)
    with pytest.raises(tangere.InputError, match="a reset.. that failed"):
        sim.step(s, u)
    s.v.sum().backward()  # it is played again
    assert float(u.grad.abs().max()) > 0


def test_gradcheck_of_what_steps_and_resets_take():
    chain = tt.Simulation(scene("chain")[0], num_envs=2, steps=3, every=2)
    name = "joint arm damping"
    damping = chain.parameters(name)[name]

    def swung(u, damping):
        s = chain.reset()
        for t in range(3):
            s = chain.step(s, u[t], {name: damping[t]})
        return s["variables"], s.bodies

    each = damping.expand(3, 2).clone().requires_grad_()
    u = torch.full((3, 2, 2, 1), 0.3, dtype=torch.float64, requires_grad=True)  # of each step
    assert torch.autograd.gradcheck(swung, (u, each), eps=1e-6, atol=1e-7, rtol=1e-4)

    rod = tt.Simulation(scene("rod")[0], 1, 40, every=2, read=["shear_state", "left_finger.sum"])
    grip = torch.tensor([0.0, 0.8, 0.8], dtype=torch.float64)
    with torch.no_grad():
        s = rod.reset()
        for _ in range(40):
            s = rod.step(s, grip)
    springs = s.shear_state
    assert float(springs.abs().max()) > 1e-5

    def held(scale):
        first = rod.reset(q=s.q, v=s.v, shear_state=scale * springs)
        return rod.step(first, grip)["left_finger.sum"][:, :3].square().sum()

    scale = torch.ones((), dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(held, scale, eps=1e-6, atol=1e-9, rtol=1e-4)
    assert float(torch.autograd.grad(held(scale), scale)[0]) != 0


def test_numbers_without_derivatives():
    sim = ball(steps=1, points=True, read=["pad"])
    drawn = {"contact pad ball kn": np.array([2.0, 3.0])}
    sim.reset(randomized=drawn)
    column = sim.model.scene.varying.index("contact pad ball kn")
    assert sim.tape.varying()[:, column].tolist() == [2, 3]
    with pytest.raises(tangere.InputError, match="is of the starting state; expected a parameter"):
        sim.reset(randomized={sim.model.scene.varying[0]: 1.0})
    with pytest.raises(tangere.InputError, match="that varies is named 'mass'"):
        sim.reset(randomized={"mass": 1.0})
    s = sim.reset()
    with pytest.raises(tangere.InputError, match="in a step of a simulation with points=True"):
        sim.step(s, torch.zeros(3), sim.parameters("tactile pad kn"))
