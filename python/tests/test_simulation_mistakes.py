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


def test_the_program_that_the_page_names_runs():
    words = [sys.executable, BENCH, "--envs", "2", "--steps", "1", "--times", "1"]
    ran = subprocess.run(words, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert "| 20 x 20 |" in ran.stdout and "forward and backward" in ran.stdout
