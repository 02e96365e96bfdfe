# SPDX-License-Identifier: Apache-2.0
"""Stable grasp and insertion with gels on the pads: what clones by pictures learn and play.

    env = TASKS["insertion"](64, seed=1)

Gels are 3 mm thick with G = 30 kPa. A camera in each sees it in 4 × 4 pixels around every point of
the pad, with printed markers and without. Rules of thumb play both tasks from the flow of the pads.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Sequence

import numpy as np

import tangere

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from stable_grasp import DENSITIES, PADS, StableGrasp  # noqa: E402

POINTS = (13, 10)  # of a pad
FINE = 4  # pixels of a gel's picture along a point
EYE = (52, 60)  # pixels of the camera on the hand, a multiple of POINTS
KINDS = ("rgb", "rgb_marker")
GELS = {f"{pad.removesuffix('_pad')}.{kind}": f"{pad}.{kind}" for kind in KINDS for pad in PADS}


def with_gels(builder: tangere.SceneBuilder) -> None:
    """Adds gels with a camera to both pads."""
    for pad in (builder.sensor.find("tactile", name=name) for name in PADS):
        pad.markers(stiffness=22.5, thickness=0.003)
        rows, cols = (FINE * points for points in POINTS)
        pad.picture(rows=rows, cols=cols, noise=1.5, markers=(10, 13), marker_radius=4e-4)


def turning(flow: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Of flows (n, 4, 13, 10): the moment about the pads' axis (n) [spacing of points], the sum of
    what points up on each pad (n, 2), and the sum of squared distances from the axis."""
    up = np.array([1, -1])[:, None, None]  # rows of the left pad go up, of the right pad down
    fz, fy = up * flow[:, 0::2], -flow[:, 1::2]
    z = up * (np.arange(13) - 6)[:, None] * np.ones((1, 10))
    y = np.broadcast_to(4.5 - np.arange(10), z.shape)
    return (y * fz - z * fy).sum((1, 2, 3)), fz.sum((2, 3)), float((y**2 + z**2).sum())


class Grasp(StableGrasp):
    """Stable grasp with gels, and a camera on the hand. Pictures are of the lifted bar."""

    before = 0  #: rows of history that a clone observes
    pictures = {**GELS, "eye": "eye.rgb"}  #: KEY of an observation → reading
    fields = PADS + list(pictures.values())

    def restart(self, envs: Any) -> None:
        if not hasattr(self, "seen"):
            self.seen = {
                key: self._batch.tactile(name) for key, name in self.pictures.items()
                if name in self.fields
            }  # fmt: skip
        super().restart(envs)

    def lifted(self, run: Any, envs: Any) -> None:
        super().lifted(run, envs)
        for key, rows in self.seen.items():
            rows[envs] = run.fields[self.pictures[key]][0, envs].numpy()

    def observe(self) -> dict[str, Any]:
        return super().observe() | {key: rows.copy() for key, rows in self.seen.items()}

    @staticmethod
    def script(obs: dict[str, np.ndarray], *_: Any) -> np.ndarray:
        """The rule of the example."""
        moment, up, square = turning(obs["flow"])
        weight = up.sum(1) / 260
        away = 1.5e-3 * moment / (1.5e-3**2 * square) / np.where(weight == 0, np.inf, weight)
        return away[:, None] * 0.4545 * 0.018**2 / 0.05


def _grasp_scene() -> tangere.Scene:
    builder = tangere.SceneBuilder.from_file(tangere.scenes()["stable_grasp"])
    builder.randomize.clear()
    with_gels(builder)
    builder.sensor.camera(
        "eye", body="hand", pos=(0.12, 0, 0.02), look=(0, 0, -0.1), up=(0, 0, 1), fov=75,
        rows=EYE[0], cols=EYE[1], noise=1.5,
    )  # fmt: skip
    return builder.scene().vary(DENSITIES)


Grasp.scene = _grasp_scene()

