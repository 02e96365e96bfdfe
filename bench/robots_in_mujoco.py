# SPDX-License-Identifier: Apache-2.0
"""Compares the scene of an imported robot with what MuJoCo makes of the same file.

Both are put into the same random states with the same forces of motors, and their accelerations are
compared. Contacts, limits, constraints, tendons, fluids and actuators that the scene does not have
are off in MuJoCo, limits are off in the scene. Joints are matched by their order in MJCF and by
name in URDF.
"""

import re
import xml.etree.ElementTree as tree
from pathlib import Path

import mujoco
import numpy as np

import tangere

FREE, BALL, SLIDE, HINGE = range(4)
TYPES = {FREE: "free3d", BALL: "spherical", SLIDE: "prismatic", HINGE: "revolute"}
Q_COUNT = {FREE: 7, BALL: 4, SLIDE: 1, HINGE: 1}
V_COUNT = {FREE: 6, BALL: 3, SLIDE: 1, HINGE: 1}
STATES = 3
STEPS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # s; an acceleration is the change of speed in a step
CLOSE = 1e-4  # of the largest acceleration
CLOSE_MASS = 1e-5  # MuJoCo keeps vertices in single precision


def load(path: Path) -> mujoco.MjModel:
    """Reads a file as MuJoCo does, URDF without its shapes, which have no mass there."""
    if path.suffix.lower() != ".urdf":
        return mujoco.MjModel.from_xml_path(str(path))
    root = tree.parse(path).getroot()
    for link in root.iter("link"):
        for part in [p for p in link if p.tag in ("visual", "collision")]:
            link.remove(part)
    for extra in root.findall("mujoco"):
        root.remove(extra)
    tree.SubElement(tree.SubElement(root, "mujoco"), "compiler", fusestatic="false")
    return mujoco.MjModel.from_xml_string(tree.tostring(root, encoding="unicode"))


def attributes(text: str, element: str) -> list[dict[str, str]]:
    return [
        dict(re.findall(r'(\w+)="([^"]*)"', words))
        for words in re.findall(f"<{element} ([^>]*)/>", text)
    ]


def silence(model: mujoco.MjModel) -> None:
    """Switches off what scenes do not have."""
    for flag in ("CONSTRAINT", "CONTACT", "LIMIT", "EQUALITY", "FRICTIONLOSS", "CLAMPCTRL"):
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, "mjDSBL_" + flag)
    model.opt.density = model.opt.viscosity = 0
    model.opt.wind[:] = 0
    if model.ntendon:
        model.tendon_stiffness[:] = model.tendon_damping[:] = model.tendon_armature[:] = 0


