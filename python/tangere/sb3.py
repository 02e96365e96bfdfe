# SPDX-License-Identifier: Apache-2.0
"""Tasks as a vector environment of Stable-Baselines3.

    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    env = VecMonitor(tangere.sb3.VecEnv("box_pushing", 64, seed=1))
    PPO("MultiInputPolicy", env).learn(1_000_000)

Needs Stable-Baselines3 (`pip install stable-baselines3`). All environments are stepped by one
call in C++, so there is nothing to gain from its SubprocVecEnv.
"""

from __future__ import annotations

from typing import Any, Sequence

import numpy as np
from stable_baselines3.common.vec_env import VecEnv as BaseVecEnv

from . import _core
from ._vector_env import Observation, checked_seed
from .gym import VectorTaskEnv
from .scene_env import VectorSceneEnv


class VecEnv(BaseVecEnv):  # type: ignore[misc]
    """Environments of one task with the interface of `stable_baselines3.common.vec_env.VecEnv`.

    The end of an episode shows the start of the next one at once. The `info` of an environment
    whose episode has ended has "terminal_observation", "TimeLimit.truncated" (the episode ran out
    of time or its simulation failed), "is_success", "episode_id" and "status"; every other `info`
    is empty. Rewards are float32, as the library's own environments give them.

    Parameters
    ----------
    task: a name of `tangere.task_names()`, or a subclass of `tangere.VectorSceneEnv`.
    num_envs: E.
    arguments: those of `tangere.VectorTaskEnv` or of the subclass, such as threads, seed, flatten.
        With `flatten=True` observations are one array, for "MlpPolicy".
    """

    def __init__(self, task: str | type[VectorSceneEnv], num_envs: int, **arguments: Any):
        if "autoreset" in arguments:
            raise _core.InputError(
                f"autoreset {arguments['autoreset']!r}; Stable-Baselines3 has same_step alone"
            )
        self.env = (
            VectorTaskEnv(task, num_envs, autoreset="same_step", **arguments)
            if isinstance(task, str)
            else task(num_envs, autoreset="same_step", **arguments)
        )
        self._seed: int | None = None
        self._actions: np.ndarray | None = None
        super().__init__(
            num_envs, self.env.single_observation_space, self.env.single_action_space
        )

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """The seed of the next reset: environment e starts with episode `first_episode` + e of it.

        None: the next reset goes on with the next episodes.
        """
        self._seed = None if seed is None else checked_seed(seed)
        return [self._seed] * self.num_envs

    def set_options(self, options: Any = None) -> None:
        """Raises InputError if there are any: a reset has no options."""
        if options:
            raise _core.InputError(f"options {options!r}; expected none")

    def reset(self) -> Observation:
        """Starts an episode of every environment and returns the observations."""
        seed, self._seed = self._seed, None
        obs, info = self.env.reset(seed=seed)
        self.reset_infos = [{"episode_id": int(e)} for e in info["episode_id"]]
        return obs

    def step_async(self, actions: np.ndarray) -> None:
        """Keeps actions, (E, na), for `step_wait`."""
        self._actions = np.asarray(actions)

    def step_wait(self) -> tuple[Observation, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Takes the actions. Returns observations, rewards (E), dones (E) bool and infos."""
        if self._actions is None:
            raise _core.InputError("step_wait() without step_async(); call that first")
        obs, reward, terminated, truncated, info = self.env.step(self._actions)
        self._actions = None
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for e in np.flatnonzero(done):
            final = info["final_info"]
            infos[e] = {
                "terminal_observation": info["final_obs"][e],
                "TimeLimit.truncated": bool(truncated[e] and not terminated[e]),
                "is_success": bool(final["success"][e]),
                "episode_id": int(final["episode_id"][e]),
                "status": int(final["status"][e]),
            }
            self.reset_infos[e] = {"episode_id": int(info["episode_id"][e])}
        return obs, reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Nothing is left to close."""
        self.env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of every environment, as `render_mode="rgb_array"` gives it; None without."""
        return self.env.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the vector environment, which is the same for every environment."""
        value = getattr(self.env, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Always raises InputError: the environments have no attributes of their own."""
        raise _core.InputError(f"attribute {attr_name!r}; environments have none of their own")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Always raises InputError: see `env` for the methods of all environments together."""
        raise _core.InputError(
            f"method {method_name!r}; environments have none of their own, use .env.{method_name}"
        )

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """False for each: no environment is an object of its own."""
        return [False for _ in self._get_indices(indices)]
