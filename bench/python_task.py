# SPDX-License-Identifier: Apache-2.0
"""Steps of 1024 environments: a task written in Python against its C++ brother, on one thread.

    PYTHONPATH=build/release/python build/venv/bin/python bench/python_task.py

Alternates between the two on equal work: `ball_rolling_small`, with a field of 32 × 32 points in
every observation. Prints CPU milliseconds of both and their ratio.
"""

import time

import numpy as np

import tangere

ENVS = 1024


class Rolling(tangere.VectorSceneEnv):
    scene = tangere.scenes()["rolling_ball_small"]
    steps_per_action, horizon = 5, 70

    def restart(self, envs):
        if not hasattr(self, "goal"):
            self.goal = np.zeros((self.num_envs, 2))
        self.goal[envs] = self.batch.q[envs, 3:5] + self.uniform(envs, [-0.01] * 2, 0.01)

    def observe(self):
        q = self.batch.q
        field = self.batch.tactile("pad")
        return {"pad": q[:, :3], "goal": self.goal - q[:, 3:5], "tactile": field}

    def reward(self, actions):
        distance = self.goal - self.batch.q[:, 3:5]
        return -(distance**2).sum(1) / 1e-4 - 0.01 * (actions**2).sum(1)


def cpu(env, actions) -> float:
    begin = time.process_time()
    env.step(actions)
    return 1e3 * (time.process_time() - begin)


ours = Rolling(ENVS, threads=1, seed=1)
theirs = tangere.make_vec("ball_rolling_small", ENVS, threads=1, seed=1)
ours.reset(), theirs.reset()
times = []
for _ in range(60):
    actions = np.random.default_rng(len(times)).uniform(-0.3, 0.1, (ENVS, 3))
    times.append((cpu(ours, actions), cpu(theirs, actions)))
mine, brother = np.median(times[20:], axis=0)  # pads touch
print(f"Python {mine:.2f} ms, C++ {brother:.2f} ms: {brother / mine:.2f} of its rate")