class Pair:
    """One robot on both sides."""

    def __init__(self, model: mujoco.MjModel, text: str, name: str, urdf: bool) -> None:
        self.theirs, self.data = model, mujoco.MjData(model)
        silence(model)
        if "gravity_share" not in text:
            model.body_gravcomp[:] = 0
        text = re.sub(r' lim(_stiffness)?="[^"]*"', "", text)
        text = re.sub(r"<initial>.*?</initial>", "", text, flags=re.S)
        self.ours = tangere.Model(tangere.Scene.from_string(text, name))
        joints = [j for j in attributes(text, "joint") if j.get("type", "fixed") != "fixed"]
        names = [model.joint(j).name for j in range(model.njnt)]
        types = [TYPES[int(t)] for t in model.jnt_type]
        self.order = list(range(model.njnt))
        if urdf and sorted(j["name"] for j in joints) == sorted(names):
            self.order = [names.index(j["name"]) for j in joints]
        self.matched = [j["type"] for j in joints] == [types[j] for j in self.order]
        if not self.matched:
            return
        index = {j["name"]: self.order[k] for k, j in enumerate(joints)}
        self.motors = [m | {"index": index[m["joint"]]} for m in attributes(text, "motor")]
        self.batches = [
            tangere.Batch(self.ours, 1, timestep=h, tolerance=1e-13, threads=1) for h in STEPS
        ]

    def draw(self, rng: np.random.Generator) -> None:
        """Puts MuJoCo into a random state."""
        model, data = self.theirs, self.data
        mujoco.mj_resetData(model, data)
        data.qvel[:] = 0.3 * rng.normal(size=model.nv)
        for kind, a in zip(model.jnt_type, model.jnt_qposadr, strict=True):
            if kind in (HINGE, SLIDE):
                data.qpos[a] = model.qpos0[a] + (0.4 if kind == HINGE else 0.03) * rng.normal()
                continue
            if kind == FREE:
                data.qpos[a : a + 3] = rng.normal(size=3)
                a += 3
            data.qpos[a : a + 4] = rng.normal(size=4)
        mujoco.mj_normalizeQuat(model, data.qpos)

    def drive(self, rng: np.random.Generator) -> np.ndarray:
        """Draws controls, which are the same on both sides."""
        model, u, used = self.theirs, np.zeros(len(self.motors)), set()
        for k, motor in enumerate(self.motors):
            joint = motor["index"]
            i = next(
                i
                for i in range(model.nu)
                if i not in used
                and model.actuator_trntype[i] in (0, 1)
                and model.actuator_trnid[i, 0] == joint
            )
            used.add(i)
            low, high = (float(x) for x in motor.get("u_range", "-0.3 0.3").split())
            self.data.ctrl[i] = u[k] = rng.uniform(max(low, -1e3), min(high, 1e3))
        for i in set(range(model.nu)) - used:
            model.actuator_gainprm[i] = model.actuator_biasprm[i] = 0
            model.actuator_gaintype[i] = model.actuator_biastype[i] = 0
        return u

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns MuJoCo's coordinates, rates and accelerations as the scene has them."""
        model, data, q, v, acceleration = self.theirs, self.data, [], [], []
        for j in self.order:
            kind, a, d = int(model.jnt_type[j]), model.jnt_qposadr[j], model.jnt_dofadr[j]
            own = data.qpos[a : a + Q_COUNT[kind]].copy()
            rates = [x[d : d + V_COUNT[kind]].copy() for x in (data.qvel, data.qacc_smooth)]
            if kind in (HINGE, SLIDE):
                own -= model.qpos0[a]
            if kind == FREE:  # seen from where it starts
                body = model.jnt_bodyid[j]
                back = model.body_quat[body] * [1, -1, -1, -1]
                turned = np.zeros(4)
                mujoco.mju_mulQuat(turned, back, own[3:])
                moved = own[:3] - model.body_pos[body]
                own[3:] = turned
                for out, vector in ((own, moved), *((x, x[:3].copy()) for x in rates)):
                    place = np.zeros(3)
                    mujoco.mju_rotVecQuat(place, vector, back)
                    out[:3] = place
            q.append(own)
            v.append(rates[0])
            acceleration.append(rates[1])
        return np.concatenate(q), np.concatenate(v), np.concatenate(acceleration)

    def error(self, rng: np.random.Generator) -> float:
        """Returns how far accelerations differ in a random state, over the largest."""
        self.draw(rng)
        u = self.drive(rng)
        mujoco.mj_forward(self.theirs, self.data)
        q, v, theirs = self.state()
        changes = []
        for batch, step in zip(self.batches, STEPS, strict=True):
            batch.reset()
            batch.set_state(q[None], v[None])
            batch.step(u[None])
            changes.append((batch.v[0] - v) / step)
        # Two steps of which one is a tenth of the other: what is linear in the step cancels. A long
        # step has errors of higher order, a short one rounding; the best counts.
        return min(
            float(np.max(np.abs(short + (short - long) / 9 - theirs)))
            for long, short in zip(changes, changes[1:], strict=False)
        ) / max(1.0, float(np.max(np.abs(theirs))))


def refusal(path: Path) -> str:
    """Returns why MuJoCo does not read a file, or nothing."""
    try:
        load(path)
    except (ValueError, tree.ParseError) as error:
        return str(error).splitlines()[0][:100]
    return ""


def compare(path: Path, text: str, name: str) -> list[str]:
    """Returns how a scene differs from MuJoCo's model: "the same" alone if it does not."""
    if why := refusal(path):
        return [f"MuJoCo refuses the file: {why}"]
    pair = Pair(load(path), text, name, path.suffix.lower() == ".urdf")
    if not pair.matched:
        return ["other joints"]
    found = []
    mass = sum(pair.ours.mass(i) for i in range(len(pair.ours.body_names)))
    if not np.isclose(mass, np.sum(pair.theirs.body_mass), rtol=CLOSE_MASS):
        found.append("another mass")
    rng = np.random.default_rng(1)
    if not max(pair.error(rng) for _ in range(STATES)) < CLOSE:
        found.append("other accelerations")
    return found or ["the same"]