DEGREE = np.pi / 180
OFF = np.array([6e-3, 6e-3, 10 * DEGREE])  # largest error at the start [m, m, rad]
ACT = np.array([0.02, 0.02, 10 * DEGREE])  # of an action, at most
HOLE = np.array([0.01975, 0.02725])  # half of its inner size [m]
APART = -0.0177  # position of the open fingers [m]
GRIPPED, AT_RIM, STEPS = 6, 44, 45  # steps of an attempt
# What an episode draws of both pads: name, range; SI units.
CONTACT = {"kn": (2e3, 14e3), "kt": (20, 140), "mu": (0.5, 2.5)}
SKIN = {"kn": (50, 450), "kt": (0.2, 2.3), "mu": (0.5, 2.5), "damping": (0, 100)}
SHIFT, TURN = 4.1e-3, 5 * DEGREE  # steps of the rule


def _names(pad: str) -> list[str]:
    return [f"contact {pad} box {n}" for n in CONTACT] + [f"tactile {pad} {n}" for n in SKIN]


def _insertion_scene() -> tangere.Scene:
    builder = tangere.SceneBuilder.from_file(tangere.scenes()["insertion"])
    builder.randomize.clear()
    with_gels(builder)
    for pad in (builder.sensor.find("tactile", name=name) for name in PADS):
        pad.imperfections(noise=1e-5)  # [N]
    return builder.scene().vary([name for pad in PADS for name in _names(pad)])


