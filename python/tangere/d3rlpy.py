# SPDX-License-Identifier: Apache-2.0
"""Data sets of `tangere generate` for d3rlpy, and its policies in closed loop.

    buffer = tangere.d3rlpy.replay_buffer("out/mixed")
    algorithm = d3rlpy.algos.IQLConfig().create()
    algorithm.fit(buffer, n_steps=10000)
    tangere.d3rlpy.play(algorithm, "box_pushing")

Needs d3rlpy and h5py. An observation is one vector: that of `tangere.make_vec(task,
flatten=True)`, divided by the scales of the task.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Sequence

import numpy as np
from d3rlpy.dataset import Episode, InfiniteBuffer, ReplayBuffer

from . import _core, gym
from ._closed_loop import TEST_SEED, play_episodes
from .data import Episodes, _none_left
from .scene_env import VectorSceneEnv

__all__ = ["play", "replay_buffer"]


def replay_buffer(
    data: str | Path | Episodes, *, keys: Sequence[str] | None = None, mask: str | None = None
) -> ReplayBuffer:
    """The episodes of a data set, in memory as float32.

    Parameters
    ----------
    data: a folder of `tangere generate`, one of its files, or an `Episodes`.
    keys: observations to join, in this order. None: all but the privileged ones.
    mask: a mask of robomimic.hdf5, such as "train"; None for all episodes.

    An episode that ran out of time is truncated: d3rlpy learns from all of its rows but the last.
    Raises InputError for unknown names and for a data set without episodes.
    """
    episodes = data if isinstance(data, Episodes) else Episodes(data)
    keys = _keys(episodes.keys, episodes.privileged, keys, str(episodes.path))
    chosen = range(len(episodes)) if mask is None else episodes.mask(mask)
    stored = []
    for index in (i for i in chosen if episodes.lengths[i]):
        arrays = episodes[index]
        rows = len(arrays["actions"])
        parts = [
            (arrays[key] / np.asarray(episodes.scale[key], np.float32)).reshape(rows, -1)
            for key in keys
        ]
        stored.append(
            Episode(
                np.concatenate(parts, axis=1).astype(np.float32),
                np.array(arrays["actions"], np.float32).reshape(rows, -1),
                np.array(arrays["rewards"], np.float32)[:, None],
                episodes.terminated(index),
            )
        )
    if not stored:
        raise _none_left(episodes, mask, False, "learn from")
    return ReplayBuffer(InfiniteBuffer(), episodes=stored)


def play(
    algorithm: Any, task: str | type[VectorSceneEnv], episodes: int = 300, *,
    keys: Sequence[str] | None = None, readings: Sequence[str] = (), seed: int = TEST_SEED,
    num_envs: int = 64, threads: int | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Plays fresh episodes of a task by whatever has d3rlpy's `predict(observations)`.

    task: a name of `tangere.task_names()`, or a class of `tangere.VectorSceneEnv`.
    keys: those of the replay buffer. readings: those of them that sensors give beside what the
        task observes, as in `tangere.make_vec`: "pad.sum", "pad/1".
    seed: of the episodes; not that of the data set.

    Returns "task", "seed", "episodes", "successes", "success_rate", the bounds of its 95 % interval
    after Wilson in "interval", "mean_return" and "mean_actions".
    """
    if episodes < 1 or num_envs < 1:
        raise _core.InputError(f"episodes {episodes}, num_envs {num_envs}; expected at least 1")
    env: Any
    if isinstance(task, type) and issubclass(task, VectorSceneEnv):
        env, name = task(min(num_envs, episodes), threads=threads), task.__name__
        known, hidden = [*env._shapes], ["q", "v", *task.privileged]
    elif isinstance(task, str):
        seen, name = _core.task_spec(task).observations, task
        known = [tensor.name for tensor in seen]
        hidden = [tensor.name for tensor in seen if tensor.privileged]
        env = gym.make_vec(task, min(num_envs, episodes), threads=threads, readings=readings)
        known += [word.partition("/")[0] for word in readings]
    else:
        raise _core.InputError(
            f"task {task!r}; expected the name of a task, or a class of tangere.VectorSceneEnv"
        )
    keys = _keys(known, hidden, keys, f"task {name!r}")

    def choose(obs: dict[str, np.ndarray]) -> Any:
        rows = [obs[key].reshape(env.num_envs, -1) for key in keys]
        return algorithm.predict(np.concatenate(rows, axis=1))

    found = play_episodes(env, choose, lambda: None, episodes, seed)
    return {"task": name, "seed": seed} | found


def _keys(
    known: Sequence[str], hidden: Sequence[str], keys: Sequence[str] | None, where: str
) -> list[str]:
    chosen = [key for key in known if key not in hidden] if keys is None else list(keys)
    unknown = [key for key in chosen if key not in known]
    if unknown or not chosen:
        raise _core.InputError(f"keys {unknown}; {where} has {list(known)}")
    return chosen
