# SPDX-License-Identifier: Apache-2.0
"""Derivatives of simulations by places and sizes, and of late and imperfect readings."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

import tangere  # noqa: E402
import tangere.torch as tt  # noqa: E402
from simulation_scenes import CHAIN, loss_of  # noqa: E402


def errors_of(sim, steps, u, names, shared=False):
    """Of a loss of all readings, by controls and parameters: of each environment, or of all."""
    u = u.clone().requires_grad_()
    numbers = [x[0].clone() if shared else x for x in sim.parameters(*names).values()]
    for x in numbers:
        x.requires_grad_()
    q = sim.reset(seed=1).q.clone()
    if sim.model.sensors:
        q[:, 2] -= 0.0155  # the pad touches the ball

    def loss(*_):
        s, total = sim.reset(seed=1, q=q, parameters=dict(zip(names, numbers))), 0
        for t in range(steps):
            s = sim.step(s, u)
            total = total + loss_of(s)
        return total

    return [c.error for c in tt.check_gradient(loss, [u, *numbers])]


def test_places_and_effects_of_joints_and_sizes_have_derivatives():
    stops = 'damping="0.02" armature="0.01" stiffness="0.3" lim="-1 -0.1" lim_stiffness="5"'
    text = CHAIN.replace('damping="0.02"', stops)
    turning = 'damping="0.01" armature="0.002"'
    of = tangere.Scene.from_string(text.replace('damping="0.01"', turning))
    names = [
        "joint arm armature", "joint arm lim_stiffness", "joint arm stiffness", "joint arm pos[2]",
        "joint hand pos[0]", "joint hand pos[1]", "joint hand armature", "body hand size[1]",
        "body arm length",
    ]  # fmt: skip
    sim = tt.Simulation(of, num_envs=2, steps=5, every=3, read=["bodies"])
    assert float(sim.parameters(*names)["joint hand pos[0]"][0]) == 0.2
    u = torch.full((1,), 0.3, dtype=torch.float64)
    assert max(errors_of(sim, 5, u, names)) < 1e-6


def test_sizes_of_bodies_with_points_are_shared():
    text = """<tangere model="box"><option unit="m-kg" gravity="0 0 -9.8" timestep="5e-3"/>
    <ground/><robot><link name="box"><joint name="box" type="free3d" pos="0 0 0"/>
    <body name="box" type="cuboid" size="0.1 0.08 0.06" density="800"
    general_contact_resolution="3 3 3"/></link></robot>
    <contact><ground_contact body="box" kn="2000" kt="2" mu="0.6" damping="1"/></contact>
    <initial><joint name="box" q="0 0 0.0295 1 0 0 0" v="0.1 0 -0.1 0.2 0.1 0"/></initial>
    </tangere>"""
    names = ["body box size[2]", "body box density"]
    of = tangere.Scene.from_string(text)
    sim = tt.Simulation(of, num_envs=2, steps=4, every=2)
    assert max(errors_of(sim, 4, torch.zeros(0), names, shared=True)) < 1e-5
    with pytest.raises(tangere.InputError, match="the same in all environments"):
        sim.reset(parameters={names[0]: torch.tensor([0.06, 0.07])})
    with pytest.raises(tangere.InputError, match="expected a positive number"):
        sim.reset(parameters={names[0]: -0.06})
    s = sim.reset(parameters={names[0]: 0.0602})
    assert sim.parameters()[names[0]].tolist() == [0.0602, 0.0602]
    s = sim.step(s, torch.zeros(0), {names[0]: 0.0602, names[1]: torch.tensor([700.0, 800.0])})
    with pytest.raises(tangere.InputError, match=r"0.07 in a step; expected it in reset"):
        sim.step(s, torch.zeros(0), {names[0]: 0.07})
    sim.reset()
    assert sim.parameters()[names[0]].tolist() == [0.06, 0.06]


def test_late_and_imperfect_readings_have_derivatives():
    text = tangere.scenes()["rolling_ball_small"].read_text()
    j = text.index("/>", text.index('<tactile name="pad"'))
    flaws = (
        '<imperfections low_pass="0.01" delay="0.005" gain="0.1" bias="0.001" crosstalk="0.05"/>'
    )
    markers = '<markers stiffness="300" thickness="0.003" spread="0.002"/>'
    of = tangere.Scene.from_string(f"{text[:j]}>{flaws}{markers}</tactile>{text[j + 2 :]}")
    names = ["pad", "pad.pressure", "pad.ideal", "pad.markers", "pad.sum"]
    numbers = ["tactile pad kn", "body ball density"]
    u = torch.tensor([0.0, 0.2, -0.5], dtype=torch.float64)
    for name in names:
        sim = tt.Simulation(of, num_envs=2, steps=5, read=[name])
        assert max(errors_of(sim, 5, u, numbers)) < 1e-5, name
