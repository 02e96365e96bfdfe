# SPDX-License-Identifier: Apache-2.0
"""The task ball_rolling_small of the catalogue, written in Python."""

from __future__ import annotations

import numpy as np

import tangere

NAME = "ball_rolling_small"


class BallRolling(tangere.VectorSceneEnv):
    """Computes with NumPy, or with PyTorch in a subclass with arrays = "torch"."""

    scene = tangere.scenes()["rolling_ball_small"]
    steps_per_action, horizon = 5, 8

    def restart(self, envs):
        place = self.batch.q[:, 3:5]
        if not hasattr(self, "goal"):
            self.goal = 0 * place
        self.goal[envs] = place[envs] + self._given(self.drawn_goals(envs))

    def drawn_goals(self, envs):
        """(n, 2) of the environments, from where the balls start [m]."""
        return self.uniform(envs, [-0.01] * 2, 0.01)

    def distance(self):
        return self.goal - self.batch.q[:, 3:5]

    def observe(self):
        pad = self.batch.q[:, :3]
        return {"pad": pad, "goal": self.distance(), "tactile": self.batch.tactile("pad")}

    def reward(self, actions):
        return -(self.distance() ** 2).sum(1) / 1e-4 - 0.01 * (actions**2).sum(1)


def uniform_actions(count, envs):
    return np.random.default_rng(1).uniform([-1, -1, -1], [1, 1, 0], (count, envs, 3))
