# SPDX-License-Identifier: Apache-2.0
"""Fresh episodes of a vector environment, and what they came to: Wilson's 95 % interval of the rate
p of successes among n is

    (p + z²/2n ± z √(p(1-p)/n + z²/4n²)) / (1 + z²/n),   z = 1.96
"""

from __future__ import annotations

import math
from typing import Any, Callable

import numpy as np

TEST_SEED = 1000003  # of episodes that policies are tested on; no data set is made with it


def play_episodes(
    env: Any, choose: Callable[[Any], Any], start: Callable[[], None], episodes: int, seed: int
) -> dict[str, Any]:
    """Plays the first episodes of a seed, as many at once as the environment has.

    choose: observations, as the environment shows them, to actions (E, na).
    start: is called before the first action of episodes.
    """
    played = []
    for first in range(0, episodes, env.num_envs):
        obs, _ = env.reset(seed=seed, options={"first_episode": first})
        start()
        over, solved = np.zeros((2, env.num_envs), bool)
        returns, actions = np.zeros(env.num_envs), np.zeros(env.num_envs, int)
        while not over.all():  # where an episode is over, others follow that do not count
            obs, reward, terminated, truncated, info = env.step(choose(obs))
            returns += np.where(over, 0, reward)
            actions += ~over
            solved |= ~over & info["success"]
            over |= terminated | truncated
        played.append((solved, returns, actions))
    return success_summary(*(np.concatenate(part)[:episodes] for part in zip(*played)))


def success_summary(solved: Any, returns: Any, actions: Any) -> dict[str, Any]:
    """Of n episodes, each (n): whether it was solved, its return, how many actions it took."""
    episodes, successes, z = len(solved), int(np.sum(solved)), 1.96
    rate = successes / episodes
    middle = rate + z * z / (2 * episodes)
    half = z * math.sqrt(rate * (1 - rate) / episodes + z * z / (4 * episodes**2))
    scale = 1 + z * z / episodes
    return {
        "episodes": episodes,
        "successes": successes,
        "success_rate": rate,
        "interval": [(middle - half) / scale, (middle + half) / scale],
        "mean_return": float(np.mean(returns)),
        "mean_actions": float(np.mean(actions)),
    }
