# SPDX-License-Identifier: Apache-2.0
"""Trains PPO of Stable-Baselines3 on stable grasps and plays what it learned in fresh episodes.

    python examples/ppo.py --steps 20000
"""

from __future__ import annotations

import argparse

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import tangere
import tangere.sb3

TASK = "stable_grasp"


def main(arguments: list[str] | None = None) -> float:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=20_000, help="actions to learn from")
    parser.add_argument("--episodes", type=int, default=320, help="fresh ones to play")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    torch.set_num_threads(1)  # the simulation has the cores

    env = VecMonitor(tangere.sb3.VecEnv(TASK, 32, seed=given.seed, flatten=True))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=256, seed=given.seed)
    model.learn(given.steps)

    # Episodes of another seed, each once, all side by side.
    fresh = tangere.make_vec(
        TASK, given.episodes, seed=1_000_003, flatten=True, autoreset="disabled"
    )
    obs, _ = fresh.reset()
    solved = over = np.zeros(given.episodes, bool)
    for _ in range(fresh.task.horizon):
        action, _ = model.predict(obs, deterministic=True)
        obs, _, terminated, truncated, info = fresh.step(action)
        solved, over = solved | info["success"], over | terminated | truncated
        if over.all():
            break
    print(f"{TASK}: {solved.mean():.3f} of {given.episodes} episodes solved")
    return float(solved.mean())


if __name__ == "__main__":
    main()
