#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes what MuJoCo makes of the robots beside this file: for robot_physics_test.cpp.

    python3 -m venv venv && venv/bin/pip install mujoco
    venv/bin/python tests/data/robots/make_reference.py

For every robot a file NAME_reference.txt of lines: "mass BODY kg" once, then for each random state
"state", and "q", "v", "u", "bias", "acceleration" with a joint and its numbers, "pose" with a body,
the place of its last joint (or of the body, if it has none) and its quaternion w x y z, "site" with
a site and its place. The last state of a file with keyframes is that of its last one. Coordinates
are those of Tangere: those of a free joint are seen from where it starts, and ref is taken away.
Controls are those of the file; a joint has those of its actuators in their order. Bodies keep the
frames that their file gives: where MuJoCo aligns a free joint with an inertia, the site BODY_origin
says where that frame is in the keyframe.
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


def load(path, aligned=False):
    assets = {p.name: p.read_bytes() for p in (HERE / "meshes").iterdir()}
    assets |= {p.name: p.read_bytes() for p in HERE.glob("*part.xml")}
    text = path.read_text().replace("package://robots/meshes/", "").replace('meshdir="meshes"', "")
    if not aligned:
        text = text.replace('align="true"', "").replace('alignfree="true"', "")
    return mujoco.MjModel.from_xml_string(text, assets)


def load_keyframe(path, model, data):
    """Sets the last keyframe, in the frames of `model`."""
    other = load(path, aligned=True)
    key = mujoco.MjData(other)
    mujoco.mj_resetDataKeyframe(other, key, other.nkey - 1)
    mujoco.mj_normalizeQuat(other, key.qpos)
    mujoco.mj_forward(other, key)
    data.qpos[:], data.qvel[:], data.ctrl[:] = key.qpos, key.qvel, key.ctrl
    sites = [model.site(s).name for s in range(model.nsite)]
    for j in range(model.njnt):
        site = model.body(model.jnt_bodyid[j]).name + "_origin"
        if model.jnt_type[j] != FREE or site not in sites:
            continue
        s, a, d = model.site(site).id, model.jnt_qposadr[j], model.jnt_dofadr[j]
        twist = np.zeros(6)
        mujoco.mj_objectVelocity(other, key, mujoco.mjtObj.mjOBJ_SITE, s, twist, 0)
        data.qpos[a : a + 3] = key.site_xpos[s]
        mujoco.mju_mat2Quat(data.qpos[a + 3 : a + 7], key.site_xmat[s])
        data.qvel[d : d + 3] = twist[3:]
        data.qvel[d + 3 : d + 6] = key.site_xmat[s].reshape(3, 3).T @ twist[:3]


def line(kind, name, numbers):
    return " ".join([kind, name] + [repr(float(x)) for x in np.atleast_1d(numbers)]) + "\n"


def is_servo(model, i):
    return model.actuator_biasprm[i, 1] != 0


def control_range(model, i):
    """A range of controls, of which a limited one is a part."""
    if not model.actuator_ctrllimited[i]:
        return (-0.3, 0.3) if is_servo(model, i) else (-1, 1)
    low, high = model.actuator_ctrlrange[i]
    beyond = 0.2 * (high - low)
    return low - beyond, high + beyond


def is_off(model, i):
    return model.opt.disableactuator >> model.actuator_group[i] & 1


def draw_state(model, data, rng):
    data.qvel[:] = rng.normal(size=model.nv)
    for j in range(model.njnt):
        at, kind = model.jnt_qposadr[j], model.jnt_type[j]
        numbers = rng.normal(size=7)
        if kind in (HINGE, SLIDE):
            data.qpos[at] = model.qpos0[at] + (0.6 if kind == HINGE else 0.03) * numbers[0]
        else:
            if kind == FREE:
                data.qpos[at : at + 3] = numbers[4:]
                at += 3
            data.qpos[at : at + 4] = numbers[:4]
    for i in range(model.nu):
        data.ctrl[i] = rng.uniform(*control_range(model, i))


def write(path):
    model = load(path)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    text = f"# Made by make_reference.py with MuJoCo {mujoco.__version__}.\n"
    for b in range(1, model.nbody):
        text += line("mass", model.body(b).name, model.body_mass[b])
    for k in range(STATES + (model.nkey > 0)):
        text += "state\n"
        if k < STATES:
            draw_state(model, data, rng)
        else:
            load_keyframe(path, model, data)
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_forward(model, data)
        q, v, found = data.qpos.copy(), data.qvel.copy(), {}
        for i in range(model.nu):
            name = model.joint(model.actuator_trnid[i, 0]).name
            if not is_off(model, i):
                found.setdefault(("u", name), []).append(data.ctrl[i])
        for j in range(model.njnt):
            name, kind = model.joint(j).name, model.jnt_type[j]
            a, d = model.jnt_qposadr[j], model.jnt_dofadr[j]
            coordinates = q[a : a + Q_COUNT[kind]].copy()
            rates, bias, acceleration = (
                x[d : d + V_COUNT[kind]].copy()
                for x in (v, data.qfrc_bias - data.qfrc_gravcomp, data.qacc_smooth)
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
        for s in range(model.nsite):
            text += line("site", model.site(s).name, data.site_xpos[s])
    (HERE / f"{path.stem}_reference.txt").write_text(text)


for robot in ("hand.urdf", "machine.xml", "meshes.xml", "kinds.xml", "models.xml", "servos.xml"):
    write(HERE / robot)