class Insertion(tangere.VectorSceneEnv):
    """The task insertion of the catalogue with gels: a box is moved and turned until it goes into
    the hole. Every attempt begins above the hole, and the pads are read when the box is gripped and
    when it stands on the rim. An action corrects x, y and yaw."""

    before = 4
    pictures = {key + when: name for when in ("", "_grip") for key, name in GELS.items()}
    fields = PADS + list(GELS.values())
    scene = _insertion_scene()
    steps_per_action, horizon, actions = STEPS, 14, 3
    warm_up = True
    touch, privileged = ("flow",), ("turned",)

    def restart(self, envs: Any) -> None:
        if not hasattr(self, "off"):
            n = self.num_envs
            self.off, self.turned = np.zeros((n, 3)), np.zeros(n)
            self.height, self.grip = np.zeros(n), np.zeros(n)
            self.flow = np.zeros((n, 4, *POINTS), np.float32)
            self.inside = np.zeros(n, bool)
            self.seen = {
                key: self.batch.tactile(name) for key, name in self.pictures.items()
                if name in self.fields
            }  # fmt: skip
        self.off[envs] = self.uniform(envs, -OFF, OFF)
        self.turned[envs] = 0
        self.height[envs] = self.uniform(envs, -0.01, 5e-3)
        self.grip[envs] = self.uniform(envs, 0.125, 0.8)
        low, high = np.array([*CONTACT.values(), *SKIN.values()]).T
        drawn = self.uniform(envs, low, high).T
        self.batch.set_randomized(
            {name: row for pad in PADS for name, row in zip(_names(pad), drawn, strict=True)}, envs
        )

    def controls(self, actions: np.ndarray) -> np.ndarray:  # hand x, y, z, turn; fingers
        self.next = self.off + ACT * actions
        u = np.zeros((STEPS, self.num_envs, 6))
        down = np.clip((np.arange(STEPS) - 4) / 18, 0, 1)
        u[..., [0, 1, 3]] = self.next
        u[..., 2] = self.height + (6e-3 - 12e-3 * down)[:, None]
        u[..., 4] = u[..., 5] = self.grip
        return u

    def simulate(self, controls: np.ndarray, envs: Any) -> None:
        self.turned[envs] += (self.next - self.off)[envs, 2]
        self.off[envs] = self.next[envs]
        self.batch.set_state(self.held(envs), np.zeros((len(envs), self.model.nv)), envs)
        shear = []
        for when, begin, end in (("_grip", 0, GRIPPED), ("", GRIPPED, AT_RIM)):
            run = self.batch.run(
                controls[begin:end], every=end - begin, fields=self.fields, envs=envs
            )
            shear.append(np.stack([run.fields[pad][0, envs, ..., :2] for pad in PADS], 1))
            for key, rows in self.seen.items():
                if key.endswith("_grip") == bool(when):
                    rows[envs] = run.fields[self.pictures[key]][0, envs]
        self.batch.run(controls[AT_RIM:], every=1, envs=envs)
        change = shear[1] - shear[0]  # (n, 2, rows, cols, 2)
        largest = np.hypot(change[..., 0], change[..., 1]).max((1, 2, 3))
        change /= np.where(largest > 1e-4, largest, np.inf)[:, None, None, None, None]
        self.flow[envs] = np.moveaxis(change, -1, 2).reshape(-1, 4, *POINTS)
        self.inside[envs] = self.is_inside()[envs]

    def held(self, envs: Any) -> np.ndarray:
        """(n, nq): the box between open fingers, 3 mm above the rim, off by self.off."""
        q = np.zeros((len(envs), self.model.nq))
        x, y, yaw = self.off[envs].T
        q[:, 0], q[:, 1], q[:, 2], q[:, 3] = x, y, self.height[envs], yaw
        q[:, 4] = q[:, 5] = APART
        q[:, 6], q[:, 7] = x - 0.004, y  # the scene's box is 4 mm off
        q[:, 9], q[:, 12] = np.cos(yaw / 2), np.sin(yaw / 2)
        return q

    def is_inside(self) -> np.ndarray:
        """(E): above the hole, and the highest corner of the lower face is below 24.7 mm."""
        x, y, z, w, a, b, c = self.batch.q[:, 6:13].T
        zx, zy, zz = 2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)
        highest = 0.058 + z + abs(zx) * 0.0175 + abs(zy) * 0.025 - zz * 0.03
        return (abs(x + 0.004) < HOLE[0]) & (abs(y) < HOLE[1]) & (highest < 0.0247)

    def observe(self) -> dict[str, Any]:
        pictures = {key: rows.copy() for key, rows in self.seen.items()}
        return {"flow": self.flow, "turned": self.turned[:, None]} | pictures

    def terminated(self) -> np.ndarray:
        return (self.lengths > 0) & self.inside

    def reward(self, actions: np.ndarray) -> np.ndarray:
        return np.where(self.inside, 10.0, -((self.off / OFF) ** 2).sum(1))

    @staticmethod
    def script(obs: dict[str, np.ndarray], _: Any, actions: np.ndarray) -> np.ndarray:
        """The rule of the catalogue: the rim loads one finger more than the other, and turns the
        box in the grip. A box that shows neither is turned."""
        moment, up, square = turning(obs["flow"])
        total = up.sum(1)
        apart = (up[:, 1] - up[:, 0]) / np.where(total > 0, total, np.inf)
        move = np.zeros((len(total), 3))
        for axis, sign, least in ((0, apart, 0.01), (1, 10 * moment / square, 0.04)):
            off = (total > 0) & (abs(sign) > least)
            move[off, axis] = -np.copysign(SHIFT, sign[off])
        turned = obs["turned"][:, 0]
        wanted = np.where(abs(turned) < 1e-6, TURN, np.where(turned > 0, -TURN, 0))
        turns = (move[:, :2] == 0).all(1) | (actions % 3 == 2)
        move[:, 2] = np.where(turns, wanted - turned, 0)
        return np.clip(move / ACT, -1, 1)


TASKS: dict[str, type[Grasp] | type[Insertion]] = {
    "stable_grasp": Grasp, "insertion": Insertion,
}  # fmt: skip


def keys(task: str) -> list[str]:
    """KEYs of the observations that clones of a task can have."""
    return ["flow", *TASKS[task].pictures]


def playing(task: str, shown: Sequence[str]) -> type[Grasp] | type[Insertion]:
    """The task as a class that reads nothing but what these observations need."""
    base = TASKS[task]
    read = [name for key, name in base.pictures.items() if key in shown]
    return type(base.__name__, (base,), {"fields": PADS + list(dict.fromkeys(read))})

