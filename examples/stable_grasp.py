# SPDX-License-Identifier: Apache-2.0
"""The task stable_grasp of the catalogue, written in Python: lift a bar of unknown densities level.

    PYTHONPATH=build/release/python build/venv/bin/python examples/stable_grasp.py

An action moves the grasp along the bar. It is 180 targets of the hand: close, hold, lift, hold,
lower, hold, open. What the pads feel while they lift says where to grasp next. Plays 64 bars by a
rule that reads the turning of the bar from this shear, and prints how many it lifts level.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

import tangere

Array = NDArray[Any]

PADS, BLOCKS, STEPS, LIFTED = ["left_pad", "right_pad"], 11, 180, 60
DENSITIES = [f"body block_{b} density" for b in range(BLOCKS)]


def ramp(first: int, length: int) -> Array:
    """(STEPS): 0 before step `first`, 1 from step first + length on, linear in between."""
    return np.clip((np.arange(1, STEPS + 1) - first) / length, 0, 1)


def scene() -> tangere.Scene:
    """The scene, in which nothing varies but the densities of the blocks."""
    builder = tangere.SceneBuilder.from_file(tangere.scenes()["stable_grasp"])
    builder.randomize.clear()
    return builder.scene().vary(DENSITIES)


class StableGrasp(tangere.VectorSceneEnv):
    scene = scene()
    steps_per_action, horizon, actions = STEPS, 9, 1
    warm_up = True  # a first grasp at the middle
    touch = ("flow",)

    moved, lift = ramp(0, 10), 0.03 * (ramp(30, 50) - ramp(100, 50))  # [1], [m]
    fingers = -0.025 * (1 - ramp(10, 10) + ramp(160, 20))  # [m]

    def restart(self, envs: Array) -> None:
        if not hasattr(self, "place"):
            self.place, self.rest = np.zeros((2, self.num_envs))  # of the grasp, of the bar [m]
            self.flow = np.zeros((self.num_envs, 4, 13, 10), np.float32)
            self.tilt, self.height = np.zeros((2, self.num_envs))  # while lifted [rad], [m]
        self.place[envs] = 0
        densities = dict(zip(DENSITIES, self.densities(envs).T, strict=True))
        q = self.batch.q[envs]
        q[:, 1] = 0
        self.batch.set_randomized(densities, envs)
        settling = tangere.Batch(self.model, len(envs), threads=self.batch.threads, timestep=0.05)
        settling.set_randomized(densities)
        settling.set_state(q, np.zeros((len(envs), self.model.nv)))
        settling.run(np.tile([0, 0, 0, 0, -0.025, -0.025], (50, len(envs), 1)))
        self.batch.set_state(settling.q, settling.v, envs)

    def densities(self, envs: Array) -> Array:
        """(n, BLOCKS) [kg/m³] of bars that balance somewhere between the second and the last but
        one block: both sides have the same moment about that place."""
        centre, density, total = self.uniform(envs, [1, 600, 3000], [BLOCKS - 1, 700, 7000]).T
        share = self.uniform(envs, [0.1] * BLOCKS, 1.1)
        block = np.arange(BLOCKS)
        side = np.sign(block - centre[:, None].astype(int))  # -1: right
        arms = abs(block + 0.5 - centre[:, None])
        arm = []
        for s in (-1, 1):
            share /= np.where(side == s, (share * (side == s)).sum(1, keepdims=True), 1)
            arm.append((share * arms * (side == s)).sum(1))
        rest, offset = total - density, centre % 1 - 0.5
        right = (rest * arm[1] - density * offset) / (arm[0] + arm[1])
        sums = np.where(side < 0, right[:, None], (rest - right)[:, None])
        return np.where(side == 0, density[:, None], share * sums)

    def controls(self, actions: Array) -> Array:  # hand x, y, z, turn; fingers
        place = np.clip(self.place + 0.05 * actions[:, 0], -0.11, 0.11)
        u = np.zeros((STEPS, self.num_envs, 6))
        u[..., 1] = self.place + self.moved[:, None] * (place - self.place)
        u[..., 2], u[..., 4:] = self.lift[:, None], self.fingers[:, None, None]
        return u

    def simulate(self, controls: Array, envs: Array) -> None:
        begins = envs[self.lengths[envs] == 0]
        self.rest[begins] = self.batch.q[begins, -5]
        run = self.batch.run(controls, every=LIFTED, fields=PADS, envs=envs)
        shear = np.stack([run.fields[pad][0, envs, ..., :2] for pad in PADS], 1)
        largest = np.sqrt((shear**2).sum(-1).max((1, 2, 3)))[:, None, None, None, None]
        flow = np.where(largest > 1e-6, shear / np.maximum(largest, 1e-6), 0)
        self.flow[envs] = np.moveaxis(flow, -1, 2).reshape(-1, 4, 13, 10)
        w, x, y, z = run.q[0, envs, -4:].T
        self.tilt[envs] = abs(np.arcsin(np.clip(2 * (y * z + w * x), -1, 1)))
        self.height[envs] = run.q[0, envs, -5]
        self.place[envs] = controls[-1, envs, 1]

    def observe(self) -> dict[str, Array]:
        return {"flow": self.flow}

    def terminated(self) -> Any:
        return (self.lengths > 0) & (self.tilt < 0.02) & (self.height - self.rest > 5e-3)

    def reward(self, actions: Array) -> Array:
        return np.where(self.terminated(), 100, -10 * self.tilt)

    def turning(self) -> Any:
        """(E, 1) the action towards the heavier side: shear is proportional to the velocity of the
        bar in the grip, so the centre of mass is ω/v Σ r²/n away."""
        up = np.array([1, -1])[:, None, None]  # rows of the left pad go up, of the right pad down
        fz, fy = up * self.flow[:, 0::2], -self.flow[:, 1::2]
        z = up * (np.arange(13) - 6)[:, None] * 1.5e-3
        y = np.broadcast_to((4.5 - np.arange(10)) * 1.5e-3, z.shape[:1] + (13, 10))
        moment, weight = ((y * fz - z * fy).sum((1, 2, 3)), fz.mean((1, 2, 3)))
        away = moment / (y**2 + z**2).sum() / np.where(weight == 0, np.inf, weight)
        return away[:, None] * 0.4545 * 0.018**2 / 0.05


if __name__ == "__main__":
    env = StableGrasp(64, seed=1, autoreset="disabled")
    env.reset()
    for _ in range(env.horizon):
        info = env.step(env.turning())[-1]
    grasps = env.lengths.mean()
    print(f"{info['success'].sum()} of {env.num_envs} bars lifted level, {grasps:.2f} grasps each")
