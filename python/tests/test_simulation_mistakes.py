# SPDX-License-Identifier: Apache-2.0
"""What a user of simulations gets wrong is named, before a number is wrong."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

import tangere  # noqa: E402
import tangere.torch as tt  # noqa: E402
from simulation_scenes import scene  # noqa: E402

BENCH = Path(__file__).parents[2] / "bench/python_simulation.py"


def simulation(**options):
    return tt.Simulation(scene("ball")[0], 1, 3, read=["pad"], threads=1, **options)


@pytest.mark.parametrize("part", ["q", "v", "bodies"])
def test_second_derivatives_are_refused(part):
    sim = simulation()
    u = torch.tensor([[0.0, 0.0, -0.2]], dtype=torch.float64, requires_grad=True)
    kinds = (lambda x: x.sum(), lambda x: x.square().sum())  # the first has constant derivatives

    def read(a):
        return getattr(sim.step(sim.reset(seed=1), a), part)

    for kind in kinds:
        with pytest.raises(tangere.InputError, match="it has first derivatives alone"):
            torch.autograd.functional.hessian(lambda a: kind(read(a)), u)
        with pytest.raises(tangere.InputError, match="it has first derivatives alone"):
            torch.autograd.grad(kind(read(u)) + u.square().sum(), u, create_graph=True)
        assert torch.autograd.grad(kind(read(u)), u)[0].any()
    rest = {"q": sim.reset().q.requires_grad_(), "v": sim.reset().v.requires_grad_()}
    start = getattr(sim.reset(**rest), part)
    with pytest.raises(tangere.InputError, match="it has first derivatives alone"):
        torch.autograd.grad(start.sum(), [*rest.values()], create_graph=True)


@pytest.mark.parametrize("name", ["num_envs", "steps", "every"])
@pytest.mark.parametrize("value", [0, -1, 1.5, "2"])
def test_counts_are_whole_numbers(name, value):
    with pytest.raises(tangere.InputError, match=f"^{name} {value!r}; expected a whole number"):
        tt.Simulation(scene("ball")[0], **{name: value})


def test_a_step_too_many_is_named_as_the_user_counts():
    sim, rest = simulation(), torch.zeros(3)
    s = sim.reset()
    for _ in range(3):
        s = sim.step(s, rest)
    with pytest.raises(tangere.InputError, match="step.. after 3 calls of it; .* at most steps=3"):
        sim.step(s, rest)


def test_names_and_states_of_other_types_are_named():
    sim, rest = simulation(), torch.zeros(3)
    s = sim.reset()
    with pytest.raises(tangere.InputError, match=r"no reading 'foo'; .* has \['pad'\]"):
        s["foo"]
    with pytest.raises(tangere.InputError, match="a state of type NoneType; expected what reset"):
        sim.step(None, rest)
    with pytest.raises(tangere.InputError, match=r"parameters\(\['x'\]\); expected parameters"):
        sim.parameters(["x"])
    assert repr(s) == "State(q (1, 10), v (1, 9), pad (1, 32, 32, 3))"


def test_a_missing_derivative_says_why():
    b = tangere.SceneBuilder("drop")
    b.ground()
    b.default.surface_contact(kn=2e8, kt=2e5, mu=0.8, damping=2e8, ks=1e8)
    ball = b.robot.link("ball")
    ball.joint("ball", "free3d", pos=(0, 0, 0.012))
    ball.body("sphere", radius=0.012, density=800)
    b.contact.surface_contact("ball", "ground")
    sim = tt.Simulation(b.scene())
    with pytest.raises(tangere.InputError, match="ball radius' has no derivative: a size .* ks"):
        sim.parameters("body ball radius")
    assert sim.parameters("body ball density")


def test_the_program_that_the_page_names_runs():
    words = [sys.executable, BENCH, "--envs", "2", "--steps", "1", "--times", "1"]
    ran = subprocess.run(words, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert "| 20 x 20 |" in ran.stdout and "forward and backward" in ran.stdout
