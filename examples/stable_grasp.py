# SPDX-License-Identifier: Apache-2.0
"""The task stable_grasp of the catalogue, written in Python: lift a bar of unknown densities level.

    PYTHONPATH=build/release/python build/venv/bin/python examples/stable_grasp.py

An action moves the grasp along the bar. It is 180 targets of the hand: close, hold, lift, hold,
lower, hold, open. What the pads feel while they lift says where to grasp next. Plays 64 bars by a
rule that reads the turning of the bar from this shear, and prints how many it lifts level. The task
computes with tensors, so a policy is also trained through time (tangere.torch.EnvTape). It needs
PyTorch.
"""

from typing import Any

import numpy as np
import torch
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
    touch, arrays = ("flow",), "torch"
    fields = PADS  # that are read while the bar is lifted

    moved = torch.from_numpy(ramp(0, 10))[:, None]
    lift = torch.from_numpy(0.03 * (ramp(30, 50) - ramp(100, 50)))[:, None]  # [m]
    fingers = torch.from_numpy(-0.025 * (1 - ramp(10, 10) + ramp(160, 20)))[:, None, None]  # [m]

    def restart(self, envs: Array) -> None:
        if not hasattr(self, "place"):
            zeros = torch.zeros(self.num_envs, dtype=torch.float64)
            self.place, self.rest = zeros, zeros  # of the grasp, of the bar [m]
            self.flow = torch.zeros(self.num_envs, 4, 13, 10)
            self.tilt, self.height = zeros, zeros  # while lifted [rad], [m]
        self.keep(envs, place=torch.zeros(len(envs), dtype=torch.float64))
        densities = dict(zip(DENSITIES, self.densities(envs).T, strict=True))
        q = self.batch.q[envs].numpy()
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

    def controls(self, actions: torch.Tensor) -> torch.Tensor:  # hand x, y, z, turn; fingers
        place = torch.clamp(self.place + 0.05 * actions[:, 0], -0.11, 0.11)
        along = (self.place + self.moved * (place - self.place))[..., None]
        still, count = torch.zeros_like(along), self.num_envs
        lift, fingers = self.lift.expand(-1, count)[..., None], self.fingers.expand(-1, count, 2)
        return torch.cat([still, along, lift, still, fingers], 2)

    def simulate(self, controls: torch.Tensor, envs: Array) -> None:
        begins = envs[self.lengths[envs] == 0]
        self.keep(begins, rest=self.batch.q[begins, -5])
        run = self.batch.run(controls, every=LIFTED, fields=self.fields, envs=envs)
        self.keep(envs, place=controls[-1, envs, 1])
        self.lifted(run, envs)

    def lifted(self, run: Any, envs: Array) -> None:
        """Takes what is felt while the bar is lifted: the first frame."""
        shear = torch.stack([run.fields[pad][0, envs, ..., :2] for pad in PADS], 1)
        largest = shear.square().sum(-1).amax((1, 2, 3)).clamp(min=1e-12).sqrt()
        largest = largest[:, None, None, None, None]
        flow = torch.where(largest > 1e-6, shear / largest, torch.zeros_like(shear))
        w, x, y, z = run.q[0, envs, -4:].unbind(1)
        self.keep(
            envs,
            flow=flow.moveaxis(-1, 2).reshape(-1, 4, 13, 10),
            tilt=torch.asin(torch.clamp(2 * (y * z + w * x), -1, 1)).abs(),
            height=run.q[0, envs, -5],
        )

    def keep(self, envs: Array, **rows: torch.Tensor) -> None:
        """Sets rows of tensors of the task, with their gradients."""
        for name, of_envs in rows.items():
            all_rows = getattr(self, name).to(of_envs.dtype)
            setattr(self, name, all_rows.index_put((torch.from_numpy(envs),), of_envs))

    def observe(self) -> dict[str, torch.Tensor]:
        return {"flow": self.flow}

    def terminated(self) -> Any:
        lifted = (self.tilt < 0.02) & (self.height - self.rest > 5e-3)
        return torch.from_numpy(self.lengths > 0) & lifted

    def reward(self, actions: torch.Tensor) -> torch.Tensor:
        return torch.where(self.terminated(), torch.full_like(self.tilt, 100), -10 * self.tilt)

    def turning(self) -> Any:
        """(E, 1) the action towards the heavier side: shear is proportional to the velocity of the
        bar in the grip, so the centre of mass is ω/v Σ r²/n away."""
        up = np.array([1, -1])[:, None, None]  # rows of the left pad go up, of the right pad down
        felt = self.flow.numpy()
        fz, fy = up * felt[:, 0::2], -felt[:, 1::2]
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
