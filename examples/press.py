# SPDX-License-Identifier: Apache-2.0
"""Presses a pad of 32 × 32 tactile points onto a ball in 16 environments, reads it and draws it."""

import numpy as np

import tangere

model = tangere.Model(tangere.Scene(tangere.scenes()["rolling_ball_small"]))
batch = tangere.Batch(model, num_envs=16, seed=1)
force = np.zeros((200, 16, model.nu))  # x, y, z for 1 s [N]
force[:, :, 2] = np.linspace(0, -0.5, 16)  # from no push to 0.5 N down
run = batch.run(force, every=10, fields=["pad", "pad.sum"])
pressed = run.fields["pad"][-1, ..., 2]  # (16, 32, 32) [N]
print("push down    [N]", *(f"{-f:.2f}" for f in force[0, ::3, 2]))
print("sensor reads [N]", *(f"{f:.2f}" for f in abs(pressed[::3]).sum((1, 2))))
for row in abs(pressed[-1])[8:24:2, 4:28]:
    print("".join(" .:-=+*#%@"[int(9.99 * f / abs(pressed[-1]).max())] for f in row))
