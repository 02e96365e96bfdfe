#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes what MuJoCo makes of the robots beside this file: for robot_physics_test.cpp.

    python3 -m venv venv && venv/bin/pip install mujoco
    venv/bin/python tests/data/robots/make_reference.py

For every robot a file NAME_reference.txt of lines: "mass BODY kg" once, then for each random state
"state", and "q", "v", "u", "bias", "acceleration" with a joint and its numbers, "pose" with a body,
the place of its last joint (or of the body, if it has none) and its quaternion w x y z. Coordinates
are those of Tangere: those of a free joint are seen from where it starts, and ref is taken away.
Accelerations are those that MuJoCo calls smooth: without contacts and limits.
"""

import pathlib

import mujoco
import numpy as np

HERE = pathlib.Path(__file__).parent
STATES = 5
FREE, BALL, SLIDE, HINGE = range(4)
Q_COUNT, V_COUNT = {FREE: 7, BALL: 4, SLIDE: 1, HINGE: 1}, {FREE: 6, BALL: 3, SLIDE: 1, HINGE: 1}


def rotation(quat):
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)


def relative(quat, other):
    """The rotation `other` as seen from the frame `quat`."""
    inverse, out = np.zeros(4), np.zeros(4)
    mujoco.mju_negQuat(inverse, quat)
    mujoco.mju_mulQuat(out, inverse, other)
    return out


def load(path):
    assets = {p.name: p.read_bytes() for p in (HERE / "meshes").iterdir()}
    text = path.read_text().replace("package://robots/meshes/", "").replace('meshdir="meshes"', "")
    return mujoco.MjModel.from_xml_string(text, assets)


def line(kind, name, numbers):
    return " ".join([kind, name] + [repr(float(x)) for x in np.atleast_1d(numbers)]) + "\n"


def control(model, i, rng):
    """A control of actuator i, and the same for a motor of Tangere."""
    joint = model.actuator_trnid[i, 0]
    gear = model.actuator_gear[i, 0]
    gain, bias = model.actuator_gainprm[i, 0], model.actuator_biasprm[i]
    if bias[1] != 0:  # a position servo: the target
        target = rng.uniform(-0.3, 0.3)
        return target, target / gear - model.qpos0[model.jnt_qposadr[joint]]
    low, high = model.actuator_ctrlrange[i]
    value = rng.uniform(low, high)
    return value, 2 * (value - low) / (high - low) - 1


def write(path):
    model = load(path)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    text = f"# Made by make_reference.py with MuJoCo {mujoco.__version__}.\n"
    for b in range(1, model.nbody):
        text += line("mass", model.body(b).name, model.body_mass[b])
    for _ in range(STATES):
        text += "state\n"
        q, v = np.zeros(model.nq), rng.normal(size=model.nv)
        u, found = [], {}
        for j in range(model.njnt):
            at, kind = model.jnt_qposadr[j], model.jnt_type[j]
            numbers = rng.normal(size=7)
            if kind in (HINGE, SLIDE):
                q[at] = model.qpos0[at] + (0.6 if kind == HINGE else 0.03) * numbers[0]
            else:
                if kind == FREE:
                    q[at : at + 3] = numbers[4:]
                    at += 3
                q[at : at + 4] = numbers[:4] / np.linalg.norm(numbers[:4])
        for i in range(model.nu):
            data.ctrl[i], ours = control(model, i, rng)
            u.append((model.joint(model.actuator_trnid[i, 0]).name, ours))
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        for name, ours in u:
            text += line("u", name, ours)
        for j in range(model.njnt):
            name, kind = model.joint(j).name, model.jnt_type[j]
            a, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
            coordinates = q[a : a + Q_COUNT[kind]].copy()
            rates, bias, acceleration = (
                x[d : d + V_COUNT[kind]].copy() for x in (v, data.qfrc_bias, data.qacc_smooth)
            )
            if kind in (HINGE, SLIDE):
                coordinates -= model.qpos0[a]
            if kind == FREE:
                body = model.jnt_bodyid[j]
                place, turn = model.body_pos[body], model.body_quat[body]
                back = rotation(turn).T
                coordinates[:3] = back @ (coordinates[:3] - place)
                coordinates[3:] = relative(turn, coordinates[3:])
                for x in (rates, bias, acceleration):
                    x[:3] = back @ x[:3]
            # A planar joint of URDF is three joints in MuJoCo.
            name = name.removesuffix("_TX").removesuffix("_TY").removesuffix("_RZ")
            for what, numbers in (
                ("q", coordinates), ("v", rates), ("bias", bias), ("acceleration", acceleration)
            ):
                found.setdefault((what, name), []).extend(numbers)
        for (what, name), numbers in found.items():
            text += line(what, name, numbers)
        for b in range(1, model.nbody):
            place = data.xpos[b]
            if model.body_jntnum[b] > 0:
                last = model.body_jntadr[b] + model.body_jntnum[b] - 1
                if model.jnt_type[last] != FREE:
                    place = place + rotation(data.xquat[b]) @ model.jnt_pos[last]
            text += line("pose", model.body(b).name, np.concatenate([place, data.xquat[b]]))
    (HERE / f"{path.stem}_reference.txt").write_text(text)


for robot in ("hand.urdf", "machine.xml"):
    write(HERE / robot)
