# SPDX-License-Identifier: Apache-2.0
"""Random scenes that touch: a driven hand with a skin on an object, with what scenes can have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SHAPES = ("sphere", "cuboid", "capsule", "cylinder", "ellipsoid", "mesh")
CUBE = "-.02 -.02 -.02  .02 -.02 -.02  .02 .02 -.02  -.02 .02 -.02 " \
       "-.02 -.02 .02  .02 -.02 .02  .02 .02 .02  -.02 .02 .02"  # fmt: skip
SIDES = "0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7"


@dataclass
class RandomScene:
    text: str
    parameters: list[str]
    read: list[str]
    points: bool  #: derivatives by points of the skin are known: it has no ks
    springs: bool  #: some contact or the skin has ks


def _body(shape: str, random: np.random.Generator) -> str:
    size = 0.04 * random.uniform(0.9, 1.1, 3)
    sizes = {
        "sphere": 'radius="0.02"',
        "cuboid": f'size="{size[0]} {size[1]} 0.04" general_contact_resolution="3 3 3"',
        "capsule": 'radius="0.02" length="0.03" quat="0.7071067811865476 0 0.7071067811865476 0"'
        ' general_contact_resolution="6 12"',
        "cylinder": 'radius="0.02" length="0.04"',
        "ellipsoid": f'size="{size[0]} {size[1]} 0.04" general_contact_resolution="60"',
        "mesh": f'vertices="{CUBE}" triangles="{SIDES}" transform_type="OBJ_TO_JOINT" '
        'pitch="0.01" resolution="16"',
    }
    return f'<body name="object" type="{shape}" {sizes[shape]} density="{random.uniform(4, 9)}e2"/>'


def random_scene(seed: int) -> RandomScene:
    random = np.random.default_rng(seed)
    shape = SHAPES[seed % len(SHAPES)]
    surfaces, springs = seed % 3 == 0, seed % 2 == 1
    feedback, integrator = seed % 5 == 4, ("BDF1", "BDF2", "SDIRK2")[seed % 3]
    elastic = 'ks="20"' if springs else ""
    law = f'kn="{random.uniform(100, 200)}" kt="1" mu="0.7" damping="1e2" {elastic}'
    if surfaces:
        elastic = 'ks="1e6"' if springs else ""
        law = f'kn="{random.uniform(1, 2)}e7" kt="1e4" mu="0.7" damping="1e7" {elastic}'
    joint = ("free3d", "free3d-exp", "free3d-euler")[int(random.integers(3))]
    axis = random.uniform(-0.2, 0.2, 2)
    kind = "surface_contact" if surfaces else "general_primitive_contact"
    bodies = 'body1="object" body2="pad"' if surfaces else \
        'general_body="object" primitive_body="pad"'  # fmt: skip
    ground = f'<surface_contact body1="object" body2="ground" {law}/>' if surfaces else \
        f'<ground_contact body="object" {law}/>'  # fmt: skip
    skin = 'ks="1"' if seed % 4 == 3 and not feedback else ""
    touch = "" if feedback else f"<{kind} {bodies} {law}/>"
    text = f"""<tangere model="random_{seed}">
<option unit="m-kg" gravity="0 0 -9.8" timestep="2e-3" integrator="{integrator}"/>
<solver_option tol="1e-13"/><ground pos="0 0 0" normal="0 0 1"/>
<robot><link name="arm"><joint name="lift" type="prismatic" axis="0 0 1" pos="0 0 0.0485"
damping="3" stiffness="20"/><body name="arm" type="cuboid" size="0.02 0.02 0.02" pos="0 0 0.1"
density="500"/>
<link name="hand"><joint name="turn" type="revolute" axis="{axis[0]} 1 {axis[1]}" damping="0.01"/>
<body name="pad" type="cuboid" size="0.06 0.06 0.02" density="500"/></link></link></robot>
<robot><link name="object"><joint name="object" type="{joint}" pos="0 0 0.0195"/>
{_body(shape, random)}</link></robot>
<actuator><motor joint="lift" ctrl="force" ctrl_range="-10 10"/>
<motor joint="turn" ctrl="position" P="2" D="0.02"/></actuator>
<contact>{touch}{ground}</contact>
<sensor><tactile name="pad" body="pad" type="rect_array" rect_pos0="-0.02 -0.02 -0.01"
rect_pos1="0.02 0.02 -0.01" axis0="1 0 0" axis1="0 1 0" resolution="5 6" kn="100" kt="0.5" mu="0.6"
damping="50" {skin} feedback="{"true" if feedback else "false"}">
<markers stiffness="22.4" thickness="0.003" spread="0.005"/></tactile></sensor>
<variable><endeffector name="tip" joint="turn" pos="0.03 0 0"/></variable></tangere>"""
    parameters = ["body object density", "body arm size[0]", "joint turn damping", "motor turn P"]
    parameters += [] if feedback else ["contact object pad kn", "tactile pad kt", "tactile pad mu"]
    read = ["pad", "pad.sum", "pad.markers", "pad.shear", "pad.pressure", "bodies", "tip"]
    read += ["shear_state"] if springs or skin else []
    return RandomScene(text, parameters, read, not skin, springs or bool(skin))
