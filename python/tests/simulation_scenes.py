# SPDX-License-Identifier: Apache-2.0
"""Scenes of the tests of simulations, and a loss of their states."""

from __future__ import annotations

from pathlib import Path

import tangere
import torch

SCENES = {
    # A scene, the numbers by which gradients are taken, a loss of a state.
    "ball": ("rolling_ball_small.xml", ["contact pad ball kn", "body ball density"]),
    "rod": ("grip_rod.xml", ["contact rod left_finger kn", "contact rod ground mu"]),
}

CHAIN = """<tangere model="chain"><option unit="m-kg" gravity="0 0 -9.8" timestep="5e-3"
integrator="SDIRK2"/><robot><link name="arm"><joint name="arm" type="revolute" axis="0 1 0"
pos="0 0 1" damping="0.02"/><body name="arm" type="capsule" radius="0.02" length="0.2"
pos="0.1 0 0" density="800"/><link name="hand"><joint name="hand" type="spherical"
pos="0.2 0 0" damping="0.01"/><body name="hand" type="cuboid" size="0.1 0.04 0.03"
pos="0.05 0 0" density="900"/></link></link></robot>
<actuator><motor joint="arm" ctrl="force" ctrl_range="-2 2"/></actuator>
<variable><endeffector joint="hand" pos="0.1 0 0"/></variable></tangere>"""


def scene(name):
    if name == "chain":
        return tangere.Scene.from_string(CHAIN), ["body hand density", "joint arm damping"]
    file, numbers = SCENES[name]
    return tangere.Scene(Path(tangere.__file__).parent / "scenes" / file), numbers


def loss_of(s):
    total = s.v.square().sum() + 10 * (s.q * torch.arange(1.0, s.q.shape[1] + 1)).sum()
    for reading in s.readings.values():
        total = total + 100 * reading.square().sum()
    return total
